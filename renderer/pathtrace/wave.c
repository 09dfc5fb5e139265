// wave.c - one wave of paths: from the camera until all have ended.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/pathtrace/path_state.h"

#define PAGE_WAIT_NS   40000000u // per piece of work
#define MOST_FRUITLESS 4096u

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

// Adds the time since the start or the last stop to a piece.
static void lap_stop(struct lap *lap, struct hg_path *p, enum hg_path_piece piece, uint64_t items)
{
    const struct lap now = lap_start();
    struct hg_path_time *time = &p->stats.pieces[piece];
    time->ns += now.ns - lap->ns;
    time->cpu_ns += now.cpu_ns - lap->cpu_ns;
    time->items += items;
    *lap = now;
}

// --- the way of a wave ---------------------------------------------------------------------------

enum hg_status hg_path_wave_begin(struct hg_path *p, struct hg_error *err)
{
    struct lap lap = lap_start();
    struct hg_page_demand demand;
    uint32_t *tiles = p->wave.buffers.tiles.mapped, *numbers = p->wave.buffers.tile_samples.mapped,
             *list;
    for (uint32_t i = 0; i < p->wave.tile_count; i++) {
        const uint32_t tile = p->wave.tile_index[i];
        tiles[i] = tile % p->film.columns | tile / p->film.columns << 16;
        numbers[i] = p->progress.pass;
    }
    p->wave.slots = p->wave.tile_count * HG_PATH_TILE_PX;
    list = p->wave.lists.live.buffer.mapped;
    for (uint32_t i = 0; i < p->wave.slots; i++)
        list[i] = i;
    p->wave.lists.live.count = p->wave.slots;
    p->wave.lists.waiting.count = p->wave.lists.shadows.count = p->wave.lists.suns.count =
        p->wave.lists.primary.count = p->wave.second = p->wave.bounce = p->wave.branch =
            p->wave.fruitless = p->wave.missed = 0;
    p->wave.part = HG_PATH_WAVE_PX;
    p->wave.wait_pages = false;
    hg_path_wave_fill(p);
    enum hg_status status = hg_path_wave_run(p,
        &(struct hg_path_run){HG_PATH_BEGIN, &p->wave.lists.live, 0, p->wave.lists.live.count},
        &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_BEGIN, p->wave.slots);
    p->stats.waves++;
    p->stats.paths += p->wave.slots;
    p->wave.phase = HG_PATH_PHASE_TRACE;
    return status;
}

// Removes those of the first `count` slots whose status does not have `bits` in `mask`.
static void keep(const struct hg_path *p, struct hg_path_list *list, uint32_t count, uint32_t mask,
    uint32_t bits)
{
    const uint32_t *status = p->wave.buffers.status.mapped, all = list->count;
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

// Embree alone on the same rays, for benchmarks; not included in the other times.
static enum hg_status trace_raw(struct hg_path *p, const struct hg_trace_wave *wave, bool any,
    struct lap *lap, struct hg_error *err)
{
    uint64_t ns = 0;
    if (!p->context->overrides.trace_raw ||
        hg_trace_backend(hg_rays_trace(p->scene.rays)) != HG_TRACE_EMBREE)
        return HG_OK;
    const enum hg_status status = hg_trace_raw(hg_rays_trace(p->scene.rays), wave, any, &ns, err);
    p->stats.raw_ns[any] += ns;
    p->stats.raw_rays[any] += wave->count;
    *lap = lap_start();
    return status;
}

// Stable partition of a list: slots whose rays missed, then the others. Returns the number of
// misses.
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
static void note_primary(struct hg_path *p)
{
    p->wave.lists.primary.count = p->wave.lists.waiting.count - p->wave.missed;
    memcpy(p->wave.lists.primary.buffer.mapped,
        (const uint32_t *)p->wave.lists.waiting.buffer.mapped + p->wave.missed,
        (size_t)p->wave.lists.primary.count * 4);
}

static enum hg_status trace(struct hg_path *p, struct hg_error *err)
{
    struct lap lap = lap_start();
    const struct hg_trace_wave wave = {.rays = &p->wave.buffers.rays,
        .hits = &p->wave.buffers.hits,
        .list = &p->wave.lists.live.buffer,
        .count = p->wave.lists.live.count,
        .coherent = p->wave.bounce == 0};
    enum hg_status status = trace_raw(p, &wave, false, &lap, err);
    if (status == HG_OK)
        status = hg_trace_closest(hg_rays_trace(p->scene.rays), &wave, err);
    lap_stop(&lap, p, HG_PATH_PIECE_TRACE, p->wave.lists.live.count);
    p->wave.missed = 0;
    if (p->wave.host_hits)
        p->wave.missed =
            sort_hits(&p->wave.buffers.hits, &p->wave.lists.live, &p->wave.lists.waiting);
    else
        copy(&p->wave.lists.live, &p->wave.lists.waiting);
    if (p->branch_bits > 0 && p->wave.bounce == 0 && p->wave.branch == 0)
        note_primary(p);
    p->wave.part = p->wave.lists.live.count;
    p->wave.phase = HG_PATH_PHASE_SHADE;
    lap_stop(&lap, p, HG_PATH_PIECE_LISTS, p->wave.lists.live.count);
    return status;
}

static enum hg_status wait_for_pages(struct hg_path *p, bool *arrived, struct hg_error *err)
{
    struct lap lap = lap_start();
    const uint64_t start = lap.ns;
    enum hg_status status = hg_page_cache_update(hg_path_pages(p), HG_PAGES_EXACT, UINT64_MAX, err);
    uint64_t spent = 0;
    while (
        status == HG_OK && hg_page_cache_under_way(hg_path_pages(p)) > 0 && spent < PAGE_WAIT_NS) {
        hg_page_cache_wait(hg_path_pages(p), PAGE_WAIT_NS - spent);
        status = hg_page_cache_update(hg_path_pages(p), HG_PAGES_EXACT, UINT64_MAX, err);
        spent = hg_clock_now_ns() - start;
    }
    *arrived = hg_page_cache_under_way(hg_path_pages(p)) == 0;
    lap_stop(&lap, p, HG_PATH_PIECE_PAGES, 0);
    return status;
}

// After a kernel that may have missed pages: keeps the suspended slots, and adapts the batch size.
static enum hg_status note_demand(
    struct hg_path *p, const struct hg_page_demand *demand, bool got_on, struct hg_error *err)
{
    p->wave.wait_pages = demand->missing > 0;
    if (!demand->fits)
        p->wave.part = p->wave.part > 1 ? (p->wave.part + 1) / 2 : 1;
    p->wave.fruitless = got_on ? 0 : p->wave.fruitless + 1;
    return p->wave.fruitless < MOST_FRUITLESS
               ? HG_OK
               : hg_error_set(err, HG_E_LIMIT, "path", "textures",
                     "paths wait for texture pages that do not come");
}

// Shadow rays to directional lights are traced after those to the other lights.
static enum hg_path_phase after_light(struct hg_path *p)
{
    if (p->wave.lists.suns.count > 0) {
        copy(&p->wave.lists.suns, &p->wave.lists.shadows);
        p->wave.lists.suns.count = 0;
        p->wave.second = 1;
        return HG_PATH_PHASE_SHADOW;
    }
    if (p->wave.lists.live.count > 0)
        return HG_PATH_PHASE_TRACE;
    const bool follows = (p->options & HG_PATH_SURFACES) == 0;
    const bool more =
        follows && p->wave.lists.primary.count > 0 && p->wave.branch + 1 < 1u << p->branch_bits;
    return more ? HG_PATH_PHASE_BRANCH : HG_PATH_PHASE_FILM;
}

static void add_demand(struct hg_page_demand *demand, const struct hg_page_demand *more)
{
    demand->missing += more->missing;
    demand->fits = demand->fits && more->fits;
}

// Of slots from a list, to `ends` those whose paths may end at what they met, to `rest` the others:
// also what is too near for that, where the host knows.
static void split_ends(const struct hg_path *p, const uint32_t *slots, uint32_t count,
    struct hg_path_list *ends, struct hg_path_list *rest)
{
    uint32_t *end = ends->buffer.mapped, *other = rest->buffer.mapped;
    const struct hg_gpu_hit *hits = p->wave.host_hits ? p->wave.buffers.hits.mapped : NULL;
    const float near_m = p->request.gather.near_m;
    ends->count = rest->count = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t slot = slots[i];
        const bool near = hits != NULL && hits[slot].t < near_m;
        if (!near && p->wave.bounce >= HG_PATH_ENDS_FROM(p->progress.pass, slot, slot >> 1))
            end[ends->count++] = slot;
        else
            other[rest->count++] = slot;
    }
}

// Hits of gathering paths: where they end there is little to do, in a kernel of its own.
static enum hg_status shade_ends(struct hg_path *p, uint32_t first, uint32_t count,
    struct hg_page_demand *demand, struct hg_error *err)
{
    // These are free until shadow rays are listed.
    struct hg_path_list *ends = &p->wave.lists.shadows, *rest = &p->wave.lists.suns;
    const uint32_t *status_of = p->wave.buffers.status.mapped;
    struct hg_page_demand other = {.fits = true};
    split_ends(p, (const uint32_t *)p->wave.lists.waiting.buffer.mapped + first, count, ends, rest);
    enum hg_status status = HG_OK;
    if (ends->count > 0)
        status = hg_path_wave_run(
            p, &(struct hg_path_run){HG_PATH_END, ends, 0, ends->count}, &other, err);
    add_demand(demand, &other);
    const uint32_t *end = ends->buffer.mapped;
    uint32_t *slots = rest->buffer.mapped;
    for (uint32_t i = 0; i < ends->count; i++) {
        slots[rest->count] = end[i];
        rest->count += (status_of[end[i]] & HG_PATH_STATUS_MASK) == HG_PATH_FINE;
    }
    if (rest->count == 0 || status != HG_OK)
        return status;
    status = hg_path_wave_run(p,
        &(struct hg_path_run){
            p->wave.host_hits ? HG_PATH_SURFACE : HG_PATH_SHADE, rest, 0, rest->count},
        &other, err);
    add_demand(demand, &other);
    return status;
}

// Samples that look for directional lights alone: paths that left the scene are over.
static enum hg_status shade_sunlit(struct hg_path *p, uint32_t missed, uint32_t count,
    struct hg_page_demand *demand, struct hg_error *err)
{
    const uint32_t *slots = p->wave.lists.waiting.buffer.mapped;
    uint32_t *status_of = p->wave.buffers.status.mapped;
    for (uint32_t i = 0; i < missed; i++)
        status_of[slots[i]] = HG_PATH_DONE;
    if (count == 0)
        return HG_OK;
    return hg_path_wave_run(p,
        &(struct hg_path_run){HG_PATH_SUNLIT, &p->wave.lists.waiting, missed, count}, demand, err);
}

static enum hg_status shade_hits(struct hg_path *p, uint32_t first, uint32_t count,
    struct hg_page_demand *demand, struct hg_error *err)
{
    const bool gathers = (p->options & (HG_PATH_GATHERS | HG_PATH_GLASS)) == HG_PATH_GATHERS;
    struct hg_page_demand other = {.fits = true};
    if (gathers && p->wave.bounce > 0)
        return shade_ends(p, first, count, demand, err);
    const enum hg_status status = hg_path_wave_run(p,
        &(struct hg_path_run){p->wave.host_hits ? HG_PATH_SURFACE : HG_PATH_SHADE,
            &p->wave.lists.waiting, first, count},
        &other, err);
    add_demand(demand, &other);
    return status;
}

// Shades the first `count` suspended slots, misses and hits in separate kernels where known.
static enum hg_status shade_some(
    struct hg_path *p, uint32_t count, struct hg_page_demand *demand, struct hg_error *err)
{
    struct lap lap = lap_start();
    const uint32_t missed = p->wave.missed < count ? p->wave.missed : count, rest = count - missed;
    enum hg_status status = HG_OK;
    *demand = (struct hg_page_demand){.fits = true};
    const bool full = !p->request.gather.on || p->progress.pass < p->request.gather.full;
    if (full && missed > 0)
        status = hg_path_wave_run(
            p, &(struct hg_path_run){HG_PATH_MISS, &p->wave.lists.waiting, 0, missed}, demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_MISS, missed);
    if (!full)
        status = shade_sunlit(p, missed, rest, demand, err);
    else if (rest > 0 && status == HG_OK)
        status = shade_hits(p, missed, rest, demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_SHADE, rest);
    p->wave.missing = demand->missing;
    return status;
}

static uint32_t count_missed(const struct hg_path *p)
{
    const struct hg_gpu_hit *hits = p->wave.buffers.hits.mapped;
    const uint32_t *slots = p->wave.lists.waiting.buffer.mapped,
                   most = p->wave.missed < p->wave.lists.waiting.count
                              ? p->wave.missed
                              : p->wave.lists.waiting.count;
    uint32_t n = 0;
    while (n < most && hits[slots[n]].draw == HG_HIT_NONE)
        n++;
    return n;
}

static enum hg_status shade(struct hg_path *p, struct hg_error *err)
{
    struct hg_page_demand demand;
    const uint32_t before = p->wave.lists.waiting.count,
                   count = before < p->wave.part ? before : p->wave.part;
    enum hg_status status = shade_some(p, count, &demand, err);
    if (status != HG_OK)
        return status;
    struct lap lap = lap_start();
    keep(p, &p->wave.lists.waiting, count, HG_PATH_STATUS_MASK, HG_PATH_WAITS);
    if (p->wave.missed > 0)
        p->wave.missed = count_missed(p);
    status = note_demand(p, &demand, p->wave.lists.waiting.count < before, err);
    if (p->wave.lists.waiting.count > 0 || status != HG_OK)
        return status;
    p->wave.wait_pages = false;
    copy(&p->wave.lists.live, &p->wave.lists.shadows);
    copy(&p->wave.lists.live, &p->wave.lists.suns);
    p->wave.second = 0;
    keep(p, &p->wave.lists.shadows, p->wave.lists.shadows.count, HG_PATH_SHADOW, HG_PATH_SHADOW);
    keep(p, &p->wave.lists.suns, p->wave.lists.suns.count, HG_PATH_SUN, HG_PATH_SUN);
    keep(p, &p->wave.lists.live, p->wave.lists.live.count, HG_PATH_STATUS_MASK, HG_PATH_LIVE);
    p->wave.phase = p->wave.lists.shadows.count > 0 ? HG_PATH_PHASE_SHADOW : after_light(p);
    p->wave.bounce++;
    lap_stop(&lap, p, HG_PATH_PIECE_LISTS, 0);
    return HG_OK;
}

static enum hg_status shadow(struct hg_path *p, struct hg_error *err)
{
    struct hg_page_demand demand;
    const uint32_t bit = HG_PATH_SHADOW << p->wave.second;
    struct lap lap = lap_start();
    const struct hg_trace_wave wave = {.rays = &p->wave.buffers.shadow_rays,
        .blocked = &p->wave.buffers.blocked,
        .list = &p->wave.lists.shadows.buffer,
        .first_ray = (uint64_t)p->wave.second * HG_PATH_WAVE_PX,
        .count = p->wave.lists.shadows.count,
        .coherent = p->wave.bounce == 1};
    enum hg_status status = trace_raw(p, &wave, true, &lap, err);
    if (status == HG_OK)
        status = hg_trace_blocked(hg_rays_trace(p->scene.rays), &wave, err);
    lap_stop(&lap, p, HG_PATH_PIECE_SHADOW, p->wave.lists.shadows.count);
    if (status == HG_OK)
        status = hg_path_wave_run(p,
            &(struct hg_path_run){
                HG_PATH_ARRIVE, &p->wave.lists.shadows, 0, p->wave.lists.shadows.count},
            &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_LIGHT, p->wave.lists.shadows.count);
    if (status != HG_OK)
        return status;
    keep(p, &p->wave.lists.shadows, p->wave.lists.shadows.count, bit, bit);
    p->wave.part = p->wave.lists.shadows.count;
    p->wave.phase = p->wave.lists.shadows.count > 0 ? HG_PATH_PHASE_ALPHA_MASK : after_light(p);
    return HG_OK;
}

// Traces again the rays of paths that passed a surface and of suspended paths.
static enum hg_status alpha_mask(struct hg_path *p, struct hg_error *err)
{
    struct hg_page_demand demand = {.fits = true};
    const uint32_t bit = HG_PATH_SHADOW << p->wave.second;
    struct lap lap = lap_start();
    const struct hg_trace_wave wave = {.rays = &p->wave.buffers.shadow_rays,
        .hits = &p->wave.buffers.shadow_hits,
        .list = &p->wave.lists.shadows.buffer,
        .first_ray = (uint64_t)p->wave.second * HG_PATH_WAVE_PX,
        .count = p->wave.lists.shadows.count};
    enum hg_status status = hg_trace_closest(hg_rays_trace(p->scene.rays), &wave, err);
    uint32_t clear = 0;
    if (status == HG_OK && p->wave.host_hits) {
        clear =
            sort_hits(&p->wave.buffers.shadow_hits, &p->wave.lists.shadows, &p->wave.lists.waiting);
        copy(&p->wave.lists.waiting, &p->wave.lists.shadows);
        p->wave.lists.waiting.count = 0;
    }
    if (status == HG_OK && clear > 0)
        status = hg_path_wave_run(p,
            &(struct hg_path_run){HG_PATH_CLEAR, &p->wave.lists.shadows, 0, clear}, &demand, err);
    const uint32_t left = p->wave.lists.shadows.count - clear,
                   some = left < p->wave.part ? left : p->wave.part;
    const uint32_t count = clear + some;
    if (status == HG_OK && some > 0)
        status = hg_path_wave_run(p,
            &(struct hg_path_run){HG_PATH_ALPHA_MASK, &p->wave.lists.shadows, clear, some}, &demand,
            err);
    lap_stop(&lap, p, HG_PATH_PIECE_ALPHA_MASK, p->wave.lists.shadows.count);
    if (status != HG_OK)
        return status;
    keep(p, &p->wave.lists.shadows, count, bit, bit);
    status =
        note_demand(p, &demand, demand.missing == 0 || p->wave.lists.shadows.count < count, err);
    if (p->wave.lists.shadows.count == 0) {
        p->wave.wait_pages = false;
        p->wave.phase = after_light(p);
    }
    return status;
}

// The same camera rays again, for slots that hit a surface.
static enum hg_status branch(struct hg_path *p, struct hg_error *err)
{
    struct lap lap = lap_start();
    struct hg_page_demand demand;
    p->wave.branch++;
    p->wave.second = p->wave.bounce = 0;
    copy(&p->wave.lists.primary, &p->wave.lists.live);
    const enum hg_status status = hg_path_wave_run(p,
        &(struct hg_path_run){HG_PATH_BEGIN, &p->wave.lists.live, 0, p->wave.lists.live.count},
        &demand, err);
    lap_stop(&lap, p, HG_PATH_PIECE_BEGIN, p->wave.lists.live.count);
    p->wave.phase = HG_PATH_PHASE_TRACE;
    return status;
}

// Adds to the film the samples of tiles whose neighbours are all in the ring.
static enum hg_status add_tiles(struct hg_path *p, uint32_t *at, uint32_t end, struct hg_error *err)
{
    struct hg_page_demand demand;
    uint32_t *tiles = p->wave.buffers.tiles.mapped, *numbers = p->wave.buffers.tile_samples.mapped,
             count = 0;
    uint32_t *samples = p->film.samples.mapped, all[HG_PATH_WAVE_TILES];
    const uint32_t *traced = p->film.traced.mapped;
    for (; *at < end && count < HG_PATH_WAVE_TILES; (*at)++) {
        if (traced[*at] != p->progress.pass + 1 || samples[*at] != p->progress.pass)
            continue;
        tiles[count] = *at % p->film.columns | *at / p->film.columns << 16;
        numbers[count] = samples[*at]++;
        all[count++] = *at;
    }
    if (count == 0)
        return HG_OK;
    if (!hg_film_cpu_is_used(p))
        return hg_path_wave_run(p,
            &(struct hg_path_run){HG_PATH_ADD, &p->wave.lists.live, 0, count * HG_PATH_TILE_PX},
            &demand, err);
    hg_film_cpu_add(p, all, count);
    return HG_OK;
}

// Adds rows of tiles to the film once they and the next row are complete.
static enum hg_status add_rows(struct hg_path *p, struct hg_error *err)
{
    const uint32_t whole = p->progress.next_tile / p->film.columns;
    const uint32_t end = p->progress.next_tile == p->film.tile_count ? p->film.rows
                         : whole > 0                                 ? whole - 1
                                                                     : 0;
    uint32_t at = p->progress.next_row * p->film.columns;
    enum hg_status status = HG_OK;
    while (status == HG_OK && at < end * p->film.columns)
        status = add_tiles(p, &at, end * p->film.columns, err);
    p->progress.next_row = end > p->progress.next_row ? end : p->progress.next_row;
    return status;
}

static enum hg_status add(struct hg_path *p, struct hg_error *err)
{
    struct hg_page_demand demand;
    struct lap lap = lap_start();
    uint32_t *traced = p->film.traced.mapped;
    p->wave.lists.live.count =
        p->wave.slots; // only its address is used: these kernels are indexed by slot
    enum hg_status status = HG_OK;
    if (hg_film_cpu_is_used(p))
        hg_film_cpu_keep(p);
    else
        status = hg_path_wave_run(p,
            &(struct hg_path_run){HG_PATH_KEEP, &p->wave.lists.live, 0, p->wave.slots}, &demand,
            err);
    for (uint32_t i = 0; i < p->wave.tile_count; i++)
        traced[p->wave.tile_index[i]] = p->progress.pass + 1;
    if (status == HG_OK)
        status = add_rows(p, err);
    lap_stop(&lap, p, HG_PATH_PIECE_FILM, p->wave.slots);
    p->wave.phase = HG_PATH_PHASE_NONE;
    p->progress.unshown = true;
    return status;
}

enum hg_status hg_path_wave_advance(struct hg_path *p, bool *over, struct hg_error *err)
{
    *over = false;
    if (p->wave.wait_pages) {
        bool arrived;
        const enum hg_status status = wait_for_pages(p, &arrived, err);
        if (status != HG_OK || !arrived)
            return status;
        p->wave.wait_pages = false;
    }
    switch (p->wave.phase) {
    case HG_PATH_PHASE_TRACE:
        return trace(p, err);
    case HG_PATH_PHASE_SHADE:
        return shade(p, err);
    case HG_PATH_PHASE_SHADOW:
        return shadow(p, err);
    case HG_PATH_PHASE_ALPHA_MASK:
        return alpha_mask(p, err);
    case HG_PATH_PHASE_BRANCH:
        return branch(p, err);
    case HG_PATH_PHASE_FILM:
    case HG_PATH_PHASE_NONE:
        break;
    }
    *over = true;
    return p->wave.phase == HG_PATH_PHASE_FILM ? add(p, err) : HG_OK;
}
