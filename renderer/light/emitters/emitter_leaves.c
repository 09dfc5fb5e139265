// Emissive triangles as leaves. See emitter_leaves.h.
#include "renderer/light/emitters/emitter_leaves.h"

#include <math.h>

#include "renderer/math/vec.h"

#define BLOCK 1024 // leaves per job

struct filling {
    const struct hg_emitter_leaves *out;
    const struct hg_emitter_sources *sources;
    const struct hg_emitter_plan *plan;
};

// --- triangles -----------------------------------------------------------------------------------

struct triangle {
    double normal[3]; // unit
    double area;      // 0: degenerate
    float min[3], max[3];
};

static void transform(const float m[12], const float p[3], double out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = (double)m[r] * (double)p[0] + (double)m[3 + r] * (double)p[1] +
                 (double)m[6 + r] * (double)p[2] + (double)m[9 + r];
}

static void grow_box(struct triangle *t, const double p[3], bool first)
{
    for (int a = 0; a < 3; a++) {
        // Rounded outwards: the device multiplies in floats.
        const double slack = fabs(p[a]) * 4e-7;
        const float low = (float)(p[a] - slack), high = (float)(p[a] + slack);
        t->min[a] = first ? low : fminf(t->min[a], low);
        t->max[a] = first ? high : fmaxf(t->max[a], high);
    }
}

static struct triangle triangle_at(const struct hg_ray_geometry_piece *piece, uint32_t index)
{
    struct triangle t = {.area = 0};
    double p[3][3], e1[3], e2[3], length = 0;
    const bool moves = memcmp(piece->world, piece->previous, sizeof piece->world) != 0;
    bool good = true;
    for (int c = 0; c < 3; c++) {
        const uint32_t vertex = piece->indices[(size_t)index * 3 + (size_t)c];
        if (vertex >= piece->vertex_count)
            return t;
        const float *at = piece->positions + (size_t)vertex * 3;
        transform(piece->world, at, p[c]);
        grow_box(&t, p[c], c == 0);
        if (moves || piece->opening != NULL) {
            double before[3];
            const float *from = piece->opening != NULL ? piece->opening : piece->positions;
            transform(piece->previous, from + (size_t)vertex * 3, before);
            grow_box(&t, before, false);
        }
    }
    for (int a = 0; a < 3; a++) {
        e1[a] = p[1][a] - p[0][a];
        e2[a] = p[2][a] - p[0][a];
        good = good && isfinite(t.min[a]) && isfinite(t.max[a]);
    }
    for (int a = 0; a < 3; a++) {
        t.normal[a] = e1[(a + 1) % 3] * e2[(a + 2) % 3] - e1[(a + 2) % 3] * e2[(a + 1) % 3];
        length += t.normal[a] * t.normal[a];
    }
    length = sqrt(length);
    if (!good || !(length > 0) || !isfinite(length) || !((float)length > 0))
        return t;
    const double sign = piece->flags & HG_DRAW_MIRRORED ? -1 : 1;
    for (int a = 0; a < 3; a++)
        t.normal[a] *= sign / length;
    t.area = length / 2;
    return t;
}

// Mean of the texture over a triangle; 1 without one.
static float glow_of(const struct hg_emitter_source *s, uint32_t index)
{
    const struct hg_texture_ref *ref = &s->part->material->slots[HG_SLOT_EMISSIVE];
    float min[2] = {INFINITY, INFINITY}, max[2] = {-INFINITY, -INFINITY};
    if (!s->glow)
        return 1;
    for (uint32_t c = 0; c < 3 && s->part->uv; c++) {
        const uint32_t vertex = s->part->piece->indices[(size_t)index * 3 + c];
        const float *uv = s->part->uv + (size_t)vertex * s->part->uv_stride;
        for (int a = 0; a < 2; a++) {
            const float *row = ref->uv_transform + a * 3;
            const float at = row[0] * uv[0] + row[1] * uv[1] + row[2];
            min[a] = fminf(min[a], at);
            max[a] = fmaxf(max[a], at);
        }
    }
    return hg_emissive_mips_mean(s->glow, min, max); // of all of it when there are no coordinates
}

// --- leaves --------------------------------------------------------------------------------------

// Prefix sums in units of 1 / 65535; every emissive triangle gets at least one.
static void sum_weights(const double *shares, uint32_t count, double total, uint16_t *out)
{
    uint32_t sum = 0, last = 0;
    for (uint32_t i = 0; i < count; i++)
        last = shares[i] > 0 ? i : last;
    for (uint32_t i = 0; i < count; i++) {
        if (shares[i] > 0)
            sum += 1 + (uint32_t)(shares[i] / total * (65535 - (1 << HG_EMITTER_MOST_SHIFT)));
        out[i] = (uint16_t)(i >= last ? 65535 : sum);
    }
}

static void join(struct hg_light_item *item, const struct triangle *t, bool first)
{
    for (int a = 0; a < 3; a++) {
        item->min[a] = first ? t->min[a] : fminf(item->min[a], t->min[a]);
        item->max[a] = first ? t->max[a] : fmaxf(item->max[a], t->max[a]);
    }
}

// Axis and cone of several normals.
static void cone_of(struct hg_light_item *item, const struct triangle *triangles,
    const double *shares, uint32_t count)
{
    double axis[3] = {0, 0, 0}, length = 0, least = 1;
    for (uint32_t i = 0; i < count; i++)
        for (int a = 0; a < 3 && shares[i] > 0; a++)
            axis[a] += triangles[i].normal[a] * triangles[i].area;
    for (int a = 0; a < 3; a++)
        length += axis[a] * axis[a];
    length = sqrt(length);
    for (int a = 0; a < 3; a++)
        item->axis[a] = length > 0 ? (float)(axis[a] / length) : a == 1;
    for (uint32_t i = 0; i < count; i++) {
        double dot = 0;
        for (int a = 0; a < 3; a++)
            dot += triangles[i].normal[a] * (double)item->axis[a];
        if (shares[i] > 0)
            least = fmin(least, dot);
    }
    item->cos_o = length > 0 && least > -1 ? (float)least : -1;
}

// With motion blur of deformed parts, normals are unbounded.
static bool turns(const struct hg_ray_geometry_piece *piece)
{
    return piece->opening != NULL ||
           memcmp(piece->world, piece->previous, 9 * sizeof *piece->world) != 0;
}

static void fill_leaf(const struct filling *f, const struct hg_emitter_source *s, uint32_t leaf)
{
    const struct hg_ray_geometry_piece *piece = s->part->piece;
    const uint32_t shift = f->plan->shift, first = (leaf - s->first_leaf) << shift;
    const uint32_t rest = piece->triangle_count - first;
    const uint32_t count = rest < 1u << shift ? rest : 1u << shift;
    struct hg_light_item *item = &f->out->items[leaf];
    struct triangle triangles[1 << HG_EMITTER_MOST_SHIFT];
    double shares[1 << HG_EMITTER_MOST_SHIFT], total = 0;
    *item =
        (struct hg_light_item){.cos_e = 0, .two_sided = (piece->flags & HG_DRAW_DOUBLE_SIDED) != 0};
    for (uint32_t i = 0; i < count; i++) {
        const float glow = glow_of(s, first + i);
        triangles[i] = triangle_at(piece, first + i);
        shares[i] = triangles[i].area * (double)s->luminance * (double)glow;
        shares[i] = shares[i] > 1e-30 && shares[i] < 1e30 ? shares[i] : 0;
        if (shares[i] > 0)
            join(item, &triangles[i], !(total > 0));
        total += shares[i];
    }
    f->out->leaves[leaf] = (struct hg_gpu_emitter_leaf){
        piece->draw, piece->first_primitive + first, s->first_weight + first, count};
    if (!(total > 0))
        return;
    item->power = (float)fmin(total, 1e30);
    cone_of(item, triangles, shares, count);
    item->cos_o = turns(piece) ? -1 : item->cos_o;
    if (shift > 0)
        sum_weights(shares, count, total, f->out->weights + s->first_weight + first);
}

static void fill_block(void *user, size_t block)
{
    const struct filling *f = user;
    const uint32_t first = (uint32_t)block * BLOCK;
    const uint32_t end = f->plan->leaf_count - first < BLOCK ? f->plan->leaf_count : first + BLOCK;
    uint32_t low = 0, high = f->sources->count - 1;
    while (low < high) { // the last that starts at or before the block
        const uint32_t middle = (low + high + 1) / 2;
        if (f->sources->items[middle].first_leaf <= first)
            low = middle;
        else
            high = middle - 1;
    }
    for (uint32_t leaf = first; leaf < end; leaf++) {
        while (leaf - f->sources->items[low].first_leaf >= f->sources->items[low].leaf_count)
            low++;
        fill_leaf(f, &f->sources->items[low], leaf);
    }
}

void hg_emitter_leaves_fill(const struct hg_emitter_leaves *out,
    const struct hg_emitter_sources *sources, const struct hg_emitter_plan *plan,
    struct hg_jobs *jobs)
{
    struct filling f = {out, sources, plan};
    if (plan->leaf_count > 0)
        hg_jobs_for(jobs, (plan->leaf_count - 1) / BLOCK + 1, fill_block, &f);
}
