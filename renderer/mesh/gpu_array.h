// gpu_array.h - an array on the device, of which only what differs is written.
// Floor 2 (mesh). Thread: the render thread.
#ifndef HG_RENDERER_MESH_GPU_ARRAY_H
#define HG_RENDERER_MESH_GPU_ARRAY_H

#include "renderer/gpu/gpu.h"

struct hg_gpu_array {
    const char *name;
    struct hg_gpu_buffer buffer;
    uint8_t *shadow; // what the device has
    size_t capacity; // bytes of shadow
    uint64_t size_bytes;
};
void hg_gpu_array_finish(struct hg_gpu *gpu, struct hg_gpu_array *table);
// Adds the bytes written to *written. On failure the table is empty, so that all is written next.
enum hg_status hg_gpu_array_write(struct hg_gpu *gpu, struct hg_gpu_array *table, const void *data,
    uint64_t size_bytes, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;

#endif
