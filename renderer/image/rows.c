#include "renderer/image/rows.h"

#include "base/alloc.h"

static const uint64_t max_whole_bytes = UINT64_C(2) << 30;

enum hg_status hg_rows_check_size(
    const struct hg_oiio_header *h, const char *name, struct hg_error *err)
{
    return h->image_bytes <= max_whole_bytes
               ? HG_OK
               : hg_error_set(err, HG_E_LIMIT, name, "size", "%dx%d px is more than allowed",
                     h->width, h->height);
}

enum hg_status hg_rows_open(const struct hg_rows_functions *functions, FILE *file,
    const struct hg_image_bytes *bytes, bool large, struct hg_rows_input **out,
    struct hg_error *err)
{
    *out = NULL;
    struct hg_rows_input *in = hg_calloc(1, functions->size_bytes);
    if (!in || !(in->name = hg_strdup(bytes->name))) {
        hg_free(in);
        return hg_error_set(err, HG_E_NOMEM, bytes->name, NULL, "no memory to decode or encode");
    }
    in->functions = functions;
    in->file = file;
    in->bytes = *bytes;
    enum hg_status status = functions->begin(in, err);
    if (!status && !large)
        status = hg_rows_check_size(&in->header, in->name, err);
    if (status)
        hg_rows_close(in);
    else
        *out = in;
    return status;
}

void hg_rows_close(struct hg_rows_input *input)
{
    if (!input)
        return;
    input->functions->close(input);
    hg_free(input->name);
    hg_free(input);
}

void hg_rows_read_text(
    const struct hg_rows_input *input, const char *key, char *text, size_t size_bytes)
{
    input->functions->read_text(input, key, text, size_bytes);
}

enum hg_status hg_rows_read(struct hg_rows_input *input, uint32_t y, uint32_t count,
    const struct hg_oiio_target *to, struct hg_error *err)
{
    const struct hg_oiio_header *h = &input->header;
    if (y > (uint32_t)h->height || count > (uint32_t)h->height - y || to->channels > h->channels)
        return hg_error_set(err, HG_E_INVAL, input->name, NULL, "no such rows");
    return input->functions->read_rows(input, y, count, to, err);
}

// ---- samples -----------------------------------------------------------------------------------

static void convert_8(const uint8_t *src, enum hg_oiio_type type, void *dst, size_t count)
{
    uint8_t *u8 = dst;
    uint16_t *u16 = dst;
    float *f32 = dst;
    for (size_t i = 0; i < count; i++) {
        if (type == HG_OIIO_U16)
            u16[i] = (uint16_t)(src[i] * 257);
        else if (type == HG_OIIO_F32)
            f32[i] = (float)src[i] * (1.0f / 255.0f);
        else
            u8[i] = src[i];
    }
}

static void convert_16(const uint16_t *src, enum hg_oiio_type type, void *dst, size_t count)
{
    uint8_t *u8 = dst;
    uint16_t *u16 = dst;
    float *f32 = dst;
    for (size_t i = 0; i < count; i++) {
        if (type == HG_OIIO_U8)
            u8[i] = (uint8_t)((src[i] * 255u + 32767u) / 65535u);
        else if (type == HG_OIIO_F32)
            f32[i] = (float)src[i] * (1.0f / 65535.0f);
        else
            u16[i] = src[i];
    }
}

size_t hg_rows_pixel_bytes(const struct hg_oiio_header *h, const struct hg_oiio_target *to)
{
    const size_t native = h->is_16bit ? 2 : 1;
    const size_t one = to->type == HG_OIIO_F32   ? 4
                       : to->type == HG_OIIO_U16 ? 2
                       : to->type == HG_OIIO_U8  ? 1
                                                 : native;
    return one * (size_t)to->channels;
}

void hg_rows_convert(
    const struct hg_oiio_header *h, const void *row, const struct hg_oiio_target *to, void *dst)
{
    const uint8_t *from = row;
    uint8_t *into = dst;
    const size_t pixels = (size_t)h->width, bytes = hg_rows_pixel_bytes(h, to);
    const bool all = to->channels == h->channels;
    const size_t runs = all ? 1 : pixels;
    const size_t count = all ? pixels * (size_t)h->channels : (size_t)to->channels;
    for (size_t i = 0; i < runs; i++, from += h->pixel_bytes, into += bytes) {
        if (h->is_16bit)
            convert_16((const uint16_t *)(const void *)from, to->type, into, count);
        else
            convert_8(from, to->type, into, count);
    }
}
