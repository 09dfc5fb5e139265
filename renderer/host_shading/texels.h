// texels.h - texels of probe light (shaders/shared/gi.h) that the host has read back: where their
// surfaces are, for rays that are sent from there. Floor 2. Pure, inline.
#ifndef HG_RENDERER_HOST_SHADING_TEXELS_H
#define HG_RENDERER_HOST_SHADING_TEXELS_H

#include "renderer/math/vec.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/gi.h"
#include "shaders/shared/reflect.h"

// The picture that they are of. camera: relative to the geometry's origin.
struct hg_host_texels {
    const struct hg_gpu_camera *camera;
    uint32_t width, height; // px
};

// Position, and the way to the eye, unit. depth: metres along the view direction.
static inline void hg_host_texel_place(const struct hg_host_texels *t, const uint32_t at[2],
    float depth, float position[3], float view[3])
{
    const struct hg_gpu_camera *c = t->camera;
    const float origin[3] = {c->ray_origin_ws.x, c->ray_origin_ws.y, c->ray_origin_ws.z};
    const float x[3] = {c->ray_x_ws.x, c->ray_x_ws.y, c->ray_x_ws.z};
    const float y[3] = {c->ray_y_ws.x, c->ray_y_ws.y, c->ray_y_ws.z};
    const float eye[3] = {c->eye_ws.x, c->eye_ws.y, c->eye_ws.z};
    const float ahead[3] = {c->forward_ws.x, c->forward_ws.y, c->forward_ws.z};
    const float middle[2] = {
        (float)(at[0] * HG_PROBE_LIGHT_PX + 2), (float)(at[1] * HG_PROBE_LIGHT_PX + 2)};
    const float px = hg_clampf(middle[0], 0, (float)(t->width - 1)) + 0.5f;
    const float py = hg_clampf(middle[1], 0, (float)(t->height - 1)) + 0.5f;
    for (int a = 0; a < 3; a++) {
        const float ray = origin[a] + px * x[a] + py * y[a];
        position[a] = c->orthographic ? ray + ahead[a] * depth : eye[a] + ray * depth;
        view[a] = c->orthographic ? -ahead[a] : -ray;
    }
    hg_normalize3(view);
}

// The interpolated normal, from the third word of a texel.
static inline void hg_host_texel_normal(uint32_t word, float out[3])
{
    const float scale = 2.0f / HG_PROBE_LIGHT_NORMAL_MOST;
    const uint32_t y = word >> HG_PROBE_LIGHT_NORMAL_BITS;
    hg_octahedral3((float)(word & HG_PROBE_LIGHT_NORMAL_MOST) * scale - 1,
        (float)(y & HG_PROBE_LIGHT_NORMAL_MOST) * scale - 1, out);
}

// What the two words say of its surface (shaders/shared/reflect.h).
struct hg_host_texel_mirror {
    float normal[3], facet[3]; // that of shading; of the triangle
    float roughness, f0;
};
static inline void hg_host_texel_mirror(const uint32_t words[2], struct hg_host_texel_mirror *out)
{
    out->roughness = (float)(words[1] & HG_MIRROR_MOST) * (1.0f / HG_MIRROR_MOST);
    out->f0 = (float)(words[1] >> HG_MIRROR_F0_SHIFT & HG_MIRROR_MOST) * (1.0f / HG_MIRROR_MOST);
    hg_octahedral3((float)(int16_t)(words[0] & 0xffff) / 32767,
        (float)(int16_t)(words[0] >> 16) / 32767, out->normal);
    hg_octahedral3((float)(int8_t)(words[1] >> HG_MIRROR_FACET_SHIFT & 0xff) / 127,
        (float)(int8_t)(words[1] >> (HG_MIRROR_FACET_SHIFT + 8)) / 127, out->facet);
}

// Normals at which the mirrored view leads behind the triangle are bent, as those of paths and of
// settled pictures are (hg_valid_normal of shaders/lib/shading_normal.glsl).
static inline void hg_host_texel_bend(const float facet[3], const float view[3], float normal[3])
{
    float along[3], half_way[3];
    const float twice = 2 * hg_dot3(normal, view);
    for (int a = 0; a < 3; a++)
        along[a] = twice * normal[a] - view[a];
    const float height = hg_dot3(along, facet);
    const float least = fminf(0.9f * hg_dot3(view, facet), 0.01f);
    if (height >= least)
        return;
    hg_mad3(along, facet, -height, along);
    const float scale = sqrtf((1 - least * least) / fmaxf(hg_dot3(along, along), 1e-12f));
    hg_mad3(view, along, scale, half_way);
    hg_mad3(half_way, facet, least, normal);
    hg_normalize3(normal);
}

// The normal that a texel mirrors about: less than 90 degrees off the view.
static inline void hg_host_texel_mirror_normal(
    const struct hg_host_texel_mirror *m, const float view[3], float out[3])
{
    hg_copy3(m->normal, out);
    const float facing = hg_dot3(out, view);
    if (facing < 0.02f) { // normal maps turn some surfaces away from the eye
        hg_mad3(out, view, 0.02f - facing, out);
        hg_normalize3(out);
    }
    hg_host_texel_bend(m->facet, view, out);
}

#endif
