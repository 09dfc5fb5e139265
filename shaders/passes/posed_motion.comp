// Where the surfaces of skinned and morphed parts were in the picture before (shared/posed_motion.h): one
// invocation per pixel of a rectangle that holds all of them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/pass_io.h"
#include "shared/posed_motion.h"

layout(local_size_x = HG_POSED_MOTION_GROUP, local_size_y = HG_POSED_MOTION_GROUP) in;

HG_POSED_MOTION_IO(HG_IO_DECLARE)

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_posed_motion push;
};

void main()
{
    uvec2 first = uvec2(push.first & 0xffffu, push.first >> 16);
    uvec2 size = uvec2(push.size & 0xffffu, push.size >> 16), at = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(at, size)))
        return;
    uvec2 pixel = first + at, id = texelFetch(hg_visibility, ivec2(pixel), 0).xy;
    vec3 was = vec3(0.0, 0.0, HG_POSED_MOTION_NONE);
    if (id.x != 0u) {
        hg_gpu_draw d = hg_draw_at(id.x - 1u);
        hg_gpu_part part = hg_part_at(d.part);
        hg_position_stream before = push.pose.parts.v[d.part].positions;
        // Parts that were not posed lead to the same positions as now.
        const uint others = HG_DRAW_LOD | HG_DRAW_POINTS | HG_DRAW_LINES;
        if ((d.flags & others) == 0u && uvec2(part.positions) != uvec2(before)) {
            uint i0 = part.indices.v[id.y * 3u], i1 = part.indices.v[id.y * 3u + 1u];
            uint i2 = part.indices.v[id.y * 3u + 2u];
            mat4x3 world = hg_world_at(d.instance);
            vec3 p0 = hg_relative_position(world, part.positions.v[i0]);
            vec3 p1 = hg_relative_position(world, part.positions.v[i1]);
            vec3 p2 = hg_relative_position(world, part.positions.v[i2]);
            vec2 ndc_per_px = 2.0 * hg_frame.inv_size;
            vec2 ndc = (vec2(pixel) + 0.5) * ndc_per_px - 1.0;
            vec3 c0 = hg_clip_position(p0).xyw, c1 = hg_clip_position(p1).xyw;
            vec3 b = hg_barycentrics_triangle(c0, c1, hg_clip_position(p2).xyw, ndc, ndc_per_px).at;
            mat4x3 world_before = push.pose.worlds.v[d.instance];
            vec3 place = before.v[i0] * b.x + before.v[i1] * b.y + before.v[i2] * b.z;
            vec3 relative = mat3(world_before) * place + (world_before[3] + push.to_eye);
            vec4 clip = push.rotated * vec4(relative, 0.0) + push.shift;
            if (clip.w > HG_POSED_MOTION_LEAST_W)
                was = clip.xyz / clip.w;
        }
    }
    push.target.v[at.y * size.x + at.x] = was;
}
