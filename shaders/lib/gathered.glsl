// gathered.glsl - light that was gathered for the surfaces of a picture at rest (shared/gi.h).
//
// A sample looks at its own pixel, and where that pixel's middle shows another surface, at the four
// beside it: a loop that ends once no pixel of a vector goes on, so it is short almost everywhere.
// Declare hg_gathered and include lib/environment.glsl, lib/light.glsl and lib/probes.glsl first.
#ifndef HG_LIB_GATHERED_GLSL
#define HG_LIB_GATHERED_GLSL

#define HG_GATHERED_BESIDE 1e-3 // weight of pixels beside the sample's own
#define HG_GATHERED_ENOUGH 0.25 // weight of the own pixel from which on those beside it do not count
#define HG_GATHERED_LEAST  1e-6 // of another surface
#define HG_GATHERED_DEPTH  0.02 // relative difference of depth at which the weight is a half

// at: middle of the sample's pixel; depth: metres along the view direction; n: shading normal.
void hg_gathered_look(vec2 at, float depth, vec3 n)
{
    ivec2 pixel = ivec2(at);
    ivec2 last = ivec2(hg_frame.width, hg_frame.height) - 1;
    vec3 irradiance = vec3(0.0), radiance = vec3(0.0);
    float sum = 0.0, sky = 0.0, sun = 0.0, most = -1.0;
    ivec2 nearest = pixel;
    for (int i = 0; i < 5 && most < HG_GATHERED_ENOUGH; i++) {
        ivec2 off = i == 0 ? ivec2(0) : (i & 1) == 0 ? ivec2(i - 3, 0) : ivec2(0, i - 2);
        uvec4 t = texelFetch(hg_gathered, clamp(pixel + off, ivec2(0), last), 0);
        float share = float(t.w & HG_GATHERED_SHARE_MASK) * (1.0 / float(HG_GATHERED_SHARE_MASK));
        float deep = uintBitsToFloat(t.w & ~HG_GATHERED_SHARE_MASK), apart = (deep - depth) / (HG_GATHERED_DEPTH * depth);
        float facing = max(dot(hg_oct_decode(unpackSnorm4x8(t.z).xy), n), 0.0);
        facing *= facing;
        facing *= facing;
        float w = facing * facing / (1.0 + apart * apart) + HG_GATHERED_LEAST;
        w *= i == 0 ? 1.0 : HG_GATHERED_BESIDE;
        w = deep > 0.0 ? w : 0.0;
        irradiance += w * hg_rgb9e5(t.x);
        radiance += w * hg_rgb9e5(t.y);
        sky += w * share * share;
        share = unpackUnorm4x8(t.z).z;
        sun += w * share * share;
        sum += w;
        nearest = w > most ? clamp(pixel + off, ivec2(0), last) : nearest;
        most = max(w, most);
    }
    float scale = 1.0 / max(sum, 1e-20);
    hg_probes_irradiance = irradiance * scale;
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_NONE)
        hg_probes_irradiance += hg_environment_irradiance(n) * (sky * scale);
    hg_probes_surfaces = radiance * scale;
    hg_probes_sky = 0.0;
    hg_light_gathered = true;
    hg_light_sun_seen = sum > 0.0 ? sun * scale : 1.0;
    if (HG_HAS2(HG_FEATURE2_LAMPS_GATHERED))
        hg_light_lamps_seen = sum > 0.0 ? texelFetch(hg_gathered, nearest + ivec2(0, hg_frame.height), 0)
                                        : uvec4(0xffffffffu);
}

#endif
