// bsdf_microfacet.glsl - the facets of the base: dielectric, metal, film; reflection and transmission.
//
// Where light goes through, reflection takes Fresnel's equations in place of Schlick's approximation,
// scaled to the material's f0 and f90: both sides and total reflection are right. Radiance is scaled
// with (n_v / n_l)^2 where the path changes its medium.
#ifndef HG_LIB_BSDF_MICROFACET_GLSL
#define HG_LIB_BSDF_MICROFACET_GLSL

#include "lib/bsdf_surface.glsl"

// --- what one facet does -------------------------------------------------------------------------

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

// Response of a microfacet: reflected and transmitted colour, and the probability of reflection.
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

// --- means over all of them ----------------------------------------------------------------------

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
        dfg = max(dfg + hg_aniso_correction(w_ts, b.base.roughness, b.anisotropy), 0.0);
        dfg /= max(dfg.x + dfg.y, 1.0);
    }
    return dfg;
}

// Means over facets of a direction.
struct hg_bsdf_mean {
    vec3 dielectric, base; // of light that they mirror
    // Where glass does not reflect what Fresnel's equations say: how much more all reflect whose
    // mirrored light arrives, and those whose refracted light does.
    vec3 more, less_through;
};

// Of those that reflect light of a direction, dfg: hg_bsdf_dfg there. With Fresnel's equations or films
// at facets that stand for them all. Of glass a table has what Fresnel's equations say; differences from
// it are taken at points that stand for all facets without total reflection. One loop for all of them:
// software rasterisers run each one's body at least once (docs/internals/frame.md).
hg_bsdf_mean hg_bsdf_mean_reflectance(hg_bsdf b, float cos_theta, vec2 dfg, float eta, bool inside)
{
    bool glass = HG_HAS(HG_FEATURE_TRANSMISSION) && b.exact && b.transmission > 0.0;
    uint films = HG_HAS_MIX(HG_MIX_UNUSUAL_GLASS) && glass && !b.glass_plain ? HG_VNDF_NODES : 0u;
    uint angles = b.exact && (!glass || b.metallic > 0.0) ? HG_ANGLE_NODES : 0u;
    hg_bsdf_mean mean;
    mean.dielectric = mean.base = mean.more = mean.less_through = vec3(0.0);
    float sum = 0.0;
    for (uint i = 0u; i < films + angles; i++) {
        vec3 node = i < films ? hg_film_node(i, cos_theta, b.mean_roughness, eta)
                              : vec3(hg_angle_node(i - films, cos_theta, b.mean_roughness), 0.0);
        hg_reflectance r = hg_bsdf_reflectance(b, node.x, eta, inside);
        if (i < films) {
            vec3 difference = r.dielectric - hg_fresnel_dielectric(node.x, hg_glass_eta(eta));
            mean.more += node.y * difference;
            mean.less_through += (node.y - node.z) * difference;
        } else {
            mean.dielectric += node.y * r.dielectric;
            mean.base += node.y * r.base;
            sum += node.y;
        }
    }
    float schlick = dfg.y / max(dfg.x + dfg.y, 1e-6);
    if (!b.exact) {
        mean.dielectric = b.f0_dielectric + (b.f90_dielectric - b.f0_dielectric) * schlick;
        mean.base = b.base.f0 + (b.f90 - b.base.f0) * schlick;
    } else {
        mean.dielectric /= max(sum, 1e-6);
        mean.base /= max(sum, 1e-6);
    }
    if (glass) {
        float dielectric = 1.0 - b.metallic;
        mean.base -= mean.dielectric * dielectric;
        vec2 all = hg_dfg(cos_theta, b.mean_roughness);
        float exact = hg_glass_shares(cos_theta, b.mean_roughness, eta).y;
        mean.dielectric = clamp((exact + mean.more) / max(all.x + all.y, 1e-4), 0.0, 1.0);
        mean.base += mean.dielectric * dielectric;
    }
    return mean;
}

// Directional albedo of the base's single reflection, below the layers where dfg is.
vec3 hg_bsdf_single_albedo(hg_bsdf b, float cos_theta, vec2 dfg)
{
    return hg_bsdf_mean_reflectance(b, cos_theta, dfg, b.eta, b.inside).base * (dfg.x + dfg.y);
}

// Share of light that the dielectric's specular part keeps from what is below: of the largest
// channel for all, of each below a film. mean: hg_bsdf_mean_reflectance there. through: what the
// layers in dfg leave, 1 without.
vec3 hg_bsdf_dielectric_albedo(hg_bsdf b, vec3 mean, vec2 dfg, float through)
{
    bool film = HG_HAS(HG_FEATURE_IRIDESCENCE) && b.iridescence > 0.0;
    vec3 single = film ? mean : vec3(hg_max3(mean));
    return min(
        single * (dfg.x + dfg.y) + b.ms_dielectric * max(through - dfg.x - dfg.y, 0.0), through);
}

// --- their lobe ----------------------------------------------------------------------------------

// f |cos| of single scattering without layers, and its density within the specular lobe.
vec3 hg_bsdf_evaluate_facets(hg_bsdf b, vec3 l_ts, out float pdf)
{
    bool behind = l_ts.z < 0.0;
    vec3 up = vec3(l_ts.xy, abs(l_ts.z)); // thin-walled: reflected, then transmitted
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

#endif
