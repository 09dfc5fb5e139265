#include "renderer/gi/occupancy.h"

#include "renderer/math/vec.h"

// Farthest that a lookup's point lies from its surface along an axis, in spacings, and a little for
// rounding.
#define REACH      (HG_PROBE_BIAS_NORMAL + HG_PROBE_BIAS_VIEW + 0.01f)
#define SLIVER     1e-6f      // squared sine between edges
#define MOST_TESTS (1u << 26) // of cells; more triangles than that fill them all anyway

struct work {
    struct hg_gi_field *field;
    uint32_t missing; // probes that no surface was found for yet
    uint64_t tests;
};

struct triangle { // grid units: one is a spacing, the first probe stands at 0
    float corners[3][3], normal[3], offset;
    bool sliver;              // the normal is not to be trusted
    uint32_t low[3], high[3]; // cells that its box touches
};

// The cell of a place along an axis, as lookups have it; never NaN's.
static uint32_t cell_of(float at, uint32_t count)
{
    const float last = count > 1 ? (float)(count - 2) : 0;
    return (uint32_t)fminf(fmaxf(floorf(at), 0), last);
}

static void load(const struct hg_gi_field *f, const struct hg_ray_geometry_piece *p,
    const uint32_t *indices, struct triangle *out)
{
    const float *m = p->world, scale = 1 / f->spacing;
    float a[3], b[3];
    for (int v = 0; v < 3; v++) {
        const float *at = p->positions + (size_t)indices[v] * 3;
        for (int k = 0; k < 3; k++)
            out->corners[v][k] =
                (m[k] * at[0] + m[3 + k] * at[1] + m[6 + k] * at[2] + m[9 + k] - f->origin[k]) *
                scale;
    }
    for (int k = 0; k < 3; k++) {
        const float x = out->corners[0][k], y = out->corners[1][k], z = out->corners[2][k];
        out->low[k] = cell_of(fminf(x, fminf(y, z)) - REACH, f->counts[k]);
        out->high[k] = cell_of(fmaxf(x, fmaxf(y, z)) + REACH, f->counts[k]);
    }
    hg_sub3(out->corners[1], out->corners[0], a);
    hg_sub3(out->corners[2], out->corners[0], b);
    hg_cross3(a, b, out->normal);
    out->offset = hg_dot3(out->normal, out->corners[0]);
    out->sliver = !(hg_dot3(out->normal, out->normal) > SLIVER * hg_dot3(a, a) * hg_dot3(b, b));
}

// The triangle's plane passes through the cell or within reach of it. Lookups beyond the grid
// belong to its outermost cells, which have no outer side.
static bool meets(const struct hg_gi_field *f, const struct triangle *t, const uint32_t cell[3])
{
    float middle = -t->offset, reach = 0;
    if (t->sliver)
        return true;
    for (int k = 0; k < 3; k++) {
        if (cell[k] == 0 || cell[k] + 2 >= f->counts[k])
            return true;
        middle += t->normal[k] * ((float)cell[k] + 0.5f);
        reach += fabsf(t->normal[k]) * (0.5f + REACH);
    }
    return !(fabsf(middle) > reach * 1.001f);
}

static void mark(struct work *w, const uint32_t cell[3])
{
    struct hg_gi_field *f = w->field;
    for (uint32_t i = 0; i < 8; i++) {
        uint32_t at[3];
        for (int k = 0; k < 3; k++) {
            at[k] = cell[k] + (i >> k & 1);
            at[k] = at[k] < f->counts[k] ? at[k] : f->counts[k] - 1;
        }
        bool *needed = &f->needed[(at[2] * f->counts[1] + at[1]) * f->counts[0] + at[0]];
        w->missing -= !*needed;
        *needed = true;
    }
}

static void add(struct work *w, const struct triangle *t)
{
    for (uint32_t z = t->low[2]; z <= t->high[2]; z++)
        for (uint32_t y = t->low[1]; y <= t->high[1]; y++)
            for (uint32_t x = t->low[0]; x <= t->high[0]; x++) {
                const uint32_t cell[3] = {x, y, z};
                w->tests++;
                if (meets(w->field, t, cell))
                    mark(w, cell);
            }
}

void hg_gi_occupy(struct hg_gi_field *field, const struct hg_host_surfaces *surfaces)
{
    struct work w = {.field = field, .missing = field->count};
    bool all = false;
    for (uint32_t d = 0; d < surfaces->draw_count; d++)
        all |= surfaces->first_pieces[d] == surfaces->first_pieces[d + 1];
    memset(field->needed, all, field->count * sizeof *field->needed);
    for (uint32_t i = 0; i < surfaces->piece_count && !all; i++) {
        const struct hg_ray_geometry_piece *p = &surfaces->pieces[i];
        for (uint32_t k = 0; k < p->triangle_count && w.missing > 0 && w.tests < MOST_TESTS; k++) {
            struct triangle t;
            load(field, p, p->indices + (size_t)k * 3, &t);
            add(&w, &t);
        }
    }
    if (w.tests >= MOST_TESTS)
        memset(field->needed, true, field->count * sizeof *field->needed);
}
