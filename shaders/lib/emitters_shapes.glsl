// emitters_shapes.glsl - lights with a size: points of their surface that are chosen, and where rays meet
// it. Part of lib/emitters.glsl. Surfaces shine outwards (spheres, tubes) or along the light's direction
// (rectangles, discs); a directional light is a disc at infinity.
#ifndef HG_LIB_EMITTERS_SHAPES_GLSL
#define HG_LIB_EMITTERS_SHAPES_GLSL

// Where a ray meets the surface.
struct hg_shape_hit {
    float distance; // < 0: nowhere
    float cosine;   // of the surface's normal and the way back
};

const hg_shape_hit hg_shape_missed = hg_shape_hit(-1.0, 0.0);

// Across a sphere of radius r at distance d: 1 - cos of the half angle, exact for small ones.
float hg_shape_cap(float r, float d)
{
    float sine2 = clamp(r * r / (d * d), 0.0, 1.0);
    return sine2 / (1.0 + sqrt(1.0 - sine2));
}

// Half the angle about a tube's axis from which a point at a distance of the axis sees it, radians.
float hg_shape_tube_angle(float radius, float axis_distance)
{
    return acos(clamp(radius / max(axis_distance, 1e-20), 0.0, 1.0));
}

// Density per steradian with which hg_shape_pick chooses what a ray from a point met; 0: never.
float hg_shape_pdf(hg_gpu_light light, vec3 position_ws, hg_shape_hit hit)
{
    if (light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        return HG_INV_PI * 0.5 * (1.0 + light.bound) / (light.radius * light.radius);
    vec3 d = light.position_ws - position_ws;
    float area = HG_PI * light.radius * light.radius;
    if (light.kind == HG_LIGHT_KIND_RECTANGLE) {
        area = 4.0 * light.half_width * light.half_height;
    } else if (light.kind == HG_LIGHT_KIND_TUBE) {
        float across = length(d - light.axis_ws * dot(d, light.axis_ws));
        area = 4.0 * light.half_width * light.radius * hg_shape_tube_angle(light.radius, across);
    } else if (light.kind != HG_LIGHT_KIND_DISC) {
        float pdf = HG_INV_PI * 0.5 / hg_shape_cap(light.radius, length(d));
        return isinf(pdf) || isnan(pdf) ? 0.0 : pdf;
    }
    return hg_emitter_solid_angle_pdf(area, hit.distance * hit.distance, hit.cosine);
}

hg_shape_hit hg_shape_hit_flat(hg_gpu_light light, vec3 from, vec3 direction)
{
    float cosine = -dot(light.direction_ws, direction);
    float t = -dot(light.position_ws - from, light.direction_ws) / max(cosine, 1e-12);
    vec3 at = from + direction * t - light.position_ws;
    bool inside = dot(at, at) <= light.radius * light.radius;
    if (light.kind == HG_LIGHT_KIND_RECTANGLE)
        inside = abs(dot(at, light.axis_ws)) <= light.half_width &&
            abs(dot(at, cross(light.direction_ws, light.axis_ws))) <= light.half_height;
    return cosine > 1e-6 && t > 0.0 && inside ? hg_shape_hit(t, cosine) : hg_shape_missed;
}

// Of the outside of a sphere, or a tube: what is along its axis is left out of the quadratic.
hg_shape_hit hg_shape_hit_round(hg_gpu_light light, vec3 from, vec3 direction)
{
    bool tube = light.kind == HG_LIGHT_KIND_TUBE;
    vec3 d = light.position_ws - from, a = light.axis_ws;
    vec3 across = tube ? direction - a * dot(direction, a) : direction;
    vec3 center = tube ? d - a * dot(d, a) : d;
    float along = dot(across, across);
    if (along < 1e-12 || dot(center, center) <= light.radius * light.radius)
        return hg_shape_missed;
    // The nearest point of the line to the middle, then back by half the chord.
    float nearest = dot(center, across) / along;
    vec3 off = across * nearest - center;
    float chord2 = (light.radius * light.radius - dot(off, off)) / along;
    if (chord2 <= 0.0 || nearest <= 0.0)
        return hg_shape_missed;
    float t = nearest - sqrt(chord2);
    if (tube && abs(dot(direction * t - d, a)) > light.half_width)
        return hg_shape_missed;
    return hg_shape_hit(t, dot(center - across * t, direction) / light.radius);
}

hg_shape_hit hg_shape_meet(hg_gpu_light light, vec3 from, vec3 direction)
{
    if (light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        return -dot(light.direction_ws, direction) >= light.bound ? hg_shape_hit(HG_EMITTER_FAR, 1.0)
                                                                  : hg_shape_missed;
    if (light.kind == HG_LIGHT_KIND_RECTANGLE || light.kind == HG_LIGHT_KIND_DISC)
        return hg_shape_hit_flat(light, from, direction);
    return hg_shape_hit_round(light, from, direction);
}

// Evenly over the cap of directions about an axis.
vec3 hg_shape_cap_direction(vec3 axis, float cap, vec2 u)
{
    vec3 t, s;
    hg_basis(axis, t, s);
    float less = u.x * cap, sine = sqrt(max(0.0, less * (2.0 - less)));
    float phi = 2.0 * HG_PI * u.y;
    return normalize(t * (sine * cos(phi)) + s * (sine * sin(phi)) + axis * (1.0 - less));
}

// Evenly over a disc. Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square".
vec2 hg_shape_disc(vec2 u)
{
    vec2 a = 2.0 * u - 1.0;
    if (a.x == 0.0 && a.y == 0.0)
        return vec2(0.0);
    bool wide = abs(a.x) > abs(a.y);
    float r = wide ? a.x : a.y;
    float phi = wide ? HG_PI * 0.25 * (a.y / a.x) : HG_PI * 0.5 - HG_PI * 0.25 * (a.x / a.y);
    return r * vec2(cos(phi), sin(phi));
}

// A direction to the light: spheres and suns evenly in solid angle, the others evenly over the surface
// that the point may see, which for tubes is the part of the mantle that faces it.
vec3 hg_shape_pick(hg_gpu_light light, vec3 position_ws, vec2 u)
{
    vec3 d = light.position_ws - position_ws, a = light.axis_ws;
    if (light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        return hg_shape_cap_direction(-light.direction_ws,
            light.radius * light.radius / (1.0 + light.bound), u);
    if (light.kind == HG_LIGHT_KIND_RECTANGLE) {
        vec2 at = (2.0 * u - 1.0) * vec2(light.half_width, light.half_height);
        return normalize(d + a * at.x + cross(light.direction_ws, a) * at.y);
    }
    if (light.kind == HG_LIGHT_KIND_DISC) {
        vec2 at = hg_shape_disc(u) * light.radius;
        return normalize(d + a * at.x + cross(light.direction_ws, a) * at.y);
    }
    if (light.kind == HG_LIGHT_KIND_TUBE) {
        vec3 back = a * dot(d, a) - d;
        float across = length(back);
        vec3 x = back / max(across, 1e-20), y = cross(a, x);
        float phi = (2.0 * u.y - 1.0) * hg_shape_tube_angle(light.radius, across);
        vec3 out_ws = x * cos(phi) + y * sin(phi);
        return normalize(d + a * ((2.0 * u.x - 1.0) * light.half_width) + out_ws * light.radius);
    }
    float distance = length(d);
    return hg_shape_cap_direction(d / max(distance, 1e-20), hg_shape_cap(light.radius, distance), u);
}

// One light with a size, that was chosen with a chance.
hg_emitter_sample hg_emitter_shape(hg_gpu_light light, float chance, vec3 position_ws, vec2 u)
{
    hg_emitter_sample s = hg_emitter_nothing();
    vec3 from = light.position_ws - position_ws;
    bool local = light.kind != HG_LIGHT_KIND_DIRECTIONAL;
    s.group = HG_EMITTER_GROUP_PUNCTUAL;
    s.draw = light.id;
    s.mask = light.shadow == HG_SHADOW_UNASKED ? 0u : HG_RAY_ALL;
    bool within = local && light.kind <= HG_LIGHT_KIND_SPOT && dot(from, from) <= light.radius * light.radius;
    if (within || !(chance > 0.0))
        return s;
    s.direction = hg_shape_pick(light, position_ws, u);
    hg_shape_hit hit = hg_shape_meet(light, position_ws, s.direction);
    if (hit.distance <= 0.0 && light.kind <= HG_LIGHT_KIND_SPOT) // by rounding
        hit = hg_shape_hit(local ? length(from) - light.radius : HG_EMITTER_FAR, 1.0);
    if (hit.distance <= 0.0)
        return s;
    s.distance = hit.distance;
    if (local)
        s.distance = hg_emitter_reach(position_ws, hit.distance, hit.cosine, 0.0);
    s.pdf = chance * hg_shape_pdf(light, position_ws, hit);
    s.radiance = hg_light_radiance(light, position_ws) *
        hg_light_surface_tint(light, s.direction * hit.distance - from);
    return s;
}

#endif
