#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "base/checked.h"

struct hg_gltf_at hg_gltf_key(const struct hg_gltf_at *at, const char *key)
{
    return (struct hg_gltf_at){.json = json_object_get(at->json, key), .up = at, .key = key};
}

struct hg_gltf_at hg_gltf_item(const struct hg_gltf_at *at, size_t index)
{
    return (struct hg_gltf_at){.json = json_array_get(at->json, index), .up = at, .index = index};
}

struct hg_gltf_at hg_gltf_extension(
    const struct hg_gltf_at *at, const char *name, struct hg_gltf_at *extensions)
{
    *extensions = hg_gltf_key(at, "extensions");
    return hg_gltf_key(extensions, name);
}

size_t hg_gltf_count(const struct hg_gltf_at *at)
{
    return json_array_size(at->json);
}

struct hg_gltf_at hg_gltf_root_item(
    const struct hg_gltf *g, const char *name, size_t index, struct hg_gltf_at *up)
{
    *up = hg_gltf_key(&g->root, name);
    return hg_gltf_item(up, index);
}

// Appends a token with ~ and / escaped (RFC 6901); cuts at the end.
static size_t append_token(char *dst, size_t size, size_t pos, const char *token)
{
    for (; *token && pos + 3 < size; token++) {
        if (*token == '~' || *token == '/') {
            dst[pos++] = '~';
            dst[pos++] = *token == '~' ? '0' : '1';
        } else {
            dst[pos++] = *token;
        }
    }
    return pos;
}

static size_t append_pointer(const struct hg_gltf_at *at, char *dst, size_t size)
{
    if (!at->up)
        return 0;
    size_t pos = append_pointer(at->up, dst, size);
    if (pos + 2 >= size)
        return pos;
    dst[pos++] = '/';
    char number[24];
    snprintf(number, sizeof number, "%zu", at->index);
    return append_token(dst, size, pos, at->key ? at->key : number);
}

static void pointer_of(const struct hg_gltf_at *at, char *dst, size_t dst_size)
{
    dst[append_pointer(at, dst, dst_size)] = '\0';
}

enum hg_status hg_gltf_fail(
    struct hg_gltf *g, const struct hg_gltf_at *at, enum hg_status status, const char *fmt, ...)
{
    char where[128], reason[256];
    pointer_of(at, where, sizeof where);
    va_list args;
    va_start(args, fmt);
    vsnprintf(reason, sizeof reason, fmt, args);
    va_end(args);
    return hg_error_set(g->err, status, g->file, where, "%s", reason);
}

void hg_gltf_warn(struct hg_gltf *g, const struct hg_gltf_at *at, const char *fmt, ...)
{
    char where[128], reason[256];
    pointer_of(at, where, sizeof where);
    va_list args;
    va_start(args, fmt);
    vsnprintf(reason, sizeof reason, fmt, args);
    va_end(args);
    hg_asset_warn_text(g->asset, where, reason);
}

static bool value_is_uint(const json_t *value, uint64_t *out)
{
    if (json_is_integer(value) && json_integer_value(value) >= 0) {
        *out = (uint64_t)json_integer_value(value);
        return true;
    }
    double real = json_is_real(value) ? json_real_value(value) : -1;
    if (!(real >= 0 && real <= 9007199254740992.0) || real != floor(real))
        return false;
    *out = (uint64_t)real;
    return true;
}

uint64_t hg_gltf_uint(const struct hg_gltf_at *at, const char *key, uint64_t fallback)
{
    uint64_t value;
    return value_is_uint(json_object_get(at->json, key), &value) ? value : fallback;
}

double hg_gltf_number(const struct hg_gltf_at *at, const char *key, double fallback)
{
    const json_t *value = json_object_get(at->json, key);
    return json_is_number(value) ? json_number_value(value) : fallback;
}

bool hg_gltf_bool(const struct hg_gltf_at *at, const char *key, bool fallback)
{
    const json_t *value = json_object_get(at->json, key);
    return json_is_boolean(value) ? json_is_true(value) : fallback;
}

const char *hg_gltf_string(const struct hg_gltf_at *at, const char *key)
{
    return json_string_value(json_object_get(at->json, key));
}

bool hg_gltf_numbers(const struct hg_gltf_at *at, const char *key, float *out, size_t count)
{
    const json_t *array = json_object_get(at->json, key);
    if (!json_is_array(array))
        return false;
    for (size_t i = 0; i < count && i < json_array_size(array); i++)
        out[i] = (float)json_number_value(json_array_get(array, i));
    return true;
}

int64_t hg_gltf_index(const struct hg_gltf_at *at, const char *key)
{
    uint64_t value;
    if (!value_is_uint(json_object_get(at->json, key), &value) || value > INT32_MAX)
        return -1;
    return (int64_t)value;
}

// A small file may name an array many times: it ends before all of them are there. What is needed
// for a moment only is counted, too.
static bool stays_within(struct hg_gltf *g, const struct hg_gltf_at *at, uint64_t resident)
{
    const uint64_t most = g->params->resident_limit_bytes;
    g->resident_used += resident;
    if (!most || g->resident_used <= most)
        return true;
    (void)hg_gltf_fail(g, at, HG_E_LIMIT,
        "up to here it takes more memory than the %llu MiB it may",
        (unsigned long long)(most >> 20));
    (void)hg_error_limit(g->err, HG_LOAD_LIMIT_RESIDENT, 0);
    return false;
}

void *hg_gltf_alloc(struct hg_gltf *g, const struct hg_gltf_at *at, uint64_t count, size_t size)
{
    uint64_t bytes, total;
    if (!hg_mul_u64(count, size, &bytes) || !hg_add_u64(g->memory_used, bytes, &total) ||
        total > g->memory_limit) {
        (void)hg_gltf_fail(g, at, HG_E_LIMIT,
            "%llu elements of %zu bytes pass the memory limit of %llu bytes",
            (unsigned long long)count, size, (unsigned long long)g->memory_limit);
        return NULL;
    }
    void *memory = hg_spill_calloc((size_t)count, size);
    if (!memory) {
        (void)hg_gltf_fail(
            g, at, HG_E_NOMEM, "no memory for %llu bytes", (unsigned long long)bytes);
        return NULL;
    }
    g->memory_used = total;
    if (stays_within(g, at, hg_alloc_resident_bytes(memory)))
        return memory;
    hg_free(memory);
    return NULL;
}

float hg_gltf_read_extra(struct hg_gltf *g, const struct hg_gltf_at *extras, const char *owner,
    const char *const *names, float most)
{
    for (; *names; names++) {
        const struct hg_gltf_at at = hg_gltf_key(extras, *names);
        const double value = json_number_value(at.json);
        if (!at.json)
            continue;
        if (json_is_number(at.json) && value >= 0 && value <= (double)most)
            return (float)value;
        hg_gltf_warn(g, &at, "VALUE_NOT_IN_RANGE: a %s's %s is a number from 0 to %g", owner,
            *names, (double)most);
    }
    return 0;
}
