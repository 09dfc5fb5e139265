// pages.h - how a mip chain is cut into pages. Floor 2 (texture). Pure: any thread.
// The layout is that of shaders/shared/texture.h.
#ifndef HG_RENDERER_TEXTURE_PAGES_H
#define HG_RENDERER_TEXTURE_PAGES_H

#include "renderer/scene/scene.h"
#include "renderer/texture/mips.h"
#include "shaders/shared/texture.h"

struct hg_page_layout {
    uint32_t width, height, mips;
    uint32_t grid_log2; // k: 2^k x 2^k entries for mip 0
    uint32_t tail;      // first mip of the tail page
    uint32_t pages;     // that exist: those of mips 0..tail-1, row by row, then the tail
    uint32_t entries;   // of the page table; those without a page are never read
};

// width, height: 1..131072.
struct hg_page_layout hg_page_layout_of(uint32_t width, uint32_t height);
// Place of a page in the table, relative to the texture's first entry.
uint32_t hg_page_entry(const struct hg_page_layout *layout, uint32_t page);
// Fields of hg_gpu_texture.bits that the layout decides.
uint32_t hg_page_layout_bits(const struct hg_page_layout *layout);

// Texels of page `page` with its border: HG_PAGE_PITCH^2 texels of mips->texel_bytes into dst.
// Border texels are those that the wrap modes put there; what no filter reads is 0 or repeats.
void hg_page_cut(const struct hg_page_layout *layout, const struct hg_mips *mips, uint32_t page,
    enum hg_wrap wrap_s, enum hg_wrap wrap_t, void *dst);

#endif
