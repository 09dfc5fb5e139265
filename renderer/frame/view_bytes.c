// view_bytes.c - see view_bytes.h.
#include "renderer/frame/view_bytes.h"

#include "renderer/frame/state.h"

static uint64_t sum_images(const struct hg_gpu_image *const *images, size_t count)
{
    uint64_t bytes = 0;
    for (size_t i = 0; i < count; i++)
        bytes += images[i]->is_alias ? 0 : images[i]->memory.size_bytes;
    return bytes;
}

static uint64_t sum_buffers(const struct hg_gpu_buffer *const *buffers, size_t count)
{
    uint64_t bytes = 0;
    for (size_t i = 0; i < count; i++)
        bytes += buffers[i]->memory.size_bytes;
    return bytes;
}

static uint64_t targets_bytes(const struct hg_view_targets *t)
{
    const struct hg_gpu_image *const images[] = {&t->visibility, &t->depth, &t->accumulated,
        &t->behind, &t->pixels[0], &t->pixels[1], &t->pixels[2], &t->checkered};
    struct hg_graph_stats graph = {0};
    if (t->graph != NULL)
        hg_graph_stats(t->graph, &graph);
    return graph.transient_bytes + sum_images(images, sizeof images / sizeof *images);
}

static uint64_t still_bytes(const struct hg_view_state *v)
{
    const struct hg_tiled_accumulation *a = &v->accumulation;
    const struct hg_view_gather *g = &v->gi.gather;
    const struct hg_gpu_image *const images[] = {&a->fallback, &g->light, &g->glass};
    const struct hg_gpu_buffer *const buffers[] = {&a->progress, &a->progress_read,
        &a->behind.progress, &g->blocks.buffer, &v->blend.lists.heads, &v->blend.lists.nodes};
    return targets_bytes(&v->targets) + targets_bytes(&v->buffers.grid) +
           sum_images(images, sizeof images / sizeof *images) +
           sum_buffers(buffers, sizeof buffers / sizeof *buffers) +
           hg_gpu_readback_bytes(&v->buffers.readback);
}

static uint64_t motion_bytes(const struct hg_view_state *v)
{
    const struct hg_temporal_view *t = &v->motion.temporal;
    const struct hg_gpu_image *const images[] = {
        &v->motion.reflections.light, &v->motion.glass.rays};
    const struct hg_gpu_buffer *const buffers[] = {
        &v->buffers.motion, &v->motion.reflections.back, &v->motion.glass.back};
    struct hg_reflect_stats reflect = {0};
    struct hg_glass_stats glass;
    if (v->motion.reflections.reflect != NULL)
        hg_reflect_stats(v->motion.reflections.reflect, &reflect);
    hg_glass_stats(v->motion.glass.glass, &glass);
    const uint64_t shown =
        t->pixels != NULL ? (uint64_t)v->settings.width * v->settings.height * 4 : 0;
    return shown + targets_bytes(&t->targets) + targets_bytes(&v->prefetch.targets) +
           (t->history != NULL ? hg_temporal_bytes(t->history) : 0) + reflect.bytes + glass.bytes +
           v->motion.mirrors.stats.bytes + sum_images(images, sizeof images / sizeof *images) +
           sum_buffers(buffers, sizeof buffers / sizeof *buffers);
}

void hg_view_bytes_get(const struct hg_view_state *view, struct hg_view_bytes *out)
{
    *out = (struct hg_view_bytes){still_bytes(view), motion_bytes(view)};
}
