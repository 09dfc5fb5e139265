// gpu_array.c - device arrays that are written where they differ. See gpu_array.h.
#include <string.h>

#include "base/alloc.h"
#include "renderer/mesh/gpu_array.h"

#define STEP 1024 // bytes compared and written at once

void hg_gpu_array_finish(struct hg_gpu *gpu, struct hg_gpu_array *table)
{
    hg_gpu_buffer_destroy(gpu, &table->buffer);
    hg_free(table->shadow);
    table->shadow = NULL;
    table->capacity = 0;
    table->size_bytes = 0;
}

static enum hg_status write_differences(struct hg_gpu *gpu, struct hg_gpu_array *table,
    const uint8_t *data, uint64_t size, uint64_t *written, struct hg_error *err)
{
    for (uint64_t at = 0; at < size;) {
        uint64_t end = at;
        while (end < size) { // a run of steps that differ
            const uint64_t n = size - end < STEP ? size - end : STEP;
            if (end + n <= table->size_bytes && memcmp(table->shadow + end, data + end, n) == 0)
                break;
            end += n;
        }
        if (end == at) {
            at += STEP;
            continue;
        }
        const enum hg_status status =
            hg_gpu_buffer_upload(gpu, &table->buffer, at, data + at, end - at, err);
        if (status != HG_OK)
            return status;
        memcpy(table->shadow + at, data + at, end - at);
        *written += end - at;
        at = end;
    }
    return HG_OK;
}

enum hg_status hg_gpu_array_write(struct hg_gpu *gpu, struct hg_gpu_array *table, const void *data,
    uint64_t size_bytes, uint64_t *written, struct hg_error *err)
{
    if (size_bytes == 0) {
        table->size_bytes = 0;
        return HG_OK;
    }
    const uint64_t before = table->buffer.size_bytes;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_DEVICE, size_bytes, table->name, &table->buffer, err);
    if (table->buffer.size_bytes != before)
        table->size_bytes = 0;
    if (status == HG_OK && hg_grow(&table->shadow, &table->capacity, size_bytes, 1) != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, table->name, NULL, "no memory");
    if (status == HG_OK)
        status = write_differences(gpu, table, data, size_bytes, written, err);
    table->size_bytes = status == HG_OK ? size_bytes : 0;
    return status;
}
