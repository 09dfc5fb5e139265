// discs.c - see discs.h.
#include "renderer/lod/discs.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"

#define BLOCK 128u // points measured at a time

uint32_t hg_disc_sides(uint32_t points)
{
    return points <= 4096 ? 16 : points <= 4u << 20 ? 8 : points <= 32u << 20 ? 6 : 4;
}

bool hg_disc_sides_ok(uint32_t sides)
{
    return sides == 4 || sides == 6 || sides == 8 || sides == 16;
}

// Cosine and sine of the corners of 16, from which the others are taken.
static const float circle[HG_DISC_SIDES_MAX][2] = {{1.0f, 0.0f}, {0.9238795f, 0.3826834f},
    {0.7071068f, 0.7071068f}, {0.3826834f, 0.9238795f}, {0.0f, 1.0f}, {-0.3826834f, 0.9238795f},
    {-0.7071068f, 0.7071068f}, {-0.9238795f, 0.3826834f}, {-1.0f, 0.0f}, {-0.9238795f, -0.3826834f},
    {-0.7071068f, -0.7071068f}, {-0.3826834f, -0.9238795f}, {0.0f, -1.0f},
    {0.3826834f, -0.9238795f}, {0.7071068f, -0.7071068f}, {0.9238795f, -0.3826834f}};
static const float hexagon[6][2] = {{1.0f, 0.0f}, {0.5f, 0.8660254f}, {-0.5f, 0.8660254f},
    {-1.0f, 0.0f}, {-0.5f, -0.8660254f}, {0.5f, -0.8660254f}};

// Circumradius of the polygon whose area is that of the unit circle: sqrt(2 pi / (n sin(2 pi /
// n))).
static float circumradius(uint32_t sides)
{
    return sides == 4 ? 1.2533141f : sides == 6 ? 1.0996361f : sides == 8 ? 1.0539074f : 1.0130016f;
}

// Directions across a unit normal (Duff et al. 2017, "Building an orthonormal basis, revisited").
void hg_disc_basis(const float n[3], float u[3], float v[3])
{
    const float sign = n[2] < 0.0f ? -1.0f : 1.0f, a = -1.0f / (sign + n[2]), b = n[0] * n[1] * a;
    u[0] = 1.0f + sign * n[0] * n[0] * a;
    u[1] = sign * b;
    u[2] = -sign * n[0];
    v[0] = b;
    v[1] = sign + n[1] * n[1] * a;
    v[2] = -n[1];
}

void hg_disc_corners(
    const float at[3], const float n[3], float radius, uint32_t sides, float *corners)
{
    float u[3], v[3];
    hg_disc_basis(n, u, v);
    const float reach = radius * circumradius(sides);
    for (uint32_t i = 0; i < sides; i++) {
        const float *turn = sides == 6 ? hexagon[i] : circle[i * (HG_DISC_SIDES_MAX / sides)];
        for (int k = 0; k < 3; k++)
            *corners++ = at[k] + reach * (turn[0] * u[k] + turn[1] * v[k]);
    }
}

// Strips across the polygon: all triangles are about equally wide.
void hg_disc_indices(uint32_t first, uint32_t sides, uint32_t *indices)
{
    uint32_t low = 0, high = sides - 1;
    for (uint32_t i = 0; i < sides - 2; i++) {
        *indices++ = first + low;
        if (i % 2 == 0) {
            *indices++ = first + low + 1;
            *indices++ = first + high;
            low++;
        } else {
            *indices++ = first + high - 1;
            *indices++ = first + high;
            high--;
        }
    }
}

bool hg_discs_can_build(const struct hg_mesh_part *part, uint32_t target_count)
{
    return part->topology == HG_TOPOLOGY_POINTS && part->joints == NULL &&
           (part->targets == NULL || target_count == 0);
}

bool hg_discs_are_lit(const struct hg_mesh_part *part)
{
    return part->normals != NULL || part->colors == NULL;
}

uint64_t hg_discs_bytes(const struct hg_mesh_part *part)
{
    const uint64_t sides = hg_disc_sides(part->index_count);
    return part->index_count *
           (sides * (12 + 16 + (part->colors != NULL ? 8 : 0)) + (sides - 2) * 12);
}

// Each disc has its own corners, and n - 2 triangles.
uint32_t hg_discs_point(const struct hg_mesh_part *discs, uint32_t triangle)
{
    const uint32_t points = (discs->vertex_count - discs->index_count / 3) / 2;
    return points > 0 ? triangle / (discs->index_count / 3 / points) : 0;
}

void hg_discs_free(struct hg_mesh_part *discs)
{
    if (discs == NULL)
        return;
    hg_mesh_part_finish(discs, 0);
    hg_free(discs);
}

static enum hg_status start_part(
    const struct hg_mesh_part *points, uint32_t count, uint32_t sides, struct hg_mesh_part **out)
{
    const uint64_t n = (uint64_t)count * sides;
    if (n * 3 > UINT32_MAX)
        return HG_E_LIMIT;
    struct hg_mesh_part *p = *out = hg_calloc(1, sizeof *p);
    if (p == NULL)
        return HG_E_NOMEM;
    p->topology = HG_TOPOLOGY_TRIANGLES;
    p->vertex_count = (uint32_t)n;
    p->index_count = count * hg_disc_triangles(sides) * 3;
    p->indices = hg_spill_calloc(p->index_count, 4);
    p->positions = hg_spill_calloc(n, 12);
    p->normals = hg_spill_calloc(n, 12);
    if (points->colors != NULL)
        p->colors = hg_spill_calloc(n, 16);
    return p->indices != NULL && p->positions != NULL && p->normals != NULL &&
                   (points->colors == NULL || p->colors != NULL)
               ? HG_OK
               : HG_E_NOMEM;
}

static void write_disc(
    struct hg_mesh_part *p, uint32_t number, const struct hg_surfel *s, uint32_t sides)
{
    const size_t first = (size_t)number * sides;
    hg_disc_corners(s->at, s->normal, s->radius, sides, p->positions + first * 3);
    hg_disc_indices(
        (uint32_t)first, sides, p->indices + (size_t)number * hg_disc_triangles(sides) * 3);
    for (size_t i = first; i < first + sides; i++) {
        memcpy(p->normals + i * 3, s->normal, sizeof s->normal);
        if (p->colors != NULL)
            memcpy(p->colors + i * 4, s->color, sizeof s->color);
    }
}

// In the order of the part, so that a primitive says which point it belongs to.
static enum hg_status fill(const struct hg_mesh_part *points, const struct hg_point_tree *tree,
    uint32_t sides, struct hg_mesh_part *out)
{
    struct hg_surfel block[BLOCK];
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; status == HG_OK && i < tree->count; i += BLOCK) {
        const uint32_t count = tree->count - i < BLOCK ? tree->count - i : BLOCK;
        status = hg_surfels_measure(tree, points, i, count, block);
        for (uint32_t k = 0; status == HG_OK && k < count; k++)
            write_disc(out, tree->items[i + k].number, &block[k], sides);
    }
    return status;
}

enum hg_status hg_discs_build(
    const struct hg_mesh_part *points, uint32_t most, struct hg_mesh_part **out)
{
    struct hg_point_tree tree = {0};
    const uint32_t stride = points->index_count > most ? (points->index_count - 1) / most + 1 : 1;
    const uint32_t sides = stride > 1 ? 4 : hg_disc_sides(points->index_count);
    *out = NULL;
    enum hg_status status = hg_point_tree_build(points, stride, false, NULL, &tree);
    if (status == HG_OK)
        status = start_part(points, tree.count, sides, out);
    if (status == HG_OK)
        status = fill(points, &tree, sides, *out);
    hg_point_tree_finish(&tree);
    if (status == HG_OK) {
        hg_mesh_part_update_bounds(*out, 0);
        return HG_OK;
    }
    hg_discs_free(*out);
    *out = NULL;
    return status;
}
