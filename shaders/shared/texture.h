// texture.h - how shaders find texels: textures, their page table and the page pools.
// Floor 0, shared by C and GLSL (scalar layout).
//
// A texture is a mip chain cut into pages of HG_PAGE_TEXELS^2. Pages live in slots of a pool, a 2D
// array image whose layers hold a square of slots of HG_PAGE_PITCH^2 texels: the
// payload and a border of HG_PAGE_BORDER texels on each side, filled across the texture's edges as
// its wrap modes ask, so that hardware filtering inside one slot is right everywhere.
//
// The page table of a texture is a pyramid of square grids, 2^k x 2^k entries for mip 0, then
// 2^(k-1), ..., where 2^k pages cover the longer side; then one entry for the tail. The tail page
// holds all mips from `tail` on (both sides <= HG_TAIL_TEXELS), at the places of HG_TAIL_X/Y.
// An entry is the place of a slot, layer << 8 | row << 4 | column, and in its upper
// bits how many mips the page in that slot is coarser than the one asked for: the entry of a page
// that is not resident names its finest resident ancestor, so that one lookup always finds texels.
// While not even the tail is there, it names a slot of one colour (HG_PAGE_NOTHING mips coarser).
//
// Feedback: two words per entry. Shaders add 1 to the first one for each lookup of a sample that did
// not get all its texels from the mips it asked for, and to the second one for lookups of some
// samples (one of 64 pixels), so that what is in use is known.
#ifndef HG_SHADERS_SHARED_TEXTURE_H
#define HG_SHADERS_SHARED_TEXTURE_H

#include "shared/types.h"

#define HG_PAGE_TEXELS 128 // payload, a power of two
#define HG_PAGE_BORDER 2   // bilinear needs 1; 2 keeps the pitch a multiple of 4 (block formats)
#define HG_PAGE_PITCH  132 // payload and both borders

// Sides of layers are powers of two, so that a place in a page, rounded to HG_POOL_STEP texels, has
// exact coordinates in every slot: filtering gives the same bits wherever a page lies.
#define HG_POOL_SIDE       2048 // RGBA8: 15 x 15 slots
#define HG_POOL_SLOTS      15
#define HG_POOL_SMALL_SIDE  1024 // where the budget holds no more: 7 x 7 (HG_FEATURE_SMALL_LAYERS)
#define HG_POOL_SMALL_SLOTS 7
#define HG_POOL_HALF_SIDE  1024 // RGBA16F: 7 x 7 slots
#define HG_POOL_HALF_SLOTS 7
#define HG_POOL_ROUND      2048.0 // floats of this size have a last place of HG_POOL_STEP: 1 / 4096
#define HG_TAIL_TEXELS 64
#define HG_PAGE_SLOT_MASK    0x00ffffffu
#define HG_PAGE_COARSER_SHIFT 24
#define HG_PAGE_NOTHING       31u // coarser than any mip

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
#define HG_TEX_WIDTH_17     0x04000000u // bit 16 of width - 1 and of height - 1 (HG_FEATURE_WIDE)
#define HG_TEX_HEIGHT_17    0x08000000u

#define HG_TEX_WRAP_REPEAT 0 // as enum hg_wrap
#define HG_TEX_WRAP_CLAMP  1
#define HG_TEX_WRAP_MIRROR 2

#define HG_TEXTURE_NONE 0xffffffffu // samples as white

struct hg_gpu_texture {
    HG_UINT size;  // (width - 1) | (height - 1) << 16, texels; their low 16 bits
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
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_page_feedback {
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_pixel_progress {
    uint v[];
};
#endif

// What a pass does with samples that got coarser texels than they asked for.
#define HG_TEXTURES_SHOW  0u // shows them
#define HG_TEXTURES_EXACT 1u // leaves them out; the pixel's progress says which samples it has

// The first entry of the table belongs to no texture; its feedback counts what shadow maps missed.
#define HG_FEEDBACK_SHADOWS 0

// A pixel's progress: samples it has (all of its first ones), and in the upper bits the run in which
// a pass in front of shading got coarser texels there.
#define HG_PROGRESS_SAMPLES_MASK 0x0001ffffu
#define HG_PROGRESS_RUN_SHIFT    17
#define HG_PROGRESS_RUNS         0x7fffu

// Part of hg_gpu_frame.
struct hg_gpu_textures {
    HG_PTR(hg_texture_list) list; // [count]
    HG_PTR(hg_page_table) table;  // [entries]
    HG_PTR(hg_page_feedback) feedback;   // [2 * entries]
    HG_PTR(hg_pixel_progress) progress;  // [height][width] of the view
    HG_UINT count;
    HG_FLOAT pool_scale; // HG_POOL_SIDE / the side of the layers of RGBA8 pages
    HG_UINT unused_0;
    HG_UINT unused_1;
    HG_UINT mode;    // HG_TEXTURES_*
    HG_UINT run;     // of a sample, 1..HG_PROGRESS_RUNS
    HG_UINT lottery; // pixels that tell what they use: x & 7 | (y & 7) << 3
    HG_FLOAT bias;   // mips, 0 unless the pools are too small for what is in view
    HG_STRUCT(hg_gpu_texture) background; // image of the environment, bits 0 = none
    HG_FLOAT background_lod; // mip of which a texel is as high as a pixel in the picture's middle
};
HG_SHARED_SIZE(hg_gpu_textures, 80);

#endif
