// bsdf_layers.glsl - clearcoat and sheen: their transmittance, and their own lobes.
//
// Layers let through T = (1 - clearcoat E_coat) (1 - max(sheen) E_sheen). Specular lobes below get
// min(T(v), T(l)), as the specification scales albedo below sheen, but for the coat too: it is
// reciprocal and never gains energy. The sheen gets the lesser of both for the coat. What that holds
// back goes on between layer and base (lib/bsdf.glsl).
#ifndef HG_LIB_BSDF_LAYERS_GLSL
#define HG_LIB_BSDF_LAYERS_GLSL

#include "lib/bsdf_surface.glsl"

// --- transmittance -------------------------------------------------------------------------------

// Transmittance of a coat; 1 where it faces away.
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
    float left; // T and what the coat holds back of what the sheen reflects
    vec2 sheen_albedo;
};

const hg_bsdf_layers hg_bsdf_no_layers = hg_bsdf_layers(1.0, 1.0, 1.0, 1.0, vec2(0.0));

// Cosines: against the coat's normal and against the base's.
hg_bsdf_layers hg_bsdf_layers_at(hg_bsdf b, float coat_cos, float cos_theta)
{
    hg_bsdf_layers o = hg_bsdf_no_layers;
    o.coat = hg_bsdf_coat_through(b, min(coat_cos, 1.0));
    if (HG_HAS(HG_FEATURE_SHEEN)) {
        o.sheen_albedo = hg_sheen_albedo(cos_theta, b.sheen_roughness);
        o.sheen = 1.0 - b.sheen_max * o.sheen_albedo.y;
    }
    o.through = o.left = o.coat * o.sheen;
    if (HG_HAS(HG_FEATURE_CLEARCOAT) && HG_HAS(HG_FEATURE_SHEEN) && o.coat < 1.0)
        o.left += b.coat * b.sheen_max *
            hg_layer_loss(HG_COATED_FIRST, cos_theta, b.sheen_roughness, b.coat_roughness).x;
    return o;
}

// What is missing in the losses below an anisotropic base's coat (xy) and sheen (zw).
vec4 hg_bsdf_layered_aniso(hg_bsdf b, vec3 w_ts)
{
    vec4 more = vec4(0.0);
    if (!HG_HAS_MIX(HG_MIX_LAYERED_ANISOTROPY) || b.alpha.x == b.alpha.y)
        return more;
    if (HG_HAS(HG_FEATURE_CLEARCOAT))
        more.xy = hg_layered_aniso_correction(
            false, w_ts, b.base.roughness, b.anisotropy, b.coat_roughness);
    if (HG_HAS(HG_FEATURE_SHEEN))
        more.zw = hg_layered_aniso_correction(
            true, w_ts, b.base.roughness, b.anisotropy, b.sheen_roughness);
    return more;
}

// a and b of the base with min(T(v), T(l)) of its layers. cos_theta: of the direction to the normal;
// more: hg_bsdf_layered_aniso there, 0 where dfg is that of the isotropic base.
vec2 hg_bsdf_dfg_below(hg_bsdf b, float cos_theta, vec4 more, vec2 dfg, hg_bsdf_layers over)
{
    vec2 coat = vec2(0.0), sheen = vec2(0.0);
    if (HG_HAS(HG_FEATURE_CLEARCOAT) && over.coat < 1.0)
        coat = hg_layer_loss(HG_COAT_FIRST, cos_theta, b.mean_roughness, b.coat_roughness) + more.xy;
    if (HG_HAS(HG_FEATURE_SHEEN) && over.sheen < 1.0)
        sheen = hg_layer_loss(HG_CLOTH_FIRST, cos_theta, b.mean_roughness, b.sheen_roughness) + more.zw;
    coat = max(coat, 0.0);
    sheen = max(sheen, 0.0);
    vec2 below = dfg * over.through - (b.coat * over.sheen) * coat -
        (b.sheen_max * over.coat) * sheen;
    // Light to grazing angles is held back by both, which counts once. The mean of the product is
    // 0.14 to 0.27 of the geometric mean of both wherever it is above 0.003.
    if (HG_HAS(HG_FEATURE_CLEARCOAT) && HG_HAS(HG_FEATURE_SHEEN))
        below += (0.2 * b.coat * b.sheen_max) * sqrt(max(coat * sheen, 0.0));
    return max(below, 0.0);
}

void hg_bsdf_make_layers(inout hg_bsdf b, hg_surface s)
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
    b.layered = max(b.coat, b.sheen_max) > 0.0;
    hg_bsdf_layers over = hg_bsdf_no_layers;
    b.below_v = b.base.dfg_v;
    if (!b.inside) {
        over = hg_bsdf_layers_at(b, dot(b.coat_n, b.base.v), b.base.n_dot_v);
        b.below_v = hg_bsdf_dfg_below(b, b.v_ts.z, hg_bsdf_layered_aniso(b, b.v_ts), b.base.dfg_v, over);
    }
    b.sheen_albedo_v = over.sheen_albedo;
    b.coat_v = over.coat;
    b.through_v = over.through;
    b.left_v = over.left;
    b.several_v = max(b.left_v - b.below_v.x - b.below_v.y, 0.0);
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

// --- their lobes ---------------------------------------------------------------------------------

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

#endif
