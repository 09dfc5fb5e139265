// bsdf_make.glsl - hg_bsdf of an evaluated material seen from a direction.
#ifndef HG_LIB_BSDF_MAKE_GLSL
#define HG_LIB_BSDF_MAKE_GLSL

#include "lib/bsdf_microfacet.glsl"
#include "lib/bsdf_glass.glsl"
#include "lib/bsdf_layers.glsl"

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
    vec3 dielectric = hg_schlick_average(b.f0_dielectric, b.f90_dielectric);
    vec3 metal = hg_schlick_average(b.tint, 1.0);
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
    float f90 = mix(b.f90_dielectric, 1.0, b.iridescence);
    vec3 below = hg_multiple_scattering_color(dielectric, f90, e_avg);
    b.base.f_ms = mix(below, hg_multiple_scattering_color(metal, 1.0, e_avg), b.metallic);
    b.base.f_ms_dielectric = hg_max3(below);
    b.ms_below = below;
    b.ms_dielectric = b.iridescence > 0.0 ? below : vec3(b.base.f_ms_dielectric);
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
        // Of glass the mean is known: total reflection is not for Gauss's points.
        bool known = HG_HAS(HG_FEATURE_TRANSMISSION) && b.exact && b.transmission > 0.0 && !b.thin &&
            (inside || !b.layered);
        vec2 all = b.base.dfg_avg;
        vec3 mirrored = k == 0u ? b.glass_reflected_behind : b.glass_reflected;
        b.enter_avg = vec3(0.0);
        if (known)
            b.enter_avg = 1.0 - hg_bsdf_dielectric_albedo(
                b, clamp(mirrored / max(all.x + all.y, 1e-4), 0.0, 1.0), all, 1.0);
        for (int i = known ? 4 : 0; i < 4; i++) {
            float c = hg_gauss_x[i];
            vec2 dfg = hg_dfg(c, b.mean_roughness);
            hg_bsdf_layers over = hg_bsdf_no_layers;
            vec2 below = dfg;
            if (!inside) {
                over = hg_bsdf_layers_at(b, c, c);
                below = hg_bsdf_dfg_below(b, c, vec4(0.0), dfg, over);
            }
            hg_bsdf_mean mean = hg_bsdf_mean_reflectance(
                b, c, below, k == 0u ? 1.0 / b.eta : b.eta, inside);
            vec3 albedo = hg_bsdf_dielectric_albedo(b, mean.dielectric, below, over.left);
            b.enter_avg += hg_gauss_w[i] * (over.left - albedo);
            if (HG_HAS_MIX(HG_MIX_LAYERED_GLASS) && b.layered_glass && !b.inside)
                b.held_avg += hg_gauss_w[i] *
                    hg_bsdf_held_outside(b, mean, dfg, below, over.through, over.left);
            vec2 held = dfg - below;
            if (k == 1u)
                b.several_avg += hg_gauss_w[i] * (held.x + held.y + over.left - 1.0);
        }
        if (HG_HAS(HG_FEATURE_ANISOTROPY) && !known && b.alpha.x != b.alpha.y) {
            vec2 more = all - hg_dfg_average(b.mean_roughness);
            b.enter_avg -= hg_max3(b.f0_dielectric) * more.x + b.f90_dielectric * more.y -
                b.ms_dielectric * (more.x + more.y);
        }
        b.enter_avg = max(b.enter_avg, 1e-4);
        b.enter_avg_behind = max(b.enter_avg_behind, b.enter_avg);
    }
    if (HG_HAS_MIX(HG_MIX_LAYERED_ANISOTROPY) && b.alpha.x != b.alpha.y && !b.inside) {
        vec2 layers = vec2(b.coat_roughness, b.sheen_roughness);
        b.several_avg += dot(vec2(b.coat, b.sheen_max),
            hg_layered_aniso_average(b.base.roughness, b.anisotropy, layers));
    }
    b.several_avg = max(b.several_avg, 1e-4);
    b.held_avg = max(b.held_avg, 1e-5);
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
        hg_max3(b.base.diffuse * b.enter_v) + hg_max3(b.base.f_ms) * b.several_v + wide.x +
        b.transmission * hg_max3(b.held_v);
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
    // What does not bend light has no lobe behind it: as good as straight through.
    float ratio = ior / ior_outside;
    ratio = abs(ratio - 1.0) < 1e-3 ? 1.001 : ratio;
    b.eta = b.inside ? 1.0 / ratio : ratio;
    b.tint = s.base_color;
    b.exact = false;
    hg_bsdf_make_base(b, s, f0);
    float dielectric = 1.0 - b.metallic;
    b.transmission = HG_HAS(HG_FEATURE_TRANSMISSION) ? s.transmission * dielectric : 0.0;
    float spread = HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) ? s.diffuse_transmission : 0.0;
    float opaque = HG_HAS(HG_FEATURE_TRANSMISSION) ? dielectric * (1.0 - s.transmission) : dielectric;
    b.base.diffuse = s.base_color * (opaque * (1.0 - spread));
    b.behind = s.diffuse_transmission_color * (opaque * spread);
    b.glass_plain = b.f90_dielectric == 1.0 && b.iridescence == 0.0 && b.eta == hg_glass_eta(b.eta) &&
        all(lessThan(abs(b.f0_dielectric - hg_ior_f0(b.eta)), vec3(1e-4)));
    bool mixed = !b.glass_plain || opaque > 0.0;
    b.exact = HG_HAS(HG_FEATURE_TRANSMISSION) && b.transmission > 0.0 && mixed;
    b.exact = b.exact || (HG_HAS(HG_FEATURE_IRIDESCENCE) && b.iridescence > 0.0);
    float cos_v = hg_bsdf_cosine(b, b.v_ts);
    hg_bsdf_make_layers(b, s);
    hg_bsdf_mean mean = hg_bsdf_mean_reflectance(b, cos_v, b.below_v, b.eta, b.inside);
    hg_bsdf_make_glass(b, mean, cos_v);
    hg_bsdf_make_held(b, mean, cos_v);
    b.enter_v = b.left_v - hg_bsdf_dielectric_albedo(b, mean.dielectric, b.below_v, b.left_v);
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

#endif
