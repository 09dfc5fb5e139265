// scene_memory.h - small glTF files put together in memory: accessors from C arrays, the bytes in
// a data: URI, loaded through the ordinary loader.
#ifndef HG_TESTS_SCENE_MEMORY_H
#define HG_TESTS_SCENE_MEMORY_H

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/scene/load.h"
#include "tests/support/check.h"

enum { MEMORY_BYTES = 1 << 16, MEMORY_TEXT = 1 << 14, MEMORY_JSON = 1 << 18 };

// Component types by their glTF numbers.
enum { BYTE = 5120, UBYTE, SHORT, USHORT, UINT = 5125, FLOAT };

struct memory_gltf { // zeroed = empty
    uint8_t bytes[MEMORY_BYTES];
    size_t size;
    char views[MEMORY_TEXT], accessors[MEMORY_TEXT];
    uint32_t view_count, accessor_count;
    char json[MEMORY_JSON];
};

static inline void memory_append(char *text, size_t capacity, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));
static inline void memory_append(char *text, size_t capacity, const char *fmt, ...)
{
    size_t n = strlen(text);
    va_list args;
    va_start(args, fmt);
    int k = vsnprintf(text + n, capacity - n, fmt, args);
    va_end(args);
    if (k < 0 || (size_t)k >= capacity - n)
        abort();
}

// Copies bytes to the next 4-byte border; returns their offset.
static inline size_t memory_bytes(struct memory_gltf *m, const void *data, size_t bytes)
{
    size_t at = (m->size + 3) & ~(size_t)3;
    if (at + bytes > sizeof m->bytes)
        abort();
    memcpy(m->bytes + at, data, bytes);
    m->size = at + bytes;
    return at;
}

// A view of these bytes; stride 0 = none is written. Returns its index.
static inline uint32_t memory_view(
    struct memory_gltf *m, const void *data, size_t bytes, uint32_t stride)
{
    size_t at = memory_bytes(m, data, bytes);
    memory_append(m->views, sizeof m->views,
        "%s{\"buffer\":0,\"byteOffset\":%zu,\"byteLength\":%zu", m->view_count ? "," : "", at,
        bytes);
    if (stride)
        memory_append(m->views, sizeof m->views, ",\"byteStride\":%u", stride);
    memory_append(m->views, sizeof m->views, "}");
    return m->view_count++;
}

// An accessor on a view (-1 = none); `more` is "" or further keys that begin with a comma.
static inline uint32_t memory_accessor(struct memory_gltf *m, int view, int component,
    const char *type, uint32_t count, const char *more)
{
    memory_append(m->accessors, sizeof m->accessors,
        "%s{\"componentType\":%d,\"type\":\"%s\",\"count\":%u", m->accessor_count ? "," : "",
        component, type, count);
    if (view >= 0)
        memory_append(m->accessors, sizeof m->accessors, ",\"bufferView\":%d", view);
    memory_append(m->accessors, sizeof m->accessors, "%s}", more);
    return m->accessor_count++;
}

// A tight accessor of floats with its own view.
static inline uint32_t memory_floats(
    struct memory_gltf *m, const char *type, uint32_t count, const float *values, size_t bytes)
{
    uint32_t view = memory_view(m, values, bytes, 0);
    return memory_accessor(m, (int)view, FLOAT, type, count, "");
}

static inline void memory_base64(const uint8_t *in, size_t size, char *out)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        uint32_t v = (uint32_t)in[i] << 16 | (i + 1 < size ? (uint32_t)in[i + 1] << 8 : 0) |
                     (i + 2 < size ? in[i + 2] : 0);
        for (int k = 0; k < 4; k++)
            *out++ = i + (size_t)k > size ? '=' : digits[v >> (18 - 6 * k) & 63];
    }
    *out = '\0';
}

// The only file there is: the JSON text.
static inline enum hg_status memory_fetch(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    const struct memory_gltf *m = user;
    *out = NULL;
    size_t n = strlen(m->json);
    if (strcmp(uri, "memory.gltf") != 0 || n > limit_bytes)
        return hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "no such file in memory");
    struct hg_refbuf *buf = hg_refbuf_create(n);
    if (!buf)
        return hg_error_set(err, HG_E_NOMEM, uri, NULL, "no memory");
    memcpy(buf->data, m->json, n);
    *out = buf;
    return HG_OK;
}

// Loads the file that `rest` (its other root keys) completes.
static inline enum hg_status memory_load(
    struct memory_gltf *m, const char *rest, struct hg_asset **out, struct hg_error *err)
{
    m->json[0] = '\0';
    memory_append(m->json, sizeof m->json, "{\"asset\":{\"version\":\"2.0\"}");
    if (m->size) {
        memory_append(m->json, sizeof m->json,
            ",\"buffers\":[{\"byteLength\":%zu,\"uri\":\"data:application/octet-stream;base64,",
            m->size);
        size_t n = strlen(m->json);
        if (n + (m->size + 2) / 3 * 4 + 1 > sizeof m->json)
            abort();
        memory_base64(m->bytes, m->size, m->json + n);
        memory_append(m->json, sizeof m->json, "\"}],\"bufferViews\":[%s]", m->views);
    }
    if (m->accessor_count)
        memory_append(m->json, sizeof m->json, ",\"accessors\":[%s]", m->accessors);
    memory_append(m->json, sizeof m->json, ",%s}", rest);
    memset(err, 0, sizeof *err);
    struct hg_load_params params = {.path = "memory.gltf",
        .fetch = memory_fetch,
        .fetch_user = m,
        .asset_number = 1,
        .scene_index = -1,
        .memory_limit_bytes = 64u << 20};
    return hg_load_asset(&params, out, err);
}

// The same, for files that are right.
static inline struct hg_asset *memory_load_ok(struct memory_gltf *m, const char *rest)
{
    struct hg_asset *asset;
    struct hg_error err;
    test_ok(memory_load(m, rest, &asset, &err), &err);
    return asset;
}

#endif
