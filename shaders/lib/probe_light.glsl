// probe_light.glsl - light from the field of probes on the opaque surfaces of a picture in motion, looked
// up at every fourth pixel along each side (shared/gi.h).
//
// A pixel blends the four nearest of them bilinearly, those of its own surface alone (joint bilateral
// upsampling: Kopf et al. 2007). Declare hg_gathered and include lib/environment.glsl and lib/probes.glsl first.
#ifndef HG_LIB_PROBE_LIGHT_GLSL
#define HG_LIB_PROBE_LIGHT_GLSL

#include "lib/probe_light_texel.glsl"

#define HG_PROBE_LIGHT_LEAST 1e-5 // weight of another surface
#define HG_PROBE_LIGHT_APART 0.06 // relative difference of depth at which the weight is a half

float hg_probe_light_open = 1.0; // share of the cosine lobe that nothing near occludes

// depth: metres along the view direction; n: shading normal.
void hg_probe_light_look(vec2 pixel, float depth, vec3 n)
{
    ivec2 last = (ivec2(hg_frame.width, hg_frame.height) + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX - 1;
    vec2 at = pixel * (1.0 / float(HG_PROBE_LIGHT_PX)) - (0.5 + 0.5 / float(HG_PROBE_LIGHT_PX));
    vec2 low = floor(at), f = at - low;
    vec3 irradiance = vec3(0.0), surfaces = vec3(0.0);
    vec4 sum = vec4(0.0); // of the share of sky, of weights, of what is open, of the sky's irradiance
    for (int i = 0; i < 4; i++) {
        ivec2 off = ivec2(i & 1, i >> 1);
        uvec4 t = texelFetch(hg_gathered, clamp(ivec2(low) + off, ivec2(0), last), 0);
        vec2 axis = mix(1.0 - f, f, vec2(off));
        float deep = uintBitsToFloat(t.w), apart = (deep - depth) / (HG_PROBE_LIGHT_APART * depth);
        float facing = max(dot(hg_probe_light_normal(t.z), n), 0.0);
        facing *= facing;
        float w = axis.x * axis.y * facing * facing / (1.0 + apart * apart) + HG_PROBE_LIGHT_LEAST;
        w = deep > 0.0 ? w : 0.0;
        irradiance += w * hg_rgb9e5(t.x);
        surfaces += w * hg_rgb9e5(t.y);
        sum += w * vec4(float(t.z >> 24), 1.0, float(t.w & HG_PROBE_LIGHT_OPEN_MASK),
            hg_probe_light_sky(t.z));
    }
    // What no block has seen is thin, and has nothing about it that would hide the environment.
    bool none = sum.y <= 0.0;
    float scale = 1.0 / max(sum.y, 1e-20);
    bool dark = hg_frame.lighting.env_kind == HG_ENV_KIND_NONE;
    vec3 open = dark ? vec3(0.0) : hg_environment_irradiance(n);
    hg_probes_irradiance = none ? open : (irradiance + sum.w * open) * scale;
    hg_probes_surfaces = surfaces * scale;
    hg_probes_sky = none ? 1.0 : sum.x * scale * (1.0 / 255.0);
    hg_probe_light_open = none ? 1.0 : sum.z * scale * (1.0 / float(HG_PROBE_LIGHT_OPEN_MASK));
}

#endif
