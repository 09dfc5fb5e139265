// texture.glsl - sampling textures through the page table. See shared/texture.h for the layout.
//
// Include lib/frame.glsl first, or define HG_TEXTURES as an expression of type hg_gpu_textures.
// The rules are those of a VkSampler (Vulkan 1.3, chapter 16): level of detail from derivatives,
// magnification at or below 0, linear or nearest within and between mips, wrap modes per axis.
//
// Compile-time options of the including pass (constants or specialisation constants):
//   HG_TEXTURE_ANISOTROPY  most taps along the major axis, 1..16; default 1
//   HG_TEXTURE_STOCHASTIC  true: one bilinear tap per lookup, whose mip and place along the major
//                          axis are chosen by hg_texture_xi, so that accumulated samples converge
//                          to trilinear filtering with up to 16 taps of anisotropy. Half the price
//                          of a trilinear lookup. Source: Pharr, Wronski, Salvi and Fajardo 2024,
//                          "Filtering After Shading with Stochastic Texture Filtering".
//   HG_TEXTURE_NOTE        true: remember which pages are asked for, so that hg_texture_report can
//                          tell the host (one lookup per note, see hg_texture_place). Else
//                          lookups of pages that are not resident are reported where they happen.
//
// Pages that are not resident (HG_FEATURE_STREAM) cost the lookup nothing: their table entries name
// their finest resident ancestor. Then hg_texture_coarser is not 0.
#ifndef HG_LIB_TEXTURE_GLSL
#define HG_LIB_TEXTURE_GLSL

#include "lib/tables.glsl"
#include "shared/bindings.h"
#include "shared/texture.h"

#ifndef HG_TEXTURES
#define HG_TEXTURES hg_frame.textures
#endif
#ifndef HG_TEXTURE_ANISOTROPY
#define HG_TEXTURE_ANISOTROPY 1u
#endif
#ifndef HG_TEXTURE_STOCHASTIC
#define HG_TEXTURE_STOCHASTIC false
#endif

#ifndef HG_TEXTURE_NOTE
#define HG_TEXTURE_NOTE false
#endif

layout(set = 0, binding = HG_BIND_PAGES_SRGB) uniform sampler2DArray hg_pages_srgb;
layout(set = 0, binding = HG_BIND_PAGES_LINEAR) uniform sampler2DArray hg_pages_linear;
layout(set = 0, binding = HG_BIND_PAGES_FLOAT) uniform sampler2DArray hg_pages_float;

// Random numbers in [0, 1) of stochastic lookups: x chooses the mip, y the place along the major
// axis. Set by the pass before it samples.
vec2 hg_texture_xi = vec2(0.5);
// Most taps that a stochastic lookup stands for; 1 = isotropic.
float hg_texture_most_taps = 16.0;

// Of the footprint that a lookup is filtered over, along its sides. Set by the pass before it samples.
float hg_texture_share = 1.0;

// Greatest number of mips by which a lookup of this invocation missed what it asked for.
uint hg_texture_coarser = 0u;
// Whether this invocation's misses count; set by the pass before it samples.
bool hg_texture_counts = true;
// Lookups without a note of their own are reported where they happen; `drawn`: as used, too
// (hg_texture_draws). Set by the pass.
bool hg_texture_drawn = false;
#define HG_TEXTURE_NO_NOTE 5u
// Entries of the page table that were asked for, by note.
uint hg_texture_note0 = HG_TEXTURE_NONE, hg_texture_note1 = HG_TEXTURE_NONE;
uint hg_texture_note2 = HG_TEXTURE_NONE, hg_texture_note3 = HG_TEXTURE_NONE;
uint hg_texture_note4 = HG_TEXTURE_NONE;

// Before lookups of another surface.
void hg_texture_forget()
{
    hg_texture_coarser = 0u;
    hg_texture_note0 = hg_texture_note1 = hg_texture_note2 = HG_TEXTURE_NONE;
    hg_texture_note3 = hg_texture_note4 = HG_TEXTURE_NONE;
}

// Where to sample: everything that does not depend on which texture of the same shape it is.
struct hg_texture_place {
    vec2 uv;      // wrapped, 0..1
    uvec2 size;   // texels of mip 0
    uint mip;     // lower mip; the next one counts by `blend`
    float blend;  // 0..1
    bool nearest; // within a mip
    uint note;    // 0..4, a constant: which one keeps the page that is asked for; or NO_NOTE
};

vec2 hg_texture_wrap(vec2 uv, uint bits)
{
    if (!HG_HAS(HG_FEATURE_SAMPLERS))
        return fract(uv);
    uvec2 wrap = uvec2(bits >> HG_TEX_WRAP_S_SHIFT, bits >> HG_TEX_WRAP_T_SHIFT) & 3u;
    vec2 repeated = fract(uv);
    vec2 mirrored = 1.0 - abs(2.0 * fract(uv * 0.5) - 1.0);
    vec2 clamped = clamp(uv, 0.0, 1.0);
    return mix(mix(repeated, clamped, equal(wrap, uvec2(HG_TEX_WRAP_CLAMP))), mirrored,
        equal(wrap, uvec2(HG_TEX_WRAP_MIRROR)));
}

uvec2 hg_texture_size(hg_gpu_texture t)
{
    uvec2 less_one = uvec2(t.size & 0xffffu, t.size >> 16u);
    if (HG_HAS(HG_FEATURE_WIDE))
        less_one += uvec2(bitfieldExtract(t.bits, 26, 1), bitfieldExtract(t.bits, 27, 1)) << 16u;
    return less_one + 1u;
}

// Level of detail to mips and weights, by the sampler's filters.
hg_texture_place hg_texture_place_at(hg_gpu_texture t, vec2 uv, float lod)
{
    hg_texture_place p;
    p.size = hg_texture_size(t);
    p.uv = hg_texture_wrap(uv, t.bits);
    p.note = 0u;
    if (HG_HAS(HG_FEATURE_STREAM))
        lod += HG_TEXTURES.bias;
    if (!HG_HAS(HG_FEATURE_SAMPLERS)) { // linear, linear between mips
        float end = max(float(bitfieldExtract(t.bits, HG_TEX_MIPS_SHIFT, 5)), 1.0) - 1.0;
        lod = clamp(lod, 0.0, end);
        if (HG_TEXTURE_STOCHASTIC)
            lod = min(floor(lod + hg_texture_xi.x), end);
        p.nearest = false;
        p.mip = uint(lod);
        p.blend = fract(lod);
        return p;
    }
    bool magnified = lod <= 0.0;
    p.nearest = (t.bits & (magnified ? HG_TEX_MAG_NEAREST : HG_TEX_MIN_NEAREST)) != 0u;
    float last = max(float(bitfieldExtract(t.bits, HG_TEX_MIPS_SHIFT, 5)), 1.0) - 1.0;
    lod = (t.bits & HG_TEX_MIP_NONE) != 0u ? 0.0 : clamp(lod, 0.0, last);
    if (HG_TEXTURE_STOCHASTIC && (t.bits & HG_TEX_MIP_NEAREST) == 0u)
        lod = min(floor(lod + hg_texture_xi.x), last);
    if ((t.bits & HG_TEX_MIP_NEAREST) != 0u)
        lod = ceil(lod + 0.5) - 1.0;
    p.mip = uint(lod);
    p.blend = fract(lod);
    return p;
}

// Level of detail of an isotropic footprint, Vulkan 1.3 eq. 16.5 (rho is the longer side).
float hg_texture_lod(vec2 size, vec2 ddx, vec2 ddy)
{
    vec2 x = ddx * size, y = ddy * size;
    return 0.5 * log2(max(max(dot(x, x), dot(y, y)), 1e-20));
}

// --- feedback ------------------------------------------------------------------------------------

bool hg_textures_exact()
{
    return HG_HAS(HG_FEATURE_REST) && HG_HAS(HG_FEATURE_STREAM) &&
        HG_TEXTURES.mode == HG_TEXTURES_EXACT;
}

// Remembers or reports that a page was asked for, of which only one `coarser` mips up is there.
// Returns `coarser`, 0 where there is no texture.
uint hg_texture_ask(hg_gpu_texture t, uint note, uint entry, uint coarser)
{
    bool there = (t.bits & HG_TEX_PRESENT) != 0u;
    coarser = there ? coarser : 0u;
    hg_texture_coarser = max(hg_texture_coarser, coarser);
    if (!HG_TEXTURE_NOTE) {
        // Exact pictures need all pages of a lookup at once: those that are there must stay.
        bool asks = (coarser != 0u || (there && hg_textures_exact())) && hg_texture_counts;
        if (asks)
            atomicAdd(HG_TEXTURES.feedback.v[entry * 2u], 1u);
        return coarser;
    }
    if (note == HG_TEXTURE_NO_NOTE) {
        bool asks = (coarser != 0u || hg_textures_exact()) && hg_texture_counts;
        if (there && (asks || hg_texture_drawn))
            atomicAdd(HG_TEXTURES.feedback.v[entry * 2u + (asks ? 0u : 1u)], 1u);
        return coarser;
    }
    entry = there ? entry : HG_TEXTURE_NONE;
    // Several lookups may share a note (of two lights, say): what is missing is not forgotten for what
    // is there.
    uint held = note == 0u ? hg_texture_note0
        : note == 1u       ? hg_texture_note1
        : note == 2u       ? hg_texture_note2
        : note == 3u       ? hg_texture_note3
                           : hg_texture_note4;
    if (coarser == 0u && hg_texture_coarser != 0u && held != HG_TEXTURE_NONE)
        return coarser;
    if (note == 0u)
        hg_texture_note0 = entry;
    else if (note == 1u)
        hg_texture_note1 = entry;
    else if (note == 2u)
        hg_texture_note2 = entry;
    else if (note == 3u)
        hg_texture_note3 = entry;
    else
        hg_texture_note4 = entry;
    return coarser;
}

// Whether a pixel tells what it uses in this sample.
bool hg_texture_draws(uvec2 pixel)
{
    return ((pixel.x & 7u) | ((pixel.y & 7u) << 3u)) == HG_TEXTURES.lottery;
}

// Tells the host what this invocation asked for: all of it as needed when something was missing
// (and counts), as used when its pixel is drawn. One loop: where no lane has anything to report it is
// left at once, also on devices that run both sides of branches.
void hg_texture_report(uvec2 pixel)
{
    bool missed = hg_texture_coarser != 0u && hg_texture_counts;
    bool drawn = hg_texture_draws(pixel);
    uint left = (hg_texture_note0 != HG_TEXTURE_NONE ? 1u : 0u) |
        (hg_texture_note1 != HG_TEXTURE_NONE ? 2u : 0u) |
        (hg_texture_note2 != HG_TEXTURE_NONE ? 4u : 0u) |
        (hg_texture_note3 != HG_TEXTURE_NONE ? 8u : 0u) |
        (hg_texture_note4 != HG_TEXTURE_NONE ? 16u : 0u);
    left = missed || drawn ? left : 0u;
    while (left != 0u) {
        uint i = uint(findLSB(left));
        left &= left - 1u;
        uint entry = i == 0u ? hg_texture_note0
            : i == 1u        ? hg_texture_note1
            : i == 2u        ? hg_texture_note2
            : i == 3u        ? hg_texture_note3
                             : hg_texture_note4;
        atomicAdd(HG_TEXTURES.feedback.v[entry * 2u + (missed ? 0u : 1u)], 1u);
    }
}

// --- progress of pixels (HG_TEXTURES_EXACT) --------------------------------------------------------

uint hg_progress_index(uvec2 pixel)
{
    return pixel.y * hg_frame.width + pixel.x;
}

// Whether the pixel still waits for this sample.
bool hg_progress_waits(uvec2 pixel)
{
    if (!hg_textures_exact())
        return true;
    uint state = HG_TEXTURES.progress.v[hg_progress_index(pixel)];
    return (state & HG_PROGRESS_SAMPLES_MASK) == hg_frame.sample_index;
}

// A pass in front of the last one had coarser texels: the sample does not count for this pixel.
void hg_progress_spoil(uvec2 pixel)
{
    if (!hg_textures_exact() || hg_texture_coarser == 0u || !hg_texture_counts)
        return;
    HG_TEXTURES.progress.v[hg_progress_index(pixel)] =
        hg_frame.sample_index | (HG_TEXTURES.run << HG_PROGRESS_RUN_SHIFT);
}

// Whether all that this sample of the pixel was made of is as it will be. Unknown of one that does
// not wait: what it lacks was not asked for.
bool hg_progress_would_take(uvec2 pixel)
{
    if (!hg_textures_exact())
        return true;
    uint state = HG_TEXTURES.progress.v[hg_progress_index(pixel)];
    return (state & HG_PROGRESS_SAMPLES_MASK) == hg_frame.sample_index &&
        (state >> HG_PROGRESS_RUN_SHIFT) != HG_TEXTURES.run && hg_texture_coarser == 0u;
}

// The last pass: true when the sample counts; then the pixel has it.
bool hg_progress_take(uvec2 pixel)
{
    bool taken = hg_progress_would_take(pixel);
    if (taken && hg_textures_exact())
        HG_TEXTURES.progress.v[hg_progress_index(pixel)] = hg_frame.sample_index + 1u;
    return taken;
}

// --- lookups -------------------------------------------------------------------------------------

// Where in the pool a place in one mip is: x, y in texels of the layer, and the layer. Integers,
// shifts and masks: on software rasterisers this costs as much as the filtering itself.
vec3 hg_texture_texel(hg_gpu_texture t, hg_texture_place p, uint mip)
{
    uint k = bitfieldExtract(t.bits, HG_TEX_GRID_SHIFT, 4);
    uint tail = bitfieldExtract(t.bits, HG_TEX_TAIL_SHIFT, 4);
    uint level = min(mip, tail);
    uvec2 size = max(p.size >> mip, 1u);
    vec2 texel = p.uv * vec2(size);
    uvec2 whole = min(uvec2(texel), size - 1u);
    uvec2 page = whole / HG_PAGE_TEXELS;
    // Grids in front of this one have 4^rest + ... + 4^k entries: every second bit of the
    // difference of two powers of four.
    uint rest = k + 1u - level;
    uint entry = t.table + (0x55555555u & ((4u << (2u * k)) - (1u << (2u * rest))));
    entry += ((page.y << rest) >> 1) + page.x; // the grid is 2^(rest - 1) wide
    uint found = hg_page_at(entry);
    uint slot = found & HG_PAGE_SLOT_MASK;
    if (HG_HAS(HG_FEATURE_STREAM)) {
        uint coarser = hg_texture_ask(t, p.note, entry, found >> HG_PAGE_COARSER_SHIFT);
        // The ancestor's texels. Where sides are odd, the place may lie a texel beside its page.
        mip = min(mip + coarser, max(bitfieldExtract(t.bits, HG_TEX_MIPS_SHIFT, 5), 1u) - 1u);
        level = min(mip, tail);
        size = max(p.size >> mip, 1u);
        page = min(page >> coarser, (size - 1u) / HG_PAGE_TEXELS);
        texel = p.uv * vec2(size);
        vec2 corner = vec2(page * HG_PAGE_TEXELS);
        texel = clamp(texel, corner - 1.5, corner + (float(HG_PAGE_TEXELS) + 1.5));
        whole = min(uvec2(max(texel, 0.0)), size - 1u);
    }
    if (p.nearest)
        texel = vec2(whole) + 0.5;
    ivec2 corner = ivec2(uvec2(slot, slot >> 4u) & 15u) * HG_PAGE_PITCH + HG_PAGE_BORDER;
    int j = int(mip - level); // place in the tail; 0 for all others
    corner += ivec2(HG_TAIL_X(j), HG_TAIL_Y(j)) - int(HG_POOL_ROUND);
    // Rounded in the page, not in the layer: the same for every slot.
    vec2 inside = texel - vec2(page * HG_PAGE_TEXELS) + HG_POOL_ROUND;
    return vec3(inside + vec2(corner), slot >> 8u);
}

// The same in 0..1 of the layer.
vec3 hg_texture_address(hg_gpu_texture t, hg_texture_place p, uint mip)
{
    float scale = 1.0 / float(HG_POOL_SIDE);
    if (HG_HAS(HG_FEATURE_SMALL_LAYERS))
        scale *= HG_TEXTURES.pool_scale;
    if (HG_HAS(HG_FEATURE_FLOAT) && bitfieldExtract(t.bits, HG_TEX_POOL_SHIFT, 2) == HG_POOL_FLOAT)
        scale = 1.0 / float(HG_POOL_HALF_SIDE);
    vec3 at = hg_texture_texel(t, p, mip);
    return vec3(at.xy * scale, at.z);
}

// Both mips of a place from one pool.
vec4 hg_texture_fetch(sampler2DArray pool, hg_gpu_texture t, hg_texture_place p)
{
    vec4 texel = textureLod(pool, hg_texture_address(t, p, p.mip), 0.0);
    if (!HG_TEXTURE_STOCHASTIC) {
        uint last = bitfieldExtract(t.bits, HG_TEX_MIPS_SHIFT, 5) - 1u;
        vec3 next = hg_texture_address(t, p, min(p.mip + 1u, last));
        texel = mix(texel, textureLod(pool, next, 0.0), p.blend);
    }
    return texel;
}

// Light of sRGB codes in 0..1 (IEC 61966-2-1), within 2.2e-5 of it: t^2.4 = t^2 P(sqrt t).
vec3 hg_texture_decode(vec3 c)
{
    vec3 t = (c + 0.055) * (1.0 / 1.055), s = sqrt(t);
    vec3 p = ((((0.1063701 * s - 0.4319403) * s + 0.7524696) * s - 0.7978478) * s + 1.3350574) * s +
        0.0358909;
    return mix(p * t * t, c * (1.0 / 12.92), lessThanEqual(c, vec3(0.04045)));
}

vec4 hg_texture_decoded(vec3 at, ivec2 corner)
{
    vec4 texel = texelFetch(hg_pages_linear, ivec3(corner, int(at.z)), 0);
    return vec4(hg_texture_decode(texel.rgb), texel.a);
}

// Colours. Devices may decode them as roughly as they like: Mesa's llvmpipe is 0.7 % too bright in
// most of the dark tones and 5 % at worst, what several bounces make more of. Shading, of both
// modes, decodes the four texels itself.
vec4 hg_texture_fetch_colour(hg_gpu_texture t, hg_texture_place p)
{
    if (!HG_TEXTURE_STOCHASTIC)
        return hg_texture_fetch(hg_pages_srgb, t, p);
    vec3 at = hg_texture_texel(t, p, p.mip);
    vec2 first = floor(at.xy - 0.5), w = at.xy - 0.5 - first;
    ivec2 i = ivec2(first);
    vec4 above = mix(hg_texture_decoded(at, i), hg_texture_decoded(at, i + ivec2(1, 0)), w.x);
    vec4 below =
        mix(hg_texture_decoded(at, i + ivec2(0, 1)), hg_texture_decoded(at, i + ivec2(1, 1)), w.x);
    return mix(above, below, w.y);
}

vec4 hg_texture_fetch_any(hg_gpu_texture t, hg_texture_place p)
{
    uint pool = bitfieldExtract(t.bits, HG_TEX_POOL_SHIFT, 2);
    if (pool == HG_POOL_SRGB)
        return hg_texture_fetch_colour(t, p);
    if (pool == HG_POOL_LINEAR)
        return hg_texture_fetch(hg_pages_linear, t, p);
    return hg_texture_fetch(hg_pages_float, t, p);
}

// Footprint for anisotropic lookups: level of detail, and the major axis that the taps cover.
// Source: Vulkan 1.3 section 16.5.7 (eta, N, lambda).
float hg_texture_footprint(vec2 size, vec2 ddx, vec2 ddy, float most, out vec2 axis, out float taps)
{
    vec2 x = ddx * size, y = ddy * size;
    float xx = max(dot(x, x), 1e-20), yy = max(dot(y, y), 1e-20);
    float major = sqrt(max(xx, yy)), minor = sqrt(min(xx, yy));
    float eta = min(major / minor, most);
    taps = ceil(eta - 1e-3);
    axis = xx >= yy ? ddx : ddy;
    return log2(major / eta);
}

hg_texture_place hg_texture_find(hg_gpu_texture t, vec2 uv, vec2 ddx, vec2 ddy)
{
    vec2 size = vec2(hg_texture_size(t));
    ddx *= hg_texture_share;
    ddy *= hg_texture_share;
    if (HG_TEXTURE_STOCHASTIC) {
        // The footprint of hg_texture_footprint in squares: no root, no division.
        vec2 x = ddx * size, y = ddy * size;
        float xx = dot(x, x), yy = dot(y, y);
        float major = max(max(xx, yy), 1e-20), minor = min(xx, yy);
        float width = max(minor, major / (hg_texture_most_taps * hg_texture_most_taps));
        float along = major > 1.002 * minor ? hg_texture_xi.y - 0.5 : 0.0;
        if (hg_texture_most_taps == 1.0)
            along = 0.0;
        return hg_texture_place_at(t, uv + (xx >= yy ? ddx : ddy) * along, 0.5 * log2(width));
    }
    return hg_texture_place_at(t, uv, hg_texture_lod(size, ddx, ddy));
}

// Samples a resolved record (of a material slot). Colour slots return linear light.
vec4 hg_texture_sample_record(hg_gpu_texture t, vec2 uv, vec2 ddx, vec2 ddy)
{
    if (HG_TEXTURE_ANISOTROPY == 1u || HG_TEXTURE_STOCHASTIC)
        return hg_texture_fetch_any(t, hg_texture_find(t, uv, ddx, ddy));
    vec2 axis;
    float taps;
    float lod = hg_texture_footprint(
        vec2(hg_texture_size(t)), ddx, ddy, float(HG_TEXTURE_ANISOTROPY), axis, taps);
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < min(uint(taps), HG_TEXTURE_ANISOTROPY); i++) {
        vec2 at = uv + axis * ((float(i) + 0.5) / taps - 0.5);
        sum += hg_texture_fetch_any(t, hg_texture_place_at(t, at, lod));
    }
    return sum / taps;
}

// texture: index of hg_textures_find; HG_TEXTURE_NONE is white. ddx, ddy: change of uv per pixel.
vec4 hg_texture_sample(uint texture, vec2 uv, vec2 ddx, vec2 ddy)
{
    if (texture == HG_TEXTURE_NONE)
        return vec4(1.0);
    return hg_texture_sample_record(HG_TEXTURES.list.v[texture], uv, ddx, ddy);
}

#endif
