// emitters_environment.glsl - directions of the environment by its light. Part of lib/emitters.glsl.
//
// Source: Clarberg, Jarosz, Akenine-Moller and Jensen 2005, "Wavelet Importance Sampling"
// (hierarchical warping).
#ifndef HG_LIB_EMITTERS_ENVIRONMENT_GLSL
#define HG_LIB_EMITTERS_ENVIRONMENT_GLSL

// The direction belongs to the sun of a sky.
bool hg_emitter_is_sky_sun(vec3 direction_ws)
{
    return dot(direction_ws, HG_EMITTERS.sky_sun_ws) > HG_EMITTERS.sky_sun_cos;
}

// What is seen far away.
vec3 hg_emitter_backdrop(vec3 direction_ws)
{
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_IMAGE)
        return hg_frame.lighting.env_color;
    return hg_environment_seen(direction_ws, hg_emitter_environment_lod);
}

// Radiance from far away: without the sun of a sky, which is a light.
vec3 hg_emitter_environment(vec3 direction_ws)
{
    return hg_emitter_is_sky_sun(direction_ws) ? vec3(0.0) : hg_emitter_backdrop(direction_ws);
}

// First quad of a level of the grid, 1..levels.
uint hg_emitter_quads_at(uint level)
{
    return 1u + 2u * ((1u << (2u * (level - 1u))) - 1u) / 3u;
}

// Solid angle of a cell in row y of the finest grid.
float hg_emitter_cell_angle(uint y, uint levels)
{
    float rows = float(1u << levels);
    return 2.0 * HG_PI / float(2u << levels) * 2.0 * sin(HG_PI * (float(y) + 0.5) / rows) *
        sin(0.5 * HG_PI / rows);
}

// Direction in the image's own frame; *pdf per steradian.
vec3 hg_emitter_warp(vec2 u, out float pdf)
{
    uint levels = HG_EMITTERS.environment_levels;
    hg_emitter_dice dx = hg_emitter_dice_of(u.x, u.xyx), dy = hg_emitter_dice_of(u.y, u.yyx);
    vec4 q = HG_EMITTERS.environment.v[0];
    float total = q.x + q.y;
    uint x = 0u, y = 0u, index = 0u;
    float weight = q.x;
    if (!(q.x > 0.0) || (q.y > 0.0 && !hg_emitter_throw(dx, q.x / total))) {
        x = index = 1u;
        weight = q.y;
    }
    for (uint level = 1u; level <= levels; level++) {
        q = HG_EMITTERS.environment.v[hg_emitter_quads_at(level) + index];
        float top = q.x + q.y, bottom = q.z + q.w;
        bool lower = !(top > 0.0) ||
            (bottom > 0.0 && !hg_emitter_throw(dy, top / (top + bottom)));
        vec2 row = lower ? q.zw : q.xy;
        bool right = !(row.x > 0.0) ||
            (row.y > 0.0 && !hg_emitter_throw(dx, row.x / (row.x + row.y)));
        weight = right ? row.y : row.x;
        x = x * 2u + (right ? 1u : 0u);
        y = y * 2u + (lower ? 1u : 0u);
        index = index * 4u + (right ? 1u : 0u) + (lower ? 2u : 0u);
    }
    pdf = weight / (total * hg_emitter_cell_angle(y, levels));
    // Evenly in solid angle within the cell.
    float rows = float(1u << levels);
    float cosine = mix(cos(HG_PI * float(y) / rows), cos(HG_PI * float(y + 1u) / rows), dy.u);
    float sine = sqrt(max(0.0, (1.0 - cosine) * (1.0 + cosine)));
    float phi = HG_PI * ((float(x) + dx.u) / rows - 1.0);
    return vec3(cos(phi) * sine, cosine, sin(phi) * sine);
}

// Density of hg_emitter_warp for a direction of the world.
float hg_emitter_warp_pdf(vec3 direction_ws)
{
    uint levels = HG_EMITTERS.environment_levels;
    vec2 size = vec2(uvec2(2u, 1u) << levels);
    uvec2 cell = uvec2(clamp(hg_environment_uv(direction_ws) * size, vec2(0.0), size - 1.0));
    vec4 root = HG_EMITTERS.environment.v[0];
    uint quad = cell.x >> levels; // the half
    for (uint level = levels; level-- > 1u;)
        quad = quad * 4u + ((cell.x >> level) & 1u) + ((cell.y >> level) & 1u) * 2u;
    float weight = quad == 0u ? root.x : root.y;
    if (levels > 0u) { // one word of the quad
        uint at = 4u * (hg_emitter_quads_at(levels) + quad) + (cell.x & 1u) + (cell.y & 1u) * 2u;
        weight = hg_emitter_cells(HG_EMITTERS.environment).v[at];
    }
    return weight / ((root.x + root.y) * hg_emitter_cell_angle(cell.y, levels));
}

// Directions behind a surface without transmission are never sampled.
bool hg_emitter_faces(vec3 direction, vec3 normal_ws)
{
    return normal_ws == vec3(0.0) || dot(direction, normal_ws) > 0.0;
}

hg_emitter_sample hg_emitter_pick_environment(float share, vec3 normal_ws, vec2 u)
{
    hg_emitter_sample s = hg_emitter_nothing();
    s.distance = HG_EMITTER_FAR;
    s.group = HG_EMITTER_GROUP_ENVIRONMENT;
    bool image = HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE) &&
        (!HG_EMITTER_MAY(HG_EMITTER_KIND_PLAIN) ||
            HG_EMITTERS.environment_kind == HG_ENV_KIND_IMAGE);
    if (image) {
        vec3 d = hg_emitter_warp(u, s.pdf);
        float c = hg_frame.lighting.env_rotation_cos, r = hg_frame.lighting.env_rotation_sin;
        s.direction = vec3(c * d.x + r * d.z, d.y, c * d.z - r * d.x); // hg_environment_rotate back
    } else if (normal_ws == vec3(0.0)) {
        float z = 1.0 - 2.0 * u.x, phi = 2.0 * HG_PI * u.y;
        s.direction = vec3(vec2(cos(phi), sin(phi)) * sqrt(max(0.0, 1.0 - z * z)), z);
        s.pdf = 0.25 * HG_INV_PI;
    } else {
        vec3 t, b, d = hg_sample_cosine(u);
        hg_basis(normal_ws, t, b);
        s.direction = normalize(t * d.x + b * d.y + normal_ws * d.z);
        s.pdf = d.z * HG_INV_PI;
    }
    s.pdf *= hg_emitter_faces(s.direction, normal_ws) ? share : 0.0;
    if (s.pdf > 0.0)
        s.radiance = hg_emitter_environment(s.direction);
    return s;
}

#endif
