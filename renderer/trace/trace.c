// trace.c - see trace.h: choosing a backend, and what all of them share.
#include "renderer/trace/trace.h"

#include <math.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/trace/internal.h"

#define FIRST_PIECE 16384u

static const struct hg_trace_ops *const backends[] = {
    [HG_TRACE_EMBREE] = &hg_trace_embree,
    [HG_TRACE_COMPUTE] = &hg_trace_compute,
    [HG_TRACE_KHR] = &hg_trace_khr,
};
#define BACKEND_COUNT (sizeof backends / sizeof backends[0])

static const char *const names[] = {
    [HG_TRACE_AUTO] = "auto",
    [HG_TRACE_EMBREE] = "embree",
    [HG_TRACE_COMPUTE] = "compute",
    [HG_TRACE_KHR] = "khr",
};

const char *hg_trace_backend_name(enum hg_trace_backend backend)
{
    return (size_t)backend < sizeof names / sizeof names[0] ? names[backend] : "unknown";
}

uint32_t hg_trace_mask(uint32_t flags)
{
    return flags & HG_DRAW_BLEND  ? HG_RAY_BLEND
           : flags & HG_DRAW_MASK ? HG_RAY_MASK
                                  : HG_RAY_OPAQUE;
}

bool hg_trace_is_ray(const struct hg_gpu_ray *r)
{
    const float *o = &r->origin_ws.x, *d = &r->direction_ws.x;
    const float at = fabsf(o[0]) + fabsf(o[1]) + fabsf(o[2]);
    const float length = fabsf(d[0]) + fabsf(d[1]) + fabsf(d[2]);
    return at <= HG_RAY_FARTHEST && length > 0.0f && length <= HG_RAY_FARTHEST &&
           r->t_max > r->t_min && r->t_max > 0.0f;
}

struct hg_trace_addresses hg_trace_addresses(const struct hg_trace_piece *piece)
{
    const struct hg_trace_wave *w = piece->wave;
    const uint64_t skip = w->list != NULL ? 0 : piece->at; // lists tell places in the whole
    return (struct hg_trace_addresses){
        .rays = w->rays->address + (w->first_ray + skip) * sizeof(struct hg_gpu_ray),
        .list = w->list != NULL ? w->list->address + piece->at * sizeof(uint32_t) : 0,
        .out = piece->any ? w->blocked->address + (w->first_hit + skip) * sizeof(uint32_t)
                          : w->hits->address + (w->first_hit + skip) * sizeof(struct hg_gpu_hit)};
}

enum hg_status hg_trace_submit_dispatch(struct hg_gpu *gpu,
    const struct hg_trace_dispatch *dispatch, uint64_t *value, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    status = hg_gpu_cmd_pipeline(cmd, dispatch->pipeline, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    hg_gpu_cmd_push(cmd, dispatch->push, dispatch->push_bytes);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), dispatch->groups, 1, 1);
    hg_gpu_memory_barrier(cmd);
    return hg_gpu_submit(gpu, cmd, value, err);
}

static enum hg_status create_backend(
    struct hg_trace *t, enum hg_trace_backend backend, struct hg_error *err)
{
    if ((size_t)backend >= BACKEND_COUNT || backends[backend] == NULL)
        return hg_error_set(err, HG_E_DEVICE, "ray tracing", hg_trace_backend_name(backend),
            "this build has no such backend");
    t->ops = backends[backend];
    t->params.backend = backend;
    return t->ops->create(t, &t->self, err);
}

static enum hg_status create_best(struct hg_trace *t, struct hg_error *err)
{
    static const enum hg_trace_backend cpu[] = {HG_TRACE_EMBREE, HG_TRACE_COMPUTE};
    static const enum hg_trace_backend gpu[] = {HG_TRACE_KHR, HG_TRACE_COMPUTE, HG_TRACE_EMBREE};
    const bool host_first = hg_gpu_strategy(t->gpu)->host_rays;
    const enum hg_trace_backend *list = host_first ? cpu : gpu;
    const size_t count = host_first ? sizeof cpu / sizeof cpu[0] : sizeof gpu / sizeof gpu[0];
    enum hg_status status = HG_E_DEVICE;
    for (size_t i = 0; i < count && status == HG_E_DEVICE; i++)
        status = create_backend(t, list[i], err);
    return status;
}

enum hg_status hg_trace_create(struct hg_gpu *gpu, const struct hg_trace_params *params,
    struct hg_trace **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_trace *t = hg_calloc(1, sizeof *t);
    if (t == NULL)
        return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
    t->gpu = gpu;
    t->params = *params;
    t->layout.apart = params->apart;
    t->piece[0] = t->piece[1] = FIRST_PIECE;
    const enum hg_status status = params->backend == HG_TRACE_AUTO
                                      ? create_best(t, err)
                                      : create_backend(t, params->backend, err);
    if (status != HG_OK) {
        hg_trace_destroy(t);
        return status;
    }
    *out = t;
    return HG_OK;
}

void hg_trace_destroy(struct hg_trace *t)
{
    if (t == NULL)
        return;
    if (t->ops != NULL)
        t->ops->destroy(t->self);
    hg_trace_compute.destroy(t->spare);
    hg_trace_layout_finish(&t->layout);
    hg_free(t);
}

enum hg_trace_backend hg_trace_backend(const struct hg_trace *t)
{
    return t->params.backend;
}

static enum hg_status sync_backend(struct hg_trace *t, struct hg_error *err)
{
    enum hg_status status = t->ops->sync(t->self, &t->layout, err);
    t->uses_spare = status == HG_E_UNSUPPORTED;
    if (!t->uses_spare) {
        hg_trace_compute.destroy(t->spare);
        t->spare = NULL;
        return status;
    }
    status = t->spare == NULL ? hg_trace_compute.create(t, &t->spare, err) : HG_OK;
    return status == HG_OK ? hg_trace_compute.sync(t->spare, &t->layout, err) : status;
}

enum hg_status hg_trace_sync(
    struct hg_trace *t, const struct hg_ray_geometry *geometry, struct hg_error *err)
{
    t->stats.build_ns = t->stats.refit_ns = 0;
    t->stats.built_triangles = t->stats.refit_triangles = 0;
    if (t->synced && t->revision == hg_ray_geometry_revision(geometry))
        return HG_OK;
    t->synced = false;
    enum hg_status status = hg_trace_layout_make(
        &t->layout, hg_ray_geometry_pieces(geometry), hg_ray_geometry_count(geometry));
    if (status != HG_OK)
        return hg_error_set(err, status, "ray tracing", NULL, "no memory");
    status = sync_backend(t, err);
    if (status != HG_OK)
        return status;
    t->synced = true;
    t->revision = hg_ray_geometry_revision(geometry);
    t->stats.triangles = t->layout.triangles;
    t->stats.instances = t->layout.instances;
    return HG_OK;
}

static bool is_placed(const struct hg_trace_body *body)
{
    return !body->flat && !body->in_world;
}

bool hg_trace_mark_placed(const struct hg_trace *t, uint32_t *marks, uint32_t draws, uint32_t mark)
{
    const struct hg_trace_layout *l = &t->layout;
    bool any = false;
    for (uint32_t i = 0; i < draws; i++)
        marks[i] &= ~mark;
    for (uint32_t i = 0; i < l->body_count && t->synced; i++) {
        for (uint32_t p = 0; p < l->bodies[i].place_count && is_placed(&l->bodies[i]); p++) {
            const uint32_t draw = l->places[l->bodies[i].first_place + p].draw;
            if (draw < draws) {
                marks[draw] |= mark;
                any = true;
            }
        }
    }
    return any;
}

static bool holds(const struct hg_gpu_buffer *buffer, uint64_t first, uint32_t count, uint64_t size)
{
    return buffer != NULL && first <= UINT32_MAX * 64ull &&
           (first + count) * size <= buffer->size_bytes;
}

static enum hg_status check(
    const struct hg_trace *t, const struct hg_trace_wave *w, bool any, struct hg_error *err)
{
    const uint32_t most = w->list != NULL ? 1 : w->count; // what a list names is not looked at
    const bool to_fits = any ? holds(w->blocked, w->first_hit, most, sizeof(uint32_t))
                             : holds(w->hits, w->first_hit, most, sizeof(struct hg_gpu_hit));
    if (!to_fits || !holds(w->rays, w->first_ray, most, sizeof(struct hg_gpu_ray)) ||
        (w->list != NULL && !holds(w->list, 0, w->count, sizeof(uint32_t))))
        return hg_error_set(err, HG_E_INVAL, "ray tracing", NULL, "the wave is not in its buffers");
    return t->synced ? HG_OK
                     : hg_error_set(err, HG_E_STATE, "ray tracing", NULL, "there is no scene");
}

// --- pieces --------------------------------------------------------------------------------------

// Waves are submitted in pieces of about 8 ms, so that other work on the queue is not delayed:
// dispatches are not preempted.
#define PIECE_NS   8000000u
#define MOST_PIECE (1u << 20)

static const struct hg_trace_ops *ops_of(const struct hg_trace *t)
{
    return t->uses_spare ? &hg_trace_compute : t->ops;
}

static enum hg_status submit(
    struct hg_trace *t, const struct hg_trace_piece *piece, uint64_t *value, struct hg_error *err)
{
    *value = 0;
    return ops_of(t)->submit(t->uses_spare ? t->spare : t->self, piece, value, err);
}

// The next piece, in rays, after `count` of them took ns.
static void adapt(uint32_t *piece, uint32_t least, uint32_t count, uint64_t ns)
{
    if (ns > PIECE_NS && *piece > least)
        *piece /= 2;
    else if (ns < PIECE_NS / 3 && count == *piece && *piece < MOST_PIECE)
        *piece *= 2;
}

static enum hg_status trace_from(
    struct hg_trace *t, const struct hg_trace_wave *w, bool any, uint32_t at, struct hg_error *err)
{
    const uint32_t least = ops_of(t)->least_piece;
    enum hg_status status = HG_OK;
    while (at < w->count && status == HG_OK) {
        const uint32_t left = w->count - at, most = least > 0 ? t->piece[any] : left;
        const struct hg_trace_piece piece = {w, any, at, left < most ? left : most};
        const uint64_t start = hg_clock_now_ns();
        uint64_t value;
        status = submit(t, &piece, &value, err);
        if (status == HG_OK && value > 0)
            status = hg_gpu_wait(t->gpu, value, err);
        if (least > 0)
            adapt(&t->piece[any], least, piece.count, hg_clock_now_ns() - start);
        at += piece.count;
    }
    return status;
}

static enum hg_status trace(
    struct hg_trace *t, const struct hg_trace_wave *w, bool any, struct hg_error *err)
{
    enum hg_status status = check(t, w, any, err);
    if (status != HG_OK)
        return status;
    const uint64_t start = hg_clock_now_ns();
    status = trace_from(t, w, any, 0, err);
    t->stats.trace_ns += hg_clock_now_ns() - start;
    t->stats.rays += w->count;
    return status;
}

// --- waves ---------------------------------------------------------------------------------------

enum hg_status hg_trace_closest(
    struct hg_trace *t, const struct hg_trace_wave *wave, struct hg_error *err)
{
    return trace(t, wave, false, err);
}

enum hg_status hg_trace_blocked(
    struct hg_trace *t, const struct hg_trace_wave *wave, struct hg_error *err)
{
    return trace(t, wave, true, err);
}

enum hg_status hg_trace_raw(struct hg_trace *t, const struct hg_trace_wave *wave, bool any,
    uint64_t *ns, struct hg_error *err)
{
    *ns = 0;
    if (t->ops->raw == NULL || !t->synced)
        return hg_error_set(err, HG_E_STATE, "ray tracing",
            hg_trace_backend_name(t->params.backend), "there is no Embree in it");
    return t->ops->raw(t->self, wave, any, ns, err);
}

void hg_trace_stats(const struct hg_trace *t, struct hg_trace_stats *out)
{
    *out = t->stats;
}
