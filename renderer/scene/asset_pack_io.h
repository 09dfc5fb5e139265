// asset_pack_io.h - numbers, texts, arrays and references of packed assets, each written and read
// by one function; of asset_pack.c and asset_pack_mesh.c. Those that read check; those that write
// have a sound asset.
#ifndef HG_RENDERER_SCENE_ASSET_PACK_IO_H
#define HG_RENDERER_SCENE_ASSET_PACK_IO_H

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/checked.h"
#include "base/spill.h"
#include "base/utf8.h"
#include "renderer/scene/asset.h"

#define NONE UINT32_MAX

enum { MOST_TEXT = 4096 };

struct family; // of a node that is read

struct hg_pack {
    struct hg_writer *out; // NULL: reading
    struct hg_reader in;
    struct hg_asset *asset;
    uint64_t left_bytes;   // of memory, reading
    enum hg_status status; // the first failure, reading
    const char *wrong;
    struct family *families; // [node_count], reading
};

static inline bool reads(const struct hg_pack *p)
{
    return p->out == NULL;
}

static inline void fail(struct hg_pack *p, enum hg_status status, const char *wrong)
{
    if (!p->status) {
        p->status = status;
        p->wrong = wrong;
    }
    p->in.failed = true;
}

static inline void require(struct hg_pack *p, bool holds, const char *wrong)
{
    if (reads(p) && !holds && !p->in.failed)
        fail(p, HG_E_FORMAT, wrong);
}

static inline bool goes_on(const struct hg_pack *p)
{
    return !p->in.failed;
}

// ---- numbers and texts -------------------------------------------------------------------------

static inline void pack_u32(struct hg_pack *p, uint32_t *v)
{
    if (reads(p))
        *v = hg_read_u32(&p->in);
    else
        hg_write_u32(p->out, *v);
}

static inline uint32_t pack_choice(struct hg_pack *p, uint32_t value, uint32_t count)
{
    pack_u32(p, &value);
    require(p, value < count, "a choice");
    return goes_on(p) ? value : 0;
}

static inline bool pack_bool(struct hg_pack *p, bool value)
{
    return pack_choice(p, value, 2) != 0;
}

static inline void pack_f64(struct hg_pack *p, double *v)
{
    if (reads(p))
        *v = hg_read_f64(&p->in);
    else
        hg_write_f64(p->out, *v);
    require(p, isfinite(*v), "a number");
}

static inline bool in_range(const float *v, uint64_t count, float low, float high)
{
    bool ok = true;
    for (uint64_t i = 0; i < count; i++)
        ok &= v[i] >= low && v[i] <= high; // false for what is not a number
    return ok;
}

static inline void pack_floats(struct hg_pack *p, float *v, uint32_t count, float low, float high)
{
    const uint8_t *bytes = reads(p) ? hg_read_bytes(&p->in, count * sizeof *v) : NULL;
    if (bytes)
        memcpy(v, bytes, count * sizeof *v);
    else if (!reads(p))
        hg_write_bytes(p->out, v, count * sizeof *v);
    require(p, in_range(v, count, low, high), "a number");
}

// What is taken is charged; *memory is NULL after a failure.
static inline void *take(struct hg_pack *p, uint64_t count, size_t size)
{
    uint64_t bytes;
    void *memory = NULL;
    if (!goes_on(p))
        return NULL;
    if (!hg_mul_u64(count, size, &bytes) || bytes > p->left_bytes)
        fail(p, HG_E_LIMIT, "the asset passes the memory limit");
    else if (!(memory = hg_spill_calloc((size_t)count, size)))
        fail(p, HG_E_NOMEM, "no memory");
    else
        p->left_bytes -= bytes;
    return memory;
}

static inline void pack_bytes(struct hg_pack *p, void **memory, uint64_t count, size_t size)
{
    if (!reads(p)) {
        hg_write_bytes(p->out, *memory, (size_t)count * size);
        return;
    }
    const size_t left = p->in.size - p->in.pos;
    require(p, count <= left / size, "a length");
    void *to = take(p, count, size);
    if (!to)
        return;
    memcpy(to, hg_read_bytes(&p->in, (size_t)count * size), (size_t)count * size);
    *memory = to;
}

static inline void pack_vertices(
    struct hg_pack *p, float **values, uint64_t count, uint32_t width, float low, float high)
{
    void *memory = *values;
    pack_bytes(p, &memory, count * width, sizeof(float));
    *values = memory;
    require(p, !goes_on(p) || in_range(*values, count * width, low, high), "a vertex");
}

// Each element takes at least `least_bytes` in the stream, and sizeof_each in memory.
static inline void pack_count(
    struct hg_pack *p, uint32_t *count, size_t least_bytes, size_t sizeof_each)
{
    pack_u32(p, count);
    require(p, *count <= (p->in.size - p->in.pos) / least_bytes, "a count");
    if (reads(p) && goes_on(p) && (uint64_t)*count * sizeof_each > p->left_bytes)
        fail(p, HG_E_LIMIT, "the asset passes the memory limit");
    if (!goes_on(p))
        *count = 0;
    else if (reads(p))
        p->left_bytes -= (uint64_t)*count * sizeof_each;
}

static inline void pack_text(struct hg_pack *p, char **text)
{
    uint32_t size = reads(p) ? 0 : (uint32_t)strlen(*text);
    pack_u32(p, &size);
    if (!reads(p)) {
        hg_write_bytes(p->out, *text, size);
        return;
    }
    require(p, size <= MOST_TEXT, "a text");
    const char *bytes = goes_on(p) ? (const char *)hg_read_bytes(&p->in, size) : NULL;
    require(p, bytes && !memchr(bytes, 0, size), "a text");
    if (!goes_on(p))
        return;
    hg_free(*text);
    *text = hg_strndup(bytes, size);
    if (!*text)
        fail(p, HG_E_NOMEM, "no memory");
}

static inline void pack_name(struct hg_pack *p, char **name)
{
    pack_text(p, name);
    require(p, !goes_on(p) || hg_utf8_is_valid(*name, strlen(*name)), "a name");
}

static inline void pack_fixed(struct hg_pack *p, char *text, size_t size)
{
    char *copy = reads(p) ? NULL : text;
    pack_text(p, &copy);
    if (!reads(p))
        return;
    require(p, copy && strlen(copy) < size, "a text");
    if (goes_on(p)) {
        memcpy(text, copy, strlen(copy) + 1);
        hg_utf8_clean(text);
    }
    hg_free(copy);
}

// An object by its index in `items`.
static inline void *pack_reference(
    struct hg_pack *p, void *object, void *const *items, uint32_t count)
{
    uint32_t index = object ? (uint32_t)((struct hg_object *)object)->id : NONE;
    pack_u32(p, &index);
    require(p, index == NONE || index < count, "a reference");
    return goes_on(p) && index != NONE ? items[index] : NULL;
}
#define REFERENCE(p, object, array, count) pack_reference(p, object, (void *const *)(array), count)

void hg_asset_pack_mesh(struct hg_pack *pack, struct hg_mesh *mesh); // asset_pack_mesh.c

#endif
