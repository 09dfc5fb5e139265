// textures.h - all textures of a scene as pages in pools, found through one page table.
// Floor 2 (texture). Thread: the render thread; images are decoded and cut on the job pool.
//
// A page set is one image as one mip chain, cut into pages (shaders/shared/texture.h). Sets are
// shared by content: SHA-256 of the encoded bytes (or of the pixels), use and wrap modes. Only
// images that some material of the scene uses are decoded; an image that cannot be read is
// reported once through the log and sampled as white.
//
// All pages are resident. Budget: the bytes of the pools stay <= budget_bytes; while a pool grows,
// its old image lives until the copy is done (stats: peak_bytes). Host memory: one decoded image
// with its mips per thread, at most about 8 bytes per texel of the images decoded at once.
#ifndef HG_RENDERER_TEXTURE_TEXTURES_H
#define HG_RENDERER_TEXTURE_TEXTURES_H

#include "base/jobs.h"
#include "renderer/gpu/gpu.h"
#include "renderer/scene/scene.h"
#include "shaders/shared/texture.h"

struct hg_textures;

// How a material uses a texture decides its transfer function and how its mips are filtered.
enum hg_texture_use {
    HG_TEXTURE_COLOR,  // sRGB files; box filter in linear light, alpha averaged
    HG_TEXTURE_BLEND,  // the same, colours weighted by alpha (no dark fringes)
    HG_TEXTURE_MASK,   // as BLEND; alpha scaled per mip so that the share of texels that pass the
                       // cutoff stays that of mip 0
    HG_TEXTURE_DATA,   // linear; plain box filter
    HG_TEXTURE_NORMAL, // linear; mips are unit vectors
};

struct hg_textures_params {
    uint64_t budget_bytes;         // of the page pools; 0 = unlimited
    struct hg_image_limits limits; // of decoded images; zero = defaults of image.h
};

struct hg_textures_stats {
    uint64_t budget_bytes, pool_bytes, peak_bytes; // peak: old and new images while growing
    uint64_t table_bytes, source_bytes;            // source: texels of all mips, without borders
    uint32_t pages, slots;                         // used, available
    uint32_t sets, textures, failed;               // page sets, texture records, unreadable images
    uint64_t decoded_images;                       // since creation
    uint64_t decode_ns, cut_ns, upload_ns;         // of the newest sync that loaded something
};

// HG_E_NOMEM. `gpu` is borrowed and must outlive it.
enum hg_status hg_textures_create(struct hg_gpu *gpu, const struct hg_textures_params *params,
    struct hg_textures **out, struct hg_error *err) HG_MUST_CHECK;
void hg_textures_destroy(struct hg_textures *textures); // accepts NULL

// Loads what the scene's materials use and frees what they no longer use. No batch may be open: a
// pool that grows is copied by a batch of its own; page uploads run in front of the next batch.
// Cheap when nothing changed. jobs NULL = this thread alone.
// HG_E_LIMIT (budget, naming it; nothing changed), HG_E_NOMEM, device errors.
enum hg_status hg_textures_sync(struct hg_textures *textures, const struct hg_scene *scene,
    struct hg_jobs *jobs, struct hg_error *err) HG_MUST_CHECK;
// Grows whenever the records of textures moved: materials must be written again.
uint64_t hg_textures_revision(const struct hg_textures *textures);

// Use of a slot by a material; what sync loaded it for.
enum hg_texture_use hg_texture_slot_use(
    const struct hg_material *material, enum hg_texture_slot slot);
// Index of the texture's record for that use, HG_TEXTURE_NONE when it has none (no image, broken,
// or not synced). cutoff: of the material for HG_TEXTURE_MASK, else ignored.
uint32_t hg_textures_find(const struct hg_textures *textures, const struct hg_texture *texture,
    enum hg_texture_use use, float cutoff);
// Record of an index; zeroes for HG_TEXTURE_NONE.
struct hg_gpu_texture hg_textures_record(const struct hg_textures *textures, uint32_t index);

void hg_textures_fill(const struct hg_textures *textures, struct hg_gpu_textures *out);
// Images of bindings HG_BIND_PAGES_SRGB, _LINEAR, _FLOAT; NULL while a pool is empty.
struct hg_gpu_image *hg_textures_pool(struct hg_textures *textures, uint32_t pool);
void hg_textures_stats(const struct hg_textures *textures, struct hg_textures_stats *out);

#endif
