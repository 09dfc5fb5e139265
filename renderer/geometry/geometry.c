// geometry.c - the whole of it, and what others read of it. See geometry.h; sync.c fills it.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/geometry/geometry_state.h"

enum hg_status hg_geometry_create(struct hg_gpu *gpu, const struct hg_geometry_params *params,
    struct hg_geometry **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_geometry *g = hg_calloc(1, sizeof *g);
    if (g == NULL)
        return hg_error_set(err, HG_E_NOMEM, "geometry", NULL, "no memory");
    g->gpu = gpu;
    if (params != NULL)
        g->params = *params;
    g->tables.draws.name = "draws";
    g->tables.instances.name = "instances";
    g->tables.parts.name = "parts";
    g->tables.materials.name = "materials";
    g->tables.lobes.name = "material lobes";
    g->bounds = hg_box_empty();
    enum hg_status status = HG_OK;
    if (g->params.jobs != NULL && g->params.bake_from != HG_GEOMETRY_BAKE_NONE) {
        status = hg_cluster_pool_create(gpu, &g->pool, err);
        if (status == HG_OK)
            status = hg_lod_build_queue_create(g->params.store, g->params.jobs, &g->baker, err);
    }
    if (status != HG_OK) {
        hg_geometry_destroy(g);
        return status;
    }
    *out = g;
    return HG_OK;
}

void hg_geometry_destroy(struct hg_geometry *g)
{
    if (g == NULL)
        return;
    hg_lod_build_queue_destroy(g->baker);
    for (uint32_t i = 0; i < g->mesh_count; i++)
        hg_mesh_entry_finish(g->gpu, g->pool, &g->meshes[i]);
    for (uint32_t i = 0; i < g->deforms.count; i++)
        hg_deform_finish(g->gpu, &g->deforms.items[i]);
    hg_triangle_cache_finish(g->gpu, &g->facets);
    hg_gpu_array_finish(g->gpu, &g->tables.draws);
    hg_gpu_array_finish(g->gpu, &g->tables.instances);
    hg_gpu_array_finish(g->gpu, &g->tables.parts);
    hg_gpu_array_finish(g->gpu, &g->tables.materials);
    hg_gpu_array_finish(g->gpu, &g->tables.lobes);
    hg_free(g->meshes);
    hg_free(g->deforms.items);
    hg_free(g->changed.items);
    hg_free(g->draws);
    hg_cluster_pool_destroy(g->pool);
    hg_free(g);
}

bool hg_geometry_set_origin(struct hg_geometry *g, const double eye_ws[3])
{
    bool moved = false;
    for (int i = 0; i < 3; i++) {
        if (fabs(eye_ws[i] - g->origin[i]) <= 0.75 * HG_GEOMETRY_ORIGIN_STEP)
            continue;
        const double cell = round(eye_ws[i] / HG_GEOMETRY_ORIGIN_STEP) * HG_GEOMETRY_ORIGIN_STEP;
        moved = moved || cell != g->origin[i];
        g->origin[i] = cell;
    }
    return moved;
}

void hg_geometry_origin(const struct hg_geometry *g, double out[3])
{
    memcpy(out, g->origin, sizeof g->origin);
}

// --- what others read ----------------------------------------------------------------------------

void hg_geometry_fill(const struct hg_geometry *g, struct hg_gpu_geometry *out)
{
    *out = (struct hg_gpu_geometry){.draws = g->tables.draws.buffer.address,
        .instances = g->tables.instances.buffer.address,
        .parts = g->tables.parts.buffer.address,
        .materials = g->tables.materials.buffer.address,
        .lobes = g->tables.lobes.buffer.address,
        .draw_count = g->draw_count,
        .instance_count = g->tables.instance_count,
        .part_count = g->tables.part_count,
        .material_count = g->tables.material_count};
}

void hg_geometry_note_peak(struct hg_geometry *g)
{
    struct hg_geometry_stats now;
    hg_geometry_stats(g, &now);
    g->stats.peak_bytes = now.peak_bytes;
}

void hg_geometry_stats(const struct hg_geometry *g, struct hg_geometry_stats *out)
{
    *out = g->stats;
    if (g->pool != NULL) {
        hg_cluster_pool_stats(g->pool, &out->chunks);
        out->used_bytes += out->chunks.used_bytes;
        out->baking = hg_lod_build_queue_pending(g->baker);
    }
    out->budget_bytes = g->params.budget_bytes;
    out->facet_bytes = g->facets.buffer.size_bytes;
    if (out->peak_bytes < out->used_bytes)
        out->peak_bytes = out->used_bytes;
}

uint64_t hg_geometry_shape_revision(const struct hg_geometry *g)
{
    return g->shape_revision;
}

uint64_t hg_geometry_revision(const struct hg_geometry *g)
{
    return g->revision;
}

bool hg_geometry_bounds(const struct hg_geometry *g, float min[3], float max[3])
{
    const bool some = !hg_box_is_empty(&g->bounds);
    for (int i = 0; i < 3; i++) {
        min[i] = some ? g->bounds.min[i] : 0.0f;
        max[i] = some ? g->bounds.max[i] : 0.0f;
    }
    return some;
}

bool hg_geometry_transmits(const struct hg_geometry *g, uint32_t draw, struct hg_box *box)
{
    const struct hg_material *m = draw < g->draw_count ? g->draws[draw].material : NULL;
    if (m == NULL || m->unlit || !(m->transmission > 0))
        return false;
    *box = g->draws[draw].bounds;
    return true;
}

bool hg_geometry_one_shape(const struct hg_geometry *g)
{
    return g->one_shape;
}

bool hg_geometry_draw_info(const struct hg_geometry *g, uint32_t draw, struct hg_draw_info *out)
{
    memset(out, 0, sizeof *out);
    if (draw >= g->draw_count)
        return false;
    const struct hg_draw_entry *d = &g->draws[draw];
    *out = (struct hg_draw_info){.node = d->node,
        .mesh = d->node->mesh,
        .material = d->material,
        .part = d->mesh_part,
        .instance = d->instance};
    return true;
}

uint32_t hg_geometry_source_primitive(
    const struct hg_geometry *g, uint32_t draw, uint32_t primitive, const float position[3])
{
    if (draw >= g->draw_count)
        return primitive;
    const struct hg_draw_entry *d = &g->draws[draw];
    const struct hg_part_entry *part = d->part;
    if (part->clusters != NULL || part->proxy != NULL) {
        const struct hg_gpu_instance *instances = hg_geometry_instances(g);
        hg_spill_begin(NULL);
        primitive = hg_lod_intake_nearest(
            &d->node->mesh->parts[d->mesh_part], &instances[d->gpu.instance].world, position);
        hg_spill_end();
        return primitive;
    }
    if (primitive >= part->primitive_count && primitive < hg_part_primitives(part))
        return part->posed.sources[primitive - part->primitive_count];
    if (part->meshlets.order != NULL && primitive < part->primitive_count)
        primitive = part->meshlets.order[primitive];
    return part->discs != NULL ? hg_discs_point(part->discs, primitive) : primitive;
}

uint32_t hg_geometry_deform_count(const struct hg_geometry *g)
{
    return g->changed.count;
}

struct hg_deform_job hg_geometry_deform(const struct hg_geometry *g, uint32_t index)
{
    const struct hg_deform_entry *e = &g->deforms.items[g->changed.items[index]];
    return (struct hg_deform_job){e->params.address, e->vertex_count};
}

void hg_geometry_deforms_done(struct hg_geometry *g)
{
    for (uint32_t i = 0; i < g->changed.count; i++)
        g->deforms.items[g->changed.items[i]].changed = false;
    g->changed.count = 0;
}
