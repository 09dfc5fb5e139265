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
// open, or cannot be had from it with energy kept, is in lib/bsdf_microfacet.glsl, bsdf_layers.glsl and
// bsdf_glass.glsl, and here for what lies below the layers:
// - What they hold back of specular lobes goes on between layer and base, with what bounces between
//   facets: U(v) U(l) / U_avg in the colour of several bounces, U = T' - E_1, E_1 the albedo of
//   white facets below the layers, T' what they let through and what the coat throws back at the
//   sheen.
// - Diffuse lobes get S(v) S(l) / S_avg with S = T' - E, which is reciprocal and exact: E is the
//   albedo of the specular part below the layers. Under a film it is that of each colour: what the
//   film does not reflect enters.
// U_avg and S_avg are cosine-weighted means.
#ifndef HG_LIB_BSDF_GLSL
#define HG_LIB_BSDF_GLSL

#include "lib/bsdf_make.glsl"

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

// --- all lobes -----------------------------------------------------------------------------------

// f |cos| below the layers that are over l, of what is scattered diffusely; with `several` of what
// facets scatter several times as well.
vec3 hg_bsdf_evaluate_diffuse(hg_bsdf b, vec3 l_ts, hg_bsdf_layers over, bool several)
{
    float cos_l = abs(l_ts.z), shape = HG_INV_PI * cos_l;
    bool behind = l_ts.z < 0.0;
    vec2 dfg_l = hg_bsdf_dfg(b, l_ts);
    float table_l = hg_bsdf_cosine(b, l_ts), layers = min(b.through_v, over.through);
    vec2 below_l = hg_bsdf_dfg_below(b, cos_l, hg_bsdf_layered_aniso(b, l_ts), dfg_l, over);
    float several_l = max(over.left - below_l.x - below_l.y, 0.0);
    float twice = b.several_v * several_l / b.several_avg;
    bool below = behind && !b.thin;
    float eta_l = below ? 1.0 / b.eta : b.eta;
    hg_bsdf_mean mean_l =
        hg_bsdf_mean_reflectance(b, table_l, below_l, eta_l, b.inside != below);
    vec3 enter_l =
        over.left - hg_bsdf_dielectric_albedo(b, mean_l.dielectric, below_l, over.left);
    vec3 enter = b.enter_v * enter_l / (behind ? b.enter_avg_behind : b.enter_avg);
    vec3 sum = (behind ? b.behind : b.base.diffuse) * enter;
    if (!several)
        return sum * shape;
    if (!behind)
        sum += b.base.f_ms * twice;
    if (HG_HAS(HG_FEATURE_TRANSMISSION) && b.thin)
        sum += b.tint * (0.5 * b.transmission) * (1.0 - b.ms_dielectric) * twice;
    else if (HG_HAS(HG_FEATURE_TRANSMISSION) && b.transmission > 0.0) {
        vec3 miss = hg_bsdf_glass_miss(hg_bsdf_glass_table(b, l_ts, table_l, eta_l), mean_l);
        vec3 glass = b.transmission * layers * b.glass_v * miss;
        if (behind)
            sum += b.tint * glass * (1.0 - b.glass_front) / (b.glass_avg_behind * b.eta * b.eta);
        else
            sum += glass * b.glass_front / b.glass_avg;
        if (HG_HAS_MIX(HG_MIX_LAYERED_GLASS) && !behind && b.layered_glass) {
            vec3 held = b.inside
                ? hg_bsdf_held_inside(b, table_l, mean_l, miss)
                : hg_bsdf_held_outside(b, mean_l, dfg_l, below_l, over.through, over.left);
            sum += b.transmission * b.held_v * held / b.held_avg;
        }
    }
    return sum * shape;
}

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
    sum += hg_bsdf_evaluate_diffuse(b, l_ts, over, true);
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

// --- either --------------------------------------------------------------------------------------

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
    vec3 sum = hg_bsdf_evaluate_diffuse(b, l_ts, over, false);
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
