// shadow.glsl - vertices of shadow maps. Include lib/frame.glsl and lib/vertex.glsl first.
#ifndef HG_LIB_SHADOW_GLSL
#define HG_LIB_SHADOW_GLSL

#include "shared/cluster.h"

layout(push_constant, scalar) uniform hg_shadow_push
{
    mat4 view_proj;              // struct hg_shadow_map of renderer/light/lighting.h
    hg_position_stream positions; // of the part or chunk that is drawn
    hg_vertex_stream vertices;
    hg_word_stream extra;
    vec2 corner_px; // of the map in the atlas
} hg_push;

vec4 hg_shadow_position(uint draw, uint vertex)
{
    hg_gpu_draw d = hg_draw_at(draw);
    vec3 p = hg_push.positions.v[vertex];
    vec3 world = hg_world_at(d.instance) * vec4(p, 1.0);
    return hg_push.view_proj * vec4(world, 1.0);
}

#endif
