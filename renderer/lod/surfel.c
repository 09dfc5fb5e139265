// surfel.c - the surface around the points of a cloud: neighbours, normals, radii.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/discs.h"

#define NEIGHBOURS 16
#define FEW        256u // points of a cloud; below, it has no surface to speak of: separate dots
#define OPEN_CELL  3.0f // of the distance to the fifth neighbour: cells that reach farther are open
#define SLACK      1.06f // discs are polygons of the same area, and positions are rounded
#define OUTLIER    4.0f  // radii of the points around a point that its own may reach
#define CELL       12    // corners of a cell without neighbours
#define LOOKS_MAX  4096u // points that are looked at for one: many may lie at one place
#define LONELY     0.01f // of the size of the part, or metres: where there is no neighbour

struct neighbours {
    float at[3];
    float distance2[NEIGHBOURS];
    uint32_t item[NEIGHBOURS];
    uint32_t count, looks;
};

// ---- neighbours ---------------------------------------------------------------------------------

static inline void note(struct neighbours *n, float distance2, uint32_t item)
{
    uint32_t i = n->count < NEIGHBOURS ? n->count++ : NEIGHBOURS - 1;
    for (; i > 0 && n->distance2[i - 1] > distance2; i--) {
        n->distance2[i] = n->distance2[i - 1];
        n->item[i] = n->item[i - 1];
    }
    n->distance2[i] = distance2;
    n->item[i] = item;
}

// Distances of a leaf first, in a loop without branches, then what they say.
static void scan(const struct hg_point_tree *t, uint32_t first, uint32_t end, struct neighbours *n)
{
    float distance2[HG_POINT_TREE_LEAF];
    const struct hg_point_item *items = t->items + first;
    const uint32_t count = end - first;
    n->looks += count;
    for (uint32_t i = 0; i < count; i++) {
        const float x = items[i].at[0] - n->at[0], y = items[i].at[1] - n->at[1],
                    z = items[i].at[2] - n->at[2];
        distance2[i] = x * x + y * y + z * z;
    }
    float worst = n->count < NEIGHBOURS ? FLT_MAX : n->distance2[NEIGHBOURS - 1];
    for (uint32_t i = 0; i < count; i++) {
        // Points at the same place, itself among them, say nothing about the spacing.
        if ((distance2[i] < worst) & (distance2[i] > 0.0f)) {
            note(n, distance2[i], first + i);
            worst = n->count < NEIGHBOURS ? FLT_MAX : n->distance2[NEIGHBOURS - 1];
        }
    }
}

static void search(
    const struct hg_point_tree *t, uint32_t level, uint32_t node, struct neighbours *n)
{
    if (level == t->depth) {
        scan(t, hg_point_tree_first(t, level, node), hg_point_tree_first(t, level, node + 1), n);
        return;
    }
    const uint32_t at = (1u << level) + node;
    const float d = n->at[t->axes[at]] - t->splits[at];
    const uint32_t near = node * 2 + (d >= 0.0f);
    search(t, level + 1, near, n);
    if (n->looks < LOOKS_MAX && (n->count < NEIGHBOURS || d * d <= n->distance2[NEIGHBOURS - 1]))
        search(t, level + 1, near ^ 1u, n);
}

// ---- normals ------------------------------------------------------------------------------------

static void normalise(float v[3])
{
    const float length = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int k = 0; k < 3; k++)
        v[k] = length > 0.0f ? v[k] / length : k == 2;
}

// One rotation of Jacobi's method that makes m[p][q] zero.
static void rotate(float m[3][3], float axes[3][3], int p, int q)
{
    if (fabsf(m[p][q]) < FLT_MIN)
        return;
    const float theta = (m[q][q] - m[p][p]) / (2.0f * m[p][q]);
    const float t = (theta >= 0.0f ? 1.0f : -1.0f) / (fabsf(theta) + sqrtf(theta * theta + 1.0f));
    const float c = 1.0f / sqrtf(t * t + 1.0f), s = t * c;
    for (int k = 0; k < 3; k++) {
        const float a = m[k][p], b = m[k][q];
        m[k][p] = c * a - s * b;
        m[k][q] = s * a + c * b;
    }
    for (int k = 0; k < 3; k++) {
        const float a = m[p][k], b = m[q][k], x = axes[k][p], y = axes[k][q];
        m[p][k] = c * a - s * b;
        m[q][k] = s * a + c * b;
        axes[k][p] = c * x - s * y;
        axes[k][q] = s * x + c * y;
    }
}

// The direction in which the neighbours are spread least.
static void estimate_normal(
    const struct hg_point_tree *t, const struct neighbours *n, float normal[3])
{
    float m[3][3] = {{0}}, axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, mean[3] = {0};
    const float scale = n->count > 0 ? 1.0f / sqrtf(n->distance2[n->count - 1]) : 0.0f;
    float d[NEIGHBOURS][3];
    for (uint32_t i = 0; i < n->count; i++)
        for (int k = 0; k < 3; k++) {
            d[i][k] = (t->items[n->item[i]].at[k] - n->at[k]) * scale;
            mean[k] += d[i][k] / (float)(n->count + 1);
        }
    for (uint32_t i = 0; i <= n->count; i++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                m[a][b] += ((i < n->count ? d[i][a] : 0.0f) - mean[a]) *
                           ((i < n->count ? d[i][b] : 0.0f) - mean[b]);
    for (int sweep = 0; sweep < 6; sweep++) {
        rotate(m, axes, 0, 1);
        rotate(m, axes, 0, 2);
        rotate(m, axes, 1, 2);
    }
    int least = 0, main = 0;
    for (int k = 1; k < 3; k++)
        least = m[k][k] < m[least][least] ? k : least;
    for (int k = 0; k < 3; k++)
        normal[k] = axes[k][least];
    normalise(normal);
    for (int k = 1; k < 3; k++)
        main = fabsf(normal[k]) > fabsf(normal[main]) ? k : main;
    for (int k = 0, flip = normal[main] < 0.0f; k < 3; k++)
        normal[k] = flip ? -normal[k] : normal[k];
}

// ---- radii --------------------------------------------------------------------------------------

struct cell {
    float corners[CELL + NEIGHBOURS][2];
    int count;
};

// Cuts off what lies nearer to a neighbour at x, y than to the origin. False: nothing does, or
// nothing would be left, and `out` is not made.
static bool cut_cell(const struct cell *c, float x, float y, struct cell *out)
{
    const float half = 0.5f * (x * x + y * y);
    float inside[CELL + NEIGHBOURS], least = INFINITY;
    for (int i = 0; i < c->count; i++) {
        inside[i] = half - (c->corners[i][0] * x + c->corners[i][1] * y);
        least = inside[i] < least ? inside[i] : least;
    }
    if (least >= 0.0f)
        return false;
    int n = 0;
    for (int i = 0; i < c->count; i++) {
        const int next = i + 1 < c->count ? i + 1 : 0;
        const float *a = c->corners[i], *b = c->corners[next];
        const float da = inside[i], db = inside[next];
        if (da >= 0.0f && n < CELL + NEIGHBOURS)
            memcpy(out->corners[n++], a, sizeof out->corners[0]);
        if ((da >= 0.0f) != (db >= 0.0f) && n < CELL + NEIGHBOURS) {
            const float s = da / (da - db);
            out->corners[n][0] = a[0] + (b[0] - a[0]) * s;
            out->corners[n++][1] = a[1] + (b[1] - a[1]) * s;
        }
    }
    out->count = n;
    return n >= 3;
}

// The farthest corner that is nearer than `below`.
static float reach_of(const struct cell *c, float below)
{
    float most = 0.0f;
    for (int i = 0; i < c->count; i++) {
        const float *p = c->corners[i], distance2 = p[0] * p[0] + p[1] * p[1];
        most = distance2 < below * below ? fmaxf(most, distance2) : most;
    }
    return sqrtf(most);
}

// How far the Voronoi cell of a point reaches in the plane of its normal. At the edge of a surface
// cells are open; their finite corners count.
static float cell_radius(
    const struct hg_point_tree *t, const struct neighbours *n, const float normal[3])
{
    static const float turn[CELL][2] = {{1, 0}, {0.8660254f, 0.5f}, {0.5f, 0.8660254f}, {0, 1},
        {-0.5f, 0.8660254f}, {-0.8660254f, 0.5f}, {-1, 0}, {-0.8660254f, -0.5f},
        {-0.5f, -0.8660254f}, {0, -1}, {0.5f, -0.8660254f}, {0.8660254f, -0.5f}};
    float u[3], v[3];
    struct cell cells[2], *cell = &cells[0], *spare = &cells[1];
    const float open = OPEN_CELL * sqrtf(n->distance2[n->count > 4 ? 4 : n->count - 1]);
    hg_disc_basis(normal, u, v);
    cell->count = CELL;
    for (int i = 0; i < CELL; i++)
        for (int k = 0; k < 2; k++)
            cell->corners[i][k] = turn[i][k] * open;
    float reach = reach_of(cell, INFINITY);
    for (uint32_t i = 0; i < n->count && n->distance2[i] < 4.0f * reach * reach; i++) {
        const float *p = t->items[n->item[i]].at;
        const float d[3] = {p[0] - n->at[0], p[1] - n->at[1], p[2] - n->at[2]};
        const float x = d[0] * u[0] + d[1] * u[1] + d[2] * u[2];
        const float y = d[0] * v[0] + d[1] * v[1] + d[2] * v[2];
        if (2.0f * (x * x + y * y) < n->distance2[i])
            continue; // above or below the surface
        if (!cut_cell(cell, x, y, spare))
            continue;
        struct cell *cut = spare;
        spare = cell;
        cell = cut;
        reach = reach_of(cell, INFINITY);
    }
    // No point of the first polygon's sides is nearer than cos(pi / CELL).
    reach = reach_of(cell, open * 0.96f);
    return reach > 0.0f ? reach : 0.5f * sqrtf(n->distance2[0]);
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

// Points that lie apart are not made larger than what is around them by much; sizes that are asked
// for apply.
static enum hg_status finish_radii(
    const struct hg_mesh_part *part, struct hg_surfel *surfels, uint32_t count)
{
    float *sorted = hg_calloc(count, sizeof *sorted);
    if (sorted == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < count; i++)
        sorted[i] = surfels[i].radius;
    qsort(sorted, count, sizeof *sorted, compare_floats);
    const float most = count > 0 ? sorted[count / 2] * OUTLIER : 0.0f;
    const float scale = part->point_scale > 0.0f ? part->point_scale : 1.0f;
    for (uint32_t i = 0; i < count; i++)
        surfels[i].radius = part->point_diameter > 0.0f ? part->point_diameter * 0.5f
                                                        : fminf(surfels[i].radius, most) * scale;
    hg_free(sorted);
    return HG_OK;
}

static float lonely_radius(const struct hg_mesh_part *part)
{
    float size = 0.0f;
    for (int k = 0; k < 3; k++)
        size = fmaxf(size, part->bounds_max[k] - part->bounds_min[k]);
    return LONELY * (size > 0.0f ? size : 1.0f);
}

static void measure(const struct hg_point_tree *t, const struct hg_mesh_part *part,
    const struct hg_point_item *item, struct hg_surfel *out)
{
    const size_t vertex =
        t->gathered ? item->number : part->indices[(size_t)item->number * t->stride];
    const float *normals = t->gathered ? t->normals : part->normals;
    const float *colors = t->gathered ? t->colors : part->colors;
    const float *own = normals != NULL ? normals + vertex * 3 : NULL;
    struct neighbours n = {.count = 0};
    memcpy(n.at, item->at, sizeof n.at);
    memcpy(out->at, item->at, sizeof out->at);
    search(t, 0, 0, &n);
    if (own != NULL && own[0] * own[0] + own[1] * own[1] + own[2] * own[2] > 0.25f) {
        memcpy(out->normal, own, sizeof out->normal);
        normalise(out->normal);
    } else {
        estimate_normal(t, &n, out->normal);
    }
    if (n.count == 0)
        out->radius = lonely_radius(part);
    else if (n.count < NEIGHBOURS || t->count < FEW)
        out->radius = 0.35f * sqrtf(n.distance2[0]);
    else
        out->radius = SLACK * cell_radius(t, &n, out->normal);
    for (size_t k = 0; k < 4; k++)
        out->color[k] = colors != NULL ? colors[vertex * 4 + k] : 1.0f;
}

enum hg_status hg_surfels_measure(const struct hg_point_tree *tree, const struct hg_mesh_part *part,
    uint32_t first, uint32_t count, struct hg_surfel *out)
{
    for (uint32_t i = 0; i < count; i++)
        measure(tree, part, &tree->items[first + i], &out[i]);
    return finish_radii(part, out, count);
}
