// page_stream.c - see page_cache.h: from what shaders asked for to pages in slots.
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/texture/cache/cache_internal.h"

#define BIAS_STEP      0.25f
#define BIAS_MOST      8.0f
#define PRESSED_FRAMES 3  // in which something found no slot: then the bias rises
#define RELAXED_FRAMES 30 // in which much less would do: then it falls
#define WAIT_STEP_NS   4000000u
#define AHEAD_WEIGHT   1e-4f // what no picture lacks yet goes behind what one lacks

// --- uploads -------------------------------------------------------------------------------------

// Mip tails are pinned, as long as that leaves half of the slots for other pages.
static void pin_tail(struct hg_page_cache *c, const struct hg_page_set *set,
    const struct page_place *place, uint32_t slot)
{
    struct hg_residency_stats stats;
    hg_residency_stats(c->residency[set->pool], &stats);
    if (place->mip == set->info->layout.tail && 2 * stats.pinned < stats.slots)
        hg_residency_pin(c->residency[set->pool], slot);
}

void hg_page_cache_forget(struct hg_page_cache *c, uint64_t key)
{
    struct hg_page_set *set = key <= UINT32_MAX ? hg_page_table_set(c, (uint32_t)key) : NULL;
    struct page_place place;
    if (set == NULL || set->refs == 0 || !hg_page_table_place(set, (uint32_t)key, &place))
        return;
    hg_page_table_remove(c, set, &place);
    set->resident--;
}

// Assigns a slot to a page that was read and uploads it. A device error drops the page.
static enum hg_status place_page(struct hg_page_cache *c, struct hg_page_set *set,
    const struct hg_page_read *read, enum hg_page_mode mode, struct hg_error *err)
{
    struct hg_residency *r = c->residency[set->pool];
    const struct page_place place = {read->mip, read->x, read->y};
    const bool tail = read->mip == set->info->layout.tail;
    const enum hg_residency_force force =
        mode == HG_PAGES_EXACT || tail ? HG_RESIDENCY_UNUSED : HG_RESIDENCY_GENTLE;
    uint32_t slot;
    uint64_t evicted;
    if (hg_residency_place(r, read->key, force, &slot, &evicted) != HG_OK) {
        hg_residency_cancel(r, read->key);
        c->refused = true;
        return HG_OK;
    }
    if (evicted != HG_RESIDENCY_NO_KEY)
        hg_page_cache_forget(c, evicted);
    const enum hg_status status = hg_pool_write(&c->pools[set->pool], slot, read->texels, err);
    if (status != HG_OK) {
        hg_residency_remove(r, slot);
        return status;
    }
    hg_page_table_add(c, set, &place, slot);
    pin_tail(c, set, &place, slot);
    set->resident++;
    c->stats.pages_loaded++;
    c->stats.bytes_uploaded +=
        (uint64_t)HG_PAGE_PITCH * HG_PAGE_PITCH * c->pools[set->pool].texel_bytes;
    return HG_OK;
}

static void report_broken(struct hg_page_cache *c, struct hg_page_set *set, struct hg_error *err)
{
    char text[512];
    if (set->failed)
        return;
    hg_error_format(err, text, sizeof text);
    hg_warn(TEXTURE, "image is shown white: %s", text);
    set->failed = true;
    c->failures++;
    c->revision++;
}

static enum hg_status finish_read(struct hg_page_cache *c, struct hg_page_read *read,
    enum hg_page_mode mode, struct hg_error *err)
{
    struct hg_page_set *set = read->user;
    set->reads--;
    c->stats.read_ns += read->ns;
    if (set->refs == 0) {
        hg_residency_cancel(c->residency[set->pool], read->key);
        hg_page_cache_sweep(c);
        return HG_OK;
    }
    if (read->status == HG_OK && hg_residency_is_in_flight(c->residency[set->pool], read->key))
        return place_page(c, set, read, mode, err);
    if (read->status == HG_E_AGAIN) { // asked for as before, and put off
        set->again = read->stamp;
        c->retry.is_due = true;
        hg_residency_put_back(c->residency[set->pool], read->key);
        return HG_OK;
    }
    hg_residency_cancel(c->residency[set->pool], read->key);
    if (read->status != HG_OK && read->status != HG_E_NOMEM)
        report_broken(c, set, &read->err);
    return HG_OK;
}

// --- reads ---------------------------------------------------------------------------------------

// Of the sources, never 0.
static uint64_t revision_of(const struct hg_page_cache *c)
{
    return hg_page_sources_revision(c->sources) + 1;
}

static bool is_ready(const struct hg_page_set *set, uint64_t revision)
{
    return set->again != revision;
}

// Slots that reads of a pool may fill beside those under way.
static uint32_t room_of(struct hg_page_cache *c, uint32_t pool, enum hg_page_mode mode)
{
    struct hg_residency_stats stats;
    hg_residency_stats(c->residency[pool], &stats);
    const uint32_t room = hg_residency_available(
        c->residency[pool], mode == HG_PAGES_EXACT ? HG_RESIDENCY_UNUSED : HG_RESIDENCY_GENTLE);
    return room > stats.in_flight ? room - stats.in_flight : 0;
}

// The most urgent request whose image is ready, if there is one; requests before it are deferred.
static struct hg_page_set *next_ready(struct hg_page_cache *c, uint32_t pool, uint64_t revision,
    uint64_t *key, struct page_place *place)
{
    float priority;
    while (hg_residency_next(c->residency[pool], key, &priority)) {
        struct hg_page_set *set = hg_page_table_set(c, (uint32_t)*key);
        // Requests outlive their set; its entries may be those of a set in another pool by now.
        const bool wanted = set != NULL && set->refs > 0 && set->pool == pool && !set->failed &&
                            hg_page_table_place(set, (uint32_t)*key, place);
        if (wanted && is_ready(set, revision))
            return set;
        if (wanted && hg_grow(&c->deferred.keys, &c->deferred.capacity, c->deferred.count + 1,
                          sizeof *c->deferred.keys) == HG_OK)
            c->deferred.keys[c->deferred.count++] = *key;
        else
            hg_residency_cancel(c->residency[pool], *key);
    }
    return NULL;
}

// False when there is nothing to read, or too much is being read already.
static bool start_read(struct hg_page_cache *c, uint32_t pool, uint64_t revision)
{
    uint64_t key;
    struct page_place place;
    struct hg_page_read *read = hg_page_reader_take(c->reader);
    struct hg_page_set *set = read != NULL ? next_ready(c, pool, revision, &key, &place) : NULL;
    if (set == NULL) {
        if (read != NULL)
            hg_page_reader_give(c->reader, read);
        return false;
    }
    read->source = set->source;
    read->user = set;
    read->key = key;
    read->stamp = revision;
    read->mip = place.mip;
    read->x = place.x;
    read->y = place.y;
    set->reads++;
    hg_page_reader_push(c->reader, read);
    return true;
}

// Requests without a free slot stay in the queue until the bias rises or the view changes, and so
// do those whose image is not ready.
static uint32_t start_reads_of(
    struct hg_page_cache *c, uint32_t pool, uint64_t revision, enum hg_page_mode mode)
{
    struct hg_residency_stats stats;
    uint32_t room = room_of(c, pool, mode);
    c->deferred.count = 0;
    while (room > 0 && start_read(c, pool, revision))
        room--;
    for (uint32_t i = 0; i < c->deferred.count; i++)
        hg_residency_put_back(c->residency[pool], c->deferred.keys[i]);
    hg_residency_stats(c->residency[pool], &stats);
    c->refused |= room == 0 && stats.requested > 0;
    c->retry.is_due |= stats.requested > c->deferred.count;
    return c->deferred.count;
}

static void start_reads(struct hg_page_cache *c, enum hg_page_mode mode)
{
    const uint64_t revision = revision_of(c);
    if (!c->retry.is_due && c->retry.revision == revision)
        return; // all that is left waits for its images
    c->retry.is_due = false;
    c->retry.revision = revision;
    c->retry.waiting = 0;
    for (uint32_t i = 0; i < POOLS; i++)
        c->retry.waiting += start_reads_of(c, i, revision, mode);
}

static enum hg_status upload_table(struct hg_page_cache *c, struct hg_error *err)
{
    if (c->table.dirty_first >= c->table.dirty_end)
        return HG_OK;
    const uint64_t first = c->table.dirty_first, count = c->table.dirty_end - c->table.dirty_first;
    const enum hg_status status =
        hg_gpu_buffer_upload(c->gpu, &c->table.buffer, first * sizeof *c->table.entries,
            c->table.entries + first, count * sizeof *c->table.entries, err);
    if (status == HG_OK)
        c->table.dirty_first = c->table.dirty_end = 0;
    return status;
}

enum hg_status hg_page_cache_update(
    struct hg_page_cache *c, enum hg_page_mode mode, uint64_t upload_ns, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = HG_OK;
    struct hg_page_read *read;
    bool any = false;
    while (status == HG_OK && (!any || hg_clock_now_ns() - start < upload_ns) &&
           (read = hg_page_reader_pop(c->reader, 0)) != NULL) {
        status = finish_read(c, read, mode, err);
        hg_page_reader_give(c->reader, read);
        any = true;
    }
    if (any)
        c->stats.upload_ns += hg_clock_now_ns() - start;
    start_reads(c, mode);
    if (status == HG_OK)
        status = hg_page_coarse_update(c, mode, err);
    return status == HG_OK ? upload_table(c, err) : status;
}

uint32_t hg_page_cache_under_way(const struct hg_page_cache *c)
{
    return hg_page_reader_out(c->reader) + c->retry.waiting;
}

static void wait_for_pages(struct hg_page_cache *c, uint64_t timeout_ns)
{
    const uint64_t end = hg_clock_now_ns() + timeout_ns;
    const uint64_t seen = hg_page_sources_revision(c->sources);
    for (uint64_t now; (now = hg_clock_now_ns()) < end;) {
        const uint64_t step = end - now < WAIT_STEP_NS ? end - now : WAIT_STEP_NS;
        if (hg_page_reader_pending(c->reader) > 0) {
            struct hg_page_read *read = hg_page_reader_pop(c->reader, step);
            if (read != NULL) {
                hg_page_reader_unpop(c->reader, read);
                return;
            }
        } else if (c->retry.waiting == 0) {
            return;
        } else {
            hg_page_sources_wait(c->sources, seen, step);
        }
        if (hg_page_sources_revision(c->sources) != seen)
            return;
    }
}

void hg_page_cache_wait(struct hg_page_cache *c, uint64_t timeout_ns)
{
    hg_page_sources_hurry(c->sources, true);
    wait_for_pages(c, timeout_ns);
    hg_page_sources_hurry(c->sources, false);
}

// --- feedback ------------------------------------------------------------------------------------

void hg_page_cache_begin(struct hg_page_cache *c, struct hg_gpu_cmd *cmd)
{
    if (c->readback.handle == VK_NULL_HANDLE)
        return; // cleared when it was read
    vkCmdFillBuffer(hg_gpu_cmd_handle(cmd), c->feedback.handle, 0, VK_WHOLE_SIZE, 0);
    hg_gpu_memory_barrier(cmd);
}

void hg_page_cache_end(struct hg_page_cache *c, struct hg_gpu_cmd *cmd)
{
    if (c->readback.handle == VK_NULL_HANDLE)
        return;
    hg_gpu_memory_barrier(cmd);
    const VkBufferCopy copy = {.size = 2ull * c->table.count * sizeof *c->table.entries};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), c->feedback.handle, c->readback.handle, 1, &copy);
}

struct tally {
    float weight;         // of requests
    uint32_t most[POOLS]; // requests to be made
    uint32_t missing[POOLS];
    uint32_t needed[POOLS]; // pages that unfinished pixels need, tails aside
};

// Queues a missing page, with its coverage times the number of missing mips as priority; when many
// mips are missing also some of its ancestors, which arrive sooner and serve more pixels. Pixels of
// an exact picture wait for the page itself: the resident coarser page may be evicted for it.
static void ask(struct hg_page_cache *c, struct hg_page_set *set, uint32_t entry, float weight,
    enum hg_page_mode mode)
{
    struct hg_residency *r = c->residency[set->pool];
    struct page_place place;
    if (!hg_page_table_place(set, entry, &place))
        return;
    uint32_t gap = c->table.entries[entry] >> HG_PAGE_COARSER_SHIFT;
    if (gap != HG_PAGE_NOTHING && mode != HG_PAGES_EXACT)
        hg_residency_use(
            r, hg_pool_slot(&c->pools[set->pool], c->table.entries[entry] & HG_PAGE_SLOT_MASK));
    const uint32_t tail = set->info->layout.tail;
    const bool nothing = gap == HG_PAGE_NOTHING || set->coarse_count > 0;
    gap = nothing ? tail - place.mip + 1 : gap;
    hg_residency_request(r, entry, weight * (float)gap);
    for (uint32_t up = 1; mode == HG_PAGES_SHOW && up < gap; up++) {
        if (!hg_page_table_parent(set, &place, &place))
            break;
        if (up % 3 == 2 || place.mip == tail)
            hg_residency_request(
                r, hg_page_table_entry(set, &place), weight * (float)(gap + 8 * up));
    }
}

static void collect_entry(struct hg_page_cache *c, struct hg_page_set *set, uint32_t entry,
    const uint32_t counts[2], enum hg_page_mode mode, struct tally *tally)
{
    const uint32_t found = c->table.entries[entry];
    const bool resident = found >> HG_PAGE_COARSER_SHIFT == 0;
    const bool tail = entry == set->table + set->entries - 1;
    tally->needed[set->pool] += counts[0] > 0 && !tail;
    if (resident) {
        hg_residency_use(
            c->residency[set->pool], hg_pool_slot(&c->pools[set->pool], found & HG_PAGE_SLOT_MASK));
    } else if (counts[0] > 0 && tally->most[set->pool] > 0) {
        tally->missing[set->pool]++;
        tally->most[set->pool]--;
        ask(c, set, entry, tally->weight * (float)counts[0], mode);
    }
}

static void collect_set(struct hg_page_cache *c, struct hg_page_set *set, uint32_t *words,
    bool clear, enum hg_page_mode mode, struct tally *tally)
{
    uint32_t *first = words + 2 * (size_t)set->table;
    bool any = false;
    for (uint32_t i = 0; i < set->entries; i++) {
        uint64_t both;
        memcpy(&both, first + 2 * (size_t)i, sizeof both);
        if (both == 0)
            continue;
        any = true;
        if (set->refs > 0 && !set->failed)
            collect_entry(c, set, set->table + i, first + 2 * (size_t)i, mode, tally);
    }
    if (clear && any)
        memset(first, 0, 2ull * set->entries * sizeof *first);
}

static bool has_slack(const struct hg_page_cache *c)
{
    for (uint32_t i = 0; i < POOLS; i++) {
        struct hg_residency_stats stats;
        hg_residency_stats(c->residency[i], &stats);
        const uint32_t idle = hg_residency_available(c->residency[i], HG_RESIDENCY_GENTLE);
        // A step down needs 2^(2 * step) = 1.41 times the pages.
        if ((double)(stats.slots - stats.pinned - idle) * 1.6 >
            (double)(stats.slots - stats.pinned))
            return false;
    }
    return true;
}

// Hysteresis: the mip bias rises as soon as the working set does not fit, and falls only when the
// larger working set of the next step down would fit.
static void steer_bias(struct hg_page_cache *c, uint32_t missing)
{
    float *bias = &c->stats.bias;
    c->pressed = c->refused && missing > 0 ? c->pressed + 1 : 0;
    c->relaxed = *bias > 0.0f && missing == 0 && has_slack(c) ? c->relaxed + 1 : 0;
    c->refused = false;
    if (c->pressed >= PRESSED_FRAMES) {
        *bias = *bias + BIAS_STEP < BIAS_MOST ? *bias + BIAS_STEP : BIAS_MOST;
        c->pressed = 0;
    } else if (c->relaxed >= RELAXED_FRAMES) {
        *bias -= BIAS_STEP;
        c->relaxed = 0;
    }
}

static void note_missing(struct hg_page_cache *c, uint32_t missing)
{
    c->stats.missing = missing;
    if (missing > 0 && c->missing_since_ns == 0)
        c->missing_since_ns = hg_clock_now_ns();
    if (missing == 0 && c->missing_since_ns != 0) {
        c->stats.sharp_ns = hg_clock_now_ns() - c->missing_since_ns;
        c->missing_since_ns = 0;
    }
}

// Prefetch takes at most half of the unused slots.
static void limit_ahead(const struct hg_page_cache *c, struct tally *tally)
{
    tally->weight = AHEAD_WEIGHT;
    for (uint32_t i = 0; i < POOLS; i++)
        tally->most[i] = hg_residency_available(c->residency[i], HG_RESIDENCY_GENTLE) / 2;
}

void hg_page_cache_collect(
    struct hg_page_cache *c, enum hg_page_mode mode, struct hg_page_demand *out)
{
    struct tally tally = {.weight = 1.0f, .most = {UINT32_MAX, UINT32_MAX}};
    if (mode == HG_PAGES_PREFETCH)
        limit_ahead(c, &tally);
    *out = (struct hg_page_demand){.fits = true};
    const bool mapped = c->readback.handle == VK_NULL_HANDLE;
    uint32_t *words = mapped ? c->feedback.mapped : c->readback.mapped;
    if (words == NULL)
        return;
    for (uint32_t i = 0; i < POOLS && mode != HG_PAGES_PREFETCH; i++) {
        hg_residency_tick(c->residency[i]);
        if (mode == HG_PAGES_EXACT)
            hg_residency_drop_requests(c->residency[i]);
    }
    out->shadows = words[HG_FEEDBACK_SHADOWS] != 0;
    words[HG_FEEDBACK_SHADOWS] = 0;
    for (uint32_t i = 0; i < c->set_count; i++)
        if (c->sets[i]->table > 0)
            collect_set(c, c->sets[i], words, mapped, mode, &tally);
    for (uint32_t i = 0; i < POOLS; i++) {
        struct hg_residency_stats stats;
        hg_residency_stats(c->residency[i], &stats);
        out->fits &=
            tally.needed[i] <= stats.slots - stats.pinned &&
            (mode != HG_PAGES_EXACT ||
                tally.missing[i] <= hg_residency_available(c->residency[i], HG_RESIDENCY_UNUSED));
        out->missing += tally.missing[i];
    }
    c->retry.is_due = true;
    if (mode != HG_PAGES_PREFETCH)
        note_missing(c, out->missing);
    if (mode == HG_PAGES_SHOW)
        steer_bias(c, out->missing);
    if (mode != HG_PAGES_EXACT) // until the next update there is time to read
        start_reads(c, HG_PAGES_SHOW);
}

// --- everything ----------------------------------------------------------------------------------

// False when the requests of a pool are full.
static void request_all(struct hg_page_cache *c)
{
    for (uint32_t i = 0; i < c->set_count; i++) {
        struct hg_page_set *set = c->sets[i];
        if (set->refs == 0 || set->failed || set->resident == set->info->layout.pages)
            continue;
        for (uint32_t k = 0; k < set->entries; k++) {
            struct page_place place;
            const uint32_t entry = set->table + k;
            if (c->table.entries[entry] >> HG_PAGE_COARSER_SHIFT != 0 &&
                hg_page_table_place(set, entry, &place))
                hg_residency_request(c->residency[set->pool], entry, (float)(1 + place.mip));
        }
    }
}

enum hg_status hg_page_cache_load_all(struct hg_page_cache *c, struct hg_error *err)
{
    uint64_t pages[POOLS] = {0};
    for (uint32_t i = 0; i < c->set_count; i++)
        if (c->sets[i]->refs > 0)
            pages[c->sets[i]->pool] += c->sets[i]->info->layout.pages;
    for (uint32_t i = 0; i < POOLS; i++)
        if (pages[i] > 0 && pages[i] + NOTHINGS > hg_pool_slots(&c->pools[i]))
            return hg_error_set(err, HG_E_LIMIT, "texture budget", NULL,
                "%llu pages do not fit at once", (unsigned long long)pages[i]);
    while (!hg_page_cache_is_complete(c)) {
        request_all(c);
        c->retry.is_due = true;
        const enum hg_status status = hg_page_cache_update(c, HG_PAGES_EXACT, UINT64_MAX, err);
        if (status != HG_OK)
            return status;
        hg_page_cache_wait(c, 100000000);
    }
    return upload_table(c, err);
}

void hg_page_cache_fill(
    struct hg_page_cache *c, enum hg_page_mode mode, struct hg_gpu_textures *out)
{
    out->table = c->table.buffer.address;
    out->feedback = c->feedback.address;
    out->pool_scale = (float)HG_POOL_SIDE / (float)c->pools[POOL_8].side;
    out->bias = mode == HG_PAGES_SHOW ? c->stats.bias : 0.0f;
    // All 64 pixels of a block in 64 frames, far apart from one to the next.
    c->lottery = (c->lottery + 27) % 64;
    out->lottery = c->lottery;
}
