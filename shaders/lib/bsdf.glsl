// bsdf.glsl - everything that happens to light at one surface point: evaluate, sample, pdf.
//
// Include lib/frame.glsl and lib/material.glsl first. Directions leave the surface, unit length,
// world space; v leads to where the ray came from. Real-time passes and the path tracer share all of
// it. The layers are those of appendix B of the glTF 2.0 specification and of KHR_materials_*:
//
//   clearcoat over sheen over base,  base = mix(dielectric, metal, metallic)
//   dielectric = specular reflection over mix(mix(diffuse, diffuse behind), transmission)
//
// The base is hg_brdf (lib/brdf.glsl) where there is nothing else. What the specification leaves
// open, or cannot be had from it with energy kept:
// - Layers let through T = (1 - clearcoat E_coat) (1 - max(sheen) E_sheen). Specular lobes below get
//   min(T(v), T(l)), as the specification scales albedo below sheen, but for the coat too: it is
//   reciprocal and never gains energy. What that holds back goes on between layer and base, with
//   what bounces between facets: U(v) U(l) / U_avg in the colour of several bounces, U = T - E_1,
//   E_1 the albedo of white facets below the layers. Diffuse lobes get S(v) S(l) / S_avg with
//   S = T - E, which is reciprocal and exact: E is the albedo of the specular part below the layers,
//   U_avg and S_avg are cosine-weighted means.
//   Under a film it is that of each colour: what the film does not reflect enters.
// - What rough glass scatters more than once between its facets leaves on both sides in lobes like
//   those of metals (Kulla and Conty 2017): a m(v) m(l) / m_avg in front, (1 - a) m(v) m'(l) / m'_avg
//   behind, m and m' what single scattering misses from this side and from the other. Lossless and
//   reciprocal where (1 - a) m_avg n^2 is the same from both sides; it is that of all light that
//   Fresnel's equations let through on average, of the lesser of m_avg and m'_avg.
// - Where light goes through, reflection takes Fresnel's equations in place of Schlick's
//   approximation, scaled to the material's f0 and f90: both sides and total reflection are right.
// - Radiance is scaled with (n_v / n_l)^2 where the path changes its medium.
#ifndef HG_LIB_BSDF_GLSL
#define HG_LIB_BSDF_GLSL

#include "lib/brdf.glsl"
#include "lib/lobes.glsl"
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
    bool delta;          // the base's specular lobe is a mirror
    float p_specular;    // probabilities of hg_bsdf_sample; specular includes transmission
    // All that follows is for HG_FEATURE_LOBES.
    float p_coat, p_sheen, p_behind; // the rest is p_diffuse
    float p_diffuse;
    vec3 t, s;           // tangent frame with base.n
    vec3 v_ts;
    vec2 alpha;          // along t and s
    float mean_roughness; // of the tables of albedo
    float anisotropy;
    vec3 ms_dielectric;  // colour of the dielectric's several bounces
    vec3 glass_avg, glass_avg_behind; // m_avg and m'_avg of glass
    vec3 glass_v, glass_front; // m(v), a
    bool glass_plain;    // its facets reflect what the table's do
    bool exact;          // albedos of the dielectric are needed with Fresnel's equations
    vec3 f0_dielectric;
    float f90, f90_dielectric;
    float metallic;
    float eta;           // index of refraction behind the surface over that in front of it
    bool thin;           // transmission does not lead into another medium
    bool inside;         // the ray came from inside of a volume
    float transmission;  // share of all, metals taken off
    vec3 tint;           // of transmission, f0 of metal: the base colour
    vec3 behind;         // colour of what is diffusely transmitted, times its share
    vec3 attenuation;    // of the medium behind the surface, 1 / m (hg_bsdf_attenuation)
    float iridescence, film_ior, film_nm;
    vec3 coat_n;
    float coat, coat_roughness, coat_alpha, coat_n_dot_v;
    bool coat_delta;
    vec3 sheen;
    float sheen_max, sheen_roughness;
    vec2 sheen_albedo_v; // hg_sheen_albedo
    float coat_v, through_v; // T(v): of the coat, of all layers
    vec2 below_v;            // a and b of the base below the layers, at v
    float several_v, several_avg; // U(v), U_avg
    vec3 enter_v, enter_avg, enter_avg_behind; // S(v), S_avg
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

// For path tracing dispersion: gives the surface the index of one channel, chosen by u at the first
// surface that disperses (`channel` is 3 before). Returns what the path's throughput is multiplied
// with: three times its colour in that channel, so that the mean is right.
vec3 hg_surface_disperse(inout hg_surface s, inout uint channel, float u)
{
    if (!HG_HAS(HG_FEATURE_TRANSMISSION) || s.dispersion <= 0.0 || s.transmission <= 0.0)
        return vec3(1.0);
    vec3 factor = vec3(1.0);
    if (channel > 2u) {
        channel = min(uint(u * 3.0), 2u);
        factor = vec3(channel == 0u, channel == 1u, channel == 2u) * 3.0;
    }
    s.ior = hg_dispersed_ior(s.ior, s.dispersion, channel);
    s.f0 = hg_ior_f0(s.ior);
    return factor;
}

// --- albedos -------------------------------------------------------------------------------------

// Cosine at which the tables hold the albedo in a direction.
float hg_bsdf_cosine(hg_bsdf b, vec3 w_ts)
{
    float c = abs(w_ts.z);
    if (HG_HAS(HG_FEATURE_ANISOTROPY) && b.alpha.x != b.alpha.y)
        c = hg_aniso_cosine(w_ts, b.alpha, b.mean_roughness);
    return c;
}

// a and b of the split sum in a direction.
vec2 hg_bsdf_dfg(hg_bsdf b, vec3 w_ts)
{
    vec2 dfg = hg_dfg(hg_bsdf_cosine(b, w_ts), b.mean_roughness);
    if (HG_HAS(HG_FEATURE_ANISOTROPY) && b.alpha.x != b.alpha.y) {
        dfg = max(dfg + hg_aniso_correction(HG_ANISO_FIRST, w_ts, b.base.roughness, b.anisotropy), 0.0);
        dfg /= max(dfg.x + dfg.y, 1.0);
    }
    return dfg;
}

// What one facet reflects: of unpolarised light by Fresnel's equations, where the dielectric lets
// light through; of the dielectric and of the base as they are.
struct hg_reflectance {
    float exact;
    vec3 dielectric, base;
};

// v_dot_h: against the facet's normal, where eta is the index behind it over that in front of it.
hg_reflectance hg_bsdf_reflectance(hg_bsdf b, float v_dot_h, float eta, bool inside)
{
    float schlick = hg_schlick_weight(v_dot_h), w = schlick, outside = v_dot_h;
    hg_reflectance r;
    r.exact = 0.0;
    if (HG_HAS(HG_FEATURE_TRANSMISSION) && b.transmission > 0.0) {
        r.exact = hg_fresnel_dielectric(v_dot_h, eta);
        float normal = hg_ior_f0(eta);
        w = clamp((r.exact - normal) / max(1.0 - normal, 1e-6), 0.0, 1.0);
        if (inside) // the angle in front of the film
            outside = sqrt(max(1.0 - (1.0 - v_dot_h * v_dot_h) / (eta * eta), 0.0));
    }
    r.dielectric = b.f0_dielectric + (b.f90_dielectric - b.f0_dielectric) * w;
    vec3 metal = b.tint + (1.0 - b.tint) * schlick;
    if (HG_HAS(HG_FEATURE_IRIDESCENCE) && b.iridescence > 0.0)
        for (uint i = b.metallic < 1.0 ? 0u : 1u; i < (b.metallic > 0.0 ? 2u : 1u); i++) {
            vec3 film = hg_film_fresnel(
                outside, b.film_ior, b.film_nm, i == 0u ? b.f0_dielectric : b.tint);
            if (i == 0u)
                r.dielectric = mix(r.dielectric, film, b.iridescence);
            else
                metal = mix(metal, film, b.iridescence);
        }
    if (r.exact >= 1.0 && eta < 1.0)
        r.dielectric = vec3(1.0);
    r.base = mix(r.dielectric, metal, b.metallic);
    return r;
}

// Mean over facets of a direction: hg_facet_angles_at.
hg_reflectance hg_bsdf_facet_mean(hg_bsdf b, uint first, float cos_theta, float eta, bool inside)
{
    hg_reflectance sum;
    vec3 weights, at = hg_facet_angles_at(first, cos_theta, b.mean_roughness, weights);
    sum.exact = 0.0;
    sum.dielectric = sum.base = vec3(0.0);
    for (int i = 0; i < 3; i++) {
        hg_reflectance r = hg_bsdf_reflectance(b, at[i], eta, inside);
        sum.exact += weights[i] * r.exact;
        sum.dielectric += weights[i] * r.dielectric;
        sum.base += weights[i] * r.base;
    }
    return sum;
}

// Of those that reflect light of a direction, dfg: hg_bsdf_dfg there.
hg_reflectance hg_bsdf_mean_reflectance(
    hg_bsdf b, float cos_theta, vec2 dfg, float eta, bool inside)
{
    if (b.exact)
        return hg_bsdf_facet_mean(b, HG_ANGLES_FIRST, cos_theta, eta, inside);
    float schlick = dfg.y / max(dfg.x + dfg.y, 1e-6);
    return hg_reflectance(0.0, b.f0_dielectric + (b.f90_dielectric - b.f0_dielectric) * schlick,
        b.base.f0 + (b.f90 - b.base.f0) * schlick);
}

// Directional albedo of the base's single reflection, below the layers where dfg is.
vec3 hg_bsdf_single_albedo(hg_bsdf b, float cos_theta, vec2 dfg)
{
    return hg_bsdf_mean_reflectance(b, cos_theta, dfg, b.eta, b.inside).base * (dfg.x + dfg.y);
}

// Share of light that the dielectric's specular part keeps from what is below: of the largest
// channel for all, of each below a film. mean: hg_bsdf_mean_reflectance there. through: what the
// layers in dfg let through, 1 without.
vec3 hg_bsdf_dielectric_albedo(hg_bsdf b, vec3 mean, vec2 dfg, float through)
{
    bool film = HG_HAS(HG_FEATURE_IRIDESCENCE) && b.iridescence > 0.0;
    vec3 single = film ? mean : vec3(hg_max3(mean));
    return min(
        single * (dfg.x + dfg.y) + b.ms_dielectric * max(through - dfg.x - dfg.y, 0.0), through);
}

// Share of light that a coat lets through; one that faces away does nothing.
float hg_coat_through(float coat, float roughness, float cos_theta)
{
    if (!HG_HAS(HG_FEATURE_CLEARCOAT) || cos_theta <= 0.0)
        return 1.0;
    vec2 dfg = hg_dfg(cos_theta, roughness);
    return 1.0 - coat * (HG_DIELECTRIC_F0 * dfg.x + dfg.y);
}

float hg_bsdf_coat_through(hg_bsdf b, float cos_theta)
{
    return hg_coat_through(b.coat, b.coat_roughness, cos_theta);
}

// What lies over the base at a direction.
struct hg_bsdf_layers {
    float coat, sheen, through; // T: of the coat, of the sheen, of both
    vec2 sheen_albedo;
};

const hg_bsdf_layers hg_bsdf_no_layers = hg_bsdf_layers(1.0, 1.0, 1.0, vec2(0.0));

// Cosines: against the coat's normal and against the base's.
hg_bsdf_layers hg_bsdf_layers_at(hg_bsdf b, float coat_cos, float cos_theta)
{
    hg_bsdf_layers o = hg_bsdf_no_layers;
    o.coat = hg_bsdf_coat_through(b, min(coat_cos, 1.0));
    if (HG_HAS(HG_FEATURE_SHEEN)) {
        o.sheen_albedo = hg_sheen_albedo(cos_theta, b.sheen_roughness);
        o.sheen = 1.0 - b.sheen_max * o.sheen_albedo.y;
    }
    o.through = o.coat * o.sheen;
    return o;
}

// a and b of the base with min(T(v), T(l)) of its layers. cos_theta: hg_bsdf_cosine.
vec2 hg_bsdf_dfg_below(hg_bsdf b, float cos_theta, vec2 dfg, hg_bsdf_layers over)
{
    vec2 below = dfg * over.through;
    if (HG_HAS(HG_FEATURE_CLEARCOAT) && over.coat < 1.0)
        below -= (b.coat * over.sheen) *
            hg_layer_loss(HG_COAT_FIRST, cos_theta, b.mean_roughness, b.coat_roughness);
    if (HG_HAS(HG_FEATURE_SHEEN) && over.sheen < 1.0)
        below -= (b.sheen_max * over.coat) *
            hg_layer_loss(HG_CLOTH_FIRST, cos_theta, b.mean_roughness, b.sheen_roughness);
    return max(below, 0.0);
}

// Gauss-Jacobi: cosines and weights of cosine-weighted means, exact for Schlick's term.
const vec4 hg_gauss_x = vec4(0.13975986, 0.41640957, 0.72315699, 0.94289580);
const vec4 hg_gauss_w = vec4(0.06236194, 0.25969510, 0.40692914, 0.27101383);

// Means of S, which layers bend, and of U; for what is scattered behind that of S on both sides, of
// which the larger one counts.
void hg_bsdf_make_enter(inout hg_bsdf b)
{
    bool both = HG_HAS(HG_FEATURE_TRANSMISSION) && HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) &&
        !b.thin && b.transmission > 0.0 && hg_max3(b.behind) > 0.0;
    b.enter_avg_behind = vec3(0.0);
    b.several_avg = 1.0 - b.base.dfg_avg.x - b.base.dfg_avg.y;
    for (uint k = both ? 0u : 1u; k < 2u; k++) {
        bool inside = b.inside != (k == 0u);
        b.enter_avg = vec3(0.0);
        for (int i = 0; i < 4; i++) {
            float c = hg_gauss_x[i];
            vec2 dfg = hg_dfg(c, b.mean_roughness);
            hg_bsdf_layers over = hg_bsdf_no_layers;
            vec2 below = dfg;
            if (!inside) {
                over = hg_bsdf_layers_at(b, c, c);
                below = hg_bsdf_dfg_below(b, c, dfg, over);
            }
            vec3 mean = hg_bsdf_mean_reflectance(
                b, c, below, k == 0u ? 1.0 / b.eta : b.eta, inside).dielectric;
            vec3 albedo = hg_bsdf_dielectric_albedo(b, mean, below, over.through);
            b.enter_avg += hg_gauss_w[i] * (over.through - albedo);
            vec2 held = dfg - below;
            if (k == 1u)
                b.several_avg += hg_gauss_w[i] * (held.x + held.y + over.through - 1.0);
        }
        b.enter_avg = max(b.enter_avg, 1e-4);
        b.enter_avg_behind = max(b.enter_avg_behind, b.enter_avg);
    }
    b.several_avg = max(b.several_avg, 1e-4);
}

// --- making one ----------------------------------------------------------------------------------

void hg_bsdf_make_film(inout hg_bsdf b, hg_surface s)
{
    b.iridescence = b.film_ior = b.film_nm = 0.0;
    if (HG_HAS(HG_FEATURE_IRIDESCENCE)) {
        b.iridescence = s.iridescence_nm > 0.0 ? s.iridescence : 0.0;
        b.film_ior = s.iridescence_ior;
        b.film_nm = s.iridescence_nm;
    }
}

// Colours of what is reflected twice or more. See hg_multiple_scattering_color.
void hg_bsdf_make_several(inout hg_bsdf b)
{
    float e_avg = b.base.dfg_avg.x + b.base.dfg_avg.y;
    // The mean of Schlick's term with f90 is f0 + (f90 - f0) / 21, linear as with 1.
    vec3 dielectric = 20.0 / 21.0 * b.f0_dielectric + b.f90_dielectric / 21.0;
    vec3 metal = 20.0 / 21.0 * b.tint + 1.0 / 21.0;
    if (HG_HAS(HG_FEATURE_IRIDESCENCE) && b.iridescence > 0.0) {
        for (uint k = b.metallic < 1.0 ? 0u : 1u; k < (b.metallic > 0.0 ? 2u : 1u); k++) {
            vec3 film = vec3(0.0);
            for (int i = 0; i < 4; i++)
                film += hg_gauss_w[i] * hg_film_fresnel(hg_gauss_x[i], b.film_ior, b.film_nm,
                    k == 0u ? b.f0_dielectric : b.tint);
            if (k == 0u)
                dielectric = mix(dielectric, film, b.iridescence);
            else
                metal = mix(metal, film, b.iridescence);
        }
    }
    vec3 below = dielectric * dielectric * e_avg / (1.0 - dielectric * (1.0 - e_avg));
    b.base.f_ms = mix(below, metal * metal * e_avg / (1.0 - metal * (1.0 - e_avg)), b.metallic);
    b.base.f_ms_dielectric = hg_max3(below);
    b.ms_dielectric = b.iridescence > 0.0 ? below : vec3(b.base.f_ms_dielectric);
}

// hg_glass_miss in a direction. table_cos: hg_bsdf_cosine.
float hg_bsdf_glass_table(hg_bsdf b, vec3 w_ts, float table_cos, float eta)
{
    float miss = hg_glass_miss(table_cos, b.mean_roughness, eta).x;
    if (!HG_HAS(HG_FEATURE_ANISOTROPY) || b.alpha.x == b.alpha.y)
        return miss;
    // About the same for all indices, none where light is not bent.
    float bends = min(abs(eta - 1.0) / (0.05 * (eta + 1.0)), 1.0);
    vec2 more =
        hg_aniso_correction(HG_BRUSHED_FIRST, w_ts, b.base.roughness, b.anisotropy) * bends;
    return clamp(miss + (eta < 1.0 ? more.y : more.x), 0.0, 1.0);
}

// Its mean over all light of that side.
float hg_bsdf_glass_table_average(hg_bsdf b, float eta)
{
    float miss = hg_glass_miss_average(b.mean_roughness, eta).x;
    if (!HG_HAS(HG_FEATURE_ANISOTROPY) || b.alpha.x == b.alpha.y)
        return miss;
    vec2 more = hg_aniso_mean(HG_BRUSHED_MEANS, b.base.roughness, b.anisotropy) * HG_BRUSHED_MOST;
    return miss * (eta < 1.0 ? more.y : more.x);
}

// What rough glass misses in a direction where its table says `miss`: there each facet reflects
// `exact` of the light and lets the rest through, here it reflects `dielectric`. Of what is let
// through the same share arrives. eta as seen from this side, mean: hg_bsdf_mean_reflectance there.
vec3 hg_bsdf_glass_miss(hg_bsdf b, float miss, float cos_theta, vec2 dfg, float eta, bool inside,
    hg_reflectance mean)
{
    float e = dfg.x + dfg.y;
    if (b.glass_plain)
        return vec3(miss);
    hg_reflectance lost = hg_bsdf_facet_mean(b, HG_LOST_FIRST, cos_theta, eta, inside);
    float met = mean.exact * e + lost.exact * (1.0 - e);
    vec3 more = (mean.dielectric - mean.exact) * e;
    float enters = clamp((1.0 - miss - mean.exact * e) / max(1.0 - met, 1e-4), 0.0, 1.0);
    vec3 met_more = more + (lost.dielectric - lost.exact) * (1.0 - e);
    return clamp(miss - more + met_more * enters, 0.0, 1.0);
}

// Mean of that over all light of one side, as Gauss's points say in proportion to the table's; r:
// mean of what the dielectric reflects on that side.
vec3 hg_bsdf_glass_average(hg_bsdf b, bool inside, out vec3 r)
{
    float eta = b.inside == inside ? b.eta : 1.0 / b.eta, table = 0.0;
    vec3 here = vec3(0.0);
    r = vec3(hg_fresnel_average(eta));
    if (b.glass_plain)
        return vec3(max(hg_bsdf_glass_table_average(b, eta), 1e-4));
    for (int i = 0; i < 4; i++) {
        float c = hg_gauss_x[i], miss = hg_glass_miss(c, b.mean_roughness, eta).x;
        vec2 dfg = hg_dfg(c, b.mean_roughness);
        hg_reflectance mean = hg_bsdf_mean_reflectance(b, c, dfg, eta, inside);
        here += hg_gauss_w[i] * hg_bsdf_glass_miss(b, miss, c, dfg, eta, inside, mean);
        table += hg_gauss_w[i] * miss;
        hg_reflectance mirror = hg_bsdf_reflectance(b, c, eta, inside);
        r += hg_gauss_w[i] * (mirror.dielectric - mirror.exact);
    }
    return max(here / max(table, 1e-6) * hg_bsdf_glass_table_average(b, eta), 1e-4);
}

// What facets of glass give back after several bounces, and what that leaves to opaque layers.
void hg_bsdf_make_glass(inout hg_bsdf b, hg_reflectance mean, float cos_v)
{
    b.glass_v = b.glass_front = vec3(0.0);
    b.glass_avg = b.glass_avg_behind = vec3(1.0);
    if (!HG_HAS(HG_FEATURE_TRANSMISSION) || b.thin || b.transmission <= 0.0)
        return;
    float miss = hg_bsdf_glass_table(b, b.v_ts, cos_v, b.eta);
    b.glass_v = hg_bsdf_glass_miss(b, miss, cos_v, b.base.dfg_v, b.eta, b.inside, mean);
    vec3 r, from_outside = hg_bsdf_glass_average(b, false, r), unused;
    vec3 from_inside = hg_bsdf_glass_average(b, true, unused);
    // What enters from outside is n^2 times what leaves: (1 - a) m_avg n^2 is the same both ways.
    float n2 = b.inside ? b.eta * b.eta : 1.0;
    vec3 enters = (1.0 - r) * min(from_outside, from_inside) * n2;
    b.glass_avg = b.inside ? from_inside : from_outside;
    b.glass_avg_behind = b.inside ? from_outside : from_inside;
    b.glass_front = 1.0 - enters / b.glass_avg;
    b.base.f_ms -= b.transmission * b.ms_dielectric;
}

// The base's parameters where the dielectric has a colour, another index or another f90.
void hg_bsdf_make_base(inout hg_bsdf b, hg_surface s, float f0)
{
    b.f0_dielectric = min(vec3(f0) * s.specular_color, 1.0) * s.specular;
    b.f90_dielectric = s.specular;
    b.metallic = clamp(s.metallic, 0.0, 1.0);
    b.f90 = mix(b.f90_dielectric, 1.0, b.metallic);
    b.base.f0_dielectric = hg_max3(b.f0_dielectric);
    b.base.f0 = mix(b.f0_dielectric, s.base_color, b.metallic);
    vec3 d = vec3(dot(b.t, b.base.v), dot(b.s, b.base.v), dot(b.base.n, b.base.v));
    b.v_ts = normalize(vec3(d.xy, max(d.z, 1e-4)));
    b.alpha = vec2(b.base.alpha);
    b.mean_roughness = b.base.roughness;
    b.anisotropy = 0.0;
    if (HG_HAS(HG_FEATURE_ANISOTROPY)) {
        b.anisotropy = clamp(s.anisotropy, 0.0, 1.0);
        b.alpha = hg_aniso_alpha(b.base.alpha, b.anisotropy);
        if (b.alpha.x != b.alpha.y)
            b.mean_roughness = hg_aniso_roughness(b.alpha);
    }
    b.base.dfg_v = hg_bsdf_dfg(b, b.v_ts);
    b.base.dfg_avg = hg_dfg_average(b.mean_roughness);
    if (HG_HAS(HG_FEATURE_ANISOTROPY) && b.alpha.x != b.alpha.y)
        b.base.dfg_avg += hg_aniso_average_correction(b.base.roughness, b.anisotropy);
    hg_bsdf_make_film(b, s);
    hg_bsdf_make_several(b);
}

// cos_v: hg_bsdf_cosine of v.
void hg_bsdf_make_layers(inout hg_bsdf b, hg_surface s, float cos_v)
{
    b.coat = 0.0;
    b.coat_n = b.base.n;
    b.coat_n_dot_v = b.base.n_dot_v;
    b.coat_delta = false;
    b.coat_roughness = b.coat_alpha = 0.0;
    if (HG_HAS(HG_FEATURE_CLEARCOAT)) {
        b.coat_n = s.clearcoat_normal;
        b.coat_n_dot_v = max(dot(b.coat_n, b.base.v), 1e-4);
        b.coat_roughness = clamp(s.clearcoat_roughness, 0.0, 1.0);
        float clamped = max(b.coat_roughness, HG_MIN_ROUGHNESS);
        b.coat_alpha = clamped * clamped;
        b.coat_delta = b.coat_roughness < HG_DELTA_ROUGHNESS;
        b.coat = s.clearcoat;
    }
    b.sheen = vec3(0.0);
    b.sheen_max = 0.0;
    b.sheen_roughness = s.sheen_roughness;
    if (HG_HAS(HG_FEATURE_SHEEN)) {
        b.sheen = s.sheen_color;
        b.sheen_max = min(hg_max3(b.sheen), 1.0);
    }
    hg_bsdf_layers over = hg_bsdf_no_layers;
    b.below_v = b.base.dfg_v;
    if (!b.inside) {
        over = hg_bsdf_layers_at(b, dot(b.coat_n, b.base.v), b.base.n_dot_v);
        b.below_v = hg_bsdf_dfg_below(b, cos_v, b.base.dfg_v, over);
    }
    b.sheen_albedo_v = over.sheen_albedo;
    b.coat_v = over.coat;
    b.through_v = over.through;
    b.several_v = max(b.through_v - b.below_v.x - b.below_v.y, 0.0);
}

// Shares of what leaves under uniform light, about: the chances of the lobes.
// reflected: albedo of the base's single reflection below the layers.
void hg_bsdf_make_chances(inout hg_bsdf b, vec3 reflected)
{
    float miss = 1.0 - b.base.dfg_v.x - b.base.dfg_v.y;
    float through = b.transmission * hg_max3(b.tint * b.enter_v);
    // Scattered twice or more, to both sides.
    vec2 wide = vec2(b.thin ? 0.5 * through * miss : 0.0);
    if (HG_HAS(HG_FEATURE_TRANSMISSION) && !b.thin)
        wide = (b.transmission * b.through_v) * vec2(hg_max3(b.glass_v * b.glass_front),
            hg_max3(b.glass_v * (1.0 - b.glass_front) * b.tint));
    float specular = hg_max3(reflected) + max(through - wide.x - wide.y, 0.0);
    float diffuse =
        hg_max3(b.base.diffuse * b.enter_v) + hg_max3(b.base.f_ms) * b.several_v + wide.x;
    float behind = hg_max3(b.behind * b.enter_v) + wide.y;
    specular = max(specular, 0.1 * (specular + diffuse + behind));
    float coat = b.inside ? 0.0 : 1.0 - b.coat_v;
    float sheen = b.inside ? 0.0 : b.sheen_max * b.sheen_albedo_v.y * b.coat_v;
    float sum = 1.0 / max(specular + diffuse + behind + coat + sheen, 1e-6);
    b.p_coat = coat * sum;
    b.p_sheen = sheen * sum;
    b.p_specular = specular * sum;
    b.p_diffuse = diffuse * sum;
    b.p_behind = behind * sum;
}

void hg_bsdf_make_lobes(inout hg_bsdf b, hg_surface s, float ior_outside)
{
    hg_basis(b.base.n, b.t, b.s);
    if (HG_HAS(HG_FEATURE_ANISOTROPY)) {
        b.t = hg_orthogonal(s.tangent, b.base.n);
        b.s = cross(b.base.n, b.t);
    }
    bool lets_through = (HG_HAS(HG_FEATURE_TRANSMISSION) && s.transmission > 0.0) ||
        (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) && s.diffuse_transmission > 0.0);
    b.thin = s.thickness <= 0.0 || !lets_through;
    b.inside = !b.thin && !s.front;
    b.attenuation = s.attenuation;
    float ior = s.ior, f0 = s.f0;
    if (ior_outside != 1.0) {
        float root = sqrt(min(s.f0, 0.9999));
        ior = (1.0 + root) / (1.0 - root);
        f0 = hg_ior_f0(ior / ior_outside);
    }
    b.eta = b.inside ? ior_outside / ior : ior / ior_outside;
    b.tint = s.base_color;
    b.exact = false;
    hg_bsdf_make_base(b, s, f0);
    float dielectric = 1.0 - b.metallic;
    b.transmission = HG_HAS(HG_FEATURE_TRANSMISSION) ? s.transmission * dielectric : 0.0;
    float spread = HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) ? s.diffuse_transmission : 0.0;
    float opaque = HG_HAS(HG_FEATURE_TRANSMISSION) ? dielectric * (1.0 - s.transmission) : dielectric;
    b.base.diffuse = s.base_color * (opaque * (1.0 - spread));
    b.behind = s.diffuse_transmission_color * (opaque * spread);
    b.glass_plain = b.f90_dielectric == 1.0 && b.iridescence == 0.0 &&
        all(lessThan(abs(b.f0_dielectric - hg_ior_f0(b.eta)), vec3(1e-4)));
    bool mixed = !b.glass_plain || opaque > 0.0;
    b.exact = HG_HAS(HG_FEATURE_TRANSMISSION) && b.transmission > 0.0 && mixed;
    b.exact = b.exact || (HG_HAS(HG_FEATURE_IRIDESCENCE) && b.iridescence > 0.0);
    float cos_v = hg_bsdf_cosine(b, b.v_ts);
    hg_bsdf_make_layers(b, s, cos_v);
    hg_reflectance mean = hg_bsdf_mean_reflectance(b, cos_v, b.below_v, b.eta, b.inside);
    hg_bsdf_make_glass(b, mean, cos_v);
    b.enter_v =
        b.through_v - hg_bsdf_dielectric_albedo(b, mean.dielectric, b.below_v, b.through_v);
    hg_bsdf_make_enter(b);
    b.delta = b.delta && b.alpha.x < 1e-2;
    hg_bsdf_make_chances(b, mean.base * (b.below_v.x + b.below_v.y));
}

// s.normal faces view_ws. ior_outside: of the medium around closed surfaces, 1 for air.
hg_bsdf hg_bsdf_make(hg_surface s, vec3 view_ws, float ior_outside)
{
    hg_bsdf b;
    float n_dot_v = dot(s.normal, view_ws);
    vec3 n = n_dot_v < 1e-3 ? normalize(s.normal + view_ws * (1e-3 - n_dot_v)) : s.normal;
    b.base = hg_brdf_make(s.base_color, s.metallic, s.roughness, s.f0, n, view_ws);
    b.delta = s.roughness < HG_DELTA_ROUGHNESS;
    b.p_specular = hg_brdf_specular_probability(b.base);
    if (HG_HAS(HG_FEATURE_LOBES))
        hg_bsdf_make_lobes(b, s, ior_outside);
    else {
        b.thin = true;
        b.inside = false;
        b.eta = 1.0;
        b.transmission = 0.0;
        b.attenuation = vec3(0.0);
    }
    return b;
}

// Emission towards v below the coat, of what the material emits.
vec3 hg_bsdf_emission(hg_bsdf b, vec3 emissive)
{
    return HG_HAS(HG_FEATURE_CLEARCOAT) ? emissive * b.coat_v : emissive;
}

// The same where no BSDF was made yet.
vec3 hg_surface_emission(hg_surface s, vec3 view_ws)
{
    bool closed = s.thickness > 0.0 && (s.transmission > 0.0 || s.diffuse_transmission > 0.0);
    if (!HG_HAS(HG_FEATURE_CLEARCOAT) || (closed && !s.front))
        return s.emissive;
    float roughness = clamp(s.clearcoat_roughness, 0.0, 1.0);
    return s.emissive * hg_coat_through(s.clearcoat, roughness, dot(s.clearcoat_normal, view_ws));
}

// --- the base alone ------------------------------------------------------------------------------

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

vec3 hg_bsdf_evaluate_base(hg_bsdf b, vec3 l, out float pdf)
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

hg_bsdf_sample_result hg_bsdf_sample_base(hg_bsdf b, vec3 u)
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
    vec3 f = hg_bsdf_evaluate_base(b, r.direction, r.pdf);
    r.weight = r.pdf > 0.0 ? f / r.pdf : vec3(0.0);
    return r;
}

// --- facets: reflection and transmission ---------------------------------------------------------

// What a facet does: colours that it reflects and lets through, and the chance that it reflects.
struct hg_facet_light {
    vec3 reflected, transmitted;
    float p_reflect;
};

// v_dot_h: against the facet's normal on the side of v.
hg_facet_light hg_bsdf_facet(hg_bsdf b, float v_dot_h)
{
    hg_reflectance r = hg_bsdf_reflectance(b, v_dot_h, b.eta, b.inside);
    hg_facet_light f;
    f.reflected = r.base;
    f.transmitted = vec3(0.0);
    f.p_reflect = 1.0;
    if (!HG_HAS(HG_FEATURE_TRANSMISSION) || b.transmission <= 0.0)
        return f;
    f.transmitted = b.tint * (1.0 - r.dielectric) * b.transmission;
    float back = hg_max3(f.reflected), through = hg_max3(f.transmitted);
    f.p_reflect = back / max(back + through, 1e-9);
    return f;
}

// f |cos| of single scattering without layers, and its density within the specular lobe.
vec3 hg_bsdf_evaluate_facets(hg_bsdf b, vec3 l_ts, out float pdf)
{
    bool behind = l_ts.z < 0.0;
    vec3 up = vec3(l_ts.xy, abs(l_ts.z)); // thin-walled: reflected, then let through
    bool bent = behind && !b.thin;
    vec3 h = bent ? b.v_ts + b.eta * l_ts : b.v_ts + up;
    h *= inversesqrt(max(dot(h, h), 1e-20));
    h *= h.z < 0.0 ? -1.0 : 1.0;
    float v_dot_h = min(dot(b.v_ts, h), 1.0), l_dot_h = dot(l_ts, h);
    pdf = 0.0;
    if (v_dot_h <= 0.0 || (bent && l_dot_h >= 0.0))
        return vec3(0.0);
    float lambda_v = hg_aniso_lambda(b.v_ts, b.alpha), lambda_l = hg_aniso_lambda(up, b.alpha);
    float d = hg_aniso_d(h, b.alpha);
    float g2 = 1.0 / (1.0 + lambda_v + lambda_l); // Heitz 2014 eq. 99
    hg_facet_light f = hg_bsdf_facet(b, v_dot_h);
    // Density of facets seen from v, and of directions over that of facets: Walter et al. 2007
    // eq. 14 and 17.
    float jacobian = 1.0 / (4.0 * v_dot_h), scale = 1.0;
    if (bent) {
        float k = v_dot_h + b.eta * l_dot_h;
        jacobian = b.eta * b.eta * -l_dot_h / max(k * k, 1e-12);
        scale = 1.0 / (b.eta * b.eta);
    }
    float seen = d * v_dot_h / b.v_ts.z * jacobian; // without shadowing of either side
    pdf = seen / (1.0 + lambda_v) * (behind ? 1.0 - f.p_reflect : f.p_reflect);
    return (behind ? f.transmitted * scale : f.reflected) * (seen * g2);
}

// --- wide lobes: diffuse to both sides, multiple scattering --------------------------------------

// f |cos| below the layers that are over l.
vec3 hg_bsdf_evaluate_diffuse(hg_bsdf b, vec3 l_ts, hg_bsdf_layers over)
{
    float cos_l = abs(l_ts.z), shape = HG_INV_PI * cos_l;
    bool behind = l_ts.z < 0.0;
    vec2 dfg_l = hg_bsdf_dfg(b, l_ts);
    float table_l = hg_bsdf_cosine(b, l_ts), layers = min(b.through_v, over.through);
    vec2 below_l = hg_bsdf_dfg_below(b, table_l, dfg_l, over);
    float several_l = max(over.through - below_l.x - below_l.y, 0.0);
    float twice = b.several_v * several_l / b.several_avg;
    bool below = behind && !b.thin;
    float eta_l = below ? 1.0 / b.eta : b.eta;
    hg_reflectance mean_l =
        hg_bsdf_mean_reflectance(b, table_l, below_l, eta_l, b.inside != below);
    vec3 enter_l = over.through -
        hg_bsdf_dielectric_albedo(b, mean_l.dielectric, below_l, over.through);
    vec3 enter = b.enter_v * enter_l / (behind ? b.enter_avg_behind : b.enter_avg);
    vec3 sum = behind ? b.behind * enter : b.base.diffuse * enter + b.base.f_ms * twice;
    if (HG_HAS(HG_FEATURE_TRANSMISSION) && b.thin)
        sum += b.tint * (0.5 * b.transmission) * (1.0 - b.ms_dielectric) * twice;
    else if (HG_HAS(HG_FEATURE_TRANSMISSION) && b.transmission > 0.0) {
        float miss = hg_bsdf_glass_table(b, l_ts, table_l, eta_l);
        vec3 glass = b.transmission * layers * b.glass_v *
            hg_bsdf_glass_miss(b, miss, table_l, dfg_l, eta_l, b.inside != below, mean_l);
        if (behind)
            sum += b.tint * glass * (1.0 - b.glass_front) / (b.glass_avg_behind * b.eta * b.eta);
        else
            sum += glass * b.glass_front / b.glass_avg;
    }
    return sum * shape;
}

// --- layers --------------------------------------------------------------------------------------

// f cos of the coat, and its density. No lobe of a mirror.
vec3 hg_bsdf_evaluate_coat(hg_bsdf b, vec3 l, out float pdf)
{
    float n_dot_l = dot(b.coat_n, l);
    pdf = 0.0;
    if (b.coat_v >= 1.0 || b.coat_delta || n_dot_l <= 0.0)
        return vec3(0.0);
    vec3 h = normalize(b.base.v + l), c = cross(b.coat_n, h);
    float v_dot_h = clamp(dot(b.base.v, h), 0.0, 1.0);
    float d = hg_ggx_d(clamp(dot(b.coat_n, h), 0.0, 1.0), dot(c, c), b.coat_alpha);
    pdf = hg_smith_g1(b.coat_n_dot_v, b.coat_alpha) * d / (4.0 * b.coat_n_dot_v);
    float f = hg_schlick(vec3(HG_DIELECTRIC_F0), v_dot_h).x;
    return vec3(b.coat * f * d * hg_smith_v(n_dot_l, b.coat_n_dot_v, b.coat_alpha) * n_dot_l);
}

// f cos of the sheen below the coat; over: the layers over l.
vec3 hg_bsdf_evaluate_sheen(hg_bsdf b, vec3 l, float n_dot_l, hg_bsdf_layers over)
{
    float alpha = hg_sheen_alpha(b.sheen_roughness);
    vec3 c = cross(b.base.n, normalize(b.base.v + l));
    float d = hg_sheen_d(dot(c, c), alpha);
    float lambda = hg_sheen_lambda(b.base.n_dot_v, alpha) + hg_sheen_lambda(n_dot_l, alpha);
    // Single scattering alone gives more than arrives where its albedo is above 1.
    float most = max(max(b.sheen_albedo_v.x, over.sheen_albedo.x), 1.0);
    float coat = min(b.coat_v, over.coat);
    return b.sheen * (d * coat / ((1.0 + lambda) * 4.0 * b.base.n_dot_v * most));
}

// --- all of it -----------------------------------------------------------------------------------

vec3 hg_bsdf_evaluate_lobes(hg_bsdf b, vec3 l, out float pdf)
{
    vec3 l_ts = vec3(dot(b.t, l), dot(b.s, l), dot(b.base.n, l));
    bool behind = l_ts.z < 0.0;
    float cos_l = min(abs(l_ts.z), 1.0), part = 0.0;
    pdf = 0.0;
    if (cos_l < 1e-6 || (behind && b.transmission <= 0.0 && hg_max3(b.behind) <= 0.0))
        return vec3(0.0);
    // Layers are on the outside of volumes, on both sides of what is thin.
    hg_bsdf_layers over = hg_bsdf_no_layers;
    if (b.thin || b.inside == behind)
        over = hg_bsdf_layers_at(b, dot(b.coat_n, l) * (behind ? -1.0 : 1.0), cos_l);
    vec3 sum = vec3(0.0);
    if (!b.delta) {
        sum = hg_bsdf_evaluate_facets(b, l_ts, part) * min(b.through_v, over.through);
        pdf += b.p_specular * part;
    }
    sum += hg_bsdf_evaluate_diffuse(b, l_ts, over);
    pdf += (behind ? b.p_behind : b.p_diffuse) * cos_l * HG_INV_PI;
    if (HG_HAS(HG_FEATURE_SHEEN) && !behind && !b.inside) {
        sum += hg_bsdf_evaluate_sheen(b, l, cos_l, over);
        pdf += b.p_sheen * (0.5 * HG_INV_PI);
    }
    if (HG_HAS(HG_FEATURE_CLEARCOAT) && !behind) {
        sum += hg_bsdf_evaluate_coat(b, l, part);
        pdf += b.p_coat * part;
    }
    return sum;
}

// One facet's direction: h and the choice between reflection and transmission.
vec3 hg_bsdf_sample_facet(hg_bsdf b, vec3 h, float choice, inout hg_bsdf_sample_result r)
{
    float v_dot_h = dot(b.v_ts, h);
    hg_facet_light f = hg_bsdf_facet(b, v_dot_h);
    bool reflects = choice < f.p_reflect;
    vec3 mirrored = 2.0 * v_dot_h * h - b.v_ts, l = mirrored;
    float radiance = 1.0;
    bool good = true;
    if (!reflects) {
        r.lobe |= HG_LOBE_TRANSMISSION;
        l = vec3(mirrored.xy, -mirrored.z);
        if (!b.thin) {
            good = hg_refract(b.v_ts, h, b.eta, l);
            radiance = 1.0 / (b.eta * b.eta);
        }
    }
    if (b.delta) {
        float p = b.p_specular * (reflects ? f.p_reflect : 1.0 - f.p_reflect);
        r.lobe |= HG_LOBE_DELTA;
        r.pdf = good && p > 0.0 ? p : 0.0;
        r.weight = (reflects ? f.reflected : f.transmitted * radiance) / max(p, 1e-9);
    } else if (!good || (l.z > 0.0) != reflects)
        r.lobe = 0u; // back into the surface
    return l;
}

hg_bsdf_sample_result hg_bsdf_sample_lobes(hg_bsdf b, vec3 u)
{
    hg_bsdf_sample_result r;
    r.weight = vec3(0.0);
    r.pdf = 0.0;
    r.direction = b.base.n;
    vec3 n = b.base.n, t = b.t, s = b.s, d = vec3(0.0, 0.0, 1.0);
    float z = u.z;
    bool coat = z < b.p_coat;
    z -= b.p_coat;
    bool specular = !coat && z < b.p_specular;
    float choice = clamp(z / max(b.p_specular, 1e-9), 0.0, 0.99999994);
    z -= b.p_specular;
    bool sheen = !coat && !specular && z < b.p_sheen;
    z -= b.p_sheen;
    bool behind = !coat && !specular && !sheen && z < b.p_behind;
    r.lobe = coat || specular || sheen ? HG_LOBE_SPECULAR : HG_LOBE_DIFFUSE;
    if (sheen) // uniform
        r.lobe = HG_LOBE_DIFFUSE;
    if (coat) {
        n = b.coat_n;
        hg_basis(n, t, s);
        vec3 v = normalize(vec3(dot(b.base.v, t), dot(b.base.v, s), b.coat_n_dot_v));
        vec3 h = vec3(0.0, 0.0, 1.0);
        if (!b.coat_delta)
            h = hg_sample_ggx_vndf(v, b.coat_alpha, u.xy);
        d = 2.0 * dot(v, h) * h - v;
    } else if (specular) {
        vec3 h = vec3(0.0, 0.0, 1.0);
        if (!b.delta)
            h = hg_sample_aniso_vndf(b.v_ts, b.alpha, u.xy);
        d = hg_bsdf_sample_facet(b, h, choice, r);
    } else if (sheen) {
        float sine = sqrt(max(0.0, 1.0 - u.x * u.x)), phi = 2.0 * HG_PI * u.y;
        d = vec3(sine * cos(phi), sine * sin(phi), u.x);
    } else {
        d = hg_sample_cosine(u.xy);
        d.z = behind ? -d.z : d.z;
        r.lobe |= behind ? HG_LOBE_TRANSMISSION : 0u;
    }
    r.direction = normalize(t * d.x + s * d.y + n * d.z);
    if (coat && b.coat_delta) {
        r.lobe |= HG_LOBE_DELTA;
        r.pdf = b.p_coat;
        r.weight = vec3(b.coat * hg_schlick(vec3(HG_DIELECTRIC_F0), b.coat_n_dot_v).x / b.p_coat);
        return r;
    }
    if (specular && b.delta) {
        float through_l = 1.0;
        bool below = (r.lobe & HG_LOBE_TRANSMISSION) != 0u;
        if (b.thin || b.inside == below)
            through_l = hg_bsdf_layers_at(
                b, dot(b.coat_n, r.direction) * (below ? -1.0 : 1.0), abs(d.z)).through;
        r.weight *= min(b.through_v, through_l);
        return r;
    }
    // Back into the surface, where other lobes may lead but this one has no density.
    if (coat && min(dot(b.coat_n, r.direction), dot(b.base.n, r.direction)) <= 0.0)
        return r;
    if (r.lobe == 0u)
        return r;
    vec3 f = hg_bsdf_evaluate_lobes(b, r.direction, r.pdf);
    r.weight = r.pdf > 0.0 ? f / r.pdf : vec3(0.0);
    return r;
}

// f(v, l) |n.l| of all lobes that are not delta, and the density of hg_bsdf_sample. l may lie on
// either side.
vec3 hg_bsdf_evaluate(hg_bsdf b, vec3 l, out float pdf)
{
    if (HG_HAS(HG_FEATURE_LOBES))
        return hg_bsdf_evaluate_lobes(b, l, pdf);
    return hg_bsdf_evaluate_base(b, l, pdf);
}

// The part of hg_bsdf_evaluate that is reflected diffusely, sheen with it: all else to this side is
// specular. l on the side of the viewer.
vec3 hg_bsdf_evaluate_diffuse_part(hg_bsdf b, vec3 l)
{
    if (!HG_HAS(HG_FEATURE_LOBES)) {
        hg_brdf base = b.base;
        base.f_ms = vec3(0.0);
        return hg_bsdf_evaluate_wide(base, clamp(dot(b.base.n, l), 0.0, 1.0));
    }
    vec3 l_ts = vec3(dot(b.t, l), dot(b.s, l), dot(b.base.n, l));
    float cos_l = min(l_ts.z, 1.0);
    if (cos_l < 1e-6)
        return vec3(0.0);
    hg_bsdf_layers over = hg_bsdf_no_layers;
    if (!b.inside)
        over = hg_bsdf_layers_at(b, dot(b.coat_n, l), cos_l);
    hg_bsdf wide = b;
    wide.base.f_ms = vec3(0.0);
    wide.transmission = 0.0;
    vec3 sum = hg_bsdf_evaluate_diffuse(wide, l_ts, over);
    if (HG_HAS(HG_FEATURE_SHEEN) && !b.inside)
        sum += hg_bsdf_evaluate_sheen(b, l, cos_l, over);
    return sum;
}

// Direction of an incoming path for three random numbers in [0, 1).
hg_bsdf_sample_result hg_bsdf_sample(hg_bsdf b, vec3 u)
{
    if (HG_HAS(HG_FEATURE_LOBES))
        return hg_bsdf_sample_lobes(b, u);
    return hg_bsdf_sample_base(b, u);
}

#endif
