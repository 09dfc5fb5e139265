// input_serve.c - what both sides of an isolated image write and read, and the side that decodes.
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/image/input.h"

enum { MOST_CHANNELS = 65536, MOST_BYTES_OF_A_CHANNEL = 8 };
static const uint64_t most_bytes = UINT64_C(1) << 33; // of one answer

// ---- headers and areas -------------------------------------------------------------------------

static void write_header(struct hg_writer *w, const struct hg_oiio_header *h)
{
    const int numbers[] = {h->width, h->height, h->tile_width, h->tile_height, h->channels,
        h->alpha_channel, h->is_float, h->is_16bit, h->straight_alpha};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        hg_write_u32(w, (uint32_t)numbers[i]);
    hg_write_u64(w, h->pixel_bytes);
}

bool hg_input_parse_header(const void *data, size_t size, struct hg_oiio_header *out)
{
    struct hg_reader r = hg_reader_make(data, size);
    struct hg_oiio_header h = {.width = (int)hg_read_u32(&r),
        .height = (int)hg_read_u32(&r),
        .tile_width = (int)hg_read_u32(&r),
        .tile_height = (int)hg_read_u32(&r),
        .channels = (int)hg_read_u32(&r),
        .alpha_channel = (int)hg_read_u32(&r),
        .is_float = hg_read_u32(&r) != 0,
        .is_16bit = hg_read_u32(&r) != 0,
        .straight_alpha = hg_read_u32(&r) != 0,
        .pixel_bytes = hg_read_u64(&r)};
    *out = (struct hg_oiio_header){0};
    if (r.failed || r.pos != size || h.width < 1 || h.height < 1 || h.tile_width < 0 ||
        h.tile_height < 0 || h.channels < 1 || h.channels > MOST_CHANNELS || h.alpha_channel < -1 ||
        h.alpha_channel > h.channels || // it is, in animated GIF files
        h.pixel_bytes < 1 || h.pixel_bytes > (uint64_t)h.channels * MOST_BYTES_OF_A_CHANNEL)
        return false;
    h.row_bytes = h.pixel_bytes * (uint64_t)h.width;
    if (!hg_mul_u64(h.row_bytes, (uint64_t)h.height, &h.image_bytes))
        return false;
    *out = h;
    return true;
}

void hg_input_write_area(struct hg_writer *w, const struct hg_input_area *a)
{
    const uint32_t numbers[] = {a->kind, (uint32_t)a->part, a->y, a->count, a->tiles.mip,
        a->tiles.at[0], a->tiles.at[1], a->tiles.size[0], a->tiles.size[1], a->type,
        (uint32_t)a->channels};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        hg_write_u32(w, numbers[i]);
}

static bool parse_area(struct hg_reader *r, struct hg_input_area *out)
{
    uint32_t n[11];
    for (size_t i = 0; i < sizeof n / sizeof *n; i++)
        n[i] = hg_read_u32(r);
    *out = (struct hg_input_area){.kind = n[0],
        .part = (int)n[1],
        .y = n[2],
        .count = n[3],
        .tiles = {n[4], {n[5], n[6]}, {n[7], n[8]}},
        .type = n[9],
        .channels = (int)n[10]};
    return !r->failed && n[0] <= HG_INPUT_TILES && n[9] <= HG_OIIO_F32;
}

uint64_t hg_input_area_bytes(const struct hg_input_area *a, const struct hg_oiio_header *h)
{
    static const uint64_t type_bytes[] = {[HG_OIIO_U8] = 1,
        [HG_OIIO_U16] = 2,
        [HG_OIIO_U32] = 4,
        [HG_OIIO_HALF] = 2,
        [HG_OIIO_F32] = 4};
    const bool tiles = a->kind == HG_INPUT_TILES, rows = a->kind == HG_INPUT_ROWS;
    const uint64_t width = tiles ? a->tiles.size[0] : (uint64_t)h->width;
    const uint64_t height = tiles ? a->tiles.size[1] : rows ? a->count : (uint64_t)h->height;
    if (a->channels < 1 || a->channels > h->channels ||
        (a->type == HG_OIIO_NATIVE && a->channels != h->channels))
        return 0;
    const uint64_t pixel =
        a->type == HG_OIIO_NATIVE ? h->pixel_bytes : (uint64_t)a->channels * type_bytes[a->type];
    uint64_t count, bytes;
    return hg_mul_u64(width, height, &count) && hg_mul_u64(count, pixel, &bytes) &&
                   bytes <= most_bytes
               ? bytes
               : 0;
}

// ---- decoding ----------------------------------------------------------------------------------

struct served { // kept by the process
    struct hg_oiio_input *input;
    struct hg_oiio_header part;
};

static enum hg_status serve_open(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err)
{
    const struct hg_image_bytes bytes = {request->data, request->data_size, request->name};
    const bool large = hg_read_u32(&request->args) != 0;
    const size_t length = request->args.size - request->args.pos;
    char format[32] = "";
    if (length < sizeof format)
        memcpy(format, request->args.data + request->args.pos, length);
    FILE *file = request->file >= 0 ? fdopen(request->file, "rb") : NULL;
    struct served *served = request->state ? NULL : hg_calloc(1, sizeof *served);
    if (!served || (request->file >= 0 && !file))
        return HG_E_NOMEM;
    request->state = served;
    enum hg_status status = hg_oiio_open(file, &bytes, format, large, &served->input, err);
    if (status)
        return status;
    served->part = *hg_oiio_get_header(served->input);
    write_header(out, &served->part);
    return HG_OK;
}

static enum hg_status serve_part(struct served *served, struct hg_isolate_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    const enum hg_status status =
        hg_oiio_part_header(served->input, (int)hg_read_u32(&request->args), &served->part, err);
    if (!status)
        write_header(out, &served->part);
    return status;
}

static enum hg_status serve_mip(
    struct served *served, struct hg_isolate_request *request, struct hg_writer *out)
{
    uint32_t size_px[2];
    if (!hg_oiio_mip_size(served->input, hg_read_u32(&request->args), size_px))
        return HG_E_NOTFOUND;
    hg_write_u32(out, size_px[0]);
    hg_write_u32(out, size_px[1]);
    return HG_OK;
}

static enum hg_status serve_text(struct served *served, struct hg_isolate_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    char key[256] = "", text[1024];
    if (request->args.size < sizeof key)
        memcpy(key, request->args.data, request->args.size);
    const enum hg_status status = hg_oiio_read_text(served->input, key, text, sizeof text, err);
    if (!status)
        hg_write_bytes(out, text, strlen(text));
    return status;
}

static enum hg_status serve_read(struct served *served, struct hg_isolate_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    struct hg_input_area a;
    if (!parse_area(&request->args, &a))
        return HG_E_INVAL;
    const uint64_t bytes = hg_input_area_bytes(&a, &served->part);
    void *pixels = bytes ? hg_calloc((size_t)bytes, 1) : NULL;
    if (!pixels)
        return bytes ? HG_E_NOMEM : HG_E_INVAL;
    *out = (struct hg_writer){.data = pixels, .size = (size_t)bytes, .capacity = (size_t)bytes};
    const struct hg_oiio_target target = {a.type, a.channels, pixels};
    if (a.kind == HG_INPUT_TILES)
        return hg_oiio_read_tiles(served->input, &a.tiles, &target, err);
    return a.kind == HG_INPUT_ROWS
               ? hg_oiio_read_rows(served->input, a.part, a.y, a.count, &target, err)
               : hg_oiio_read_image(served->input, a.part, &target, err);
}

enum hg_status hg_input_serve(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err)
{
    struct served *served = request->state;
    if (request->op == HG_ISOLATE_IMAGE_OPEN)
        return serve_open(request, out, err);
    if (!served || !served->input)
        return HG_E_INVAL;
    switch (request->op) {
    case HG_ISOLATE_IMAGE_PART:
        return serve_part(served, request, out, err);
    case HG_ISOLATE_IMAGE_MIP:
        return serve_mip(served, request, out);
    case HG_ISOLATE_IMAGE_TEXT:
        return serve_text(served, request, out, err);
    default:
        return serve_read(served, request, out, err);
    }
}
