// cache_internal.h - what the files of the page cache share. Private to renderer/texture/.
#ifndef HG_RENDERER_TEXTURE_CACHE_CACHE_INTERNAL_H
#define HG_RENDERER_TEXTURE_CACHE_CACHE_INTERNAL_H

#include "renderer/residency/residency.h"
#include "renderer/texture/source/half.h"
#include "renderer/texture/cache/page_cache.h"
#include "renderer/texture/cache/page_reader.h"
#include "renderer/texture/cache/pool.h"

// Pools of texels of one size; each has its slots and its residency.
enum { POOL_8, POOL_HALF, POOLS };

#define HG_PAGE_COARSE_SLOTS 32 // most pages of a preview

// Slots that are never given away, in each pool: what is seen before even the tail is there.
enum { NOTHING_GREY, NOTHING_NORMAL, NOTHING_WHITE, NOTHINGS };

struct hg_page_set {
    struct hg_page_source *source;
    const struct hg_page_source_info *info;
    struct hg_image_source *image; // one reference
    uint32_t refs;
    uint32_t table, entries; // of the page table; table 0: none yet
    uint32_t pool;           // POOL_*
    uint32_t nothing;        // NOTHING_*
    uint32_t resident;       // pages
    uint32_t reads;          // under way
    uint64_t again;          // revision of the sources at which it was not ready; 0 = none
    bool failed;
    // Its preview, shown until it has pages of its own (page_coarse.c).
    uint32_t coarse_mip, coarse_number, coarse_count;
    uint32_t coarse_since; // frame, + 1, in which the first page of its own was there
    uint32_t coarse_slots[HG_PAGE_COARSE_SLOTS];
};

struct page_place {
    uint32_t mip, x, y; // mip == layout.tail: the tail
};

struct hg_page_cache {
    struct hg_gpu *gpu;
    struct hg_page_cache_params params;
    uint64_t budget_bytes;
    struct hg_page_sources *sources;
    struct hg_page_reader *reader;
    struct hg_pool pools[POOLS];
    struct hg_residency *residency[POOLS]; // keys: entries of the table
    struct hg_page_set **sets;             // ordered by table; those without one first
    size_t set_capacity;
    uint32_t set_count;
    struct {               // the page table
        uint32_t *entries; // as on the device
        size_t capacity;
        uint32_t count;
        uint32_t dirty_first, dirty_end; // entries to upload
        struct hg_gpu_buffer buffer;
    } table;
    struct hg_gpu_buffer feedback, readback; // readback: feedback cannot be mapped
    uint32_t failures;
    uint64_t revision;
    uint32_t lottery;
    uint64_t missing_since_ns;
    struct {               // requests for pages of images that were not ready
        bool is_due;       // some may be read now
        uint64_t revision; // of the sources, when they were last tried
        uint32_t waiting;  // how many were not ready then
    } retry;
    struct { // requests of one pool that are put back after its queue was read
        uint64_t *keys;
        size_t capacity;
        uint32_t count;
    } deferred;
    uint32_t pressed, relaxed; // frames in a row in which the pools were too small, or half empty
    uint64_t coarse_revision;  // of the sources, when previews were looked for
    bool refused;              // something in view found no slot since the last collect
    struct hg_page_cache_stats stats;
};

// page_stream.c: the page of this key is no longer there.
void hg_page_cache_forget(struct hg_page_cache *cache, uint64_t key);

// page_coarse.c: previews come, change and go; the slots of one are free again.
enum hg_status hg_page_coarse_update(
    struct hg_page_cache *cache, enum hg_page_mode mode, struct hg_error *err) HG_MUST_CHECK;
void hg_page_coarse_forget(struct hg_page_cache *cache, struct hg_page_set *set);

// page_cache.c: destroys sets that are neither used nor read.
void hg_page_cache_sweep(struct hg_page_cache *cache);

// page_table.c: from entries to pages, and the entries of ancestors and descendants.
struct hg_page_set *hg_page_table_set(const struct hg_page_cache *cache, uint32_t entry);
// False when no page has this entry.
bool hg_page_table_place(const struct hg_page_set *set, uint32_t entry, struct page_place *out);
uint32_t hg_page_table_entry(const struct hg_page_set *set, const struct page_place *place);
// The page one level up (the tail above the last mip); false for the tail. `out` may be `place`.
bool hg_page_table_parent(
    const struct hg_page_set *set, const struct page_place *place, struct page_place *out);
// All entries of a set that has no resident page.
void hg_page_table_clear(struct hg_page_cache *cache, const struct hg_page_set *set);
// The page became resident in `slot`, or left it.
void hg_page_table_add(struct hg_page_cache *cache, const struct hg_page_set *set,
    const struct page_place *place, uint32_t slot);
void hg_page_table_remove(
    struct hg_page_cache *cache, const struct hg_page_set *set, const struct page_place *place);
void hg_page_table_set_entry(struct hg_page_cache *cache, uint32_t entry, uint32_t value);

#endif
