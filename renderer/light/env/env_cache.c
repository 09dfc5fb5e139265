#include "renderer/light/env/env_cache.h"

#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"

#define CACHE_VERSION 4u // raise with every change of the filters or of the layout
#define SKY_VERSION   1u // or of the sky's model

static size_t level_bytes(const struct hg_environment_map *map, uint32_t level)
{
    size_t s = map->face_size >> level;
    return 6 * s * s * 4 * sizeof(uint16_t);
}

static const size_t irradiance_bytes =
    (size_t)HG_ENVIRONMENT_PITCH * HG_ENVIRONMENT_PITCH * sizeof(struct hg_vec4);

static enum hg_status make_key(
    const uint8_t content[32], uint32_t image_width, struct hg_store_key *out)
{
    struct hg_writer w = {0};
    hg_write_bytes(&w, content, 32);
    hg_write_u32(&w, HG_ENVIRONMENT_LEVELS);
    hg_write_u32(&w, HG_IRRADIANCE_SIZE);
    hg_write_u32(&w, image_width);
    hg_write_u32(&w, hg_environment_face_size(image_width));
    enum hg_status status =
        w.failed ? HG_E_NOMEM : hg_store_key("environment", CACHE_VERSION, w.data, w.size, out);
    hg_writer_finish(&w);
    return status;
}

static void *read_block(struct hg_store_entry *entry, uint32_t block, size_t size)
{
    void *data = hg_store_entry_size(entry, block) == size ? hg_calloc(size, 1) : NULL;
    if (data && hg_store_entry_read(entry, block, data, size, NULL)) {
        hg_free(data);
        return NULL;
    }
    return data;
}

static bool read_map(struct hg_store_entry *entry, struct hg_environment_map *map)
{
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++)
        if (!(map->specular[l] = read_block(entry, l, level_bytes(map, l))))
            return false;
    map->irradiance = read_block(entry, HG_ENVIRONMENT_LEVELS, irradiance_bytes);
    return map->irradiance != NULL;
}

bool hg_env_cache_read(struct hg_store *store, const uint8_t key[32], uint32_t image_width,
    struct hg_environment_map *map)
{
    *map = (struct hg_environment_map){0};
    struct hg_store_key name;
    struct hg_store_entry *entry;
    if (make_key(key, image_width, &name) || hg_store_find(store, &name, &entry, NULL))
        return false;
    map->face_size = hg_environment_face_size(image_width);
    bool good = read_map(entry, map);
    if (!good)
        hg_environment_map_finish(map);
    hg_store_entry_close(entry);
    return good;
}

enum hg_status hg_env_cache_write(struct hg_store *store, const uint8_t key[32],
    uint32_t image_width, const struct hg_environment_map *map, struct hg_error *err)
{
    struct hg_store_key name;
    struct hg_store_writer *writer;
    if (make_key(key, image_width, &name))
        return hg_error_set(err, HG_E_NOMEM, "environment cache", NULL, "no memory");
    enum hg_status status = hg_store_begin(store, &name, &writer, err);
    if (status)
        return status;
    hg_store_label(writer, "environment: %u x %u", image_width, image_width / 2);
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS && !status; l++)
        status = hg_store_write(writer, l, map->specular[l], level_bytes(map, l), err);
    if (!status)
        status =
            hg_store_write(writer, HG_ENVIRONMENT_LEVELS, map->irradiance, irradiance_bytes, err);
    if (!status)
        return hg_store_commit(writer, err);
    hg_store_abort(writer);
    return status;
}

// --- skies ---------------------------------------------------------------------------------------

static enum hg_status make_sky_key(
    const uint8_t content[32], uint32_t width, uint32_t height, struct hg_store_key *out)
{
    struct hg_writer w = {0};
    hg_write_bytes(&w, content, 32);
    hg_write_u32(&w, width);
    hg_write_u32(&w, height);
    enum hg_status status =
        w.failed ? HG_E_NOMEM : hg_store_key("sky", SKY_VERSION, w.data, w.size, out);
    hg_writer_finish(&w);
    return status;
}

uint16_t *hg_env_cache_read_sky(
    struct hg_store *store, const uint8_t key[32], uint32_t width, uint32_t height)
{
    struct hg_store_key name;
    struct hg_store_entry *entry;
    if (make_sky_key(key, width, height, &name) || hg_store_find(store, &name, &entry, NULL))
        return NULL;
    uint16_t *texels = read_block(entry, 0, (size_t)width * height * 8);
    hg_store_entry_close(entry);
    return texels;
}

enum hg_status hg_env_cache_write_sky(struct hg_store *store, const uint8_t key[32], uint32_t width,
    uint32_t height, const uint16_t *texels, struct hg_error *err)
{
    struct hg_store_key name;
    struct hg_store_writer *writer;
    if (make_sky_key(key, width, height, &name))
        return hg_error_set(err, HG_E_NOMEM, "sky cache", NULL, "no memory");
    enum hg_status status = hg_store_begin(store, &name, &writer, err);
    if (status)
        return status;
    hg_store_label(writer, "sky: %u x %u", width, height);
    status = hg_store_write(writer, 0, texels, (size_t)width * height * 8, err);
    if (!status)
        return hg_store_commit(writer, err);
    hg_store_abort(writer);
    return status;
}
