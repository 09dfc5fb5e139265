// probe_light_texel.glsl - texels of probe light (shared/gi.h): of which pixel they are, and how they are packed.
//
// Include lib/frame.glsl and lib/octahedral.glsl first.
#ifndef HG_LIB_PROBE_LIGHT_TEXEL_GLSL
#define HG_LIB_PROBE_LIGHT_TEXEL_GLSL

// The pixel whose surface a texel is of: that in the middle of its block, and where nothing is there others.
#define HG_PROBE_LIGHT_TRIES 5
ivec2 hg_probe_light_pixel(ivec2 texel, int number)
{
    ivec2 at = number == 0 ? ivec2(2, 2)
        : number == 1      ? ivec2(0, 1)
        : number == 2      ? ivec2(3, 0)
        : number == 3      ? ivec2(1, 3)
                           : ivec2(3, 3);
    return min(texel * HG_PROBE_LIGHT_PX + at, ivec2(hg_frame.width, hg_frame.height) - 1);
}

// Normal with 12 bits for each coordinate, and a share.
uint hg_probe_light_pack(vec3 n, float share)
{
    uvec2 e = uvec2(round((hg_oct_encode(n) * 0.5 + 0.5) * 4095.0));
    return e.x | e.y << 12 | uint(round(clamp(share, 0.0, 1.0) * 255.0)) << 24;
}

vec3 hg_probe_light_normal(uint word)
{
    return hg_oct_decode(vec2(word & 4095u, word >> 12 & 4095u) * (2.0 / 4095.0) - 1.0);
}

#endif
