// triangle_cache.h - what shading reads of triangles on CPU devices
// (shaders/shared/triangle_cache.h). Floor 2 (geometry). Private to the room. Thread: the render
// thread. See geometry.h.
#ifndef HG_RENDERER_GEOMETRY_TRIANGLE_CACHE_H
#define HG_RENDERER_GEOMETRY_TRIANGLE_CACHE_H

#include "renderer/mesh/gpu_array.h"

struct hg_triangle_cache {
    struct hg_gpu_buffer buffer;
    struct hg_gpu_array first;  // [draws]
    uint32_t *firsts;           // what it will hold
    uint64_t *keys, *next_keys; // [draws] what the buffer holds, 0 = nothing; what it will
    struct hg_triangle_cache_job *jobs;
    size_t first_capacity, key_capacity, next_capacity, job_capacity;
    uint32_t job_count;
    uint64_t revision; // of the geometry at the last sync
    bool wanted;
};
void hg_triangle_cache_finish(struct hg_gpu *gpu, struct hg_triangle_cache *facets);

#endif
