// tonemap.glsl - scene radiance to display colour.
//
// Input: linear Rec.709, exposed. Output: linear display values 0..1; hg_srgb_encode makes the
// bytes. No dithering: the same radiance gives the same bytes.
#ifndef HG_LIB_TONEMAP_GLSL
#define HG_LIB_TONEMAP_GLSL

#define HG_TONEMAP_OP_ACES        0u
#define HG_TONEMAP_OP_AGX         1u
#define HG_TONEMAP_OP_PBR_NEUTRAL 2u
#define HG_TONEMAP_OP_LINEAR      3u

// ACES RRT + sRGB ODT. Source: Hill's fit (BakingLab, 2016) with the exposure 1 / 0.6 that three.js
// and the glTF sample viewer put before it, so that white stays where other curves have it.
vec3 hg_tonemap_aces(vec3 c)
{
    const mat3 to_rrt = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566,
        0.83777);
    const mat3 to_display = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367,
        -0.00605, 1.07602);
    vec3 v = to_rrt * (c * (1.0 / 0.6));
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081);
    return clamp(to_display * v, 0.0, 1.0);
}

// AgX base look: inset, log2 of -12.47393..4.026069 stops about 0.18, a sigmoid, outset.
// Source: Sobotka 2022 (AgX); the sigmoid as the sixth-order polynomial of Wrensch 2023, "Minimal
// AgX Implementation". AgX makes display values of a 2.2 power; they are made linear again here.
vec3 hg_tonemap_agx(vec3 c)
{
    const mat3 inset = mat3(0.842479062253094, 0.0423282422610123, 0.0423756549057051,
        0.0784335999999992, 0.878468636469772, 0.0784336, 0.0792237451477643, 0.0791661274605434,
        0.879142973793104);
    const mat3 outset = mat3(1.19687900512017, -0.0528968517574562, -0.0529716355144438,
        -0.0980208811401368, 1.15190312990417, -0.0980434501171241, -0.0990297440797205,
        -0.0989611768448433, 1.15107367264116);
    vec3 x = log2(max(inset * c, vec3(1e-10)));
    x = clamp((x + 12.47393) / (4.026069 + 12.47393), 0.0, 1.0);
    vec3 x2 = x * x, x4 = x2 * x2;
    x = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x -
        0.00232;
    return pow(clamp(outset * x, 0.0, 1.0), vec3(2.2));
}

// Khronos PBR Neutral. Source: Khronos 2024, "PBR Neutral Tone Mapper" specification.
vec3 hg_tonemap_pbr_neutral(vec3 c)
{
    const float start = 0.8 - 0.04, desaturation = 0.15, room = 1.0 - start;
    float low = min(c.r, min(c.g, c.b));
    c -= low < 0.08 ? low - 6.25 * low * low : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < start)
        return clamp(c, 0.0, 1.0);
    float new_peak = 1.0 - room * room / (peak + room - start);
    float g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return clamp(mix(c * (new_peak / peak), vec3(new_peak), g), 0.0, 1.0);
}

vec3 hg_tonemap(vec3 linear, uint op)
{
    vec3 c = clamp(linear, vec3(0.0), vec3(65504.0));
    if (op == HG_TONEMAP_OP_ACES)
        return hg_tonemap_aces(c);
    if (op == HG_TONEMAP_OP_AGX)
        return hg_tonemap_agx(c);
    if (op == HG_TONEMAP_OP_PBR_NEUTRAL)
        return hg_tonemap_pbr_neutral(c);
    return min(c, vec3(1.0));
}

// Electro-optical transfer, linear to encoded. Source: IEC 61966-2-1:1999.
vec3 hg_srgb_encode(vec3 c)
{
    c = clamp(c, 0.0, 1.0);
    vec3 high = 1.055 * pow(max(c, vec3(1e-8)), vec3(1.0 / 2.4)) - 0.055;
    return mix(high, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

vec3 hg_srgb_decode(vec3 c)
{
    c = clamp(c, 0.0, 1.0);
    vec3 high = pow((c + 0.055) / 1.055, vec3(2.4));
    return mix(high, c / 12.92, lessThanEqual(c, vec3(0.04045)));
}

#endif
