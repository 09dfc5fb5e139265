// shadow.glsl - vertices of shadow maps. Include lib/frame.glsl and lib/vertex.glsl first.
#ifndef HG_LIB_SHADOW_GLSL
#define HG_LIB_SHADOW_GLSL

layout(push_constant, scalar) uniform hg_shadow_push
{
    mat4 view_proj; // struct hg_shadow_map of renderer/light/lighting.h
} hg_push;

vec4 hg_shadow_position(uint draw, uint vertex)
{
    hg_gpu_draw d = HG_GEOMETRY.draws.v[draw];
    vec3 p = HG_GEOMETRY.parts.v[d.part].positions.v[vertex];
    vec3 world = HG_GEOMETRY.instances.v[d.instance].world * vec4(p, 1.0);
    return hg_push.view_proj * vec4(world, 1.0);
}

#endif
