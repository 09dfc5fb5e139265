// source.h - reading the image behind a texture: identity first, pixels when they are needed.
// Floor 2 (texture). Any thread; borrows the image source for the call.
#ifndef HG_RENDERER_TEXTURE_SOURCE_H
#define HG_RENDERER_TEXTURE_SOURCE_H

#include "base/sha256.h"
#include "renderer/scene/scene.h"

struct hg_source_info {
    uint8_t hash[HG_SHA256_BYTES]; // of the encoded bytes, or of size, format and pixels
    uint32_t width, height;
    bool is_float; // more than 8 bits are kept
};

// Statuses of image.h and base/file.h, HG_E_LIMIT for sides above 65536.
enum hg_status hg_source_identify(const struct hg_image_source *source, struct hg_source_info *out,
    struct hg_error *err) HG_MUST_CHECK;
// RGBA8, or what `pixels` holds, or RGBA32F for float files. *view borrows the pixels of a source
// that has them, else *owned holds them (hg_image_finish in both cases).
enum hg_status hg_source_decode(const struct hg_image_source *source,
    const struct hg_source_info *info, const struct hg_image_limits *limits,
    const struct hg_image **view, struct hg_image *owned, struct hg_error *err) HG_MUST_CHECK;

#endif
