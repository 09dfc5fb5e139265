// debug_probes.glsl - probes as spheres in the scene, for debug views (lib/probes.glsl).
//
// Of each grid, from the finest on: what a finer one has is not shown of a coarser one. A ray visits the cells about the grid's points in their order (Amanatides and Woo 1987, "A Fast Voxel
// Traversal Algorithm for Ray Tracing"). A probe stays within 0.45 spacings of its point, so a sphere of
// HG_DEBUG_PROBE_RADIUS lies in its cell. Include lib/frame.glsl, lib/tables.glsl and lib/probes.glsl first.
#ifndef HG_LIB_DEBUG_PROBES_GLSL
#define HG_LIB_DEBUG_PROBES_GLSL

#include "shared/debug.h"

// Black is mapped to black, infinitely bright to white.
vec3 hg_debug_light(vec3 light)
{
    return light / (HG_DEBUG_LIGHT_HALF + light);
}

// Of a place: whether the probe takes part, and if not why.
vec3 hg_debug_probe_state(uint place)
{
    vec3 moved = hg_probe_offset(place);
    if ((place & HG_PROBE_INSIDE) != 0u)
        return vec3(0.8, 0.02, 0.02);
    if ((place & HG_PROBE_AWAKE) == 0u)
        return vec3(0.02, 0.1, 0.8);
    return length(moved) > HG_PROBE_MOVED ? vec3(0.85, 0.75, 0.0) : vec3(0.05, 0.55, 0.05);
}

// Colour of the sphere in a cell that a ray meets, and how far away (spacings); a < 0: none. from, d: in
// units of the grid; d is unit.
vec4 hg_debug_probe_in(hg_gpu_probe_grid p, ivec3 cell, vec3 from, vec3 d)
{
    uint k = uint((cell.z * int(p.counts[1]) + cell.y) * int(p.counts[0]) + cell.x);
    uint place = p.words.v[k];
    vec3 moved = hg_probe_offset(place);
    vec3 to = vec3(cell) + moved - from;
    float along = dot(to, d), r = HG_DEBUG_PROBE_RADIUS;
    float half_chord = r * r - dot(to - along * d, to - along * d);
    if (half_chord < 0.0 || along < r)
        return vec4(-1.0);
    float t = along - sqrt(half_chord);
    vec3 n = (t * d - to) / r, state = hg_debug_probe_state(place);
    bool rim = dot(n, d) > -0.6;
    if (rim || (place & HG_PROBE_AWAKE) == 0u)
        return vec4(state, t);
    return vec4(hg_debug_light(hg_probe_irradiance(p, p.count + k * HG_PROBE_IRRADIANCE_TEXELS, n, vec2(0.5))), t);
}

// A finer grid has the light of the place.
bool hg_debug_is_finer(int grid, vec3 at_ws)
{
    for (int c = grid + 1; c < int(hg_frame.probes.count); c++) {
        hg_gpu_probe_grid p = hg_frame.probes.grids[c];
        if (hg_probe_grid_share(p, (at_ws - p.origin_ws) / p.spacing) >= 1.0)
            return true;
    }
    return false;
}

// Colour of the nearest sphere of a grid along a ray, and how far away (in lengths of direction), nearer than `most`;
// a < 0: none.
vec4 hg_debug_probes_of(int grid, vec3 start_ws, vec3 direction, float most)
{
    hg_gpu_probe_grid p = hg_frame.probes.grids[grid];
    vec3 counts = vec3(p.counts[0], p.counts[1], p.counts[2]);
    vec3 from = (start_ws - p.origin_ws) / p.spacing, d = normalize(direction);
    vec3 inverse = 1.0 / mix(d, vec3(1e-12), lessThan(abs(d), vec3(1e-12)));
    vec3 a = (-0.5 - from) * inverse, b = (counts - 0.5 - from) * inverse;
    vec3 low = min(a, b), high = max(a, b);
    float t = max(max(low.x, low.y), max(low.z, 0.0)), end = min(high.x, min(high.y, high.z));
    end = min(end, most * length(direction) / p.spacing);
    ivec3 cell = ivec3(clamp(round(from + d * t), vec3(0.0), counts - 1.0));
    ivec3 step_to = ivec3(sign(d));
    int left = int(counts.x + counts.y + counts.z);
    while (t < end && left-- > 0) {
        vec4 found = hg_debug_probe_in(p, cell, from, d);
        if (found.a >= 0.0 && !hg_debug_is_finer(grid, p.origin_ws + vec3(cell) * p.spacing))
            return found.a < end ? vec4(found.rgb, found.a * p.spacing / length(direction)) : vec4(-1.0);
        vec3 leaves = (vec3(cell) + 0.5 * vec3(step_to) - from) * inverse;
        leaves = mix(leaves, vec3(3.4e38), equal(step_to, ivec3(0)));
        t = min(leaves.x, min(leaves.y, leaves.z));
        int axis = leaves.x <= t ? 0 : leaves.y <= t ? 1 : 2;
        cell[axis] += step_to[axis];
        if (cell[axis] < 0 || cell[axis] >= int(counts[axis]))
            break;
    }
    return vec4(-1.0);
}

// The nearest one of all grids, alpha 1; alpha 0: none.
vec4 hg_debug_probes(vec3 start_ws, vec3 direction, float most)
{
    vec4 nearest = vec4(0.0);
    for (int grid = int(hg_frame.probes.count) - 1; grid >= 0; grid--) {
        vec4 found = hg_debug_probes_of(grid, start_ws, direction, most);
        nearest = found.a >= 0.0 ? vec4(found.rgb, 1.0) : nearest;
        most = found.a >= 0.0 ? found.a : most;
    }
    return nearest;
}

#endif
