// Units of lights, and what they own.
#include <math.h>

#include "renderer/scene/asset.h"
#include "renderer/scene/light_table.h"

// Solid angle that the flux of a light of intensity 1 fills, far away: docs/internals/light.md.
static double solid_angle(const struct hg_light *light)
{
    const double inner = cos((double)light->inner_cone_rad),
                 outer = cos((double)light->outer_cone_rad);
    switch (light->kind) {
    case HG_LIGHT_POINT:
        return light->profile ? (double)light->profile->solid_angle : 4 * M_PI;
    case HG_LIGHT_SPOT: // its cone falls off by the square of a line from `inner` to `outer`
        return 2 * M_PI * ((1 - inner) + (inner - outer) / 3);
    case HG_LIGHT_RECTANGLE:
    case HG_LIGHT_DISC:
        return M_PI;
    case HG_LIGHT_TUBE:
        return M_PI * M_PI;
    default:
        return 0;
    }
}

float hg_light_peak(const struct hg_light *light)
{
    const double angle = light->lumens > 0 ? solid_angle(light) : 0;
    if (angle > 0)
        return (float)((double)light->lumens / angle);
    if (light->profile && light->absolute)
        return light->intensity * light->profile->peak_cd;
    return light->intensity;
}

enum hg_status hg_light_set_texture(
    struct hg_light *light, struct hg_texture *texture, struct hg_error *err)
{
    struct hg_light_table *image = NULL;
    enum hg_status status = texture ? hg_light_image_create(texture, &image, err) : HG_OK;
    if (status)
        return status;
    hg_light_table_unref(light->image);
    light->image = image;
    light->texture = texture;
    return HG_OK;
}
