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

// Normal, no share of the environment's irradiance, and that of its reflection.
uint hg_probe_light_pack(vec3 n, float share)
{
    uvec2 e = uvec2(round((hg_oct_encode(n) * 0.5 + 0.5) * float(HG_PROBE_LIGHT_NORMAL_MOST)));
    return e.x | e.y << HG_PROBE_LIGHT_NORMAL_BITS | uint(round(clamp(share, 0.0, 1.0) * 255.0)) << 24;
}

vec3 hg_probe_light_normal(uint word)
{
    uvec2 e = uvec2(word, word >> HG_PROBE_LIGHT_NORMAL_BITS) & HG_PROBE_LIGHT_NORMAL_MOST;
    return hg_oct_decode(vec2(e) * (2.0 / float(HG_PROBE_LIGHT_NORMAL_MOST)) - 1.0);
}

// Of the environment's irradiance.
float hg_probe_light_sky(uint word)
{
    return float(word >> HG_PROBE_LIGHT_SKY_SHIFT & HG_PROBE_LIGHT_SKY_MOST) *
        (1.0 / float(HG_PROBE_LIGHT_SKY_MOST));
}

#endif
