#include "renderer/light/env/env_file.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/reader.h"
#include "renderer/scene/asset.h"

#define SIDE_PX   131072u
#define BAND_ROWS 16u

struct reading {
    struct hg_image_reader *reader;
    const atomic_bool *cancel;
    const char *path;
    uint32_t width, height; // of the file
    struct hg_image *image;
    float *band, *narrow; // [BAND_ROWS][width], [image->width] texels
};

// --- averaging -----------------------------------------------------------------------------------

// Adds the values that some light has, weighted.
static void add(float to[4], const float *from, float weight)
{
    for (int c = 0; c < 4; c++)
        to[c] += from[c] > 0 && from[c] <= 1e12f ? from[c] * weight : 0;
}

// One row, each texel the mean of those it covers, in part at both ends.
static void narrow_row(const struct reading *r, const float *row)
{
    const uint32_t width = r->image->width;
    const double step = (double)r->width / width;
    memset(r->narrow, 0, (size_t)width * 4 * sizeof *r->narrow);
    for (uint32_t x = 0; x < width; x++) {
        const double first = x * step, end = (x + 1) * step;
        for (uint32_t i = (uint32_t)first; i < end && i < r->width; i++) {
            const double part = fmin(i + 1, end) - fmax(i, first);
            add(r->narrow + (size_t)x * 4, row + (size_t)i * 4, (float)(part / step));
        }
    }
}

// Row y of the file goes into the one or two rows of the image that cover it.
static void add_row(const struct reading *r, uint32_t y, const float *row)
{
    struct hg_image *image = r->image;
    const double step = (double)r->height / image->height;
    narrow_row(r, row);
    for (uint32_t to = (uint32_t)(y / step); to < image->height && to * step < y + 1; to++) {
        const double part = fmin(y + 1, (to + 1) * step) - fmax(y, to * step);
        float *out = (float *)image->pixels + (size_t)to * image->width * 4;
        for (uint32_t x = 0; x < image->width && part > 0; x++)
            add(out + (size_t)x * 4, r->narrow + (size_t)x * 4, (float)(part / step));
    }
}

// --- reading -------------------------------------------------------------------------------------

static enum hg_status cancelled(const struct reading *r, struct hg_error *err)
{
    return r->cancel != NULL && atomic_load(r->cancel)
               ? hg_error_set(err, HG_E_CANCELLED, r->path, NULL, "the session ended")
               : HG_OK;
}

static enum hg_status read_rows(const struct reading *r, struct hg_error *err)
{
    const bool whole = r->image->width == r->width && r->image->height == r->height;
    enum hg_status status = HG_OK;
    for (uint32_t y = 0; y < r->height && status == HG_OK; y += BAND_ROWS) {
        const uint32_t rest = r->height - y, count = rest < BAND_ROWS ? rest : BAND_ROWS;
        float *to = whole ? (float *)r->image->pixels + (size_t)y * r->width * 4 : r->band;
        status = cancelled(r, err);
        if (status == HG_OK)
            status = hg_image_reader_rows(r->reader, HG_PIXEL_RGBA32F, count, to, err);
        for (uint32_t i = 0; i < count && status == HG_OK && !whole; i++)
            add_row(r, y + i, r->band + (size_t)i * r->width * 4);
    }
    if (status == HG_OK && !hg_image_reader_is_unchanged(r->reader))
        return hg_error_set(err, HG_E_HASH, r->path, NULL, "the file was changed meanwhile");
    return status;
}

static enum hg_status make_image(
    struct hg_image_reader *reader, struct reading *r, struct hg_error *err)
{
    const struct hg_image_reader_info *info = hg_image_reader_info(reader);
    uint32_t width = info->width, height = info->height;
    while (width > HG_ENVIRONMENT_IMAGE_WIDTH || height > HG_ENVIRONMENT_IMAGE_WIDTH / 2) {
        width = width > 1 ? width / 2 : 1;
        height = height > 1 ? height / 2 : 1;
    }
    r->reader = reader;
    r->width = info->width;
    r->height = info->height;
    enum hg_status status = hg_image_create(width, height, HG_PIXEL_RGBA32F, NULL, r->image);
    if (status == HG_OK && width < info->width) {
        r->band = hg_calloc((size_t)BAND_ROWS * info->width, 4 * sizeof *r->band);
        r->narrow = hg_calloc(width, 4 * sizeof *r->narrow);
    }
    if (status != HG_OK || (width < info->width && (r->band == NULL || r->narrow == NULL)))
        status = hg_error_set(err, HG_E_NOMEM, r->path, NULL, "no memory for an environment");
    if (status == HG_OK)
        status = read_rows(r, err);
    hg_free(r->band);
    hg_free(r->narrow);
    return status;
}

static enum hg_status name_source(
    const char *path, struct hg_environment_file *out, struct hg_error *err)
{
    const char *name = strrchr(path, '/');
    out->source = hg_image_source_create(name != NULL ? name + 1 : path);
    if (out->source != NULL)
        out->source->path = hg_strdup(path);
    if (out->source == NULL || out->source->path == NULL)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for an environment");
    return HG_OK;
}

enum hg_status hg_environment_file_read(const char *path, const atomic_bool *cancel,
    struct hg_environment_file *out, struct hg_error *err)
{
    struct reading r = {.path = path, .cancel = cancel, .image = &out->image};
    struct hg_image_reader *reader;
    *out = (struct hg_environment_file){0};
    enum hg_status status = hg_image_reader_open(path, SIDE_PX, &reader, err);
    if (status != HG_OK)
        return status;
    status = hg_image_reader_hash(reader, out->hash, err);
    if (status == HG_OK)
        status = make_image(reader, &r, err);
    hg_image_reader_close(reader);
    if (status == HG_OK && (uint64_t)r.width * r.height > HG_ENVIRONMENT_PLAIN_TEXELS)
        status = name_source(path, out, err);
    if (status != HG_OK)
        hg_environment_file_finish(out);
    return status;
}

void hg_environment_file_finish(struct hg_environment_file *file)
{
    hg_image_finish(&file->image);
    hg_image_source_unref(file->source);
    *file = (struct hg_environment_file){0};
}

void hg_environment_file_use(struct hg_environment_file *file, struct hg_environment *environment)
{
    hg_image_finish(&environment->image);
    hg_image_source_unref(environment->background.image);
    environment->image = file->image;
    memcpy(environment->image_hash, file->hash, sizeof environment->image_hash);
    environment->background.image = file->source;
    environment->background.wrap_s = HG_WRAP_REPEAT;
    environment->background.wrap_t = HG_WRAP_CLAMP;
    environment->background.head.revision++;
    environment->kind = HG_ENV_IMAGE;
    *file = (struct hg_environment_file){0};
}
