// lobes.glsl - the lobes of KHR_materials_*, one by one: distributions, Fresnel terms, albedos.
//
// Include lib/frame.glsl first. Vectors with _ts are in the tangent frame of the surface, z along
// its normal. lib/bsdf.glsl and its parts put the lobes together.
#ifndef HG_LIB_LOBES_GLSL
#define HG_LIB_LOBES_GLSL

#include "lib/brdf.glsl"

float hg_max3(vec3 c)
{
    return max(c.x, max(c.y, c.z));
}

// --- anisotropic GGX; alpha along x and y --------------------------------------------------------

// Widths of a surface of `alpha` whose anisotropy has this strength: KHR_materials_anisotropy.
vec2 hg_aniso_alpha(float alpha, float strength)
{
    return vec2(mix(alpha, 1.0, strength * strength), alpha);
}

// Heitz 2014 eq. 85 (Burley 2012).
float hg_aniso_d(vec3 h_ts, vec2 alpha)
{
    vec2 e = h_ts.xy / alpha;
    float k = dot(e, e) + h_ts.z * h_ts.z;
    return HG_INV_PI / (alpha.x * alpha.y * k * k);
}

// Heitz 2014 eq. 72 and 80.
float hg_aniso_lambda(vec3 w_ts, vec2 alpha)
{
    vec2 e = w_ts.xy * alpha;
    return 0.5 * (sqrt(1.0 + dot(e, e) / max(w_ts.z * w_ts.z, 1e-14)) - 1.0);
}

// Microfacet normal visible from v_ts (z > 0); as hg_sample_ggx_vndf. Its density is
// D(h) max(0, v.h) / ((1 + Lambda(v)) v.z): Heitz 2018 eq. 3.
vec3 hg_sample_aniso_vndf(vec3 v_ts, vec2 alpha, vec2 u)
{
    vec3 stretched = normalize(vec3(v_ts.xy * alpha, v_ts.z));
    float phi = 2.0 * HG_PI * u.x;
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float r = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 h = vec3(r * cos(phi), r * sin(phi), z) + stretched;
    return normalize(vec3(h.xy * alpha, max(h.z, 1e-9)));
}

// Perceptual roughness of the isotropic surface whose albedo is about that of an anisotropic one, and
// the cosine at which it is so: where masking is the same, alpha tan(theta) in Heitz 2014 eq. 85. The
// width between mean and quadratic mean fits the integrals best: for all strengths and directions
// the albedo is at most 0.02 too low and 0.05 too high, 0.01 in quadratic mean. The rest is in a
// table (hg_aniso_correction).
float hg_aniso_roughness(vec2 alpha)
{
    float rms = sqrt(0.5 * dot(alpha, alpha)), mean = 0.5 * (alpha.x + alpha.y);
    return sqrt(mix(rms, mean, 0.15));
}

float hg_aniso_cosine(vec3 w_ts, vec2 alpha, float roughness)
{
    vec2 e = w_ts.xy * alpha;
    float z2 = w_ts.z * w_ts.z, width = roughness * roughness;
    return abs(w_ts.z) * inversesqrt(max(z2 + dot(e, e) / max(width * width, 1e-12), 1e-12));
}

// Place in tables of anisotropic surfaces, 0..1: cosine, azimuth, strength, roughness.
vec4 hg_aniso_place(vec3 w_ts, float roughness, float strength)
{
    float azimuth = abs(w_ts.x) * inversesqrt(max(dot(w_ts.xy, w_ts.xy), 1e-12));
    return vec4(sqrt(min(vec2(abs(w_ts.z), azimuth), 1.0)), strength, roughness);
}

vec2 hg_aniso_signed(vec2 entry)
{
    return (entry - 0.5) * (2.0 * HG_ANISO_RANGE);
}

// What is missing in hg_dfg of an anisotropic surface: HG_ANISO_FIRST of renderer/light/albedo/dfg.h.
vec2 hg_aniso_correction(vec3 w_ts, float roughness, float strength)
{
    const uvec4 size =
        uvec4(HG_ANISO_COSINES, HG_ANISO_AZIMUTHS, HG_ANISO_STRENGTHS, HG_ANISO_ROUGHS);
    return hg_aniso_signed(
        hg_table_4(HG_ANISO_FIRST, hg_aniso_place(w_ts, roughness, strength), size));
}

// What is missing in hg_dfg_average.
vec2 hg_aniso_average_correction(float roughness, float strength)
{
    return hg_aniso_signed(hg_table_2(HG_ANISO_MEANS, vec2(strength, roughness),
        uvec2(HG_ANISO_STRENGTHS, HG_ANISO_ROUGHS)));
}

// --- Fresnel terms -------------------------------------------------------------------------------

// Unpolarised reflectance of a dielectric; eta: index behind the surface over that in front of it.
// Walter et al. 2007 eq. 22.
float hg_fresnel_dielectric(float cos_theta, float eta)
{
    float c = clamp(cos_theta, 0.0, 1.0);
    float g2 = eta * eta - 1.0 + c * c;
    if (g2 <= 0.0)
        return 1.0;
    float g = sqrt(g2), a = (g - c) / (g + c);
    float b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * a * a * (1.0 + b * b);
}

float hg_ior_f0(float eta)
{
    float r = (eta - 1.0) / (eta + 1.0);
    return r * r;
}

// Colour that interference leaves of white light, for an optical path difference in nm: Gaussians
// in the frequency domain of the CIE 1931 functions. Belcour and Barla 2017, section 4.
vec3 hg_film_sensitivity(float path_nm, vec3 shift)
{
    float phase = 2.0 * HG_PI * path_nm * 1e-9;
    const vec3 size = vec3(5.4856e-13, 4.4201e-13, 5.2481e-13);
    const vec3 middle = vec3(1.6810e6, 1.7953e6, 2.2084e6);
    const vec3 width = vec3(4.3278e9, 9.3046e9, 6.6121e9);
    vec3 xyz = size * sqrt(2.0 * HG_PI * width) * cos(middle * phase + shift) *
        exp(-width * phase * phase);
    xyz.x += 9.7470e-14 * sqrt(2.0 * HG_PI * 4.5282e9) * cos(2.2399e6 * phase + shift.x) *
        exp(-4.5282e9 * phase * phase);
    // XYZ to linear Rec.709, IEC 61966-2-1
    const mat3 rec709 = mat3(3.2404542, -0.9692660, 0.0556434, -1.5371385, 1.8760108, -0.2040259,
        -0.4985314, 0.0415560, 1.0572252);
    return rec709 * (xyz / 1.0685e-7);
}

// Reflectance of a thin film of index film_ior on a base of reflectance f0, in air. Belcour and
// Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence",
// eq. 6-12 with Schlick's terms, as KHR_materials_iridescence has it.
vec3 hg_film_fresnel(float cos_theta, float film_ior, float thickness_nm, vec3 f0)
{
    // A film that vanishes goes over into none.
    float eta = mix(1.0, film_ior, smoothstep(0.0, 0.03, thickness_nm));
    float sin2 = (1.0 - cos_theta * cos_theta) / (eta * eta);
    if (sin2 >= 1.0)
        return vec3(1.0);
    float cos_film = sqrt(1.0 - sin2);
    float r12 = mix(hg_schlick_weight(cos_theta), 1.0, hg_ior_f0(eta));
    float t12 = 1.0 - r12;
    vec3 root = sqrt(clamp(f0, 0.0, 0.9999));
    vec3 base = (1.0 + root) / (1.0 - root);
    vec3 at_base = (base - eta) / (base + eta);
    vec3 r23 = hg_schlick(at_base * at_base, cos_film);
    vec3 shift = vec3(eta < 1.0 ? 0.0 : HG_PI) + HG_PI * vec3(lessThan(base, vec3(eta)));
    float path_nm = 2.0 * eta * thickness_nm * cos_film;
    vec3 r123 = clamp(r12 * r23, 0.0, 0.9999), root123 = sqrt(r123);
    vec3 rs = t12 * t12 * r23 / (1.0 - r123);
    vec3 sum = r12 + rs, c = rs - t12;
    for (int m = 1; m <= 2; m++) {
        c *= root123;
        sum += c * 2.0 * hg_film_sensitivity(float(m) * path_nm, float(m) * shift);
    }
    return clamp(sum, 0.0, 1.0);
}

// A facet of those that stand for all that reflect to a direction: its cosine (x) and weight (y), up to a
// factor. HG_ANGLES_FIRST of renderer/light/albedo/dfg.h.
vec2 hg_angle_node(uint node, float cos_theta, float roughness)
{
    const float last = float(HG_ANGLES_SIZE - 1);
    vec2 p = clamp(vec2(sqrt(max(cos_theta, 0.0)), roughness), 0.0, 1.0) * last;
    uvec2 i = uvec2(min(p, vec2(last - 1.0)));
    vec2 f = p - vec2(i);
    const uint column = HG_ANGLE_NODES, row = column * HG_ANGLES_SIZE;
    uint k = HG_ANGLES_FIRST + row * i.y + column * i.x + node;
    vec2 at = mix(mix(hg_dfg_at(k), hg_dfg_at(k + column), f.x),
        mix(hg_dfg_at(k + row), hg_dfg_at(k + row + column), f.x), f.y);
    return vec2(at.x * at.x, at.y);
}

// --- sheen ---------------------------------------------------------------------------------------

float hg_sheen_alpha(float roughness)
{
    return max(roughness * roughness, HG_SHEEN_MIN_ALPHA);
}

// Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF", eq. 2.
float hg_sheen_d(float sin2_h, float alpha)
{
    return (2.0 + 1.0 / alpha) * pow(max(sin2_h, 1e-12), 0.5 / alpha) * (0.5 * HG_INV_PI);
}

// Fit of the Smith Lambda, ibid. section 3.
float hg_sheen_l(float x, float alpha)
{
    float t = (1.0 - alpha) * (1.0 - alpha);
    float a = mix(21.5473, 25.3245, t), b = mix(3.82987, 3.32435, t);
    float c = mix(0.19823, 0.16801, t), d = mix(-1.97760, -1.27393, t);
    return a / (1.0 + b * pow(x, c)) + d * x + mix(-4.32054, -4.85967, t);
}

float hg_sheen_lambda(float x, float alpha)
{
    float low = hg_sheen_l(x < 0.5 ? x : 1.0 - x, alpha);
    return exp(x < 0.5 ? low : 2.0 * hg_sheen_l(0.5, alpha) - low);
}

// x: directional albedo, from the table; above 1 at grazing angles of smooth sheens. y: what is left
// of it where hg_bsdf_evaluate_sheen keeps it below 1.
vec2 hg_sheen_albedo(float cos_theta, float roughness)
{
    const float last = float(HG_SHEEN_SIZE - 1);
    vec2 p = clamp(vec2(sqrt(max(cos_theta, 0.0)), roughness), 0.0, 1.0) * last;
    uvec2 i = uvec2(min(p, vec2(last - 1.0)));
    vec2 f = p - vec2(i);
    uint k = HG_SHEEN_FIRST + i.y * HG_SHEEN_SIZE + i.x;
    vec2 low = mix(hg_dfg_at(k), hg_dfg_at(k + 1u), f.x);
    vec2 high = mix(hg_dfg_at(k + HG_SHEEN_SIZE), hg_dfg_at(k + HG_SHEEN_SIZE + 1u), f.x);
    return mix(low, high, f.y) * vec2(HG_SHEEN_MOST, 1.0);
}

// What a and b of a base lose below a layer of this roughness and of strength 1, or a sheen below a
// coat: HG_COAT_FIRST, HG_CLOTH_FIRST and HG_COATED_FIRST of renderer/light/albedo/dfg.h.
vec2 hg_layer_loss(uint first, float cos_theta, float roughness, float layer_roughness)
{
    const vec3 last = vec3(HG_LAYER_SIZE, HG_LAYER_SIZE, HG_LAYER_ROUGHS) - 1.0;
    vec3 p = clamp(vec3(sqrt(max(cos_theta, 0.0)), roughness, layer_roughness), 0.0, 1.0) * last;
    uvec3 i = uvec3(min(p, last - 1.0));
    vec3 f = p - vec3(i);
    vec2 sum[2];
    for (uint n = 0u; n < 2u; n++) {
        uint k = first + ((i.z + n) * HG_LAYER_SIZE + i.y) * HG_LAYER_SIZE + i.x;
        sum[n] = mix(mix(hg_dfg_at(k), hg_dfg_at(k + 1u), f.x),
            mix(hg_dfg_at(k + HG_LAYER_SIZE), hg_dfg_at(k + HG_LAYER_SIZE + 1u), f.x), f.y);
    }
    return mix(sum[0], sum[1], f.z);
}

// --- refraction ----------------------------------------------------------------------------------

// What is missing in hg_layer_loss below a coat or, with `cloth`, a sheen where the base is
// anisotropic: HG_OVER_ANISO_FIRST there.
vec2 hg_layered_aniso_correction(
    bool cloth, vec3 w_ts, float roughness, float strength, float layer_roughness)
{
    const uvec4 size = uvec4(HG_OVER_ANISO_COSINES, HG_OVER_ANISO_AZIMUTHS,
        HG_OVER_ANISO_STRENGTHS, HG_OVER_ANISO_ROUGHS);
    const uint words = HG_OVER_ANISO_BASES * HG_OVER_ANISO_SIDE;
    vec4 p = hg_aniso_place(w_ts, roughness, strength);
    float layer = clamp(layer_roughness, 0.0, 1.0) * float(HG_OVER_ANISO_LAYERS - 1);
    uint i = min(uint(layer), uint(HG_OVER_ANISO_LAYERS - 2));
    uint first = HG_OVER_ANISO_FIRST + (cloth ? HG_OVER_ANISO_WORDS : 0u) + i * words;
    return hg_aniso_signed(
        mix(hg_table_4(first, p, size), hg_table_4(first + words, p, size), layer - float(i)));
}

// And in the mean over all directions of what a coat (x) and a sheen (y) hold back.
vec2 hg_layered_aniso_average(float roughness, float strength, vec2 layer_roughness)
{
    const uvec3 size = uvec3(HG_OVER_ANISO_STRENGTHS, HG_OVER_ANISO_ROUGHS, HG_OVER_ANISO_LAYERS);
    vec2 p = vec2(strength, roughness);
    vec2 coat = hg_aniso_signed(hg_table_3(HG_OVER_ANISO_MEANS, vec3(p, layer_roughness.x), size));
    vec2 cloth = hg_aniso_signed(hg_table_3(HG_OVER_ANISO_MEANS, vec3(p, layer_roughness.y), size));
    return vec2(coat.x, cloth.y);
}

// Absorption-free index of one of the three channels: KHR_materials_dispersion.
float hg_dispersed_ior(float ior, float dispersion, uint channel)
{
    float half_spread = (ior - 1.0) * HG_DISPERSION_HALF_SPREAD * dispersion;
    return max(ior + half_spread * (float(channel) - 1.0), 1.0);
}

// --- tables of glass -----------------------------------------------------------------------------

// eta: index behind over that in front; below 1 all of this is seen from inside.

// That of the tables, which end at an index of 3: beyond it they stand for what differs from there.
float hg_glass_eta(float eta)
{
    const float most = (1.0 + HG_GLASS_FAR) / (1.0 - HG_GLASS_FAR);
    return clamp(eta, 1.0 / most, most);
}

// Cosine where total reflection ends.
float hg_glass_edge(float eta)
{
    float e = hg_glass_eta(eta);
    return sqrt(max(1.0 - e * e, 0.0));
}

// Place of a cosine in them: hg_glass_place of renderer/light/albedo/table.h.
float hg_glass_place(float cos_theta, float eta)
{
    float c = clamp(cos_theta, 0.0, 1.0), edge = hg_glass_edge(eta);
    if (eta >= 1.0)
        return sqrt(c);
    if (c >= edge)
        return HG_GLASS_EDGE + (1.0 - HG_GLASS_EDGE) * sqrt((c - edge) / max(1.0 - edge, 1e-6));
    return asin(sqrt(c / edge)) * (2.0 * HG_INV_PI * HG_GLASS_EDGE);
}

// Place of an index of refraction.
float hg_glass_layer(float eta)
{
    float e = max(eta, 1.0 / max(eta, 1e-3));
    return sqrt(min((e - 1.0) / ((e + 1.0) * HG_GLASS_FAR), 1.0));
}

// Shares of light that facets of glass lose (x) and reflect (y) when they are met once:
// HG_GLASS_FIRST of renderer/light/albedo/dfg.h.
vec2 hg_glass_shares(float cos_theta, float roughness, float eta)
{
    return hg_table_3(HG_GLASS_FIRST + (eta < 1.0 ? HG_GLASS_WORDS : 0u),
        vec3(hg_glass_place(cos_theta, eta), roughness, hg_glass_layer(eta)),
        uvec3(HG_GLASS_COSINES, HG_GLASS_ROUGHS, HG_GLASS_IORS));
}

// Cosine-weighted means of both.
vec2 hg_glass_shares_average(float roughness, float eta)
{
    return hg_table_2(HG_GLASS_MEANS + (eta < 1.0 ? HG_GLASS_IORS * HG_GLASS_ROUGHS : 0u),
        vec2(roughness, hg_glass_layer(eta)), uvec2(HG_GLASS_ROUGHS, HG_GLASS_IORS));
}

// A facet of glass that stands for others: its cosine (x), the weight of light that it mirrors (y), and
// how much that of refracted light is less (z): HG_FILM_FIRST of renderer/light/albedo/dfg.h.
vec3 hg_film_node(uint node, float cos_theta, float roughness, float eta)
{
    const uvec3 size = uvec3(HG_FILM_COSINES, HG_FILM_ROUGHS, HG_FILM_IORS);
    uint first = HG_FILM_FIRST + (4u * node + (eta < 1.0 ? 1u : 0u)) * HG_FILM_WORDS;
    vec3 p = vec3(hg_glass_place(cos_theta, eta), roughness, hg_glass_layer(eta));
    vec2 mirrored = hg_table_3(first, p, size);
    float less = hg_table_3(first + 2u * HG_FILM_WORDS, p, size).x;
    return vec3(mix(hg_glass_edge(eta), 1.0, mirrored.x * mirrored.x),
        vec2(mirrored.y, less) * 2.0 - 1.0);
}

// One that stands for all of all directions: w is the weight of what smooth glass mirrors. HG_FILM_MEANS
// there.
vec4 hg_film_mean_node(uint node, float roughness, float eta)
{
    const uvec2 size = uvec2(HG_FILM_ROUGHS, HG_FILM_IORS);
    uint words = size.x * size.y, first = HG_FILM_MEANS + (4u * node + (eta < 1.0 ? 1u : 0u)) * words;
    vec2 p = vec2(roughness, hg_glass_layer(eta));
    vec2 mirrored = hg_table_2(first, p, size), other = hg_table_2(first + 2u * words, p, size);
    return vec4(mix(hg_glass_edge(eta), 1.0, mirrored.x * mirrored.x),
        vec2(mirrored.y, other.x) * 2.0 - 1.0, other.y);
}

// Share that a coat (x) or sheen (y) of strength 1 holds back of what glass lets through:
// HG_HELD_FIRST of renderer/light/albedo/dfg.h.
vec2 hg_glass_held(float cos_theta, float roughness, float eta, vec2 layer_roughness)
{
    vec3 p = vec3(hg_glass_place(cos_theta, eta), roughness, hg_glass_layer(eta));
    const uvec4 size = uvec4(HG_HELD_COSINES, HG_HELD_ROUGHS, HG_HELD_IORS, HG_HELD_LAYERS);
    uint first = HG_HELD_FIRST + (eta < 1.0 ? size.x * size.y * size.z * size.w : 0u);
    return vec2(hg_table_4(first, vec4(p, layer_roughness.x), size).x,
        hg_table_4(first, vec4(p, layer_roughness.y), size).y);
}

vec2 hg_glass_held_average(float roughness, float eta, vec2 layer_roughness)
{
    vec2 p = vec2(roughness, hg_glass_layer(eta));
    const uvec3 size = uvec3(HG_HELD_ROUGHS, HG_HELD_IORS, HG_HELD_LAYERS);
    uint first = HG_HELD_MEANS + (eta < 1.0 ? size.x * size.y * size.z : 0u);
    return vec2(hg_table_3(first, vec3(p, layer_roughness.x), size).x,
        hg_table_3(first, vec3(p, layer_roughness.y), size).y);
}

// Layer of the tables of anisotropic glass above this index, and how far it is from the one below,
// which at 0 is that of index 1 and not stored.
float hg_brushed_layer(float eta, out uint layer)
{
    float p = hg_glass_layer(eta) * float(HG_BRUSHED_IORS);
    layer = min(uint(p), uint(HG_BRUSHED_IORS - 1));
    return p - float(layer);
}

// How far a direction leans along x, and its place in them: hg_lean and hg_brushed_place of
// renderer/light/albedo/table.h.
float hg_lean(float x, float z)
{
    return asinh(x / max(z, 1e-4));
}

float hg_brushed_place(vec3 w_ts, float eta)
{
    float z = abs(w_ts.z), sin2 = max(1.0 - z * z, 0.0), lean = hg_lean(abs(w_ts.x), z);
    float most = hg_lean(sqrt(sin2), z), e = hg_glass_eta(eta);
    float edge = hg_lean(sqrt(max(sin2 - e * e, 0.0)), z);
    if (eta >= 1.0)
        return 1.0 - lean / max(most, 1e-6);
    if (lean < edge)
        return 0.5 + 0.5 * sqrt(1.0 - lean / edge);
    return 0.5 - 0.5 * sqrt(min((lean - edge) / max(most - edge, 1e-6), 1.0));
}

// What is missing in the loss of hg_glass_shares of an anisotropic surface at the cosine and mean
// roughness: HG_BRUSHED_FIRST of renderer/light/albedo/dfg.h.
float hg_brushed_correction(vec3 w_ts, float roughness, float strength, float eta)
{
    const uvec4 size = uvec4(
        HG_BRUSHED_COSINES, HG_BRUSHED_AZIMUTHS, HG_BRUSHED_STRENGTHS, HG_BRUSHED_ROUGHS);
    const uint words = size.x * size.y * size.z * size.w;
    vec4 p = vec4(
        hg_glass_place(abs(w_ts.z), eta), hg_brushed_place(w_ts, eta), strength, roughness);
    uint layer;
    float above = hg_brushed_layer(eta, layer);
    vec2 far = hg_aniso_signed(hg_table_4(HG_BRUSHED_FIRST + layer * words, p, size));
    vec2 near = vec2(0.0);
    if (layer > 0u)
        near = hg_aniso_signed(hg_table_4(HG_BRUSHED_FIRST + (layer - 1u) * words, p, size));
    vec2 sum = mix(near, far, above);
    return eta < 1.0 ? sum.y : sum.x;
}

// The mean loss over that of hg_glass_shares_average; below the first layer as there.
float hg_brushed_average_ratio(float roughness, float strength, float eta)
{
    const uvec2 size = uvec2(HG_BRUSHED_STRENGTHS, HG_BRUSHED_ROUGHS);
    uint layer, words = size.x * size.y;
    float above = hg_brushed_layer(eta, layer);
    vec2 p = vec2(strength, roughness);
    vec2 far = hg_table_2(HG_BRUSHED_MEANS + layer * words, p, size);
    vec2 near = hg_table_2(HG_BRUSHED_MEANS + (max(layer, 1u) - 1u) * words, p, size);
    vec2 mean = mix(near, far, above) * HG_BRUSHED_MOST;
    return eta < 1.0 ? mean.y : mean.x;
}

// --- refraction of one direction -----------------------------------------------------------------

// Direction behind a facet, unit; false: all is reflected. v leads away from it in front.
bool hg_refract(vec3 v, vec3 h, float eta, out vec3 l)
{
    float c = dot(v, h), k = 1.0 - (1.0 - c * c) / (eta * eta);
    l = vec3(0.0);
    if (k <= 0.0)
        return false;
    l = normalize(h * (c / eta - sqrt(k)) - v / eta);
    return true;
}

#endif
