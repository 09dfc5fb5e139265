// path.glsl - what the kernels of path tracing have in common: the block of the wave, words of
// state, footprints, random numbers. Include lib/frame.glsl first.
#ifndef HG_LIB_PATH_GLSL
#define HG_LIB_PATH_GLSL

#include "lib/octahedral.glsl"
#include "lib/tables.glsl"
#include "lib/sobol.glsl"
#include "shared/path.h"

// Mesa 22.3 makes words of uniform blocks that branches depend on constants of the shader, and
// writes beyond its own table of them when they are those of this block. It leaves out what has no
// constant offset: the block is the first of an array, by an index that only the host knows.
layout(set = 0, binding = HG_BIND_PATH, scalar) uniform hg_path_block
{
    hg_gpu_path hg_path_blocks[2];
};
layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_path_push push;
};
#define hg_path hg_path_blocks[push.block]

layout(constant_id = 3) const uint hg_path_options = 0u;
#define HG_PATH_CAN(option) ((hg_path_options & (option)) != 0u)

float hg_path_get(uint word, uint slot)
{
    return hg_path.state.v[word * hg_path.capacity + slot];
}

vec3 hg_path_get3(uint word, uint slot)
{
    return vec3(hg_path_get(word, slot), hg_path_get(word + 1u, slot), hg_path_get(word + 2u, slot));
}

void hg_path_set(uint word, uint slot, float value)
{
    hg_path.state.v[word * hg_path.capacity + slot] = value;
}

void hg_path_set3(uint word, uint slot, vec3 value)
{
    hg_path_set(word, slot, value.x);
    hg_path_set(word + 1u, slot, value.y);
    hg_path_set(word + 2u, slot, value.z);
}

void hg_path_add3(uint word, uint slot, vec3 value)
{
    hg_path_set3(word, slot, hg_path_get3(word, slot) + value);
}

void hg_path_add(uint word, uint slot, float value)
{
    hg_path_set(word, slot, hg_path_get(word, slot) + value);
}

// Two positive floats of 8 digits.
float hg_path_pack_cone(float width, float spread)
{
    return uintBitsToFloat((floatBitsToUint(width) & 0xffff0000u) | (floatBitsToUint(spread) >> 16u));
}

vec2 hg_path_unpack_cone(float word)
{
    uint bits = floatBitsToUint(word);
    return uintBitsToFloat(uvec2(bits & 0xffff0000u, bits << 16u));
}

uvec2 hg_path_pixel(uint slot)
{
    uint tile = hg_path.tiles.v[slot / HG_PATH_TILE_PX], i = slot % HG_PATH_TILE_PX;
    uvec2 p = uvec2(i, i >> 1u) & 0x55u; // even bits: x, odd bits: y
    p = (p | (p >> 1u)) & 0x33u;
    p = (p | (p >> 2u)) & 0x0fu;
    return uvec2(tile & 0xffffu, tile >> 16u) * HG_PATH_TILE_SIDE + p;
}

uint hg_path_sample(uint slot)
{
    return hg_path.tile_samples.v[slot / HG_PATH_TILE_PX];
}

// Pairs of random numbers: the camera uses the first HG_PATH_CAMERA_PAIRS, each step of a path as
// many as HG_PATH_STEP_PAIRS.
#define HG_PATH_CAMERA_PAIRS 2u
#define HG_PATH_STEP_PAIRS   4u
#define HG_PATH_TIME_PAIR    0xfff0u // one of its own, so that the others do not depend on it

// Of the camera.
hg_sampler hg_path_sampler(uvec2 pixel, uint number)
{
    return hg_sampler_make(pixel, number, hg_path.sample_bits, hg_frame.seed);
}

// Among all paths of a pixel.
uint hg_path_number(uint slot)
{
    return (hg_path_sample(slot) << hg_path.branch_bits) | push.branch;
}

// Of a path, by its number.
hg_sampler hg_path_step_sampler(uvec2 pixel, uint number)
{
    return hg_sampler_make(pixel, number, hg_path.sample_bits + hg_path.branch_bits, hg_frame.seed);
}

float hg_path_branches()
{
    return float(1u << hg_path.branch_bits);
}

// Channel of a plane in the words of a path that the film adds up; the film's squares have none.
uint hg_path_out(uint channel)
{
    return HG_PATH_OUT + (channel < HG_PATH_FILM_SQUARES ? channel : channel - 1u);
}

#define HG_PATH_HAS(plane) \
    (HG_PATH_CAN(HG_PATH_PLANES) && hg_path.planes[plane] != HG_PATH_NO_PLANE)

void hg_path_put3(uint plane, uint slot, vec3 value)
{
    if (HG_PATH_HAS(plane))
        hg_path_set3(hg_path_out(hg_path.planes[plane]), slot, value);
}

void hg_path_put(uint plane, uint slot, float value)
{
    if (HG_PATH_HAS(plane))
        hg_path_set(hg_path_out(hg_path.planes[plane]), slot, value);
}

void hg_path_add_plane(uint plane, uint slot, vec3 value)
{
    if (HG_PATH_HAS(plane))
        hg_path_add3(hg_path_out(hg_path.planes[plane]), slot, value);
}

void hg_path_add_guide(uint channel, uint slot, vec3 value)
{
    if (HG_PATH_HAS(HG_PATH_PLANE_GUIDE))
        hg_path_add3(hg_path_out(hg_path.planes[HG_PATH_PLANE_GUIDE] + channel), slot, value);
}

// Light that reached the camera: by the whole, by where it comes from, and by the way it came.
// way: 0 run into, 1 by a ray to a light, 2 by the second one to a directional light.
void hg_path_light(uint slot, uint bounce, uint way, uint group, vec3 radiance)
{
    hg_path_add3(HG_PATH_OUT, slot, radiance);
    if (HG_PATH_CAN(HG_PATH_GROUPS))
        hg_path_add3(hg_path_out(hg_path.planes[HG_PATH_PLANE_GROUPS] + 3u * group), slot, radiance);
    if (bounce == 0u)
        hg_path_add_plane(HG_PATH_PLANE_EMISSION, slot, radiance);
    if (bounce == 0u || !HG_PATH_CAN(HG_PATH_SPLIT))
        return;
    uint plane = bounce == 1u ? HG_PATH_PLANE_DIRECT : HG_PATH_PLANE_INDIRECT;
    uint word = bounce == 1u ? 3u * way : HG_PATH_SPLIT_PATH;
    vec3 share = hg_path_get3(hg_path.split + word, slot);
    if (share.x < 0.0) {
        hg_path_add_plane(plane + HG_PATH_LOBE_TRANSMISSION, slot, radiance);
        hg_path_add_guide(HG_PATH_GUIDE_SPECULAR, slot, radiance);
        return;
    }
    vec3 diffuse = radiance * share;
    bool direct = bounce == 1u || HG_PATH_CAN(HG_PATH_GATHERS);
    hg_path_add_guide(direct ? HG_PATH_GUIDE_DIRECT : HG_PATH_GUIDE_INDIRECT, slot, diffuse);
    hg_path_add_guide(HG_PATH_GUIDE_SPECULAR, slot, radiance - diffuse);
    hg_path_add_plane(plane + HG_PATH_LOBE_DIFFUSE, slot, diffuse);
    hg_path_add_plane(plane + HG_PATH_LOBE_SPECULAR, slot, radiance - diffuse);
}

// Of the environment's light that a path gathered, HG_PATH_GUIDE_OPEN_SKY or _SEEN_SKY; way as above.
void hg_path_add_sky(uint channel, uint slot, uint way, vec3 radiance)
{
    vec3 share = hg_path_get3(hg_path.split + 3u * way, slot);
    if (share.x >= 0.0)
        hg_path_add_guide(channel, slot, radiance * share);
}

// Of what directional lights give the first surface of a gathering path, HG_PATH_GUIDE_OPEN_SUN or _SEEN_SUN.
void hg_path_add_sun(uint channel, uint slot, float light)
{
    if (HG_PATH_HAS(HG_PATH_PLANE_GUIDE))
        hg_path_add(hg_path_out(hg_path.planes[HG_PATH_PLANE_GUIDE] + channel), slot, light);
}

uint hg_path_mark(uint draw)
{
    return HG_PATH_CAN(HG_PATH_GROUPS | HG_PATH_CATCHER | HG_PATH_PLACED) ? hg_path.draw_marks.v[draw]
                                                                          : 0u;
}

// Numbers by whose rounding a surface may lie elsewhere than where rays meet it: large where a
// matrix brings back corners from far away, and rays are brought to them. Metres.
float hg_path_terms(uint draw, mat4x3 world)
{
    vec3 a = abs(world[3]);
    return (hg_path_mark(draw) & HG_PATH_MARK_PLACED) != 0u ? max(a.x, max(a.y, a.z)) : 0.0;
}

// --- time ----------------------------------------------------------------------------------------

float hg_path_time = 1.0; // of the ray, 0..1 in the shutter

// Between the opening and the closing; without a shutter what is there now. Things that stand still
// stay where they are to the bit.
#define HG_PATH_BETWEEN(before, now) ((before) + ((now) - (before)) * hg_path_time)

vec3 hg_path_eye()
{
    if (!HG_PATH_CAN(HG_PATH_BLURS))
        return hg_frame.camera.eye_ws;
    return HG_PATH_BETWEEN(hg_path.moments[HG_PATH_OPENING].eye_ws,
        hg_path.moments[HG_PATH_CLOSING].eye_ws);
}

vec3 hg_path_forward()
{
    if (!HG_PATH_CAN(HG_PATH_BLURS))
        return hg_frame.camera.forward_ws;
    return normalize(HG_PATH_BETWEEN(hg_path.moments[HG_PATH_OPENING].forward_ws,
        hg_path.moments[HG_PATH_CLOSING].forward_ws));
}

mat4x3 hg_path_world(uint instance)
{
    mat4x3 world = hg_world_at(instance);
    if (HG_PATH_CAN(HG_PATH_BLURS)) {
        mat4x3 before = hg_path.moments[HG_PATH_OPENING].scene.worlds.v[instance];
        world = HG_PATH_BETWEEN(before, world);
    }
    return world;
}

// The part as it was when the shutter opened: only positions and vertices of deformed ones differ.
hg_gpu_part hg_path_part_before(hg_gpu_draw d, hg_gpu_part now)
{
    if ((d.flags & HG_DRAW_LOD) != 0u)
        return now;
    return hg_path.moments[HG_PATH_OPENING].scene.parts.v[d.part];
}

vec3 hg_path_finite(vec3 v)
{
    return any(isnan(v)) || any(isinf(v)) ? vec3(0.0) : v;
}

#endif
