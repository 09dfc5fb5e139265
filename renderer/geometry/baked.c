// baked.c - parts that get levels of detail: which, and how results come in. See internal.h.
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/geometry/internal.h"

#define BAKE_FROM 32768u // triangles

static bool can_bake(const struct hg_geometry *g, const struct hg_mesh *mesh)
{
    for (uint32_t p = 0; p < mesh->part_count; p++)
        if (mesh->parts[p].joints != NULL) // the node's other parts are posed with it
            return false;
    for (uint32_t i = 0; i < g->deform_count; i++)
        if (g->deforms[i].mesh == mesh->head.id)
            return false;
    return true;
}

uint32_t hg_baked_from(const struct hg_geometry *g)
{
    if (g->baker == NULL)
        return UINT32_MAX;
    return g->params.bake_from > 0 ? g->params.bake_from : BAKE_FROM;
}

static bool is_large(const struct hg_geometry *g, const struct hg_part_entry *part)
{
    return part->primitive_count >= hg_baked_from(g) && part->clusters == NULL && !part->baking;
}

void hg_baked_queue(struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count)
{
    for (uint32_t i = 0; g->baker != NULL && i < count; i++) {
        struct hg_mesh_entry *e = &meshes[i];
        for (uint32_t p = 0; p < e->part_count; p++) {
            struct hg_part_entry *part = &e->parts[p];
            if (!is_large(g, part) || !can_bake(g, e->mesh) ||
                !hg_lod_can_bake(&e->mesh->parts[p], e->target_count))
                continue;
            // Without memory for a copy the part is drawn as it is.
            part->baking =
                hg_baker_add(g->baker, e->mesh, e->id, e->revision, p) == HG_OK;
        }
    }
}

// The part has chunks in place of streams of its own.
static void swap_in(struct hg_geometry *g, struct hg_mesh_entry *e, uint32_t index,
    struct hg_cluster_mesh *clusters)
{
    struct hg_part_entry *part = &e->parts[index];
    const uint64_t own = part->buffer.size_bytes > 0 ? part->layout.total_bytes : 0;
    g->stats.used_bytes += clusters->table.size_bytes;
    hg_geometry_note_peak(g);
    g->stats.used_bytes -= g->stats.used_bytes < own ? g->stats.used_bytes : own;
    e->bytes -= part->layout.total_bytes;
    hg_gpu_buffer_destroy(g->gpu, &part->buffer);
    hg_free(part->host_indices);
    hg_meshlets_finish(&part->meshlets);
    hg_numbered_finish(&part->numbered);
    part->host_indices = NULL;
    part->indices = part->numbered_indices = NULL;
    part->layout = (struct hg_pack_layout){
        .flags = clusters->lod->flags, .extra_words = clusters->lod->extra_words};
    part->clusters = clusters;
    hg_box_add_point(&part->bounds, clusters->lod->min);
    hg_box_add_point(&part->bounds, clusters->lod->max);
    e->bytes += clusters->table.size_bytes;
}

static bool take_in(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, struct hg_baked *baked)
{
    struct hg_mesh_entry *e = NULL;
    for (uint32_t i = 0; i < count; i++)
        if (meshes[i].id == baked->mesh && meshes[i].revision == baked->revision)
            e = &meshes[i];
    struct hg_cluster_mesh *clusters = NULL;
    struct hg_error err;
    const bool wanted = e != NULL && baked->status == HG_OK;
    if (wanted) {
        // The part itself goes only when its chunks are there: until then both count, and the
        // coarsest level may be above the budget (a chunk or a few).
        const uint64_t budget = g->params.budget_bytes, used = g->stats.used_bytes;
        if (budget > 0)
            hg_cluster_pool_set_budget(g->pool, budget > used ? budget - used : 1);
        baked->status = hg_cluster_mesh_open(
            g->pool, &baked->stored, baked->data, baked->size, &clusters, &err);
        if (baked->status != HG_OK)
            hg_warn(GEOMETRY, "a mesh part stays without levels of detail: %s", err.reason);
    } else {
        hg_lod_stored_close(&baked->stored);
        hg_free(baked->data);
    }
    if (clusters == NULL)
        return false;
    swap_in(g, e, baked->part, clusters);
    return true;
}

bool hg_baked_collect(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, bool wait)
{
    struct hg_baked baked;
    bool some = false;
    while (g->baker != NULL && hg_baker_take(g->baker, wait, &baked))
        some = take_in(g, meshes, count, &baked) || some;
    return some;
}

bool hg_geometry_poll(struct hg_geometry *g, bool wait)
{
    if (g->pool == NULL)
        return false;
    hg_geometry_note_peak(g);
    hg_cluster_pool_tick(g->pool);
    if (!hg_baked_collect(g, g->meshes, g->mesh_count, wait))
        return false;
    g->signature = 0;
    g->shape_revision++;
    return true;
}

uint32_t hg_geometry_baking(const struct hg_geometry *g)
{
    return g->baker != NULL ? hg_baker_pending(g->baker) : 0;
}

bool hg_geometry_has_levels(const struct hg_geometry *g)
{
    for (uint32_t i = 0; i < g->mesh_count; i++)
        for (uint32_t p = 0; p < g->meshes[i].part_count; p++)
            if (g->meshes[i].parts[p].clusters != NULL)
                return true;
    return false;
}
