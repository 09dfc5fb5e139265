// work.h - one picture of reflections in the making. Floor 2, private to renderer/reflect.
//
// Smooth surfaces mirror texel by texel. What rough ones mirror is gathered in cells
// (renderer/irradiance).
#ifndef HG_RENDERER_REFLECT_WORK_H
#define HG_RENDERER_REFLECT_WORK_H

#include "renderer/reflect/filter.h"
#include "renderer/gi/patches.h"
#include "renderer/reflect/picture.h"

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
    struct hg_reflect_image image;
    struct hg_reflect_texel *texels;
    hg_reflect_sums *sums, *spare;
    struct hg_reflect_history before;
    uint32_t count; // texels; arrays [count] without other words
    struct hg_lobe_sample *samples;
    uint8_t *sources, *answers; // enum hg_reflect_source, hg_cache_answer
    uint32_t *waiting;          // texels that the cache has no light for
    struct hg_cache_place *places;
    uint32_t *smooth;            // [rows] texels that mirror
    uint32_t *row_counts;        // [rows] of them those that send
    struct hg_reflect_ask *asks; // [HG_REFLECT_MOST_LIT]
    uint32_t ask_count, ray_count;
    struct hg_gpu_buffer rays, hits, list;
    struct hg_gi_patches light;
    double origin[3]; // that the history is relative to
    struct hg_reflect_stats stats;
};

#define HG_REFLECT_MOST_LIT 8192 // surfaces that are lit for one picture
#define HG_REFLECT_PERIODS  3    // every picture, every second one, every fourth

struct hg_reflect_work {
    struct hg_reflect *r;
    const struct hg_reflect_picture *p;
    uint32_t *out;
    uint32_t sample;                 // number, of those of this picture
    float xi[HG_REFLECT_PERIODS][2]; // of a texel that sends so seldom
};

#endif
