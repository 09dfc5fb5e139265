// EXT_meshopt_compression: modes ATTRIBUTES, TRIANGLES, INDICES; filters NONE, OCTAHEDRAL,
// QUATERNION, EXPONENTIAL.
#include <meshoptimizer.h>

#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/scene/formats/gltf/gltf.h"

enum mode { ATTRIBUTES, TRIANGLES, INDICES, MODES };

static enum mode parse_mode(const char *text)
{
    static const char *const names[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
    enum mode m = ATTRIBUTES;
    while (m < MODES && (!text || strcmp(text, names[m]) != 0))
        m++;
    return m;
}

static bool stride_ok(enum mode mode, uint64_t stride, uint64_t count)
{
    if (mode == ATTRIBUTES)
        return stride >= 4 && stride <= 256 && stride % 4 == 0;
    return (stride == 2 || stride == 4) && (mode != TRIANGLES || count % 3 == 0);
}

static bool apply_filter(const char *filter, void *data, size_t count, size_t stride)
{
    if (!filter || strcmp(filter, "NONE") == 0)
        return true;
    if (strcmp(filter, "OCTAHEDRAL") == 0 && (stride == 4 || stride == 8))
        meshopt_decodeFilterOct(data, count, stride);
    else if (strcmp(filter, "QUATERNION") == 0 && stride == 8)
        meshopt_decodeFilterQuat(data, count, stride);
    else if (strcmp(filter, "EXPONENTIAL") == 0 && stride % 4 == 0)
        meshopt_decodeFilterExp(data, count, stride);
    else
        return false;
    return true;
}

static enum hg_status find_source(
    struct hg_gltf *g, const struct hg_gltf_at *at, const uint8_t **data, uint64_t *length)
{
    int64_t index = hg_gltf_index(at, "buffer");
    uint64_t offset = hg_gltf_uint(at, "byteOffset", 0);
    *length = hg_gltf_uint(at, "byteLength", 0);
    if (index < 0 || index >= g->buffer_count || !g->buffers[index].data)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no buffer with bytes");
    if (!hg_range_ok(offset, *length, g->buffers[index].size))
        return hg_gltf_fail(
            g, at, HG_E_FORMAT, "BUFFER_VIEW_TOO_LONG: the compressed bytes pass the buffer");
    *data = g->buffers[index].data + offset;
    return HG_OK;
}

enum hg_status hg_gltf_decode_meshopt(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_gltf_view *view)
{
    const uint8_t *source = NULL;
    uint64_t length = 0, count = hg_gltf_uint(at, "count", 0),
             stride = hg_gltf_uint(at, "byteStride", 0);
    enum mode mode = parse_mode(hg_gltf_string(at, "mode"));
    enum hg_status status = find_source(g, at, &source, &length);
    if (status)
        return status;
    if (mode == MODES || !stride_ok(mode, stride, count) || count > UINT32_MAX)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "mode, count and byteStride do not fit together");
    // Slack: with AVX the filters of the library may touch whole vectors at the end.
    uint8_t *out = hg_gltf_alloc(g, at, count * stride + 64, 1);
    if (!out)
        return g->err->status;
    int rc = mode == ATTRIBUTES  ? meshopt_decodeVertexBuffer(out, count, stride, source, length)
             : mode == TRIANGLES ? meshopt_decodeIndexBuffer(out, count, stride, source, length)
                                 : meshopt_decodeIndexSequence(out, count, stride, source, length);
    bool filtered = rc == 0 && (mode != ATTRIBUTES ||
                                   apply_filter(hg_gltf_string(at, "filter"), out, count, stride));
    if (!filtered) {
        hg_free(out);
        return hg_gltf_fail(g, at, HG_E_FORMAT,
            rc ? "the compressed stream is malformed (%d)" : "unknown filter for this stride (%d)",
            rc);
    }
    view->decoded = out;
    view->data = out;
    view->size = count * stride;
    view->stride = mode == ATTRIBUTES ? (uint32_t)stride : 0;
    return HG_OK;
}
