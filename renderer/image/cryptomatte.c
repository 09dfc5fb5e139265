#include "renderer/image/cryptomatte.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

// ---- ids ---------------------------------------------------------------------------------------

static uint32_t rotate(uint32_t x, int n)
{
    return x << n | x >> (32 - n);
}

static uint32_t scramble(uint32_t k)
{
    return rotate(k * 0xcc9e2d51u, 15) * 0x1b873593u;
}

uint32_t hg_cryptomatte_hash(const void *name, size_t size)
{
    const uint8_t *p = name;
    uint32_t h = 0, k = 0;
    size_t blocks = size / 4;
    for (size_t i = 0; i < blocks; i++, p += 4) {
        k = (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
        h = rotate(h ^ scramble(k), 13) * 5 + 0xe6546b64u;
    }
    k = 0;
    for (size_t i = size % 4; i > 0; i--)
        k = k << 8 | p[i - 1];
    h ^= scramble(k);
    h ^= (uint32_t)size;
    h = (h ^ h >> 16) * 0x85ebca6bu;
    h = (h ^ h >> 13) * 0xc2b2ae35u;
    return h ^ h >> 16;
}

uint32_t hg_cryptomatte_bits(uint32_t hash)
{
    uint32_t exponent = hash >> 23 & 255;
    return exponent == 0 || exponent == 255 ? hash ^ 1u << 23 : hash;
}

uint32_t hg_cryptomatte_id(const char *name)
{
    return hg_cryptomatte_bits(hg_cryptomatte_hash(name, strlen(name)));
}

void hg_cryptomatte_prefix(const char *layer, char out[24])
{
    char hex[16];
    snprintf(hex, sizeof hex, "%08x", hg_cryptomatte_hash(layer, strlen(layer)));
    snprintf(out, 24, "cryptomatte/%.7s/", hex);
}

// ---- ranks -------------------------------------------------------------------------------------

static int by_id(const void *a, const void *b)
{
    const struct hg_cryptomatte_sample *x = a, *y = b;
    return x->id < y->id ? -1 : x->id > y->id;
}

static int by_weight(const void *a, const void *b)
{
    const struct hg_cryptomatte_sample *x = a, *y = b;
    return x->weight > y->weight ? -1 : x->weight < y->weight ? 1 : by_id(a, b);
}

void hg_cryptomatte_rank(
    struct hg_cryptomatte_sample *samples, uint32_t count, float total, uint32_t ranks, float *out)
{
    uint32_t kept = 0;
    qsort(samples, count, sizeof *samples, by_id);
    for (uint32_t i = 0; i < count; i++) {
        if (samples[i].id == 0 || !(samples[i].weight > 0))
            continue;
        if (kept && samples[kept - 1].id == samples[i].id)
            samples[kept - 1].weight += samples[i].weight;
        else
            samples[kept++] = samples[i];
    }
    qsort(samples, kept, sizeof *samples, by_weight);
    memset(out, 0, ranks * 2 * sizeof *out);
    for (uint32_t i = 0; i < ranks && i < kept && total > 0; i++) {
        memcpy(&out[2 * i], &samples[i].id, sizeof *out);
        out[2 * i + 1] = samples[i].weight / total;
    }
}

// ---- manifest ----------------------------------------------------------------------------------

static int by_name(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

static void write_quoted(struct hg_writer *w, const char *text)
{
    hg_write_u8(w, '"');
    for (const char *c = text; *c; c++) {
        char escaped[8];
        if ((unsigned char)*c < 0x20) {
            snprintf(escaped, sizeof escaped, "\\u%04x", (unsigned)*c);
            hg_write_bytes(w, escaped, 6);
            continue;
        }
        if (*c == '"' || *c == '\\')
            hg_write_u8(w, '\\');
        hg_write_u8(w, (uint8_t)*c);
    }
    hg_write_u8(w, '"');
}

enum hg_status hg_cryptomatte_manifest(const char *const *names, uint32_t count, char **out)
{
    *out = NULL;
    const char **sorted = hg_calloc(count ? count : 1, sizeof *sorted);
    if (!sorted)
        return HG_E_NOMEM;
    if (count)
        memcpy(sorted, names, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_name);
    struct hg_writer w = {.limit_bytes = HG_CRYPTOMATTE_MANIFEST_BYTES};
    hg_write_u8(&w, '{');
    for (uint32_t i = 0; i < count; i++) {
        char hex[16];
        if (i && strcmp(sorted[i], sorted[i - 1]) == 0)
            continue;
        if (i)
            hg_write_u8(&w, ',');
        write_quoted(&w, sorted[i]);
        snprintf(hex, sizeof hex, ":\"%08x\"", hg_cryptomatte_id(sorted[i]));
        hg_write_bytes(&w, hex, 11);
    }
    hg_write_bytes(&w, "}", 2); // terminated
    hg_free(sorted);
    if (w.failed) {
        bool limit = w.size >= HG_CRYPTOMATTE_MANIFEST_BYTES / 2;
        hg_writer_finish(&w);
        return limit ? HG_E_LIMIT : HG_E_NOMEM;
    }
    *out = (char *)w.data;
    return HG_OK;
}
