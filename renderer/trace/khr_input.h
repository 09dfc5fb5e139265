// khr_input.h - what goes into one acceleration structure of the device. Private to the room.
// Floor 2 (trace). Thread: the render thread.
#ifndef HG_RENDERER_TRACE_KHR_INPUT_H
#define HG_RENDERER_TRACE_KHR_INPUT_H

#include "renderer/gpu/gpu.h"
#include "renderer/trace/ray_geometry.h"

struct hg_khr_input { // zeroed = empty; hg_khr_input_finish when it is built
    VkAccelerationStructureGeometryKHR *geometries;
    VkAccelerationStructureBuildRangeInfoKHR *ranges;
    uint32_t *counts; // of primitives
    size_t geometry_capacity, range_capacity, count_capacity;
    uint32_t count;
    struct hg_gpu_buffer *indices; // [index_count] in place of those of pieces
    size_t index_capacity;
    uint32_t index_count;
};

void hg_khr_input_finish(struct hg_gpu *gpu, struct hg_khr_input *input);
// Appends a piece; triangles that are none become points where the host sees them. transform:
// address of a row-major 3 x 4 matrix; 0 = none. HG_E_NOMEM, device errors.
enum hg_status hg_khr_input_add(struct hg_gpu *gpu, struct hg_khr_input *input,
    const struct hg_ray_geometry_piece *piece, VkDeviceAddress transform,
    struct hg_error *err) HG_MUST_CHECK;
// 4 columns of 3 to rows.
void hg_khr_rows(const float columns[12], VkTransformMatrixKHR *out);

#endif
