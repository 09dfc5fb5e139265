// zstd.h - one-shot Zstandard for lossless frames (ZSTD_RGBA8).
// Floor 1. Thread-safe; each encoder belongs to one thread. Level 1 unless said otherwise.
#ifndef HG_RENDERER_IMAGE_ZSTD_H
#define HG_RENDERER_IMAGE_ZSTD_H

#include "base/bytes.h"
#include "base/status.h"

// Appends one Zstandard frame holding `size` bytes, with its content size written in the header.
// level 1..19. HG_E_INVAL (level), HG_E_NOMEM (memory, or the writer's limit). The same input and
// level give the same bytes for one version of libzstd.
enum hg_status hg_zstd_encode(const void *data, size_t size, int level, struct hg_writer *out,
    struct hg_error *err) HG_MUST_CHECK;

// Decodes exactly `size` bytes into dst. HG_E_FORMAT: not one frame of that content size.
enum hg_status hg_zstd_decode(
    const void *data, size_t data_size, void *dst, size_t size, struct hg_error *err) HG_MUST_CHECK;

#endif
