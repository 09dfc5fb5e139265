// glass.glsl - what rays of the host brought to clear glass in a picture in motion (shared/glass.h).
//
// Declare hg_gathered and include lib/environment.glsl and lib/probes.glsl first.
#ifndef HG_LIB_GLASS_GLSL
#define HG_LIB_GLASS_GLSL

#include "shared/glass.h"

#define HG_GLASS_LEAST 1e-3 // weight of a neighbour, of where the middle of the pixel met another surface
#define HG_GLASS_CLEAR 0.1  // perceptual roughness up to which rays have all that is seen,
#define HG_GLASS_ROUGH 0.3  // and from which on nothing of it

float hg_glass_share = 0.0;    // of what follows; the rest is what layers know by themselves
vec3 hg_glass_behind;          // radiance from behind, before the first surface weighs it
vec3 hg_glass_mirrored;        // radiance from the mirror direction without the environment,
float hg_glass_sky;            // and share of that

vec3 hg_glass_direction(uint word)
{
    return hg_oct_decode(vec2(word >> 16, word >> 1 & 0x7fffu) * vec2(2.0 / 65535.0, 2.0 / 32767.0) - 1.0);
}

// Bilinear, of the texels that there are.
void hg_glass_look(vec2 pixel, float roughness)
{
    ivec2 size = textureSize(hg_gathered, 0);
    vec2 at = pixel * (vec2(size) * hg_frame.inv_size) - 0.5;
    vec2 low = floor(at), f = at - low;
    vec3 through = vec3(0.0), left = vec3(0.0), mirrored = vec3(0.0), direction = vec3(0.0);
    float sum = 0.0, sky = 0.0;
    for (int i = 0; i < 4; i++) {
        ivec2 off = ivec2(i & 1, i >> 1);
        uvec4 t = texelFetch(hg_gathered, clamp(ivec2(low) + off, ivec2(0), size - 1), 0);
        vec2 axis = mix(1.0 - f, f, vec2(off));
        float w = (t.y & HG_GLASS_THERE) != 0u ? axis.x * axis.y + HG_GLASS_LEAST : 0.0;
        vec3 lets = w * hg_rgb9e5(t.z);
        bool open = t.w == HG_GLASS_SKY;
        sum += w;
        through += w * hg_rgb9e5(t.x);
        left += lets;
        direction += hg_max3(lets) * hg_glass_direction(t.y);
        mirrored += open ? vec3(0.0) : w * hg_rgb9e5(t.w);
        sky += open ? w : 0.0;
    }
    float scale = 1.0 / max(sum, 1e-20);
    bool dark = hg_frame.lighting.env_kind == HG_ENV_KIND_NONE;
    vec3 far = dark ? vec3(0.0) : hg_environment_prefiltered(normalize(direction + vec3(0.0, 1e-10, 0.0)), roughness);
    hg_glass_behind = (through + left * far) * scale;
    hg_glass_mirrored = mirrored * scale;
    hg_glass_sky = sky * scale;
    hg_glass_share = sum > 0.0 ? 1.0 - smoothstep(HG_GLASS_CLEAR, HG_GLASS_ROUGH, roughness) : 0.0;
}

#endif
