// walk.h - a walk through a scene, one picture a pose, and how its pictures are judged: against
// references, and against the pictures before after reprojection. Private to renderer/bench.
// Thread: one.
#ifndef HG_RENDERER_BENCH_WALK_H
#define HG_RENDERER_BENCH_WALK_H

#include "renderer/bench/bench.h"

#define HG_BENCH_WALK_POSES 60
#define HG_BENCH_WALK_EVERY 5

struct hg_bench_walk { // zeroed: none
    struct hg_scene *scene;
    float vfov_rad;
    struct hg_bench_pose line[HG_BENCH_WALK_POSES];
    const struct hg_bench_pose *path; // `line`, or the caller's
    uint32_t path_count, width, height;
    float **motion; // [path_count] of the poses that are compared: [height][width][3], px to the
                    // picture before, and whether it was seen there. NULL: not found
};

// The poses of `bench`, or as many through the longer axis of the scene. HG_E_NOMEM.
enum hg_status hg_bench_walk_init(struct hg_bench_walk *walk, struct hg_scene *scene,
    const struct hg_bench_settings *bench, struct hg_error *err) HG_MUST_CHECK;
void hg_bench_walk_finish(struct hg_bench_walk *walk); // accepts a zeroed one

// Every fifth pose is compared.
bool hg_bench_walk_is_compared(uint32_t pose);
enum hg_status hg_bench_walk_look(const struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, struct hg_error *err) HG_MUST_CHECK;
// One picture in motion as RGBA8.
enum hg_status hg_bench_walk_draw(const struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, struct hg_refbuf **picture, struct hg_error *err) HG_MUST_CHECK;
// The settled picture of a pose as RGBA8.
enum hg_status hg_bench_walk_settle(const struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, struct hg_refbuf **picture, struct hg_error *err) HG_MUST_CHECK;
// Walks until nothing is streamed or baked any more, at most two minutes.
enum hg_status hg_bench_walk_warm_up(
    const struct hg_bench_walk *walk, struct hg_view *view, struct hg_error *err) HG_MUST_CHECK;
// Where the pixels of a pose that is compared were at the pose before, from the depth of the newest
// picture: nothing moves but the camera. The view has parameter temporal AUTO. *depth_before: of
// the picture before, NULL at first; replaced; freed with hg_free in the end.
enum hg_status hg_bench_walk_find_motion(struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, float **depth_before, struct hg_error *err) HG_MUST_CHECK;

float hg_bench_luma(const uint8_t *rgba); // 0..1, of encoded values
// Of RGBA8 pictures of the walk's size. Mean change of luma where a pixel of the pose was a picture
// before, over those that were seen.
double hg_bench_walk_change(
    const struct hg_bench_walk *walk, uint32_t pose, const uint8_t *before, const uint8_t *now);
// Mean difference of luma, 0..1.
double hg_bench_walk_luma_error(
    const struct hg_bench_walk *walk, const uint8_t *truth, const uint8_t *picture);
// Mean FLIP. HG_E_NOMEM.
enum hg_status hg_bench_walk_flip(const struct hg_bench_walk *walk, uint8_t *truth,
    uint8_t *picture, double *flip, struct hg_error *err) HG_MUST_CHECK;

#endif
