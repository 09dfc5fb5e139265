// pages.c - see pages.h.
#include <string.h>

#include "renderer/texture/source/pages.h"

uint32_t hg_pages_across(uint32_t side, uint32_t mip)
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
    while (hg_pages_across(longer, 0) > 1u << l.grid_log2)
        l.grid_log2++;
    while (longer >> l.tail > HG_TAIL_TEXELS)
        l.tail++;
    for (uint32_t i = 0; i < l.tail; i++)
        l.pages += hg_pages_across(width, i) * hg_pages_across(height, i);
    l.pages++;
    l.entries = entries_before(l.grid_log2, l.tail) + 1;
    return l;
}

uint32_t hg_page_find(
    const struct hg_page_layout *l, uint32_t page, uint32_t *column, uint32_t *row)
{
    *column = *row = 0;
    for (uint32_t mip = 0; mip < l->tail; mip++) {
        const uint32_t across = hg_pages_across(l->width, mip);
        const uint32_t count = across * hg_pages_across(l->height, mip);
        if (page < count) {
            *column = page % across;
            *row = page / across;
            return mip;
        }
        page -= count;
    }
    return l->tail;
}

uint32_t hg_page_number(const struct hg_page_layout *l, uint32_t mip, uint32_t x, uint32_t y)
{
    uint32_t page = 0;
    for (uint32_t i = 0; i < mip && i < l->tail; i++)
        page += hg_pages_across(l->width, i) * hg_pages_across(l->height, i);
    if (mip >= l->tail)
        return mip == l->tail && x == 0 && y == 0 ? page : UINT32_MAX;
    const uint32_t across = hg_pages_across(l->width, mip);
    return x < across && y < hg_pages_across(l->height, mip) ? page + y * across + x : UINT32_MAX;
}

uint32_t hg_page_entry(const struct hg_page_layout *layout, uint32_t mip, uint32_t x, uint32_t y)
{
    const uint32_t before = entries_before(layout->grid_log2, mip);
    return mip == layout->tail ? before : before + (y << (layout->grid_log2 - mip)) + x;
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

// Where the columns or rows of a rectangle come from: a position and which part holds it.
struct place {
    uint32_t at;
    bool other; // of the part beyond the edge
};

// Positions along one axis of a mip.
struct axis {
    int64_t first;
    uint32_t count, side; // positions; texels of the mip
    enum hg_wrap wrap;
    uint32_t own, own_length; // texels that parts[0] has
};

static void place_texels(const struct axis *a, struct place *places)
{
    for (uint32_t i = 0; i < a->count; i++) {
        const uint32_t at = wrap_texel(a->first + i, a->side, a->wrap);
        places[i] = (struct place){at, at < a->own || at - a->own >= a->own_length};
    }
}

static const uint8_t *texel_of(
    const struct hg_page_part parts[4], struct place x, struct place y, uint32_t texel_bytes)
{
    const struct hg_page_part *p = &parts[(x.other ? 1 : 0) + (y.other ? 2 : 0)];
    return p->texels + (y.at - p->y) * p->pitch_bytes + (size_t)(x.at - p->x) * texel_bytes;
}

// A rectangle of a mip, wrapped, to dst (rows HG_PAGE_PITCH texels apart).
struct rectangle {
    int64_t x, y;
    uint32_t columns, rows;
    uint32_t width, height; // of the mip
};

static void copy_rectangle(const struct hg_page_view *v, const struct rectangle *r,
    const struct hg_page_part parts[4], uint8_t *dst)
{
    const size_t bytes = v->texel_bytes;
    struct place xs[HG_PAGE_PITCH], ys[HG_PAGE_PITCH];
    place_texels(&(struct axis){r->x, r->columns, r->width, v->wrap_s, parts->x, parts->width}, xs);
    place_texels(&(struct axis){r->y, r->rows, r->height, v->wrap_t, parts->y, parts->height}, ys);
    for (uint32_t y = 0; y < r->rows; y++, dst += HG_PAGE_PITCH * bytes)
        for (uint32_t x = 0, run; x < r->columns; x += run) {
            for (run = 1; x + run < r->columns && xs[x + run].at == xs[x].at + run &&
                          xs[x + run].other == xs[x].other;)
                run++;
            memcpy(dst + x * bytes, texel_of(parts, xs[x], ys[y], v->texel_bytes), run * bytes);
        }
}

static void scale_alpha(
    const struct hg_page_view *v, uint32_t mip, const struct rectangle *r, uint8_t *dst)
{
    if (v->alpha == NULL || mip == 0)
        return;
    for (uint32_t y = 0; y < r->rows; y++, dst += HG_PAGE_PITCH * 4)
        for (uint32_t x = 0; x < r->columns; x++)
            dst[x * 4 + 3] = v->alpha[mip][dst[x * 4 + 3]];
}

static uint32_t shown(uint32_t side, uint32_t page)
{
    const uint32_t rest = side - page * HG_PAGE_TEXELS;
    return (rest < HG_PAGE_TEXELS ? rest : HG_PAGE_TEXELS) + 2 * HG_PAGE_BORDER;
}

void hg_page_assemble(const struct hg_page_view *v, uint32_t mip, uint32_t x, uint32_t y,
    const struct hg_page_part parts[4], void *dst)
{
    struct rectangle r = {.x = (int64_t)x * HG_PAGE_TEXELS - HG_PAGE_BORDER,
        .y = (int64_t)y * HG_PAGE_TEXELS - HG_PAGE_BORDER,
        .width = hg_mips_side(v->layout->width, mip),
        .height = hg_mips_side(v->layout->height, mip)};
    r.columns = shown(r.width, x);
    r.rows = shown(r.height, y);
    if (r.columns < HG_PAGE_PITCH || r.rows < HG_PAGE_PITCH)
        memset(dst, 0, (size_t)HG_PAGE_PITCH * HG_PAGE_PITCH * v->texel_bytes);
    copy_rectangle(v, &r, parts, dst);
    scale_alpha(v, mip, &r, dst);
}

void hg_page_assemble_tail(
    const struct hg_page_view *v, const uint8_t *const levels[HG_MIPS_MAX], void *dst)
{
    memset(dst, 0, (size_t)HG_PAGE_PITCH * HG_PAGE_PITCH * v->texel_bytes);
    for (uint32_t i = v->layout->tail; i < v->layout->mips; i++) {
        const int j = (int)(i - v->layout->tail);
        uint8_t *corner =
            (uint8_t *)dst + ((size_t)HG_TAIL_Y(j) * HG_PAGE_PITCH + HG_TAIL_X(j)) * v->texel_bytes;
        struct rectangle r = {.x = -HG_PAGE_BORDER,
            .y = -HG_PAGE_BORDER,
            .width = hg_mips_side(v->layout->width, i),
            .height = hg_mips_side(v->layout->height, i)};
        r.columns = r.width + 2 * HG_PAGE_BORDER;
        r.rows = r.height + 2 * HG_PAGE_BORDER;
        const struct hg_page_part whole[4] = {
            {levels[i], (size_t)r.width * v->texel_bytes, 0, 0, r.width, r.height}};
        copy_rectangle(v, &r, whole, corner);
        scale_alpha(v, i, &r, corner);
    }
}

void hg_page_take(const struct hg_page_view *v, const struct hg_mips *mips, uint32_t mip,
    uint32_t x, uint32_t y, void *dst)
{
    if (mip >= v->layout->tail) {
        hg_page_assemble_tail(v, (const uint8_t *const *)mips->levels, dst);
        return;
    }
    const uint32_t w = hg_mips_side(mips->width, mip), h = hg_mips_side(mips->height, mip);
    const struct hg_page_part whole[4] = {
        {mips->levels[mip], (size_t)w * mips->texel_bytes, 0, 0, w, h}};
    hg_page_assemble(v, mip, x, y, whole, dst);
}
