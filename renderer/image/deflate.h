// deflate.h - zlib streams (RFC 1950), through libdeflate.
// Floor 1. Thread-safe; no state.
#ifndef HG_RENDERER_IMAGE_DEFLATE_H
#define HG_RENDERER_IMAGE_DEFLATE_H

#include "base/bytes.h"
#include "base/status.h"

// Appends `size` bytes, compressed; level 1 (fast) to 12. HG_E_NOMEM.
enum hg_status hg_deflate_encode(const uint8_t *data, size_t size, int level, struct hg_writer *out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
