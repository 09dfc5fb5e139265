// page_cache.c - see page_cache.h: sets, and pools and table in line with them.
#include "renderer/texture/cache/page_cache.h"

#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/scene/asset.h"
#include "renderer/texture/cache/cache_internal.h"

#define HYSTERESIS      30           // frames
#define NOTHING_KEY     (1ull << 40) // keys of the slots of one colour
#define DEFAULT_THREADS 2

// --- life ----------------------------------------------------------------------------------------

static enum hg_status init(struct hg_page_cache *c, struct hg_error *err)
{
    const struct hg_residency_params residency = {.hysteresis = HYSTERESIS};
    const struct hg_page_sources_params sources = {
        .store = c->params.store, .memory_bytes = c->params.host_bytes, .limits = c->params.limits};
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < POOLS; i++) {
        hg_pool_init(&c->pools[i], c->gpu, i == POOL_8 ? 4 : 8, false);
        if (status == HG_OK)
            status = hg_residency_create(&residency, &c->residency[i]);
    }
    if (status == HG_OK)
        status = hg_page_reader_create(c->params.threads > 0 ? c->params.threads : DEFAULT_THREADS,
            HG_PAGE_CACHE_READS, &c->reader);
    if (status != HG_OK)
        return hg_error_set(err, status, "textures", NULL, "no memory");
    return hg_page_sources_create(&sources, &c->sources, err);
}

enum hg_status hg_page_cache_create(struct hg_gpu *gpu, const struct hg_page_cache_params *params,
    struct hg_page_cache **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_page_cache *c = hg_calloc(1, sizeof *c);
    if (c == NULL)
        return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
    c->gpu = gpu;
    c->params = *params;
    c->table.count = 1; // entry 0 is unused
    c->revision = 1;
    const uint64_t half = hg_gpu_get_caps(gpu)->memory_bytes / 2;
    c->budget_bytes = params->budget_bytes > 0 ? params->budget_bytes : half;
    const enum hg_status status = init(c, err);
    if (status != HG_OK) {
        hg_page_cache_destroy(c);
        return status;
    }
    *out = c;
    return HG_OK;
}

static void destroy_set(struct hg_page_set *set)
{
    hg_page_source_close(set->source);
    hg_image_source_unref(set->image);
    hg_free(set);
}

void hg_page_cache_destroy(struct hg_page_cache *c)
{
    if (c == NULL)
        return;
    hg_page_reader_destroy(c->reader); // before the sources that it reads
    for (uint32_t i = 0; i < c->set_count; i++)
        destroy_set(c->sets[i]);
    hg_page_sources_destroy(c->sources);
    for (uint32_t i = 0; i < POOLS; i++) {
        hg_pool_finish(&c->pools[i]);
        hg_residency_destroy(c->residency[i]);
    }
    hg_gpu_buffer_destroy(c->gpu, &c->table.buffer);
    hg_gpu_buffer_destroy(c->gpu, &c->feedback);
    hg_gpu_buffer_destroy(c->gpu, &c->readback);
    hg_free(c->sets);
    hg_free(c->table.entries);
    hg_free(c->deferred.keys);
    hg_free(c);
}

struct hg_page_sources *hg_page_cache_sources(struct hg_page_cache *c)
{
    return c->sources;
}

uint64_t hg_page_cache_revision(const struct hg_page_cache *c)
{
    return c->revision;
}

// --- sets ----------------------------------------------------------------------------------------

// Placeholder before the first page of a material is resident: as close as possible to the mean of
// the texture.
static uint32_t nothing_of(const struct hg_page_source_info *info, enum hg_texture_use use)
{
    (void)info;
    return use == HG_TEXTURE_NORMAL ? NOTHING_NORMAL
           : use == HG_TEXTURE_DATA ? NOTHING_WHITE
                                    : NOTHING_GREY;
}

static struct hg_page_set *find_content(
    const struct hg_page_cache *c, const struct hg_page_source_info *info)
{
    for (uint32_t i = 0; i < c->set_count; i++)
        if (c->sets[i]->refs > 0 &&
            memcmp(c->sets[i]->info->content_id, info->content_id, sizeof info->content_id) == 0)
            return c->sets[i];
    return NULL;
}

enum hg_status hg_page_cache_acquire(struct hg_page_cache *c, struct hg_page_source *source,
    struct hg_image_source *image, enum hg_texture_use use, struct hg_page_set **out,
    struct hg_error *err)
{
    const struct hg_page_source_info *info = hg_page_source_info(source);
    *out = find_content(c, info);
    if (*out != NULL) {
        (*out)->refs++;
        hg_page_source_close(source);
        return HG_OK;
    }
    struct hg_page_set *set = hg_calloc(1, sizeof *set);
    if (set == NULL || hg_grow(&c->sets, &c->set_capacity, c->set_count + 1, sizeof *c->sets)) {
        hg_free(set);
        hg_page_source_close(source);
        return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
    }
    *set = (struct hg_page_set){.source = source,
        .info = info,
        .image = hg_image_source_ref(image),
        .refs = 1,
        .entries = info->layout.entries,
        .pool = info->texel_bytes == 4 ? POOL_8 : POOL_HALF,
        .nothing = nothing_of(info, use)};
    memmove(c->sets + 1, c->sets, c->set_count * sizeof *c->sets); // those without a table first
    c->sets[0] = set;
    c->set_count++;
    hg_page_source_prefetch(source);
    *out = set;
    return HG_OK;
}

static void drop_pages(struct hg_page_cache *c, struct hg_page_set *set)
{
    struct hg_residency *r = c->residency[set->pool];
    struct hg_residency_stats stats;
    hg_residency_stats(r, &stats);
    for (uint32_t slot = 0; slot < stats.slots && set->resident > 0; slot++) {
        const uint64_t key = hg_residency_item(r, slot);
        if (key < set->table || key >= (uint64_t)set->table + set->entries)
            continue;
        hg_residency_remove(r, slot);
        set->resident--;
    }
}

// The set itself goes when no thread reads it any more (hg_page_cache_sweep).
void hg_page_cache_release(struct hg_page_cache *c, struct hg_page_set *set)
{
    if (--set->refs > 0)
        return;
    c->failures -= set->failed;
    hg_page_coarse_forget(c, set);
    if (set->table > 0)
        drop_pages(c, set);
    hg_page_cache_sweep(c);
}

void hg_page_cache_sweep(struct hg_page_cache *c)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < c->set_count; i++) {
        struct hg_page_set *set = c->sets[i];
        if (set->refs == 0 && set->reads == 0)
            destroy_set(set);
        else
            c->sets[kept++] = set;
    }
    c->set_count = kept;
}

const struct hg_page_source_info *hg_page_set_info(const struct hg_page_set *set)
{
    return set->info;
}

uint32_t hg_page_set_table(const struct hg_page_set *set)
{
    return set->table;
}

bool hg_page_set_failed(const struct hg_page_set *set)
{
    return set->failed;
}

// --- the table -----------------------------------------------------------------------------------

static enum hg_status out_of_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
}

// Moves sets[0], which has no table yet, into the first gap that is wide enough.
static enum hg_status place_table(struct hg_page_cache *c)
{
    struct hg_page_set *set = c->sets[0];
    uint32_t first = 0, at = 1, end = 1; // sets[first..] have tables
    while (first < c->set_count && c->sets[first]->table == 0)
        first++;
    for (at = first; at < c->set_count; at++) {
        if (c->sets[at]->table - end >= set->entries)
            break;
        end = c->sets[at]->table + c->sets[at]->entries;
    }
    uint32_t count = end + set->entries;
    count = count > c->table.count ? count : c->table.count;
    if (count < end ||
        hg_grow(&c->table.entries, &c->table.capacity, count, sizeof *c->table.entries) != HG_OK)
        return HG_E_NOMEM;
    if (c->table.count == 1)
        c->table.entries[0] = HG_PAGE_NOTHING << HG_PAGE_COARSER_SHIFT;
    for (uint32_t i = c->table.count; i < count; i++)
        c->table.entries[i] = HG_PAGE_NOTHING << HG_PAGE_COARSER_SHIFT;
    c->table.count = count;
    set->table = end;
    memmove(c->sets, c->sets + 1, (at - 1) * sizeof *c->sets);
    c->sets[at - 1] = set;
    hg_page_table_clear(c, set);
    return HG_OK;
}

// Buffers for all entries; all of it is uploaded when they moved.
static enum hg_status reserve_buffers(struct hg_page_cache *c, struct hg_error *err)
{
    const uint64_t bytes = (uint64_t)c->table.count * sizeof *c->table.entries;
    const bool mapped = hg_gpu_get_caps(c->gpu)->mapped && hg_gpu_strategy(c->gpu)->host_reads;
    if (c->table.buffer.size_bytes >= bytes && c->feedback.size_bytes >= 2 * bytes &&
        (mapped || c->readback.size_bytes >= 2 * bytes))
        return HG_OK;
    enum hg_status status = hg_gpu_buffer_reserve(
        c->gpu, HG_GPU_BUFFER_DEVICE, bytes, "page-table", &c->table.buffer, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            c->gpu, HG_GPU_BUFFER_DEVICE, 2 * bytes, "page-feedback", &c->feedback, err);
    if (status == HG_OK && !mapped)
        status = hg_gpu_buffer_reserve(
            c->gpu, HG_GPU_BUFFER_READBACK, 2 * bytes, "page-readback", &c->readback, err);
    if (status == HG_OK && mapped)
        memset(c->feedback.mapped, 0, c->feedback.size_bytes);
    c->table.dirty_first = 0;
    c->table.dirty_end = c->table.count;
    return status;
}

// --- pools ---------------------------------------------------------------------------------------

struct plan {
    uint64_t pages[POOLS]; // of all sets
    uint32_t whole[POOLS]; // layers that hold them all
    uint32_t layers[POOLS];
};

static uint64_t bytes_of(const struct hg_page_cache *c, const uint32_t layers[POOLS])
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < POOLS; i++)
        bytes += layers[i] * hg_pool_layer_bytes(&c->pools[i]);
    return bytes;
}

static uint32_t smaller(uint64_t a, uint64_t b)
{
    const uint64_t least = a < b ? a : b;
    return least > UINT32_MAX ? UINT32_MAX : (uint32_t)least;
}

// The budget is divided by demand; each pool in use gets at least one layer.
static void share_budget(const struct hg_page_cache *c, struct plan *p)
{
    const uint64_t bytes[POOLS] = {
        hg_pool_layer_bytes(&c->pools[POOL_8]), hg_pool_layer_bytes(&c->pools[POOL_HALF])};
    const double need[POOLS] = {(double)p->whole[POOL_8] * (double)bytes[POOL_8],
        (double)p->whole[POOL_HALF] * (double)bytes[POOL_HALF]};
    const double share = need[POOL_HALF] / (need[POOL_8] + need[POOL_HALF]);
    uint32_t half = smaller(
        (uint64_t)((double)c->budget_bytes * share) / bytes[POOL_HALF], p->whole[POOL_HALF]);
    if (half == 0 && p->whole[POOL_HALF] > 0)
        half = 1;
    while (half > 1 && p->whole[POOL_8] > 0 &&
           half * bytes[POOL_HALF] + bytes[POOL_8] > c->budget_bytes)
        half--;
    const uint64_t used = half * bytes[POOL_HALF];
    const uint64_t left = c->budget_bytes > used ? c->budget_bytes - used : 0;
    p->layers[POOL_HALF] = half;
    p->layers[POOL_8] = smaller(left / bytes[POOL_8], p->whole[POOL_8]);
    if (p->layers[POOL_8] == 0 && p->whole[POOL_8] > 0)
        p->layers[POOL_8] = 1; // beyond the budget: the caller says so
}

static enum hg_status make_plan(struct hg_page_cache *c, struct plan *p, struct hg_error *err)
{
    const uint32_t most = hg_gpu_get_caps(c->gpu)->max_image_layers;
    *p = (struct plan){0};
    for (uint32_t i = 0; i < c->set_count; i++)
        if (c->sets[i]->refs > 0)
            p->pages[c->sets[i]->pool] += c->sets[i]->info->layout.pages;
    for (uint32_t i = 0; i < POOLS; i++) {
        const uint64_t slots = p->pages[i] > 0 ? p->pages[i] + NOTHINGS : 0;
        const uint64_t layer = c->pools[i].row * c->pools[i].row;
        p->whole[i] = smaller((slots + layer - 1) / layer, most);
        p->layers[i] = p->whole[i];
    }
    if (bytes_of(c, p->layers) > c->budget_bytes)
        share_budget(c, p);
    const uint64_t bytes = bytes_of(c, p->layers);
    if (bytes > c->budget_bytes)
        return hg_error_set(err, HG_E_LIMIT, "texture budget", NULL,
            "%llu bytes are the least for these textures, the budget is %llu",
            (unsigned long long)bytes, (unsigned long long)c->budget_bytes);
    // Keeps the current size while it fits.
    for (uint32_t i = 0; i < POOLS; i++) {
        uint32_t layers[POOLS] = {p->layers[POOL_8], p->layers[POOL_HALF]};
        layers[i] = c->pools[i].layers;
        if (p->layers[i] > 0 && layers[i] > p->layers[i] && bytes_of(c, layers) <= c->budget_bytes)
            p->layers[i] = layers[i];
    }
    return HG_OK;
}

// Evicts all pages of a pool.
static void empty_pool(struct hg_page_cache *c, uint32_t pool)
{
    struct hg_residency_stats stats;
    hg_residency_stats(c->residency[pool], &stats);
    for (uint32_t slot = 0; slot < stats.slots; slot++)
        hg_residency_remove(c->residency[pool], slot);
    for (uint32_t i = 0; i < c->set_count; i++) {
        struct hg_page_set *set = c->sets[i];
        if (set->pool != pool || set->table == 0)
            continue;
        set->resident = 0;
        set->coarse_count = set->coarse_number = set->coarse_since = 0;
        hg_page_table_clear(c, set);
    }
}

// The slots of one colour, in the first slots of a pool that was rebuilt.
static enum hg_status fill_nothing(struct hg_page_cache *c, uint32_t pool, struct hg_error *err)
{
    static const float colors[NOTHINGS][4] = {[NOTHING_GREY] = {0.5f, 0.5f, 0.5f, 1},
        [NOTHING_NORMAL] = {0.5f, 0.5f, 1, 1},
        [NOTHING_WHITE] = {1, 1, 1, 1}};
    const size_t texels = (size_t)HG_PAGE_PITCH * HG_PAGE_PITCH;
    uint8_t *page = hg_calloc(texels, c->pools[pool].texel_bytes);
    if (page == NULL)
        return out_of_memory(err);
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < NOTHINGS && status == HG_OK; i++) {
        uint32_t slot;
        uint64_t evicted;
        for (size_t k = 0; k < texels * 4; k++) {
            if (pool == POOL_8)
                page[k] = (uint8_t)(colors[i][k & 3] * 255.0f + 0.5f);
            else
                ((uint16_t *)(void *)page)[k] = hg_half_from_float(colors[i][k & 3]);
        }
        status = hg_residency_place(
            c->residency[pool], NOTHING_KEY + i, HG_RESIDENCY_GENTLE, &slot, &evicted);
        if (status == HG_OK) {
            hg_residency_pin(c->residency[pool], slot);
            status = hg_pool_write(&c->pools[pool], slot, page, err);
        }
    }
    hg_free(page);
    return status;
}

static void note_peak(struct hg_page_cache *c, uint64_t extra)
{
    const uint32_t layers[POOLS] = {c->pools[POOL_8].layers, c->pools[POOL_HALF].layers};
    c->stats.pool_bytes = bytes_of(c, layers);
    if (c->stats.pool_bytes + extra > c->stats.peak_bytes)
        c->stats.peak_bytes = c->stats.pool_bytes + extra;
}

static enum hg_status resize_pool(
    struct hg_page_cache *c, uint32_t pool, uint32_t layers, struct hg_error *err)
{
    struct hg_pool *p = &c->pools[pool];
    const uint64_t others = c->stats.pool_bytes - (uint64_t)p->layers * hg_pool_layer_bytes(p);
    const uint64_t both = ((uint64_t)p->layers + layers) * hg_pool_layer_bytes(p);
    const bool keep = layers > p->layers && p->layers > 0 && others + both <= c->budget_bytes;
    const uint64_t old = p->layers * hg_pool_layer_bytes(p);
    if (!keep)
        empty_pool(c, pool);
    enum hg_status status = hg_pool_resize(p, layers, keep, err);
    const bool grown = status == HG_OK;
    if (hg_residency_resize(c->residency[pool], hg_pool_slots(p)) != HG_OK && status == HG_OK)
        status = out_of_memory(err);
    note_peak(c, keep && grown ? old : 0);
    if (status == HG_OK && !keep && layers > 0)
        status = fill_nothing(c, pool, err);
    return status;
}

// Shrinks pools first, to free memory for those that grow.
static enum hg_status resize_pools(
    struct hg_page_cache *c, const struct plan *p, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (int growing = 0; growing < 2; growing++)
        for (uint32_t i = 0; i < POOLS && status == HG_OK; i++)
            if (p->layers[i] != c->pools[i].layers &&
                (p->layers[i] > c->pools[i].layers) == (growing == 1))
                status = resize_pool(c, i, p->layers[i], err);
    return status;
}

static void drop_pool(struct hg_page_cache *c, uint32_t pool, bool small)
{
    struct hg_pool *p = &c->pools[pool];
    const uint32_t texel_bytes = p->texel_bytes;
    empty_pool(c, pool);
    hg_pool_finish(p);
    hg_pool_init(p, c->gpu, texel_bytes, small);
    if (hg_residency_resize(c->residency[pool], 0) != HG_OK)
        hg_debug(TEXTURE, "slots stay reserved"); // fewer slots take no memory
    note_peak(c, 0);
}

static void drop_pools(struct hg_page_cache *c)
{
    for (uint32_t i = 0; i < POOLS; i++)
        drop_pool(c, i, hg_pool_is_small(&c->pools[i]));
}

// Large layers hold more pages per byte; small ones leave room for the other pool.
static enum hg_status choose_layers(struct hg_page_cache *c, struct hg_error *err)
{
    bool uses[POOLS] = {false};
    for (uint32_t i = 0; i < c->set_count; i++)
        uses[c->sets[i]->pool] |= c->sets[i]->refs > 0;
    const uint64_t large = (uint64_t)HG_POOL_SIDE * HG_POOL_SIDE * 4;
    const uint64_t half = uses[POOL_HALF] ? hg_pool_layer_bytes(&c->pools[POOL_HALF]) : 0;
    const bool small = uses[POOL_8] && large + half > c->budget_bytes;
    enum hg_status status = HG_OK;
    if (small == hg_pool_is_small(&c->pools[POOL_8]) || !uses[POOL_8])
        return HG_OK;
    if (c->pools[POOL_8].layers > 0)
        status = resize_pool(c, POOL_8, 0, err); // waits for what was recorded
    if (status == HG_OK)
        drop_pool(c, POOL_8, small);
    return status;
}

enum hg_status hg_page_cache_fit(struct hg_page_cache *c, struct hg_error *err)
{
    struct plan plan;
    hg_page_cache_sweep(c);
    enum hg_status status = choose_layers(c, err);
    if (status == HG_OK)
        status = make_plan(c, &plan, err);
    if (status != HG_OK)
        return status;
    while (c->set_count > 0 && c->sets[0]->table == 0)
        if (place_table(c) != HG_OK)
            return out_of_memory(err);
    status = reserve_buffers(c, err);
    if (status == HG_OK)
        status = resize_pools(c, &plan, err);
    if (status != HG_OK) // a pool may be half made: all are rebuilt
        drop_pools(c);
    return status;
}

bool hg_page_cache_is_complete(const struct hg_page_cache *c)
{
    for (uint32_t i = 0; i < c->set_count; i++)
        if (c->sets[i]->refs > 0 && !c->sets[i]->failed &&
            c->sets[i]->resident < c->sets[i]->info->layout.pages)
            return false;
    return true;
}

struct hg_gpu_image *hg_page_cache_pool(struct hg_page_cache *c, uint32_t pool)
{
    struct hg_pool *p = &c->pools[pool == HG_POOL_FLOAT ? POOL_HALF : POOL_8];
    if (p->layers == 0)
        return NULL;
    return pool == HG_POOL_SRGB ? &p->srgb : &p->image;
}

void hg_page_cache_stats(const struct hg_page_cache *c, struct hg_page_cache_stats *out)
{
    *out = c->stats;
    out->budget_bytes = c->params.budget_bytes;
    out->table_bytes = (uint64_t)c->table.count * sizeof *c->table.entries;
    out->failed = c->failures;
    for (uint32_t i = 0; i < c->set_count; i++)
        out->sets += c->sets[i]->refs > 0 && !c->sets[i]->failed;
    for (uint32_t i = 0; i < POOLS; i++) {
        struct hg_residency_stats r;
        hg_residency_stats(c->residency[i], &r);
        out->slots += r.slots;
        out->resident += r.resident;
        out->evicted += r.evicted;
        out->requested += r.requests;
    }
}
