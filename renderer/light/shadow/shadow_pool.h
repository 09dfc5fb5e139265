// shadow_pool.h - the pages of a sun's virtual shadow map that an atlas holds, for all views of its
// scene.
// Floor 2 (light). Pure host code. Thread: the render thread.
//
// Pages count along right and up of the projection of the map of the whole scene, from its origin,
// so that views with cameras near each other want the same ones. They stay until something moves
// over them or another page needs the place longest unused. Views that want more than there is have
// equal parts.
#ifndef HG_RENDERER_LIGHT_SHADOW_SHADOW_POOL_H
#define HG_RENDERER_LIGHT_SHADOW_SHADOW_POOL_H

#include "renderer/light/lighting.h"

#define HG_SHADOW_POOL_SIDE_PX    2048
#define HG_SHADOW_POOL_MOST_PAGES 256
#define HG_SHADOW_FRESH_PAGES     16 // drawn in a picture, at most

// Level 0 has the finest texels.
struct hg_shadow_page {
    int32_t x, y;
    uint32_t level;
    uint32_t wanted; // picture that asked for it last
    const void *by;  // view of that picture
    bool taken;      // false: free
};

// Zero-initialise.
struct hg_shadow_pool {
    struct hg_gpu_shadow whole; // projection that the pages belong to
    struct hg_vec2 rect_px;     // in the atlas
    uint32_t side;              // pages in a row; 0: there is no pool
    struct hg_shadow_page pages[HG_SHADOW_POOL_MOST_PAGES];
    uint16_t
        first[HG_SHADOW_POOL_MOST_PAGES]; // by hash of its place: number of a page + 1; 0: none
    uint16_t next[HG_SHADOW_POOL_MOST_PAGES];
    uint32_t picture; // counts planned pictures, of all views
    struct {
        const struct hg_shadow_map *maps; // [count], of a view's plan; NULL: nothing is due
        uint32_t count;
        uint32_t order[HG_SHADOW_FRESH_PAGES]; // their pages
    } due;                                     // of the picture that was planned last
};

// Of the map of the whole scene, in metres.
float hg_shadow_page_texel(const struct hg_gpu_shadow *whole, uint32_t level);
// Metres of a side of a page, without its border.
float hg_shadow_page_side(const struct hg_gpu_shadow *whole, uint32_t level);
// In the plane of the projection, from its origin.
void hg_shadow_page_plane(const struct hg_gpu_shadow *whole, const float position[3], float out[2]);

// A picture is planned, in a pool as placed in the atlas. Pages of another projection or place are
// forgotten.
void hg_shadow_pool_begin(struct hg_shadow_pool *pool, const struct hg_gpu_shadow *place,
    const struct hg_gpu_shadow *whole);
// Nothing is known of the atlas.
void hg_shadow_pool_forget(struct hg_shadow_pool *pool);
// Casters moved within a box: pages that it may cover are no longer held.
void hg_shadow_pool_touch(struct hg_shadow_pool *pool, const struct hg_box *casters);
// What became of the maps that are due: stale ones are not held.
void hg_shadow_pool_note(struct hg_shadow_pool *pool);

// Another view than this one has wanted pages of late.
bool hg_shadow_pool_serves_others(const struct hg_shadow_pool *pool, const void *view);
// The page that is held; NULL: it is not.
struct hg_shadow_page *hg_shadow_pool_find(
    struct hg_shadow_pool *pool, uint32_t level, int32_t x, int32_t y);
// Gives a page a place that this picture does not want, and the map that draws it; *evicted counts
// pages that made room. False: there is no place.
bool hg_shadow_pool_take(struct hg_shadow_pool *pool, const struct hg_shadow_page *wanted,
    struct hg_shadow_map *map, uint32_t *evicted);

#endif
