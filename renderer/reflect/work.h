// work.h - one picture of reflections in the making: two levels of texels, and the rays of both.
// Floor 2, private to renderer/reflect.
//
// Smooth surfaces mirror texel by texel. Rough ones mirror what is alike for their neighbours, too:
// of 2 x 2 texels (a block) one stands for all of them, another one in each turn, and what blocks
// have found goes back to their texels by surface in the end.
#ifndef HG_RENDERER_REFLECT_WORK_H
#define HG_RENDERER_REFLECT_WORK_H

#include "renderer/reflect/filter.h"
#include "renderer/gi/patches.h"
#include "renderer/reflect/picture.h"

enum { HG_REFLECT_TEXELS, HG_REFLECT_BLOCKS, HG_REFLECT_LEVELS };

struct hg_reflect_level {
    struct hg_reflect_image image;
    uint32_t first; // its texels' place among those of both
    struct hg_reflect_texel *texels;
    hg_reflect_sums *sums, *spare;
    struct hg_reflect_history before;
};

struct hg_reflect_ask { // of a texel that waits for light
    uint32_t texel;
    struct hg_cache_place place;
    bool cached; // the light is that of the place
    uint32_t point;
};

struct hg_reflect {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    uint32_t number; // of the picture
    struct hg_reflect_level levels[HG_REFLECT_LEVELS];
    uint32_t count; // texels of both levels; arrays [count] without other words
    struct hg_lobe_sample *samples;
    uint8_t *sources, *answers; // enum hg_reflect_source, hg_cache_answer
    uint32_t *chosen;           // [blocks] the texel that stands for it
    uint32_t *waiting;          // texels that the cache has no light for
    struct hg_cache_place *places;
    uint32_t *smooth;            // [rows of texels] that mirror by themselves
    uint32_t *row_counts;        // [rows of blocks]
    struct hg_reflect_ask *asks; // [HG_REFLECT_MOST_LIT]
    uint32_t ask_count, ray_count;
    float *planes; // [HG_REFLECT_PLANES][rows + 2][columns + 2] of blocks: spread.c
    struct hg_gpu_buffer rays, hits, list;
    struct hg_gi_patches light;
    double origin[3]; // that the history is relative to
    struct hg_reflect_stats stats;
};

#define HG_REFLECT_PLANES   13
#define HG_REFLECT_MOST_LIT 8192 // surfaces that are lit for one picture
#define HG_REFLECT_PERIODS  5    // every picture, every second one, every fourth and so on

struct hg_reflect_work {
    struct hg_reflect *r;
    const struct hg_reflect_picture *p;
    uint32_t *out;
    uint32_t sample;                 // number, of those of this picture
    float xi[HG_REFLECT_PERIODS][2]; // of a texel that sends so seldom
};

static inline struct hg_reflect_texel *hg_reflect_texel_at(const struct hg_reflect *r, size_t i)
{
    const struct hg_reflect_level *l = &r->levels[i >= r->levels[HG_REFLECT_BLOCKS].first];
    return &l->texels[i - l->first];
}

#endif
