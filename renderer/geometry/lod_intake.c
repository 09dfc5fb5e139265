// lod_intake.c - parts that get levels of detail: which, and how results come in. See internal.h.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/geometry/geometry_state.h"
#include "renderer/lod/internal.h"

#define BAKE_FROM      32768u // triangles
#define PROXY_MOST     16384u // triangles
#define PROXY_LEAST    64u
#define PROXY_TRIANGLE 160u // bytes that a triangle of a proxy takes at most, more or less

static bool can_bake(const struct hg_geometry *g, const struct hg_mesh *mesh)
{
    for (uint32_t p = 0; p < mesh->part_count; p++)
        if (mesh->parts[p].joints != NULL) // the node's other parts are posed with it
            return false;
    for (uint32_t i = 0; i < g->deforms.count; i++)
        if (g->deforms.items[i].mesh == mesh->head.id)
            return false;
    return true;
}

uint32_t hg_lod_intake_from(const struct hg_geometry *g)
{
    if (g->baker == NULL)
        return UINT32_MAX;
    return g->params.bake_from > 0 ? g->params.bake_from : BAKE_FROM;
}

static bool is_large(const struct hg_geometry *g, const struct hg_part_entry *part, uint32_t source)
{
    return source >= hg_lod_intake_from(g) && part->clusters == NULL && !part->baking;
}

void hg_lod_intake_queue(struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count)
{
    for (uint32_t i = 0; g->baker != NULL && i < count; i++) {
        struct hg_mesh_entry *e = &meshes[i];
        for (uint32_t p = 0; p < e->part_count; p++) {
            struct hg_part_entry *part = &e->parts[p];
            const uint32_t source = hg_part_source_primitives(&e->mesh->parts[p]);
            if (!is_large(g, part, source) || !can_bake(g, e->mesh) ||
                !hg_lod_can_bake(&e->mesh->parts[p], e->target_count))
                continue;
            // Without memory for a copy the part is drawn as it is.
            part->baking =
                hg_lod_build_queue_add(g->baker, e->mesh, e->id, e->revision, p) == HG_OK;
        }
    }
}

static bool wants_proxy(const struct hg_part_entry *part)
{
    return part->baking && part->clusters == NULL && part->proxy == NULL && !part->unbaked &&
           part->buffer.size_bytes == 0 && part->primitive_count > PROXY_MOST;
}

enum hg_status hg_lod_intake_show_proxies(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, uint64_t used_bytes)
{
    const uint64_t budget = g->params.budget_bytes;
    uint64_t own = 0, parts = 0;
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t p = 0; p < meshes[i].part_count; p++) {
            const bool wanted = wants_proxy(&meshes[i].parts[p]);
            own += wanted ? meshes[i].parts[p].layout.total_bytes : 0;
            parts += wanted;
        }
    }
    // Half of the room is for chunks: they come before the proxies go.
    const uint64_t others = used_bytes - own, room = budget > others ? (budget - others) / 2 : 0;
    const uint64_t each = parts > 0 ? room / parts / PROXY_TRIANGLE : 0;
    const uint32_t triangles = each < PROXY_LEAST  ? PROXY_LEAST
                               : each > PROXY_MOST ? PROXY_MOST
                                                   : (uint32_t)each;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t p = 0; p < meshes[i].part_count && status == HG_OK; p++)
            if (wants_proxy(&meshes[i].parts[p]))
                status = hg_mesh_entry_set_proxy(&meshes[i], p, triangles);
    return status;
}

uint64_t hg_lod_intake_lost_bytes(
    const struct hg_mesh_entry *meshes, uint32_t count, uint64_t *proxy_bytes)
{
    uint64_t bytes = 0;
    *proxy_bytes = 0;
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t p = 0; p < meshes[i].part_count; p++) {
            if (!meshes[i].parts[p].unbaked)
                continue;
            bytes += hg_part_whole_bytes(&meshes[i].mesh->parts[p]);
            *proxy_bytes += meshes[i].parts[p].layout.total_bytes;
        }
    }
    return bytes;
}

enum hg_status hg_lod_intake_drop_proxies(struct hg_geometry *g, struct hg_mesh_entry *meshes,
    uint32_t count, uint64_t *written, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t p = 0; p < meshes[i].part_count && status == HG_OK; p++)
            if (meshes[i].parts[p].unbaked)
                status = hg_mesh_entry_drop_proxy(g->gpu, &meshes[i], p, written, err);
    return status;
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
    hg_provoking_finish(&part->numbered);
    g->stats.proxies -= part->proxy != NULL && g->stats.proxies > 0;
    hg_proxy_free(part->proxy);
    part->proxy = NULL;
    part->vertex_count = e->mesh->parts[index].vertex_count;
    part->index_count = e->mesh->parts[index].index_count;
    part->primitive_count = part->index_count / 3;
    if (e->mesh->parts[index].topology == HG_TOPOLOGY_POINTS)
        part->primitive_count = (uint32_t)clusters->lod->source_triangles;
    part->host_indices = NULL;
    part->indices = part->numbered_indices = NULL;
    part->layout = (struct hg_pack_layout){
        .flags = clusters->lod->flags, .extra_words = clusters->lod->extra_words};
    part->clusters = clusters;
    part->bounds = part->own_bounds;
    hg_box_add_point(&part->bounds, clusters->lod->min);
    hg_box_add_point(&part->bounds, clusters->lod->max);
    e->bytes += clusters->table.size_bytes;
}

static bool take_in(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, struct hg_lod_built *baked)
{
    struct hg_mesh_entry *e = hg_mesh_entry_find(meshes, count, baked->mesh);
    if (e != NULL && e->revision != baked->revision)
        e = NULL;
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
    if (clusters == NULL && e != NULL && e->parts[baked->part].proxy != NULL) {
        e->parts[baked->part].unbaked = true; // a proxy is no picture of it: the next sync says so
        return true;
    }
    if (clusters == NULL)
        return false;
    swap_in(g, e, baked->part, clusters);
    return true;
}

bool hg_lod_intake_collect(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, uint64_t until_ns)
{
    struct hg_lod_built baked;
    bool some = false;
    while (g->baker != NULL && hg_lod_build_queue_take(g->baker, until_ns, &baked))
        some = take_in(g, meshes, count, &baked) || some;
    return some;
}

bool hg_geometry_poll(struct hg_geometry *g, uint64_t until_ns)
{
    if (g->pool == NULL)
        return false;
    hg_geometry_note_peak(g);
    hg_cluster_pool_tick(g->pool);
    if (!hg_lod_intake_collect(g, g->meshes, g->mesh_count, until_ns))
        return false;
    g->signature = 0;
    g->shape_revision++;
    return true;
}

uint32_t hg_geometry_baking(const struct hg_geometry *g)
{
    return g->baker != NULL ? hg_lod_build_queue_pending(g->baker) : 0;
}

bool hg_geometry_has_levels(const struct hg_geometry *g)
{
    for (uint32_t i = 0; i < g->mesh_count; i++)
        for (uint32_t p = 0; p < g->meshes[i].part_count; p++)
            if (g->meshes[i].parts[p].clusters != NULL)
                return true;
    return false;
}

bool hg_geometry_is_simplified(const struct hg_geometry *g)
{
    for (uint32_t i = 0; i < g->deforms.count; i++)
        if (g->deforms.items[i].source->posed.count > 0)
            return true;
    return hg_geometry_has_levels(g);
}

// --- what stands where a level was seen ----------------------------------------------------------

// inverse(world) * point; the point of the origin when there is no inverse.
static void to_object(const struct hg_mat4x3 *world, const float point[3], float out[3])
{
    const float *m = world->m;
    double c[3][3], p[3], det = 0.0;
    for (int i = 0; i < 3; i++) { // cofactors: cross products of the columns
        const float *a = m + (i + 1) % 3 * 3, *b = m + (i + 2) % 3 * 3;
        for (int k = 0; k < 3; k++)
            c[i][k] = (double)a[(k + 1) % 3] * (double)b[(k + 2) % 3] -
                      (double)a[(k + 2) % 3] * (double)b[(k + 1) % 3];
        p[i] = (double)point[i] - (double)m[9 + i];
    }
    for (int k = 0; k < 3; k++)
        det += (double)m[k] * c[0][k];
    for (int i = 0; i < 3; i++)
        out[i] =
            det != 0.0 ? (float)((c[i][0] * p[0] + c[i][1] * p[1] + c[i][2] * p[2]) / det) : 0.0f;
}

static uint32_t nearest_point(const struct hg_mesh_part *part, const float at[3])
{
    float best = INFINITY;
    uint32_t nearest = 0;
    for (uint32_t i = 0; i < part->index_count; i++) {
        const float *p = part->positions + (size_t)part->indices[i] * 3;
        const float d[3] = {p[0] - at[0], p[1] - at[1], p[2] - at[2]};
        const float distance2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        if (distance2 < best) {
            best = distance2;
            nearest = i;
        }
    }
    return nearest;
}

uint32_t hg_lod_intake_nearest(
    const struct hg_mesh_part *part, const struct hg_mat4x3 *world, const float point[3])
{
    float at[4] = {0}, best = INFINITY;
    uint32_t nearest = 0;
    to_object(world, point, at);
    if (part->topology == HG_TOPOLOGY_POINTS)
        return nearest_point(part, at);
    for (uint32_t t = 0; t < part->index_count / 3; t++) {
        const uint32_t *v = part->indices + (size_t)t * 3;
        const float *a = part->positions + (size_t)v[0] * 3,
                    *b = part->positions + (size_t)v[1] * 3,
                    *c = part->positions + (size_t)v[2] * 3;
        float least = 0.0f; // squared distance to the box of the triangle
        for (int k = 0; k < 3; k++) {
            const float low = fminf(a[k], fminf(b[k], c[k])), high = fmaxf(a[k], fmaxf(b[k], c[k]));
            const float gap = fmaxf(fmaxf(low - at[k], at[k] - high), 0.0f);
            least += gap * gap;
        }
        if (least >= best)
            continue;
        const float corners[3][4] = {{a[0], a[1], a[2]}, {b[0], b[1], b[2]}, {c[0], c[1], c[2]}};
        const float distance2 = hg_lod_distance2(at, corners[0], corners[1], corners[2]);
        if (distance2 < best) {
            best = distance2;
            nearest = t;
        }
    }
    return nearest;
}
