#include "renderer/scene/scene.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/extent.h"
#include "renderer/scene/xform.h"

// ---- ids: open addressing, linear probing, backward-shift deletion -----------------------------

struct hg_id_slot {
    uint64_t id;
    struct hg_object *object; // NULL = free
};

static uint32_t id_hash(uint64_t id)
{
    id ^= id >> 33;
    id *= 0xff51afd7ed558ccdull; // finaliser of MurmurHash3
    id ^= id >> 33;
    return (uint32_t)id;
}

static struct hg_id_slot *id_slot(const struct hg_id_map *map, uint64_t id)
{
    uint32_t mask = map->capacity - 1;
    uint32_t i = id_hash(id) & mask;
    while (map->slots[i].object && map->slots[i].id != id)
        i = (i + 1) & mask;
    return &map->slots[i];
}

static enum hg_status id_reserve(struct hg_id_map *map, uint32_t extra)
{
    uint64_t need = ((uint64_t)map->used + extra) * 2;
    if (need <= map->capacity)
        return HG_OK;
    uint64_t capacity = map->capacity ? map->capacity : 64;
    while (capacity < need)
        capacity *= 2;
    if (capacity > UINT32_MAX)
        return HG_E_NOMEM;
    struct hg_id_map fresh = {.capacity = (uint32_t)capacity, .used = map->used};
    fresh.slots = hg_calloc(capacity, sizeof *fresh.slots);
    if (!fresh.slots)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < map->capacity; i++)
        if (map->slots[i].object)
            *id_slot(&fresh, map->slots[i].id) = map->slots[i];
    hg_free(map->slots);
    *map = fresh;
    return HG_OK;
}

static void id_put(struct hg_id_map *map, struct hg_object *object) // after id_reserve
{
    *id_slot(map, object->id) = (struct hg_id_slot){.id = object->id, .object = object};
    map->used++;
}

static void id_remove(struct hg_id_map *map, uint64_t id)
{
    struct hg_id_slot *slot = id_slot(map, id);
    if (!slot->object)
        return;
    uint32_t mask = map->capacity - 1, hole = (uint32_t)(slot - map->slots);
    for (uint32_t i = (hole + 1) & mask; map->slots[i].object; i = (i + 1) & mask) {
        uint32_t home = id_hash(map->slots[i].id) & mask;
        if (((i - home) & mask) >= ((i - hole) & mask)) {
            map->slots[hole] = map->slots[i];
            hole = i;
        }
    }
    map->slots[hole].object = NULL;
    map->used--;
}

struct hg_object *hg_scene_find(const struct hg_scene *scene, enum hg_object_kind kind, uint64_t id)
{
    if ((unsigned)kind >= HG_OBJECT_KINDS || scene->ids[kind].capacity == 0)
        return NULL;
    return id_slot(&scene->ids[kind], id)->object;
}

// ---- life --------------------------------------------------------------------------------------

// Of a sky whose sun is not placed: azimuth -40, elevation 50 degrees, a key light from the left.
static const float sun_direction[3] = {-0.41318f, 0.76604f, 0.49240f};

enum hg_status hg_scene_create(struct hg_scene **out)
{
    *out = hg_calloc(1, sizeof **out);
    if (!*out)
        return HG_E_NOMEM;
    (*out)->revision = 1;
    (*out)->environment.intensity = (*out)->environment.wanted_intensity = 1;
    memcpy((*out)->environment.sun_direction, sun_direction, sizeof sun_direction);
    (*out)->environment.turbidity = 2;
    return HG_OK;
}

static bool is_client_made(const struct hg_object *object)
{
    return object->id >> 32 == 0;
}

void hg_scene_destroy(struct hg_scene *scene)
{
    if (!scene)
        return;
    for (int kind = 0; kind < HG_OBJECT_KINDS; kind++) {
        struct hg_object_list *list = &scene->objects[kind];
        for (uint32_t i = 0; i < list->count; i++)
            if (is_client_made(list->items[i]))
                hg_object_destroy((enum hg_object_kind)kind, list->items[i]);
        hg_free(list->items);
        hg_free(scene->ids[kind].slots);
    }
    for (uint32_t i = 0; i < scene->asset_count; i++)
        hg_asset_destroy(scene->assets[i]);
    hg_free(scene->assets);
    hg_free(scene->environment.image.pixels);
    hg_image_source_unref(scene->environment.background.image);
    hg_free(scene);
}

void hg_scene_touch(struct hg_scene *scene, struct hg_object *object)
{
    object->revision = scene->revision + 1;
}

void hg_scene_publish(struct hg_scene *scene)
{
    scene->revision++;
}

// ---- objects -----------------------------------------------------------------------------------

static struct hg_object *new_object(enum hg_object_kind kind)
{
    static const size_t sizes[HG_OBJECT_KINDS] = {sizeof(struct hg_node), sizeof(struct hg_mesh),
        sizeof(struct hg_material), sizeof(struct hg_texture), sizeof(struct hg_light),
        sizeof(struct hg_camera)};
    struct hg_object *object = hg_calloc(1, sizes[kind]);
    if (!object)
        return NULL;
    if (kind == HG_OBJECT_NODE)
        hg_node_set_defaults((struct hg_node *)object);
    else if (kind == HG_OBJECT_MATERIAL)
        hg_material_set_defaults((struct hg_material *)object);
    else if (kind == HG_OBJECT_LIGHT)
        hg_light_set_defaults((struct hg_light *)object);
    else if (kind == HG_OBJECT_CAMERA)
        hg_camera_set_defaults((struct hg_camera *)object);
    object->name = hg_strdup("");
    if (!object->name) {
        hg_object_destroy(kind, object);
        return NULL;
    }
    return object;
}

// Room for `extra` more objects of a kind, so that what follows cannot fail.
static enum hg_status reserve(struct hg_scene *scene, enum hg_object_kind kind, uint32_t extra)
{
    struct hg_object_list *list = &scene->objects[kind];
    if (extra > UINT32_MAX / 4 - list->count)
        return HG_E_NOMEM;
    enum hg_status status =
        hg_grow(&list->items, &list->capacity, (size_t)list->count + extra, sizeof *list->items);
    return status ? status : id_reserve(&scene->ids[kind], extra);
}

static void register_object(
    struct hg_scene *scene, enum hg_object_kind kind, struct hg_object *object)
{
    struct hg_object_list *list = &scene->objects[kind];
    list->items[list->count++] = object;
    id_put(&scene->ids[kind], object);
    hg_scene_touch(scene, object);
}

enum hg_status hg_scene_add(
    struct hg_scene *scene, enum hg_object_kind kind, uint64_t id, struct hg_object **out)
{
    *out = NULL;
    if ((unsigned)kind >= HG_OBJECT_KINDS || id >> 32 != 0)
        return HG_E_INVAL;
    if (hg_scene_find(scene, kind, id))
        return HG_E_EXISTS;
    enum hg_status status = reserve(scene, kind, 1);
    if (status)
        return status;
    struct hg_object *object = new_object(kind);
    if (!object)
        return HG_E_NOMEM;
    object->id = id;
    register_object(scene, kind, object);
    *out = object;
    return HG_OK;
}

// ---- references --------------------------------------------------------------------------------

// A set of objects that are about to go: one object, or all of an asset.
struct doomed {
    const struct hg_object *object;
    uint64_t asset; // high half of ids; used when object is NULL
};

static bool is_doomed(const struct doomed *doomed, const void *object)
{
    const struct hg_object *o = object;
    if (!o)
        return false;
    return doomed->object ? o == doomed->object : o->id >> 32 == doomed->asset;
}

static void unlink_node(struct hg_node *node)
{
    if (!node->parent)
        return;
    struct hg_node **link = &node->parent->first_child;
    while (*link != node)
        link = &(*link)->next_sibling;
    *link = node->next_sibling;
    node->next_sibling = NULL;
    node->parent = NULL;
}

static void forget_in_node(
    struct hg_scene *scene, struct hg_node *node, const struct doomed *doomed)
{
    bool changed = false;
    if (is_doomed(doomed, node->mesh)) {
        node->mesh = NULL;
        node->skin = NULL;
        hg_free(node->weights);
        node->weights = NULL;
        changed = true;
    }
    if (is_doomed(doomed, node->light)) {
        node->light = NULL;
        changed = true;
    }
    if (is_doomed(doomed, node->camera)) {
        node->camera = NULL;
        changed = true;
    }
    if (is_doomed(doomed, node->parent)) {
        unlink_node(node);
        changed = true;
    }
    if (changed)
        hg_scene_touch(scene, &node->head);
}

static void forget_in_mesh(
    struct hg_scene *scene, struct hg_mesh *mesh, const struct doomed *doomed)
{
    for (uint32_t p = 0; p < mesh->part_count; p++)
        if (is_doomed(doomed, mesh->parts[p].material)) {
            mesh->parts[p].material = NULL;
            hg_scene_touch(scene, &mesh->head);
        }
}

static void forget_in_material(
    struct hg_scene *scene, struct hg_material *material, const struct doomed *doomed)
{
    for (int s = 0; s < HG_SLOT_COUNT; s++)
        if (is_doomed(doomed, material->slots[s].texture)) {
            material->slots[s].texture = NULL;
            hg_scene_touch(scene, &material->head);
        }
}

static void forget_in_lights(struct hg_scene *scene, const struct doomed *doomed)
{
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_LIGHT];
    for (uint32_t i = 0; i < list->count; i++) {
        struct hg_light *light = (struct hg_light *)list->items[i];
        if (is_doomed(doomed, light) || !is_doomed(doomed, light->texture))
            continue;
        if (hg_light_set_texture(light, NULL, NULL) == HG_OK)
            hg_scene_touch(scene, &light->head);
    }
}

// Clears what surviving objects say about doomed ones.
static void forget(struct hg_scene *scene, const struct doomed *doomed)
{
    for (int kind = HG_OBJECT_NODE; kind <= HG_OBJECT_MATERIAL; kind++) {
        struct hg_object_list *list = &scene->objects[kind];
        for (uint32_t i = 0; i < list->count; i++) {
            struct hg_object *object = list->items[i];
            if (is_doomed(doomed, object))
                continue;
            if (kind == HG_OBJECT_NODE)
                forget_in_node(scene, (struct hg_node *)object, doomed);
            else if (kind == HG_OBJECT_MESH)
                forget_in_mesh(scene, (struct hg_mesh *)object, doomed);
            else
                forget_in_material(scene, (struct hg_material *)object, doomed);
        }
    }
    forget_in_lights(scene, doomed);
    struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++)
        if (is_doomed(doomed, nodes->items[i]) &&
            !is_doomed(doomed, ((struct hg_node *)nodes->items[i])->parent))
            unlink_node((struct hg_node *)nodes->items[i]);
}

static void unregister(
    struct hg_scene *scene, enum hg_object_kind kind, const struct doomed *doomed)
{
    struct hg_object_list *list = &scene->objects[kind];
    uint32_t kept = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        struct hg_object *object = list->items[i];
        if (is_doomed(doomed, object))
            id_remove(&scene->ids[kind], object->id);
        else
            list->items[kept++] = object;
    }
    list->count = kept;
}

enum hg_status hg_scene_remove(
    struct hg_scene *scene, enum hg_object_kind kind, uint64_t id, struct hg_error *err)
{
    struct hg_object *object = hg_scene_find(scene, kind, id);
    if (!object)
        return hg_error_set(
            err, HG_E_NOTFOUND, "object", NULL, "no object has id %llu", (unsigned long long)id);
    if (!is_client_made(object))
        return hg_error_set(err, HG_E_STATE, "object", NULL,
            "object %llu belongs to asset %u; unload the asset", (unsigned long long)id,
            (unsigned)(id >> 32));
    struct doomed doomed = {.object = object};
    forget(scene, &doomed);
    unregister(scene, kind, &doomed);
    hg_object_destroy(kind, object);
    return HG_OK;
}

enum hg_status hg_scene_set_parent(
    struct hg_scene *scene, struct hg_node *node, struct hg_node *parent)
{
    for (const struct hg_node *up = parent; up; up = up->parent)
        if (up == node)
            return HG_E_INVAL;
    if (node->parent != parent) {
        unlink_node(node);
        if (parent)
            hg_node_append_child(parent, node);
    }
    hg_scene_touch(scene, &node->head);
    return HG_OK;
}

// ---- assets ------------------------------------------------------------------------------------

struct kind_array {
    void *items;
    uint32_t count;
};

static struct kind_array asset_objects(const struct hg_asset *asset, int kind)
{
    switch (kind) {
    case HG_OBJECT_NODE:
        return (struct kind_array){asset->nodes, asset->node_count};
    case HG_OBJECT_MESH:
        return (struct kind_array){asset->meshes, asset->mesh_count};
    case HG_OBJECT_MATERIAL:
        return (struct kind_array){asset->materials, asset->material_count};
    case HG_OBJECT_TEXTURE:
        return (struct kind_array){asset->textures, asset->texture_count};
    case HG_OBJECT_LIGHT:
        return (struct kind_array){asset->lights, asset->light_count};
    default:
        return (struct kind_array){asset->cameras, asset->camera_count};
    }
}

struct hg_asset *hg_scene_find_asset(const struct hg_scene *scene, uint32_t number)
{
    for (uint32_t i = 0; i < scene->asset_count; i++)
        if (scene->assets[i]->number == number)
            return scene->assets[i];
    return NULL;
}

static void mark_animated(const struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->animation_count; i++)
        for (uint32_t c = 0; c < asset->animations[i].channel_count; c++) {
            const struct hg_anim_channel *channel = &asset->animations[i].channels[c];
            if (channel->node && channel->path != HG_ANIM_WEIGHTS)
                channel->node->animated = true;
        }
}

enum hg_status hg_scene_add_asset(
    struct hg_scene *scene, struct hg_asset *asset, struct hg_node *parent)
{
    if (asset->number == 0)
        return HG_E_INVAL;
    if (hg_scene_find_asset(scene, asset->number))
        return HG_E_EXISTS;
    enum hg_status status = hg_grow(&scene->assets, &scene->asset_capacity,
        (size_t)scene->asset_count + 1, sizeof *scene->assets);
    for (int kind = 0; !status && kind < HG_OBJECT_KINDS; kind++)
        status = reserve(scene, (enum hg_object_kind)kind, asset_objects(asset, kind).count);
    if (!status)
        status = hg_asset_keep_rest(asset);
    if (status)
        return status;
    for (int kind = 0; kind < HG_OBJECT_KINDS; kind++) {
        struct kind_array array = asset_objects(asset, kind);
        struct hg_object **items = array.items;
        for (uint32_t i = 0; i < array.count; i++)
            register_object(scene, (enum hg_object_kind)kind, items[i]);
    }
    hg_asset_align_origin(scene, asset);
    for (uint32_t i = 0; parent && i < asset->root_count; i++)
        hg_node_append_child(parent, asset->roots[i]);
    scene->assets[scene->asset_count++] = asset;
    asset->scene = scene;
    mark_animated(asset);
    return HG_OK;
}

enum hg_status hg_scene_remove_asset(struct hg_scene *scene, uint32_t number)
{
    struct hg_asset *asset = hg_scene_find_asset(scene, number);
    if (!asset)
        return HG_E_NOTFOUND;
    struct doomed doomed = {.asset = number};
    forget(scene, &doomed);
    for (int kind = 0; kind < HG_OBJECT_KINDS; kind++)
        unregister(scene, (enum hg_object_kind)kind, &doomed);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < scene->asset_count; i++)
        if (scene->assets[i] != asset)
            scene->assets[kept++] = scene->assets[i];
    scene->asset_count = kept;
    hg_asset_destroy(asset);
    return HG_OK;
}

// ---- world -------------------------------------------------------------------------------------

// Next node of a depth-first walk below `top` (NULL = the end). Uses links only, so that deep
// hierarchies cost no stack.
static struct hg_node *next_node(struct hg_node *node, const struct hg_node *top)
{
    if (node->first_child)
        return node->first_child;
    while (node != top && !node->next_sibling)
        node = node->parent;
    return node == top ? NULL : node->next_sibling;
}

static void update_node(struct hg_node *node)
{
    bool first = node->world[15] == 0; // never updated before
    memcpy(node->previous_world, node->world, sizeof node->world);
    if (node->has_matrix)
        memcpy(node->world, node->matrix, sizeof node->world);
    else
        hg_mat4_from_trs(node->translation, node->rotation, node->scale, node->world);
    node->world_visible = node->visible;
    if (node->parent) {
        hg_mat4_mul(node->parent->world, node->world, node->world);
        node->world_visible = node->visible && node->parent->world_visible;
    }
    if (first)
        memcpy(node->previous_world, node->world, sizeof node->world);
}

void hg_scene_update(struct hg_scene *scene)
{
    struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        struct hg_node *top = (struct hg_node *)nodes->items[i];
        if (top->parent)
            continue;
        for (struct hg_node *node = top; node; node = next_node(node, top))
            update_node(node);
    }
}

// A box and whether anything was added to it.
struct growing_box {
    float *min, *max;
    bool any;
};

static bool grow_box(void *user, const float matrix[16], const float min[3], const float max[3])
{
    struct growing_box *box = user;
    box->any = true;
    hg_bounds_add_box(box->min, box->max, matrix, min, max);
    return false;
}

static bool add_node_bounds(const struct hg_node *node, float min[3], float max[3])
{
    struct growing_box box = {min, max, false};
    hg_extent_visit_boxes(node, grow_box, &box);
    return box.any;
}

bool hg_scene_bounds(
    const struct hg_scene *scene, const struct hg_node *node, float min[3], float max[3])
{
    bool any = false;
    hg_bounds_clear(min, max);
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    if (node)
        for (struct hg_node *n = (struct hg_node *)node; n; n = next_node(n, node))
            any |= add_node_bounds(n, min, max);
    else
        for (uint32_t i = 0; i < nodes->count; i++)
            any |= add_node_bounds((struct hg_node *)nodes->items[i], min, max);
    if (!any)
        for (int i = 0; i < 3; i++)
            min[i] = max[i] = 0;
    return any;
}

// ---- an asset by itself ------------------------------------------------------------------------

// World matrices of an asset's nodes, by index, without touching the nodes.
static void asset_worlds(const struct hg_asset *asset, float (*worlds)[16])
{
    for (uint32_t i = 0; i < asset->root_count; i++)
        for (struct hg_node *n = asset->roots[i]; n; n = next_node(n, asset->roots[i])) {
            float *world = worlds[(uint32_t)n->head.id];
            if (n->has_matrix)
                memcpy(world, n->matrix, sizeof n->matrix);
            else
                hg_mat4_from_trs(n->translation, n->rotation, n->scale, world);
            if (n != asset->roots[i])
                hg_mat4_mul(worlds[(uint32_t)n->parent->head.id], world, world);
        }
}

bool hg_asset_bounds(const struct hg_asset *asset, float min[3], float max[3])
{
    hg_bounds_clear(min, max);
    bool any = false;
    float(*worlds)[16] = hg_calloc(asset->node_count, sizeof *worlds);
    if (!worlds)
        return false;
    asset_worlds(asset, worlds);
    for (uint32_t i = 0; i < asset->node_count; i++) {
        struct hg_node copy = *asset->nodes[i];
        memcpy(copy.world, worlds[i], sizeof copy.world);
        copy.world_visible = copy.world[15] != 0 && copy.visible;
        copy.skin = NULL; // the bind pose stands for the skinned mesh
        any |= add_node_bounds(&copy, min, max);
    }
    hg_free(worlds);
    return any;
}
