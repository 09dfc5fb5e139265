// texture.h - how shaders find texels: textures, their page table and the page pools.
// Floor 0, shared by C and GLSL (scalar layout).
//
// A texture is a mip chain cut into pages of HG_PAGE_TEXELS^2. Pages live in slots of a pool, a 2D
// array image whose layers hold HG_POOL_SLOTS x HG_POOL_SLOTS slots of HG_PAGE_PITCH^2 texels: the
// payload and a border of HG_PAGE_BORDER texels on each side, filled across the texture's edges as
// its wrap modes ask, so that hardware filtering inside one slot is right everywhere.
//
// The page table of a texture is a pyramid of square grids, 2^k x 2^k entries for mip 0, then
// 2^(k-1), ..., where 2^k pages cover the longer side; then one entry for the tail. The tail page
// holds all mips from `tail` on (both sides <= HG_TAIL_TEXELS), at the places of HG_TAIL_X/Y.
// An entry is a slot number: layer * HG_POOL_SLOTS^2 + row * HG_POOL_SLOTS + column. The upper
// 8 bits are 0 while all pages are resident.
#ifndef HG_SHADERS_SHARED_TEXTURE_H
#define HG_SHADERS_SHARED_TEXTURE_H

#include "shared/types.h"

#define HG_PAGE_TEXELS 128 // payload, a power of two
#define HG_PAGE_BORDER 2   // bilinear needs 1; 2 keeps the pitch a multiple of 4 (block formats)
#define HG_PAGE_PITCH  132 // payload and both borders
#define HG_POOL_SLOTS  8   // slots per side of a layer, a power of two
#define HG_POOL_SIDE   1056
#define HG_TAIL_TEXELS 64
#define HG_PAGE_SLOT_MASK 0x00ffffffu

// Corner (border included) of the j-th mip of the tail in its page. Each mip takes at most
// (64 >> j) + 4 texels: the first fills a column, the others are stacked in a second one.
#define HG_TAIL_X(j) ((j) == 0 ? 0 : 68)
#define HG_TAIL_Y(j) ((j) == 0 ? 0 : 64 - (128 >> (j)) + 4 * ((j)-1))

#define HG_POOL_SRGB   0
#define HG_POOL_LINEAR 1
#define HG_POOL_FLOAT  2
#define HG_POOL_COUNT  3

// hg_gpu_texture.bits
#define HG_TEX_MIPS_SHIFT   0  // 5 bits: number of mips, 1..17
#define HG_TEX_GRID_SHIFT   5  // 4 bits: k
#define HG_TEX_TAIL_SHIFT   9  // 4 bits: first mip of the tail
#define HG_TEX_WRAP_S_SHIFT 13 // 2 bits: HG_TEX_WRAP_*
#define HG_TEX_WRAP_T_SHIFT 15 // 2 bits
#define HG_TEX_POOL_SHIFT   17 // 2 bits: HG_POOL_*
#define HG_TEX_MAG_NEAREST  0x00080000u
#define HG_TEX_MIN_NEAREST  0x00100000u
#define HG_TEX_MIP_NEAREST  0x00200000u
#define HG_TEX_MIP_NONE     0x00400000u
#define HG_TEX_UV1          0x00800000u // material slots: second uv set
#define HG_TEX_TRANSFORM    0x01000000u // material slots: has a uv transform
#define HG_TEX_PRESENT      0x02000000u

#define HG_TEX_WRAP_REPEAT 0 // as enum hg_wrap
#define HG_TEX_WRAP_CLAMP  1
#define HG_TEX_WRAP_MIRROR 2

#define HG_TEXTURE_NONE 0xffffffffu // samples as white

struct hg_gpu_texture {
    HG_UINT size;  // (width - 1) | (height - 1) << 16, texels
    HG_UINT bits;  // HG_TEX_*
    HG_UINT table; // first entry in the page table
};
HG_SHARED_SIZE(hg_gpu_texture, 12);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_texture_list {
    hg_gpu_texture v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_page_table {
    uint v[];
};
#endif

// Part of hg_gpu_frame.
struct hg_gpu_textures {
    HG_PTR(hg_texture_list) list; // [count]
    HG_PTR(hg_page_table) table;  // [entries]
    HG_UINT count;
    HG_UINT layers[HG_POOL_COUNT]; // of each pool, 0 = none
};
HG_SHARED_SIZE(hg_gpu_textures, 32);

#endif
