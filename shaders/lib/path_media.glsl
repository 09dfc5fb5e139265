// path_media.glsl - which media a path is in: nested dielectrics.
//
// A path keeps the materials of the closed surfaces that it has gone into and not out of, innermost
// last entered, at most four; what it enters beyond that is not kept. The one entered last is the
// one around: its absorption counts on the way, and its index of refraction is what is outside of
// the next surface that is entered. Behind a surface that is left lies what was around it before it
// was entered. When others were entered since (volumes that overlap) the one around stays around, and
// nothing bends there. A camera starts in air.
// Include lib/path.glsl, lib/material.glsl and lib/bsdf.glsl first.
#ifndef HG_LIB_PATH_MEDIA_GLSL
#define HG_LIB_PATH_MEDIA_GLSL

#define HG_MEDIA HG_HAS(HG_FEATURE_TRANSMISSION | HG_FEATURE_DIFFUSE_TRANSMISSION)

// media: material + 1 in 16 bits each, innermost in the lowest; 0: air.
vec3 hg_media_attenuation(uvec2 media)
{
    uint material = media.x & 0xffffu;
    if (!HG_MEDIA || material == 0u)
        return vec3(0.0);
    uint lobes = HG_MATERIAL_AT(material - 1u, lobes);
    if (lobes == 0u || hg_frame.geometry.lobes.v[lobes - 1u].thickness == 0.0)
        return vec3(0.0);
    return hg_frame.geometry.lobes.v[lobes - 1u].attenuation;
}

// channel: of the path, 3 while it has all of them.
float hg_media_ior(uint material, uint channel)
{
    if (material == 0u)
        return 1.0;
    uint lobes = HG_MATERIAL_AT(material - 1u, lobes);
    if (lobes == 0u)
        return 1.5;
    float ior = hg_frame.geometry.lobes.v[lobes - 1u].ior;
    float dispersion = hg_frame.geometry.lobes.v[lobes - 1u].dispersion;
    return channel > 2u || dispersion <= 0.0 ? ior : hg_dispersed_ior(ior, dispersion, channel);
}

uvec2 hg_media_without(uvec2 media, uint material)
{
    uvec4 m = uvec4(media.x & 0xffffu, media.x >> 16u, media.y & 0xffffu, media.y >> 16u);
    if (m.x == material)
        m = uvec4(m.yzw, 0u);
    else if (m.y == material)
        m = uvec4(m.x, m.zw, 0u);
    else if (m.z == material)
        m = uvec4(m.xy, m.w, 0u);
    else if (m.w == material)
        m.w = 0u;
    return uvec2(m.x | (m.y << 16u), m.z | (m.w << 16u));
}

// Index of refraction outside of a surface that was hit; `ior`: its own.
float hg_media_outside(uvec2 media, uint material, bool front, float ior, uint channel)
{
    if (!HG_MEDIA)
        return 1.0;
    uvec2 around = front ? media : hg_media_without(media, material + 1u);
    if (around != media && (around.x & 0xffffu) == (media.x & 0xffffu) && around.x != 0u)
        return ior;
    return hg_media_ior(around.x & 0xffffu, channel);
}

// The path goes through a surface: into what it bounds, from the front, or out of it.
void hg_media_cross(inout uvec2 media, uint material, bool front)
{
    if (!HG_MEDIA)
        return;
    if (!front)
        media = hg_media_without(media, material + 1u);
    else if (material < 0xffffu && media.y >> 16u == 0u)
        media = uvec2((media.x << 16u) | (material + 1u), (media.y << 16u) | (media.x >> 16u));
}

#endif
