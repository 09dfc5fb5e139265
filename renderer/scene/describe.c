#include <jansson.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/light_table.h"

// jansson takes what is given to *_new and drops it itself on failure; a NULL anywhere shows up as
// a failed set, which `ok` collects.
struct describer {
    bool ok;
};

static void put(struct describer *d, json_t *object, const char *key, json_t *value)
{
    if (json_object_set_new(object, key, value) != 0)
        d->ok = false;
}

static void put_text(struct describer *d, json_t *object, const char *key, const char *text)
{
    json_t *value = json_string(text);
    put(d, object, key, value ? value : json_string("(not UTF-8)"));
}

static json_t *real(double value)
{
    return json_real(isfinite(value) ? value : 0); // JSON has no infinity
}

static json_t *numbers(struct describer *d, const float *values, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        if (json_array_append_new(array, real((double)values[i])) != 0)
            d->ok = false;
    return array;
}

static json_t *names(struct describer *d, char *const *items, uint32_t count)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < count; i++)
        if (json_array_append_new(array, json_string(items[i])) != 0)
            d->ok = false;
    return array;
}

static void append(struct describer *d, json_t *array, json_t *value)
{
    if (json_array_append_new(array, value) != 0)
        d->ok = false;
}

// ---- totals ------------------------------------------------------------------------------------

struct totals {
    uint64_t vertices, triangles, lines, points, drawn_triangles, instances;
};

static void count_mesh(const struct hg_mesh *mesh, struct totals *t)
{
    for (uint32_t p = 0; p < mesh->part_count; p++) {
        const struct hg_mesh_part *part = &mesh->parts[p];
        t->vertices += part->vertex_count;
        if (part->topology == HG_TOPOLOGY_TRIANGLES)
            t->triangles += part->index_count / 3;
        else if (part->topology == HG_TOPOLOGY_LINES)
            t->lines += part->index_count / 2;
        else
            t->points += part->index_count;
    }
}

static bool is_shown(const struct hg_node *node)
{
    while (node && node->visible)
        node = node->parent;
    return node == NULL;
}

static void count_asset(const struct hg_asset *asset, struct totals *t)
{
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        count_mesh(asset->meshes[m], t);
    for (uint32_t n = 0; n < asset->node_count; n++) {
        const struct hg_node *node = asset->nodes[n];
        struct totals one = {0};
        if (!node->mesh || !is_shown(node))
            continue;
        count_mesh(node->mesh, &one);
        uint64_t copies = node->instance_count ? node->instance_count : 1;
        t->drawn_triangles += one.triangles * copies;
        t->instances += copies;
    }
}

static json_t *describe_counts(struct describer *d, const struct hg_asset *asset)
{
    struct totals t = {0};
    count_asset(asset, &t);
    const struct {
        const char *key;
        uint64_t value;
    } rows[] = {{"nodes", asset->node_count}, {"meshes", asset->mesh_count},
        {"materials", asset->material_count}, {"textures", asset->texture_count},
        {"lights", asset->light_count}, {"cameras", asset->camera_count},
        {"skins", asset->skin_count}, {"animations", asset->animation_count},
        {"vertices", t.vertices}, {"triangles", t.triangles}, {"lines", t.lines},
        {"points", t.points}, {"mesh_instances", t.instances},
        {"drawn_triangles", t.drawn_triangles}};
    json_t *object = json_object();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        put(d, object, rows[i].key, json_integer((json_int_t)rows[i].value));
    return object;
}

static json_t *describe_bounds(struct describer *d, const struct hg_asset *asset)
{
    float min[3], max[3];
    if (!hg_asset_bounds(asset, min, max))
        return json_null();
    json_t *object = json_object();
    put(d, object, "min", numbers(d, min, 3));
    put(d, object, "max", numbers(d, max, 3));
    return object;
}

// Whole numbers are written as such: a real of seven digits would lose metres of them.
static json_t *describe_origin(struct describer *d, const struct hg_asset *asset)
{
    json_t *array = json_array();
    for (int i = 0; i < 3; i++) {
        const double v = asset->file.origin[i];
        const bool whole = fabs(v) < 9e15 && v == floor(v);
        append(d, array, whole ? json_integer((json_int_t)v) : real(v));
    }
    return array;
}

// ---- lists -------------------------------------------------------------------------------------

static json_t *describe_material(struct describer *d, const struct hg_material *m)
{
    static const char *const modes[] = {"opaque", "mask", "blend"};
    json_t *object = json_object();
    put_text(d, object, "name", m->head.name);
    put(d, object, "base_color", numbers(d, m->base_color, 4));
    put(d, object, "metallic", real((double)m->metallic));
    put(d, object, "roughness", real((double)m->roughness));
    put(d, object, "emissive", numbers(d, m->emissive, 3));
    put_text(d, object, "alpha_mode", modes[m->alpha_mode]);
    put(d, object, "double_sided", json_boolean(m->double_sided));
    put(d, object, "unlit", json_boolean(m->unlit));
    int used = 0;
    for (int s = 0; s < HG_SLOT_COUNT; s++)
        used += m->slots[s].texture != NULL;
    put(d, object, "textures", json_integer(used));
    return object;
}

static json_t *describe_texture(struct describer *d, const struct hg_texture *texture)
{
    json_t *object = json_object();
    const struct hg_image_source *image = texture->image;
    put_text(d, object, "name", texture->head.name);
    put_text(d, object, "image", image ? image->label : "");
    struct hg_image_info info = {0};
    enum hg_status status = HG_E_NOTFOUND;
    if (image && image->encoded)
        status = hg_image_probe_memory(
            &(struct hg_image_bytes){image->encoded->data, image->encoded->size, image->label},
            &info, NULL);
    else if (image && image->path)
        status = hg_image_probe_file(image->path, &info, NULL);
    else if (image) {
        info.width = image->pixels.width;
        info.height = image->pixels.height;
        status = HG_OK;
    }
    put(d, object, "width", json_integer(status ? 0 : info.width));
    put(d, object, "height", json_integer(status ? 0 : info.height));
    return object;
}

static json_t *describe_light(struct describer *d, const struct hg_light *light)
{
    static const char *const kinds[] = {
        "directional", "point", "spot", "rectangle", "disc", "tube"};
    const bool has_width = light->kind == HG_LIGHT_RECTANGLE || light->kind == HG_LIGHT_TUBE;
    json_t *object = json_object();
    put_text(d, object, "name", light->head.name);
    put_text(d, object, "kind", kinds[light->kind]);
    put(d, object, "color", numbers(d, light->color, 3));
    put(d, object, "intensity", real((double)light->intensity));
    if (light->kind != HG_LIGHT_DIRECTIONAL && light->kind != HG_LIGHT_RECTANGLE &&
        light->radius > 0)
        put(d, object, "radius", real((double)light->radius));
    if (has_width)
        put(d, object, "width", real((double)light->width));
    if (light->kind == HG_LIGHT_RECTANGLE)
        put(d, object, "height", real((double)light->height));
    if (light->kind == HG_LIGHT_DIRECTIONAL && light->angular_diameter_rad > 0)
        put(d, object, "angular_diameter_rad", real((double)light->angular_diameter_rad));
    if (light->lumens > 0)
        put(d, object, "lumens", real((double)light->lumens));
    if (light->profile) {
        put(d, object, "profile_peak_candela", real((double)light->profile->peak_cd));
        put(d, object, "profile_absolute", json_boolean(light->absolute));
    }
    if (light->texture)
        put(d, object, "texture", json_integer((json_int_t)(light->texture->head.id & 0xffffffff)));
    return object;
}

static json_t *describe_camera(
    struct describer *d, const struct hg_asset *asset, const struct hg_camera *camera)
{
    json_t *object = json_object();
    const struct hg_node *holder = NULL;
    for (uint32_t n = 0; n < asset->node_count && !holder; n++)
        if (asset->nodes[n]->camera == camera)
            holder = asset->nodes[n];
    put_text(d, object, "name", camera->head.name);
    put_text(d, object, "node", holder ? holder->head.name : "");
    bool perspective = camera->kind == HG_CAMERA_PERSPECTIVE;
    put_text(d, object, "kind", perspective ? "perspective" : "orthographic");
    put(d, object, perspective ? "vfov_deg" : "half_height",
        real(perspective ? (double)camera->vfov_rad * 57.29577951308232
                         : (double)camera->half_height));
    const struct hg_camera_optics *o = &camera->optics;
    const float optics[] = {o->f_number, o->shutter_s, o->iso, o->sensor_mm, o->focus_distance};
    static const char *const names[] = {
        "f_number", "shutter_s", "iso", "sensor_mm", "focus_distance"};
    for (size_t i = 0; i < sizeof optics / sizeof *optics; i++)
        if (optics[i] > 0)
            put(d, object, names[i], real((double)optics[i]));
    return object;
}

static json_t *describe_animations(struct describer *d, const struct hg_asset *asset)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < asset->animation_count; i++) {
        json_t *object = json_object();
        put_text(d, object, "name", asset->animations[i].name);
        put(d, object, "duration_s", real(asset->animations[i].duration_s));
        put(d, object, "channels", json_integer(asset->animations[i].channel_count));
        put(d, object, "conflicts", json_boolean(asset->animations[i].conflicts));
        append(d, array, object);
    }
    return array;
}

static json_t *describe_warnings(struct describer *d, const struct hg_asset *asset)
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < asset->warning_count; i++) {
        json_t *object = json_object();
        put_text(d, object, "what", asset->warnings[i].what);
        put_text(d, object, "where", asset->warnings[i].where);
        put_text(d, object, "reason", asset->warnings[i].reason);
        append(d, array, object);
    }
    return array;
}

static void describe_lists(struct describer *d, json_t *root, const struct hg_asset *asset)
{
    json_t *materials = json_array(), *textures = json_array();
    json_t *lights = json_array(), *cameras = json_array();
    for (uint32_t i = 0; i < asset->material_count; i++)
        append(d, materials, describe_material(d, asset->materials[i]));
    for (uint32_t i = 0; i < asset->texture_count; i++)
        append(d, textures, describe_texture(d, asset->textures[i]));
    for (uint32_t i = 0; i < asset->light_count; i++)
        append(d, lights, describe_light(d, asset->lights[i]));
    for (uint32_t i = 0; i < asset->camera_count; i++)
        append(d, cameras, describe_camera(d, asset, asset->cameras[i]));
    put(d, root, "materials", materials);
    put(d, root, "textures", textures);
    put(d, root, "lights", lights);
    put(d, root, "cameras", cameras);
    put(d, root, "animations", describe_animations(d, asset));
    put(d, root, "variants", names(d, asset->variants.names, asset->variants.count));
    if (asset->variants.chosen >= 0)
        put_text(d, root, "variant", asset->variants.names[asset->variants.chosen]);
    put(d, root, "extensions_used",
        names(d, asset->file.extensions_used, asset->file.extension_count));
    put(d, root, "warnings", describe_warnings(d, asset));
}

enum hg_status hg_asset_describe(const struct hg_asset *asset, char **json_text)
{
    struct describer d = {.ok = true};
    *json_text = NULL;
    json_t *root = json_object();
    put_text(&d, root, "file", asset->label);
    put_text(&d, root, "format", asset->file.format);
    put_text(&d, root, "version", asset->file.version);
    put_text(&d, root, "generator", asset->file.generator);
    put_text(&d, root, "copyright", asset->file.copyright);
    if (asset->file.up_reason) {
        static const char *const axes[] = {"", "", "+X", "+Y", "+Z", "-X", "-Y", "-Z"};
        put_text(&d, root, "up", axes[asset->file.up]);
        put_text(&d, root, "up_reason", asset->file.up_reason);
    }
    put(&d, root, "counts", describe_counts(&d, asset));
    put(&d, root, "bounds", describe_bounds(&d, asset));
    put(&d, root, "origin", describe_origin(&d, asset));
    describe_lists(&d, root, asset);
    char *text = d.ok ? json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(7)) : NULL;
    json_decref(root);
    if (text)
        *json_text = hg_strdup(text);
    free(text);
    return *json_text ? HG_OK : HG_E_NOMEM;
}
