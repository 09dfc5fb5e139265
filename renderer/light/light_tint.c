#include "renderer/light/light_tint.h"

#include "renderer/math/vec.h"
#include "renderer/scene/light_table.h"

bool hg_light_is_tinted(const struct hg_gpu_light *light)
{
    return light->profile != HG_LIGHT_NO_TABLE || light->image != HG_LIGHT_NO_TABLE;
}

static bool is_flat(const struct hg_gpu_light *light)
{
    return light->kind == HG_LIGHT_KIND_RECTANGLE || light->kind == HG_LIGHT_KIND_DISC;
}

static void to_frame(const struct hg_gpu_light *light, const float d[3], float out[3])
{
    const float x[3] = {light->axis_ws.x, light->axis_ws.y, light->axis_ws.z};
    const float way[3] = {light->direction_ws.x, light->direction_ws.y, light->direction_ws.z};
    float up[3];
    hg_cross3(x, way, up);
    out[0] = hg_dot3(d, x);
    out[1] = hg_dot3(d, up);
    out[2] = -hg_dot3(d, way);
}

// at: in the light's frame, of a length of 1 but for DIRECTIONAL.
static void cookie_uv(const struct hg_gpu_light *light, const float at[3], float uv[2])
{
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
        uv[0] = 0.5f + at[0] / (2 * light->half_width);
        uv[1] = 0.5f - at[1] / (2 * light->half_height);
    } else if (light->kind == HG_LIGHT_KIND_SPOT) {
        const float outer =
            hg_clampf(-light->spot_offset / light->spot_scale, HG_LIGHT_LEAST_COS, 1 - 1e-7f);
        const float reach = fmaxf(-at[2], 1e-6f) * sqrtf(1 - outer * outer) / outer;
        uv[0] = 0.5f + at[0] / (2 * reach);
        uv[1] = 0.5f - at[1] / (2 * reach);
    } else {
        uv[0] = atan2f(at[2], at[0]) / (2 * (float)HG_PI) + 0.5f;
        uv[1] = 0.5f - asinf(hg_clampf(at[1], -1, 1)) / (float)HG_PI;
    }
}

void hg_light_tint(const struct hg_gpu_light *light, const uint32_t *tables,
    const float position_ws[3], float out[3])
{
    const float middle[3] = {light->position_ws.x, light->position_ws.y, light->position_ws.z};
    float d[3], at[3], uv[2];
    out[0] = out[1] = out[2] = 1;
    if (!hg_light_is_tinted(light))
        return;
    hg_sub3(position_ws, middle, d);
    if (light->kind != HG_LIGHT_KIND_DIRECTIONAL)
        hg_normalize3(d);
    to_frame(light, d, at);
    if (light->image != HG_LIGHT_NO_TABLE && !is_flat(light)) {
        cookie_uv(light, at, uv);
        hg_light_image_at(tables + light->image, uv[0], uv[1], out);
    }
    if (light->profile == HG_LIGHT_NO_TABLE)
        return;
    const float factor = hg_light_profile_at(tables + light->profile, at);
    for (int c = 0; c < 3; c++)
        out[c] *= factor;
}

void hg_light_surface_tint(const struct hg_gpu_light *light, const uint32_t *tables,
    const float offset_ws[3], float out[3])
{
    const bool rectangle = light->kind == HG_LIGHT_KIND_RECTANGLE;
    float at[3];
    out[0] = out[1] = out[2] = 1;
    if (light->image == HG_LIGHT_NO_TABLE || !is_flat(light))
        return;
    to_frame(light, offset_ws, at);
    const float u = 0.5f - at[0] / (2 * (rectangle ? light->half_width : light->radius));
    const float v = 0.5f - at[1] / (2 * (rectangle ? light->half_height : light->radius));
    hg_light_image_at(tables + light->image, hg_clampf(u, 0, 1), hg_clampf(v, 0, 1), out);
}
