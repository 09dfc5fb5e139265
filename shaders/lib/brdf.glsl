// brdf.glsl - the metallic-roughness BRDF of glTF 2.0, made to keep its energy.
//
// Include lib/frame.glsl first: the directional albedo table is reached through hg_frame.lighting.
// All cosines are against the shading normal, all directions leave the surface, unit length.
//
//   f = f_specular + f_multiple + f_diffuse
//
// f_specular is appendix B of the glTF 2.0 specification (Trowbridge-Reitz D, height-correlated
// Smith V, Schlick F; f0 = 0.04 or base colour, mixed by metallic). Two terms differ from the sample
// implementation there, which loses up to 60 % of the light on rough metals and gains up to 80 % on
// smooth dielectrics at grazing angles:
// - f_multiple returns the light that bounces more than once between the microfacets, after Kulla
//   and Conty 2017. Chosen over Turquin's scaling (2019) because it is reciprocal, which the path
//   tracer needs, and because its environment form is exactly that of Fdez-Aguera 2019.
// - f_diffuse couples to what the specular part leaves over, (1 - E(v)) (1 - E(l)) / (1 - E_avg),
//   in place of (1 - F(v.h)): equal within a few percent away from grazing, reciprocal, and energy
//   is conserved exactly.
// E, E_avg: directional and average albedo of the specular part, from the table made by
// renderer/light/albedo/dfg.c.
#ifndef HG_LIB_BRDF_GLSL
#define HG_LIB_BRDF_GLSL

#include "lib/sampling.glsl"
#include "lib/tables.glsl"

#define HG_DIELECTRIC_F0 0.04 // index of refraction 1.5; glTF 2.0 appendix B.3.5
// Perceptual roughness below which a highlight of a punctual light is narrower than any pixel, and
// D overflows half floats. The environment's mirror reflection is not clamped.
#define HG_MIN_ROUGHNESS 0.045

struct hg_brdf {
    vec3 n;          // shading normal
    vec3 v;          // to the eye
    float n_dot_v;   // > 0
    float roughness; // perceptual, as the material says
    float f0_dielectric;
    float alpha;     // roughness^2, clamped
    vec3 f0;         // reflectance at normal incidence; f90 is 1
    vec3 diffuse;    // (1 - metallic) base colour
    vec3 f_ms;       // colour of the multiple-scattering lobe
    vec2 dfg_v;      // (a, b): E(v) = f0 a + b without multiple scattering
    vec2 dfg_avg;    // cosine-weighted averages of a and b
    float f_ms_dielectric;
    float diffuse_scale_v; // (1 - E(v)) / (1 - E_avg) of the dielectric part
};

// Trowbridge-Reitz (GGX) distribution of normals. glTF 2.0 eq. B.3.2; Walter et al. 2007 eq. 33.
// 1 - (n.h)^2 comes in as the squared length of the cross product to keep its digits at alpha ~ 0.
float hg_ggx_d(float n_dot_h, float sin2_h, float alpha)
{
    float a = n_dot_h * alpha;
    float k = alpha / (sin2_h + a * a);
    return k * k * HG_INV_PI;
}

// Height-correlated Smith visibility, G2 / (4 n.l n.v). glTF 2.0 eq. B.3.3; Heitz 2014 eq. 99.
float hg_smith_v(float n_dot_l, float n_dot_v, float alpha)
{
    float a2 = alpha * alpha;
    float l = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2);
    float v = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2);
    return 0.5 / max(l + v, 1e-12);
}

// Smith masking G1. Heitz 2014 eq. 72 (Lambda) and 43.
float hg_smith_g1(float cos_theta, float alpha)
{
    float a2 = alpha * alpha;
    return 2.0 * cos_theta / (cos_theta + sqrt(cos_theta * cos_theta * (1.0 - a2) + a2));
}

// (1 - cos)^5 of Schlick's approximation. Schlick 1994 eq. 24.
float hg_schlick_weight(float cos_theta)
{
    float m = clamp(1.0 - cos_theta, 0.0, 1.0);
    float m2 = m * m;
    return m2 * m2 * m;
}

vec3 hg_schlick(vec3 f0, float v_dot_h)
{
    return f0 + (1.0 - f0) * hg_schlick_weight(v_dot_h);
}

// Scale a and bias b of the split sum, E = f0 a + b, at a cosine and perceptual roughness.
// Karis 2013, "Real Shading in Unreal Engine 4", eq. 8. Bilinear in (sqrt(cos), roughness).
vec2 hg_dfg(float cos_theta, float roughness)
{
    const float last = float(HG_DFG_SIZE - 1);
    vec2 p = clamp(vec2(sqrt(max(cos_theta, 0.0)), roughness), 0.0, 1.0) * last;
    uvec2 i = uvec2(min(p, vec2(last - 1.0)));
    vec2 f = p - vec2(i);
    uint k = i.y * HG_DFG_SIZE + i.x;
    vec2 low = mix(hg_dfg_at(k), hg_dfg_at(k + 1u), f.x);
    vec2 high = mix(hg_dfg_at(k + HG_DFG_SIZE),
        hg_dfg_at(k + HG_DFG_SIZE + 1u), f.x);
    return mix(low, high, f.y);
}

// Cosine-weighted averages of a and b, 2 times the integral over cos. Kulla and Conty 2017.
vec2 hg_dfg_average(float roughness)
{
    const float last = float(HG_DFG_SIZE - 1);
    float p = clamp(roughness, 0.0, 1.0) * last;
    uint i = uint(min(p, last - 1.0));
    uint k = HG_DFG_SIZE * HG_DFG_SIZE + i;
    return mix(hg_dfg_at(k), hg_dfg_at(k + 1u), p - float(i));
}

// Colour of light that was reflected twice or more: F^2 p / (1 - F (1 - p)), Kulla and Conty 2017
// with the square of Hill 2018, "A Multi-Faceted Exploration", part 3. There p is e_avg, the share of
// light that leaves after one bounce, and F is f_avg, Fresnel's term averaged over all directions.
// But light that has met two facets leaves more often, and met them at more grazing angles: both are
// fitted to walks from facet to facet (Heitz et al. 2016; tests/analytic/microfacet_walks.c), against
// which f0 of 0.3 to 0.8 lost up to 7 %. f_avg, f90: 0..1; e_avg: 0.4..1.
vec3 hg_multiple_scattering_color(vec3 f_avg, float f90, float e_avg)
{
    float p = 0.0896 + e_avg * (1.5285 - 0.6665 * e_avg);
    float grazing = 0.0946 + e_avg * (0.5432 * e_avg - 0.4855);
    vec3 f = f_avg + max(f90 - f_avg, 0.0) * grazing;
    return f * f * p / (1.0 - f * (1.0 - p));
}

// Schlick's term averaged over all directions, weighted with their cosine.
vec3 hg_schlick_average(vec3 f0, float f90)
{
    return f0 + (f90 - f0) * (1.0 / 21.0);
}

// Directional albedo of the specular part, multiple scattering included, from a and b.
vec3 hg_specular_albedo(vec3 f0, vec3 f_ms, vec2 dfg)
{
    return f0 * dfg.x + dfg.y + f_ms * (1.0 - dfg.x - dfg.y);
}

// What does not depend on the light. n_dot_v is kept above 0, for normals that interpolation or a
// normal map turned away from the eye.
hg_brdf hg_brdf_make(
    vec3 base_color, float metallic, float roughness, float f0_dielectric, vec3 n, vec3 v)
{
    hg_brdf b;
    b.n = n;
    b.v = v;
    b.n_dot_v = clamp(abs(dot(n, v)), 1e-4, 1.0);
    b.roughness = clamp(roughness, 0.0, 1.0);
    float clamped = max(b.roughness, HG_MIN_ROUGHNESS);
    b.alpha = clamped * clamped;
    b.f0_dielectric = f0_dielectric;
    b.f0 = mix(vec3(f0_dielectric), base_color, metallic);
    b.diffuse = (1.0 - metallic) * base_color;
    b.dfg_v = hg_dfg(b.n_dot_v, b.roughness);
    b.dfg_avg = hg_dfg_average(b.roughness);
    float e_avg = b.dfg_avg.x + b.dfg_avg.y;
    vec3 dielectric = hg_schlick_average(vec3(f0_dielectric), 1.0);
    vec3 metal = hg_schlick_average(base_color, 1.0);
    b.f_ms_dielectric = hg_multiple_scattering_color(dielectric, 1.0, e_avg).x;
    b.f_ms = mix(vec3(b.f_ms_dielectric), hg_multiple_scattering_color(metal, 1.0, e_avg), metallic);
    float e_v = f0_dielectric * b.dfg_v.x + b.dfg_v.y +
        b.f_ms_dielectric * (1.0 - b.dfg_v.x - b.dfg_v.y);
    float e_d = f0_dielectric * b.dfg_avg.x + b.dfg_avg.y + b.f_ms_dielectric * (1.0 - e_avg);
    b.diffuse_scale_v = (1.0 - e_v) / max(1.0 - e_d, 1e-4);
    return b;
}

#ifdef HG_LIB_MATERIAL_GLSL
// Of an evaluated material (include lib/material.glsl first); view_ws leads to the eye.
hg_brdf hg_surface_brdf(hg_surface s, vec3 view_ws)
{
    return hg_brdf_make(s.base_color, s.metallic, s.roughness, s.f0, s.normal, view_ws);
}
#endif

// f(v, l) n.l for a light direction; 0 below the horizon.
vec3 hg_brdf_evaluate(hg_brdf b, vec3 l)
{
    float n_dot_l = min(dot(b.n, l), 1.0);
    if (n_dot_l <= 0.0)
        return vec3(0.0);
    vec3 h = normalize(b.v + l);
    float n_dot_h = clamp(dot(b.n, h), 0.0, 1.0);
    float v_dot_h = clamp(dot(b.v, h), 0.0, 1.0);
    vec3 c = cross(b.n, h);
    vec3 specular = hg_schlick(b.f0, v_dot_h) *
        (hg_ggx_d(n_dot_h, dot(c, c), b.alpha) * hg_smith_v(n_dot_l, b.n_dot_v, b.alpha));
    vec2 dfg_l = hg_dfg(n_dot_l, b.roughness);
    float miss_v = 1.0 - b.dfg_v.x - b.dfg_v.y;
    float miss_l = 1.0 - dfg_l.x - dfg_l.y;
    float miss_avg = max(1.0 - b.dfg_avg.x - b.dfg_avg.y, 1e-4);
    vec3 multiple = b.f_ms * (miss_v * miss_l / miss_avg * HG_INV_PI);
    float e_l = b.f0_dielectric * dfg_l.x + dfg_l.y + b.f_ms_dielectric * miss_l;
    vec3 diffuse = b.diffuse * (b.diffuse_scale_v * (1.0 - e_l) * HG_INV_PI);
    return (specular + multiple + diffuse) * n_dot_l;
}

// Probability of sampling the specular lobe: its share of the albedo.
float hg_brdf_specular_probability(hg_brdf b)
{
    vec3 s = hg_specular_albedo(b.f0, b.f_ms, b.dfg_v);
    float specular = max(s.x, max(s.y, s.z));
    float diffuse = max(b.diffuse.x, max(b.diffuse.y, b.diffuse.z)) * (1.0 - min(specular, 1.0));
    return clamp(specular / max(specular + diffuse, 1e-6), 0.1, 1.0);
}

// Density of hg_brdf_sample per solid angle. Specular: VNDF over 4 v.h, Heitz 2018 eq. 17.
float hg_brdf_pdf(hg_brdf b, vec3 l)
{
    float n_dot_l = dot(b.n, l);
    if (n_dot_l <= 0.0)
        return 0.0;
    vec3 h = normalize(b.v + l);
    vec3 c = cross(b.n, h);
    float d = hg_ggx_d(clamp(dot(b.n, h), 0.0, 1.0), dot(c, c), b.alpha);
    float specular = hg_smith_g1(b.n_dot_v, b.alpha) * d / (4.0 * b.n_dot_v);
    return mix(n_dot_l * HG_INV_PI, specular, hg_brdf_specular_probability(b));
}

// Direction of an incoming path for three random numbers; may lie below the horizon, where
// evaluate and pdf are 0.
vec3 hg_brdf_sample(hg_brdf b, vec3 u)
{
    vec3 t, s;
    hg_basis(b.n, t, s);
    if (u.z >= hg_brdf_specular_probability(b)) {
        vec3 d = hg_sample_cosine(u.xy);
        return normalize(t * d.x + s * d.y + b.n * d.z);
    }
    vec3 v = vec3(dot(b.v, t), dot(b.v, s), b.n_dot_v);
    vec3 h = hg_sample_ggx_vndf(normalize(v), b.alpha, u.xy);
    vec3 h_ws = t * h.x + s * h.y + b.n * h.z;
    return normalize(2.0 * dot(b.v, h_ws) * h_ws - b.v);
}

#endif
