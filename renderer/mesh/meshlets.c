// meshlets.c - see meshlets.h.
#include "renderer/mesh/meshlets.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"

#define DIMENSIONS 6

// A normal that turns by 90 degrees counts as much as this part of the longest side of the centres.
#define NORMAL_SHARE 0.35f

struct split {
    const struct hg_mesh_part *part;
    float (*keys)[DIMENSIONS]; // centre, unit normal (0 without an area)
    uint32_t *order;
    struct hg_meshlet_list *out;
};

static const float *corner(const struct hg_mesh_part *part, uint32_t triangle, uint32_t k)
{
    return part->positions + (size_t)part->indices[(size_t)triangle * 3 + k] * 3;
}

static void key_of(const struct hg_mesh_part *part, uint32_t triangle, float key[DIMENSIONS])
{
    const float *a = corner(part, triangle, 0), *b = corner(part, triangle, 1);
    const float *c = corner(part, triangle, 2);
    double u[3], v[3];
    for (int i = 0; i < 3; i++) {
        key[i] = (float)(((double)a[i] + b[i] + c[i]) / 3.0);
        u[i] = (double)b[i] - a[i];
        v[i] = (double)c[i] - a[i];
    }
    const double n[3] = {
        u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; i++)
        key[3 + i] = length > 0.0 ? (float)(n[i] / length) : 0.0f;
}

// --- split ---------------------------------------------------------------------------------------

static int longest_side(const struct split *s, uint32_t first, uint32_t count)
{
    float low[DIMENSIONS], high[DIMENSIONS], best = -1.0f, reach = 0.0f;
    for (int d = 0; d < DIMENSIONS; d++) {
        low[d] = FLT_MAX;
        high[d] = -FLT_MAX;
    }
    for (uint32_t i = first; i < first + count; i++) {
        const float *k = s->keys[s->order[i]];
        for (int d = 0; d < DIMENSIONS; d++) {
            low[d] = k[d] < low[d] ? k[d] : low[d];
            high[d] = k[d] > high[d] ? k[d] : high[d];
        }
    }
    for (int d = 0; d < 3; d++)
        reach = high[d] - low[d] > reach ? high[d] - low[d] : reach;
    int axis = 0;
    for (int d = 0; d < DIMENSIONS; d++) {
        const float side = (high[d] - low[d]) * (d < 3 ? 1.0f : NORMAL_SHARE * reach);
        if (side > best) {
            best = side;
            axis = d;
        }
    }
    return axis;
}

// Total order: equal keys by triangle.
static bool is_before(const struct split *s, int axis, uint32_t a, uint32_t b)
{
    const float x = s->keys[a][axis], y = s->keys[b][axis];
    return x < y || (x == y && a < b);
}

// Puts the `rank` smallest in front. Source: Hoare 1961, "Algorithm 65: Find".
static void select_smallest(
    const struct split *s, int axis, uint32_t *v, uint32_t count, uint32_t rank)
{
    while (count > 1) {
        const uint32_t pivot = v[(count - 1) / 2];
        uint32_t i = 0, j = count - 1;
        for (;; i++, j--) {
            while (is_before(s, axis, v[i], pivot))
                i++;
            while (is_before(s, axis, pivot, v[j]))
                j--;
            if (i >= j)
                break;
            const uint32_t t = v[i];
            v[i] = v[j];
            v[j] = t;
        }
        const uint32_t left = j + 1; // < count, as the pivot is not the last
        if (rank == left)
            return;
        if (rank < left) {
            count = left;
        } else {
            v += left;
            count -= left;
            rank -= left;
        }
    }
}

// --- one meshlet ---------------------------------------------------------------------------------

static void box_of(const struct split *s, struct hg_meshlet *c)
{
    float low[3] = {FLT_MAX, FLT_MAX, FLT_MAX}, high[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
    for (uint32_t i = c->first; i < c->first + c->count; i++)
        for (uint32_t k = 0; k < 3; k++) {
            const float *p = corner(s->part, s->order[i], k);
            for (int d = 0; d < 3; d++) {
                low[d] = p[d] < low[d] ? p[d] : low[d];
                high[d] = p[d] > high[d] ? p[d] : high[d];
            }
        }
    for (int d = 0; d < 3; d++) {
        c->center[d] = 0.5f * low[d] + 0.5f * high[d];
        const float half = 0.5f * high[d] - 0.5f * low[d];
        c->extent[d] = half + 1e-6f * (fabsf(c->center[d]) + half);
    }
}

// Sources: Shirmun and Abi-Ezzi 1993, "The Cone of Normals Technique for Fast Processing of Curved
// Patches"; the test with the eye against a sphere of apexes.
static void cone_of(const struct split *s, struct hg_meshlet *c)
{
    double axis[3] = {0}, least = 1.0;
    for (uint32_t i = c->first; i < c->first + c->count; i++)
        for (int d = 0; d < 3; d++)
            axis[d] += (double)s->keys[s->order[i]][3 + d];
    const double length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    c->cone_cutoff = 1.0f;
    if (!(length > 0.0))
        return;
    for (uint32_t i = c->first; i < c->first + c->count; i++) {
        const float *n = s->keys[s->order[i]] + 3;
        const double at = ((double)n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2]) / length;
        least = at < least ? at : least; // 0 without an area: no cone
    }
    for (int d = 0; d < 3; d++)
        c->cone_axis[d] = (float)(axis[d] / length);
    if (least > 0.1)
        c->cone_cutoff = fminf(1.0f, (float)sqrt(1.0 - least * least) + HG_CONE_MARGIN);
}

static void add_meshlet(struct split *s, uint32_t first, uint32_t count)
{
    struct hg_meshlet *c = &s->out->items[s->out->count++];
    *c = (struct hg_meshlet){.first = first, .count = count};
    box_of(s, c);
    cone_of(s, c);
}

// Depth is that of a balanced tree: at most 25 for 2^32 triangles.
static void split(struct split *s, uint32_t first, uint32_t count) // NOLINT(misc-no-recursion)
{
    if (count <= HG_MESHLET_TRIANGLES) {
        add_meshlet(s, first, count);
        return;
    }
    const uint32_t meshlets = (count + HG_MESHLET_TRIANGLES - 1) / HG_MESHLET_TRIANGLES;
    const uint32_t left = meshlets / 2 * HG_MESHLET_TRIANGLES;
    select_smallest(s, longest_side(s, first, count), s->order + first, count, left);
    split(s, first, left);
    split(s, first + left, count - left);
}

enum hg_status hg_meshlets_build(const struct hg_mesh_part *part, struct hg_meshlet_list *out)
{
    memset(out, 0, sizeof *out);
    const uint32_t count = part->index_count / 3;
    if (part->topology != HG_TOPOLOGY_TRIANGLES || count == 0)
        return HG_OK;
    struct split s = {.part = part, .out = out};
    s.keys = hg_spill_scratch(count, sizeof *s.keys);
    s.order = hg_calloc(count, sizeof *s.order);
    out->items =
        hg_calloc((count + HG_MESHLET_TRIANGLES - 1) / HG_MESHLET_TRIANGLES, sizeof *out->items);
    if (s.keys == NULL || s.order == NULL || out->items == NULL) {
        hg_free(s.keys);
        hg_free(s.order);
        hg_meshlets_finish(out);
        return HG_E_NOMEM;
    }
    for (uint32_t i = 0; i < count; i++) {
        key_of(part, i, s.keys[i]);
        s.order[i] = i;
    }
    split(&s, 0, count);
    hg_free(s.keys);
    if (count <= HG_MESHLET_TRIANGLES)
        hg_free(s.order);
    else
        out->order = s.order;
    return HG_OK;
}

void hg_meshlets_finish(struct hg_meshlet_list *list)
{
    hg_free(list->items);
    hg_free(list->order);
    memset(list, 0, sizeof *list);
}
