// path_motion.glsl - where what the camera sees was and will be in the picture.
//
// Include lib/path.glsl and lib/hit.glsl first.
#ifndef HG_LIB_PATH_MOTION_GLSL
#define HG_LIB_PATH_MOTION_GLSL

// Where a point of a triangle is at one of the block's moments; w = 1.
vec4 position_at(uint moment, hg_gpu_hit hit)
{
    uint triangle = hit.primitive;
    hg_gpu_draw d = hg_draw_at(hit.draw);
    hg_gpu_part part = hg_path.moments[moment].scene.parts.v[d.part];
    if (HG_HAS(HG_FEATURE_LOD) && (d.flags & HG_DRAW_LOD) != 0u) {
        part = hg_part_list(hg_part_at(d.part).indices).v[triangle >> HG_LOD_SHIFT];
        triangle &= (1u << HG_LOD_SHIFT) - 1u;
    }
    uint first = triangle * 3u;
    vec3 p0 = part.positions.v[part.indices.v[first]];
    vec3 p1 = part.positions.v[part.indices.v[first + 1u]];
    vec3 p2 = part.positions.v[part.indices.v[first + 2u]];
    mat4x3 world = hg_path.moments[moment].scene.worlds.v[d.instance];
    return vec4(hg_world_corner(world, p0) + mat3(world) * ((p1 - p0) * hit.u + (p2 - p0) * hit.v), 1.0);
}

// Place in the picture of a point (w = 1) or a direction (w = 0), px; false: not in front.
bool project(uint moment, vec4 at, out vec2 px)
{
    vec3 x = hg_path.moments[moment].ray_x_ws, y = hg_path.moments[moment].ray_y_ws;
    vec3 from = hg_path.moments[moment].ray_origin_ws, to = at.xyz;
    bool flat_view = hg_frame.camera.orthographic != 0u;
    float depth = 1.0;
    if (!flat_view) {
        to -= at.w * hg_path.moments[moment].eye_ws;
        depth = dot(to, hg_path.moments[moment].forward_ws);
        to /= max(depth, 1e-30);
    }
    px = vec2(dot(to - from, x) / dot(x, x), dot(to - from, y) / dot(y, y));
    return depth > 0.0 && (!flat_view || at.w > 0.0);
}

void put_motion(uint slot, vec4 before, vec4 now, vec4 after)
{
    uint at = hg_path_out(hg_path.planes[HG_PATH_PLANE_MOTION]);
    vec2 a, b, c;
    bool here = project(HG_PATH_NOW, now, b);
    vec2 back = here && project(HG_PATH_PREVIOUS, before, a) ? a - b : vec2(0.0);
    vec2 on = here && project(HG_PATH_NEXT, after, c) ? c - b : vec2(0.0);
    hg_path_set(at, slot, back.x);
    hg_path_set(at + 1u, slot, back.y);
    hg_path_set(at + 2u, slot, on.x);
    hg_path_set(at + 3u, slot, on.y);
}

#endif
