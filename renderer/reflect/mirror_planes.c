// mirror_planes.c - see mirror_planes.h.
#include "renderer/reflect/mirror_planes.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/host_shading/texels.h"

#define TRIED         32      // points whose planes are tried
#define SMOOTH_COSINE 0.9999f // between the shading normal and that of the mesh: 0.8 degrees
#define APART         1e-3f   // of the depth, that points may lie off a plane
#define FITS          2       // rounds of least squares

struct hg_mirror_point {
    float position[3], normal[3];
    float apart;  // metres
    float weight; // reflectance to the eye; 0: its plane is taken already
    uint32_t texel;
};

void hg_mirror_points_finish(struct hg_mirror_points *points)
{
    hg_free(points->items);
    *points = (struct hg_mirror_points){0};
}

uint64_t hg_mirror_points_bytes(const struct hg_mirror_points *points)
{
    return points->capacity * sizeof *points->items;
}

// --- points --------------------------------------------------------------------------------------

static bool point_of(
    const struct hg_mirror_texels *t, uint32_t x, uint32_t y, struct hg_mirror_point *out)
{
    const uint32_t i = y * t->columns + x;
    const uint32_t *light = t->light + 4 * (size_t)i, *mirror = t->surfaces + 2 * (size_t)i;
    struct hg_host_texel_mirror of;
    float depth, smooth[3], view[3];
    memcpy(&depth, &light[3], sizeof depth);
    hg_host_texel_mirror(mirror, &of);
    if (!(depth > 0) || !(of.roughness < HG_MIRROR_ROUGH))
        return false;
    hg_copy3(of.normal, out->normal);
    hg_host_texel_normal(light[2], smooth);
    if (!(hg_dot3(out->normal, smooth) > SMOOTH_COSINE))
        return false;
    const struct hg_host_texels texels = {t->camera, t->width, t->height};
    hg_host_texel_place(&texels, (const uint32_t[2]){x, y}, depth, out->position, view);
    const float m = 1 - hg_clampf(hg_dot3(view, out->normal), 0, 1);
    out->weight = of.f0 + (1 - of.f0) * m * m * m * m * m;
    out->apart = APART * depth;
    out->texel = i;
    return true;
}

static enum hg_status collect(const struct hg_mirror_texels *t, struct hg_mirror_points *points)
{
    points->count = 0;
    for (uint32_t y = 0; y < t->rows; y++)
        for (uint32_t x = 0; x < t->columns; x++) {
            struct hg_mirror_point p;
            if (!point_of(t, x, y, &p))
                continue;
            const enum hg_status status =
                hg_grow(&points->items, &points->capacity, points->count + 1, sizeof p);
            if (status != HG_OK)
                return status;
            points->items[points->count++] = p;
        }
    return HG_OK;
}

// --- planes --------------------------------------------------------------------------------------

static bool is_on(const struct hg_mirror_plane *plane, const struct hg_mirror_point *p)
{
    return p->weight > 0 && hg_dot3(p->normal, plane->normal) > HG_MIRROR_LEAST_COSINE &&
           fabsf(hg_dot3(p->position, plane->normal) - plane->offset) < p->apart;
}

static float weigh(const struct hg_mirror_points *points, const struct hg_mirror_plane *plane)
{
    float sum = 0;
    for (uint32_t i = 0; i < points->count; i++)
        sum += is_on(plane, &points->items[i]) ? points->items[i].weight : 0;
    return sum;
}

static struct hg_mirror_plane plane_at(const struct hg_mirror_point *p)
{
    struct hg_mirror_plane plane = {.offset = hg_dot3(p->position, p->normal)};
    hg_copy3(p->normal, plane.normal);
    return plane;
}

static struct hg_mirror_plane choose(const struct hg_mirror_points *points)
{
    struct hg_mirror_plane best = {0};
    float most = 0;
    for (uint32_t k = 0; k < TRIED; k++) {
        const uint64_t i = (uint64_t)points->count * (2 * k + 1) / (2 * TRIED);
        if (!(points->items[i].weight > 0))
            continue;
        const struct hg_mirror_plane plane = plane_at(&points->items[i]);
        const float sum = weigh(points, &plane);
        if (sum > most) {
            most = sum;
            best = plane;
        }
    }
    return best;
}

// Heights of its points over the plane, as a linear function of where they are in it.
static void fit(const struct hg_mirror_points *points, struct hg_mirror_plane *plane)
{
    double mean[3] = {0}, uu = 0, uv = 0, vv = 0, uh = 0, vh = 0, count = 0;
    float t[3], b[3];
    hg_basis3(plane->normal, t, b);
    for (uint32_t i = 0; i < points->count; i++) {
        const struct hg_mirror_point *p = &points->items[i];
        if (!is_on(plane, p))
            continue;
        for (int a = 0; a < 3; a++)
            mean[a] += (double)p->position[a];
        count++;
    }
    for (int a = 0; a < 3; a++)
        mean[a] /= fmax(count, 1);
    for (uint32_t i = 0; i < points->count; i++) {
        const struct hg_mirror_point *p = &points->items[i];
        double u = 0, v = 0, h = 0;
        for (int a = 0; a < 3; a++) {
            const double d = (double)p->position[a] - mean[a];
            u += d * (double)t[a];
            v += d * (double)b[a];
            h += d * (double)plane->normal[a];
        }
        if (!is_on(plane, p))
            continue;
        uu += u * u;
        uv += u * v;
        vv += v * v;
        uh += u * h;
        vh += v * h;
    }
    const double det = uu * vv - uv * uv;
    if (!(count >= 3 && det > 1e-6 * uu * vv)) // all in one line
        return;
    const float slope[2] = {(float)((uh * vv - vh * uv) / det), (float)((vh * uu - uh * uv) / det)};
    hg_mad3(plane->normal, t, -slope[0], plane->normal);
    hg_mad3(plane->normal, b, -slope[1], plane->normal);
    hg_normalize3(plane->normal);
    plane->offset = 0;
    for (int a = 0; a < 3; a++)
        plane->offset += plane->normal[a] * (float)mean[a];
}

static void take(struct hg_mirror_points *points, const struct hg_mirror_plane *plane,
    uint8_t number, uint8_t *of)
{
    for (uint32_t i = 0; i < points->count; i++) {
        struct hg_mirror_point *p = &points->items[i];
        if (!is_on(plane, p))
            continue;
        of[p->texel] = number;
        p->weight = 0;
    }
}

enum hg_status hg_mirror_planes_find(const struct hg_mirror_texels *texels,
    struct hg_mirror_points *scratch, uint8_t *of, struct hg_mirror_plane out[HG_MIRROR_PLANES],
    uint32_t *count)
{
    const size_t all = (size_t)texels->columns * texels->rows;
    const enum hg_status status = collect(texels, scratch);
    *count = 0;
    memset(of, 0, all);
    if (status != HG_OK || scratch->count == 0)
        return status;
    for (uint32_t k = 0; k < HG_MIRROR_PLANES; k++) {
        struct hg_mirror_plane plane = choose(scratch);
        for (int i = 0; i < FITS; i++)
            fit(scratch, &plane);
        const float before =
            hg_dot3(plane.normal, hg_mirror_axes(&texels->camera->eye_ws)) - plane.offset;
        if (weigh(scratch, &plane) < HG_MIRROR_LEAST * (float)all || !(before > 0))
            break;
        out[k] = plane;
        take(scratch, &plane, (uint8_t)(k + 1), of);
        *count = k + 1;
    }
    return HG_OK;
}
