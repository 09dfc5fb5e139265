// mips.c - see mips.h.
#include "renderer/texture/source/mips.h"

#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"

static enum hg_status allocate(struct hg_mips *m)
{
    size_t total = 0;
    for (uint32_t i = 0; i < m->count; i++) {
        const size_t texels = (size_t)hg_mips_side(m->width, i) * hg_mips_side(m->height, i);
        if (!hg_add_size(total, texels * m->texel_bytes, &total))
            return HG_E_NOMEM;
    }
    uint8_t *bytes = hg_calloc(total, 1);
    if (bytes == NULL)
        return HG_E_NOMEM;
    m->bytes = total;
    for (uint32_t i = 0; i < m->count; i++) {
        m->levels[i] = bytes;
        bytes += (size_t)hg_mips_side(m->width, i) * hg_mips_side(m->height, i) * m->texel_bytes;
    }
    return HG_OK;
}

static enum hg_status keep_row(void *user, uint32_t mip, uint32_t y, const void *texels)
{
    struct hg_mips *m = user;
    const size_t bytes = (size_t)hg_mips_side(m->width, mip) * m->texel_bytes;
    memcpy(m->levels[mip] + y * bytes, texels, bytes);
    return HG_OK;
}

void hg_mips_count_alpha(const struct hg_mips *mips, uint32_t mip, uint64_t histogram[256])
{
    memset(histogram, 0, 256 * sizeof *histogram);
    const size_t count = (size_t)hg_mips_side(mips->width, mip) * hg_mips_side(mips->height, mip);
    for (size_t i = 0; i < count; i++)
        histogram[mips->levels[mip][i * 4 + 3]]++;
}

static void keep_coverage(struct hg_mips *m, float cutoff)
{
    uint64_t top[256], histogram[256];
    hg_mips_count_alpha(m, 0, top);
    for (uint32_t i = 1; i < m->count; i++) {
        uint8_t table[256];
        hg_mips_count_alpha(m, i, histogram);
        hg_mips_mask_table(top, histogram, cutoff, table);
        const size_t count = (size_t)hg_mips_side(m->width, i) * hg_mips_side(m->height, i);
        for (size_t t = 0; t < count; t++)
            m->levels[i][t * 4 + 3] = table[m->levels[i][t * 4 + 3]];
    }
}

enum hg_mip_filter hg_mips_filter(enum hg_texture_use use)
{
    if (use == HG_TEXTURE_BLEND || use == HG_TEXTURE_MASK)
        return HG_MIP_WEIGHTED;
    return use == HG_TEXTURE_NORMAL ? HG_MIP_NORMAL : HG_MIP_PLAIN;
}

static enum hg_status filter_image(
    const struct hg_image *image, const struct hg_mips_params *params, struct hg_mips *m)
{
    const struct hg_mip_stream_params stream_params = {.width = image->width,
        .height = image->height,
        .format = image->format,
        .filter = hg_mips_filter(params->use),
        .srgb = params->srgb,
        .half = params->half,
        .row = keep_row,
        .user = m};
    struct hg_mip_stream *stream;
    enum hg_status status = hg_mip_stream_create(&stream_params, &stream);
    const size_t row_bytes = (size_t)image->width * hg_pixel_bytes(image->format);
    for (uint32_t y = 0; status == HG_OK && y < image->height; y++)
        status = hg_mip_stream_push(stream, (const uint8_t *)image->pixels + y * row_bytes);
    hg_mip_stream_destroy(stream);
    return status;
}

enum hg_status hg_mips_build(
    const struct hg_image *image, const struct hg_mips_params *params, struct hg_mips *out)
{
    memset(out, 0, sizeof *out);
    if (image->width == 0 || image->height == 0 || image->width > HG_MIPS_SIDE_PX ||
        image->height > HG_MIPS_SIDE_PX)
        return HG_E_INVAL;
    struct hg_mips m = {.width = image->width,
        .height = image->height,
        .count = hg_mips_count(image->width, image->height),
        .texel_bytes = hg_mips_texel_bytes(image->format, params->half)};
    enum hg_status status = allocate(&m);
    if (status == HG_OK)
        status = filter_image(image, params, &m);
    if (status != HG_OK) {
        hg_mips_finish(&m);
        return status;
    }
    if (params->use == HG_TEXTURE_MASK && params->cutoff > 0.0f && m.texel_bytes == 4)
        keep_coverage(&m, params->cutoff);
    *out = m;
    return HG_OK;
}

void hg_mips_finish(struct hg_mips *mips)
{
    hg_free(mips->levels[0]);
    memset(mips, 0, sizeof *mips);
}
