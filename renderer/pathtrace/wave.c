// wave.c - one wave of paths: from the camera until all have ended.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/pathtrace/path_state.h"
#include "shaders/shared/features.h"

#define PAGE_WAIT_NS   40000000u // per piece of work
#define MOST_FRUITLESS 4096u

static struct hg_page_cache *pages_of(const struct hg_view_state *view)
{
    return hg_textures_cache(view->scene_gpu->textures);
}

// --- times ---------------------------------------------------------------------------------------

static const char *const piece_names[HG_PATH_PIECES] = {"path begin", "path trace", "path miss",
    "path shade", "path shadow", "path light", "path holes", "path film", "path lists", "pages"};

const char *hg_path_piece_name(enum hg_path_piece piece)
{
    return piece_names[piece];
}

struct lap { // of a watch
    uint64_t ns, cpu_ns;
};

static struct lap lap_start(void)
{
    return (struct lap){hg_clock_now_ns(), hg_clock_cpu_ns()};
}

// The time since the start or the last stop counts for a piece.
static void lap_stop(struct lap *lap, struct hg_path *p, enum hg_path_piece piece, uint64_t items)
{
    const struct lap now = lap_start();
    struct hg_path_time *time = &p->stats.pieces[piece];
    time->ns += now.ns - lap->ns;
    time->cpu_ns += now.cpu_ns - lap->cpu_ns;
    time->items += items;
    *lap = now;
}

// --- memory --------------------------------------------------------------------------------------

void hg_path_wave_destroy(struct hg_path *p)
{
    struct hg_gpu *gpu = p->context->gpu;
    struct hg_gpu_buffer *all[] = {&p->rays, &p->shadow_rays, &p->hits, &p->shadow_hits,
        &p->blocked, &p->status, &p->state, &p->tiles, &p->tile_samples, &p->block_buffer,
        &p->live.buffer, &p->waiting.buffer, &p->shadows.buffer, &p->suns.buffer, &p->seen.buffer};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        hg_gpu_buffer_destroy(gpu, all[i]);
}

enum hg_status hg_path_wave_create(struct hg_path *p, struct hg_error *err)
{
    const uint64_t n = HG_PATH_WAVE_PX,
                   words =
                       HG_PATH_WORDS + p->sampled_channels - 1 +
                       (p->options & (HG_PATH_SPLIT | HG_PATH_GROUPS) ? HG_PATH_SPLIT_WORDS : 0) +
                       (p->options & HG_PATH_FOLLOWS ? HG_PATH_SEEN_WORDS : 0);
    const bool shared = hg_trace_backend(p->trace) == HG_TRACE_EMBREE;
    const enum hg_gpu_buffer_kind kind = shared ? HG_GPU_BUFFER_READBACK : HG_GPU_BUFFER_DEVICE;
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        enum hg_gpu_buffer_kind kind;
        const char *name;
    } all[] = {{&p->rays, n * sizeof(struct hg_gpu_ray), kind, "rays"},
        {&p->shadow_rays, 2 * n * sizeof(struct hg_gpu_ray), kind, "shadow rays"},
        {&p->hits, n * sizeof(struct hg_gpu_hit), kind, "hits"},
        {&p->shadow_hits, n * sizeof(struct hg_gpu_hit), kind, "shadow hits"},
        {&p->blocked, n * 4, kind, "blocked"},
        {&p->status, n * 4, HG_GPU_BUFFER_READBACK, "path status"},
        {&p->state, n * 4 * words, HG_GPU_BUFFER_DEVICE, "path state"},
        {&p->live.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "live paths"},
        {&p->waiting.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "waiting paths"},
        {&p->shadows.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "shadow paths"},
        {&p->suns.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "sun paths"},
        {&p->seen.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "seen paths"},
        {&p->tiles, HG_PATH_WAVE_TILES * 4, HG_GPU_BUFFER_UPLOAD, "wave tiles"},
        {&p->tile_samples, HG_PATH_WAVE_TILES * 4, HG_GPU_BUFFER_UPLOAD, "wave samples"},
        {&p->block_buffer, (2 * sizeof p->block + 255) / 256 * 256, HG_GPU_BUFFER_UPLOAD, "path"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof all / sizeof *all && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            p->context->gpu, all[i].kind, all[i].bytes, all[i].name, all[i].buffer, err);
    p->sees_hits = shared;
    return status;
}

// --- kernels -------------------------------------------------------------------------------------

static void fill_lens(const struct hg_view_state *view, struct hg_gpu_path *block)
{
    const struct hg_gpu_camera *c = &view->frame.camera;
    const struct hg_view_camera_state *s = &view->camera;
    const bool sharp = c->orthographic != 0 || view->settings.mode != HG_VIEW_MODE_PATH;
    const float radius = sharp ? 0.0f : s->lens_radius;
    const float *inverse = c->inv_view.m;
    double distance = s->focus_distance;
    if (!(distance > 0.0)) {
        distance = 0.0;
        for (int i = 0; i < 3; i++)
            distance += (s->target[i] - s->eye[i]) * (double)(&c->forward_ws.x)[i];
    }
    block->lens_x_ws =
        (struct hg_vec3){inverse[0] * radius, inverse[1] * radius, inverse[2] * radius};
    block->lens_y_ws =
        (struct hg_vec3){inverse[4] * radius, inverse[5] * radius, inverse[6] * radius};
    block->focus_distance = distance > 1e-6 ? (float)distance : 1e-6f;
}

uint32_t hg_path_sample_bits(uint32_t samples)
{
    uint32_t bits = 0;
    while (bits < 16 && (1u << bits) < samples)
        bits++;
    return bits;
}

// Fewer pipelines on devices that skip what is not there.
static uint32_t may_of(const struct hg_view_state *view, const struct hg_gpu_emitters *e)
{
    uint32_t may = view->path->channels > HG_PATH_FILM_WORDS ? HG_PATH_PLANES : 0;
    const bool others = e->node_count > 0 || e->environment_kind != HG_ENV_KIND_NONE;
    const uint32_t apart = e->directional_count > 0 && others ? HG_PATH_SUNS_APART : 0;
    if (!hg_gpu_get_caps(view->context->gpu)->is_cpu)
        return HG_PATH_PLANES | HG_EMITTER_KIND_ALL | apart;
    may |= e->node_count > 0 ? HG_EMITTER_KIND_TREE : 0;
    may |= e->directional_count > 0 ? HG_EMITTER_KIND_SUN : 0;
    may |= e->directional_count > 1 ? HG_EMITTER_KIND_SUNS : 0;
    if (e->environment_kind == HG_ENV_KIND_IMAGE)
        may |= HG_EMITTER_KIND_IMAGE;
    else if (e->environment_kind != HG_ENV_KIND_NONE)
        may |= HG_EMITTER_KIND_PLAIN;
    return may | apart;
}

// What one of several samples stands for. Their mean is filtered by the picture itself, so that
// texels of coarse mips, which hold some of what lies beside, would only blur it. Source: Pharr,
// Jakob and Humphreys, "Physically Based Rendering", 4th ed., section 10.1.3.
static float footprint_of(const struct hg_view_state *view)
{
    if (view->settings.mode != HG_VIEW_MODE_PATH)
        return 1;
    return fmaxf(1 / sqrtf((float)view->settings.samples), 0.125f);
}

void hg_path_wave_fill(struct hg_view_state *view)
{
    struct hg_path *p = view->path;
    const struct hg_path_settings *s = &view->settings.path;
    const uint32_t estimators = view->context->overrides.path_estimators;
    p->block = (struct hg_gpu_path){.rays = p->rays.address,
        .shadow_rays = p->shadow_rays.address,
        .hits = p->hits.address,
        .shadow_hits = p->shadow_hits.address,
        .blocked = p->blocked.address,
        .status = p->status.address,
        .state = p->state.address,
        .tiles = p->tiles.address,
        .tile_samples = p->tile_samples.address,
        .film = p->film.address,
        .ring = p->ring.address,
        .traced = p->traced.address,
        .columns = p->columns,
        .ring_rows = p->ring_rows,
        .draw_marks = p->draw_marks.address,
        .light_groups = p->light_groups.address,
        .names = p->names.address,
        .lists = p->lists,
        .list_count = p->list_count,
        .name_draws = p->name_draws,
        .split = HG_PATH_WORDS + p->sampled_channels - 1,
        .capacity = HG_PATH_WAVE_PX,
        .channels = p->sampled_channels,
        .sample_bits = hg_path_sample_bits(view->settings.samples),
        .branch_bits = p->branch_bits,
        .footprint = footprint_of(view),
        .max_bounces = s->max_bounces,
        .clamp_indirect = s->clamp_indirect,
        .holes = p->holes,
        .estimators = estimators != 0 ? estimators : HG_PATH_USE_EMITTERS | HG_PATH_USE_SURFACES};
    hg_emitters_fill(p->emitters, &p->block.emitters);
    memcpy(p->block.moments, p->moments, sizeof p->moments);
    p->may = may_of(view, &p->block.emitters) | (p->splats ? HG_PATH_SPLATS : 0);
    memcpy(p->block.planes, p->planes, sizeof p->planes);
    fill_lens(view, &p->block);
    if (p->splats)
        hg_path_splat_fill(s, p->pass, view->settings.seed, &p->block);
    else
        hg_path_filter_fill(s->filter, s->filter_radius_px, p->block.filter_px);
    memcpy(p->block_buffer.mapped, &p->block, sizeof p->block);
}

// Runs a kernel on `count` slots of a list (from `first`). *demand: what it missed.
static enum hg_status run(struct hg_view_state *view, enum hg_path_kernel kernel,
    const struct hg_path_list *list, uint32_t first, uint32_t count, struct hg_page_demand *demand,
    struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_gpu_cmd *cmd;
    *demand = (struct hg_page_demand){.fits = true};
    const bool samples = kernel != HG_PATH_BEGIN && kernel != HG_PATH_ARRIVE &&
                         kernel != HG_PATH_CLEAR && kernel != HG_PATH_KEEP && kernel != HG_PATH_ADD;
    view->stream.on = samples && !hg_page_cache_is_complete(pages_of(view));
    enum hg_status status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    hg_frame_fill_path(view);
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_gpu_uniform block = {p->block_buffer.address, p->block_buffer.size_bytes};
    const struct hg_gpu_path_push push = {
        list->buffer.address + (uint64_t)first * 4, count, 0, p->second, p->branch};
    if (view->stream.on)
        hg_page_cache_begin(pages_of(view), cmd);
    const bool shades =
        kernel == HG_PATH_SHADE || kernel == HG_PATH_MISS || kernel == HG_PATH_SURFACE;
    const uint32_t options = p->options | p->may | (shades && p->bounce == 0 ? HG_PATH_FIRST : 0);
    status = hg_path_record(&pass, kernel, options, &block, &push, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    if (view->stream.on)
        hg_page_cache_end(pages_of(view), cmd);
    status = hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
    if (status == HG_OK && view->stream.on)
        hg_page_cache_collect(pages_of(view), HG_PAGES_EXACT, demand);
    p->missing = demand->missing;
    return status;
}

// --- the way of a wave ---------------------------------------------------------------------------

enum hg_status hg_path_wave_begin(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct lap lap = lap_start();
    struct hg_page_demand demand;
    uint32_t *tiles = p->tiles.mapped, *numbers = p->tile_samples.mapped, *list;
    for (uint32_t i = 0; i < p->wave_tiles; i++) {
        const uint32_t tile = p->tile_index[i];
        tiles[i] = tile % p->columns | tile / p->columns << 16;
        numbers[i] = p->pass;
    }
    p->slots = p->wave_tiles * HG_PATH_TILE_PX;
    list = p->live.buffer.mapped;
    for (uint32_t i = 0; i < p->slots; i++)
        list[i] = i;
    p->live.count = p->slots;
    p->waiting.count = p->shadows.count = p->suns.count = p->seen.count = p->second = p->bounce =
        p->branch = p->fruitless = p->missed = 0;
    p->part = HG_PATH_WAVE_PX;
    p->wait_pages = false;
    hg_path_wave_fill(view);
    enum hg_status status = run(view, HG_PATH_BEGIN, &p->live, 0, p->live.count, &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_BEGIN, p->slots);
    p->stats.waves++;
    p->stats.paths += p->slots;
    p->phase = HG_PATH_PHASE_TRACE;
    return status;
}

// Of the first `count` slots those stay whose status has `bits` of `mask`; so do all others.
static void keep(const struct hg_path *p, struct hg_path_list *list, uint32_t count, uint32_t mask,
    uint32_t bits)
{
    const uint32_t *status = p->status.mapped, all = list->count;
    uint32_t *slots = list->buffer.mapped;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t slot = slots[i];
        slots[kept] = slot;
        kept += (status[slot] & mask) == bits;
    }
    memmove(slots + kept, slots + count, (size_t)(all - count) * 4);
    list->count = kept + all - count;
}

static void copy(const struct hg_path_list *from, struct hg_path_list *to)
{
    to->count = from->count;
    memcpy(to->buffer.mapped, from->buffer.mapped, (size_t)from->count * 4);
}

// Embree alone on the same rays, for benchmarks; costs no time that counts.
static enum hg_status trace_raw(struct hg_view_state *view, const struct hg_trace_wave *wave,
    bool any, struct lap *lap, struct hg_error *err)
{
    struct hg_path *p = view->path;
    uint64_t ns = 0;
    if (!view->context->overrides.trace_raw || hg_trace_backend(p->trace) != HG_TRACE_EMBREE)
        return HG_OK;
    const enum hg_status status = hg_trace_raw(p->trace, wave, any, &ns, err);
    p->stats.raw_ns[any] += ns;
    p->stats.raw_rays[any] += wave->count;
    *lap = lap_start();
    return status;
}

// Slots of a list, first those whose rays hit nothing, then the others, each in their order.
// Returns how many the first are.
static uint32_t sort_hits(
    const struct hg_gpu_buffer *buffer, const struct hg_path_list *from, struct hg_path_list *to)
{
    const struct hg_gpu_hit *hits = buffer->mapped;
    const uint32_t *slots = from->buffer.mapped, count = from->count;
    uint32_t *out = to->buffer.mapped, missed = 0, at = 0;
    for (uint32_t i = 0; i < count; i++)
        missed += hits[slots[i]].draw == HG_HIT_NONE;
    for (uint32_t i = 0, hit = missed; i < count; i++) {
        const bool none = hits[slots[i]].draw == HG_HIT_NONE;
        out[none ? at : hit] = slots[i];
        at += none;
        hit += !none;
    }
    to->count = count;
    return missed;
}

// Slots whose surfaces get further branches; all where the host does not see what was hit.
static void note_seen(struct hg_path *p)
{
    p->seen.count = p->waiting.count - p->missed;
    memcpy(p->seen.buffer.mapped, (const uint32_t *)p->waiting.buffer.mapped + p->missed,
        (size_t)p->seen.count * 4);
}

static enum hg_status trace(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct lap lap = lap_start();
    const struct hg_trace_wave wave = {.rays = &p->rays,
        .hits = &p->hits,
        .list = &p->live.buffer,
        .count = p->live.count,
        .coherent = p->bounce == 0};
    enum hg_status status = trace_raw(view, &wave, false, &lap, err);
    if (status == HG_OK)
        status = hg_trace_closest(p->trace, &wave, err);
    lap_stop(&lap, p, HG_PATH_PIECE_TRACE, p->live.count);
    p->missed = 0;
    if (p->sees_hits)
        p->missed = sort_hits(&p->hits, &p->live, &p->waiting);
    else
        copy(&p->live, &p->waiting);
    if (p->branch_bits > 0 && p->bounce == 0 && p->branch == 0)
        note_seen(p);
    p->part = p->live.count;
    p->phase = HG_PATH_PHASE_SHADE;
    lap_stop(&lap, p, HG_PATH_PIECE_LISTS, p->live.count);
    return status;
}

static enum hg_status wait_for_pages(
    struct hg_view_state *view, bool *arrived, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct lap lap = lap_start();
    const uint64_t start = lap.ns;
    enum hg_status status = hg_page_cache_update(pages_of(view), HG_PAGES_EXACT, UINT64_MAX, err);
    uint64_t spent = 0;
    while (status == HG_OK && hg_page_cache_under_way(pages_of(view)) > 0 && spent < PAGE_WAIT_NS) {
        hg_page_cache_wait(pages_of(view), PAGE_WAIT_NS - spent);
        status = hg_page_cache_update(pages_of(view), HG_PAGES_EXACT, UINT64_MAX, err);
        spent = hg_clock_now_ns() - start;
    }
    *arrived = hg_page_cache_under_way(pages_of(view)) == 0;
    lap_stop(&lap, p, HG_PATH_PIECE_PAGES, 0);
    return status;
}

// After a kernel that may have missed pages: what is left to do, and how much of it at once.
static enum hg_status note_demand(
    struct hg_path *p, const struct hg_page_demand *demand, bool got_on, struct hg_error *err)
{
    p->wait_pages = demand->missing > 0;
    if (!demand->fits)
        p->part = p->part > 1 ? (p->part + 1) / 2 : 1;
    p->fruitless = got_on ? 0 : p->fruitless + 1;
    return p->fruitless < MOST_FRUITLESS ? HG_OK
                                         : hg_error_set(err, HG_E_LIMIT, "path", "textures",
                                               "paths wait for texture pages that do not come");
}

// Rays to directional lights come after those to the others.
static enum hg_path_phase after_light(struct hg_path *p)
{
    if (p->suns.count > 0) {
        copy(&p->suns, &p->shadows);
        p->suns.count = 0;
        p->second = 1;
        return HG_PATH_PHASE_SHADOW;
    }
    if (p->live.count > 0)
        return HG_PATH_PHASE_TRACE;
    const bool follows = (p->options & HG_PATH_SURFACES) == 0;
    const bool more = follows && p->seen.count > 0 && p->branch + 1 < 1u << p->branch_bits;
    return more ? HG_PATH_PHASE_BRANCH : HG_PATH_PHASE_FILM;
}

// The first `count` of those that wait, in two kernels where it is known what their rays found.
static enum hg_status shade_some(
    struct hg_view_state *view, uint32_t count, struct hg_page_demand *demand, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct lap lap = lap_start();
    struct hg_page_demand other = {.fits = true};
    const uint32_t missed = p->missed < count ? p->missed : count, rest = count - missed;
    enum hg_status status = HG_OK;
    *demand = other;
    if (missed > 0)
        status = run(view, HG_PATH_MISS, &p->waiting, 0, missed, demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_MISS, missed);
    if (rest > 0 && status == HG_OK)
        status = run(view, p->sees_hits ? HG_PATH_SURFACE : HG_PATH_SHADE, &p->waiting, missed,
            rest, &other, err);
    lap_stop(&lap, p, HG_PATH_PIECE_SHADE, rest);
    demand->missing += other.missing;
    demand->fits = demand->fits && other.fits;
    p->missing = demand->missing;
    return status;
}

static uint32_t count_missed(const struct hg_path *p)
{
    const struct hg_gpu_hit *hits = p->hits.mapped;
    const uint32_t *slots = p->waiting.buffer.mapped,
                   most = p->missed < p->waiting.count ? p->missed : p->waiting.count;
    uint32_t n = 0;
    while (n < most && hits[slots[n]].draw == HG_HIT_NONE)
        n++;
    return n;
}

static enum hg_status shade(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_page_demand demand;
    const uint32_t before = p->waiting.count, count = before < p->part ? before : p->part;
    enum hg_status status = shade_some(view, count, &demand, err);
    if (status != HG_OK)
        return status;
    struct lap lap = lap_start();
    keep(p, &p->waiting, count, HG_PATH_STATUS_MASK, HG_PATH_WAITS);
    if (p->missed > 0)
        p->missed = count_missed(p);
    status = note_demand(p, &demand, p->waiting.count < before, err);
    if (p->waiting.count > 0 || status != HG_OK)
        return status;
    p->wait_pages = false;
    copy(&p->live, &p->shadows);
    copy(&p->live, &p->suns);
    p->second = 0;
    keep(p, &p->shadows, p->shadows.count, HG_PATH_SHADOW, HG_PATH_SHADOW);
    keep(p, &p->suns, p->suns.count, HG_PATH_SUN, HG_PATH_SUN);
    keep(p, &p->live, p->live.count, HG_PATH_STATUS_MASK, HG_PATH_LIVE);
    p->phase = p->shadows.count > 0 ? HG_PATH_PHASE_SHADOW : after_light(p);
    p->bounce++;
    lap_stop(&lap, p, HG_PATH_PIECE_LISTS, 0);
    return HG_OK;
}

static enum hg_status shadow(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_page_demand demand;
    const uint32_t bit = HG_PATH_SHADOW << p->second;
    struct lap lap = lap_start();
    const struct hg_trace_wave wave = {.rays = &p->shadow_rays,
        .blocked = &p->blocked,
        .list = &p->shadows.buffer,
        .first_ray = (uint64_t)p->second * HG_PATH_WAVE_PX,
        .count = p->shadows.count,
        .coherent = p->bounce == 1};
    enum hg_status status = trace_raw(view, &wave, true, &lap, err);
    if (status == HG_OK)
        status = hg_trace_blocked(p->trace, &wave, err);
    lap_stop(&lap, p, HG_PATH_PIECE_SHADOW, p->shadows.count);
    if (status == HG_OK)
        status = run(view, HG_PATH_ARRIVE, &p->shadows, 0, p->shadows.count, &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_LIGHT, p->shadows.count);
    if (status != HG_OK)
        return status;
    keep(p, &p->shadows, p->shadows.count, bit, bit);
    p->part = p->shadows.count;
    p->phase = p->shadows.count > 0 ? HG_PATH_PHASE_HOLES : after_light(p);
    return HG_OK;
}

// Paths that went past a surface and paths that wait alike: their rays are followed once more.
static enum hg_status holes(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_page_demand demand = {.fits = true};
    const uint32_t bit = HG_PATH_SHADOW << p->second;
    struct lap lap = lap_start();
    const struct hg_trace_wave wave = {.rays = &p->shadow_rays,
        .hits = &p->shadow_hits,
        .list = &p->shadows.buffer,
        .first_ray = (uint64_t)p->second * HG_PATH_WAVE_PX,
        .count = p->shadows.count};
    enum hg_status status = hg_trace_closest(p->trace, &wave, err);
    uint32_t clear = 0;
    if (status == HG_OK && p->sees_hits) {
        clear = sort_hits(&p->shadow_hits, &p->shadows, &p->waiting);
        copy(&p->waiting, &p->shadows);
        p->waiting.count = 0;
    }
    if (status == HG_OK && clear > 0)
        status = run(view, HG_PATH_CLEAR, &p->shadows, 0, clear, &demand, err);
    const uint32_t left = p->shadows.count - clear, some = left < p->part ? left : p->part;
    const uint32_t count = clear + some;
    if (status == HG_OK && some > 0)
        status = run(view, HG_PATH_HOLES, &p->shadows, clear, some, &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_HOLES, p->shadows.count);
    if (status != HG_OK)
        return status;
    keep(p, &p->shadows, count, bit, bit);
    status = note_demand(p, &demand, demand.missing == 0 || p->shadows.count < count, err);
    if (p->shadows.count == 0) {
        p->wait_pages = false;
        p->phase = after_light(p);
    }
    return status;
}

// The same camera rays once more, of the slots that have met something.
static enum hg_status branch(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct lap lap = lap_start();
    struct hg_page_demand demand;
    p->branch++;
    p->second = p->bounce = 0;
    copy(&p->seen, &p->live);
    const enum hg_status status =
        run(view, HG_PATH_BEGIN, &p->live, 0, p->live.count, &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_BEGIN, p->live.count);
    p->phase = HG_PATH_PHASE_TRACE;
    return status;
}

// Samples of some tiles, which all lie in the ring with those around, to the film.
static enum hg_status add_tiles(
    struct hg_view_state *view, uint32_t *at, uint32_t end, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_page_demand demand;
    uint32_t *tiles = p->tiles.mapped, *numbers = p->tile_samples.mapped, count = 0;
    uint32_t *samples = p->samples.mapped, all[HG_PATH_WAVE_TILES];
    const uint32_t *traced = p->traced.mapped;
    for (; *at < end && count < HG_PATH_WAVE_TILES; (*at)++) {
        if (traced[*at] != p->pass + 1 || samples[*at] != p->pass)
            continue;
        tiles[count] = *at % p->columns | *at / p->columns << 16;
        numbers[count] = samples[*at]++;
        all[count++] = *at;
    }
    if (count == 0)
        return HG_OK;
    if (!hg_film_cpu_is_used(p))
        return run(view, HG_PATH_ADD, &p->live, 0, count * HG_PATH_TILE_PX, &demand, err);
    hg_film_cpu_add(p, all, count);
    return HG_OK;
}

// To the film go the rows of tiles of which this one and the next are through.
static enum hg_status add_rows(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const uint32_t whole = p->next_tile / p->columns;
    const uint32_t end = p->next_tile == p->tile_count ? p->rows : whole > 0 ? whole - 1 : 0;
    uint32_t at = p->next_row * p->columns;
    enum hg_status status = HG_OK;
    while (status == HG_OK && at < end * p->columns)
        status = add_tiles(view, &at, end * p->columns, err);
    p->next_row = end > p->next_row ? end : p->next_row;
    return status;
}

static enum hg_status add(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_page_demand demand;
    struct lap lap = lap_start();
    uint32_t *traced = p->traced.mapped;
    p->live.count = p->slots; // for its address alone: these kernels go by slot
    enum hg_status status = HG_OK;
    if (hg_film_cpu_is_used(p))
        hg_film_cpu_keep(p);
    else
        status = run(view, HG_PATH_KEEP, &p->live, 0, p->slots, &demand, err);
    for (uint32_t i = 0; i < p->wave_tiles; i++)
        traced[p->tile_index[i]] = p->pass + 1;
    if (status == HG_OK)
        status = add_rows(view, err);
    lap_stop(&lap, p, HG_PATH_PIECE_FILM, p->slots);
    p->phase = HG_PATH_PHASE_NONE;
    p->stale = true;
    return status;
}

enum hg_status hg_path_advance(struct hg_view_state *view, bool *over, struct hg_error *err)
{
    struct hg_path *p = view->path;
    *over = false;
    if (p->wait_pages) {
        bool arrived;
        const enum hg_status status = wait_for_pages(view, &arrived, err);
        if (status != HG_OK || !arrived)
            return status;
        p->wait_pages = false;
    }
    switch (p->phase) {
    case HG_PATH_PHASE_TRACE:
        return trace(view, err);
    case HG_PATH_PHASE_SHADE:
        return shade(view, err);
    case HG_PATH_PHASE_SHADOW:
        return shadow(view, err);
    case HG_PATH_PHASE_HOLES:
        return holes(view, err);
    case HG_PATH_PHASE_BRANCH:
        return branch(view, err);
    case HG_PATH_PHASE_FILM:
    case HG_PATH_PHASE_NONE:
        break;
    }
    *over = true;
    return p->phase == HG_PATH_PHASE_FILM ? add(view, err) : HG_OK;
}
