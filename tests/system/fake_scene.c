#include "tests/system/fake_scene.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

enum { MAX_OBJECTS = 8192 };

struct open_message {
    struct hg_arena arena;
    union hgp_any any;
};

static void open_packet(const struct hg_packet *packet, struct open_message *m)
{
    *m = (struct open_message){0};
    if (hgp_decode(HGP_VERSION_MAX, packet->header.type,
            hg_reader_make(packet->payload, packet->header.length), &m->arena, &m->any, NULL))
        abort(); // the broker lets nothing bad through
}

static void rewrite(struct fake_object *object, const union hgp_any *any)
{
    struct hg_packet *packet = hg_packet_encode((enum hgp_type)object->type, any);
    if (!packet)
        abort();
    hg_packet_unref(object->packet);
    object->packet = packet;
}

void fake_merge(struct hg_packet **slot, struct hg_packet *packet)
{
    if (!*slot) {
        *slot = hg_packet_ref(packet);
        return;
    }
    struct open_message older, newer;
    open_packet(*slot, &older);
    open_packet(packet, &newer);
    enum hgp_type type = (enum hgp_type)packet->header.type;
    if (type == HGP_T_view_camera)
        older.any.view_camera.has_camera = false;
    if (type == HGP_T_environment_set &&
        (newer.any.environment_set.has_path || newer.any.environment_set.has_hash))
        older.any.environment_set.has_path = older.any.environment_set.has_hash = false;
    if (type == HGP_T_material_set && newer.any.material_set.has_emissive)
        older.any.material_set.has_emissive_strength = false;
    hgp_merge(type, &older.any, &newer.any);
    struct hg_packet *merged = hg_packet_encode(type, &older.any);
    if (!merged)
        abort();
    hg_packet_unref(*slot);
    *slot = merged;
    hg_arena_finish(&older.arena);
    hg_arena_finish(&newer.arena);
}

struct fake_object *fake_scene_find(
    const struct fake_scene *scene, uint16_t type, uint64_t id, int64_t extra)
{
    for (struct fake_object *it = scene->objects; it; it = it->next)
        if (it->type == type && it->id == id && it->extra == extra)
            return it;
    return NULL;
}

static bool exists(const struct fake_scene *scene, uint16_t type, uint64_t id)
{
    if (!id)
        return true;
    return id >> 32 ? fake_scene_find(scene, HGP_T_asset_load, id >> 32, 0) != NULL
                    : fake_scene_find(scene, type, id, 0) != NULL;
}

static struct fake_object *add(
    struct fake_scene *scene, uint64_t id, int64_t extra, struct hg_packet *packet)
{
    struct fake_object *object = hg_calloc(1, sizeof *object);
    if (!object)
        abort();
    *object = (struct fake_object){.next = scene->objects,
        .type = packet->header.type,
        .id = id,
        .extra = extra,
        .packet = hg_packet_ref(packet)};
    return scene->objects = object;
}

static void put(struct fake_scene *scene, uint64_t id, struct hg_packet *packet)
{
    struct fake_object *object = fake_scene_find(scene, packet->header.type, id, 0);
    if (object)
        fake_merge(&object->packet, packet);
    else
        add(scene, id, 0, packet);
}

// ---- going --------------------------------------------------------------------------------------

// What goes: one object, or everything of an asset.
struct doomed {
    uint16_t type;
    uint64_t id;
    uint32_t asset; // 0 = the object
};

static bool is_doomed(const struct doomed *d, uint16_t type, uint64_t id)
{
    return id && (d->asset ? id >> 32 == d->asset : type == d->type && id == d->id);
}

static void forget_in_node(struct fake_object *object, const struct doomed *d)
{
    struct open_message m;
    open_packet(object->packet, &m);
    struct hgp_node_set *n = &m.any.node_set;
    n->has_parent &= !is_doomed(d, HGP_T_node_set, n->parent);
    n->has_mesh &= !is_doomed(d, HGP_T_mesh_set, n->mesh);
    n->has_light &= !is_doomed(d, HGP_T_light_set, n->light);
    n->has_camera &= !is_doomed(d, HGP_T_camera_set, n->camera);
    rewrite(object, &m.any);
    hg_arena_finish(&m.arena);
}

static void forget_in_material(struct fake_object *object, const struct doomed *d)
{
    struct open_message m;
    open_packet(object->packet, &m);
    struct hgp_material_set *s = &m.any.material_set;
    s->has_base_color_texture &= !is_doomed(d, HGP_T_texture_set, s->base_color_texture);
    s->has_normal_texture &= !is_doomed(d, HGP_T_texture_set, s->normal_texture);
    rewrite(object, &m.any);
    hg_arena_finish(&m.arena);
}

static void forget_in_mesh(struct fake_object *object, const struct doomed *d)
{
    struct open_message m;
    open_packet(object->packet, &m);
    for (uint32_t i = 0; i < m.any.mesh_set.parts.count; i++) {
        struct hgp_mesh_part *part = (struct hgp_mesh_part *)&m.any.mesh_set.parts.items[i];
        if (is_doomed(d, HGP_T_material_set, part->material))
            part->material = 0;
    }
    rewrite(object, &m.any);
    hg_arena_finish(&m.arena);
}

static void forget_in_load(struct fake_object *object, const struct doomed *d)
{
    struct open_message m;
    open_packet(object->packet, &m);
    m.any.asset_load.has_parent &= !is_doomed(d, HGP_T_node_set, m.any.asset_load.parent);
    rewrite(object, &m.any);
    hg_arena_finish(&m.arena);
}

static bool goes_with(const struct fake_object *object, const struct doomed *d)
{
    if (!d->asset)
        return object->type == d->type && object->id == d->id;
    switch (object->type) {
    case HGP_T_asset_load:
    case HGP_T_variant_set:
    case HGP_T_animation_set:
        return object->id == d->asset;
    case HGP_T_environment_set:
        return false;
    default:
        return object->id >> 32 == d->asset;
    }
}

static void destroy(struct fake_object **link)
{
    struct fake_object *object = *link;
    *link = object->next;
    hg_packet_unref(object->packet);
    hg_free(object);
}

static void remove_doomed(struct fake_scene *scene, const struct doomed *d)
{
    for (struct fake_object **link = &scene->objects; *link;)
        if (goes_with(*link, d))
            destroy(link);
        else
            link = &(*link)->next;
    for (struct fake_object *it = scene->objects; it; it = it->next) {
        if (it->type == HGP_T_node_set)
            forget_in_node(it, d);
        if (it->type == HGP_T_material_set)
            forget_in_material(it, d);
        if (it->type == HGP_T_mesh_set)
            forget_in_mesh(it, d);
        if (it->type == HGP_T_asset_load)
            forget_in_load(it, d);
    }
}

static enum hg_status object_remove(struct fake_scene *scene, const struct hgp_object_remove *m)
{
    static const uint16_t types[] = {HGP_T_node_set, HGP_T_mesh_set, HGP_T_material_set,
        HGP_T_texture_set, HGP_T_light_set, HGP_T_camera_set};
    if (m->object >> 32 || !exists(scene, types[m->kind], m->object))
        return HG_E_NOTFOUND;
    remove_doomed(scene, &(struct doomed){.type = types[m->kind], .id = m->object});
    return HG_OK;
}

// ---- edits --------------------------------------------------------------------------------------

static uint64_t parent_of(const struct fake_scene *scene, uint64_t node)
{
    struct fake_object *object = fake_scene_find(scene, HGP_T_node_set, node, 0);
    struct hgp_node_set m = {0};
    if (object &&
        hgp_decode(HGP_VERSION_MAX, HGP_T_node_set,
            hg_reader_make(object->packet->payload, object->packet->header.length), NULL, &m, NULL))
        abort();
    return m.has_parent ? m.parent : 0;
}

static enum hg_status check_node(const struct fake_scene *scene, const struct hgp_node_set *m)
{
    if ((m->has_parent && !exists(scene, HGP_T_node_set, m->parent)) ||
        (m->has_mesh && !exists(scene, HGP_T_mesh_set, m->mesh)) ||
        (m->has_light && !exists(scene, HGP_T_light_set, m->light)) ||
        (m->has_camera && !exists(scene, HGP_T_camera_set, m->camera)))
        return HG_E_NOTFOUND;
    for (uint64_t up = m->has_parent ? m->parent : 0; up; up = parent_of(scene, up))
        if (up == m->node)
            return HG_E_INVAL;
    return HG_OK;
}

static enum hg_status check_mesh(const struct fake_scene *scene, const struct hgp_mesh_set *m)
{
    for (uint32_t i = 0; i < m->parts.count; i++)
        if (!exists(scene, HGP_T_material_set, m->parts.items[i].material))
            return HG_E_NOTFOUND;
    return HG_OK;
}

static enum hg_status check_material(
    const struct fake_scene *scene, const struct hgp_material_set *m)
{
    if (m->has_emissive_strength && !m->has_emissive)
        return HG_E_INVAL;
    return (m->has_base_color_texture &&
               !exists(scene, HGP_T_texture_set, m->base_color_texture)) ||
                   (m->has_normal_texture && !exists(scene, HGP_T_texture_set, m->normal_texture))
               ? HG_E_NOTFOUND
               : HG_OK;
}

static enum hg_status asset_load(
    struct fake_scene *scene, struct hg_packet *packet, const struct hgp_asset_load *m)
{
    if (fake_scene_find(scene, HGP_T_asset_load, m->asset, 0))
        return HG_E_EXISTS;
    if (m->has_parent && !exists(scene, HGP_T_node_set, m->parent))
        return HG_E_NOTFOUND;
    add(scene, m->asset, 0, packet);
    return HG_OK;
}

static enum hg_status asset_unload(struct fake_scene *scene, uint32_t asset)
{
    if (!fake_scene_find(scene, HGP_T_asset_load, asset, 0))
        return HG_E_NOTFOUND;
    remove_doomed(scene, &(struct doomed){.asset = asset});
    return HG_OK;
}

// A pose moves all nodes of its asset; later moves win over it, later poses over those.
static enum hg_status animation_set(
    struct fake_scene *scene, struct hg_packet *packet, const struct hgp_animation_set *m)
{
    if (!fake_scene_find(scene, HGP_T_asset_load, m->asset, 0))
        return HG_E_NOTFOUND;
    for (struct fake_object **link = &scene->objects; *link;)
        if ((*link)->type == HGP_T_animation_set && (*link)->id == m->asset &&
            (m->animation < 0 || (*link)->extra == m->animation))
            destroy(link);
        else
            link = &(*link)->next;
    for (struct fake_object *it = scene->objects; it; it = it->next) {
        if (it->type != HGP_T_node_set || it->id >> 32 != m->asset)
            continue;
        struct open_message node;
        open_packet(it->packet, &node);
        node.any.node_set.has_translation = node.any.node_set.has_rotation = false;
        rewrite(it, &node.any);
        hg_arena_finish(&node.arena);
    }
    add(scene, m->asset, m->animation, packet); // in front: the list has the newest first
    return HG_OK;
}

static enum hg_status variant_set(
    struct fake_scene *scene, struct hg_packet *packet, uint32_t asset)
{
    if (!fake_scene_find(scene, HGP_T_asset_load, asset, 0))
        return HG_E_NOTFOUND;
    put(scene, asset, packet);
    return HG_OK;
}

struct range {
    uint32_t first, count;
};

static enum hg_status object_set(
    struct fake_scene *scene, struct hg_packet *packet, uint64_t id, struct range range)
{
    bool known = fake_scene_find(scene, packet->header.type, id, 0) ||
                 (id >> 32 && exists(scene, packet->header.type, id));
    if (!known && (id < range.first || id - range.first >= range.count))
        return HG_E_NOTFOUND;
    put(scene, id, packet);
    return HG_OK;
}

static enum hg_status apply(struct fake_scene *scene, struct hg_packet *packet,
    const union hgp_any *any, struct range range)
{
    enum hg_status status = HG_OK;
    switch (packet->header.type) {
    case HGP_T_asset_load:
        return asset_load(scene, packet, &any->asset_load);
    case HGP_T_asset_unload:
        return asset_unload(scene, any->asset_unload.asset);
    case HGP_T_object_remove:
        return object_remove(scene, &any->object_remove);
    case HGP_T_animation_set:
        return animation_set(scene, packet, &any->animation_set);
    case HGP_T_variant_set:
        return variant_set(scene, packet, any->variant_set.asset);
    case HGP_T_environment_set:
        put(scene, 0, packet);
        return HG_OK;
    case HGP_T_mesh_set:
        status = check_mesh(scene, &any->mesh_set);
        return status ? status : object_set(scene, packet, any->mesh_set.mesh, range);
    case HGP_T_node_set:
        status = check_node(scene, &any->node_set);
        return status ? status : object_set(scene, packet, any->node_set.node, range);
    case HGP_T_material_set:
        status = check_material(scene, &any->material_set);
        return status ? status : object_set(scene, packet, any->material_set.material, range);
    case HGP_T_texture_set:
        return object_set(scene, packet, any->texture_set.texture, range);
    case HGP_T_light_set:
        return object_set(scene, packet, any->light_set.light, range);
    case HGP_T_camera_set:
        return object_set(scene, packet, any->camera_set.camera, range);
    default:
        return HG_E_UNSUPPORTED;
    }
}

enum hg_status fake_scene_apply(
    struct fake_scene *scene, struct hg_packet *packet, uint32_t first_id, uint32_t id_count)
{
    struct open_message m;
    open_packet(packet, &m);
    enum hg_status status = apply(scene, packet, &m.any, (struct range){first_id, id_count});
    hg_arena_finish(&m.arena);
    return status;
}

// ---- looking ------------------------------------------------------------------------------------

static int compare(const void *a, const void *b)
{
    const struct fake_object *x = *(struct fake_object *const *)a;
    const struct fake_object *y = *(struct fake_object *const *)b;
    if (x->type != y->type)
        return x->type < y->type ? -1 : 1;
    return x->id < y->id ? -1 : x->id > y->id;
}

void fake_scene_hash(const struct fake_scene *scene, struct hg_sha256 *h)
{
    struct fake_object *sorted[MAX_OBJECTS];
    size_t count = 0;
    for (struct fake_object *it = scene->objects; it && count < MAX_OBJECTS; it = it->next) {
        if (it->type == HGP_T_animation_set) { // their order shows
            hg_sha256_update(h, it->packet->payload, it->packet->header.length);
            continue;
        }
        sorted[count++] = it;
    }
    qsort(sorted, count, sizeof *sorted, compare);
    for (size_t i = 0; i < count; i++) {
        hg_sha256_update(h, &sorted[i]->type, sizeof sorted[i]->type);
        hg_sha256_update(h, sorted[i]->packet->payload, sorted[i]->packet->header.length);
    }
}

void fake_scene_finish(struct fake_scene *scene)
{
    while (scene->objects)
        destroy(&scene->objects);
}
