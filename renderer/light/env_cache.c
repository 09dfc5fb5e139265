#include "renderer/light/env_cache.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/file.h"
#include "base/log.h"
#include "base/sha256.h"

#define CACHE_MAGIC   0x56454748u // "HGEV"
#define CACHE_VERSION 2u          // raise with every change of the filters or of the layout
#define CACHE_LIMIT   (64u << 20) // a map of the largest face size has 67 MB / 2

char *hg_env_cache_path(const char *cache_dir, const uint8_t key[32])
{
    char hex[HG_SHA256_HEX];
    size_t length = strlen(cache_dir) + HG_SHA256_HEX + 16;
    char *path = hg_calloc(length, 1);
    if (!path)
        return NULL;
    hg_sha256_hex(key, hex);
    snprintf(path, length, "%s/env-%s.bin", cache_dir, hex);
    return path;
}

static size_t level_bytes(const struct hg_environment_map *map, uint32_t level)
{
    size_t s = map->face_size >> level;
    return 6 * s * s * 4 * sizeof(uint16_t);
}

static const size_t irradiance_bytes =
    (size_t)HG_ENVIRONMENT_PITCH * HG_ENVIRONMENT_PITCH * sizeof(struct hg_vec4);

// Fields in front of the arrays. False when they are not those of this key and program.
static bool read_head(
    struct hg_reader *r, const uint8_t key[32], uint32_t image_width, uint32_t *face_size)
{
    bool same = hg_read_u32(r) == CACHE_MAGIC;
    same &= hg_read_u32(r) == CACHE_VERSION;
    same &= hg_read_u32(r) == HG_ENVIRONMENT_LEVELS;
    same &= hg_read_u32(r) == HG_IRRADIANCE_SIZE;
    same &= hg_read_u32(r) == image_width;
    *face_size = hg_read_u32(r);
    const uint8_t *stored = hg_read_bytes(r, 32);
    return same && !r->failed && !memcmp(stored, key, 32) &&
           *face_size == hg_environment_face_size(image_width);
}

static bool read_arrays(struct hg_reader *r, struct hg_environment_map *map)
{
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++) {
        const uint8_t *bytes = hg_read_bytes(r, level_bytes(map, l));
        map->specular[l] = bytes ? hg_calloc(level_bytes(map, l), 1) : NULL;
        if (!map->specular[l])
            return false;
        memcpy(map->specular[l], bytes, level_bytes(map, l));
    }
    const uint8_t *bytes = hg_read_bytes(r, irradiance_bytes);
    map->irradiance = bytes ? hg_calloc(irradiance_bytes, 1) : NULL;
    if (!map->irradiance)
        return false;
    memcpy(map->irradiance, bytes, irradiance_bytes);
    return r->pos == r->size;
}

static bool digest_fits(const uint8_t *data, size_t size)
{
    uint8_t digest[HG_SHA256_BYTES];
    return size > HG_SHA256_BYTES && hg_sha256(data, size - HG_SHA256_BYTES, digest) == HG_OK &&
           !memcmp(digest, data + size - HG_SHA256_BYTES, HG_SHA256_BYTES);
}

bool hg_env_cache_read(const char *cache_dir, const uint8_t key[32], uint32_t image_width,
    struct hg_environment_map *map)
{
    *map = (struct hg_environment_map){0};
    char *path = hg_env_cache_path(cache_dir, key);
    uint8_t *data = NULL;
    size_t size = 0;
    if (!path || hg_file_read(path, CACHE_LIMIT, &data, &size, NULL)) {
        hg_free(path);
        return false;
    }
    bool good = digest_fits(data, size);
    struct hg_reader r = hg_reader_make(data, good ? size - HG_SHA256_BYTES : 0);
    good = good && read_head(&r, key, image_width, &map->face_size) && read_arrays(&r, map);
    if (!good) {
        hg_warn(LIGHT, "%s is damaged or of another version and is made anew", path);
        hg_environment_map_finish(map);
    }
    hg_free(data);
    hg_free(path);
    return good;
}

enum hg_status hg_env_cache_write(const char *cache_dir, const uint8_t key[32],
    uint32_t image_width, const struct hg_environment_map *map, struct hg_error *err)
{
    struct hg_writer w = {0};
    const uint32_t head[] = {CACHE_MAGIC, CACHE_VERSION, HG_ENVIRONMENT_LEVELS, HG_IRRADIANCE_SIZE,
        image_width, map->face_size};
    for (size_t i = 0; i < sizeof head / sizeof head[0]; i++)
        hg_write_u32(&w, head[i]);
    hg_write_bytes(&w, key, 32);
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++)
        hg_write_bytes(&w, map->specular[l], level_bytes(map, l));
    hg_write_bytes(&w, map->irradiance, irradiance_bytes);
    uint8_t digest[HG_SHA256_BYTES];
    char *path = hg_env_cache_path(cache_dir, key);
    enum hg_status status = HG_E_NOMEM;
    if (path && !w.failed && hg_sha256(w.data, w.size, digest) == HG_OK) {
        hg_write_bytes(&w, digest, sizeof digest);
        status = w.failed ? HG_E_NOMEM : hg_file_write_atomic(path, w.data, w.size, err);
    }
    if (status == HG_E_NOMEM)
        hg_error_set(err, status, "environment cache", NULL, "no memory");
    hg_writer_finish(&w);
    hg_free(path);
    return status;
}
