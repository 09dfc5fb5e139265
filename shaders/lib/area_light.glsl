// area_light.glsl - light of surfaces of one radiance on a point, in closed form: the outline of the surface
// as a polygon, clipped at the horizon, under a cosine, or under a linearly transformed one for specular
// lobes. Part of lib/light.glsl.
//
// Source: Heitz, Dupuy, Hill and Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed
// Cosines". Rounds, which Heitz and Hill 2017 ("Real-Time Line- and Disk-Light Shading") integrate as
// ellipses, are polygons of their area here: linear maps leave polygons what they are, and the clipping is
// the exact one for them, too.
#ifndef HG_LIB_AREA_LIGHT_GLSL
#define HG_LIB_AREA_LIGHT_GLSL

#define HG_AREA_CORNERS 12u
// A circle's polygon has its area.
#define HG_AREA_WIDENED sqrt(2.0 * HG_PI / float(HG_AREA_CORNERS) / sin(2.0 * HG_PI / float(HG_AREA_CORNERS)))
// Deviation of the filter of an image, of the distance to it: half way to the half width of a cosine lobe on
// a parallel plane, whose tails are longer than a normal distribution's.
#define HG_AREA_BLUR 0.5
#define HG_AREA_TEXELS 1.2 // deviation of a level's own blur, in its texels (renderer/scene/light_table.c)
#define HG_AREA_SMALL   0.05 // of its distance: up to this size a polygon is one point with an area

// --- outline -------------------------------------------------------------------------------------

// What a point sees: `corners` offsets from `center`, metres, or of any unit for lights at infinity.
struct hg_area_outline {
    vec3 center; // from the point; 0: it sees nothing
    vec3 x, y;   // half axes, or of tubes: to the point and across, both of the tube's radius
    vec3 along;  // tubes: half its length
    float angle; // tubes: half of what is seen of its mantle, radians
    uint corners;
    uint image;  // of the surface of rectangles and discs, in the tables; HG_LIGHT_NO_TABLE
};

hg_area_outline hg_area_outline_of(hg_gpu_light light, vec3 pos_ws)
{
    hg_area_outline o;
    vec3 d = light.position_ws - pos_ws, a = light.axis_ws;
    float square = dot(d, d), r2 = light.radius * light.radius;
    const float widened = HG_AREA_WIDENED;
    o.center = d;
    o.image = HG_HAS2(HG_FEATURE2_LIGHT_TABLES) && hg_light_is_flat(light) ? light.image : HG_LIGHT_NO_TABLE;
    o.along = vec3(0.0);
    o.angle = 0.0;
    o.corners = HG_AREA_CORNERS;
    if (light.kind == HG_LIGHT_KIND_RECTANGLE || light.kind == HG_LIGHT_KIND_DISC) {
        bool flat_disc = light.kind == HG_LIGHT_KIND_DISC;
        o.x = a * (flat_disc ? light.radius * widened : light.half_width);
        o.y = cross(light.direction_ws, a) * (flat_disc ? light.radius * widened : light.half_height);
        o.corners = flat_disc ? HG_AREA_CORNERS : 4u;
        if (dot(d, light.direction_ws) >= 0.0)
            o.center = vec3(0.0);
        return o;
    }
    if (light.kind == HG_LIGHT_KIND_TUBE) {
        vec3 back = a * dot(d, a) - d;
        float across = length(back);
        o.x = back * (light.radius / max(across, 1e-20));
        o.y = cross(a, o.x);
        o.along = a * light.half_width;
        o.angle = acos(clamp(light.radius / max(across, 1e-20), 0.0, 1.0));
        if (across <= light.radius)
            o.center = vec3(0.0);
        return o;
    }
    // The circle that a sphere is seen in, or that of a sun.
    bool sun = light.kind == HG_LIGHT_KIND_DIRECTIONAL;
    vec3 axis = sun ? -light.direction_ws : d * inversesqrt(max(square, 1e-20));
    float radius = sun ? light.radius : light.radius * sqrt(max(1.0 - r2 / max(square, 1e-20), 0.0));
    vec3 t, s;
    hg_basis(axis, t, s);
    o.center = sun ? axis * light.bound : d * (1.0 - r2 / max(square, 1e-20));
    o.x = t * (radius * widened);
    o.y = s * (radius * widened);
    if (!sun && square <= r2)
        o.center = vec3(0.0);
    return o;
}

// Corner i less the center.
vec3 hg_area_corner(hg_area_outline o, uint i)
{
    if (o.corners == 4u)
        return (i == 0u || i == 3u ? o.x : -o.x) + (i < 2u ? o.y : -o.y);
    if (o.along == vec3(0.0)) {
        float phi = float(i) * (2.0 * HG_PI / float(HG_AREA_CORNERS));
        return o.x * cos(phi) + o.y * sin(phi);
    }
    // An arc of each end.
    const uint half_way = HG_AREA_CORNERS / 2u;
    bool far = i >= half_way;
    float part = float(far ? HG_AREA_CORNERS - 1u - i : i) / float(half_way - 1u);
    float phi = o.angle * (2.0 * part - 1.0);
    return o.x * cos(phi) + o.y * sin(phi) + (far ? -o.along : o.along);
}

// --- integral over a polygon -----------------------------------------------------------------------

// Corner by corner, in a space in which the lobe is a cosine about z.
struct hg_area_sum {
    vec3 center, first, last; // corners less the center
    vec3 irradiance;          // vector irradiance so far
    vec3 leaves, enters;      // where it goes through the horizon; 0: nowhere so far
    vec3 area;
    float reach2; // of the farthest corner
};

hg_area_sum hg_area_begin(vec3 center)
{
    return hg_area_sum(
        center, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
}

// Of the edge between two directions: its angle times the normal of its plane.
vec3 hg_area_edge(vec3 a, vec3 b)
{
    a = normalize(a);
    b = normalize(b);
    vec3 c = cross(a, b);
    float sine = length(c);
    return c * (sine > 1e-6 ? atan(sine, dot(a, b)) / sine : 1.0);
}

void hg_area_add_edge(inout hg_area_sum sum, vec3 from, vec3 to)
{
    vec3 a = sum.center + from, b = sum.center + to;
    sum.area += cross(from, to);
    if (a.z <= 0.0 && b.z <= 0.0)
        return;
    vec3 cut = a + (b - a) * (a.z / (abs(a.z - b.z) > 0.0 ? a.z - b.z : 1.0));
    cut.z = 0.0;
    if (a.z <= 0.0) {
        // What lies between leaving and coming back is closed along the horizon.
        if (sum.leaves != vec3(0.0))
            sum.irradiance += hg_area_edge(sum.leaves, cut);
        else
            sum.enters = cut;
        sum.leaves = vec3(0.0);
        a = cut;
    }
    if (b.z <= 0.0)
        sum.leaves = b = cut;
    sum.irradiance += hg_area_edge(a, b);
}

void hg_area_add(inout hg_area_sum sum, uint i, vec3 corner)
{
    if (i == 0u)
        sum.first = corner;
    else
        hg_area_add_edge(sum, sum.last, corner);
    sum.last = corner;
    sum.reach2 = max(sum.reach2, dot(corner, corner));
}

// Share of the lobe that the polygon covers, and times it the mean direction of what it covers.
vec4 hg_area_end(hg_area_sum sum)
{
    hg_area_add_edge(sum, sum.last, sum.first);
    if (sum.leaves != vec3(0.0) && sum.enters != vec3(0.0))
        sum.irradiance += hg_area_edge(sum.leaves, sum.enters);
    float square = max(dot(sum.center, sum.center), 1e-30);
    if (sum.reach2 < HG_AREA_SMALL * HG_AREA_SMALL * square) {
        // Edges would cancel but for rounding.
        vec3 w = sum.center * inversesqrt(square);
        float share = 0.5 * abs(dot(sum.area, w)) * max(w.z, 0.0) / (HG_PI * square);
        return vec4(w * share, share);
    }
    vec3 f = sum.irradiance * (0.5 * HG_INV_PI);
    f = f.z < 0.0 ? -f : f;
    return vec4(normalize(f + vec3(0.0, 0.0, 1e-20)) * f.z, f.z);
}

// --- images --------------------------------------------------------------------------------------

// Mean colour of what a lobe sees of an image, in a space in which it is a cosine about z: where the
// direction of the vector irradiance, which lies within the outline, meets the surface, blurred by the
// distance. x, y, center: of the outline, in that space; linear maps keep places on the surface.
// Source: Heitz, Dupuy, Hill and Neubelt 2016, section 5, "Textured Polygonal Lights".
vec3 hg_area_image(hg_area_outline o, vec3 x, vec3 y, vec3 center, vec3 towards)
{
    vec3 n = cross(x, y);
    float nn = max(dot(n, n), 1e-30), facing = dot(towards, n);
    float t = dot(center, n) / (abs(facing) > 1e-20 ? facing : 1e-20);
    vec3 p = towards * t - center;
    vec2 at = vec2(dot(cross(p, y), n), dot(cross(x, p), n)) / nn;
    if (o.corners != 4u)
        at *= HG_AREA_WIDENED;
    uint size = hg_light_word(o.image);
    float texels = sqrt(float((size & 0xffffu) * (size >> 16)));
    float blur = HG_AREA_BLUR * abs(t) / (2.0 * sqrt(sqrt(nn))); // of the mean side
    return hg_light_image_lod(o.image, clamp(vec2(0.5) + vec2(-0.5, 0.5) * at, vec2(0.0), vec2(1.0)),
        log2(max(blur * texels / HG_AREA_TEXELS, 1e-6)));
}

// --- lobes ---------------------------------------------------------------------------------------

// m11, m22, m13 and sine of renderer/light/ltc/ltc.h.
vec4 hg_ltc(float cosine, float roughness)
{
    const float last = float(HG_LTC_SIZE - 1);
    vec2 p = clamp(vec2(sqrt(max(cosine, 0.0)), roughness), 0.0, 1.0) * last;
    uvec2 i = uvec2(min(p, vec2(last - 1.0)));
    vec2 f = p - vec2(i);
    vec4 row[2];
    for (uint k = 0u; k < 2u; k++) {
        uint at = HG_LTC_FIRST + 2u * ((i.y + k) * HG_LTC_SIZE + i.x);
        vec4 low = vec4(unpackHalf2x16(hg_frame.lighting.dfg.v[at]),
            unpackHalf2x16(hg_frame.lighting.dfg.v[at + 1u]));
        vec4 high = vec4(unpackHalf2x16(hg_frame.lighting.dfg.v[at + 2u]),
            unpackHalf2x16(hg_frame.lighting.dfg.v[at + 3u]));
        row[k] = mix(low, high, f.x);
    }
    vec4 m = mix(row[0], row[1], f.y);
    m.zw *= sqrt(max(1.0 - cosine * cosine, 0.0));
    return vec4(m.xyz, min(m.w, 1.0));
}

// A direction of the frame about the normal, x away from the eye, to where the lobe is a cosine.
vec3 hg_ltc_to_cosine(vec4 m, vec3 v)
{
    float cosine = sqrt(max(1.0 - m.w * m.w, 0.0));
    float x = cosine * v.x - m.w * v.z, z = m.w * v.x + cosine * v.z;
    return vec3((x - m.z * z) / m.x, v.y / m.y, z);
}

// Rows: x away from the eye, y, z = n.
mat3 hg_area_frame(vec3 n, vec3 v)
{
    vec3 x = n * dot(n, v) - v;
    float length2 = dot(x, x);
    vec3 t, s;
    hg_basis(n, t, s);
    x = length2 > 1e-12 ? x * inversesqrt(length2) : t;
    return transpose(mat3(x, cross(n, x), n));
}

// Of a polygon: share of the cosine lobe about the normal and its mean direction, and of a specular lobe.
struct hg_area_cover {
    vec4 cosine;    // xyz: in the frame about the normal, times w; w: irradiance over pi per radiance
    float specular; // mean of the lobe
    vec3 wide_tint, narrow_tint; // colour of the image that each sees, 1 without one
};

hg_area_cover hg_area_covers(hg_area_outline o, vec3 n, vec3 v, float roughness)
{
    mat3 frame = hg_area_frame(n, v);
    vec4 m = hg_ltc(abs(dot(n, v)), roughness);
    vec3 center = frame * o.center;
    hg_area_sum wide = hg_area_begin(center);
    hg_area_sum narrow = hg_area_begin(hg_ltc_to_cosine(m, center));
    uint i = 0u;
    do {
        vec3 corner = frame * hg_area_corner(o, i);
        hg_area_add(wide, i, corner);
        hg_area_add(narrow, i, hg_ltc_to_cosine(m, corner));
    } while (++i < o.corners);
    hg_area_cover c = hg_area_cover(hg_area_end(wide), 0.0, vec3(1.0), vec3(1.0));
    vec4 lobe = hg_area_end(narrow);
    c.specular = lobe.w;
    if (HG_HAS2(HG_FEATURE2_LIGHT_TABLES) && o.image != HG_LIGHT_NO_TABLE) {
        vec3 x = frame * o.x, y = frame * o.y;
        c.wide_tint = hg_area_image(o, x, y, center, c.cosine.xyz / max(c.cosine.w, 1e-20));
        c.narrow_tint = hg_area_image(o, hg_ltc_to_cosine(m, x), hg_ltc_to_cosine(m, y),
            hg_ltc_to_cosine(m, center), lobe.xyz / max(lobe.w, 1e-20));
    }
    return c;
}

// Share of the cosine lobe about a normal, times the colour it has; from: mean direction, unit where there
// is any.
vec3 hg_area_irradiance(hg_area_outline o, vec3 n, out vec3 from)
{
    mat3 frame = hg_area_frame(n, n);
    hg_area_sum sum = hg_area_begin(frame * o.center);
    uint i = 0u;
    do
        hg_area_add(sum, i, frame * hg_area_corner(o, i));
    while (++i < o.corners);
    vec4 c = hg_area_end(sum);
    from = c.xyz * frame / max(c.w, 1e-20);
    if (HG_HAS2(HG_FEATURE2_LIGHT_TABLES) && o.image != HG_LIGHT_NO_TABLE)
        return c.w * hg_area_image(o, frame * o.x, frame * o.y, frame * o.center, c.xyz / max(c.w, 1e-20));
    return vec3(c.w);
}

// What a surface reflects of an outline of radiance 1; `mean`: of the directions that it is lit from.
vec3 hg_area_reflected(hg_brdf b, hg_area_outline o, out vec3 mean)
{
    hg_area_cover c = hg_area_covers(o, b.n, b.v, b.roughness);
    mean = c.cosine.xyz * hg_area_frame(b.n, b.v);
    float miss_v = 1.0 - b.dfg_v.x - b.dfg_v.y;
    vec3 single = b.f0 * b.dfg_v.x + b.dfg_v.y;
    // The cosine of the light, where albedo goes by it, is that of the mean direction.
    vec2 dfg_l = hg_dfg(clamp(c.cosine.z / max(c.cosine.w, 1e-20), 0.0, 1.0), b.roughness);
    float miss_l = 1.0 - dfg_l.x - dfg_l.y;
    float miss_avg = max(1.0 - b.dfg_avg.x - b.dfg_avg.y, 1e-4);
    float e_l = b.f0_dielectric * dfg_l.x + dfg_l.y + b.f_ms_dielectric * miss_l;
    vec3 wide = b.f_ms * (miss_v * miss_l / miss_avg) + b.diffuse * (b.diffuse_scale_v * (1.0 - e_l));
    return single * c.specular * c.narrow_tint + wide * c.cosine.w * c.wide_tint;
}

#ifdef HG_LIB_BSDF_GLSL
// What is scattered of light from about a direction, over the share of the cosine lobe that it comes from.
vec3 hg_area_scattered(hg_bsdf b, vec3 l)
{
    vec3 l_ts = vec3(dot(b.t, l), dot(b.s, l), dot(b.base.n, l));
    bool behind = l_ts.z < 0.0;
    float cos_l = clamp(abs(l_ts.z), 1e-3, 1.0);
    hg_bsdf_layers over = hg_bsdf_no_layers;
    if (b.thin || b.inside == behind)
        over = hg_bsdf_layers_at(b, dot(b.coat_n, l) * (behind ? -1.0 : 1.0), cos_l);
    vec3 sum = hg_bsdf_evaluate_diffuse(b, l_ts, over, true);
    if (HG_HAS(HG_FEATURE_SHEEN) && !behind && !b.inside)
        sum += hg_bsdf_evaluate_sheen(b, l, cos_l, over);
    return sum * (HG_PI / cos_l);
}

// The same of all lobes: base and coat have a lobe each, what is scattered, by sheen as well, goes by the
// mean direction. Light that comes through rough glass is left to reflections.
vec3 hg_area_reflected_by_lobes(hg_bsdf b, hg_area_outline o, out vec3 mean)
{
    hg_area_cover c = hg_area_covers(o, b.base.n, b.base.v, b.base.roughness);
    mean = c.cosine.xyz * hg_area_frame(b.base.n, b.base.v);
    vec3 sum = hg_bsdf_single_albedo(b, hg_bsdf_cosine(b, b.v_ts), b.below_v) * c.specular * c.narrow_tint;
    if (c.cosine.w > 0.0)
        sum += hg_area_scattered(b, normalize(mean)) * c.cosine.w * c.wide_tint;
    if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION)) {
        vec3 from;
        vec3 share = hg_area_irradiance(o, -b.base.n, from);
        float most = max(share.r, max(share.g, share.b));
        sum += most > 0.0 ? hg_area_scattered(b, from) * share : vec3(0.0);
        mean = most > c.cosine.w ? from : mean;
    }
    if (HG_HAS(HG_FEATURE_CLEARCOAT)) {
        hg_area_cover coat = hg_area_covers(o, b.coat_n, b.base.v, b.coat_roughness);
        sum += coat.specular * coat.narrow_tint * (1.0 - b.coat_v);
    }
    return sum;
}
#endif

#endif
