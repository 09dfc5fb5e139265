// page_ondemand.c - see page_ondemand.h.
#include "renderer/texture/source/page_ondemand.h"

#include <string.h>

#include "base/alloc.h"

enum { SIDE = HG_PAGE_PITCH };

// Buffers for one page.
struct make {
    struct hg_tile_cache *tiles;
    const struct hg_page_backing *backing;
    const struct hg_page_chain *chain;
    struct hg_page_request *read;
    uint8_t *pixels; // [SIDE * SIDE] as the source has them
    uint8_t *texels; // [4][SIDE * SIDE]
    struct hg_error *err;
};

struct span {
    uint32_t first, length;
};

static enum hg_status make_pixels(
    struct make *m, uint32_t mip, struct span x, struct span y, void *pixels)
{
    const struct hg_image_tiles *t = m->backing->tiles;
    const struct hg_image_rect rect = {mip, {x.first, y.first}, {x.length, y.length}};
    if (t != NULL)
        return t->make(t->user, &rect, pixels)
                   ? HG_OK
                   : hg_error_set(m->err, HG_E_IO, "tiles", NULL, "mip %u cannot be made", mip);
    uint64_t bytes;
    const enum hg_status status =
        hg_tile_cache_rect(m->tiles, m->backing->file, &rect, pixels, &bytes, m->err);
    m->read->bytes += bytes;
    if (status == HG_OK && !hg_open_file_is_unchanged(m->backing->file))
        return hg_error_set(m->err, HG_E_HASH, "image", NULL, "the file was changed");
    return status;
}

// A rectangle of the mip as texels, rows tight.
static enum hg_status make_rect(
    struct make *m, uint32_t mip, struct span x, struct span y, uint8_t *texels)
{
    const size_t count = (size_t)x.length * y.length;
    const enum hg_pixel_format format = m->backing->format;
    const bool as_is = format == HG_PIXEL_RGBA8 && m->chain->texel_bytes == 4;
    uint8_t *pixels = as_is ? texels : m->pixels;
    const enum hg_status status = make_pixels(m, mip, x, y, pixels);
    if (status == HG_OK && !as_is)
        hg_mips_to_half(format, m->chain->srgb, pixels, count, (uint16_t *)(void *)texels);
    return status;
}

static struct span own_span(uint32_t page, uint32_t side)
{
    const uint32_t first = page > 0 ? page * HG_PAGE_TEXELS - HG_PAGE_BORDER : 0;
    const uint32_t end = (page + 1) * HG_PAGE_TEXELS + HG_PAGE_BORDER;
    return (struct span){first, (end < side ? end : side) - first};
}

// What REPEAT shows beyond the edge; length 0: nothing that the page does not have.
static struct span other_span(uint32_t page, uint32_t side, enum hg_wrap wrap)
{
    if (wrap != HG_WRAP_REPEAT)
        return (struct span){0};
    if (page == 0) // a narrow mip is in the first page as a whole
        return side > HG_PAGE_TEXELS + HG_PAGE_BORDER
                   ? (struct span){side - HG_PAGE_BORDER, HG_PAGE_BORDER}
                   : (struct span){0};
    const uint32_t end = (page + 1) * HG_PAGE_TEXELS + HG_PAGE_BORDER;
    return (struct span){0, end > side ? HG_PAGE_BORDER : 0};
}

static enum hg_status make_page(struct make *m)
{
    const struct hg_page_request *r = m->read;
    const struct hg_page_view *view = r->view;
    const struct hg_page_layout *l = view->layout;
    const uint32_t w = hg_mips_side(l->width, r->mip), h = hg_mips_side(l->height, r->mip);
    const struct span xs[2] = {own_span(r->x, w), other_span(r->x, w, view->wrap_s)};
    const struct span ys[2] = {own_span(r->y, h), other_span(r->y, h, view->wrap_t)};
    struct hg_page_part parts[4] = {0};
    for (int i = 0; i < 4; i++) {
        const struct span x = xs[i & 1], y = ys[i >> 1];
        if (x.length == 0 || y.length == 0)
            continue;
        uint8_t *texels = m->texels + (size_t)i * SIDE * SIDE * m->chain->texel_bytes;
        const enum hg_status status = make_rect(m, r->mip, x, y, texels);
        if (status != HG_OK)
            return status;
        parts[i] = (struct hg_page_part){
            texels, (size_t)x.length * m->chain->texel_bytes, x.first, y.first, x.length, y.length};
    }
    hg_page_assemble(view, r->mip, r->x, r->y, parts, r->texels);
    return HG_OK;
}

static enum hg_status make_tail(struct make *m)
{
    const struct hg_page_layout *l = m->read->view->layout;
    const uint8_t *levels[HG_MIPS_MAX] = {0};
    uint8_t *texels = m->texels;
    for (uint32_t i = l->tail; i < l->mips; i++) {
        const uint32_t w = hg_mips_side(l->width, i), h = hg_mips_side(l->height, i);
        const enum hg_status status =
            make_rect(m, i, (struct span){0, w}, (struct span){0, h}, texels);
        if (status != HG_OK)
            return status;
        levels[i] = texels;
        texels += (size_t)w * h * m->chain->texel_bytes;
    }
    hg_page_assemble_tail(m->read->view, levels, m->read->texels);
    return HG_OK;
}

enum hg_status hg_page_make(struct hg_tile_cache *tiles, const struct hg_page_backing *backing,
    const struct hg_page_chain *chain, struct hg_page_request *read, struct hg_error *err)
{
    struct make m = {.tiles = tiles, .backing = backing, .chain = chain, .read = read, .err = err};
    read->bytes = 0;
    m.pixels = hg_calloc((size_t)SIDE * SIDE, 16);
    m.texels = hg_calloc((size_t)4 * SIDE * SIDE, chain->texel_bytes);
    enum hg_status status;
    if (m.pixels == NULL || m.texels == NULL)
        status = hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
    else
        status = read->mip >= read->view->layout->tail ? make_tail(&m) : make_page(&m);
    hg_free(m.pixels);
    hg_free(m.texels);
    return status;
}
