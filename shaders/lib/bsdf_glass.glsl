// bsdf_glass.glsl - light within and between facets of glass: absorption, dispersion, bounces.
//
// What rough glass scatters more than once between its facets leaves on both sides in lobes like
// those of metals (Kulla and Conty 2017): a m(v) m(l) / m_avg in front, (1 - a) m(v) m'(l) / m'_avg
// behind, m and m' what single scattering misses from this side and from the other. Lossless and
// reciprocal where (1 - a) m_avg n^2 is the same from both sides; it is that of all light that
// Fresnel's equations let through on average, of the lesser of m_avg and m'_avg.
#ifndef HG_LIB_BSDF_GLASS_GLSL
#define HG_LIB_BSDF_GLASS_GLSL

#include "lib/bsdf_facets.glsl"

// Gauss-Jacobi: cosines and weights of cosine-weighted means, exact for Schlick's term.
const vec4 hg_gauss_x = vec4(0.13975986, 0.41640957, 0.72315699, 0.94289580);
const vec4 hg_gauss_w = vec4(0.06236194, 0.25969510, 0.40692914, 0.27101383);

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

// --- several bounces between its facets ----------------------------------------------------------

// hg_glass_miss in a direction. table_cos: hg_bsdf_cosine.
float hg_bsdf_glass_table(hg_bsdf b, vec3 w_ts, float table_cos, float eta)
{
    float miss = hg_glass_miss(table_cos, b.mean_roughness, eta).x;
    if (!HG_HAS(HG_FEATURE_ANISOTROPY) || b.alpha.x == b.alpha.y)
        return miss;
    miss += hg_brushed_correction(w_ts, b.base.roughness, b.anisotropy, eta).x;
    return clamp(miss, 0.0, 1.0);
}

// Its mean over all light of that side.
float hg_bsdf_glass_table_average(hg_bsdf b, float eta)
{
    float miss = hg_glass_miss_average(b.mean_roughness, eta).x;
    if (!HG_HAS(HG_FEATURE_ANISOTROPY) || b.alpha.x == b.alpha.y)
        return miss;
    return miss * hg_brushed_average_ratio(b.base.roughness, b.anisotropy, eta).x;
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

#endif
