// tails.h - the coarsest mips of a material's textures, on the host: their means, and the holes of
// alpha masks. Floor 2, private to renderer/host_shading. Thread: the render thread makes them;
// lookups from any.
#ifndef HG_RENDERER_HOST_SHADING_TAILS_H
#define HG_RENDERER_HOST_SHADING_TAILS_H

#include "renderer/texture/textures.h"

// The mean of a slot's texture, linear: white where there is none, or none that can be read. Waits
// for it to be decoded.
void hg_host_texture_mean(struct hg_textures *textures, const struct hg_material *material,
    enum hg_texture_slot slot, float out[4]);

// The alpha of a masked material's base colour, of the finest mip of at most HG_TAIL_TEXELS a side,
// which covers as much as the finest of all does.
struct hg_host_mask {
    uint32_t width, height;
    enum hg_wrap wrap_s, wrap_t;
    struct hg_texture_ref place; // its uv set and transform
    float cutoff;                // of texels, 0..255: lower ones are holes
    uint8_t texels[];            // [height][width]
};
// NULL: the material has no holes, or none that can be read.
struct hg_host_mask *hg_host_mask_create(
    struct hg_textures *textures, const struct hg_material *material);
bool hg_host_mask_has_hole(const struct hg_host_mask *mask, const float uv[2]);

#endif
