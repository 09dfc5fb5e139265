#include "renderer/image/zstd.h"

#include <zstd.h>

#include "base/alloc.h"

enum hg_status hg_zstd_encode(
    const void *data, size_t size, int level, struct hg_writer *out, struct hg_error *err)
{
    if (level < 1 || level > 19)
        return hg_error_set(err, HG_E_INVAL, "zstd", "level", "%d is not in 1..19", level);
    size_t capacity = ZSTD_compressBound(size);
    void *bytes = ZSTD_isError(capacity) ? NULL : hg_calloc(capacity, 1);
    if (!bytes)
        return hg_error_set(err, HG_E_NOMEM, "zstd", NULL, "no memory for %zu bytes", size);
    size_t written = ZSTD_compress(bytes, capacity, data, size, level);
    bool failed = ZSTD_isError(written);
    if (!failed)
        hg_write_bytes(out, bytes, written);
    hg_free(bytes);
    if (failed || out->failed)
        return hg_error_set(err, HG_E_NOMEM, "zstd", NULL, "no room for the frame");
    return HG_OK;
}

enum hg_status hg_zstd_decode(
    const void *data, size_t data_size, void *dst, size_t size, struct hg_error *err)
{
    unsigned long long content = ZSTD_getFrameContentSize(data, data_size);
    if (content != size || ZSTD_findFrameCompressedSize(data, data_size) != data_size)
        return hg_error_set(
            err, HG_E_FORMAT, "zstd", "byte 0", "not one frame of %zu content bytes", size);
    size_t done = ZSTD_decompress(dst, size, data, data_size);
    if (ZSTD_isError(done) || done != size)
        return hg_error_set(err, HG_E_FORMAT, "zstd", NULL, "%s",
            ZSTD_isError(done) ? ZSTD_getErrorName(done) : "the frame is short");
    return HG_OK;
}
