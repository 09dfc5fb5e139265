#include "renderer/image/deflate.h"

#include <libdeflate.h>

#include "base/alloc.h"

enum hg_status hg_deflate_encode(
    const uint8_t *data, size_t size, int level, struct hg_writer *out, struct hg_error *err)
{
    struct libdeflate_compressor *c = libdeflate_alloc_compressor(level);
    const size_t bound = c ? libdeflate_zlib_compress_bound(c, size) : 0;
    uint8_t *bytes = bound ? hg_calloc(bound, 1) : NULL;
    const size_t written = bytes ? libdeflate_zlib_compress(c, data, size, bytes, bound) : 0;
    if (written)
        hg_write_bytes(out, bytes, written);
    hg_free(bytes);
    if (c)
        libdeflate_free_compressor(c);
    return written && !out->failed
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "deflate", NULL, "no memory for %zu bytes", bound);
}
