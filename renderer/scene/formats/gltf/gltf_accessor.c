#include "renderer/scene/formats/gltf/gltf.h"

#include <string.h>

#include "base/checked.h"

enum { BYTE = 5120, UBYTE, SHORT, USHORT, UINT = 5125, FLOAT };

uint32_t hg_gltf_component_bytes(uint32_t component_type)
{
    switch (component_type) {
    case BYTE:
    case UBYTE:
        return 1;
    case SHORT:
    case USHORT:
        return 2;
    case UINT:
    case FLOAT:
        return 4;
    default:
        return 0;
    }
}

static bool parse_type(const char *type, uint32_t *rows, uint32_t *columns)
{
    static const struct {
        const char *name;
        uint8_t rows, columns;
    } types[] = {{"SCALAR", 1, 1}, {"VEC2", 2, 1}, {"VEC3", 3, 1}, {"VEC4", 4, 1}, {"MAT2", 2, 2},
        {"MAT3", 3, 3}, {"MAT4", 4, 4}};
    for (size_t i = 0; type && i < sizeof types / sizeof *types; i++)
        if (strcmp(type, types[i].name) == 0) {
            *rows = types[i].rows;
            *columns = types[i].columns;
            return true;
        }
    return false;
}

// ---- buffer views ------------------------------------------------------------------------------

static enum hg_status view_load(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_gltf_view *view)
{
    struct hg_gltf_at extensions;
    struct hg_gltf_at meshopt = hg_gltf_extension(at, "EXT_meshopt_compression", &extensions);
    if (meshopt.json)
        return hg_gltf_decode_meshopt(g, &meshopt, view);
    int64_t buffer = hg_gltf_index(at, "buffer");
    if (buffer < 0 || buffer >= g->buffer_count)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no such buffer");
    const struct hg_gltf_buffer *b = &g->buffers[buffer];
    uint64_t offset = hg_gltf_uint(at, "byteOffset", 0);
    uint64_t length = hg_gltf_uint(at, "byteLength", 0);
    if (!b->data)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "buffer %lld has no bytes", (long long)buffer);
    if (!hg_range_ok(offset, length, b->size))
        return hg_gltf_fail(g, at, HG_E_FORMAT,
            "BUFFER_VIEW_TOO_LONG: bytes %llu + %llu do not fit buffer %lld of %llu",
            (unsigned long long)offset, (unsigned long long)length, (long long)buffer,
            (unsigned long long)b->size);
    uint64_t stride = hg_gltf_uint(at, "byteStride", 0);
    if (stride > 252)
        return hg_gltf_fail(g, at, HG_E_FORMAT, "VALUE_NOT_IN_RANGE: byteStride %llu passes 252",
            (unsigned long long)stride);
    view->data = b->data + offset;
    view->size = length;
    view->stride = (uint32_t)stride;
    return HG_OK;
}

enum hg_status hg_gltf_view_get(struct hg_gltf *g, uint64_t index, const struct hg_gltf_view **out)
{
    *out = NULL;
    struct hg_gltf_at list, at = hg_gltf_root_item(g, "bufferViews", (size_t)index, &list);
    if (index >= g->view_count)
        return hg_gltf_fail(g, &list, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no buffer view %llu",
            (unsigned long long)index);
    struct hg_gltf_view *view = &g->views[index];
    if (!view->ready) {
        enum hg_status status = view_load(g, &at, view);
        if (status)
            return status;
        view->ready = true;
    }
    *out = view;
    return HG_OK;
}

// ---- opening -----------------------------------------------------------------------------------

// Finds `count` elements of an accessor (or of a part of a sparse one) in their buffer view.
// *stride: in bytes; replaced by that of the view, if it has one. *data is NULL on failure.
static enum hg_status locate(struct hg_gltf *g, const struct hg_gltf_at *at, uint64_t count,
    uint32_t element_bytes, uint32_t *stride, const uint8_t **data)
{
    const uint64_t offset = hg_gltf_uint(at, "byteOffset", 0);
    *data = NULL;
    const struct hg_gltf_view *view;
    int64_t index = hg_gltf_index(at, "bufferView");
    enum hg_status status = hg_gltf_view_get(g, index < 0 ? UINT32_MAX : (uint64_t)index, &view);
    if (status)
        return status;
    if (view->stride)
        *stride = view->stride;
    if (*stride < element_bytes)
        return hg_gltf_fail(g, at, HG_E_FORMAT,
            "ACCESSOR_SMALL_BYTESTRIDE: byteStride %u is less than an element's %u bytes", *stride,
            element_bytes);
    uint64_t need = count ? (count - 1) * *stride + element_bytes : 0;
    if (!hg_range_ok(offset, need, view->size))
        return hg_gltf_fail(g, at, HG_E_FORMAT,
            "ACCESSOR_TOO_LONG: bytes %llu + %llu do not fit buffer view %lld of %llu",
            (unsigned long long)offset, (unsigned long long)need, (long long)index,
            (unsigned long long)view->size);
    *data = view->data + offset;
    return HG_OK;
}

static uint32_t load_index(const uint8_t *p, uint32_t component_type)
{
    uint32_t v = 0;
    memcpy(
        &v, p, hg_gltf_component_bytes(component_type)); // little endian, as every host we run on
    return v;
}

static enum hg_status open_sparse(
    struct hg_gltf *g, const struct hg_gltf_at *sparse, struct hg_gltf_accessor *a)
{
    uint64_t count = hg_gltf_uint(sparse, "count", 0);
    if (count > a->count)
        return hg_gltf_fail(g, sparse, HG_E_FORMAT,
            "ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE: %llu of %u elements are replaced",
            (unsigned long long)count, a->count);
    struct hg_gltf_at indices = hg_gltf_key(sparse, "indices");
    struct hg_gltf_at values = hg_gltf_key(sparse, "values");
    uint32_t type = (uint32_t)hg_gltf_uint(&indices, "componentType", 0);
    if (type != UBYTE && type != USHORT && type != UINT)
        return hg_gltf_fail(
            g, &indices, HG_E_FORMAT, "VALUE_NOT_IN_LIST: componentType %u of indices", type);
    uint32_t index_bytes = hg_gltf_component_bytes(type), stride = index_bytes;
    enum hg_status status = locate(g, &indices, count, index_bytes, &stride, &a->sparse_indices);
    if (status)
        return status;
    if (stride != index_bytes)
        return hg_gltf_fail(g, &indices, HG_E_FORMAT,
            "BUFFER_VIEW_INVALID_BYTE_STRIDE: sparse indices must be tightly packed");
    stride = a->element_bytes;
    status = locate(g, &values, count, a->element_bytes, &stride, &a->sparse_values);
    if (status)
        return status;
    if (stride != a->element_bytes)
        return hg_gltf_fail(g, &values, HG_E_FORMAT,
            "BUFFER_VIEW_INVALID_BYTE_STRIDE: sparse values must be tightly packed");
    for (uint64_t i = 0; i < count; i++) {
        uint32_t index = load_index(a->sparse_indices + i * index_bytes, type);
        if (index >= a->count)
            return hg_gltf_fail(g, &indices, HG_E_FORMAT,
                "ACCESSOR_INDEX_OOB: sparse index %u of %u elements", index, a->count);
        if (i && index <= load_index(a->sparse_indices + (i - 1) * index_bytes, type))
            return hg_gltf_fail(g, &indices, HG_E_FORMAT,
                "ACCESSOR_SPARSE_INDICES_NON_INCREASING: at %llu", (unsigned long long)i);
    }
    a->sparse_count = (uint32_t)count;
    a->sparse_index_type = type;
    return HG_OK;
}

enum hg_status hg_gltf_accessor_shape(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_gltf_accessor *a)
{
    uint64_t count = hg_gltf_uint(at, "count", 0);
    a->component_type = (uint32_t)hg_gltf_uint(at, "componentType", 0);
    uint32_t bytes = hg_gltf_component_bytes(a->component_type);
    if (!bytes)
        return hg_gltf_fail(
            g, at, HG_E_FORMAT, "VALUE_NOT_IN_LIST: componentType %u", a->component_type);
    if (!parse_type(hg_gltf_string(at, "type"), &a->rows, &a->columns))
        return hg_gltf_fail(g, at, HG_E_FORMAT, "VALUE_NOT_IN_LIST: unknown accessor type");
    if (count > UINT32_MAX - 1)
        return hg_gltf_fail(
            g, at, HG_E_LIMIT, "%llu elements are too many", (unsigned long long)count);
    a->count = (uint32_t)count;
    a->normalized = hg_gltf_bool(at, "normalized", false) && a->component_type != FLOAT;
    a->column_bytes = a->rows * bytes;
    if (a->columns > 1) // columns of matrices begin on 4-byte borders
        a->column_bytes = (a->column_bytes + 3) & ~3u;
    a->element_bytes = a->column_bytes * (a->columns - 1) + a->rows * bytes;
    if (a->columns > 1) // elements, too
        a->stride = a->column_bytes * a->columns;
    else
        a->stride = a->element_bytes;
    return HG_OK;
}

enum hg_status hg_gltf_accessor_open(
    struct hg_gltf *g, uint64_t index, struct hg_gltf_accessor *out)
{
    memset(out, 0, sizeof *out);
    struct hg_gltf_at list, at = hg_gltf_root_item(g, "accessors", (size_t)index, &list);
    if (!at.json)
        return hg_gltf_fail(g, &list, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no accessor %llu",
            (unsigned long long)index);
    struct hg_gltf_accessor a = {0};
    enum hg_status status = hg_gltf_accessor_shape(g, &at, &a);
    if (!status && hg_gltf_index(&at, "bufferView") >= 0)
        status = locate(g, &at, a.count, a.element_bytes, &a.stride, &a.data);
    struct hg_gltf_at sparse = hg_gltf_key(&at, "sparse");
    if (!status && sparse.json)
        status = open_sparse(g, &sparse, &a);
    if (status)
        return status;
    *out = a;
    return HG_OK;
}

// ---- reading -----------------------------------------------------------------------------------

static float load_float(const uint8_t *p, uint32_t type, bool normalized)
{
    switch (type) {
    case BYTE: {
        float v = (float)(int8_t)p[0];
        v = normalized ? v / 127.0f : v;
        return normalized && v < -1 ? -1 : v;
    }
    case UBYTE:
        return normalized ? (float)p[0] / 255.0f : (float)p[0];
    case SHORT: {
        int16_t s;
        memcpy(&s, p, 2);
        float v = normalized ? (float)s / 32767.0f : (float)s;
        return normalized && v < -1 ? -1 : v;
    }
    case USHORT: {
        uint16_t s;
        memcpy(&s, p, 2);
        return normalized ? (float)s / 65535.0f : (float)s;
    }
    case UINT: {
        uint32_t u;
        memcpy(&u, p, 4);
        return normalized ? (float)((double)u / 4294967295.0) : (float)u;
    }
    default: {
        float f;
        memcpy(&f, p, 4);
        return f;
    }
    }
}

static void read_element(
    const struct hg_gltf_accessor *a, const uint8_t *p, uint32_t components, float *out)
{
    uint32_t bytes = hg_gltf_component_bytes(a->component_type);
    uint32_t have = a->rows * a->columns;
    for (uint32_t c = 0; c < components && c < have; c++)
        out[c] = load_float(p + (c / a->rows) * a->column_bytes + (c % a->rows) * bytes,
            a->component_type, a->normalized);
}

static bool is_plain_floats(const struct hg_gltf_accessor *a, uint32_t components)
{
    return a->component_type == FLOAT && a->columns == 1 && a->rows == components;
}

void hg_gltf_read_floats(
    const struct hg_gltf_accessor *a, uint32_t components, float fill, float *out)
{
    bool plain = is_plain_floats(a, components);
    for (uint32_t i = 0; i < a->count; i++) {
        float *element = out + (size_t)i * components;
        if (plain && a->data) {
            memcpy(element, a->data + (size_t)i * a->stride, components * sizeof *out);
            continue;
        }
        for (uint32_t c = 0; c < components; c++)
            element[c] = c < a->rows * a->columns ? 0 : fill;
        if (a->data)
            read_element(a, a->data + (size_t)i * a->stride, components, element);
    }
    for (uint32_t i = 0; i < a->sparse_count; i++) {
        uint32_t bytes = hg_gltf_component_bytes(a->sparse_index_type);
        uint32_t index = load_index(a->sparse_indices + (size_t)i * bytes, a->sparse_index_type);
        read_element(a, a->sparse_values + (size_t)i * a->element_bytes, components,
            out + (size_t)index * components);
    }
}

static void read_uint_element(
    const struct hg_gltf_accessor *a, const uint8_t *p, uint32_t components, uint32_t *out)
{
    uint32_t bytes = hg_gltf_component_bytes(a->component_type);
    for (uint32_t c = 0; c < components && c < a->rows; c++)
        out[c] = load_index(p + c * bytes, a->component_type);
}

void hg_gltf_read_uints(const struct hg_gltf_accessor *a, uint32_t components, uint32_t *out)
{
    memset(out, 0, (size_t)a->count * components * sizeof *out);
    for (uint32_t i = 0; a->data && i < a->count; i++)
        read_uint_element(
            a, a->data + (size_t)i * a->stride, components, out + (size_t)i * components);
    for (uint32_t i = 0; i < a->sparse_count; i++) {
        uint32_t bytes = hg_gltf_component_bytes(a->sparse_index_type);
        uint32_t index = load_index(a->sparse_indices + (size_t)i * bytes, a->sparse_index_type);
        read_uint_element(a, a->sparse_values + (size_t)i * a->element_bytes, components,
            out + (size_t)index * components);
    }
}
