// page_cache.h - the pages that are on the device, for all scenes: pools, page table, residency.
// Floor 2 (texture). Thread: the render thread; pages are read by threads of its own.
//
// A page set is one image seen through one use and wrap modes (a page source), shared by content.
// Its pages are streamed into slots of two pools: RGBA8 (sRGB and linear pages side by side, seen
// through two views of one image) and RGBA16F. The page table has an entry for every page; that of
// a page which is not resident names its finest resident ancestor.
//
// Life of a page: a batch of commands requests it (feedback), hg_page_cache_collect queues it by
// coverage and number of missing mips, a thread reads it, hg_page_cache_update uploads it and
// patches the table between two batches. The least recently used pages are evicted.
//
// Budget: the pools take at most budget_bytes, at every moment; they are made when sets come and
// never grow past it. Outside the budget: table and feedback (12 bytes per page of all sets) and
// HG_PAGE_CACHE_READS pages of host memory for reads under way.
#ifndef HG_RENDERER_TEXTURE_CACHE_PAGE_CACHE_H
#define HG_RENDERER_TEXTURE_CACHE_PAGE_CACHE_H

#include "renderer/gpu/gpu.h"
#include "renderer/texture/source/page_source.h"

#define HG_PAGE_CACHE_READS 64 // most pages that are being read or wait for their upload

struct hg_page_cache;
struct hg_page_set;

struct hg_page_cache_params {
    uint64_t budget_bytes;         // of the pools; 0 = half of the device's memory
    uint64_t host_bytes;           // of decoded images (page_source.h); 0 = its default
    struct hg_store *store;        // of baked pages; NULL = none
    struct hg_image_limits limits; // of decoded images; zero = defaults of image.h
    unsigned threads;              // that read pages; 0 = 2
};

struct hg_page_cache_stats {
    uint64_t budget_bytes, pool_bytes, peak_bytes; // of the pools
    uint64_t table_bytes;
    uint32_t slots, resident, sets, failed;
    uint32_t missing;            // of the newest batch that was collected
    uint64_t requested, evicted; // pages, since creation
    uint64_t pages_loaded, read_ns, upload_ns;
    uint64_t bytes_uploaded;
    uint64_t sharp_ns; // how long the newest batch of frames with missing pages lasted
    float bias;        // mips
};

// HG_E_NOMEM. `gpu` and the store are borrowed.
enum hg_status hg_page_cache_create(struct hg_gpu *gpu, const struct hg_page_cache_params *params,
    struct hg_page_cache **out, struct hg_error *err) HG_MUST_CHECK;
void hg_page_cache_destroy(struct hg_page_cache *cache); // all sets released; accepts NULL

// --- sets ----------------------------------------------------------------------------------------

// Where sources of this cache are opened (any thread may open).
struct hg_page_sources *hg_page_cache_sources(struct hg_page_cache *cache);
// Takes ownership of the source, which was opened for `image` (also on failure); the set keeps a
// reference on the image. Sets of equal content are shared. Pages can be requested after the next
// hg_page_cache_fit. HG_E_NOMEM.
enum hg_status hg_page_cache_acquire(struct hg_page_cache *cache, struct hg_page_source *source,
    struct hg_image_source *image, enum hg_texture_use use, struct hg_page_set **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_page_cache_release(struct hg_page_cache *cache, struct hg_page_set *set);
const struct hg_page_source_info *hg_page_set_info(const struct hg_page_set *set);
uint32_t hg_page_set_table(const struct hg_page_set *set); // first entry
bool hg_page_set_failed(const struct hg_page_set *set);    // cannot be read

// Resizes table and pools for the sets. No batch may be open. When a pool cannot be copied while it
// grows, its pages are dropped and loaded again. HG_E_LIMIT (the budget holds not even
// one layer of each pool in use), HG_E_NOMEM, device errors; then the cache is as before, or empty.
enum hg_status hg_page_cache_fit(struct hg_page_cache *cache, struct hg_error *err) HG_MUST_CHECK;
// Incremented when sets turn out to be broken.
uint64_t hg_page_cache_revision(const struct hg_page_cache *cache);

// --- frames --------------------------------------------------------------------------------------

enum hg_page_mode {
    HG_PAGES_SHOW,  // a moving picture: what is in use stays, the bias rises when it does not fit
    HG_PAGES_EXACT, // a picture to be kept: what the newest batch did not need may go
    HG_PAGES_PREFETCH, // collect only: prefetch, with lower priority than all other requests
};

// Uploads pages that were read, for about upload_ns (UINT64_MAX: all of them), and starts reads of
// the most urgent requests. No batch may be open. Device errors, HG_E_NOMEM.
enum hg_status hg_page_cache_update(struct hg_page_cache *cache, enum hg_page_mode mode,
    uint64_t upload_ns, struct hg_error *err) HG_MUST_CHECK;
// Waits until a page was read or may be read now, or nothing is under way, or the time is over.
void hg_page_cache_wait(struct hg_page_cache *cache, uint64_t timeout_ns);
// Pages that are being read, and images that must be decoded first. After an update, 0 means that
// no further request can be served.
uint32_t hg_page_cache_under_way(const struct hg_page_cache *cache);

// Around the commands of a batch that samples pages.
void hg_page_cache_begin(struct hg_page_cache *cache, struct hg_gpu_cmd *cmd);
void hg_page_cache_end(struct hg_page_cache *cache, struct hg_gpu_cmd *cmd);

// Requests of a batch.
struct hg_page_demand {
    uint32_t missing; // requested pages that were not resident
    bool shadows;     // shadow maps were drawn with coarser texels
    bool fits;        // EXACT: all that its unfinished pixels need fits the pools at once
};
// Reads the feedback of a completed batch: marks uses, queues missing pages, and except for EXACT
// starts reading them at once.
void hg_page_cache_collect(
    struct hg_page_cache *cache, enum hg_page_mode mode, struct hg_page_demand *out);

// True when every page of every set is resident: feedback is not needed.
bool hg_page_cache_is_complete(const struct hg_page_cache *cache);
// Blocks until that is so. HG_E_LIMIT (they do not fit), device errors.
enum hg_status hg_page_cache_load_all(
    struct hg_page_cache *cache, struct hg_error *err) HG_MUST_CHECK;

// table, feedback, pool_scale, lottery, bias (0 in EXACT); the rest is not touched.
void hg_page_cache_fill(
    struct hg_page_cache *cache, enum hg_page_mode mode, struct hg_gpu_textures *out);
// Image of a pool (HG_POOL_*), NULL while it is empty.
struct hg_gpu_image *hg_page_cache_pool(struct hg_page_cache *cache, uint32_t pool);
void hg_page_cache_stats(const struct hg_page_cache *cache, struct hg_page_cache_stats *out);

#endif
