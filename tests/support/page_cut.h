// page_cut.h - pages of a texture by their number, cut from a chain in memory.
#ifndef HG_TESTS_SUPPORT_PAGE_CUT_H
#define HG_TESTS_SUPPORT_PAGE_CUT_H

#include "renderer/texture/source/pages.h"

// dst: HG_PAGE_PITCH^2 texels, alpha as it is.
static inline void page_cut(const struct hg_page_layout *layout, const struct hg_mips *mips,
    uint32_t page, const enum hg_wrap wrap[2], void *dst)
{
    const struct hg_page_view view = {
        .layout = layout, .wrap_s = wrap[0], .wrap_t = wrap[1], .texel_bytes = mips->texel_bytes};
    uint32_t x, y;
    const uint32_t mip = hg_page_find(layout, page, &x, &y);
    hg_page_take(&view, mips, mip, x, y, dst);
}

#endif
