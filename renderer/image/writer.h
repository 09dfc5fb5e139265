// writer.h - image files written piece by piece: rows in order, or tiles of mips. For benchmarks
// and tests that need files larger than memory, or such as other programs make.
// Floor 1. A writer belongs to one thread and writes straight to its path.
#ifndef HG_RENDERER_IMAGE_WRITER_H
#define HG_RENDERER_IMAGE_WRITER_H

#include "renderer/image/image.h"

struct hg_image_writer;

struct hg_image_writer_params {
    const char *path;
    const char *format;     // "tiff" (deflate) or "png"
    uint32_t width, height; // of mip 0; mip m has sides max(1, side >> m)
    uint32_t channels;      // 1..4 bytes per pixel
    uint32_t tile_px;       // side of the tiles of a TIFF file; 0: rows
};

#ifdef __cplusplus
extern "C" {
#endif

// HG_E_UNSUPPORTED, HG_E_IO, HG_E_NOMEM; so do the others.
enum hg_status hg_image_writer_begin(const struct hg_image_writer_params *params,
    struct hg_image_writer **out, struct hg_error *err) HG_MUST_CHECK;
// The next `count` rows of mip 0, tight.
enum hg_status hg_image_writer_rows(struct hg_image_writer *writer, uint32_t count,
    const void *pixels, struct hg_error *err) HG_MUST_CHECK;
// A tile of the present mip, tile_px squared, tight; x, y in pixels. Tiles may come in any order.
enum hg_status hg_image_writer_tile(struct hg_image_writer *writer, uint32_t x, uint32_t y,
    const void *pixels, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_image_writer_next_mip(
    struct hg_image_writer *writer, struct hg_error *err) HG_MUST_CHECK;
// Completes the file and destroys the writer.
enum hg_status hg_image_writer_end(
    struct hg_image_writer *writer, struct hg_error *err) HG_MUST_CHECK;
void hg_image_writer_abort(struct hg_image_writer *writer); // accepts NULL; the file stays broken

#ifdef __cplusplus
}
#endif

#endif
