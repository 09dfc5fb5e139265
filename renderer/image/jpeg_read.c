// jpeg_read.c - rows of JPEG files by libjpeg-turbo: see rows.h. The library reports errors by
// longjmp: what may do so is called by functions without state of their own, below `guarded`.
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include <jpeglib.h>

#include "base/alloc.h"
#include "renderer/image/rows.h"

enum { MAX_SCANS = 500 }; // of a progressive file: each costs a pass over the picture

struct jpeg_input {
    struct hg_rows_input base;
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf jump;
    uint8_t *row;         // one, as stored
    bool begun;           // there is something to destroy
    bool failed;          // nothing more comes of it
    enum hg_status fault; // of the last error
    char reason[JMSG_LENGTH_MAX + 16];
};

// ---- the library -------------------------------------------------------------------------------

static _Noreturn void on_error(j_common_ptr jpeg)
{
    struct jpeg_input *in = jpeg->client_data;
    char text[JMSG_LENGTH_MAX];
    jpeg->err->format_message(jpeg, text);
    in->fault = HG_E_FORMAT;
    snprintf(in->reason, sizeof in->reason, "libjpeg: %s", text);
    longjmp(in->jump, 1);
}

// Warnings are about damage that the library gets over.
static void on_message(j_common_ptr jpeg)
{
    (void)jpeg;
}

static void on_progress(j_common_ptr jpeg)
{
    struct jpeg_input *in = jpeg->client_data;
    if (in->jpeg.input_scan_number <= MAX_SCANS)
        return;
    in->fault = HG_E_LIMIT;
    snprintf(in->reason, sizeof in->reason, "more than %d scans", MAX_SCANS);
    longjmp(in->jump, 1);
}

typedef void jpeg_work(struct jpeg_input *in);

static enum hg_status guarded(struct jpeg_input *in, jpeg_work *work, struct hg_error *err)
{
    in->failed = true;
    if (setjmp(in->jump))
        return hg_error_set(err, in->fault, in->base.name, NULL, "%s", in->reason);
    work(in);
    in->failed = false;
    return HG_OK;
}

// ---- opening -----------------------------------------------------------------------------------

static void end_decoder(struct jpeg_input *in)
{
    if (in->begun)
        jpeg_destroy_decompress(&in->jpeg);
    in->begun = false;
}

static void read_header(struct jpeg_input *in)
{
    jpeg_create_decompress(&in->jpeg);
    in->begun = true;
    in->jpeg.client_data = in; // creation clears all but the functions for errors
    in->jpeg.progress = &in->progress;
    if (in->base.file)
        jpeg_stdio_src(&in->jpeg, in->base.file);
    else
        jpeg_mem_src(&in->jpeg, in->base.bytes.data, (unsigned long)in->base.bytes.size);
    jpeg_read_header(&in->jpeg, TRUE);
    in->jpeg.out_color_space = in->jpeg.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
}

static void start(struct jpeg_input *in)
{
    jpeg_start_decompress(&in->jpeg);
}

// From the first byte on, up to the pixels.
static enum hg_status begin(struct jpeg_input *in, struct hg_error *err)
{
    end_decoder(in);
    in->failed = true;
    snprintf(in->reason, sizeof in->reason, "it cannot be read from its beginning again");
    in->fault = HG_E_IO;
    if (in->base.file && fseeko(in->base.file, 0, SEEK_SET) != 0)
        return hg_error_set(err, HG_E_IO, in->base.name, NULL, "%s", in->reason);
    memset(&in->jpeg, 0, sizeof in->jpeg);
    in->jpeg.err = jpeg_std_error(&in->errors);
    in->jpeg.client_data = in;
    in->errors.error_exit = on_error;
    in->errors.output_message = on_message;
    in->progress.progress_monitor = on_progress;
    return guarded(in, read_header, err);
}

static bool is_cmyk(const struct jpeg_input *in)
{
    return in->jpeg.jpeg_color_space == JCS_CMYK || in->jpeg.jpeg_color_space == JCS_YCCK ||
           (in->jpeg.num_components != 1 && in->jpeg.num_components != 3);
}

static void describe(struct jpeg_input *in)
{
    struct hg_oiio_header *h = &in->base.header;
    h->width = (int)in->jpeg.image_width;
    h->height = (int)in->jpeg.image_height;
    h->channels = in->jpeg.num_components;
    h->alpha_channel = -1;
    h->pixel_bytes = (uint64_t)h->channels;
    h->row_bytes = h->pixel_bytes * (uint64_t)h->width;
    h->image_bytes = h->row_bytes * (uint64_t)h->height;
}

static enum hg_status begin_first(struct hg_rows_input *base, struct hg_error *err)
{
    struct jpeg_input *in = (struct jpeg_input *)base;
    const enum hg_status status = begin(in, err);
    if (status)
        return status;
    if (is_cmyk(in))
        return hg_error_set(err, HG_E_UNSUPPORTED, in->base.name, NULL, "not gray or RGB");
    describe(in);
    return HG_OK;
}

// ---- pixels ------------------------------------------------------------------------------------

static void read_row(struct jpeg_input *in)
{
    JSAMPROW row = in->row;
    jpeg_read_scanlines(&in->jpeg, &row, 1);
}

static enum hg_status prepare(struct jpeg_input *in, uint32_t y, struct hg_error *err)
{
    const bool started = in->jpeg.global_state != 0 && in->jpeg.output_width != 0;
    enum hg_status status = HG_OK;
    if (!in->row && !(in->row = hg_calloc((size_t)in->base.header.row_bytes, 1)))
        return hg_error_set(err, HG_E_NOMEM, in->base.name, NULL, "no memory to decode or encode");
    if (started && y >= in->jpeg.output_scanline)
        return HG_OK;
    if (started)
        status = begin(in, err);
    return status ? status : guarded(in, start, err);
}

static enum hg_status read_rows(struct hg_rows_input *base, uint32_t y, uint32_t count,
    const struct hg_oiio_target *to, struct hg_error *err)
{
    struct jpeg_input *in = (struct jpeg_input *)base;
    const size_t stride = hg_rows_pixel_bytes(&base->header, to) * (size_t)base->header.width;
    uint8_t *dst = to->pixels;
    if (in->failed)
        return hg_error_set(err, in->fault, in->base.name, NULL, "%s", in->reason);
    enum hg_status status = count ? prepare(in, y, err) : HG_OK;
    while (!status && in->jpeg.output_scanline < y)
        status = guarded(in, read_row, err);
    for (uint32_t i = 0; i < count && !status; i++, dst += stride) {
        status = guarded(in, read_row, err);
        if (!status)
            hg_rows_convert(&base->header, in->row, to, dst);
    }
    return status;
}

// Comments have no names: hg_image_examine looks into them itself.
static void read_text(
    const struct hg_rows_input *base, const char *key, char *text, size_t size_bytes)
{
    (void)base;
    (void)key;
    snprintf(text, size_bytes, "%s", "");
}

static void close_input(struct hg_rows_input *base)
{
    struct jpeg_input *in = (struct jpeg_input *)base;
    end_decoder(in);
    hg_free(in->row);
}

enum hg_status hg_jpeg_open(FILE *file, const struct hg_image_bytes *bytes, bool large,
    struct hg_rows_input **out, struct hg_error *err)
{
    static const struct hg_rows_functions functions = {
        sizeof(struct jpeg_input), begin_first, read_rows, read_text, close_input};
    return hg_rows_open(&functions, file, bytes, large, out, err);
}
