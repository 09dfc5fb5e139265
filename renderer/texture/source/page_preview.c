#include "renderer/texture/source/page_preview.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"

#define PUBLISH_NS UINT64_C(500000000) // between two states of it

struct preview {
    struct hg_page_sources *sources;
    struct hg_page_image *image;
    struct hg_source_rows *rows;
    struct hg_image small; // in the rows' format
    uint8_t *row;          // one of the file
};

uint32_t hg_page_preview_mip(const struct hg_page_layout *layout)
{
    uint32_t mip = 0;
    while (mip < layout->tail && (hg_mips_side(layout->width, mip) > HG_PAGE_PREVIEW_SIDE ||
                                     hg_mips_side(layout->height, mip) > HG_PAGE_PREVIEW_SIDE))
        mip++;
    return mip;
}

void hg_page_preview_drop(struct hg_page_image *image)
{
    hg_mips_finish(&image->preview);
    image->preview = (struct hg_mips){0};
}

static float component(const struct preview *p, const uint8_t *texel, uint32_t c)
{
    float value;
    if (p->small.format == HG_PIXEL_RGBA8)
        return texel[c];
    if (p->small.format == HG_PIXEL_RGBA16)
        return ((const uint16_t *)(const void *)texel)[c];
    memcpy(&value, texel + c * sizeof value, sizeof value);
    return value;
}

// Means of the row's texels, as numbers.
static void shrink_row(const struct preview *p, uint8_t *to)
{
    const size_t bytes = hg_pixel_bytes(p->small.format);
    const uint64_t from_width = p->image->info.width, width = p->small.width;
    for (uint64_t x = 0; x < width; x++) {
        const uint64_t first = x * from_width / width, end = (x + 1) * from_width / width;
        float sum[4] = {0};
        for (uint64_t i = first; i < end; i++)
            for (uint32_t c = 0; c < 4; c++)
                sum[c] += component(p, p->row + i * bytes, c);
        for (uint32_t c = 0; c < 4; c++) {
            const float mean = sum[c] / (float)(end - first);
            if (p->small.format == HG_PIXEL_RGBA8)
                to[x * bytes + c] = (uint8_t)(mean + 0.5f);
            else if (p->small.format == HG_PIXEL_RGBA16)
                ((uint16_t *)(void *)to)[x * 4 + c] = (uint16_t)(mean + 0.5f);
            else
                memcpy(to + x * bytes + c * sizeof mean, &mean, sizeof mean);
        }
    }
}

// False when there is no memory for it.
static bool publish(struct preview *p)
{
    struct hg_page_image *image = p->image;
    struct hg_mips mips;
    if (hg_page_chain_mips(image, &p->small, &mips) != HG_OK)
        return false;
    pthread_mutex_lock(&p->sources->lock);
    hg_page_preview_drop(image);
    image->preview = mips;
    image->preview_number++;
    hg_page_sources_changed(p->sources, true);
    pthread_mutex_unlock(&p->sources->lock);
    return true;
}

static bool stopped(const struct preview *p)
{
    return atomic_load(&p->image->cancel) || p->sources->stop;
}

static void read_rows(struct preview *p)
{
    const uint64_t height = p->image->info.height, rows = p->small.height;
    const size_t bytes = (size_t)p->small.width * hg_pixel_bytes(p->small.format);
    uint64_t next = hg_clock_now_ns() + PUBLISH_NS, at = 0;
    for (uint64_t y = 0; y < rows; y++) {
        const uint64_t from = (2 * y + 1) * height / (2 * rows);
        uint8_t *to = (uint8_t *)p->small.pixels + y * bytes;
        if (stopped(p) ||
            hg_source_rows_skip(p->rows, (uint32_t)(from - at), p->row, NULL) != HG_OK ||
            hg_source_rows_next(p->rows, 1, p->row, NULL) != HG_OK)
            return;
        at = from + 1;
        shrink_row(p, to);
        if (y + 1 < rows && hg_clock_now_ns() < next)
            continue;
        for (uint64_t below = y + 1; below < rows; below++)
            memcpy((uint8_t *)p->small.pixels + below * bytes, to, bytes);
        if (!publish(p))
            return;
        next = hg_clock_now_ns() + PUBLISH_NS;
    }
}

void hg_page_preview_read(struct hg_page_sources *sources, struct hg_page_image *image,
    const struct hg_image_source *origin)
{
    struct preview p = {.sources = sources, .image = image};
    const uint32_t mip = hg_page_preview_mip(&image->layout);
    if (hg_source_rows_open(origin, &image->info, &p.rows, NULL) != HG_OK)
        return;
    const enum hg_pixel_format format = hg_source_rows_format(p.rows);
    p.row = hg_calloc(image->info.width, hg_pixel_bytes(format));
    if (p.row != NULL &&
        hg_image_create(hg_mips_side(image->info.width, mip), hg_mips_side(image->info.height, mip),
            format, NULL, &p.small) == HG_OK)
        read_rows(&p);
    hg_image_finish(&p.small);
    hg_free(p.row);
    hg_source_rows_close(p.rows);
}
