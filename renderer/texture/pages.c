// pages.c - see pages.h.
#include <string.h>

#include "renderer/texture/pages.h"

static uint32_t pages_across(uint32_t side, uint32_t mip)
{
    return (hg_mips_side(side, mip) + HG_PAGE_TEXELS - 1) / HG_PAGE_TEXELS;
}

// Entries in front of mip `level` in the pyramid of grids.
static uint32_t entries_before(uint32_t grid_log2, uint32_t level)
{
    const uint32_t rest = grid_log2 + 1 - level;
    return ((4u << (2 * grid_log2)) - (1u << (2 * rest))) / 3u;
}

struct hg_page_layout hg_page_layout_of(uint32_t width, uint32_t height)
{
    struct hg_page_layout l = {
        .width = width, .height = height, .mips = hg_mips_count(width, height)};
    const uint32_t longer = width > height ? width : height;
    while (pages_across(longer, 0) > 1u << l.grid_log2)
        l.grid_log2++;
    while (longer >> l.tail > HG_TAIL_TEXELS)
        l.tail++;
    for (uint32_t i = 0; i < l.tail; i++)
        l.pages += pages_across(width, i) * pages_across(height, i);
    l.pages++;
    l.entries = entries_before(l.grid_log2, l.tail) + 1;
    return l;
}

// Mip and position in the mip's grid of pages; mip == tail for the tail page.
static uint32_t find_page(
    const struct hg_page_layout *l, uint32_t page, uint32_t *column, uint32_t *row)
{
    *column = *row = 0;
    for (uint32_t mip = 0; mip < l->tail; mip++) {
        const uint32_t across = pages_across(l->width, mip);
        const uint32_t count = across * pages_across(l->height, mip);
        if (page < count) {
            *column = page % across;
            *row = page / across;
            return mip;
        }
        page -= count;
    }
    return l->tail;
}

uint32_t hg_page_entry(const struct hg_page_layout *layout, uint32_t page)
{
    uint32_t column, row;
    const uint32_t mip = find_page(layout, page, &column, &row);
    const uint32_t before = entries_before(layout->grid_log2, mip);
    return mip == layout->tail ? before : before + (row << (layout->grid_log2 - mip)) + column;
}

uint32_t hg_page_layout_bits(const struct hg_page_layout *layout)
{
    return layout->mips << HG_TEX_MIPS_SHIFT | layout->grid_log2 << HG_TEX_GRID_SHIFT |
           layout->tail << HG_TEX_TAIL_SHIFT;
}

// Texel that a wrap mode puts at coordinate i of `side` texels. Vulkan 1.3 section 16.7.
static uint32_t wrap_texel(int64_t i, uint32_t side, enum hg_wrap wrap)
{
    if (wrap == HG_WRAP_CLAMP)
        return i < 0 ? 0 : i >= side ? side - 1 : (uint32_t)i;
    const int64_t period = wrap == HG_WRAP_MIRROR ? 2 * (int64_t)side : side;
    i %= period;
    i = i < 0 ? i + period : i;
    return (uint32_t)(i < side ? i : period - 1 - i);
}

struct cut {
    const uint8_t *texels; // of the mip
    uint32_t width, height, texel_bytes;
    enum hg_wrap wrap_s, wrap_t;
};

// Copies columns x0.. x0 + columns and rows y0.. of the mip, wrapped, to (x, y) of the page.
static void cut_rectangle(
    const struct cut *c, int64_t x0, int64_t y0, uint32_t columns, uint32_t rows, uint8_t *dst)
{
    const size_t bytes = c->texel_bytes, pitch = HG_PAGE_PITCH * bytes;
    uint32_t from[HG_PAGE_PITCH];
    uint32_t run_start = columns, run = 0; // columns that lie in the mip, copied at once
    for (uint32_t i = 0; i < columns; i++) {
        from[i] = wrap_texel(x0 + i, c->width, c->wrap_s);
        if (x0 + i >= 0 && x0 + i < c->width) {
            run_start = run == 0 ? i : run_start;
            run++;
        }
    }
    for (uint32_t y = 0; y < rows; y++, dst += pitch) {
        const uint8_t *row =
            c->texels + (size_t)wrap_texel(y0 + y, c->height, c->wrap_t) * c->width * bytes;
        for (uint32_t i = 0; i < run_start; i++)
            memcpy(dst + i * bytes, row + from[i] * bytes, bytes);
        if (run > 0)
            memcpy(dst + run_start * bytes, row + from[run_start] * bytes, run * bytes);
        for (uint32_t i = run_start + run; i < columns; i++)
            memcpy(dst + i * bytes, row + from[i] * bytes, bytes);
    }
}

void hg_page_cut(const struct hg_page_layout *layout, const struct hg_mips *mips, uint32_t page,
    enum hg_wrap wrap_s, enum hg_wrap wrap_t, void *dst)
{
    uint32_t column, row;
    const uint32_t mip = find_page(layout, page, &column, &row);
    struct cut c = {.texel_bytes = mips->texel_bytes, .wrap_s = wrap_s, .wrap_t = wrap_t};
    if (mip < layout->tail) {
        c.texels = mips->levels[mip];
        c.width = hg_mips_side(mips->width, mip);
        c.height = hg_mips_side(mips->height, mip);
        cut_rectangle(&c, (int64_t)column * HG_PAGE_TEXELS - HG_PAGE_BORDER,
            (int64_t)row * HG_PAGE_TEXELS - HG_PAGE_BORDER, HG_PAGE_PITCH, HG_PAGE_PITCH, dst);
        return;
    }
    memset(dst, 0, (size_t)HG_PAGE_PITCH * HG_PAGE_PITCH * c.texel_bytes);
    for (uint32_t i = mip; i < layout->mips; i++) {
        const uint32_t j = i - mip;
        const size_t corner =
            ((size_t)HG_TAIL_Y((int)j) * HG_PAGE_PITCH + HG_TAIL_X((int)j)) * c.texel_bytes;
        c.texels = mips->levels[i];
        c.width = hg_mips_side(mips->width, i);
        c.height = hg_mips_side(mips->height, i);
        cut_rectangle(&c, -HG_PAGE_BORDER, -HG_PAGE_BORDER, c.width + 2 * HG_PAGE_BORDER,
            c.height + 2 * HG_PAGE_BORDER, (uint8_t *)dst + corner);
    }
}
