// bsdf.glsl - everything that happens to light at one surface point: evaluate, sample, pdf.
//
// Include lib/frame.glsl and lib/material.glsl first. Directions leave the surface, unit length,
// world space. The base layer is hg_brdf (lib/brdf.glsl), so that real-time passes and the path
// tracer agree.
#ifndef HG_LIB_BSDF_GLSL
#define HG_LIB_BSDF_GLSL

#include "lib/brdf.glsl"
#include "lib/material.glsl"

// Bits of hg_bsdf_sample_result.lobe.
#define HG_LOBE_DIFFUSE      1u
#define HG_LOBE_SPECULAR     2u
#define HG_LOBE_TRANSMISSION 4u // the path goes on behind the surface
#define HG_LOBE_DELTA        8u // one direction only: hg_bsdf_evaluate knows nothing of it

// Perceptual roughness below which a lobe is a mirror: narrower than what any picture resolves.
#define HG_DELTA_ROUGHNESS 0.03

struct hg_bsdf {
    hg_brdf base;
    bool delta;         // the base's specular lobe is a mirror
    bool thin;          // transmission does not lead into another medium
    float eta;          // index of refraction behind the surface over that in front of it
    vec3 attenuation;   // of the medium behind the surface, 1 / m (hg_bsdf_attenuation)
    float p_specular;   // of hg_bsdf_sample
};

struct hg_bsdf_sample_result {
    vec3 direction;
    vec3 weight; // f |cos| / pdf
    float pdf;   // per solid angle; delta: probability of the lobe; 0: the path ends
    uint lobe;   // HG_LOBE_*
};

// Light that a medium lets through over a distance in metres. Beer-Lambert.
vec3 hg_bsdf_attenuation(vec3 attenuation, float distance)
{
    return exp(-attenuation * distance);
}

// view leads to where the ray came from; s.normal faces it. ior_outside: of the medium around closed
// surfaces, 1 for air.
hg_bsdf hg_bsdf_make(hg_surface s, vec3 view_ws, float ior_outside)
{
    hg_bsdf b;
    float n_dot_v = dot(s.normal, view_ws);
    vec3 n = n_dot_v < 1e-3 ? normalize(s.normal + view_ws * (1e-3 - n_dot_v)) : s.normal;
    b.base = hg_brdf_make(s.base_color, s.metallic, s.roughness, s.f0, n, view_ws);
    b.delta = s.roughness < HG_DELTA_ROUGHNESS;
    b.thin = true;
    b.eta = 1.0;
    b.attenuation = vec3(0.0);
    b.p_specular = hg_brdf_specular_probability(b.base);
    return b;
}

// Diffuse and multiple-scattering parts of the base, f n.l.
vec3 hg_bsdf_evaluate_wide(hg_brdf b, float n_dot_l)
{
    vec2 dfg_l = hg_dfg(n_dot_l, b.roughness);
    float miss_v = 1.0 - b.dfg_v.x - b.dfg_v.y;
    float miss_l = 1.0 - dfg_l.x - dfg_l.y;
    float miss_avg = max(1.0 - b.dfg_avg.x - b.dfg_avg.y, 1e-4);
    float e_l = b.f0_dielectric * dfg_l.x + dfg_l.y + b.f_ms_dielectric * miss_l;
    return (b.f_ms * (miss_v * miss_l / miss_avg) + b.diffuse * (b.diffuse_scale_v * (1.0 - e_l))) *
        (HG_INV_PI * n_dot_l);
}

// f(v, l) |n.l| of all lobes that are not delta, and the density of hg_bsdf_sample.
vec3 hg_bsdf_evaluate(hg_bsdf b, vec3 l, out float pdf)
{
    float n_dot_l = min(dot(b.base.n, l), 1.0);
    pdf = 0.0;
    if (n_dot_l <= 0.0)
        return vec3(0.0);
    if (b.delta) {
        pdf = (1.0 - b.p_specular) * n_dot_l * HG_INV_PI;
        return hg_bsdf_evaluate_wide(b.base, n_dot_l);
    }
    pdf = hg_brdf_pdf(b.base, l);
    return hg_brdf_evaluate(b.base, l);
}

// Direction of an incoming path for three random numbers in [0, 1).
hg_bsdf_sample_result hg_bsdf_sample(hg_bsdf b, vec3 u)
{
    hg_bsdf_sample_result r;
    bool specular = u.z < b.p_specular;
    r.lobe = specular ? HG_LOBE_SPECULAR : HG_LOBE_DIFFUSE;
    if (specular && b.delta) {
        r.direction = normalize(2.0 * dot(b.base.n, b.base.v) * b.base.n - b.base.v);
        r.weight = hg_schlick(b.base.f0, b.base.n_dot_v) / b.p_specular;
        r.pdf = b.p_specular;
        r.lobe |= HG_LOBE_DELTA;
        return r;
    }
    r.direction = hg_brdf_sample(b.base, u);
    vec3 f = hg_bsdf_evaluate(b, r.direction, r.pdf);
    r.weight = r.pdf > 0.0 ? f / r.pdf : vec3(0.0);
    return r;
}

#endif
