// Lights, and their size in extras.
//
// glTF has no lights with a size. What exporters and engines call it is read from the extras of a
// light and of the nodes that have it (docs/internals/light.md, "Lights with a size"). Extras
// belong to applications, so that what does not fit is left out with a warning.
#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <string.h>
#include <strings.h>

// ---- size --------------------------------------------------------------------------------------

static float read_size(
    struct hg_gltf *g, const struct hg_gltf_at *extras, const char *const *names, float most)
{
    return hg_gltf_read_extra(g, extras, "light", names, most);
}

static void read_shape(struct hg_gltf *g, const struct hg_gltf_at *extras, struct hg_light *light)
{
    static const struct {
        const char *name;
        unsigned kind;
    } shapes[] = {{"sphere", HG_LIGHT_POINT}, {"rectangle", HG_LIGHT_RECTANGLE},
        {"rect", HG_LIGHT_RECTANGLE}, {"square", HG_LIGHT_RECTANGLE}, {"disc", HG_LIGHT_DISC},
        {"disk", HG_LIGHT_DISC}, {"tube", HG_LIGHT_TUBE}};
    const struct hg_gltf_at at = hg_gltf_key(extras, "shape");
    const char *text = json_string_value(at.json);
    if (!at.json || light->kind == HG_LIGHT_DIRECTIONAL)
        return;
    for (size_t i = 0; text && i < sizeof shapes / sizeof shapes[0]; i++) {
        if (strcasecmp(text, shapes[i].name) != 0)
            continue;
        if (shapes[i].kind != HG_LIGHT_POINT)
            light->kind = shapes[i].kind;
        return;
    }
    hg_gltf_warn(g, &at, "VALUE_NOT_IN_LIST: a light's shape is sphere, rectangle, disc or tube");
}

// Luminous flux in lumens, in place of the intensity.
static void read_flux(struct hg_gltf *g, const struct hg_gltf_at *extras, struct hg_light *light)
{
    static const char *const fluxes[] = {"lumens", "luminous_flux", NULL};
    const float lumens = read_size(g, extras, fluxes, HG_LIGHT_MOST_LUMENS);
    light->lumens = lumens > 0 ? lumens : light->lumens;
}

void hg_gltf_read_light_size(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light)
{
    static const char *const radii[] = {"radius", "shadow_soft_size", NULL};
    static const char *const angles[] = {"angular_diameter", "angularDiameter", "angle", NULL};
    static const char *const widths[] = {"width", "length", "size", NULL};
    static const char *const heights[] = {"height", "size_y", NULL};
    static const char *const diameters[] = {"size", NULL};
    const struct hg_gltf_at extras = hg_gltf_key(at, "extras");
    const struct hg_light before = *light;
    const char *missing;
    if (!json_is_object(extras.json))
        return;
    if (light->kind == HG_LIGHT_DIRECTIONAL) {
        const float angle = read_size(g, &extras, angles, HG_LIGHT_MOST_ANGLE_RAD);
        light->angular_diameter_rad = angle > 0 ? angle : light->angular_diameter_rad;
        return;
    }
    read_shape(g, &extras, light);
    read_flux(g, &extras, light);
    const float radius = read_size(g, &extras, radii, HG_LIGHT_MOST_SIZE_M);
    light->radius = radius > 0 ? radius : light->radius;
    if (light->kind == HG_LIGHT_DISC && !(radius > 0)) {
        const float diameter = read_size(g, &extras, diameters, HG_LIGHT_MOST_SIZE_M);
        light->radius = diameter > 0 ? diameter / 2 : light->radius;
    } else if (light->kind == HG_LIGHT_RECTANGLE || light->kind == HG_LIGHT_TUBE) {
        const float width = read_size(g, &extras, widths, HG_LIGHT_MOST_SIZE_M);
        const float height = read_size(g, &extras, heights, HG_LIGHT_MOST_SIZE_M);
        light->width = width > 0 ? width : light->width;
        light->height = height > 0 ? height : width > 0 ? width : light->height;
    }
    if (!hg_light_has_size(light, &missing)) {
        hg_gltf_warn(g, &extras, "a light of this shape needs a %s above 0", missing);
        *light = before;
    }
}

// ---- lights ------------------------------------------------------------------------------------

static enum hg_status read_light(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light)
{
    const char *type = hg_gltf_string(at, "type");
    if (type && strcmp(type, "directional") == 0)
        light->kind = HG_LIGHT_DIRECTIONAL;
    else if (type && strcmp(type, "point") == 0)
        light->kind = HG_LIGHT_POINT;
    else if (type && strcmp(type, "spot") == 0)
        light->kind = HG_LIGHT_SPOT;
    else
        return hg_gltf_fail(
            g, at, HG_E_FORMAT, "VALUE_NOT_IN_LIST: light type '%s'", type ? type : "");
    hg_gltf_numbers(at, "color", light->color, 3);
    light->intensity = (float)fmax(hg_gltf_number(at, "intensity", 1), 0);
    light->range = (float)fmax(hg_gltf_number(at, "range", 0), 0);
    struct hg_gltf_at spot = hg_gltf_key(at, "spot");
    double outer = hg_gltf_number(&spot, "outerConeAngle", M_PI / 4);
    double inner = hg_gltf_number(&spot, "innerConeAngle", 0);
    if (light->kind == HG_LIGHT_SPOT && !(inner >= 0 && inner < outer && outer <= M_PI / 2 + 1e-4))
        hg_gltf_warn(
            g, &spot, "KHR_LIGHTS_PUNCTUAL_LIGHT_SPOT_ANGLES: inner %g, outer %g", inner, outer);
    light->outer_cone_rad = (float)fmin(fmax(outer, 1e-3), M_PI / 2);
    light->inner_cone_rad = (float)fmin(fmax(inner, 0), light->outer_cone_rad);
    hg_gltf_read_light_size(g, at, light);
    return hg_gltf_read_light_tables(g, at, light);
}

enum hg_status hg_gltf_load_lights(struct hg_gltf *g)
{
    struct hg_gltf_at extensions;
    struct hg_gltf_at punctual = hg_gltf_extension(&g->root, "KHR_lights_punctual", &extensions);
    struct hg_gltf_at list = hg_gltf_key(&punctual, "lights");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_light *light = hg_asset_add_light(g->asset, hg_gltf_string(&at, "name"));
        if (!light)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a light");
        enum hg_status status = read_light(g, &at, light);
        if (status)
            return status;
    }
    g->punctual_count = g->asset->light_count;
    return HG_OK;
}
