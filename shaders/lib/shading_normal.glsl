// shading_normal.glsl - normals that fit their triangle and where they are seen from, the same for paths
// and for pictures with gathered light. Include lib/brdf.glsl first.
#ifndef HG_LIB_SHADING_NORMAL_GLSL
#define HG_LIB_SHADING_NORMAL_GLSL

// Shading normal nearest to n at which the mirrored view does not lead below the triangle, where
// light would be lost: the mirrored direction is lifted to just above it, and the normal is half-way.
// v and geometric lie on one side.
vec3 hg_valid_normal(vec3 n, vec3 geometric, vec3 v)
{
    vec3 r = 2.0 * dot(n, v) * n - v;
    float height = dot(r, geometric), least = min(0.9 * dot(v, geometric), 0.01);
    if (height >= least)
        return n;
    vec3 along = r - height * geometric;
    float scale = sqrt((1.0 - least * least) / max(dot(along, along), 1e-12));
    vec3 half_way = v + along * scale + geometric * least;
    return half_way * inversesqrt(max(dot(half_way, half_way), 1e-12));
}

// Share of specular (reflected or transmitted) light in all light that leaves a surface.
float hg_specular_share(hg_surface s, float n_dot_v)
{
    vec2 dfg = hg_dfg(clamp(n_dot_v, 0.0, 1.0), s.roughness);
    float color = max(s.base_color.r, max(s.base_color.g, s.base_color.b));
    float dielectric = s.specular * (s.f0 * dfg.x + dfg.y);
    float mirrored = mix(dielectric, color * dfg.x + dfg.y, s.metallic);
    float below = (1.0 - s.metallic) * (1.0 - min(dielectric, 1.0)) * color;
    return clamp((mirrored + s.transmission * below) / max(mirrored + below, 1e-6), 0.0, 1.0);
}

// A normal that points behind its triangle is mirrored at it. One whose mirrored view would lead
// behind it is bent, by as much as the surface mirrors: what it scatters goes by the normal as it is.
vec3 hg_shading_normal(hg_surface s, vec3 view)
{
    vec3 n = s.normal - s.geometric_normal * (2.0 * min(dot(s.normal, s.geometric_normal), 0.0));
    vec3 bent = hg_valid_normal(n, s.geometric_normal, view);
    if (bent == n)
        return n;
    return normalize(mix(n, bent, hg_specular_share(s, dot(bent, view))));
}

void hg_bend_normals(inout hg_surface s, vec3 view)
{
    s.normal = hg_shading_normal(s, view);
    if (HG_HAS(HG_FEATURE_CLEARCOAT))
        s.clearcoat_normal = hg_valid_normal(s.clearcoat_normal, s.geometric_normal, view);
}

#endif
