// motion_table.c - see motion_table.h.
#include "renderer/geometry/motion_table.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/geometry/geometry_state.h"

#define MOST_MOVED 65534u
#define MOST_STEPS 256u // that an instance is looked for
#define NOT_FOUND  UINT32_MAX

void hg_motion_table_finish(struct hg_motion_table *t)
{
    hg_free(t->nodes);
    hg_free(t->worlds);
    hg_free(t->draws);
    hg_free(t->moved);
    *t = (struct hg_motion_table){0};
}

static bool is_deformed(const struct hg_draw_entry *d)
{
    return d->deform != NULL && d->deform->vertex_count > 0;
}

bool hg_motion_table_deforms(const struct hg_geometry *g)
{
    for (uint32_t i = 0; i < g->deforms.count; i++)
        if (g->deforms.items[i].vertex_count > 0)
            return true;
    return false;
}

bool hg_motion_table_bounds(const struct hg_geometry *g, float min[3], float max[3])
{
    struct hg_box all = hg_box_empty();
    bool any = false;
    for (uint32_t i = 0; i < g->draw_count; i++) {
        if (!is_deformed(&g->draws[i]))
            continue;
        hg_box_add(&all, &g->draws[i].bounds);
        any = true;
    }
    memcpy(min, all.min, sizeof all.min);
    memcpy(max, all.max, sizeof all.max);
    return any;
}

// --- now to then ---------------------------------------------------------------------------------

static void to_double(const struct hg_mat4x3 *m, const double shift[3], double out[16])
{
    memset(out, 0, 16 * sizeof *out);
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 3; r++)
            out[c * 4 + r] = (double)m->m[c * 3 + r];
    for (int r = 0; r < 3; r++)
        out[12 + r] += shift[r];
    out[15] = 1.0;
}

// False: flat.
static bool invert(const double m[16], double out[16])
{
    const double det = hg_matrix_determinant3(m);
    if (!(fabs(det) > 1e-30))
        return false;
    memset(out, 0, 16 * sizeof *out);
    for (int c = 0; c < 3; c++) {
        for (int r = 0; r < 3; r++) {
            const int a = (c + 1) % 3, b = (c + 2) % 3, d = (r + 1) % 3, e = (r + 2) % 3;
            out[c * 4 + r] = (m[d * 4 + a] * m[e * 4 + b] - m[e * 4 + a] * m[d * 4 + b]) / det;
        }
    }
    for (int r = 0; r < 3; r++)
        out[12 + r] = -(out[r] * m[12] + out[4 + r] * m[13] + out[8 + r] * m[14]);
    out[15] = 1.0;
    return true;
}

// Number of an instance in the picture before; `hint`: where it is if nothing was added or removed.
static uint32_t find(const struct hg_motion_table *t, uint64_t node, uint32_t *hint)
{
    for (uint32_t k = 0; k < t->count && k < MOST_STEPS; k++) {
        const uint32_t at = (*hint + k) % t->count;
        if (t->nodes[at] == node) {
            *hint = at + 1;
            return at;
        }
    }
    return NOT_FOUND;
}

// What an instance is for its draws.
static uint16_t compare_one(struct hg_motion_table *t, const struct hg_gpu_instance *now,
    const double shift[3], uint32_t *hint)
{
    const double none[3] = {0};
    const bool stays = shift[0] == 0.0 && shift[1] == 0.0 && shift[2] == 0.0;
    const uint32_t was = find(t, now->node, hint);
    double before[16], after[16], inverse[16];
    if (was == NOT_FOUND)
        return HG_MOTION_DEFORMED;
    if (stays && memcmp(&t->worlds[was], &now->world, sizeof now->world) == 0)
        return HG_MOTION_STANDS;
    to_double(&t->worlds[was], shift, before);
    to_double(&now->world, none, after);
    bool same = true;
    for (int i = 0; i < 12; i++)
        same &= (float)before[i / 3 * 4 + i % 3] == now->world.m[i];
    if (same)
        return HG_MOTION_STANDS;
    if (t->moved_count > MOST_MOVED || !invert(after, inverse))
        return HG_MOTION_DEFORMED;
    hg_matrix_multiply(before, inverse, t->moved[t->moved_count]);
    return (uint16_t)t->moved_count++;
}

static uint64_t layout_of(const struct hg_geometry *g)
{
    uint64_t hash = g->tables.part_count;
    for (uint32_t i = 0; i < g->draw_count; i++) {
        const struct hg_draw_entry *d = &g->draws[i];
        hash = hg_hash_mix(hash, (uint64_t)d->gpu.part << 32 | d->gpu.instance);
        hash = hg_hash_mix(hash, d->node->head.id);
        hash = hg_hash_mix(hash, is_deformed(d) ? d->deform->vertex_count : 0);
    }
    return hash;
}

static bool make_room(struct hg_motion_table *t, const struct hg_geometry *g, uint16_t **kinds)
{
    const uint32_t instances = g->tables.instance_count;
    hg_free(t->draws);
    hg_free(t->moved);
    t->draw_count = t->moved_count = 0;
    t->deformed = false;
    t->draws = hg_calloc(g->draw_count + 1u, sizeof *t->draws);
    t->moved = hg_calloc(instances + 1u, sizeof *t->moved);
    *kinds = hg_calloc(instances + 1u, sizeof **kinds);
    return t->draws != NULL && t->moved != NULL && *kinds != NULL;
}

enum hg_status hg_motion_table_compare(struct hg_motion_table *t, const struct hg_geometry *g)
{
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    uint16_t *kinds;
    uint32_t hint = 0;
    double shift[3];
    if (!make_room(t, g, &kinds)) {
        hg_free(kinds);
        hg_motion_table_finish(t);
        return HG_E_NOMEM;
    }
    for (int i = 0; i < 3; i++)
        shift[i] = t->origin[i] - g->origin[i];
    for (int i = 0; i < 16; i += 5)
        t->moved[0][i] = 1.0;
    t->moved_count = 1;
    for (uint32_t i = 0; i < g->tables.instance_count && t->count > 0; i++)
        kinds[i] = compare_one(t, &instances[i], shift, &hint);
    t->draw_count = g->draw_count;
    t->same_layout = t->count > 0 && t->layout == layout_of(g);
    for (uint32_t i = 0; i < g->draw_count && t->count > 0; i++) {
        const struct hg_draw_entry *d = &g->draws[i];
        t->draws[i] = is_deformed(d) ? HG_MOTION_DEFORMED : kinds[d->gpu.instance];
        t->deformed |= t->draws[i] == HG_MOTION_DEFORMED;
    }
    hg_free(kinds);
    return HG_OK;
}

enum hg_status hg_motion_table_note(struct hg_motion_table *t, const struct hg_geometry *g)
{
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    const uint32_t count = g->tables.instance_count;
    if (count != t->count) {
        hg_free(t->nodes);
        hg_free(t->worlds);
        t->nodes = hg_calloc(count + 1u, sizeof *t->nodes);
        t->worlds = hg_calloc(count + 1u, sizeof *t->worlds);
    }
    if (t->nodes == NULL || t->worlds == NULL) {
        hg_motion_table_finish(t);
        return count > 0 ? HG_E_NOMEM : HG_OK;
    }
    t->count = count;
    t->layout = layout_of(g);
    memcpy(t->origin, g->origin, sizeof t->origin);
    for (uint32_t i = 0; i < count; i++) {
        t->nodes[i] = instances[i].node;
        t->worlds[i] = instances[i].world;
    }
    return HG_OK;
}
