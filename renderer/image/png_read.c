// png_read.c - PNG by libpng: see rows.h. libpng reports errors by longjmp: what may do so is
// called by functions without state of their own, below `guarded`.
#include <png.h>
#include <setjmp.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/rows.h"

struct png_input {
    struct hg_rows_input base;
    size_t at; // in bytes
    png_structp png;
    png_infop info;
    uint32_t next_row;
    uint8_t *row;   // one, as stored
    uint8_t *whole; // all rows of an interlaced picture, once they are asked for
    bool interlaced;
    bool started;     // the decoder has its rows
    bool failed;      // nothing more comes of it
    char reason[256]; // of libpng's last error
};

// ---- libpng ------------------------------------------------------------------------------------

static _Noreturn void on_error(png_structp png, png_const_charp text)
{
    struct png_input *in = png_get_error_ptr(png);
    snprintf(in->reason, sizeof in->reason, "libpng: %s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text;
}

static void on_read(png_structp png, png_bytep data, size_t size)
{
    struct png_input *in = png_get_io_ptr(png);
    if (in->base.file) {
        if (fread(data, 1, size, in->base.file) != size)
            png_error(png, "the file ends too early");
    } else {
        if (size > in->base.bytes.size - in->at)
            png_error(png, "the file ends too early");
        memcpy(data, (const uint8_t *)in->base.bytes.data + in->at, size);
        in->at += size;
    }
}

typedef void png_work(struct png_input *in, void *argument);

static enum hg_status guarded(
    struct png_input *in, png_work *work, void *argument, struct hg_error *err)
{
    in->failed = true;
    if (setjmp(png_jmpbuf(in->png)))
        return hg_error_set(err, HG_E_FORMAT, in->base.name, NULL, "%s", in->reason);
    work(in, argument);
    in->failed = false;
    return HG_OK;
}

// ---- opening -----------------------------------------------------------------------------------

static void read_header(struct png_input *in, void *unused)
{
    (void)unused;
    png_structp png = in->png;
    png_set_read_fn(png, in, on_read);
    png_set_user_limits(png, PNG_UINT_31_MAX, PNG_UINT_31_MAX); // callers check sizes
    png_read_info(png, in->info);
    in->interlaced = png_get_interlace_type(png, in->info) != PNG_INTERLACE_NONE;
    if (png_get_color_type(png, in->info) == PNG_COLOR_TYPE_PALETTE)
        png_set_palette_to_rgb(png);
    if (png_get_bit_depth(png, in->info) < 8)
        png_set_expand_gray_1_2_4_to_8(png);
    if (png_get_valid(png, in->info, PNG_INFO_tRNS))
        png_set_tRNS_to_alpha(png);
    if (png_get_bit_depth(png, in->info) == 16)
        png_set_swap(png); // samples in the order of this machine
    if (in->interlaced)
        png_set_interlace_handling(png);
}

// Of what is decoded. libpng says so only once it has its rows: two, which it fills, as wide as the
// header claims.
static int decoded_channels(struct png_input *in)
{
    const int type = png_get_color_type(in->png, in->info);
    const int colors = (type & PNG_COLOR_MASK_COLOR) ? 3 : 1; // a palette has colors
    const bool alpha =
        (type & PNG_COLOR_MASK_ALPHA) || png_get_valid(in->png, in->info, PNG_INFO_tRNS);
    return colors + alpha;
}

static void describe(struct png_input *in)
{
    struct hg_oiio_header *h = &in->base.header;
    const int channels = decoded_channels(in);
    h->width = (int)png_get_image_width(in->png, in->info);
    h->height = (int)png_get_image_height(in->png, in->info);
    h->channels = channels;
    h->alpha_channel = channels == 2 || channels == 4 ? channels - 1 : -1;
    h->is_16bit = png_get_bit_depth(in->png, in->info) == 16;
    h->straight_alpha = true;
    h->pixel_bytes = (uint64_t)channels * (h->is_16bit ? 2 : 1);
    h->row_bytes = h->pixel_bytes * (uint64_t)h->width;
    h->image_bytes = h->row_bytes * (uint64_t)h->height;
}

static void end_decoder(struct png_input *in)
{
    if (in->png)
        png_destroy_read_struct(&in->png, &in->info, NULL);
    in->png = NULL;
    in->info = NULL;
}

// From the first byte on.
static enum hg_status begin(struct png_input *in, struct hg_error *err)
{
    end_decoder(in);
    in->at = 0;
    in->next_row = 0;
    in->started = false;
    in->failed = true;
    snprintf(in->reason, sizeof in->reason, "it cannot be read from its beginning again");
    if (in->base.file && fseeko(in->base.file, 0, SEEK_SET) != 0)
        return hg_error_set(err, HG_E_IO, in->base.name, NULL, "cannot read it from its beginning");
    in->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, in, on_error, on_warning);
    in->info = in->png ? png_create_info_struct(in->png) : NULL;
    if (!in->info)
        return hg_error_set(err, HG_E_NOMEM, in->base.name, NULL, "no memory to decode or encode");
    return guarded(in, read_header, NULL, err);
}

static enum hg_status begin_first(struct hg_rows_input *base, struct hg_error *err)
{
    struct png_input *in = (struct png_input *)base;
    const enum hg_status status = begin(in, err);
    if (status)
        return status;
    describe(in);
    return HG_OK;
}

// ---- pixels ------------------------------------------------------------------------------------

// When pixels are asked for, and callers have checked the size.
static void start_rows(struct png_input *in)
{
    png_read_update_info(in->png, in->info);
    if (png_get_rowbytes(in->png, in->info) != in->base.header.row_bytes)
        png_error(in->png, "rows of another size than the header says");
    in->started = true;
}

static void read_row(struct png_input *in, void *row)
{
    if (!in->started)
        start_rows(in);
    png_read_row(in->png, row, NULL);
}

static void read_whole(struct png_input *in, void *unused)
{
    (void)unused;
    start_rows(in);
    for (int pass = 0; pass < PNG_INTERLACE_ADAM7_PASSES; pass++)
        for (int y = 0; y < in->base.header.height; y++)
            png_read_row(in->png, in->whole + (size_t)y * in->base.header.row_bytes, NULL);
}

// The row y as stored, in in->row or in->whole.
static enum hg_status decode_row(
    struct png_input *in, uint32_t y, const uint8_t **row, struct hg_error *err)
{
    const size_t row_bytes = (size_t)in->base.header.row_bytes;
    enum hg_status status = HG_OK;
    if (in->interlaced) {
        *row = in->whole + (size_t)y * row_bytes;
        return HG_OK;
    }
    if (y < in->next_row)
        status = begin(in, err);
    for (; !status && in->next_row <= y; in->next_row++)
        status = guarded(in, read_row, in->row, err);
    *row = in->row;
    return status;
}

static enum hg_status prepare(struct png_input *in, struct hg_error *err)
{
    if (in->interlaced ? in->whole != NULL : in->row != NULL)
        return HG_OK;
    const uint64_t bytes = in->interlaced ? in->base.header.image_bytes : in->base.header.row_bytes;
    enum hg_status status =
        in->interlaced ? hg_rows_check_size(&in->base.header, in->base.name, err) : HG_OK;
    if (status)
        return status;
    uint8_t *memory = hg_calloc((size_t)bytes, 1);
    if (!memory)
        return hg_error_set(err, HG_E_NOMEM, in->base.name, NULL, "no memory to decode or encode");
    if (!in->interlaced) {
        in->row = memory;
        return HG_OK;
    }
    in->whole = memory;
    status = guarded(in, read_whole, NULL, err);
    if (status) {
        hg_free(in->whole);
        in->whole = NULL;
    }
    return status;
}

static enum hg_status read_rows(struct hg_rows_input *base, uint32_t y, uint32_t count,
    const struct hg_oiio_target *to, struct hg_error *err)
{
    struct png_input *in = (struct png_input *)base;
    const size_t stride = hg_rows_pixel_bytes(&base->header, to) * (size_t)base->header.width;
    uint8_t *dst = to->pixels;
    if (in->failed)
        return hg_error_set(err, HG_E_FORMAT, in->base.name, NULL, "%s", in->reason);
    enum hg_status status = prepare(in, err);
    for (uint32_t i = 0; i < count && !status; i++, dst += stride) {
        const uint8_t *row;
        status = decode_row(in, y + i, &row, err);
        if (!status)
            hg_rows_convert(&base->header, row, to, dst);
    }
    return status;
}

static void read_text(
    const struct hg_rows_input *base, const char *key, char *text, size_t size_bytes)
{
    const struct png_input *in = (const struct png_input *)base;
    png_textp texts = NULL;
    const int count = in->png ? png_get_text(in->png, in->info, &texts, NULL) : 0;
    snprintf(text, size_bytes, "%s", "");
    for (int i = 0; i < count; i++)
        if (strcmp(texts[i].key, key) == 0 && texts[i].text)
            snprintf(text, size_bytes, "%s", texts[i].text);
}

static void close_input(struct hg_rows_input *base)
{
    struct png_input *in = (struct png_input *)base;
    end_decoder(in);
    hg_free(in->row);
    hg_free(in->whole);
}

enum hg_status hg_png_open(FILE *file, const struct hg_image_bytes *bytes, bool large,
    struct hg_rows_input **out, struct hg_error *err)
{
    static const struct hg_rows_functions functions = {
        sizeof(struct png_input), begin_first, read_rows, read_text, close_input};
    return hg_rows_open(&functions, file, bytes, large, out, err);
}
