// probes.glsl - diffuse light from a field of irradiance probes (shared/gi.h).
//
// Probes stand on nested grids. The finest one around a point has its light, but for beyond its outermost probes, where
// the next coarser one comes in, and for points that none of its probes sees.
// Of a grid the eight probes around a point count, weighed by the grid, by whether they lie in front of the surface, and
// by Chebyshev's inequality on the distances that their rays met. Tables are read at one texel that
// the sample's random numbers choose, so that accumulated samples see them interpolated.
// Source: Majercik et al. 2019, "Dynamic Diffuse Global Illumination with Ray-Traced Irradiance
// Fields", section 5; Majercik et al. 2021, "Scaling Probe-Based Real-Time Dynamic Global
// Illumination for Production" (bias along normal and view).
// renderer/gi/field.c has the same on the host. Include lib/frame.glsl and lib/tables.glsl first.
#ifndef HG_LIB_PROBES_GLSL
#define HG_LIB_PROBES_GLSL

#include "lib/octahedral.glsl"

vec3 hg_probes_irradiance;  // on the normal that was asked for, over pi
vec3 hg_probes_behind;      // on the opposite one, where surfaces let light through
vec3 hg_probes_surfaces;    // about the mirror direction, of surfaces alone, over pi
float hg_probes_sky = 1.0;  // share of the environment that is seen about it
#ifdef HG_PROBES_BILINEAR
vec3 hg_probes_hidden_way = vec3(0.0, 1.0, 0.0); // where something near hides what probes see
vec3 hg_probes_hiding;      // mean radiance of surfaces about that way, which what hides has as well; where
                            // probes see none, of those about the mirror direction
#endif

// Texel of a table with this side; xi in [0, 1) moves the point by up to half a texel.
uint hg_probe_texel(vec3 d, int side, vec2 xi)
{
    ivec2 i = ivec2(floor((hg_oct_encode(d) * 0.5 + 0.5) * float(side) + xi - 0.5));
    // Beyond an edge the table goes on mirrored about the middle of that edge.
    bool x = i.x < 0 || i.x >= side;
    i = x ? ivec2(clamp(i.x, 0, side - 1), side - 1 - i.y) : i;
    bool y = i.y < 0 || i.y >= side;
    i = y ? ivec2(side - 1 - i.x, clamp(i.y, 0, side - 1)) : i;
    i = clamp(i, ivec2(0), ivec2(side - 1));
    return uint(i.y * side + i.x);
}

vec3 hg_rgb9e5(uint word)
{
    float scale = exp2(float(word >> 27) - 24.0);
    return vec3(uvec3(word, word >> 9, word >> 18) & 511u) * scale;
}

// A point that is looked up, relative to a grid.
struct hg_probe_point {
    vec3 pos_ws, lifted_ws, at; // at: in units of the grid
};

hg_probe_point hg_probe_point_in(hg_gpu_probe_grid p, vec3 pos_ws, vec3 n_geometric, vec3 view)
{
    hg_probe_point point;
    point.pos_ws = pos_ws;
    point.lifted_ws = pos_ws +
        (n_geometric * HG_PROBE_BIAS_NORMAL + view * HG_PROBE_BIAS_VIEW) * p.spacing;
    point.at = (point.lifted_ws - p.origin_ws) / p.spacing;
    return point;
}

// How much of the light at a point is that of a grid with a coarser one: all of it inside, none far beyond its edge.
float hg_probe_grid_share(hg_gpu_probe_grid p, vec3 at)
{
    vec3 edge = min(at, vec3(p.counts[0], p.counts[1], p.counts[2]) - 1.0 - at);
    return clamp(min(edge.x, min(edge.y, edge.z)) + HG_PROBE_BEYOND, 0.0, 1.0);
}

// Metres between the probes that light at a point is from.
float hg_probes_spacing(vec3 pos_ws)
{
    int c = int(hg_frame.probes.count) - 1;
    for (; c > 0; c--) {
        hg_gpu_probe_grid p = hg_frame.probes.grids[c];
        if (hg_probe_grid_share(p, (pos_ws - p.origin_ws) / p.spacing) > 0.5)
            break;
    }
    return hg_frame.probes.grids[max(c, 0)].spacing;
}

// Of a place: from the point of the grid to the probe, in spacings.
vec3 hg_probe_offset(uint place)
{
    return vec3(uvec3(place, place >> HG_PROBE_BITS, place >> (2 * HG_PROBE_BITS)) & HG_PROBE_BITS_MASK) *
        (1.0 / float(HG_PROBE_OFFSET_STEPS)) - 0.5;
}

// The wall next to a probe is between it and what lies there from it, in spacings.
bool hg_probe_is_walled_off(uint place, vec3 from)
{
    uvec3 code = uvec3(place >> (3 * HG_PROBE_BITS), place >> (4 * HG_PROBE_BITS), place >> (5 * HG_PROBE_BITS)) &
        HG_PROBE_BITS_MASK;
    vec3 wall = vec3(code) * (1.0 / float(HG_PROBE_WALL_STEPS));
    vec2 e = wall.xy * 2.0 - 1.0;
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y)); // as hg_oct_decode, not unit
    float fold = max(-n.z, 0.0), far = wall.z + HG_PROBE_WALL_SLACK;
    n.xy -= clamp(n.xy * 1e6, -fold, fold);
    float along = dot(n, from);
    return code.z != HG_PROBE_WALL_NONE && along < 0.0 && along * along > far * far * dot(n, n);
}

// Weight of a probe without that of the grid.
float hg_probe_weight(hg_gpu_probe_grid p, uint probe, uint place, vec3 at_ws, hg_probe_point point, vec3 n, vec2 xi)
{
    float wrap = dot(normalize(at_ws - point.pos_ws), n) * 0.5 + 0.5;
    float weight = wrap * wrap + 0.02;
    vec3 from = point.lifted_ws - at_ws;
    float distance = length(from) / p.spacing;
    uint k = p.count * (1u + HG_PROBE_IRRADIANCE_TEXELS) +
        probe * HG_PROBE_MOMENT_TEXELS + hg_probe_texel(from, HG_PROBE_MOMENT_SIDE, xi);
    vec2 moments = unpackHalf2x16(p.words.v[k]);
    float beyond = max(distance - moments.x, 0.0);
    float seen = moments.y / (moments.y + beyond * beyond);
    seen = hg_probe_is_walled_off(place, from * (1.0 / p.spacing)) ? 0.0 : seen;
    weight = max(weight * seen * seen * seen, 1e-6);
    return weight < 0.2 ? weight * weight * weight * 25.0 : weight;
}

// First word of what is looked up of the first probe. HG_PROBES_BETWEEN, where true: the light between surfaces, without
// what emitters send.
uint hg_probe_irradiance_words(hg_gpu_probe_grid p)
{
#ifdef HG_PROBES_BETWEEN
    if (HG_PROBES_BETWEEN)
        return p.count * (1u + 3u * HG_PROBE_IRRADIANCE_TEXELS + HG_PROBE_MOMENT_TEXELS);
#endif
    return p.count;
}

// Irradiance of a probe, from the first word of its table. HG_PROBES_BILINEAR: of the four texels about n,
// as the mean of many xi would have it.
vec3 hg_probe_irradiance(hg_gpu_probe_grid p, uint first, vec3 n, vec2 xi)
{
#ifdef HG_PROBES_BILINEAR
    vec2 f = fract((hg_oct_encode(n) * 0.5 + 0.5) * float(HG_PROBE_IRRADIANCE_SIDE) - 0.5);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; i++) {
        vec2 off = vec2(i & 1, i >> 1), w = mix(1.0 - f, f, off);
        uint texel = hg_probe_texel(n, HG_PROBE_IRRADIANCE_SIDE, off);
        sum += hg_rgb9e5(p.words.v[first + texel]) * (w.x * w.y);
    }
    return sum;
#else
    return hg_rgb9e5(p.words.v[first + hg_probe_texel(n, HG_PROBE_IRRADIANCE_SIDE, xi)]);
#endif
}

struct hg_probe_light {
    vec3 irradiance, surfaces, hiding;
    float sky, weight; // of all probes
};

// Of one grid.
hg_probe_light hg_probe_grid_look(hg_gpu_probe_grid p, hg_probe_point point, vec3 n_geometric, vec3 n, vec3 r, vec3 xi)
{
    ivec3 most = ivec3(p.counts[0], p.counts[1], p.counts[2]) - 1;
    ivec3 base = clamp(ivec3(floor(point.at)), ivec3(0), max(most - 1, ivec3(0)));
    vec3 f = clamp(point.at - vec3(base), 0.0, 1.0);
    vec4 sum = vec4(0.0);
#ifdef HG_PROBES_BILINEAR
    vec4 reflection = vec4(0.0), hiding = vec4(0.0);
    uint hidden = hg_probe_texel(hg_probes_hidden_way, HG_PROBE_IRRADIANCE_SIDE, vec2(0.5));
    uint mirrored = hg_probe_texel(r, HG_PROBE_IRRADIANCE_SIDE, xi.yx);
    xi.yz = vec2(0.5);
#endif
    uint chosen = 0u, words = hg_probe_irradiance_words(p);
    float pick = xi.z;
    for (int i = 0; i < 8; i++) {
        ivec3 off = ivec3(i, i >> 1, i >> 2) & 1;
        ivec3 cell = min(base + off, most);
        uint k = uint((cell.z * (most.y + 1) + cell.y) * (most.x + 1) + cell.x);
        uint place = p.words.v[k];
        vec3 tri = mix(1.0 - f, f, vec3(off));
        vec3 probe_ws = p.origin_ws + (vec3(cell) + hg_probe_offset(place)) * p.spacing;
        float w = tri.x * tri.y * tri.z * hg_probe_weight(p, k, place, probe_ws, point, n_geometric, xi.yz);
        w = (place & HG_PROBE_AWAKE) != 0u ? w : 0.0;
        sum += vec4(hg_probe_irradiance(p, words + k * HG_PROBE_IRRADIANCE_TEXELS, n, xi.xy), 1.0) * w;
#ifdef HG_PROBES_BILINEAR
        uint both = p.count * (1u + HG_PROBE_IRRADIANCE_TEXELS + HG_PROBE_MOMENT_TEXELS) +
            2u * (k * HG_PROBE_IRRADIANCE_TEXELS + mirrored);
        reflection += w * vec4(hg_rgb9e5(p.words.v[both]), uintBitsToFloat(p.words.v[both + 1u]));
        both += 2u * hidden - 2u * mirrored;
        hiding += w * vec4(hg_rgb9e5(p.words.v[both]), 1.0 - uintBitsToFloat(p.words.v[both + 1u]));
#endif
        // One of them by weight, for the reflection.
        float share = sum.w > 0.0 ? w / sum.w : 0.0;
        bool take = pick < share;
        chosen = take ? k : chosen;
        pick = take ? pick / max(share, 1e-6) : (pick - share) / max(1.0 - share, 1e-6);
    }
    hg_probe_light light;
    light.weight = sum.w;
    light.irradiance = sum.rgb / max(sum.w, 1e-24);
#ifdef HG_PROBES_BILINEAR
    light.surfaces = reflection.rgb / max(sum.w, 1e-24);
    light.sky = reflection.a / max(sum.w, 1e-24);
    hiding += 0.01 * vec4(reflection.rgb, sum.w - reflection.a);
    light.hiding = hiding.rgb / max(hiding.a, 1e-3 * sum.w);
#else
    uint k = p.count * (1u + HG_PROBE_IRRADIANCE_TEXELS + HG_PROBE_MOMENT_TEXELS) +
        2u * (chosen * HG_PROBE_IRRADIANCE_TEXELS +
            hg_probe_texel(r, HG_PROBE_IRRADIANCE_SIDE, xi.yx));
    light.surfaces = sum.w > 0.0 ? hg_rgb9e5(p.words.v[k]) : vec3(0.0);
    light.sky = sum.w > 0.0 ? uintBitsToFloat(p.words.v[k + 1u]) : 0.0;
#endif
    return light;
}

// The light at a surface: n its shading normal, n_geometric faces the eye, r where it mirrors.
void hg_probes_look(vec3 pos_ws, vec3 n_geometric, vec3 n, vec3 view, vec3 r, vec3 xi)
{
    float left = 1.0;
    hg_probes_irradiance = hg_probes_surfaces = vec3(0.0);
    hg_probes_sky = 0.0;
#ifdef HG_PROBES_BILINEAR
    hg_probes_hiding = vec3(0.0);
#endif
    for (int c = int(hg_frame.probes.count) - 1; c >= 0 && left > 0.0; c--) {
        hg_gpu_probe_grid p = hg_frame.probes.grids[c];
        hg_probe_point point = hg_probe_point_in(p, pos_ws, n_geometric, view);
        float share = c > 0 ? left * hg_probe_grid_share(p, point.at) : left;
        if (share <= 0.0)
            continue;
        hg_probe_light light = hg_probe_grid_look(p, point, n_geometric, n, r, xi);
        if (c > 0)
            share *= min(HG_PROBE_SURE * light.weight, 1.0);
        hg_probes_irradiance += share * light.irradiance;
        hg_probes_surfaces += share * light.surfaces;
        hg_probes_sky += share * light.sky;
#ifdef HG_PROBES_BILINEAR
        hg_probes_hiding += share * light.hiding;
#endif
        left -= share;
    }
}

#endif
