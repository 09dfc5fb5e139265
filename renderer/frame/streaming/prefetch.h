// prefetch.h - pages that a moving camera will need soon.
// Floor 4. Thread: the render thread.
//
// Two consistent camera changes predict its next position by linear extrapolation of place and
// rotation. From there a picture of 1/8 size with 1.3 times the field of view is drawn now and
// then; its missing pages are loaded with lower priority than those of displayed pictures. Prefetch
// takes a small share of the time, half of that while nothing is missing, and at most half of the
// unused slots.
#ifndef HG_RENDERER_FRAME_STREAMING_PREFETCH_H
#define HG_RENDERER_FRAME_STREAMING_PREFETCH_H

#include "renderer/frame/draw.h"

// Camera position at a time.
struct hg_prefetch_place {
    double eye[3], direction[3], up[3]; // direction, up: of unit length
    double distance;                    // to the target
    uint64_t ns;
};

struct hg_prefetch {
    struct hg_prefetch_place places[3]; // of the newest changes, the last one first
    uint32_t place_count;
    uint64_t revision; // of the camera, of the last place
    uint64_t begun_ns; // the newest picture; 0 = none
    uint64_t next_ns;  // not before
    uint32_t drawn;    // pictures, since creation
    // Resources of its pictures.
    struct hg_culling *culling;
    struct hg_view_targets targets;
    struct hg_gpu_frame frame;
};

void hg_prefetch_finish(struct hg_gpu *gpu, struct hg_prefetch *prefetch); // accepts a zeroed one
// Predicts the camera after horizon_ns, or two more changes. False when the camera does not move
// steadily, as after a jump. Pure.
bool hg_prefetch_predict(const struct hg_prefetch_place places[3], uint64_t horizon_ns,
    struct hg_view_camera_state *camera);
// After a picture in motion: records the camera, and may draw a prefetch picture. revision: of the
// camera, differs when it has changed.
enum hg_status hg_prefetch_draw(struct hg_prefetch *prefetch, const struct hg_draw *draw,
    uint64_t revision, struct hg_error *err) HG_MUST_CHECK;

#endif
