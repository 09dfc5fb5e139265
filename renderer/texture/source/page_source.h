// page_source.h - sources of page texels: files, pixels, tiles made on demand.
// Floor 2 (texture). Thread-safe.
//
// A source is one image seen through one use (transfer, mip filter) and wrap modes. Its pages are
// byte-identical whichever backing they come from:
//   memory   a decoded image with its mips, until the pack is written
//   pack     an entry of the store: compressed pages, baked in the background or ahead of time
//   file     a tiled file with mips of its own, read in place (uses COLOR, DATA and RADIANCE)
//   tiles    made on demand by a callback
// Images too large for memory are baked band by band from the file and can be read afterwards.
//
// Opening reads what identifies the image and decodes nothing. The first read starts loading it on
// the room's own threads and returns HG_E_AGAIN until pages are available.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_SOURCE_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_SOURCE_H

#include "base/sha256.h"
#include "renderer/scene/scene.h"
#include "base/store/store.h"
#include "renderer/texture/source/pages.h"
#include "renderer/texture/textures.h"

struct hg_page_sources; // shared by all sources: store, threads, memory
struct hg_page_source;

struct hg_page_sources_params {
    struct hg_store *store;        // borrowed; NULL: nothing is kept on disk
    uint64_t memory_bytes;         // of decoded images and mips; default 512 MiB. One image at a
                                   // time may be larger, if it is no larger than image_bytes
    uint64_t image_bytes;          // images whose pixels take more are never decoded whole;
                                   // default memory_bytes / 4
    unsigned threads;              // that load and bake; default 1 per core
    uint32_t files;                // read in place that may stay open; default: open_files.h
    struct hg_image_limits limits; // zero fields: 131072 texels a side, 2^34 in all
};

struct hg_page_sources_stats {
    uint32_t sources, loading, baking, failed;    // now; failed: since creation
    uint64_t memory_bytes, memory_peak_bytes;     // decoded images, mips and bands of bakes
    uint64_t bake_texels_done, bake_texels_total; // mip 0, of all bakes since creation; total: and
                                                  // of those that wait in memory for theirs
    uint64_t pages_read, bytes_read; // pages handed out; bytes of packs and files for them
    uint64_t read_ns;                // summed over threads
    // Of files read in place: decoded tiles that are kept (an eighth of memory_bytes at most, and
    // no more than images leave of it), and how often they were there.
    uint64_t tile_bytes, tiles_found, tiles_decoded;
    uint64_t files_open, files_reopened; // of those files: now; since creation
    uint64_t pages_baked, packs_baked, packs_found, pack_bytes, bake_ns;
};

enum hg_status hg_page_sources_create(const struct hg_page_sources_params *params,
    struct hg_page_sources **out, struct hg_error *err) HG_MUST_CHECK;
// Waits for the running step of each thread; unfinished packs are dropped. All sources must be
// closed. Accepts NULL.
void hg_page_sources_destroy(struct hg_page_sources *sources);
void hg_page_sources_stats(struct hg_page_sources *sources, struct hg_page_sources_stats *out);
// Grows whenever pages that were refused with HG_E_AGAIN may be had now, or never will.
uint64_t hg_page_sources_revision(struct hg_page_sources *sources);
// Waits until the revision is no longer `seen`, or the time is over.
void hg_page_sources_wait(struct hg_page_sources *sources, uint64_t seen, uint64_t timeout_ns);

// The process is about to end: for at most `most_ns` images that are in memory are made into packs,
// the smallest first; nothing is loaded any more. Returns early when there is nothing left to do.
void hg_page_sources_linger(struct hg_page_sources *sources, uint64_t most_ns);

// A draw can do nothing but wait (counted): until the matching call with false images
// are loaded at full priority, not behind the threads that draw.
void hg_page_sources_hurry(struct hg_page_sources *sources, bool hurry);

// What to open. `image` is borrowed until the source is closed (sources keep no reference on it,
// except that its refbuf is held). A path with "<UDIM>" stands for all tiles that exist: one grid,
// tile 1001 at the lower left, each cell as large as the largest tile.
struct hg_page_source_params {
    const struct hg_image_source *image;
    enum hg_texture_use use;
    uint8_t cutoff; // 1..255 for HG_TEXTURE_MASK, else 0
    enum hg_wrap wrap_s, wrap_t;
};

struct hg_page_source_info {
    struct hg_page_layout layout;
    uint32_t pool;                       // HG_POOL_*
    uint32_t texel_bytes;                // 4: RGBA8, 8: RGBA16F
    uint32_t udim_columns, udim_rows;    // of a UDIM set, else 0
    uint8_t content_id[HG_SHA256_BYTES]; // equal ids: equal pages in every byte
};

// Statuses of image.h and base/file.h; HG_E_LIMIT for sides above 131072.
enum hg_status hg_page_source_open(struct hg_page_sources *sources,
    const struct hg_page_source_params *params, struct hg_page_source **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_page_source_close(struct hg_page_source *source); // accepts NULL; no read may be running
const struct hg_page_source_info *hg_page_source_info(const struct hg_page_source *source);

// Its pages may be asked for soon: it is loaded when there is nothing more urgent and memory for
// it.
void hg_page_source_prefetch(struct hg_page_source *source);

// One page with its border: HG_PAGE_PITCH^2 texels, as hg_page_take makes them. mip == layout.tail
// (x, y 0) is the tail page, else x, y count pages of that mip. Many threads may read one source.
//
// HG_E_AGAIN: not decoded or baked yet; loading has begun, try again when the revision grows.
// HG_E_INVAL (no such page), HG_E_NOMEM, and what made the image unreadable, now and ever after.
enum hg_status hg_page_source_read(struct hg_page_source *source, uint32_t mip, uint32_t x,
    uint32_t y, void *texels, struct hg_error *err) HG_MUST_CHECK;
// Blocks until pages can be read, or says why they never will.
enum hg_status hg_page_source_wait(
    struct hg_page_source *source, struct hg_error *err) HG_MUST_CHECK;

// While an image that is too large for memory is read for the first time: a coarse version of it,
// made of some of its rows, to be shown in the meantime and never kept. Its pages are those of *mip
// and up. Returns its number, which grows as more rows come, or 0: none (any more).
uint32_t hg_page_source_preview(struct hg_page_source *source, uint32_t *mip);
// As hg_page_source_read. False: there is no such page.
bool hg_page_source_preview_page(
    struct hg_page_source *source, uint32_t mip, uint32_t x, uint32_t y, void *texels);

// What one bake did, for `helio bake`.
struct hg_page_bake {
    uint64_t texels;     // of mip 0
    uint64_t pages;      // in the pack
    uint64_t pack_bytes; // 0: read in place or made on demand, nothing to bake
    uint64_t bake_ns;    // 0: the pack was there
    struct hg_store_key key; // of the pack
};
// Blocks until the pack is written. HG_E_STATE (no store), statuses of store.h and image.h.
enum hg_status hg_page_source_bake(
    struct hg_page_source *source, struct hg_page_bake *out, struct hg_error *err) HG_MUST_CHECK;

#endif
