// history.glsl - where things were in the frame before. Include lib/tables.glsl first.
#ifndef HG_LIB_HISTORY_GLSL
#define HG_LIB_HISTORY_GLSL

#include "shared/history.h"

layout(set = 0, binding = HG_BIND_HISTORY, scalar) uniform hg_history_block
{
    hg_gpu_history hg_history;
};

// Object to world of an instance a frame ago, in the world of this frame.
mat4x3 hg_previous_world(uint instance)
{
    if ((hg_history.flags & HG_HISTORY_POSE) == 0u)
        return hg_world_at(instance);
    mat4x3 world = hg_history.pose.worlds.v[instance];
    world[3] += hg_history.shift_ws;
    return world;
}

// Where a point of the world was seen by the camera a frame ago: clip space.
vec4 hg_previous_clip(vec3 position_ws)
{
    return hg_history.camera.view_proj * vec4(position_ws, 1.0);
}

#endif
