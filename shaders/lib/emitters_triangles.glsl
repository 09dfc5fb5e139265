// emitters_triangles.glsl - points of emissive triangles and what leaves them. Part of
// lib/emitters.glsl.
#ifndef HG_LIB_EMITTERS_TRIANGLES_GLSL
#define HG_LIB_EMITTERS_TRIANGLES_GLSL

struct hg_emitter_triangle {
    hg_gpu_part part;
    uvec3 corners;
    vec3 p0, e1, e2; // a corner and the edges from it
    vec3 normal;     // unit, of the front side
    float area;      // 0: degenerate
    float terms;     // HG_EMITTER_TERMS
    uint flags, material;
};

hg_emitter_triangle hg_emitter_fetch(uint draw, uint primitive)
{
    hg_emitter_triangle t;
    hg_gpu_draw d = hg_draw_at(draw);
    t.part = hg_part_at(d.part);
    t.flags = d.flags;
    t.material = d.material;
    if (HG_HAS(HG_FEATURE_LOD) && (d.flags & HG_DRAW_LOD) != 0u) {
        t.part = hg_part_list(t.part.indices).v[primitive >> HG_LOD_SHIFT];
        primitive &= (1u << HG_LOD_SHIFT) - 1u;
    }
    mat4x3 world = HG_EMITTER_WORLD(d);
    t.terms = HG_EMITTER_TERMS(draw, world);
    uint first = primitive * 3u;
    t.corners = uvec3(
        t.part.indices.v[first], t.part.indices.v[first + 1u], t.part.indices.v[first + 2u]);
    t.p0 = hg_world_corner(world, HG_EMITTER_POSITION(d, t.part, t.corners.x));
    t.e1 = hg_world_corner(world, HG_EMITTER_POSITION(d, t.part, t.corners.y)) - t.p0;
    t.e2 = hg_world_corner(world, HG_EMITTER_POSITION(d, t.part, t.corners.z)) - t.p0;
    vec3 face = cross(t.e1, t.e2) * ((d.flags & HG_DRAW_MIRRORED) != 0u ? -1.0 : 1.0);
    float twice = length(face);
    bool good = twice > 0.0 && !isinf(twice);
    t.area = good ? 0.5 * twice : 0.0;
    t.normal = good ? face / twice : vec3(0.0);
    return t;
}

// Cosine on the shining side of a triangle for light that leaves along -direction; <= 0: none.
float hg_emitter_cosine(hg_emitter_triangle t, vec3 direction)
{
    float c = -dot(t.normal, direction);
    return (t.flags & HG_DRAW_DOUBLE_SIDED) != 0u ? abs(c) : c;
}

// Surface point of a triangle as far as emission needs it; width: of the footprint, metres.
hg_vertex hg_emitter_vertex(hg_emitter_triangle t, vec2 b, float width)
{
    hg_vertex v;
    vec3 w = vec3(1.0 - b.x - b.y, b.x, b.y);
    v.position_ws = t.p0 + t.e1 * b.x + t.e2 * b.y;
    v.depth = 0.0;
    v.normal_ws = v.geometric_ws = t.normal;
    v.tangent_ws = vec4(1.0, 0.0, 0.0, 1.0);
    v.material = t.material;
    v.flags = t.flags;
    v.instance = 0u;
    v.front = true;
    vec2 a0 = t.part.vertices.v[t.corners.x].uv, a1 = t.part.vertices.v[t.corners.y].uv,
         a2 = t.part.vertices.v[t.corners.z].uv;
    float scale = width * inversesqrt(max(2.0 * t.area, 1e-30));
    v.uv0 = a0 * w.x + a1 * w.y + a2 * w.z;
    v.uv0_dx = (a1 - a0) * scale;
    v.uv0_dy = (a2 - a0) * scale;
    v.uv1 = v.uv0;
    v.uv1_dx = v.uv0_dx;
    v.uv1_dy = v.uv0_dy;
    if (HG_HAS(HG_FEATURE_VERTICES) && (t.flags & HG_DRAW_UV1) != 0u) {
        a0 = hg_fetch_uv1(t.part.extra, t.flags, t.corners.x);
        a1 = hg_fetch_uv1(t.part.extra, t.flags, t.corners.y);
        a2 = hg_fetch_uv1(t.part.extra, t.flags, t.corners.z);
        v.uv1 = a0 * w.x + a1 * w.y + a2 * w.z;
        v.uv1_dx = (a1 - a0) * scale;
        v.uv1_dy = (a2 - a0) * scale;
    }
    v.color = vec4(1.0);
    if (HG_HAS(HG_FEATURE_VERTICES) && (t.flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16)) != 0u)
        v.color = hg_fetch_color(t.part.extra, t.flags, t.corners.x) * w.x +
            hg_fetch_color(t.part.extra, t.flags, t.corners.y) * w.y +
            hg_fetch_color(t.part.extra, t.flags, t.corners.z) * w.z;
    return v;
}

// Radiance that leaves a point, times the share of the surface that is there.
vec3 hg_emitter_radiance(hg_vertex v)
{
    vec3 radiance = HG_MATERIAL_AT(v.material, emissive);
    if (HG_HAS(HG_FEATURE_EMISSIVE))
        radiance *= hg_material_sample(v.material, HG_MATERIAL_EMISSIVE, true, v).rgb;
    uint flags = HG_MATERIAL_AT(v.material, flags);
    if ((flags & (HG_MATERIAL_MASK | HG_MATERIAL_BLEND)) != 0u) {
        float alpha = hg_material_alpha(v.material, v);
        if ((flags & HG_MATERIAL_MASK) != 0u)
            alpha = alpha >= HG_MATERIAL_AT(v.material, alpha_cutoff) ? 1.0 : 0.0;
        radiance *= clamp(alpha, 0.0, 1.0);
    }
    return radiance;
}

uint hg_emitter_weight(uint i)
{
    return (HG_EMITTERS.weights.v[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu;
}

// Share of triangle i among those of a leaf.
float hg_emitter_part_chance(hg_gpu_emitter_leaf leaf, uint i)
{
    if (leaf.count < 2u)
        return 1.0;
    uint below = i == 0u ? 0u : hg_emitter_weight(leaf.first_weight + i - 1u);
    return float(hg_emitter_weight(leaf.first_weight + i) - below) / 65535.0;
}

// One of the triangles of a leaf.
uint hg_emitter_pick_part(hg_gpu_emitter_leaf leaf, float u)
{
    if (leaf.count < 2u)
        return 0u;
    uint at = min(uint(u * 65535.0), 65534u), low = 0u, high = leaf.count - 1u;
    for (uint i = 0u; i < 16u && low < high; i++) {
        uint middle = (low + high) >> 1u;
        if (hg_emitter_weight(leaf.first_weight + middle) > at)
            high = middle;
        else
            low = middle + 1u;
    }
    return low;
}

// Density per steradian of a point of a triangle that is chosen evenly.
float hg_emitter_solid_angle_pdf(float area, float distance2, float cosine)
{
    float pdf = distance2 / (area * cosine);
    return area > 0.0 && cosine > 1e-6 && !isinf(pdf) && pdf > 0.0 ? pdf : 0.0;
}

hg_emitter_sample hg_emitter_pick_triangle(hg_gpu_emitter_leaf leaf, float chance,
    vec3 position_ws, float u, vec2 v)
{
    hg_emitter_sample s = hg_emitter_nothing();
    uint part = hg_emitter_pick_part(leaf, u);
    hg_emitter_triangle t = hg_emitter_fetch(leaf.draw, leaf.primitive + part);
    // Evenly over the triangle. Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    vec2 b = v.y > v.x ? vec2(v.x * 0.5, v.y - v.x * 0.5) : vec2(v.x - v.y * 0.5, v.y * 0.5);
    vec3 d = t.p0 + t.e1 * b.x + t.e2 * b.y - position_ws;
    float d2 = dot(d, d);
    if (!(d2 > 0.0) || isinf(d2))
        return s;
    s.direction = d * inversesqrt(d2);
    float distance = sqrt(d2), cosine = hg_emitter_cosine(t, s.direction);
    s.distance = hg_emitter_reach(position_ws, distance, cosine, t.terms);
    s.pdf = chance * hg_emitter_part_chance(leaf, part) *
        hg_emitter_solid_angle_pdf(t.area, d2, cosine);
    s.group = HG_EMITTER_GROUP_EMISSIVE;
    s.draw = leaf.draw;
    s.primitive = leaf.primitive + part;
    s.barycentrics = b;
    if (s.pdf > 0.0)
        s.radiance = hg_emitter_radiance(hg_emitter_vertex(
            t, b, hg_emitter_cone_width + hg_emitter_cone_spread * distance));
    return s;
}

// Leaf of a triangle, its place in it; false: it is not among those that are chosen.
bool hg_emitter_find(uint draw, uint primitive, out uint leaf, out uint part)
{
    leaf = part = 0u;
    if (draw >= HG_EMITTERS.draw_count)
        return false;
    uint low = HG_EMITTERS.draw_pieces.v[draw], end = HG_EMITTERS.draw_pieces.v[draw + 1u];
    if (low >= end)
        return false;
    uint high = end - 1u;
    for (uint i = 0u; i < 32u && low < high; i++) { // the last that starts at or before it
        uint middle = (low + high + 1u) >> 1u;
        if (HG_EMITTERS.pieces.v[middle].first_primitive <= primitive)
            low = middle;
        else
            high = middle - 1u;
    }
    hg_gpu_emitter_piece piece = HG_EMITTERS.pieces.v[low];
    uint i = primitive - piece.first_primitive;
    leaf = piece.first_leaf + (i >> piece.shift);
    part = i & ((1u << piece.shift) - 1u);
    return primitive >= piece.first_primitive && i < piece.count;
}

#endif
