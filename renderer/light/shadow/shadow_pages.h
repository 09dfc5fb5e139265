// shadow_pages.h - what one view sees of a sun's shadow in pictures in motion: a virtual shadow
// map. Floor 2 (light). Pure host code. Thread: the render thread.
//
// Levels of a clipmap share the projection of the map of the whole scene and are finer than it,
// each with texels of half the size of the next. They are cut into pages; those that surfaces of
// the picture before asked for are drawn, a few in a picture, into the pool of the atlas
// (shadow_pool.h), where other views find them, too. Each level has a window of pages about the
// camera, toroidally. What has no page yet is looked up in a coarser one, in the end in the map of
// the whole scene. Source: Lefohn, Sengupta and Owens 2007, "Resolution-Matched Shadow Maps" (pages
// by request); Tanner et al. 1998, "The Clipmap" (levels, toroidal windows).
#ifndef HG_RENDERER_LIGHT_SHADOW_SHADOW_PAGES_H
#define HG_RENDERER_LIGHT_SHADOW_SHADOW_PAGES_H

#include "renderer/light/shadow/shadow_pool.h"

struct hg_shadow_page_found {
    struct hg_shadow_page page;
    uint32_t slot;   // of the pool
    uint32_t wanted; // level that the surface wants; HG_SHADOW_PAGE_LEVELS: the whole map will do
};

// What surfaces asked for at one place of a level's window: the page that most asked for.
struct hg_shadow_page_request {
    int32_t x, y;
    uint32_t count; // 0: nothing
};

// Zero-initialise.
struct hg_shadow_pages {
    const void *view;            // whose they are
    struct hg_shadow_pool *pool; // of the picture that was planned last, until the next plan of any
                                 // view; NULL: none
    struct hg_gpu_shadow whole;  // projection that the requests belong to
    float eye[2];                // place of the camera, in the plane of the projection
    float per_depth, constant;   // texels for a surface: metres per metre of view depth; metres
    struct hg_shadow_page_request requests[HG_SHADOW_PAGE_LEVELS]
                                          [HG_SHADOW_PAGE_WINDOW * HG_SHADOW_PAGE_WINDOW];
    uint32_t table[HG_SHADOW_PAGE_WORDS]; // as shaders read it
    struct hg_shadow_page_stats stats;
};

// The pool of this picture, which has begun (hg_shadow_pool_begin), and what the camera needs.
// NULL: there is none. Requests for another projection are forgotten.
void hg_shadow_pages_begin(
    struct hg_shadow_pages *pages, struct hg_shadow_pool *pool, const struct hg_gpu_camera *camera);
// Chooses what is drawn in this picture, most asked for first: writes maps to draw,
// [HG_SHADOW_FRESH_PAGES], and returns how many; they stay where they are until the pool has noted
// what became of them. The table holds them.
uint32_t hg_shadow_pages_plan(struct hg_shadow_pages *pages, struct hg_shadow_map *maps);
// Replaces the requests by those of a picture: its reversed depth, [height][width], of the camera
// that drew it.
void hg_shadow_pages_see(struct hg_shadow_pages *pages, const struct hg_gpu_camera *camera,
    const struct hg_shadow_depth *depth);

// Share of what a picture shows where texels of the whole map are several times as large as a
// pixel.
float hg_shadow_pages_share(
    float whole_texel, const struct hg_gpu_camera *camera, const struct hg_shadow_depth *depth);

// What a surface looks up, as shaders do: its page, or that of a coarser level. False: the map of
// the whole scene.
bool hg_shadow_pages_find(const struct hg_shadow_pages *pages, const float position[3],
    float view_depth, struct hg_shadow_page_found *out);
// As hg_lighting_page_color.
void hg_shadow_pages_color(const struct hg_shadow_pages *pages, const struct hg_gpu_camera *camera,
    const struct hg_shadow_depth *depth, const uint32_t pixel[2], uint8_t out[4]);
// All but `table`, `first` and `shadow`.
void hg_shadow_pages_fill(const struct hg_shadow_pages *pages, struct hg_gpu_shadow_pages *out);

#endif
