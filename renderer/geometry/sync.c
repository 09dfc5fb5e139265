// sync.c - brings the device in line with a scene. See geometry.h.
//
// A sync first compares a signature of everything it reads; when it differs, lists are rebuilt
// and the device gets what differs: meshes by {id, revision}, poses by their bytes, tables by
// pieces. New sizes are checked against the budget before anything is taken or dropped.
#include "renderer/geometry/sync.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "base/hash.h"
#include "base/spill.h"

// --- signature -----------------------------------------------------------------------------------

// Nodes: where things are and what they look like from afar; without materials.
static uint64_t shape_signature(const struct hg_geometry *g, const struct hg_scene *scene)
{
    uint64_t h = 1;
    for (int i = 0; i < 3; i++)
        h = hg_hash_mix(h, (uint64_t)(int64_t)g->origin[i]);
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *n = (const struct hg_node *)nodes->items[i];
        h = hg_hash_mix_bytes(h, n->world, sizeof n->world); // also of joints, which have no mesh
        if (n->mesh == NULL)
            continue;
        h = hg_hash_mix(h, n->head.id);
        h = hg_hash_mix(h, n->head.revision);
        h = hg_hash_mix(h, n->mesh->head.id);
        h = hg_hash_mix(h, n->mesh->head.revision * 2 + n->world_visible);
        if (n->weights != NULL)
            h = hg_hash_mix_bytes(h, n->weights, n->mesh->target_count * sizeof *n->weights);
    }
    return h | 1;
}

static uint64_t material_signature(const struct hg_scene *scene, const struct hg_textures *textures)
{
    uint64_t h = textures != NULL ? hg_textures_revision(textures) : 0;
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_MATERIAL];
    for (uint32_t i = 0; i < list->count; i++) {
        h = hg_hash_mix(h, list->items[i]->id);
        h = hg_hash_mix(h, list->items[i]->revision);
    }
    for (uint32_t i = 0; i < scene->asset_count; i++)
        h = hg_hash_mix(h,
            (uint64_t)scene->assets[i]->number << 32 | (uint32_t)scene->assets[i]->variants.chosen);
    return h;
}

// --- lists ---------------------------------------------------------------------------------------

static enum hg_status out_of_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "geometry", NULL, "no memory");
}

static int compare_deforms(const void *a, const void *b)
{
    const struct hg_deform_entry *x = a, *y = b;
    if (x->node != y->node)
        return x->node < y->node ? -1 : 1;
    return x->part < y->part ? -1 : x->part > y->part;
}

struct hg_deform_entry *hg_sync_find_deform(
    const struct hg_deform_list *list, uint64_t node, uint32_t part)
{
    const struct hg_deform_entry key = {.node = node, .part = part};
    return list->count > 0 ? bsearch(&key, list->items, list->count, sizeof key, compare_deforms)
                           : NULL;
}

static void look(struct hg_sync *s)
{
    if (!s->looks)
        hg_spill_begin(NULL);
    s->looks = true;
}

static enum hg_status collect_meshes(struct hg_sync *s, struct hg_error *err)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_MESH];
    const uint32_t from = hg_lod_intake_from(s->g);
    const struct hg_mesh_entry_limits limits = {
        .number_below = hg_gpu_strategy(s->g->gpu)->provoking_vertices ? from : 0,
        .meshlets_below = from};
    s->meshes = hg_calloc(list->count, sizeof *s->meshes);
    if (s->meshes == NULL)
        return out_of_memory(err);
    for (uint32_t i = 0; i < list->count; i++) {
        const struct hg_mesh *mesh = (const struct hg_mesh *)list->items[i];
        struct hg_mesh_entry *entry = &s->meshes[s->mesh_count];
        const struct hg_mesh_entry *old =
            hg_mesh_entry_find(s->g->meshes, s->g->mesh_count, mesh->head.id);
        if (old != NULL && old->revision == mesh->head.revision) {
            *entry = *old;
            entry->is_new = false;
        } else {
            look(s);
            const enum hg_status status = hg_mesh_entry_init(entry, mesh, &limits, err);
            if (status != HG_OK)
                return status;
            entry->is_new = true;
        }
        entry->mesh = mesh;
        s->mesh_count++;
    }
    hg_mesh_entry_sort(s->meshes, s->mesh_count);
    return HG_OK;
}

static enum hg_status add_node_deforms(
    struct hg_sync *s, const struct hg_node *node, const struct hg_mesh_entry *mesh)
{
    struct hg_geometry *g = s->g;
    for (uint32_t part = 0; part < mesh->part_count; part++)
        if (mesh->parts[part].clusters != NULL)
            return HG_OK; // has neither joints nor targets
    if (!hg_deform_is_needed(node) && !(g->deform_all && mesh->target_count > 0) &&
        hg_sync_find_deform(&g->deforms, node->head.id, 0) == NULL)
        return HG_OK;
    for (uint32_t part = 0; part < mesh->part_count; part++) {
        const enum hg_status status = hg_grow(&s->deforms.items, &s->deforms.capacity,
            s->deforms.count + 1, sizeof *s->deforms.items);
        if (status != HG_OK)
            return status;
        struct hg_deform_entry fresh;
        hg_deform_init(&fresh, node, part, mesh);
        const struct hg_deform_entry *old = hg_sync_find_deform(&g->deforms, node->head.id, part);
        if (old != NULL && old->mesh == fresh.mesh && old->mesh_revision == fresh.mesh_revision &&
            old->joint_count == fresh.joint_count) {
            fresh = *old;
            fresh.source = &mesh->parts[part];
            fresh.is_new = false;
        } else {
            fresh.is_new = true;
        }
        fresh.node_object = node;
        s->deforms.items[s->deforms.count++] = fresh;
    }
    return HG_OK;
}

// Deformations of all visible nodes, and how many draws and instances there will be.
static enum hg_status collect_nodes(struct hg_sync *s, struct hg_error *err)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_NODE];
    uint64_t draws = 0, instances = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        const struct hg_node *node = (const struct hg_node *)list->items[i];
        if (node->mesh == NULL || !node->world_visible)
            continue;
        const struct hg_mesh_entry *mesh =
            hg_mesh_entry_find(s->meshes, s->mesh_count, node->mesh->head.id);
        if (mesh == NULL)
            continue;
        if (add_node_deforms(s, node, mesh) != HG_OK)
            return out_of_memory(err);
        const uint64_t copies = node->instance_count > 0 ? node->instance_count : 1;
        instances += copies;
        draws += copies * mesh->part_count;
    }
    if (draws >= 1u << 28 || instances >= 1u << 28)
        return hg_error_set(err, HG_E_LIMIT, "geometry", NULL, "more than 2^28 draws or instances");
    if (s->deforms.count > 0)
        qsort(s->deforms.items, s->deforms.count, sizeof *s->deforms.items, compare_deforms);
    s->draw_limit = (uint32_t)draws;
    s->instance_limit = (uint32_t)instances;
    s->part_count = s->deforms.count;
    for (uint32_t i = 0; i < s->mesh_count; i++)
        s->part_count += s->meshes[i].part_count;
    const struct hg_object_list *materials = &s->scene->objects[HG_OBJECT_MATERIAL];
    s->materials.count = materials->count + 1;
    for (uint32_t i = 0; i < materials->count; i++)
        s->materials.lobe_count +=
            hg_material_lobes((const struct hg_material *)materials->items[i]) != 0;
    return HG_OK;
}

// --- budget --------------------------------------------------------------------------------------

static uint64_t bytes_of(const struct hg_sync *s)
{
    uint64_t bytes = s->draw_limit * sizeof(struct hg_gpu_draw) +
                     s->instance_limit * sizeof(struct hg_gpu_instance) +
                     s->part_count * sizeof(struct hg_gpu_part) +
                     s->materials.count * sizeof(struct hg_gpu_material) +
                     s->materials.lobe_count * sizeof(struct hg_gpu_lobes);
    bytes += bytes / 2; // tables grow by half
    for (uint32_t i = 0; i < s->mesh_count; i++)
        bytes += s->meshes[i].bytes;
    for (uint32_t i = 0; i < s->deforms.count; i++)
        bytes += hg_deform_bytes(&s->deforms.items[i]);
    return bytes;
}

// What the parts leave of the budget is for chunks; the pool gives back what it has above that, up
// to a block. Returns what it cannot do without.
static uint64_t pool_bytes(struct hg_geometry *g, uint64_t bytes)
{
    struct hg_cluster_pool_stats pool;
    const uint64_t budget = g->params.budget_bytes;
    if (g->pool == NULL)
        return 0;
    hg_geometry_note_peak(g);
    hg_cluster_pool_set_budget(g->pool, budget == 0 ? 0 : budget > bytes ? budget - bytes : 1);
    hg_cluster_pool_stats(g->pool, &pool);
    return pool.root_bytes;
}

static enum hg_status check_budget(struct hg_sync *s, struct hg_error *err)
{
    struct hg_geometry *g = s->g;
    const uint64_t budget = g->params.budget_bytes;
    uint64_t bytes = bytes_of(s), chunks = pool_bytes(g, bytes);
    if (budget > 0 && g->pool != NULL && bytes + chunks > budget) {
        // Not all parts fit as they are: what can have levels is shown by proxies until it has
        // them.
        hg_lod_intake_queue(g, s->meshes, s->mesh_count);
        if (hg_lod_intake_show_proxies(g, s->meshes, s->mesh_count, bytes + chunks) != HG_OK)
            return out_of_memory(err);
        bytes = bytes_of(s);
        chunks = pool_bytes(g, bytes);
    }
    if (budget > 0 && g->pool != NULL && bytes + chunks > budget) { // parts that are shown already
        hg_lod_intake_collect(g, s->meshes, s->mesh_count, HG_COND_FOREVER);
        bytes = bytes_of(s);
        chunks = pool_bytes(g, bytes);
    }
    uint64_t proxies;
    const uint64_t lost = hg_lod_intake_lost_bytes(s->meshes, s->mesh_count, &proxies);
    if (lost > 0) { // those that could not get levels are shown as they are, or nothing is
        bytes += lost - proxies;
        chunks = pool_bytes(g, bytes);
        s->drops_proxies = true;
    }
    if (lost > 0 && bytes + chunks > budget)
        return hg_error_set(err, HG_E_LIMIT, "geometry budget", NULL,
            "%llu bytes are meshes that could not get levels of detail, the budget is %llu",
            (unsigned long long)lost, (unsigned long long)budget);
    if (budget > 0 && bytes + chunks > budget)
        return hg_error_set(err, HG_E_LIMIT, "geometry budget", NULL,
            "%llu bytes are needed, the budget is %llu", (unsigned long long)(bytes + chunks),
            (unsigned long long)budget);
    s->used_bytes = bytes;
    return HG_OK;
}

// --- upload --------------------------------------------------------------------------------------

static enum hg_status upload_meshes(struct hg_sync *s, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (s->drops_proxies) {
        look(s);
        status = hg_lod_intake_drop_proxies(s->g, s->meshes, s->mesh_count, &s->written, err);
    }
    for (uint32_t i = 0; i < s->mesh_count && status == HG_OK; i++) {
        struct hg_mesh_entry *entry = &s->meshes[i];
        if (!entry->is_new)
            continue;
        status = hg_mesh_entry_upload(s->g->gpu, entry, entry->mesh, &s->written, err);
        s->uploads += entry->part_count;
    }
    for (uint32_t i = 0; i < s->deforms.count && status == HG_OK; i++) {
        struct hg_deform_entry *entry = &s->deforms.items[i];
        status = hg_deform_update(s->g->gpu, entry, entry->node_object, &s->written, err);
    }
    return status;
}

// --- commit --------------------------------------------------------------------------------------

static enum hg_status list_changed_deforms(struct hg_geometry *g)
{
    const enum hg_status status = hg_grow(
        &g->changed.items, &g->changed.capacity, g->deforms.count, sizeof *g->changed.items);
    g->changed.count = 0;
    for (uint32_t i = 0; i < g->deforms.count && status == HG_OK; i++)
        if (g->deforms.items[i].changed)
            g->changed.items[g->changed.count++] = i;
    return status;
}

// Old entries that the new lists did not take over.
static void retire_old(struct hg_sync *s)
{
    struct hg_geometry *g = s->g;
    for (uint32_t i = 0; i < g->mesh_count; i++) {
        const struct hg_mesh_entry *now =
            hg_mesh_entry_find(s->meshes, s->mesh_count, g->meshes[i].id);
        if (now == NULL || now->is_new)
            hg_mesh_entry_finish(g->gpu, g->pool, &g->meshes[i]);
    }
    for (uint32_t i = 0; i < g->deforms.count; i++) {
        const struct hg_deform_entry *now =
            hg_sync_find_deform(&s->deforms, g->deforms.items[i].node, g->deforms.items[i].part);
        if (now == NULL || now->is_new)
            hg_deform_finish(g->gpu, &g->deforms.items[i]);
    }
}

#define SWAP(a, b)                                                                                 \
    do {                                                                                           \
        __typeof__(a) swap_ = (a);                                                                 \
        (a) = (b);                                                                                 \
        (b) = swap_;                                                                               \
    } while (0)

static enum hg_status commit(struct hg_sync *s, struct hg_error *err)
{
    struct hg_geometry *g = s->g;
    hg_moved_casters_note(s);
    retire_old(s);
    SWAP(g->meshes, s->meshes);
    SWAP(g->deforms, s->deforms);
    SWAP(g->draws, s->draws);
    g->mesh_count = s->mesh_count;
    g->draw_count = s->draw_count;
    g->tables.part_count = s->part_count;
    g->tables.material_count = s->materials.count;
    g->tables.instance_count = s->instance_count;
    g->bounds = s->bounds;
    g->one_shape = s->materials.one_shape;
    g->bits = s->bits;
    struct hg_geometry_stats *st = &g->stats;
    st->used_bytes = s->used_bytes;
    hg_geometry_note_peak(g);
    st->uploaded_bytes = s->written;
    st->triangles_total = s->triangles;
    st->draws = s->draw_count;
    st->instances = s->instance_count;
    st->parts = s->part_count;
    st->materials = s->materials.count;
    st->deforms = g->deforms.count;
    st->parts_uploaded = s->uploads;
    st->proxies = 0;
    for (uint32_t i = 0; i < g->mesh_count; i++)
        for (uint32_t p = 0; p < g->meshes[i].part_count; p++)
            st->proxies += g->meshes[i].parts[p].proxy != NULL;
    if (list_changed_deforms(g) != HG_OK)
        return out_of_memory(err);
    st->deforms_changed = g->changed.count;
    return HG_OK;
}

// New entries go; old ones may have got levels, and their poses may have been written, so they run
// again.
static void roll_back(struct hg_sync *s)
{
    struct hg_geometry *g = s->g;
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        if (s->meshes[i].is_new)
            hg_mesh_entry_finish(g->gpu, g->pool, &s->meshes[i]);
        else
            hg_mesh_entry_find(g->meshes, g->mesh_count, s->meshes[i].id)->bytes =
                s->meshes[i].bytes;
    }
    for (uint32_t i = 0; i < s->deforms.count; i++)
        if (s->deforms.items[i].is_new)
            hg_deform_finish(g->gpu, &s->deforms.items[i]);
    for (uint32_t i = 0; i < g->deforms.count; i++)
        if (g->deforms.items[i].pose != NULL)
            memset(g->deforms.items[i].pose, 0, g->deforms.items[i].params_bytes);
    g->signature = 0;
}

static enum hg_status sync_changed(struct hg_sync *s, struct hg_error *err)
{
    enum hg_status status = collect_meshes(s, err);
    if (status == HG_OK)
        status = collect_nodes(s, err);
    if (status == HG_OK)
        status = check_budget(s, err);
    if (status == HG_OK)
        status = upload_meshes(s, err);
    if (status == HG_OK)
        status = hg_draw_tables_make(s, err);
    if (status == HG_OK)
        status = hg_draw_tables_write(s, err);
    if (status != HG_OK) {
        roll_back(s);
        return status;
    }
    return commit(s, err);
}

// --- the whole -----------------------------------------------------------------------------------

// Masked and blended draws throw shadows with holes: a change of materials shows there too.
static uint64_t caster_signature(const struct hg_geometry *g, uint64_t shape, uint64_t material)
{
    bool holes = false;
    for (uint32_t i = 0; i < g->draw_count; i++) {
        shape = hg_hash_mix(shape, g->draws[i].gpu.flags);
        holes = holes || (g->draws[i].gpu.flags & (HG_DRAW_MASK | HG_DRAW_BLEND)) != 0;
    }
    return holes ? hg_hash_mix(shape, material) : shape;
}

enum hg_status hg_geometry_sync(struct hg_geometry *g, const struct hg_scene *scene,
    const struct hg_textures *textures, struct hg_error *err)
{
    const uint64_t shape = shape_signature(g, scene);
    const uint64_t material = material_signature(scene, textures);
    const uint64_t signature = hg_hash_mix(shape, material) | 1;
    g->stats.uploaded_bytes = 0;
    g->stats.parts_uploaded = 0;
    g->stats.deforms_changed = g->changed.count;
    if (signature == g->signature)
        return HG_OK;
    struct hg_sync s = {.g = g, .scene = scene, .textures = textures, .material = material};
    const enum hg_status status = sync_changed(&s, err);
    if (status == HG_OK) {
        const uint64_t casters = caster_signature(g, shape, material);
        g->shape_revision += casters != g->shape_signature;
        g->shape_signature = casters;
        g->signature = signature;
        g->revision++;
        hg_lod_intake_queue(g, g->meshes, g->mesh_count);
    }
    if (s.looks)
        hg_spill_end();
    hg_free(s.meshes);
    hg_free(s.deforms.items);
    hg_draw_tables_finish(&s);
    return status;
}
