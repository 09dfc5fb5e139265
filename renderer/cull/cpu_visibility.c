// cpu_visibility.c - see cpu_visibility.h.
#include "renderer/cull/cpu_visibility.h"

#include <string.h>

#include "base/alloc.h"

#define RUNS_PER_JOB 512
#define PIXEL_BYTES  12 // two words of ids, one of depth

_Static_assert(HG_MESHLET_TRIANGLES <= HG_RASTER_MOST_TRIANGLES, "a meshlet is a run");

void hg_cpu_visibility_finish(struct hg_gpu *gpu, struct hg_cpu_visibility *h)
{
    hg_gpu_buffer_destroy(gpu, &h->pixels);
    hg_raster_destroy(h->raster);
    hg_free(h->runs);
    hg_free(h->sources);
    hg_free(h->takes);
    hg_free(h->marks);
    memset(h, 0, sizeof *h);
}

// Several runs may share a bit: it is set when one of them was seen.
static void learn(
    const struct hg_cpu_visibility *h, const struct hg_cpu_visibility_history *history)
{
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < h->count; i++) {
            const uint32_t bit = h->sources[i].bit;
            if (bit >= history->bits)
                continue;
            if (pass == 0)
                history->words[bit / 32] &= ~(1u << bit % 32);
            else if ((h->marks[i] & HG_RASTER_SEEN) != 0)
                history->words[bit / 32] |= 1u << bit % 32;
        }
    }
}

void hg_cpu_visibility_reset(
    struct hg_cpu_visibility *h, const struct hg_cpu_visibility_history *history)
{
    if (h->drawn && history->words != NULL)
        learn(h, history);
    h->count = 0;
    h->drawn = false;
}

// --- taking --------------------------------------------------------------------------------------

struct taking {
    struct hg_cpu_visibility *hosted;
    const struct hg_geometry *g;
    const struct hg_culling_view *looks;
    struct hg_raster_view view;
    const struct hg_selection *runs;
};

static const struct hg_mat4x3 *world_of(const struct hg_geometry *g, uint32_t draw)
{
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    return &instances[g->draws[draw].gpu.instance].world;
}

static bool may_take(const struct taking *t, const struct hg_run *run)
{
    const struct hg_geometry *g = t->g;
    const uint32_t others = HG_DRAW_MASK | HG_DRAW_BLEND | HG_DRAW_LINES | HG_DRAW_POINTS;
    const struct hg_draw_entry *d = &g->draws[run->draw];
    if ((hg_select_flags(g, t->looks, run->draw) & others) != 0 || d->deformed ||
        !(run->extent[0] >= 0.0f))
        return false;
    if (run->chunk == HG_LOD_NONE)
        return t->looks->host_parts && d->part->numbered_indices != NULL &&
               d->part->buffer.mapped != NULL;
    return d->part->clusters->chunks[run->chunk].host_indices == NULL &&
           run->count <= HG_RASTER_MOST_TRIANGLES;
}

static void look_at_runs(void *user, size_t job)
{
    const struct taking *t = user;
    const uint32_t first = (uint32_t)job * RUNS_PER_JOB;
    uint32_t opened = UINT32_MAX; // draw
    struct hg_raster_rows rows;
    for (uint32_t i = first; i < first + RUNS_PER_JOB && i < t->runs->count; i++) {
        const struct hg_run *run = &t->runs->items[i];
        t->hosted->takes[i] = may_take(t, run);
        if (t->hosted->takes[i] == 0)
            continue;
        if (run->draw != opened)
            hg_raster_open(&t->view, world_of(t->g, run->draw), &rows);
        opened = run->draw;
        t->hosted->takes[i] = hg_raster_takes(&t->view, &rows, run->center, run->extent);
    }
}

static const float *positions_of(const struct hg_chunk_state *chunk)
{
    return (const float *)(const void *)((const uint8_t *)chunk->indices +
                                         (chunk->part.positions - chunk->part.indices));
}

// What all runs of a draw have in common.
static struct hg_raster_run of_draw(
    const struct hg_cpu_visibility_set *set, const struct hg_run *run)
{
    const struct hg_geometry *g = set->geometry;
    const struct hg_cpu_visibility_history *history = &set->history;
    return (struct hg_raster_run){.world = world_of(g, run->draw),
        .draw = run->draw,
        .both_sides = (hg_select_flags(g, set->view, run->draw) & HG_DRAW_DOUBLE_SIDED) != 0,
        .mirrored = (g->draws[run->draw].gpu.flags & HG_DRAW_MIRRORED) != 0,
        .late = history->words != NULL && run->bit < history->bits &&
                (history->words[run->bit / 32] >> run->bit % 32 & 1u) == 0};
}

static void push(struct hg_cpu_visibility *h, const struct hg_raster_run *run,
    const struct hg_cpu_visibility_source *source)
{
    h->sources[h->count] = *source;
    h->marks[h->count] = 0;
    h->runs[h->count++] = *run;
}

static void add_cluster(
    struct hg_cpu_visibility *h, const struct hg_cpu_visibility_set *set, const struct hg_run *run)
{
    struct hg_cluster_mesh *mesh = set->geometry->draws[run->draw].part->clusters;
    const struct hg_chunk_state *chunk = &mesh->chunks[run->chunk];
    struct hg_raster_run to = of_draw(set, run);
    to.positions = positions_of(chunk);
    to.indices = chunk->indices + (size_t)run->first * 3;
    to.count = run->count;
    to.number = (run->chunk << HG_LOD_SHIFT) + run->first;
    memcpy(to.center, run->center, sizeof to.center);
    memcpy(to.extent, run->extent, sizeof to.extent);
    push(h, &to, &(struct hg_cpu_visibility_source){mesh, run->chunk, run->bit});
}

// Meshlets of a run, which are neighbours of one group, as the numbered list of the part has them.
static void add_meshlets(
    struct hg_cpu_visibility *h, const struct hg_cpu_visibility_set *set, const struct hg_run *run)
{
    const struct hg_draw_entry *d = &set->geometry->draws[run->draw];
    const struct hg_meshlet_list *list = &d->part->meshlets;
    const uint32_t first = (run->bit - d->first_bit) * HG_MESHLET_GROUP;
    struct hg_raster_run to = of_draw(set, run);
    to.positions = (const float *)(const void *)((const uint8_t *)d->part->buffer.mapped +
                                                 d->part->numbered_at.positions);
    for (uint32_t i = first; i < list->count && i < first + HG_MESHLET_GROUP; i++) {
        const struct hg_meshlet *m = &list->items[i];
        if (m->first < run->first || m->first >= run->first + run->count)
            continue;
        to.indices = d->part->numbered_indices + (size_t)m->first * 3;
        to.count = m->count;
        to.number = m->first;
        memcpy(to.center, m->center, sizeof to.center);
        memcpy(to.extent, m->extent, sizeof to.extent);
        push(h, &to, &(struct hg_cpu_visibility_source){NULL, HG_LOD_NONE, run->bit});
    }
}

static struct hg_raster_view view_of(const struct hg_culling_lens *lens, const float eye[3])
{
    struct hg_raster_view view = {.width = lens->width, .height = lens->height};
    memcpy(view.view_proj, lens->view_proj, sizeof view.view_proj);
    memcpy(view.clip, lens->clip, sizeof view.clip);
    memcpy(view.eye, eye, sizeof view.eye);
    return view;
}

static enum hg_status reserve(struct hg_cpu_visibility *h, size_t count)
{
    enum hg_status status = hg_grow(&h->runs, &h->run_capacity, count + 1, sizeof *h->runs);
    if (status == HG_OK)
        status = hg_grow(&h->sources, &h->source_capacity, count + 1, sizeof *h->sources);
    if (status == HG_OK)
        status = hg_grow(&h->takes, &h->take_capacity, count + 1, sizeof *h->takes);
    if (status == HG_OK)
        status = hg_grow(&h->marks, &h->mark_capacity, count + 1, sizeof *h->marks);
    if (status == HG_OK && h->raster == NULL) {
        h->raster = hg_raster_create(false);
        status = h->raster != NULL ? HG_OK : HG_E_NOMEM;
    }
    return status;
}

enum hg_status hg_cpu_visibility_take(struct hg_cpu_visibility *h,
    const struct hg_cpu_visibility_set *set, struct hg_jobs *jobs, struct hg_selection *runs)
{
    const struct hg_culling_view *view = set->view;
    struct taking t = {.hosted = h, .g = set->geometry, .looks = view, .runs = runs};
    if (view->host->width > HG_RASTER_MOST_SIDE || view->host->height > HG_RASTER_MOST_SIDE ||
        runs->count > HG_RASTER_MOST_RUNS / HG_MESHLET_GROUP || h->count > 0)
        return HG_OK;
    t.view = view_of(view->host, view->eye);
    const enum hg_status status = reserve(h, (size_t)runs->count * HG_MESHLET_GROUP);
    if (status != HG_OK)
        return status;
    memcpy(h->eye, view->eye, sizeof h->eye);
    h->set = set->number;
    const size_t count = ((size_t)runs->count + RUNS_PER_JOB - 1) / RUNS_PER_JOB;
    if (count > 1 && jobs != NULL)
        hg_jobs_for(jobs, count, look_at_runs, &t);
    else
        for (size_t i = 0; i < count; i++)
            look_at_runs(&t, i);
    uint32_t left = 0;
    for (uint32_t i = 0; i < runs->count; i++) {
        const struct hg_run *run = &runs->items[i];
        if (h->takes[i] == 0)
            runs->items[left++] = *run;
        else if (run->chunk != HG_LOD_NONE)
            add_cluster(h, set, run);
        else
            add_meshlets(h, set, run);
    }
    runs->count = left;
    return HG_OK;
}

void hg_cpu_visibility_use(const struct hg_cpu_visibility *h, const struct hg_geometry *g)
{
    for (uint32_t i = 0; i < h->count; i++)
        if (h->sources[i].mesh != NULL && (i == 0 || h->sources[i].mesh != h->sources[i - 1].mesh ||
                                              h->sources[i].chunk != h->sources[i - 1].chunk))
            hg_cluster_pool_use(g->pool, h->sources[i].mesh, h->sources[i].chunk);
}

// --- drawing -------------------------------------------------------------------------------------

enum hg_status hg_cpu_visibility_draw(struct hg_cpu_visibility *h, struct hg_gpu *gpu,
    const struct hg_culling_sample *sample, struct hg_jobs *jobs, struct hg_error *err)
{
    const struct hg_culling_lens *lens = sample->lens;
    const uint32_t slot = sample->slot, slots = sample->slots;
    const uint64_t px = (uint64_t)lens->width * lens->height;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_UPLOAD, px * slots * PIXEL_BYTES, "pixels of the host", &h->pixels, err);
    if (status != HG_OK)
        return status;
    h->width = lens->width;
    h->height = lens->height;
    h->slots = slots;
    uint8_t *mapped = h->pixels.mapped;
    const struct hg_raster_target target = {.ids = (uint32_t *)(void *)(mapped + px * slot * 8),
        .depth = (float *)(void *)(mapped + px * slots * 8 + px * slot * 4)};
    const struct hg_raster_view view = view_of(lens, h->eye);
    if (slot == 0)
        memset(h->marks, 0, h->count);
    h->drawn = true;
    const struct hg_raster_runs runs = {h->runs, h->count, h->marks};
    status = hg_raster_draw(h->raster, &view, &runs, &target, jobs);
    return status == HG_OK ? HG_OK : hg_error_set(err, status, "draw lists", NULL, "no memory");
}

static void copy(const struct hg_cpu_visibility *h, struct hg_gpu_cmd *cmd, uint64_t offset,
    uint32_t bytes, struct hg_gpu_image *image, VkRect2D area)
{
    const uint64_t first = (uint64_t)(uint32_t)area.offset.y * h->width + (uint32_t)area.offset.x;
    const struct hg_gpu_region region = {.x = (uint32_t)area.offset.x,
        .y = (uint32_t)area.offset.y,
        .width = area.extent.width,
        .height = area.extent.height};
    hg_gpu_image_write(cmd, image, &region, &h->pixels, offset + first * bytes, h->width);
}

void hg_cpu_visibility_copy(const struct hg_cpu_visibility *h, struct hg_gpu_cmd *cmd,
    uint32_t slot, struct hg_gpu_image *visibility, struct hg_gpu_image *depth, VkRect2D area)
{
    const uint64_t px = (uint64_t)h->width * h->height;
    if (area.extent.width == 0)
        area = (VkRect2D){{0, 0}, {h->width, h->height}};
    copy(h, cmd, px * slot * 8, 8, visibility, area);
    copy(h, cmd, px * h->slots * 8 + px * slot * 4, 4, depth, area);
}

uint64_t hg_cpu_visibility_triangles(const struct hg_cpu_visibility *h)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < h->count; i++)
        sum += (h->marks[i] & HG_RASTER_DRAWN) != 0 ? h->runs[i].count : 0;
    return sum;
}
