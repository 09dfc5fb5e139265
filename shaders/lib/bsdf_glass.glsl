// bsdf_glass.glsl - light within and between facets of glass: absorption, dispersion, bounces.
//
// What rough glass scatters more than once between its facets leaves on both sides in lobes like
// those of metals (Kulla and Conty 2017): a m(v) m(l) / m_avg in front, (1 - a) m(v) m'(l) / m'_avg
// behind, m and m' what single scattering misses from this side and from the other. Lossless and
// reciprocal where (1 - a) m_avg n^2 is the same from both sides; it is that of all light that
// Fresnel's equations let through on average, of the lesser of m_avg and m'_avg.
#ifndef HG_LIB_BSDF_GLASS_GLSL
#define HG_LIB_BSDF_GLASS_GLSL

#include "lib/bsdf_microfacet.glsl"
#include "lib/bsdf_layers.glsl"

// Gauss-Jacobi: cosines and weights of cosine-weighted means, exact for Schlick's term.
const vec4 hg_gauss_x = vec4(0.13975986, 0.41640957, 0.72315699, 0.94289580);
const vec4 hg_gauss_w = vec4(0.06236194, 0.25969510, 0.40692914, 0.27101383);

// Transmittance of a medium over a distance in metres. Beer-Lambert.
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

// What single scattering loses in a direction by the tables. table_cos: hg_bsdf_cosine.
float hg_bsdf_glass_table(hg_bsdf b, vec3 w_ts, float table_cos, float eta)
{
    if (!HG_HAS_MIX(HG_MIX_ANISOTROPIC_GLASS) || b.alpha.x == b.alpha.y)
        return hg_glass_shares(table_cos, b.mean_roughness, eta).x;
    float miss = hg_glass_shares(abs(w_ts.z), b.mean_roughness, eta).x;
    miss += hg_brushed_correction(w_ts, b.base.roughness, b.anisotropy, eta);
    return clamp(miss, 0.0, 1.0);
}

// Its mean over all light of that side.
float hg_bsdf_glass_table_average(hg_bsdf b, float eta)
{
    float miss = hg_glass_shares_average(b.mean_roughness, eta).x;
    if (!HG_HAS_MIX(HG_MIX_ANISOTROPIC_GLASS) || b.alpha.x == b.alpha.y)
        return miss;
    return miss * hg_brushed_average_ratio(b.base.roughness, b.anisotropy, eta);
}

// What rough glass misses in a direction where its table says `miss`; mean:
// hg_bsdf_mean_reflectance there.
vec3 hg_bsdf_glass_miss(float miss, hg_bsdf_mean mean)
{
    return clamp(miss - mean.more + mean.less_through, 0.0, 1.0);
}

// Mean of the miss over all light of one side. r: of what smooth facets of the dielectric reflect;
// reflected: of what rough ones do.
vec3 hg_bsdf_glass_average(hg_bsdf b, bool inside, out vec3 r, out vec3 reflected)
{
    float eta = b.inside == inside ? b.eta : 1.0 / b.eta;
    vec3 miss = vec3(hg_bsdf_glass_table_average(b, eta));
    r = vec3(hg_glass_shares_average(0.0, eta).y);
    reflected = vec3(hg_glass_shares_average(b.mean_roughness, eta).y);
    uint first = HG_HAS_MIX(HG_MIX_UNUSUAL_GLASS) && !b.glass_plain ? 0u : HG_MEAN_NODES;
    for (uint i = first; i < HG_MEAN_NODES; i++) {
        vec4 node = hg_film_mean_node(i, b.mean_roughness, eta);
        vec3 difference = hg_bsdf_reflectance(b, node.x, eta, inside).dielectric -
            hg_fresnel_dielectric(node.x, hg_glass_eta(eta));
        reflected += node.y * difference;
        miss -= node.z * difference;
        r += node.w * difference;
    }
    r = clamp(r, 0.0, 1.0);
    return clamp(miss, 1e-4, 1.0);
}

// What facets of glass give back after several bounces, and what that leaves to opaque layers.
void hg_bsdf_make_glass(inout hg_bsdf b, hg_bsdf_mean mean, float cos_v)
{
    b.glass_v = b.glass_front = b.glass_reflected = b.glass_reflected_behind = vec3(0.0);
    b.glass_avg = b.glass_avg_behind = vec3(1.0);
    if (!HG_HAS(HG_FEATURE_TRANSMISSION) || b.thin || b.transmission <= 0.0)
        return;
    b.glass_v = hg_bsdf_glass_miss(hg_bsdf_glass_table(b, b.v_ts, cos_v, b.eta), mean);
    vec3 r, out_of, reflected, reflected_inside;
    vec3 from_outside = hg_bsdf_glass_average(b, false, r, reflected);
    vec3 from_inside = hg_bsdf_glass_average(b, true, out_of, reflected_inside);
    b.glass_reflected = b.inside ? reflected_inside : reflected;
    b.glass_reflected_behind = b.inside ? reflected : reflected_inside;
    // What enters from outside is n^2 times what leaves: (1 - a) m_avg n^2 is the same both ways.
    float n2 = b.inside ? b.eta * b.eta : 1.0;
    vec3 enters = (1.0 - r) * min(from_outside, from_inside) * n2;
    b.glass_avg = b.inside ? from_inside : from_outside;
    b.glass_avg_behind = b.inside ? from_outside : from_inside;
    b.glass_front = 1.0 - enters / b.glass_avg;
    b.base.f_ms -= b.transmission * b.ms_below;
}

// --- what layers over it hold back ---------------------------------------------------------------

// From outside a layer holds back some of what glass reflects, from inside some of what it lets
// through, in one bounce and in several. It goes on as light reflected to that side, a lobe like
// those above, which is what the underside of a layer does.

// From outside at a direction where dfg is that of the base without layers and below with them; with
// what a coat throws back at sheen.
vec3 hg_bsdf_held_outside(
    hg_bsdf b, hg_bsdf_mean mean, vec2 dfg, vec2 below, float through, float left)
{
    vec2 held = max(dfg * through - below, 0.0);
    if (b.exact)
        return mean.dielectric * (held.x + held.y) + (left - through);
    return b.f0_dielectric * held.x + b.f90_dielectric * held.y + (left - through);
}

// Share of what leaves that coat and sheen hold back, of theirs at strength 1.
float hg_bsdf_held_of(hg_bsdf b, vec2 held)
{
    vec2 h = held * vec2(b.coat, b.sheen_max);
    return h.x + h.y - h.x * h.y;
}

// From inside; mean: hg_bsdf_mean_reflectance there, miss: hg_bsdf_glass_miss.
vec3 hg_bsdf_held_inside(hg_bsdf b, float cos_theta, hg_bsdf_mean mean, vec3 miss)
{
    vec2 layers = vec2(b.coat_roughness, b.sheen_roughness);
    vec2 shares = hg_glass_shares(cos_theta, b.mean_roughness, b.eta);
    vec3 leaves = max(1.0 - shares.x - shares.y - mean.less_through, 0.0);
    float held = hg_bsdf_held_of(b, hg_glass_held(cos_theta, b.mean_roughness, b.eta, layers));
    return leaves * held + miss * (1.0 - b.glass_front) * b.held_several;
}

// Mean of that.
vec3 hg_bsdf_held_average(hg_bsdf b)
{
    vec2 layers = vec2(b.coat_roughness, b.sheen_roughness);
    vec3 leaves = max(1.0 - b.glass_avg - b.glass_reflected, 0.0);
    float held = hg_bsdf_held_of(b, hg_glass_held_average(b.mean_roughness, b.eta, layers));
    return leaves * held + b.glass_avg * (1.0 - b.glass_front) * b.held_several;
}

// Seen from inside; from outside hg_bsdf_make_enter makes the mean.
void hg_bsdf_make_held(inout hg_bsdf b, hg_bsdf_mean mean, float cos_v)
{
    b.held_v = b.held_avg = vec3(0.0);
    b.held_several = 0.0;
    b.layered_glass = b.layered && !b.thin && b.transmission > 0.0;
    if (!HG_HAS_MIX(HG_MIX_LAYERED_GLASS) || !b.layered_glass)
        return;
    if (!b.inside) {
        b.held_v =
            hg_bsdf_held_outside(b, mean, b.base.dfg_v, b.below_v, b.through_v, b.left_v);
        return;
    }
    float all = 0.0;
    for (int i = 0; i < 4; i++) {
        float c = hg_gauss_x[i];
        float miss = hg_gauss_w[i] * hg_glass_shares(c, b.mean_roughness, 1.0 / b.eta).x;
        b.held_several += miss * (1.0 - hg_bsdf_layers_at(b, c, c).through);
        all += miss;
    }
    b.held_several /= max(all, 1e-6);
    // Out and in again through the tinted surface.
    b.held_v = hg_bsdf_held_inside(b, cos_v, mean, b.glass_v) * b.tint * b.tint;
    b.held_avg = max(hg_bsdf_held_average(b), 1e-5);
}

#endif
