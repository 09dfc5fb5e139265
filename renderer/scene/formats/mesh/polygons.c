#include "renderer/scene/formats/mesh/polygons.h"

#include <math.h>
#include <string.h>

static const uint64_t most_work = UINT64_C(4000000000); // a few seconds

void hg_polygons_begin(struct hg_polygons *p)
{
    *p = (struct hg_polygons){.corners.item_bytes = 2 * sizeof(double),
        .links.item_bytes = 2 * sizeof(uint32_t),
        .triangles.item_bytes = 3 * sizeof(uint32_t),
        .work_left = most_work};
}

void hg_polygons_finish(struct hg_mesh_file *f, struct hg_polygons *p)
{
    hg_mesh_array_finish(f, &p->corners);
    hg_mesh_array_finish(f, &p->links);
    hg_mesh_array_finish(f, &p->triangles);
}

static void make_fan(uint32_t (*triangles)[3], uint32_t count)
{
    for (uint32_t i = 0; i + 2 < count; i++) {
        triangles[i][0] = 0;
        triangles[i][1] = i + 1;
        triangles[i][2] = i + 2;
    }
}

// Newell's normal: twice the area along each axis. About the first corner, so that far polygons
// keep their digits.
static void plane_of(const double *xyz, uint32_t count, double normal[3])
{
    normal[0] = normal[1] = normal[2] = 0;
    for (uint32_t i = 0; i < count; i++) {
        double a[3], b[3];
        for (int c = 0; c < 3; c++) {
            a[c] = xyz[(size_t)i * 3 + c] - xyz[c];
            b[c] = xyz[(size_t)((i + 1) % count) * 3 + c] - xyz[c];
        }
        normal[0] += (a[1] - b[1]) * (a[2] + b[2]);
        normal[1] += (a[2] - b[2]) * (a[0] + b[0]);
        normal[2] += (a[0] - b[0]) * (a[1] + b[1]);
    }
}

// Along the axis of the largest component, mirrored where needed so that the polygon turns left.
static void project(const double *xyz, uint32_t count, double (*out)[2])
{
    double n[3];
    plane_of(xyz, count, n);
    int axis = fabs(n[0]) > fabs(n[1]) ? 0 : 1;
    axis = fabs(n[2]) > fabs(n[axis]) ? 2 : axis;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (n[axis] < 0) {
        const int swap = u;
        u = v;
        v = swap;
    }
    for (uint32_t i = 0; i < count; i++) {
        out[i][0] = xyz[(size_t)i * 3 + u] - xyz[u];
        out[i][1] = xyz[(size_t)i * 3 + v] - xyz[v];
    }
}

// Twice the signed area; positive: c is left of a -> b.
static double turn(const double a[2], const double b[2], const double c[2])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static bool same(const double a[2], const double b[2])
{
    return a[0] == b[0] && a[1] == b[1];
}

static bool is_convex(double (*corners)[2], uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (turn(corners[i], corners[(i + 1) % count], corners[(i + 2) % count]) < 0)
            return false;
    // A star turns left at every corner too: all corners lie left of a fan's rays only if convex.
    for (uint32_t i = 2; i < count; i++)
        if (turn(corners[0], corners[i - 1], corners[i]) < 0)
            return false;
    return true;
}

static bool is_inside(const double t[3][2], const double p[2])
{
    return turn(t[0], t[1], p) >= 0 && turn(t[1], t[2], p) >= 0 && turn(t[2], t[0], p) >= 0;
}

struct ears {
    double (*at)[2];
    uint32_t (*link)[2]; // before, after
    uint64_t *work_left;
};

// Whether the triangle at i can be cut off: it turns left, and no corner that turns right or
// straight lies in it.
static bool is_ear(const struct ears *e, uint32_t i)
{
    const uint32_t before = e->link[i][0], after = e->link[i][1];
    const double t[3][2] = {{e->at[before][0], e->at[before][1]}, {e->at[i][0], e->at[i][1]},
        {e->at[after][0], e->at[after][1]}};
    uint64_t work = 1;
    bool ear = turn(t[0], t[1], t[2]) > 0;
    for (uint32_t k = e->link[after][1]; ear && k != before; k = e->link[k][1], work++)
        ear = turn(e->at[e->link[k][0]], e->at[k], e->at[e->link[k][1]]) > 0 ||
              !is_inside(t, e->at[k]) || same(e->at[k], t[0]) || same(e->at[k], t[1]) ||
              same(e->at[k], t[2]);
    *e->work_left -= work < *e->work_left ? work : *e->work_left;
    return ear;
}

// Cuts ears until none is left; where a polygon crosses itself the next corner is cut all the same.
static void clip_ears(const struct ears *e, uint32_t count, uint32_t (*triangles)[3])
{
    for (uint32_t i = 0; i < count; i++) {
        e->link[i][0] = i ? i - 1 : count - 1;
        e->link[i][1] = i + 1 < count ? i + 1 : 0;
    }
    uint32_t left = count, made = 0, tried = 0;
    for (uint32_t i = 0; left > 2;) {
        const uint32_t before = e->link[i][0], after = e->link[i][1];
        if (left > 3 && tried<left && * e->work_left> 0 && !is_ear(e, i)) {
            i = after;
            tried++;
            continue;
        }
        memcpy(triangles[made++], (const uint32_t[3]){before, i, after}, sizeof *triangles);
        e->link[before][1] = after;
        e->link[after][0] = before;
        left--;
        tried = 0;
        i = e->link[after][1]; // skipping one keeps fans short
    }
}

enum hg_status hg_polygons_cut(
    struct hg_mesh_file *f, struct hg_polygons *p, const double *xyz, uint32_t count)
{
    p->corners.count = p->links.count = p->triangles.count = 0;
    if (count < 3)
        return HG_OK;
    uint32_t(*triangles)[3] = hg_mesh_array_add(f, &p->triangles, count - 2);
    double(*corners)[2] = triangles ? hg_mesh_array_add(f, &p->corners, count) : NULL;
    if (!corners)
        return f->err->status;
    if (count > 3)
        project(xyz, count, corners);
    if (count == 3 || is_convex(corners, count)) {
        make_fan(triangles, count);
        return HG_OK;
    }
    if (p->work_left == 0) {
        p->gave_up = true;
        make_fan(triangles, count);
        return HG_OK;
    }
    uint32_t(*links)[2] = hg_mesh_array_add(f, &p->links, count);
    if (!links)
        return f->err->status;
    clip_ears(&(struct ears){corners, links, &p->work_left}, count, triangles);
    p->gave_up = p->gave_up || p->work_left == 0;
    return HG_OK;
}
