// light_table.glsl - photometric profiles and images of lights, from the tables of
// shared/light_table.h. Part of lib/light.glsl; renderer/light/light_tint.c does the same on the host.
#ifndef HG_LIB_LIGHT_TABLE_GLSL
#define HG_LIB_LIGHT_TABLE_GLSL

#include "shared/light_table.h"

uint hg_light_word(uint i)
{
    return hg_frame.lighting.tables.v[i];
}

// --- profiles ------------------------------------------------------------------------------------

float hg_light_profile_row(uint row, float t, uint thetas)
{
    uint i = uint(min(t, float(thetas - 2u)));
    return mix(uintBitsToFloat(hg_light_word(row + i)), uintBitsToFloat(hg_light_word(row + i + 1u)),
        t - float(i));
}

// Factor in a direction of the light's frame, unit length.
float hg_light_profile(uint table, vec3 direction)
{
    uint head = hg_light_word(table);
    uint thetas = head & 0xffffu, phis = head >> 16;
    float t = acos(clamp(-direction.z, -1.0, 1.0)) * (HG_INV_PI * float(thetas - 1u));
    uint first = table + HG_LIGHT_PROFILE_HEAD;
    if (phis == 1u)
        return hg_light_profile_row(first, t, thetas);
    float turn = direction.x == 0.0 && direction.y == 0.0 ? 0.0 : atan(direction.y, direction.x) * (0.5 * HG_INV_PI);
    float p = (turn < 0.0 ? turn + 1.0 : turn) * float(phis);
    uint p0 = uint(p) % phis;
    return mix(hg_light_profile_row(first + p0 * thetas, t, thetas),
        hg_light_profile_row(first + (p0 + 1u) % phis * thetas, t, thetas), fract(p));
}

// --- images --------------------------------------------------------------------------------------

uint hg_light_wrapped(int i, uint side, uint wrap)
{
    int n = int(side);
    if (wrap == HG_LIGHT_WRAP_CLAMP)
        return uint(clamp(i, 0, n - 1));
    int period = wrap == HG_LIGHT_WRAP_MIRROR ? 2 * n : n;
    int at = i % period;
    at += at < 0 ? period : 0;
    return uint(at < n ? at : period - 1 - at);
}

vec3 hg_light_texel(uint first, uint i)
{
    return vec3(unpackHalf2x16(hg_light_word(first + 2u * i)), unpackHalf2x16(hg_light_word(first + 2u * i + 1u)).x);
}

// Bilinear, of the level that begins at a word; wrap: of both axes, as in word 1.
vec3 hg_light_level(uint first, uvec2 size, uint wrap, vec2 uv)
{
    vec2 at = clamp(uv * vec2(size) - 0.5, vec2(-1e6), vec2(1e6));
    ivec2 i = ivec2(floor(at));
    vec2 f = at - floor(at);
    uint x0 = hg_light_wrapped(i.x, size.x, wrap >> 8 & 0xffu);
    uint x1 = hg_light_wrapped(i.x + 1, size.x, wrap >> 8 & 0xffu);
    uint y0 = hg_light_wrapped(i.y, size.y, wrap >> 16) * size.x;
    uint y1 = hg_light_wrapped(i.y + 1, size.y, wrap >> 16) * size.x;
    return mix(mix(hg_light_texel(first, y0 + x0), hg_light_texel(first, y0 + x1), f.x),
        mix(hg_light_texel(first, y1 + x0), hg_light_texel(first, y1 + x1), f.x), f.y);
}

// The finest level.
vec3 hg_light_image(uint table, vec2 uv)
{
    uint size = hg_light_word(table);
    return hg_light_level(
        table + HG_LIGHT_IMAGE_HEAD, uvec2(size & 0xffffu, size >> 16), hg_light_word(table + 1u), uv);
}

// Within the edges, between two levels; lod: 0 is the finest.
vec3 hg_light_image_lod(uint table, vec2 uv, float lod)
{
    uint head = hg_light_word(table), wrap = HG_LIGHT_WRAP_CLAMP * 0x10100u;
    uvec2 size = uvec2(head & 0xffffu, head >> 16);
    lod = clamp(lod, 0.0, float((hg_light_word(table + 1u) & 0xffu) - 1u));
    uint first = table + HG_LIGHT_IMAGE_HEAD, level = uint(lod);
    for (uint i = 0u; i < level; i++) {
        first += 2u * size.x * size.y;
        size = max(size / 2u, uvec2(1u));
    }
    vec3 fine = hg_light_level(first, size, wrap, uv);
    if (lod == float(level))
        return fine;
    return mix(fine,
        hg_light_level(first + 2u * size.x * size.y, max(size / 2u, uvec2(1u)), wrap, uv), fract(lod));
}

// --- lights --------------------------------------------------------------------------------------

vec3 hg_light_up(hg_gpu_light light)
{
    return cross(light.axis_ws, light.direction_ws);
}

// A direction or an offset in the light's frame.
vec3 hg_light_frame(hg_gpu_light light, vec3 d)
{
    return vec3(dot(d, light.axis_ws), dot(d, hg_light_up(light)), -dot(d, light.direction_ws));
}

// Where the image of a light that has no surface of its own meets a point, an offset in its frame.
vec2 hg_light_cookie_uv(hg_gpu_light light, vec3 at)
{
    if (light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        return vec2(0.5) + vec2(at.x, -at.y) / (2.0 * vec2(light.half_width, light.half_height));
    if (light.kind == HG_LIGHT_KIND_SPOT) {
        float outer = clamp(-light.spot_offset / light.spot_scale, HG_LIGHT_LEAST_COS, 1.0 - 1e-7);
        float reach = max(-at.z, 1e-6 * length(at)) * sqrt(1.0 - outer * outer) / outer;
        return vec2(0.5) + vec2(at.x, -at.y) / (2.0 * max(reach, 1e-20));
    }
    at = normalize(at + vec3(0.0, 0.0, 1e-20));
    float turn = at.x == 0.0 && at.z == 0.0 ? 0.0 : atan(at.z, at.x);
    return vec2(turn * (0.5 * HG_INV_PI) + 0.5, 0.5 - asin(clamp(at.y, -1.0, 1.0)) * HG_INV_PI);
}

bool hg_light_is_flat(hg_gpu_light light)
{
    return light.kind == HG_LIGHT_KIND_RECTANGLE || light.kind == HG_LIGHT_KIND_DISC;
}

// What profile and projected image leave of a light at a point.
vec3 hg_light_tint(hg_gpu_light light, vec3 pos_ws)
{
    vec3 tint = vec3(1.0);
    if (!HG_HAS2(HG_FEATURE2_LIGHT_TABLES))
        return tint;
    vec3 at = hg_light_frame(light, pos_ws - light.position_ws);
    if (light.profile != HG_LIGHT_NO_TABLE)
        tint *= hg_light_profile(light.profile, at * inversesqrt(max(dot(at, at), 1e-20)));
    if (light.image != HG_LIGHT_NO_TABLE && !hg_light_is_flat(light))
        tint *= hg_light_image(light.image, hg_light_cookie_uv(light, at));
    return tint;
}

// Colour of a flat light's surface at an offset from its middle.
vec3 hg_light_surface_tint(hg_gpu_light light, vec3 offset_ws)
{
    if (!HG_HAS2(HG_FEATURE2_LIGHT_TABLES) || light.image == HG_LIGHT_NO_TABLE || !hg_light_is_flat(light))
        return vec3(1.0);
    bool rectangle = light.kind == HG_LIGHT_KIND_RECTANGLE;
    vec2 half_size = rectangle ? vec2(light.half_width, light.half_height) : vec2(light.radius);
    vec2 at = vec2(dot(offset_ws, light.axis_ws), dot(offset_ws, hg_light_up(light)));
    return hg_light_image(light.image, clamp(vec2(0.5) - at / (2.0 * half_size), vec2(0.0), vec2(1.0)));
}

#endif
