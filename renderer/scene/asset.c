#include "renderer/scene/asset.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/utf8.h"
#include "renderer/scene/light_table.h"
#include "renderer/scene/xform.h"

struct hg_asset *hg_asset_create(uint32_t number, const char *label)
{
    struct hg_asset *asset = hg_calloc(1, sizeof *asset);
    if (!asset)
        return NULL;
    asset->number = number;
    asset->variants.chosen = -1;
    asset->label = hg_strdup(label);
    if (!asset->label) {
        hg_free(asset);
        return NULL;
    }
    return asset;
}

void hg_asset_warn_text(struct hg_asset *asset, const char *where, const char *reason)
{
    if (asset->warning_count >= HG_ASSET_MAX_WARNINGS) {
        struct hg_warning *last = &asset->warnings[HG_ASSET_MAX_WARNINGS - 1];
        snprintf(last->reason, sizeof last->reason,
            "more problems of the same kinds; see the first %d", HG_ASSET_MAX_WARNINGS - 1);
        last->where[0] = '\0';
        return;
    }
    if (!asset->warnings)
        asset->warnings = hg_calloc(HG_ASSET_MAX_WARNINGS, sizeof *asset->warnings);
    if (!asset->warnings)
        return;
    struct hg_warning *w = &asset->warnings[asset->warning_count++];
    snprintf(w->what, sizeof w->what, "%s", asset->label);
    snprintf(w->where, sizeof w->where, "%s", where ? where : "");
    snprintf(w->reason, sizeof w->reason, "%s", reason);
    hg_utf8_clean(w->where); // it may be a name of the file's
    hg_utf8_clean(w->reason);
}

void hg_asset_warn(struct hg_asset *asset, const char *where, const char *fmt, ...)
{
    char text[256];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    hg_asset_warn_text(asset, where, text);
}

// Grows an exact-count array of pointers in steps of powers of two and appends.
static bool append_pointer(void *array_ptr, uint32_t *count, void *item)
{
    void **items;
    memcpy(&items, array_ptr, sizeof items);
    if ((*count & (*count - 1)) == 0) { // 0, 1, 2, 4, ...: full
        size_t capacity = *count ? (size_t)*count * 2 : 1;
        items = hg_realloc(items, capacity, sizeof *items);
        if (!items)
            return false;
        memcpy(array_ptr, &items, sizeof items);
    }
    items[(*count)++] = item;
    return true;
}

static void *add_object(struct hg_asset *asset, enum hg_object_kind kind, size_t size,
    const char *name, void *array_ptr, uint32_t *count)
{
    struct hg_object *object = hg_calloc(1, size);
    if (!object)
        return NULL;
    object->id = (uint64_t)asset->number << 32 | *count;
    object->name = hg_strdup(name ? name : "");
    if (!object->name || !append_pointer(array_ptr, count, object)) {
        hg_object_destroy(kind, object);
        return NULL;
    }
    return object;
}

void hg_node_set_defaults(struct hg_node *node)
{
    node->rotation[3] = 1;
    for (int i = 0; i < 3; i++)
        node->scale[i] = 1;
    hg_mat4_identity(node->matrix);
    node->visible = true;
}

void hg_light_set_defaults(struct hg_light *light)
{
    for (int i = 0; i < 3; i++)
        light->color[i] = 1;
    light->intensity = 1;
    light->outer_cone_rad = 0.785398163f;
    light->width = light->height = 1;
    light->casts_shadow = true;
}

bool hg_light_has_size(const struct hg_light *light, const char **what)
{
    const bool disc = light->kind == HG_LIGHT_DISC, tube = light->kind == HG_LIGHT_TUBE;
    const bool flat = light->kind == HG_LIGHT_RECTANGLE;
    *what = NULL;
    if ((disc || tube) && !(light->radius > 0))
        *what = "radius";
    else if ((flat || tube) && !(light->width > 0))
        *what = "width";
    else if (flat && !(light->height > 0))
        *what = "height";
    return *what == NULL;
}

void hg_camera_set_defaults(struct hg_camera *camera)
{
    camera->vfov_rad = 0.785398163f;
    camera->half_height = 1;
    camera->near = 0.01f;
}

struct hg_node *hg_asset_add_node(struct hg_asset *asset, const char *name)
{
    struct hg_node *node =
        add_object(asset, HG_OBJECT_NODE, sizeof *node, name, &asset->nodes, &asset->node_count);
    if (node) {
        node->asset = asset;
        hg_node_set_defaults(node);
    }
    return node;
}

struct hg_mesh *hg_asset_add_mesh(struct hg_asset *asset, const char *name)
{
    return add_object(
        asset, HG_OBJECT_MESH, sizeof(struct hg_mesh), name, &asset->meshes, &asset->mesh_count);
}

struct hg_material *hg_asset_add_material(struct hg_asset *asset, const char *name)
{
    struct hg_material *material = add_object(asset, HG_OBJECT_MATERIAL, sizeof *material, name,
        &asset->materials, &asset->material_count);
    if (material)
        hg_material_set_defaults(material);
    return material;
}

enum hg_status hg_asset_transform_roots(struct hg_asset *asset, const float matrix[16])
{
    struct hg_node *top = asset->root_count ? hg_asset_add_node(asset, "") : NULL;
    if (!asset->root_count)
        return HG_OK;
    if (!top)
        return HG_E_NOMEM;
    top->has_matrix = true;
    memcpy(top->matrix, matrix, sizeof top->matrix);
    for (uint32_t i = 0; i < asset->root_count; i++)
        hg_node_append_child(top, asset->roots[i]);
    asset->roots[0] = top;
    asset->root_count = 1;
    return HG_OK;
}

struct hg_texture *hg_asset_add_texture(struct hg_asset *asset, const char *name)
{
    return add_object(asset, HG_OBJECT_TEXTURE, sizeof(struct hg_texture), name, &asset->textures,
        &asset->texture_count);
}

struct hg_light *hg_asset_add_light(struct hg_asset *asset, const char *name)
{
    struct hg_light *light = add_object(
        asset, HG_OBJECT_LIGHT, sizeof *light, name, &asset->lights, &asset->light_count);
    if (light)
        hg_light_set_defaults(light);
    return light;
}

struct hg_camera *hg_asset_add_camera(struct hg_asset *asset, const char *name)
{
    struct hg_camera *camera = add_object(
        asset, HG_OBJECT_CAMERA, sizeof *camera, name, &asset->cameras, &asset->camera_count);
    if (camera)
        hg_camera_set_defaults(camera);
    return camera;
}

struct hg_skin *hg_asset_add_skin(struct hg_asset *asset)
{
    struct hg_skin *skin = hg_calloc(1, sizeof *skin);
    if (skin && !append_pointer(&asset->skins, &asset->skin_count, skin)) {
        hg_free(skin);
        return NULL;
    }
    return skin;
}

void hg_node_append_child(struct hg_node *parent, struct hg_node *child)
{
    struct hg_node **link = &parent->first_child;
    while (*link)
        link = &(*link)->next_sibling;
    *link = child;
    child->next_sibling = NULL;
    child->parent = parent;
}

struct hg_image_source *hg_image_source_create(const char *label)
{
    struct hg_image_source *source = hg_calloc(1, sizeof *source);
    if (!source)
        return NULL;
    source->refs = 1;
    source->label = hg_strdup(label);
    if (!source->label) {
        hg_free(source);
        return NULL;
    }
    return source;
}

struct hg_image_source *hg_image_source_ref(struct hg_image_source *source)
{
    source->refs++;
    return source;
}

void hg_image_source_unref(struct hg_image_source *source)
{
    if (!source || --source->refs)
        return;
    hg_refbuf_unref(source->encoded);
    hg_free(source->pixels.pixels);
    hg_free(source->path);
    hg_free(source->label);
    hg_free(source);
}

static void mesh_finish(struct hg_mesh *mesh)
{
    for (uint32_t i = 0; mesh->parts && i < mesh->part_count; i++)
        hg_mesh_part_finish(&mesh->parts[i], mesh->target_count);
    hg_free(mesh->parts);
    hg_free(mesh->weights);
}

void hg_object_destroy(enum hg_object_kind kind, struct hg_object *object)
{
    if (!object)
        return;
    if (kind == HG_OBJECT_NODE) {
        struct hg_node *node = (struct hg_node *)object;
        hg_free(node->weights);
        hg_free(node->instances);
    } else if (kind == HG_OBJECT_MESH) {
        mesh_finish((struct hg_mesh *)object);
    } else if (kind == HG_OBJECT_TEXTURE) {
        hg_image_source_unref(((struct hg_texture *)object)->image);
    } else if (kind == HG_OBJECT_LIGHT) {
        hg_light_table_unref(((struct hg_light *)object)->profile);
        hg_light_table_unref(((struct hg_light *)object)->image);
    }
    hg_free(object->name);
    hg_free(object);
}

static void destroy_objects(enum hg_object_kind kind, void *array, uint32_t count)
{
    struct hg_object **objects = array;
    for (uint32_t i = 0; i < count; i++)
        hg_object_destroy(kind, objects[i]);
    hg_free(array);
}

static void destroy_animations(struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->animation_count; i++) {
        struct hg_animation *animation = &asset->animations[i];
        for (uint32_t c = 0; c < animation->channel_count; c++) {
            hg_free(animation->channels[c].times);
            hg_free(animation->channels[c].values);
            hg_free(animation->channels[c].rest);
        }
        hg_free(animation->channels);
        hg_free(animation->name);
    }
    hg_free(asset->animations);
}

static void destroy_strings(char **strings, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        hg_free(strings[i]);
    hg_free(strings);
}

void hg_asset_destroy(struct hg_asset *asset)
{
    if (!asset)
        return;
    destroy_objects(HG_OBJECT_NODE, asset->nodes, asset->node_count);
    destroy_objects(HG_OBJECT_MESH, asset->meshes, asset->mesh_count);
    destroy_objects(HG_OBJECT_MATERIAL, asset->materials, asset->material_count);
    destroy_objects(HG_OBJECT_TEXTURE, asset->textures, asset->texture_count);
    destroy_objects(HG_OBJECT_LIGHT, asset->lights, asset->light_count);
    destroy_objects(HG_OBJECT_CAMERA, asset->cameras, asset->camera_count);
    for (uint32_t i = 0; i < asset->skin_count; i++) {
        hg_free(asset->skins[i]->joints);
        hg_free(asset->skins[i]->inverse_bind);
        hg_free(asset->skins[i]);
    }
    hg_free(asset->skins);
    destroy_animations(asset);
    destroy_strings(asset->variants.names, asset->variants.count);
    destroy_strings(asset->file.extensions_used, asset->file.extension_count);
    hg_free(asset->warnings);
    hg_free(asset->roots);
    hg_free(asset->label);
    hg_free(asset);
}

struct hg_material *hg_asset_part_material(
    const struct hg_asset *asset, const struct hg_mesh_part *part)
{
    if (asset && part->variants && asset->variants.chosen >= 0 &&
        (uint32_t)asset->variants.chosen < asset->variants.count &&
        part->variants[asset->variants.chosen])
        return part->variants[asset->variants.chosen];
    return part->material;
}

bool hg_texture_slot_is_srgb(enum hg_texture_slot slot)
{
    return slot == HG_SLOT_BASE_COLOR || slot == HG_SLOT_EMISSIVE || slot == HG_SLOT_SHEEN_COLOR ||
           slot == HG_SLOT_SPECULAR_COLOR || slot == HG_SLOT_DIFFUSE_TRANSMISSION_COLOR;
}

void hg_material_set_defaults(struct hg_material *m)
{
    for (int i = 0; i < 4; i++)
        m->base_color[i] = 1;
    m->metallic = m->roughness = 1;
    m->normal_scale = m->occlusion_strength = m->clearcoat.normal_scale = 1;
    m->alpha_cutoff = 0.5f;
    m->ior = 1.5f;
    m->specular.factor = 1;
    for (int i = 0; i < 3; i++)
        m->specular.color[i] = m->volume.attenuation_color[i] = m->diffuse_transmission.color[i] =
            1;
    m->volume.attenuation_distance = INFINITY;
    m->iridescence.ior = 1.3f;
    m->iridescence.thickness_min_nm = 100;
    m->iridescence.thickness_max_nm = 400;
    for (int i = 0; i < HG_SLOT_COUNT; i++)
        m->slots[i].uv_transform[0] = m->slots[i].uv_transform[4] = 1;
}
