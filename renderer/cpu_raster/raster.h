// raster.h - triangles drawn by the host: which surface each pixel shows, and its depth.
// Floor 2 (geometry). Private to the room. Thread: one at a time; work is spread over jobs.
//
// For devices that draw in software. Their cost per triangle (vertices, setup and lists of tiles,
// much of it on one thread) is some ten times what a triangle of a pixel or so needs. Rules are
// those of Vulkan and the arithmetic is llvmpipe's, operation by operation: corners in single
// precision, snapped to 1/256 px, top-left rule, depth from a plane through the corners. Of
// surfaces at the same depth the first run is seen, and of a run the first triangle.
//
// The image is cut in tiles; a job draws one of them at a time, in two phases: runs that are
// expected to be seen, then those whose box is not behind what is there (Greene, Kass and Miller
// 1993, "Hierarchical Z-Buffer Visibility"). Phases change the cost and not the picture.
#ifndef HG_RENDERER_CPU_RASTER_RASTER_H
#define HG_RENDERER_CPU_RASTER_RASTER_H

#include "base/jobs.h"
#include "shaders/shared/types.h"

#define HG_RASTER_MOST_TRIANGLES 128u
#define HG_RASTER_MOST_SIDE      16384u // px
#define HG_RASTER_MOST_RUNS      (UINT32_MAX / HG_RASTER_MOST_TRIANGLES)

// Consecutive triangles of one draw, all of them inside of what hg_raster_takes allows.
struct hg_raster_run {
    const float *positions;        // of vertex 0, object space
    const uint32_t *indices;       // [count * 3]
    const struct hg_mat4x3 *world; // object to world
    float center[3], extent[3];    // box, object space
    uint32_t count;                // 1..HG_RASTER_MOST_TRIANGLES
    uint32_t draw, number;         // ids: of the draw, of the first triangle
    bool both_sides, mirrored;
    bool late; // second phase
};

// What is drawn of a picture, in draw order.
struct hg_raster_runs {
    const struct hg_raster_run *list;
    uint32_t count; // 0..HG_RASTER_MOST_RUNS
    uint8_t *marks; // [count] HG_RASTER_* are added
};

struct hg_raster_view {
    float view_proj[16], clip[4]; // clip = view_proj * (position - eye, 0) + clip
    float eye[3];
    uint32_t width, height; // px, 1..HG_RASTER_MOST_SIDE
};

struct hg_raster_target {
    uint32_t *ids; // [height][width][2] draw + 1, number of the triangle; 0, 0: nothing
    float *depth;  // [height][width] reversed; 0: nothing
};

// What became of a run, in any tile.
#define HG_RASTER_DRAWN 1u // its triangles were looked at
#define HG_RASTER_SEEN  2u // pixels show it

struct hg_raster; // memory between pictures

// portable: the plain kernel on every processor, for tests. HG_E_NOMEM as NULL.
struct hg_raster *hg_raster_create(bool portable) HG_MUST_CHECK;
void hg_raster_destroy(struct hg_raster *raster); // accepts NULL

// Rows of clip space from object space, for boxes.
struct hg_raster_rows {
    float m[4][4];
};
void hg_raster_open(
    const struct hg_raster_view *view, const struct hg_mat4x3 *world, struct hg_raster_rows *out);
// Whether a box lies in front of the eye, within the depth and not far outside of the image, so
// that the driver would cut no triangle in it, wherever samples lie in their pixels.
bool hg_raster_takes(const struct hg_raster_view *view, const struct hg_raster_rows *rows,
    const float center[3], const float extent[3]);
// Draws runs and marks them. jobs may be NULL. HG_E_NOMEM.
enum hg_status hg_raster_draw(struct hg_raster *raster, const struct hg_raster_view *view,
    const struct hg_raster_runs *runs, const struct hg_raster_target *target,
    struct hg_jobs *jobs) HG_MUST_CHECK;

#endif
