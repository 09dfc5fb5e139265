// page_image.h - the image behind page sources: one for equal content, however many sources show
// it. Floor 2, private to page_source.c and page_load.c. Fields are guarded by hg_page_sources.lock
// unless they never change.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_IMAGE_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_IMAGE_H

#include <pthread.h>
#include <stdatomic.h>

#include "renderer/texture/source/page_pack.h"
#include "renderer/texture/source/page_source.h"
#include "renderer/texture/source/source.h"
#include "renderer/texture/source/tile_cache.h"

#define HG_PAGE_LOAD_THREADS 16

enum hg_page_backing_kind {
    HG_PAGES_IN_MEMORY,
    HG_PAGES_IN_PACK,
    HG_PAGES_ON_DEMAND, // tiles made by a callback, or files read in place
};

// Where pages come from now. Immutable; the last user frees it.
struct hg_page_backing {
    atomic_uint refs;
    enum hg_page_backing_kind kind;
    struct hg_mips mips;
    uint64_t memory_bytes;
    struct hg_page_pack pack;
    struct hg_page_histograms *histograms; // of `mips`
    const struct hg_image_tiles *tiles;
    struct hg_open_file *file;   // or this
    enum hg_pixel_format format; // what `file` is read as
};

struct hg_page_image {
    struct hg_page_image *next;
    struct hg_page_source *members; // sources that show it
    char name[128];                 // of the first source, for messages
    struct hg_page_chain chain;     // never changes, nor do the next three
    struct hg_source_info info;
    struct hg_page_layout layout;
    uint32_t pool;
    struct hg_page_backing *backing; // NULL: nothing can be read yet
    bool wanted;                     // a reader waits for pages
    bool early;                      // pages may be requested soon
    bool bake_wanted;                // a caller waits for the pack
    bool no_bake;                    // the pack cannot be written (err says why)
    bool busy;                       // a thread works on it
    bool failed;                     // it cannot be read (err)
    atomic_bool cancel;              // cancels the thread's work: no user is left
    struct hg_page_source *borrowed; // whose hg_image_source the thread reads
    unsigned tries;                  // that failed for lack of memory
    uint64_t retry_ns;               // not before this time (another process is baking)
    uint64_t used_ns;                // last read; 0: never
    uint64_t reads;                  // pages that were read
    uint64_t texels_baked;           // of mip 0, by the bake that runs
    struct hg_mips preview;          // from hg_page_preview_mip on; count 0 = none
    uint32_t preview_number;         // grows with each one
    struct hg_page_bake bake;
    struct hg_error err;
};

struct hg_page_source {
    struct hg_page_sources *sources;
    struct hg_page_source *next; // of image->members
    struct hg_page_image *image;
    const struct hg_image_source *origin;
    struct hg_page_source_info info;
    enum hg_wrap wrap_s, wrap_t;
    uint8_t cutoff;
    bool has_alpha; // `alpha` is filled
    uint8_t (*alpha)[256];
};

struct hg_page_sources {
    struct hg_page_sources_params params;
    pthread_mutex_t lock;
    pthread_cond_t work, rush, changed; // signals worker threads; signals their waiters
    unsigned hurry;                     // threads blocked in a wait
    struct hg_page_image *images;
    struct hg_page_scratch **scratches; // free ones
    size_t scratch_capacity, scratch_count;
    uint64_t revision, memory_bytes;
    uint64_t linger_ns; // the process ends: nothing is begun after this; 0: it goes on
    struct hg_page_sources_stats stats;
    struct hg_tile_cache *tiles;
    struct hg_open_files *files;
    struct hg_jobs *jobs; // compresses pages of large images; NULL with one thread
    atomic_bool stop;
    bool warned;
    // The first half runs behind the threads that draw, the second half beside them, but only while
    // those wait.
    unsigned thread_count, started;
    pthread_t threads[2 * HG_PAGE_LOAD_THREADS];
};

// Whether a pack may be made of it, once its pixels are in memory.
static inline bool hg_page_can_bake(
    const struct hg_page_sources *s, const struct hg_page_image *image)
{
    return s->params.store != NULL && !image->no_bake;
}

static inline uint64_t hg_page_image_texels(const struct hg_page_image *image)
{
    return (uint64_t)image->info.width * image->info.height;
}

void *hg_page_load_thread(void *sources);
// The mips of pixels as the image's chain has them. Any thread.
enum hg_status hg_page_chain_mips(const struct hg_page_image *image, const struct hg_image *pixels,
    struct hg_mips *out) HG_MUST_CHECK;
void hg_page_backing_unref(struct hg_page_sources *sources, struct hg_page_backing *backing);
// The lock is held. Wakes all waiters.
void hg_page_sources_changed(struct hg_page_sources *sources, bool pages_appeared);

#endif
