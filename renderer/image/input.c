#include "renderer/image/input.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/image/rows.h"

static const uint64_t band_bytes = 16 << 20; // of one answer of rows

struct hg_input {
    struct hg_oiio_input *here; // one of three
    struct hg_rows_input *rows;
    struct hg_isolated *process;
    struct hg_oiio_header header, part; // of the first part; of the one looked at last
    // To open it again:
    FILE *file;
    struct hg_image_bytes bytes;
    char *name;
    const char *format;
    bool large, has_answered; // since it was opened
};

// ---- calls -------------------------------------------------------------------------------------

static enum hg_status call(struct hg_input *in, enum hg_isolate_op op, const struct hg_writer *args,
    struct hg_isolate_result *out, struct hg_error *err)
{
    const struct hg_isolate_call what = {.op = op, .args = args->data, .args_size = args->size};
    if (args->failed)
        return hg_error_set(err, HG_E_NOMEM, in->name, NULL, "no memory");
    return hg_isolate_get()->call(in->process, &what, out, err);
}

static enum hg_status unsound(const struct hg_input *in, struct hg_error *err)
{
    return hg_error_set(err, HG_E_FORMAT, in->name, NULL, "what its reader made of it is unsound");
}

static enum hg_status open_process(struct hg_input *in, struct hg_error *err)
{
    const struct hg_isolate_ops *ops = hg_isolate_get();
    struct hg_isolate_result result = {0};
    struct hg_writer args = {0};
    in->has_answered = false;
    enum hg_status status = ops->open(ops->user, in->name, &in->process, err);
    if (status) // others that are open may be closed, as when there is no memory
        return status == HG_E_LIMIT ? HG_E_NOMEM : status;
    hg_write_u32(&args, in->large);
    hg_write_bytes(&args, in->format, strlen(in->format));
    const struct hg_isolate_call what = {.op = HG_ISOLATE_IMAGE_OPEN,
        .args = args.data,
        .args_size = args.size,
        .data = in->file ? NULL : in->bytes.data,
        .data_size = in->file ? 0 : in->bytes.size,
        .file = in->file ? fileno(in->file) : -1};
    status = args.failed ? HG_E_NOMEM : ops->call(in->process, &what, &result, err);
    if (!status && !hg_input_parse_header(result.data, result.size, &in->header))
        status = unsound(in, err);
    ops->release(&result);
    hg_writer_finish(&args);
    in->part = in->header;
    return status;
}

// Processor time is limited for a process, not for each of its answers: one that has read much of a
// file that stays open gets a successor. A file that ends its first answer does not.
static enum hg_status call_again(struct hg_input *in, enum hg_isolate_op op,
    const struct hg_writer *args, struct hg_isolate_result *out, struct hg_error *err)
{
    struct hg_error first = {0};
    enum hg_status status = call(in, op, args, out, &first);
    if (status == HG_E_LIMIT && in->has_answered) {
        hg_isolate_get()->close(in->process);
        in->process = NULL;
        status = open_process(in, &first);
        if (!status)
            status = call(in, op, args, out, &first);
    }
    in->has_answered |= !status;
    if (status && err)
        *err = first;
    return status;
}

// ---- opening -----------------------------------------------------------------------------------

// PNG, JPEG, OpenEXR and Radiance HDR are what scenes consist of and are read here.
static bool is_isolated(const char *format)
{
    static const char *const common[] = {"png", "jpeg", "openexr", "hdr"};
    bool isolated = hg_isolate_get() != NULL;
    for (size_t i = 0; i < sizeof common / sizeof *common; i++)
        isolated &= strcmp(format, common[i]) != 0;
    return isolated;
}

// HG_E_UNSUPPORTED, without a reason: a file that OpenImageIO reads.
static enum hg_status open_rows(struct hg_input *in, struct hg_error *err)
{
    struct hg_error why = {0};
    enum hg_status status = HG_E_UNSUPPORTED;
    if (strcmp(in->format, "png") == 0)
        status = hg_png_open(in->file, &in->bytes, in->large, &in->rows, &why);
    else if (strcmp(in->format, "jpeg") == 0)
        status = hg_jpeg_open(in->file, &in->bytes, in->large, &in->rows, &why);
    if (!status)
        in->header = in->part = in->rows->header;
    else if (status != HG_E_UNSUPPORTED && err)
        *err = why;
    return status;
}

enum hg_status hg_input_open(FILE *file, const struct hg_image_bytes *bytes, const char *format,
    bool large, struct hg_input **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_input *in = hg_calloc(1, sizeof *in);
    if (!in || !(in->name = hg_strdup(bytes->name))) {
        hg_free(in);
        return hg_error_set(err, HG_E_NOMEM, bytes->name, NULL, "no memory to decode or encode");
    }
    in->file = file;
    in->bytes = *bytes;
    in->format = format;
    in->large = large;
    enum hg_status status = open_rows(in, err);
    if (status == HG_E_UNSUPPORTED && is_isolated(format))
        status = open_process(in, err);
    else if (status == HG_E_UNSUPPORTED &&
             !(status = hg_oiio_open(file, bytes, format, large, &in->here, err)))
        in->header = in->part = *hg_oiio_get_header(in->here);
    if (status)
        hg_input_close(in);
    else
        *out = in;
    return status;
}

void hg_input_close(struct hg_input *in)
{
    if (!in)
        return;
    hg_oiio_close(in->here);
    hg_rows_close(in->rows);
    if (in->process)
        hg_isolate_get()->close(in->process);
    hg_free(in->name);
    hg_free(in);
}

const char *hg_input_name(const struct hg_input *in)
{
    return in->name;
}

const struct hg_oiio_header *hg_input_get_header(const struct hg_input *in)
{
    return &in->header;
}

// ---- what it says ------------------------------------------------------------------------------

enum hg_status hg_input_part_header(
    struct hg_input *in, int part, struct hg_oiio_header *out, struct hg_error *err)
{
    struct hg_isolate_result result;
    struct hg_writer args = {0};
    *out = (struct hg_oiio_header){0};
    if (in->rows) {
        *out = in->part = in->header;
        return part == 0 ? HG_OK : HG_E_NOTFOUND;
    }
    if (in->here) {
        const enum hg_status status = hg_oiio_part_header(in->here, part, out, err);
        in->part = *out;
        return status;
    }
    hg_write_u32(&args, (uint32_t)part);
    enum hg_status status = call_again(in, HG_ISOLATE_IMAGE_PART, &args, &result, err);
    hg_writer_finish(&args);
    if (!status && !hg_input_parse_header(result.data, result.size, out))
        status = unsound(in, err);
    hg_isolate_get()->release(&result);
    in->part = *out;
    return status;
}

bool hg_input_mip_size(struct hg_input *in, uint32_t mip, uint32_t size_px[2])
{
    struct hg_isolate_result result;
    struct hg_writer args = {0};
    if (in->rows)
        return false;
    if (in->here)
        return hg_oiio_mip_size(in->here, mip, size_px);
    hg_write_u32(&args, mip);
    const enum hg_status status = call_again(in, HG_ISOLATE_IMAGE_MIP, &args, &result, NULL);
    hg_writer_finish(&args);
    struct hg_reader r = hg_reader_make(result.data, result.size);
    size_px[0] = hg_read_u32(&r);
    size_px[1] = hg_read_u32(&r);
    hg_isolate_get()->release(&result);
    return !status && !r.failed;
}

enum hg_status hg_input_read_text(
    struct hg_input *in, const char *key, char *text, size_t size_bytes, struct hg_error *err)
{
    struct hg_isolate_result result;
    struct hg_writer args = {0};
    if (in->rows) {
        hg_rows_read_text(in->rows, key, text, size_bytes);
        return HG_OK;
    }
    if (in->here)
        return hg_oiio_read_text(in->here, key, text, size_bytes, err);
    hg_write_bytes(&args, key, strlen(key));
    const enum hg_status status = call_again(in, HG_ISOLATE_IMAGE_TEXT, &args, &result, err);
    hg_writer_finish(&args);
    snprintf(text, size_bytes, "%.*s", result.size < size_bytes ? (int)result.size : 0,
        result.data ? (const char *)result.data : "");
    hg_isolate_get()->release(&result);
    return status;
}

// ---- pixels ------------------------------------------------------------------------------------

static enum hg_status read_area(
    struct hg_input *in, const struct hg_input_area *area, void *pixels, struct hg_error *err)
{
    struct hg_isolate_result result;
    struct hg_writer args = {0};
    const uint64_t bytes = hg_input_area_bytes(area, &in->part);
    hg_input_write_area(&args, area);
    enum hg_status status = call_again(in, HG_ISOLATE_IMAGE_READ, &args, &result, err);
    hg_writer_finish(&args);
    if (!status && (bytes == 0 || result.size != bytes))
        status = unsound(in, err);
    else if (!status)
        memcpy(pixels, result.data, result.size);
    hg_isolate_get()->release(&result);
    return status;
}

enum hg_status hg_input_read_rows(struct hg_input *in, int part, uint32_t y, uint32_t count,
    const struct hg_oiio_target *to, struct hg_error *err)
{
    if (in->rows)
        return hg_rows_read(in->rows, y, count, to, err);
    if (in->here)
        return hg_oiio_read_rows(in->here, part, y, count, to, err);
    struct hg_input_area area = {.kind = HG_INPUT_ROWS,
        .part = part,
        .count = 1,
        .type = to->type,
        .channels = to->channels};
    const uint64_t row_bytes = hg_input_area_bytes(&area, &in->part);
    const uint32_t most =
        row_bytes && row_bytes < band_bytes ? (uint32_t)(band_bytes / row_bytes) : 1;
    enum hg_status status = HG_OK;
    for (uint32_t done = 0; done < count && !status; done += area.count) {
        area.y = y + done;
        area.count = count - done < most ? count - done : most;
        status = read_area(in, &area, (uint8_t *)to->pixels + done * row_bytes, err);
    }
    return status;
}

enum hg_status hg_input_read_image(
    struct hg_input *in, int part, const struct hg_oiio_target *to, struct hg_error *err)
{
    if (in->here)
        return hg_oiio_read_image(in->here, part, to, err);
    if (in->part.tile_width == 0)
        return hg_input_read_rows(in, part, 0, (uint32_t)in->part.height, to, err);
    const struct hg_input_area area = {
        .kind = HG_INPUT_IMAGE, .part = part, .type = to->type, .channels = to->channels};
    return read_area(in, &area, to->pixels, err);
}

enum hg_status hg_input_read_tiles(struct hg_input *in, const struct hg_image_rect *rect,
    const struct hg_oiio_target *to, struct hg_error *err)
{
    if (in->here)
        return hg_oiio_read_tiles(in->here, rect, to, err);
    const struct hg_input_area area = {
        .kind = HG_INPUT_TILES, .tiles = *rect, .type = to->type, .channels = to->channels};
    return read_area(in, &area, to->pixels, err);
}
