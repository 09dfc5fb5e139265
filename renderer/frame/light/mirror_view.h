// mirror_view.h - planar mirrors of pictures in motion.
// Floor 4. Thread: the render thread; rays are made and taken apart on jobs.
//
// In the pause of a picture for its reflections (reflect_view.h) the planes are chosen that mirror
// most. Rays from their pixels, mirrored there, find what is seen by way of them: these are the
// rays of the camera mirrored at the plane, so what they meet is that camera's visibility buffer,
// from which the ordinary passes shade with textures, lights and shadow maps. In the mirrored scene
// surfaces mirror what probes say. Source: Akenine-Moller et al. 2018, "Real-Time Rendering",
// section 11.6.2 (the mirrored camera); rays in place of its rasterised picture need no clip plane.
#ifndef HG_RENDERER_FRAME_LIGHT_MIRROR_VIEW_H
#define HG_RENDERER_FRAME_LIGHT_MIRROR_VIEW_H

#include "renderer/gpu/gpu.h"
#include "renderer/reflect/mirror_planes.h"

struct hg_draw;

struct hg_mirror_stats { // of the newest picture
    uint32_t planes, rays;
    uint64_t ns;    // of the host
    uint64_t bytes; // of the mirrored pictures, and of what is kept to make them
};

// From one picture in motion to the next.
struct hg_mirror_view {
    struct hg_mirror_plane planes[HG_MIRROR_PLANES];
    uint32_t count;         // of the newest picture
    uint32_t width, height; // of the mirrored pictures, px
    struct hg_mirror_points points;
    // [rows][columns] of probe light. of: plane + 1, 0 = none; masks: bits of the planes that this
    // texel or one beside it shows.
    uint8_t *of, *masks;
    uint32_t *list;                  // pixels of one plane, those of a texel together
    uint32_t texels;                 // that there is memory for
    struct hg_gpu_buffer rays, hits; // of a part of the list
    struct hg_gpu_buffer pixels;     // of each plane ids, depths
    struct hg_mirror_stats stats;
};

void hg_mirror_view_finish(struct hg_gpu *gpu, struct hg_mirror_view *mirrors);
// Pixels along each side per ray of mirrors and clear glass, for a picture of that size: 1, 2 or 4.
uint32_t hg_mirror_view_step(VkExtent2D size);
// After the picture, before its motion vectors are made: pixels of planes move as what they mirror.
// depth, ids: of the samples, as of struct hg_temporal_picture; ids NULL: nothing moved by itself.
void hg_mirror_view_move(struct hg_draw *draw, float *depth, uint32_t *ids);

#endif
