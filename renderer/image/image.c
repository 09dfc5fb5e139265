#include "renderer/image/image.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/file.h"
#include "renderer/image/check.h"
#include "renderer/image/decode.h"
#include "renderer/image/encode.h"
#include "renderer/image/reader.h"

static const struct hg_image_limits default_limits = {
    .max_side_px = 32768,
    .max_pixels = UINT64_C(1) << 28,
    .max_bytes = UINT64_C(1) << 31,
};
static const uint64_t max_file_bytes = UINT64_C(1) << 31;
static const uint64_t max_probe_bytes = UINT64_C(1) << 26; // larger files are not held to be probed

// Magic numbers of the supported formats. Nothing else is tried: a file never selects an unexpected
// parser (video containers, camera raw, vendor formats).
struct magic {
    const char *format; // OpenImageIO's name, or "ktx2", which is read here
    size_t offset, size;
    const char *bytes;
};

static const struct magic magics[] = {
    {"png", 0, 8, "\x89PNG\r\n\x1a\n"},
    {"jpeg", 0, 3, "\xff\xd8\xff"},
    {"webp", 8, 4, "WEBP"},
    {"openexr", 0, 4, "\x76\x2f\x31\x01"},
    {"hdr", 0, 2, "#?"},
    {"tiff", 0, 4, "II*\0"},
    {"tiff", 0, 4, "MM\0*"},
    {"tiff", 0, 4, "II+\0"},
    {"tiff", 0, 4, "MM\0+"},
    {"bmp", 0, 2, "BM"},
    {"gif", 0, 6, "GIF87a"},
    {"gif", 0, 6, "GIF89a"},
    {"psd", 0, 4, "8BPS"},
    {"dds", 0, 4, "DDS "},
    {"jpeg2000", 0, 12, "\0\0\0\x0cjP  \r\n\x87\n"},
    {"jpeg2000", 0, 4, "\xff\x4f\xff\x51"},
    {"ktx2", 0, 12, "\xabKTX 20\xbb\r\n\x1a\n"},
};

size_t hg_pixel_bytes(enum hg_pixel_format format)
{
    switch (format) {
    case HG_PIXEL_RGBA8:
        return 4;
    case HG_PIXEL_RGBA16:
        return 8;
    case HG_PIXEL_RGBA32F:
        return 16;
    }
    return 0;
}

static bool has_extension(const char *name, const char *extension)
{
    const char *dot = strrchr(name, '.');
    return dot && strcasecmp(dot + 1, extension) == 0;
}

// OpenImageIO's reader for these bytes, or NULL.
static const char *find_format(const uint8_t *data, size_t size, const char *name)
{
    for (size_t i = 0; i < sizeof magics / sizeof *magics; i++) {
        const struct magic *m = &magics[i];
        if (size >= m->offset + m->size && memcmp(data + m->offset, m->bytes, m->size) == 0)
            return m->format;
    }
    if (size >= 3 && data[0] == 'P' && data[1] >= '1' && data[1] <= '7')
        return "pnm";
    if (size >= 3 && data[0] == 'P' && (data[1] == 'F' || data[1] == 'f'))
        return "pnm";
    // Targa has no first bytes of its own.
    return size >= 18 && has_extension(name, "tga") ? "targa" : NULL;
}

enum hg_status hg_image_sniff(
    const void *data, size_t size, const char *name, const char **format, struct hg_error *err)
{
    *format = size > 0 ? find_format(data, size, name) : NULL;
    if (*format)
        return HG_OK;
    if (size == 0)
        return hg_error_set(err, HG_E_FORMAT, name, "byte 0", "the image is empty");
    return hg_error_set(err, HG_E_FORMAT, name, "byte 0", "not an image format that is read here");
}

// The reader for these bytes, once they have passed the checks that protect the libraries.
static enum hg_status choose_reader(
    const struct hg_image_bytes *file, const char **format, struct hg_error *err)
{
    enum hg_status st = hg_image_sniff(file->data, file->size, file->name, format, err);
    return st ? st : hg_check_bytes(*format, file->data, file->size, file->name, err);
}

static struct hg_image_limits complete_limits(const struct hg_image_limits *limits)
{
    struct hg_image_limits l = limits ? *limits : default_limits;
    l.max_side_px = l.max_side_px ? l.max_side_px : default_limits.max_side_px;
    l.max_pixels = l.max_pixels ? l.max_pixels : default_limits.max_pixels;
    l.max_bytes = l.max_bytes ? l.max_bytes : default_limits.max_bytes;
    return l;
}

// Takes the properties from a reader, and closes it.
static void probe_reader(struct hg_image_reader *reader, struct hg_image_info *out)
{
    const struct hg_image_reader_info *info = hg_image_reader_info(reader);
    *out = (struct hg_image_info){.width = info->width,
        .height = info->height,
        .channels = info->channels,
        .is_float = info->is_float,
        .is_16bit = info->is_16bit};
    snprintf(out->file_format, sizeof out->file_format, "%s", info->file_format);
    hg_image_reader_close(reader);
}

enum hg_status hg_image_probe_memory(
    const struct hg_image_bytes *file, struct hg_image_info *out, struct hg_error *err)
{
    const char *format;
    memset(out, 0, sizeof *out);
    enum hg_status st = choose_reader(file, &format, err);
    if (st)
        return st;
    if (strcmp(format, "ktx2") != 0)
        return hg_decode_probe(file, format, out, err);
    struct hg_image_reader *reader;
    st = hg_image_reader_open_memory(file, UINT32_MAX, &reader, err);
    if (!st)
        probe_reader(reader, out);
    return st;
}

// A whole file of a format that has only a row reader (KTX2).
static enum hg_status read_rows(const struct hg_image_bytes *file, enum hg_pixel_format format,
    const struct hg_image_limits *l, struct hg_image *out, struct hg_error *err)
{
    struct hg_image_reader *reader;
    enum hg_status st = hg_image_reader_open_memory(file, l->max_side_px, &reader, err);
    if (st)
        return st;
    const struct hg_image_reader_info *info = hg_image_reader_info(reader);
    st = hg_image_create(info->width, info->height, format, l, out);
    if (st)
        hg_error_set(err, st, file->name, "size", "%ux%u px: %s", info->width, info->height,
            hg_status_text(st));
    else
        st = hg_image_reader_rows(reader, format, info->height, out->pixels, err);
    out->has_alpha = info->has_alpha;
    hg_image_reader_close(reader);
    if (st)
        hg_image_finish(out);
    return st;
}

enum hg_status hg_image_read_memory(const struct hg_image_bytes *file, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out, struct hg_error *err)
{
    const char *reader;
    struct hg_image_limits l = complete_limits(limits);
    memset(out, 0, sizeof *out);
    enum hg_status st = choose_reader(file, &reader, err);
    if (st)
        return st;
    bool decoded = false;
    if (strcmp(reader, "ktx2") == 0)
        return read_rows(file, format, &l, out, err);
    if (format == HG_PIXEL_RGBA8 && strcmp(reader, "jpeg") == 0)
        st = hg_jpeg_decode(file, &l, out, &decoded, err);
    return st || decoded ? st : hg_decode_image(file, reader, format, &l, out, err);
}

// A JPEG that is cut short would still be shown; its comments hold "key=value".
static enum hg_status examine_jpeg(const struct hg_image_bytes *file, const char *key,
    struct hg_image_summary *out, struct hg_error *err)
{
    const uint8_t *data = file->data;
    const size_t size = file->size;
    if (size < 4 || data[size - 2] != 0xff || data[size - 1] != 0xd9)
        return hg_error_set(
            err, HG_E_FORMAT, file->name, NULL, "the end of the picture is missing");
    size_t length = strlen(key);
    for (size_t at = 2; at + 4 <= size && data[at] == 0xff && data[at + 1] != 0xda;) {
        size_t segment = (size_t)data[at + 2] << 8 | data[at + 3];
        const uint8_t *text = data + at + 4;
        if (segment < 2 || segment > size - at - 2)
            break;
        if (data[at + 1] == 0xfe && segment - 2 > length && memcmp(text, key, length) == 0 &&
            text[length] == '=')
            snprintf(out->value, sizeof out->value, "%.*s", (int)(segment - 3 - length),
                (const char *)text + length + 1);
        at += 2 + segment;
    }
    return HG_OK;
}

enum hg_status hg_image_examine(const struct hg_image_bytes *file, const char *key,
    const struct hg_image_limits *limits, struct hg_image_summary *out, struct hg_error *err)
{
    const char *format;
    struct hg_image_limits l = complete_limits(limits);
    memset(out, 0, sizeof *out);
    enum hg_status st = choose_reader(file, &format, err);
    if (!st && strcmp(format, "ktx2") == 0)
        st = hg_error_set(err, HG_E_UNSUPPORTED, file->name, NULL, "no file that is written here");
    if (!st)
        st = hg_decode_examine(file, format, key, &l, out, err);
    if (!st && strcmp(format, "jpeg") == 0)
        st = examine_jpeg(file, key, out, err);
    if (st)
        memset(out, 0, sizeof *out);
    return st;
}

// From its head alone.
static enum hg_status probe_large_file(
    const char *path, struct hg_image_info *out, struct hg_error *err)
{
    struct hg_image_reader *reader;
    enum hg_status st = hg_image_reader_open(path, UINT32_MAX, &reader, err);
    if (!st)
        probe_reader(reader, out);
    return st;
}

enum hg_status hg_image_probe_file(
    const char *path, struct hg_image_info *out, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    memset(out, 0, sizeof *out);
    enum hg_status st = hg_file_read(path, max_probe_bytes, &data, &size, err);
    if (st == HG_E_LIMIT) {
        if (err)
            *err = (struct hg_error){0};
        return probe_large_file(path, out, err);
    }
    if (st)
        return st;
    st = hg_image_probe_memory(&(struct hg_image_bytes){data, size, path}, out, err);
    hg_free(data);
    return st;
}

enum hg_status hg_image_read_file(const char *path, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    memset(out, 0, sizeof *out);
    enum hg_status st = hg_file_read(path, max_file_bytes, &data, &size, err);
    if (st)
        return st;
    st = hg_image_read_memory(&(struct hg_image_bytes){data, size, path}, format, limits, out, err);
    hg_free(data);
    return st;
}

static bool within_limits(
    uint32_t width, uint32_t height, const struct hg_image_limits *l, size_t pixel_bytes)
{
    uint64_t pixels = (uint64_t)width * height, bytes;
    return width && height && width <= l->max_side_px && height <= l->max_side_px &&
           pixels <= l->max_pixels && hg_mul_u64(pixels, pixel_bytes, &bytes) &&
           bytes <= l->max_bytes && bytes <= SIZE_MAX;
}

enum hg_status hg_image_create(uint32_t width, uint32_t height, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out)
{
    struct hg_image_limits l = complete_limits(limits);
    size_t pixel_bytes = hg_pixel_bytes(format);
    memset(out, 0, sizeof *out);
    if (!within_limits(width, height, &l, pixel_bytes))
        return HG_E_LIMIT;
    size_t size = (size_t)width * height * pixel_bytes;
    void *pixels = hg_calloc(size, 1);
    if (!pixels)
        return HG_E_NOMEM;
    *out = (struct hg_image){
        .width = width, .height = height, .format = format, .size_bytes = size, .pixels = pixels};
    return HG_OK;
}

void hg_image_finish(struct hg_image *image)
{
    hg_free(image->pixels);
    memset(image, 0, sizeof *image);
}
