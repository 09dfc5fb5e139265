// pages.h - how a mip chain is cut into pages. Floor 2 (texture). Pure: any thread.
// The layout is that of shaders/shared/texture.h.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGES_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGES_H

#include "renderer/scene/scene.h"
#include "renderer/texture/source/mips.h"
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
// Pages across a side of a mip.
uint32_t hg_pages_across(uint32_t side, uint32_t mip);
// Number of a page: mip by mip, row by row, the tail page (mip == tail, x and y 0) last; UINT32_MAX
// when there is no such page. And back; returns the mip.
uint32_t hg_page_number(const struct hg_page_layout *layout, uint32_t mip, uint32_t x, uint32_t y);
uint32_t hg_page_find(const struct hg_page_layout *layout, uint32_t page, uint32_t *x, uint32_t *y);
// Place in the page table of a page of a mip (mip == tail, x and y 0: the tail page), relative to
// the texture's first entry: below layout->entries.
uint32_t hg_page_entry(const struct hg_page_layout *layout, uint32_t mip, uint32_t x, uint32_t y);
// Fields of hg_gpu_texture.bits that the layout decides.
uint32_t hg_page_layout_bits(const struct hg_page_layout *layout);

// How the texels of mips become pages.
struct hg_page_view {
    const struct hg_page_layout *layout;
    enum hg_wrap wrap_s, wrap_t;
    uint32_t texel_bytes;
    const uint8_t (*alpha)[256]; // [layout->mips] tables for the alpha of RGBA8, or NULL
};

// One page to be read.
struct hg_page_request {
    const struct hg_page_view *view;
    uint32_t mip, x, y; // mip == layout.tail (x, y 0): the tail page
    void *texels;       // out: HG_PAGE_PITCH^2 texels, as hg_page_take makes them
    uint64_t bytes;     // out: read from the store, or decoded from a file
};

// Texels of a mip that are at hand.
struct hg_page_part {
    const uint8_t *texels;
    size_t pitch_bytes;
    uint32_t x, y, width, height; // in texels of the mip
};

// One page with its border: HG_PAGE_PITCH^2 texels into dst. Border texels are those that the wrap
// modes put there; what no filter reads (more than HG_PAGE_BORDER beyond the edge) is 0.
//   parts[0] the page's own texels and those of its border that lie inside the mip
//   parts[1] columns of the other edge that REPEAT asks for, parts[2] rows, parts[3] both; not read
//            when parts[0] has them. x range as [1] or [0], y range as [2] or [0]
void hg_page_assemble(const struct hg_page_view *view, uint32_t mip, uint32_t x, uint32_t y,
    const struct hg_page_part parts[4], void *dst);
// The tail page from the texels of its mips, rows tight.
void hg_page_assemble_tail(
    const struct hg_page_view *view, const uint8_t *const levels[HG_MIPS_MAX], void *dst);
// One page (mip == tail: the tail page) from a chain in memory.
void hg_page_take(const struct hg_page_view *view, const struct hg_mips *mips, uint32_t mip,
    uint32_t x, uint32_t y, void *dst);

#endif
