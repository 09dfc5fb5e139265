// prefetch.h - pages that a moving camera will need soon.
// Floor 4. Thread: the render thread.
//
// From two changes of the camera that agree follows where it will be a moment from now, in a
// straight line and with its turn going on. From there a picture of an eighth of the size, and 1.3
// times as wide, is drawn now and then, and what it lacks is read behind everything that pictures
// lack already. It takes a small share of the time, and fills at most half of what no picture uses.
#ifndef HG_RENDERER_FRAME_PREFETCH_H
#define HG_RENDERER_FRAME_PREFETCH_H

#include "renderer/frame/draw.h"

// Where a camera was, and when.
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
    // What its pictures are drawn with.
    struct hg_culling *visible;
    struct hg_view_targets targets;
    struct hg_gpu_frame frame;
};

void hg_prefetch_finish(struct hg_gpu *gpu, struct hg_prefetch *ahead); // accepts a zeroed one
// Where it will be after horizon_ns, or two more changes. False when the camera does not move
// steadily, as after a jump. Pure.
bool hg_prefetch_predict(const struct hg_prefetch_place places[3], uint64_t horizon_ns,
    struct hg_view_camera_state *camera);
// After a picture in motion, which was drawn like that: takes note of the camera, and may draw.
// revision: of the camera, another one when it has changed.
enum hg_status hg_prefetch_draw(struct hg_prefetch *ahead, const struct hg_draw *draw,
    uint64_t revision, struct hg_error *err) HG_MUST_CHECK;

#endif
