// glass_region.c - see glass_region.h.
#include "renderer/frame/light/glass_region.h"

#include <math.h>

#include "renderer/math/box.h"

#define MARGIN 1.0f // px around what boxes are seen in

struct rectangle {
    float left, top, right, bottom; // px; empty: left > right
};

// Where a corner is seen; false: nowhere, as it is not in front of the camera.
static bool project(
    const struct hg_gpu_camera *c, const float size[2], const float p[3], float out[2])
{
    const float *m = c->view_proj.m;
    const float w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
    for (int a = 0; a < 2; a++) {
        const float clip = m[a] * p[0] + m[4 + a] * p[1] + m[8 + a] * p[2] + m[12 + a];
        out[a] = (clip / w * 0.5f + 0.5f) * size[a];
    }
    return w > 0;
}

static void add_box(struct rectangle *r, const struct hg_gpu_camera *camera, const float size[2],
    const struct hg_box *box)
{
    struct rectangle own = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    int seen = 0;
    for (int i = 0; i < 8; i++) {
        const float corner[3] = {i & 1 ? box->max[0] : box->min[0],
            i & 2 ? box->max[1] : box->min[1], i & 4 ? box->max[2] : box->min[2]};
        float at[2];
        seen += project(camera, size, corner, at);
        own = (struct rectangle){fminf(own.left, at[0]), fminf(own.top, at[1]),
            fmaxf(own.right, at[0]), fmaxf(own.bottom, at[1])};
    }
    if (seen == 0)
        return;
    if (seen < 8) // it reaches behind the camera
        own = (struct rectangle){0, 0, size[0], size[1]};
    *r = (struct rectangle){fminf(r->left, own.left), fminf(r->top, own.top),
        fmaxf(r->right, own.right), fmaxf(r->bottom, own.bottom)};
}

// Whole pixels of [low, high], within [0, size).
static void clip(float low, float high, uint32_t size, uint32_t *first, uint32_t *count)
{
    const float begin = fmaxf(floorf(low - MARGIN), 0);
    const float end = fminf(ceilf(high + MARGIN), (float)size);
    *first = begin < end ? (uint32_t)begin : 0;
    *count = begin < end ? (uint32_t)end - *first : 0;
}

struct hg_picture_region hg_glass_region(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_geometry *geometry = view->scene_gpu->geometry;
    const struct hg_camera_setup setup =
        hg_scene_gpu_camera(view->scene_gpu, &view->camera, s->width, s->height);
    const float size[2] = {(float)s->width, (float)s->height};
    struct rectangle r = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    struct hg_gpu_camera camera;
    struct hg_gpu_geometry tables;
    struct hg_picture_region out = {0};
    hg_camera_fill(&setup, &camera);
    hg_geometry_fill(geometry, &tables);
    for (uint32_t i = 0; i < tables.draw_count; i++) {
        struct hg_box box;
        if (hg_geometry_transmits(geometry, i, &box))
            add_box(&r, &camera, size, &box);
    }
    clip(r.left, r.right, s->width, &out.x, &out.width);
    clip(r.top, r.bottom, s->height, &out.y, &out.height);
    return out.width > 0 && out.height > 0 ? out : (struct hg_picture_region){0};
}
