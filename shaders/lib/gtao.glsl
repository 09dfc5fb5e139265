// gtao.glsl - ambient occlusion by what the depth of the picture shows near a point, with the bent normal.
//
// Slices of the hemisphere that contain the view direction; in each the two horizons, from a few samples of
// depth on either side, and the cosine-weighted part between them in closed form. Source: Jimenez et al. 2016,
// "Practical Real-Time Strategies for Accurate Indirect Occlusion", equations 3 to 10; directions integrated in the same way.
//
// Include lib/frame.glsl, and define hg_gtao_depth(ivec2 pixel) first: metres along the view direction; 0
// where nothing is. HG_GTAO_SLICES, HG_GTAO_STEPS: how many, of either side.
#ifndef HG_LIB_GTAO_GLSL
#define HG_LIB_GTAO_GLSL

#ifndef HG_GTAO_SLICES
#define HG_GTAO_SLICES 2
#define HG_GTAO_STEPS  4
#endif

// Relative to the eye, with a perspective camera; px with the centre of pixel 0 at 0.5.
vec3 hg_gtao_position(vec2 px, float depth)
{
    return (hg_frame.camera.ray_origin_ws + px.x * hg_frame.camera.ray_x_ws + px.y * hg_frame.camera.ray_y_ws) *
        depth;
}

// The greatest cosine to the view direction of what is seen from p along a line of the picture: that of the
// hemisphere's edge, and of each occluder as much as its distance lets it count.
float hg_gtao_horizon(vec2 from, vec2 way, vec3 p, vec3 view, vec2 edge_and_radius, float xi)
{
    float edge = edge_and_radius.x, radius = edge_and_radius.y, most = edge;
    vec2 last = vec2(hg_frame.width, hg_frame.height);
    for (int k = 0; k < HG_GTAO_STEPS; k++) {
        float s = (float(k) + xi) * (1.0 / float(HG_GTAO_STEPS));
        vec2 off = way * (s * s);
        off *= max(1.0, float(k + 2) * inversesqrt(max(dot(off, off), 1e-12))); // each in another pixel, none next to it
        vec2 px = floor(from + off) + 0.5;
        bool inside = all(greaterThan(px, vec2(0.0))) && all(lessThan(px, last));
        float depth = inside ? hg_gtao_depth(ivec2(px)) : 0.0;
        vec3 d = hg_gtao_position(px, depth) - p;
        float far = length(d), share = depth > 0.0 ? clamp(2.0 - 2.0 * far / radius, 0.0, 1.0) : 0.0;
        most = max(most, mix(edge, dot(d, view) / max(far, 1e-6), share));
    }
    return most;
}

// Within 7e-5; library functions are most of the time here. Abramowitz and Stegun 1964, 4.4.45.
float hg_gtao_acos(float x)
{
    float a = min(abs(x), 1.0);
    float angle = sqrt(1.0 - a) * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - a * 0.0187293)));
    return x < 0.0 ? 3.14159265 - angle : angle;
}

// Of one side of a slice, from the view direction to a horizon whose cosine is h; n: cosine and sine of the
// normal's angle from the view direction to that side. x: part of the cosine lobe (equation 7); y, z: its sum of
// directions along the view direction and to that side.
vec3 hg_gtao_arc(float h, vec2 n)
{
    float s = sqrt(max(1.0 - h * h, 0.0)), s3 = s * s * s, h3 = h * h * h;
    float part = n.x + 2.0 * hg_gtao_acos(h) * n.y - ((2.0 * h * h - 1.0) * n.x + 2.0 * s * h * n.y);
    return vec3(0.25 * part, n.x * (1.0 - h3) + n.y * s3, n.x * s3 + n.y * (2.0 - 3.0 * h + h3));
}

// p: relative to the eye, at `pixel`; n: unit, towards the eye; radius: metres within which things
// occlude, wholly up to its half. xi: angle and distances of this point. xyz: mean direction that is
// not occluded, unit; w: share of the cosine lobe that is not.
vec4 hg_gtao(vec2 pixel, vec3 p, vec3 n, float radius, vec2 xi)
{
    vec3 view = -normalize(p), across = normalize(cross(view, hg_frame.camera.ray_y_ws));
    vec3 up = cross(across, view), bent = vec3(0.0);
    float depth = dot(p, hg_frame.camera.forward_ws), open = 0.0;
    float per_px = 1.0 / dot(hg_frame.camera.ray_x_ws, hg_frame.camera.ray_x_ws);
    for (int i = 0; i < HG_GTAO_SLICES; i++) {
        float phi = 3.14159265 * (float(i) + xi.x) * (1.0 / float(HG_GTAO_SLICES));
        vec3 side = cos(phi) * across + sin(phi) * up;
        // Where a step to that side goes in the picture, px per metre.
        vec3 slope = (side - p * (dot(side, hg_frame.camera.forward_ws) / depth)) * (per_px / depth);
        vec2 way = vec2(dot(slope, hg_frame.camera.ray_x_ws), dot(slope, hg_frame.camera.ray_y_ws)) * radius;
        vec3 axis = cross(side, view), in_slice = n - axis * dot(n, axis);
        float part = length(in_slice);
        float cosine = clamp(dot(in_slice, view) / max(part, 1e-6), -1.0, 1.0);
        float sine = (dot(in_slice, side) < 0.0 ? -1.0 : 1.0) * sqrt(max(1.0 - cosine * cosine, 0.0));
        // Of the hemisphere about the normal: 90 degrees to either side.
        float ahead = hg_gtao_horizon(pixel, way, p, view, vec2(-sine, radius), xi.y);
        float behind = hg_gtao_horizon(pixel, -way, p, view, vec2(sine, radius), xi.y);
        vec3 right = hg_gtao_arc(ahead, vec2(cosine, sine)), left = hg_gtao_arc(behind, vec2(cosine, -sine));
        open += part * (right.x + left.x);
        bent += part * ((right.y + left.y) * view + (right.z - left.z) * side);
    }
    return vec4(normalize(bent + 1e-4 * n), clamp(open * (1.0 / float(HG_GTAO_SLICES)), 0.0, 1.0));
}

#endif
