// source.c - see source.h: identity and whole images.
#include "renderer/texture/source/source.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "renderer/texture/source/mip_stream.h"
#include "renderer/texture/source/udim.h"

#define FILE_LIMIT_BYTES (1ull << 31)
#define MEMO_BYTES       (4u << 20)           // files of this size are worth remembering
#define MEMO_AGE_NS      UINT64_C(2000000000) // younger files may change within one time stamp
#define MEMO_VERSION     1

static enum hg_status check_size(
    const struct hg_source_info *info, const char *label, struct hg_error *err)
{
    if (info->width == 0 || info->height == 0)
        return hg_error_set(err, HG_E_FORMAT, label, NULL, "the image is empty");
    if (info->width > HG_MIPS_SIDE_PX || info->height > HG_MIPS_SIDE_PX)
        return hg_error_set(err, HG_E_LIMIT, label, NULL, "%u x %u texels, %u are allowed",
            info->width, info->height, HG_MIPS_SIDE_PX);
    return HG_OK;
}

static enum hg_status no_memory(const char *label, struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory to identify it");
}

// --- pixels and tiles ----------------------------------------------------------------------------

static enum hg_status identify_pixels(
    const struct hg_image *image, struct hg_source_info *out, struct hg_error *err)
{
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return no_memory(NULL, err);
    const uint32_t head[3] = {image->width, image->height, (uint32_t)image->format};
    hg_sha256_update(h, head, sizeof head);
    hg_sha256_update(h, image->pixels, image->size_bytes);
    hg_sha256_end(h, out->hash);
    out->width = image->width;
    out->height = image->height;
    out->is_float = image->format != HG_PIXEL_RGBA8;
    return HG_OK;
}

static enum hg_status identify_tiles(
    const struct hg_image_tiles *tiles, struct hg_source_info *out, struct hg_error *err)
{
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return no_memory(NULL, err);
    const uint32_t head[4] = {tiles->width, tiles->height, (uint32_t)tiles->format, UINT32_MAX};
    hg_sha256_update(h, head, sizeof head);
    hg_sha256_update(h, tiles->id, sizeof tiles->id);
    hg_sha256_end(h, out->hash);
    out->width = tiles->width;
    out->height = tiles->height;
    out->is_float = tiles->format != HG_PIXEL_RGBA8;
    return HG_OK;
}

// --- files ---------------------------------------------------------------------------------------

enum hg_status hg_source_stamp(
    const struct hg_image_reader_info *info, uint8_t stamp[HG_SHA256_BYTES])
{
    const uint64_t words[4] = {
        info->file_bytes, info->file_time_ns, info->file_id, info->device_id};
    return hg_sha256(words, sizeof words, stamp);
}

static bool find_memo(struct hg_store *store, const struct hg_store_key *key, uint8_t hash[32])
{
    struct hg_store_entry *entry;
    if (hg_store_find(store, key, &entry, NULL) != HG_OK)
        return false;
    const bool found = hg_store_entry_size(entry, 0) == HG_SHA256_BYTES &&
                       hg_store_entry_read(entry, 0, hash, HG_SHA256_BYTES, NULL) == HG_OK;
    hg_store_entry_close(entry);
    return found;
}

static void keep_memo(struct hg_store *store, const struct hg_store_key *key, const uint8_t *hash)
{
    struct hg_store_writer *writer;
    if (hg_store_begin(store, key, &writer, NULL) != HG_OK)
        return;
    hg_store_label(writer, "hash of a file");
    if (hg_store_write(writer, 0, hash, HG_SHA256_BYTES, NULL) != HG_OK)
        hg_store_abort(writer);
    else if (hg_store_commit(writer, NULL) != HG_OK)
        return; // it is only slower next time
}

enum hg_status hg_source_hash_file(struct hg_store *store, struct hg_image_reader *reader,
    uint8_t hash[HG_SHA256_BYTES], struct hg_error *err)
{
    const struct hg_image_reader_info *info = hg_image_reader_info(reader);
    uint8_t stamp[HG_SHA256_BYTES];
    struct hg_store_key key;
    const bool old = info->file_time_ns + MEMO_AGE_NS < hg_clock_wall_ns();
    const bool memo = store != NULL && old && info->file_bytes >= MEMO_BYTES &&
                      hg_source_stamp(info, stamp) == HG_OK &&
                      hg_store_key("hash", MEMO_VERSION, stamp, sizeof stamp, &key) == HG_OK;
    if (memo && find_memo(store, &key, hash))
        return HG_OK;
    const enum hg_status status = hg_image_reader_hash(reader, hash, err);
    if (status == HG_OK && memo)
        keep_memo(store, &key, hash);
    return status;
}

static enum hg_status describe_reader(struct hg_store *store, struct hg_image_reader *reader,
    struct hg_source_info *out, struct hg_error *err)
{
    const struct hg_image_reader_info *info = hg_image_reader_info(reader);
    out->width = info->width;
    out->height = info->height;
    out->is_float = info->is_float;
    out->has_mips = info->tile_width > 0 && info->mips == hg_mips_count(info->width, info->height);
    if (hg_source_stamp(info, out->stamp) != HG_OK)
        return no_memory(NULL, err);
    return hg_source_hash_file(store, reader, out->hash, err);
}

static enum hg_status open_reader(
    const struct hg_image_source *source, struct hg_image_reader **out, struct hg_error *err)
{
    return source->encoded != NULL
               ? hg_image_reader_open_memory(&(struct hg_image_bytes){source->encoded->data,
                                                 source->encoded->size, source->label},
                     HG_MIPS_SIDE_PX, out, err)
               : hg_image_reader_open(source->path, HG_MIPS_SIDE_PX, out, err);
}

static enum hg_status identify_file(struct hg_store *store, const struct hg_image_source *source,
    struct hg_source_info *out, struct hg_error *err)
{
    struct hg_image_reader *reader;
    enum hg_status status = open_reader(source, &reader, err);
    if (status != HG_OK)
        return status;
    status = describe_reader(store, reader, out, err);
    hg_image_reader_close(reader);
    return status;
}

enum hg_status hg_source_identify(struct hg_store *store, const struct hg_image_source *source,
    struct hg_source_info *out, struct hg_error *err)
{
    memset(out, 0, sizeof *out);
    enum hg_status status;
    if (source->encoded == NULL && source->path != NULL && hg_udim_is_pattern(source->path))
        status = hg_udim_identify(store, source->path, out, err);
    else if (source->encoded != NULL || source->path != NULL)
        status = identify_file(store, source, out, err);
    else if (source->tiles != NULL)
        status = identify_tiles(source->tiles, out, err);
    else if (source->pixels.pixels != NULL)
        status = identify_pixels(&source->pixels, out, err);
    else
        status = hg_error_set(err, HG_E_NOTFOUND, source->label, NULL, "the image has no data");
    if (status == HG_OK)
        status = check_size(out, source->label, err);
    if (status != HG_OK)
        memset(out, 0, sizeof *out);
    return status;
}

// --- whole images --------------------------------------------------------------------------------

static enum hg_status changed(const struct hg_image_source *source, struct hg_error *err)
{
    return hg_error_set(
        err, HG_E_HASH, source->label, NULL, "the file is not the one that was opened");
}

static enum hg_status decode_file(const struct hg_image_source *source,
    const struct hg_source_info *info, const struct hg_image_limits *limits, struct hg_image *owned,
    struct hg_error *err)
{
    uint8_t *data, hash[HG_SHA256_BYTES];
    size_t size;
    enum hg_status status = hg_file_read(source->path, FILE_LIMIT_BYTES, &data, &size, err);
    if (status != HG_OK)
        return status;
    if (hg_sha256(data, size, hash) != HG_OK)
        status = no_memory(source->label, err);
    else if (memcmp(hash, info->hash, sizeof hash) != 0)
        status = changed(source, err);
    else
        status = hg_image_read_memory(&(struct hg_image_bytes){data, size, source->label},
            info->is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8, limits, owned, err);
    hg_free(data);
    return status;
}

// UDIM sets.
static enum hg_status decode_rows(const struct hg_image_source *source,
    const struct hg_source_info *info, const struct hg_image_limits *limits, struct hg_image *owned,
    struct hg_error *err)
{
    struct hg_source_rows *rows;
    enum hg_status status = hg_source_rows_open(source, info, &rows, err);
    if (status != HG_OK)
        return status;
    status = hg_image_create(info->width, info->height, hg_source_rows_format(rows), limits, owned);
    if (status != HG_OK)
        hg_error_set(err, status, source->label, NULL, "%s", hg_status_text(status));
    if (status == HG_OK)
        status = hg_source_rows_next(rows, info->height, owned->pixels, err);
    if (status == HG_OK)
        status = hg_source_rows_check(rows, err);
    hg_source_rows_close(rows);
    if (status != HG_OK)
        hg_image_finish(owned);
    return status;
}

enum hg_status hg_source_decode(const struct hg_image_source *source,
    const struct hg_source_info *info, const struct hg_image_limits *limits,
    const struct hg_image **view, struct hg_image *owned, struct hg_error *err)
{
    memset(owned, 0, sizeof *owned);
    *view = NULL;
    enum hg_status status = HG_OK;
    if (source->encoded != NULL)
        status = hg_image_read_memory(
            &(struct hg_image_bytes){source->encoded->data, source->encoded->size, source->label},
            info->is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8, limits, owned, err);
    else if (source->path != NULL && info->udim_columns > 0)
        status = decode_rows(source, info, limits, owned, err);
    else if (source->path != NULL)
        status = decode_file(source, info, limits, owned, err);
    if (status != HG_OK)
        return status;
    *view = owned->pixels != NULL ? owned : &source->pixels;
    if ((*view)->width == info->width && (*view)->height == info->height)
        return HG_OK;
    *view = NULL;
    hg_image_finish(owned);
    return changed(source, err);
}

enum hg_status hg_source_open_file(const struct hg_image_source *source,
    const struct hg_source_info *info, struct hg_image_reader **out, struct hg_error *err)
{
    uint8_t stamp[HG_SHA256_BYTES];
    enum hg_status status = open_reader(source, out, err);
    if (status != HG_OK)
        return status;
    if (hg_source_stamp(hg_image_reader_info(*out), stamp) != HG_OK)
        status = no_memory(source->label, err);
    else if (memcmp(stamp, info->stamp, sizeof stamp) != 0)
        status = changed(source, err);
    if (status != HG_OK) {
        hg_image_reader_close(*out);
        *out = NULL;
    }
    return status;
}
