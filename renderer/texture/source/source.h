// source.h - reading the image behind a texture: identity first, pixels when they are needed.
// Floor 2 (texture). Any thread; borrows the image source for the call.
//
// A path with "<UDIM>" names a set of tiles (1001 + column + 10 * row, row 0 at the bottom) that is
// read as one image: a grid of cells as large as the largest tile. Smaller tiles are enlarged by
// repeating texels, missing ones are 0 in all channels.
#ifndef HG_RENDERER_TEXTURE_SOURCE_SOURCE_H
#define HG_RENDERER_TEXTURE_SOURCE_SOURCE_H

#include "base/sha256.h"
#include "renderer/image/reader.h"
#include "renderer/scene/scene.h"
#include "base/store/store.h"

struct hg_source_info {
    uint8_t hash[HG_SHA256_BYTES]; // of the encoded bytes, or of size, format and pixels
    uint32_t width, height;
    bool is_float;                    // more than 8 bits are kept
    bool has_mips;                    // a tiled file whose mips are complete
    uint32_t udim_columns, udim_rows; // of a UDIM set, else 0
    uint8_t stamp[HG_SHA256_BYTES];   // of sizes, times and ids of the files
};

// Statuses of image.h and base/file.h, HG_E_LIMIT for sides above 131072. With a store (may be
// NULL) the hashes of large files are remembered by size, time and id of the file.
enum hg_status hg_source_identify(struct hg_store *store, const struct hg_image_source *source,
    struct hg_source_info *out, struct hg_error *err) HG_MUST_CHECK;
// RGBA8, or what `pixels` holds, or RGBA32F for float files. *view borrows the pixels of a source
// that has them, else *owned holds them (hg_image_finish in both cases).
// HG_E_HASH: the file is not the one that was identified.
enum hg_status hg_source_decode(const struct hg_image_source *source,
    const struct hg_source_info *info, const struct hg_image_limits *limits,
    const struct hg_image **view, struct hg_image *owned, struct hg_error *err) HG_MUST_CHECK;

// --- rows, for images that are not held whole

struct hg_source_rows;

// HG_E_HASH as above.
enum hg_status hg_source_rows_open(const struct hg_image_source *source,
    const struct hg_source_info *info, struct hg_source_rows **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_source_rows_close(struct hg_source_rows *rows); // accepts NULL
enum hg_pixel_format hg_source_rows_format(const struct hg_source_rows *rows);
uint64_t hg_source_rows_bytes(const struct hg_source_rows *rows); // memory it takes
// The next `count` rows from the top, tight.
enum hg_status hg_source_rows_next(
    struct hg_source_rows *rows, uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
// Passes over rows; `pixels` has room for one of them. Cheap where the file allows to find a row.
enum hg_status hg_source_rows_skip(
    struct hg_source_rows *rows, uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
// After the last row: HG_E_HASH when a file was changed meanwhile.
enum hg_status hg_source_rows_check(
    const struct hg_source_rows *rows, struct hg_error *err) HG_MUST_CHECK;

// A tiled file with mips of its own, opened to be read in place. HG_E_HASH as above.
enum hg_status hg_source_open_file(const struct hg_image_source *source,
    const struct hg_source_info *info, struct hg_image_reader **out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
