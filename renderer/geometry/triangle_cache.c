// triangle_cache.c - what shading reads of triangles on CPU devices
// (shaders/shared/triangle_cache.h). See geometry.h.
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/geometry/geometry_state.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/triangle_cache.h"

// Scenes with more triangles are shaded from their vertices.
#define MAX_BYTES (64ull << 20) // with what the buffer may grow by
#define MAX_DRAWS (HG_TABLE_BYTES / 4)

// What the facets of a draw are made of: equal keys, equal facets, unless a pose changed.
static uint64_t key_of(const struct hg_geometry *g, const struct hg_draw_entry *d, uint32_t first)
{
    const size_t instance = d->gpu.instance * sizeof(struct hg_gpu_instance);
    uint64_t h = hg_hash_mix(first + 1, (uint64_t)d->part->primitive_count << 32 | d->gpu.flags);
    h = hg_hash_mix(hg_hash_mix(h, d->node->mesh->head.id), d->node->mesh->head.revision);
    h = hg_hash_mix(h, d->mesh_part);
    h = hg_hash_mix_bytes(h, g->tables.parts.shadow + d->gpu.part * sizeof(struct hg_gpu_part),
        sizeof(struct hg_gpu_part));
    return hg_hash_mix_bytes(h, g->tables.instances.shadow + instance, sizeof(struct hg_mat4x3)) |
           1;
}

static bool pose_changed(const struct hg_geometry *g, const struct hg_draw_entry *d)
{
    for (uint32_t i = 0; i < g->changed.count; i++)
        if (g->deforms.items[g->changed.items[i]].index == d->gpu.part)
            return true;
    return false;
}

static uint64_t count_facets(const struct hg_geometry *g)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < g->draw_count; i++)
        count += hg_part_primitives(g->draws[i].part);
    return count;
}

void hg_triangle_cache_finish(struct hg_gpu *gpu, struct hg_triangle_cache *f)
{
    hg_gpu_buffer_destroy(gpu, &f->buffer);
    hg_gpu_array_finish(gpu, &f->first);
    hg_free(f->firsts);
    hg_free(f->keys);
    hg_free(f->next_keys);
    hg_free(f->jobs);
    *f = (struct hg_triangle_cache){0};
}

static enum hg_status grow(struct hg_triangle_cache *f, uint32_t draws)
{
    const size_t before = f->key_capacity;
    enum hg_status status = hg_grow(&f->keys, &f->key_capacity, draws, sizeof *f->keys);
    if (status == HG_OK && f->key_capacity > before)
        memset(f->keys + before, 0, (f->key_capacity - before) * sizeof *f->keys);
    if (status == HG_OK)
        status = hg_grow(&f->next_keys, &f->next_capacity, draws, sizeof *f->next_keys);
    if (status == HG_OK)
        status = hg_grow(&f->firsts, &f->first_capacity, draws, sizeof *f->firsts);
    return status == HG_OK ? hg_grow(&f->jobs, &f->job_capacity, draws, sizeof *f->jobs) : status;
}

static void list_jobs(struct hg_geometry *g)
{
    struct hg_triangle_cache *f = &g->facets;
    uint32_t first = 0;
    f->job_count = 0;
    for (uint32_t i = 0; i < g->draw_count; i++) {
        const struct hg_draw_entry *d = &g->draws[i];
        const uint32_t count = hg_part_primitives(d->part);
        f->firsts[i] = first;
        f->next_keys[i] = key_of(g, d, first);
        if (pose_changed(g, d))
            f->keys[i] = 0; // until it is made, also when the pose is done with before that
        if (f->next_keys[i] != f->keys[i])
            f->jobs[f->job_count++] = (struct hg_triangle_cache_job){i, first, count};
        first += count;
    }
    // Draws behind these are no more: their facets are written over, and a draw that takes such a
    // place again, with the same key, has to be made again.
    memset(f->keys + g->draw_count, 0, (f->key_capacity - g->draw_count) * sizeof *f->keys);
}

static enum hg_status make(struct hg_geometry *g, uint64_t bytes, struct hg_error *err)
{
    struct hg_triangle_cache *f = &g->facets;
    if (grow(f, g->draw_count) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "facets", NULL, "no memory");
    const uint64_t before = f->buffer.size_bytes;
    enum hg_status status =
        hg_gpu_buffer_reserve(g->gpu, HG_GPU_BUFFER_TEXELS, bytes, "facets", &f->buffer, err);
    if (status != HG_OK)
        return status;
    if (f->buffer.size_bytes != before)
        memset(f->keys, 0, f->key_capacity * sizeof *f->keys);
    list_jobs(g);
    uint64_t written = 0;
    f->first.name = "first facets";
    return hg_gpu_array_write(
        g->gpu, &f->first, f->firsts, g->draw_count * sizeof *f->firsts, &written, err);
}

enum hg_status hg_geometry_sync_triangle_cache(
    struct hg_geometry *g, bool wanted, struct hg_error *err)
{
    struct hg_triangle_cache *f = &g->facets;
    if (f->wanted == wanted && f->revision == g->revision && g->changed.count == 0)
        return HG_OK;
    const uint64_t bytes = count_facets(g) * sizeof(struct hg_gpu_facet);
    const uint64_t grown = bytes + bytes / 2;
    enum hg_status status = HG_OK;
    if (wanted && bytes > 0 && grown <= MAX_BYTES && g->draw_count <= MAX_DRAWS &&
        grown / 16 <= hg_gpu_get_caps(g->gpu)->max_texels)
        status = make(g, bytes, err);
    else
        hg_triangle_cache_finish(g->gpu, f);
    if (status != HG_OK)
        hg_triangle_cache_finish(g->gpu, f);
    f->wanted = wanted;
    f->revision = status == HG_OK ? g->revision : 0;
    return status;
}

bool hg_geometry_triangle_cache(
    const struct hg_geometry *g, struct hg_gpu_uniform *first, const struct hg_gpu_buffer **facets)
{
    const struct hg_triangle_cache *f = &g->facets;
    *first = (struct hg_gpu_uniform){f->first.buffer.address, f->first.size_bytes};
    *facets = f->buffer.handle != VK_NULL_HANDLE ? &f->buffer : NULL;
    return *facets != NULL;
}

uint32_t hg_geometry_facet_jobs(
    const struct hg_geometry *g, const struct hg_triangle_cache_job **jobs)
{
    *jobs = g->facets.jobs;
    return g->facets.job_count;
}

void hg_geometry_triangle_cache_done(struct hg_geometry *g)
{
    struct hg_triangle_cache *f = &g->facets;
    for (uint32_t i = 0; i < f->job_count; i++)
        f->keys[f->jobs[i].draw] = f->next_keys[f->jobs[i].draw];
    f->job_count = 0;
}
