// khr_input.c - see khr_input.h.
#include "renderer/trace/khr_input.h"

#include <math.h>

#include "base/alloc.h"

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
}

void hg_khr_input_finish(struct hg_gpu *gpu, struct hg_khr_input *in)
{
    for (uint32_t i = 0; i < in->index_count; i++)
        hg_gpu_buffer_destroy(gpu, &in->indices[i]);
    hg_free(in->indices);
    hg_free(in->geometries);
    hg_free(in->ranges);
    hg_free(in->counts);
}

static enum hg_status input_grow(struct hg_khr_input *in)
{
    const size_t n = (size_t)in->count + 1;
    if (hg_grow(&in->geometries, &in->geometry_capacity, n, sizeof *in->geometries) != HG_OK ||
        hg_grow(&in->ranges, &in->range_capacity, n, sizeof *in->ranges) != HG_OK ||
        hg_grow(&in->counts, &in->count_capacity, n, sizeof *in->counts) != HG_OK)
        return HG_E_NOMEM;
    return HG_OK;
}

static bool is_corner(const struct hg_ray_geometry_piece *p, uint32_t index)
{
    const float *v = p->positions + (size_t)index * 3;
    return index < p->vertex_count && fabsf(v[0]) <= 1e18f && fabsf(v[1]) <= 1e18f &&
           fabsf(v[2]) <= 1e18f;
}

static bool is_triangle(const struct hg_ray_geometry_piece *p, uint32_t triangle)
{
    const uint32_t *i = p->indices + (size_t)triangle * 3;
    return is_corner(p, i[0]) && is_corner(p, i[1]) && is_corner(p, i[2]);
}

// Indices of a piece some of whose triangles are none: those become points. *address: where, or
// that of the piece when all are.
static enum hg_status mend_indices(struct hg_gpu *gpu, struct hg_khr_input *in,
    const struct hg_ray_geometry_piece *piece, VkDeviceAddress *address, struct hg_error *err)
{
    uint32_t good = 0, bad = 0;
    *address = piece->indices_address;
    if (piece->positions == NULL || piece->indices == NULL)
        return HG_OK;
    for (uint32_t i = 0; i < piece->triangle_count; i++) {
        if (!is_triangle(piece, i))
            bad++;
        else
            good = piece->indices[(size_t)i * 3];
    }
    if (bad == 0)
        return HG_OK;
    uint32_t *mended = hg_calloc((size_t)piece->triangle_count * 3, sizeof *mended);
    if (mended == NULL || hg_grow(&in->indices, &in->index_capacity, in->index_count + 1,
                              sizeof *in->indices) != HG_OK) {
        hg_free(mended);
        return no_memory(err);
    }
    for (uint32_t i = 0; i < piece->triangle_count; i++)
        for (uint32_t c = 0; c < 3; c++)
            mended[i * 3 + c] = is_triangle(piece, i) ? piece->indices[(size_t)i * 3 + c] : good;
    const uint64_t bytes = piece->triangle_count * 12ull;
    struct hg_gpu_buffer *buffer = &in->indices[in->index_count];
    enum hg_status status =
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_DEVICE, bytes, "indices", buffer, err);
    if (status == HG_OK) {
        in->index_count++;
        *address = buffer->address;
        status = hg_gpu_buffer_upload(gpu, buffer, 0, mended, bytes, err);
    }
    hg_free(mended);
    return status;
}

enum hg_status hg_khr_input_add(struct hg_gpu *gpu, struct hg_khr_input *in,
    const struct hg_ray_geometry_piece *piece, VkDeviceAddress transform, struct hg_error *err)
{
    VkDeviceAddress indices;
    enum hg_status status = input_grow(in) == HG_OK ? HG_OK : no_memory(err);
    if (status == HG_OK)
        status = mend_indices(gpu, in, piece, &indices, err);
    if (status != HG_OK)
        return status;
    in->geometries[in->count] = (VkAccelerationStructureGeometryKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
        .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
        .geometry.triangles =
            {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
                .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                .vertexData.deviceAddress = piece->positions_address,
                .vertexStride = 12,
                .maxVertex = piece->vertex_count > 0 ? piece->vertex_count - 1 : 0,
                .indexType = VK_INDEX_TYPE_UINT32,
                .indexData.deviceAddress = indices,
                .transformData.deviceAddress = transform},
        .flags = VK_GEOMETRY_OPAQUE_BIT_KHR};
    in->ranges[in->count] =
        (VkAccelerationStructureBuildRangeInfoKHR){.primitiveCount = piece->triangle_count};
    in->counts[in->count++] = piece->triangle_count;
    return HG_OK;
}

void hg_khr_rows(const float m[12], VkTransformMatrixKHR *out)
{
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 4; column++)
            out->matrix[row][column] = m[column * 3 + row];
}
