// history.h - the frame before, for passes that look back (lib/history.glsl). Floor 0, shared by C
// and GLSL. Filled in where a pass of the frame wants it (renderer/frame/history.h).
#ifndef HG_SHADERS_SHARED_HISTORY_H
#define HG_SHADERS_SHARED_HISTORY_H

#include "shared/frame.h"

#define HG_HISTORY_CAMERA 1u // there is a previous frame
#define HG_HISTORY_POSE   2u // and it is known where everything was

struct hg_gpu_history {
    HG_STRUCT(hg_gpu_camera) camera;      // as it was, relative to the origin of this frame
    HG_STRUCT(hg_gpu_pose_snapshot) pose; // of nodes, skins and morphs: HG_HISTORY_POSE
    HG_VEC3 shift_ws;                     // to be added to positions of `pose`
    HG_UINT flags;                        // HG_HISTORY_*
    HG_VEC2 jitter_px;                    // of the last sample
    HG_UINT reserved[2];
};
HG_SHARED_SIZE(hg_gpu_history, 448);

#endif
