// textures.h - the textures of one scene: which page sets its materials use, and their records.
// Floor 2 (texture). Thread: the render thread; images are identified on the job pool.
//
// A page set is one image as one mip chain, cut into pages (shaders/shared/texture.h). Sets live in
// a page cache that scenes may share, by content: SHA-256 of the encoded bytes (or of the pixels),
// use and wrap modes. Only images that some material of the scene uses are opened; an image that
// cannot be read is reported once through the log and sampled as white.
#ifndef HG_RENDERER_TEXTURE_TEXTURES_H
#define HG_RENDERER_TEXTURE_TEXTURES_H

#include "base/jobs.h"
#include "renderer/gpu/gpu.h"
#include "renderer/scene/scene.h"
#include "shaders/shared/texture.h"

struct hg_textures;
struct hg_page_cache;

// How a material uses a texture decides its transfer function and how its mips are filtered.
enum hg_texture_use {
    HG_TEXTURE_COLOR,  // sRGB files; box filter in linear light, alpha averaged
    HG_TEXTURE_BLEND,  // the same, colours weighted by alpha (no dark fringes)
    HG_TEXTURE_MASK,   // as BLEND; alpha scaled per mip so that the share of texels that pass the
                       // cutoff stays that of mip 0
    HG_TEXTURE_DATA,   // linear; plain box filter
    HG_TEXTURE_NORMAL, // linear; mips are unit vectors, alpha says what averaging has lost
    HG_TEXTURE_RADIANCE, // numbers as they are stored, always in half floats; plain box filter
};

struct hg_textures_params {
    struct hg_page_cache *cache;   // borrowed; NULL = one of its own, with
    uint64_t budget_bytes;         // of the page pools; 0 = half of the device's memory
    struct hg_image_limits limits; // of decoded images; zero = defaults of image.h
};

struct hg_textures_stats {
    uint64_t budget_bytes, pool_bytes, peak_bytes; // of the page cache: pools now and at most
    uint64_t table_bytes, source_bytes;            // source: texels of all mips, without borders
    uint32_t pages, slots;                         // resident, available (cache)
    uint32_t sets, textures, failed;               // page sets, texture records, unreadable images
    uint32_t missing;                              // pages of the newest frame (cache)
    uint64_t requested, evicted, loaded;           // pages since creation (cache)
    uint64_t bytes_read;                           // of packs and files
    uint64_t decode_ns, upload_ns;                 // since creation (cache)
    uint64_t sharp_ns; // from the first frame with missing pages to the next without (cache)
    float bias;        // mips that moving pictures leave out because the budget is too small
};

// HG_E_NOMEM. `gpu` is borrowed and must outlive it.
enum hg_status hg_textures_create(struct hg_gpu *gpu, const struct hg_textures_params *params,
    struct hg_textures **out, struct hg_error *err) HG_MUST_CHECK;
void hg_textures_destroy(struct hg_textures *textures); // accepts NULL

// Opens what the scene's materials use and lets go of what they no longer use; pages come later
// (page_cache.h). No batch may be open. Cheap when nothing changed. jobs NULL = this thread alone.
// HG_E_LIMIT (budget, naming it), HG_E_NOMEM, device errors: the next sync starts from what is
// there.
enum hg_status hg_textures_sync(struct hg_textures *textures, const struct hg_scene *scene,
    struct hg_jobs *jobs, struct hg_error *err) HG_MUST_CHECK;
// Grows whenever the records of textures changed: materials must be written again.
uint64_t hg_textures_revision(const struct hg_textures *textures);
// True when sync would change something although the scene did not: an image turned out to be
// broken.
bool hg_textures_is_stale(const struct hg_textures *textures);
struct hg_page_cache *hg_textures_cache(struct hg_textures *textures);
// Makes all pages of the cache resident, for tests and benchmarks. HG_E_LIMIT: they do not fit.
enum hg_status hg_textures_load_all(
    struct hg_textures *textures, struct hg_error *err) HG_MUST_CHECK;

// Use of a slot by a material; what sync loaded it for.
enum hg_texture_use hg_texture_slot_use(
    const struct hg_material *material, enum hg_texture_slot slot);
// Index of the texture's record for that use, HG_TEXTURE_NONE when it has none (no image, broken,
// or not synced). cutoff: of the material for HG_TEXTURE_MASK, else ignored.
uint32_t hg_textures_find(const struct hg_textures *textures, const struct hg_texture *texture,
    enum hg_texture_use use, float cutoff);
// Record of an index; zeroes for HG_TEXTURE_NONE.
struct hg_gpu_texture hg_textures_record(const struct hg_textures *textures, uint32_t index);

// Record of the image behind the scene (hg_environment.background), zeroes when there is none.
struct hg_gpu_texture hg_textures_background(const struct hg_textures *textures);
// Some material's texture lies in the float pool (HG_FEATURE_FLOAT).
bool hg_textures_has_float(const struct hg_textures *textures);
// Some texture of the scene is wider or higher than 65536 texels (HG_FEATURE_WIDE).
bool hg_textures_has_wide(const struct hg_textures *textures);
// mode: HG_TEXTURES_*; progress, run and mode itself are the caller's.
void hg_textures_fill(
    const struct hg_textures *textures, uint32_t mode, struct hg_gpu_textures *out);
// Images of bindings HG_BIND_PAGES_SRGB, _LINEAR, _FLOAT; NULL while a pool is empty.
struct hg_gpu_image *hg_textures_pool(struct hg_textures *textures, uint32_t pool);
void hg_textures_stats(const struct hg_textures *textures, struct hg_textures_stats *out);

#endif
