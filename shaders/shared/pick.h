// pick.h - what passes/pick.comp says about a pixel. Floor 0, shared by C and GLSL.
#ifndef HG_SHADERS_SHARED_PICK_H
#define HG_SHADERS_SHARED_PICK_H

#include "shared/types.h"

struct hg_gpu_pick {
    HG_VEC3 position_ws; // relative to the origin of the geometry room
    HG_FLOAT distance;   // from the eye (orthographic: from its plane), metres
    HG_VEC3 normal_ws;   // shading normal on the eye's side, unit
    HG_UINT draw_plus_one; // 0 = nothing there
    HG_VEC2 uv;
    HG_UINT triangle;
    HG_FLOAT depth;        // along the view direction, metres
};
HG_SHARED_SIZE(hg_gpu_pick, 48);

#endif
