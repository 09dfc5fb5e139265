// posed_motion.h - where posed surfaces were in the picture before (passes/posed_motion.comp).
// Floor 0, shared by C and GLSL.
#ifndef HG_SHADERS_SHARED_POSED_MOTION_H
#define HG_SHADERS_SHARED_POSED_MOTION_H

#include "shared/geometry.h"

#define HG_POSED_MOTION_GROUP   8     // invocations along each side
#define HG_POSED_MOTION_LEAST_W 1e-7f // nearer to the plane of the eye nothing was seen
#define HG_POSED_MOTION_NONE    -1.0f // depth of what is not posed, or was not to be seen

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer hg_posed_motion_out {
    vec3 v[]; // [rows][columns] NDC of the picture before: x, y, depth
};
#endif
struct hg_gpu_posed_motion {
    HG_PTR(hg_posed_motion_out) target;
    HG_STRUCT(hg_gpu_pose_snapshot) pose; // of the picture before
    HG_MAT4 rotated;     // its camera: relative to the eye, all but the last column, to clip space
    HG_VEC4 shift;       // the last column of its projection
    HG_VEC3 to_eye;      // to be added to positions of `pose`: relative to the eye of then
    HG_UINT first, size; // of the rectangle, px: x and y in 16 bits each
    HG_UINT reserved;
};
HG_SHARED_SIZE(hg_gpu_posed_motion, 128);

#endif
