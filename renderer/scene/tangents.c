// Tangent spaces with the results of MikkTSpace at its default angular threshold.
// Source: M. S. Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited", and his public
// description of the weld, group and average steps.
//
// Steps: weld equal vertices; one tangent frame per triangle; neighbours across edges; groups of
// triangles around a vertex that share its UV chart and orientation; an angle-weighted average
// per group; split vertices whose corners got different frames.
//
// MikkTSpace's bitangent points along +v. glTF's v grows downwards while the green of its normal
// maps points up, so the sign stored in w is negated.
#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

enum { NONE = -1, MAX_EXACT_GROUP = 64, MAX_VARIANTS_COMPARED = 16 };

struct frame { // tangent frame of one triangle
    float s[3], t[3];
    bool orient, any; // keeps the UV orientation; degenerate in UV: joins whatever group comes
    bool degenerate;  // two corners coincide in space
};

struct edge_slot {
    uint64_t key;
    int32_t first, last; // FIFO of unmatched corners (edge corner -> next corner); NONE = empty
    bool used;
};

struct mikk {
    struct hg_mesh_part *part;
    const float *uv;
    uint32_t triangles, corners;
    uint32_t *weld;       // [corners] representative vertex
    struct frame *frames; // [triangles]
    int32_t *neighbour;   // [corners] triangle across the edge corner -> next corner
    int32_t *next;        // [corners] FIFO links
    bool *assigned_any;   // [triangles] some corner is in a group
    uint32_t *group;      // [corners] 1 + group number, 0 = none
    uint32_t group_count;
    uint32_t *stack, *members; // [corners + 2], [triangles]
    float *result;             // [corners * 4] tangent, sign
};

static bool not_zero(float v)
{
    return fabsf(v) > FLT_MIN;
}

static void normalize(float v[3])
{
    if (!not_zero(v[0]) && !not_zero(v[1]) && !not_zero(v[2]))
        return;
    float scale = 1.0f / sqrtf(hg_dot3(v, v));
    for (int i = 0; i < 3; i++)
        v[i] *= scale;
}

// v without its part along n, unit length.
static void project(const float v[3], const float n[3], float out[3])
{
    float d = hg_dot3(n, v);
    for (int i = 0; i < 3; i++)
        out[i] = v[i] - n[i] * d;
    normalize(out);
}

static const float *position(const struct mikk *m, uint32_t corner)
{
    return m->part->positions + (size_t)m->part->indices[corner] * 3;
}

static const float *normal(const struct mikk *m, uint32_t corner)
{
    return m->part->normals + (size_t)m->part->indices[corner] * 3;
}

// ---- weld --------------------------------------------------------------------------------------

static void load_key(const struct mikk *m, uint32_t v, float key[8])
{
    memcpy(key, m->part->positions + (size_t)v * 3, 3 * sizeof(float));
    memcpy(key + 3, m->part->normals + (size_t)v * 3, 3 * sizeof(float));
    memcpy(key + 6, m->uv + (size_t)v * 2, 2 * sizeof(float));
    for (int i = 0; i < 8; i++)
        key[i] += 0.0f; // -0 equals 0
}

static uint64_t hash_bytes(const void *data, size_t size)
{
    const uint8_t *p = data;
    uint64_t h = 0x9e3779b97f4a7c15ull;
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word;
        memcpy(&word, p + i, 8);
        h = (h ^ word) * 0xff51afd7ed558ccdull;
        h ^= h >> 32;
    }
    return h;
}

static size_t table_size(size_t items)
{
    size_t size = 16;
    while (size < items * 2)
        size *= 2;
    return size;
}

static bool weld_vertices(struct mikk *m)
{
    uint32_t n = m->part->vertex_count;
    size_t size = table_size(n);
    uint32_t *table = hg_spill_scratch(size, sizeof *table); // 1 + vertex
    uint32_t *same = hg_spill_scratch(n, sizeof *same);
    for (uint32_t v = 0; table && same && v < n; v++) {
        float key[8], other[8];
        load_key(m, v, key);
        size_t i = hash_bytes(key, sizeof key) & (size - 1);
        for (; table[i]; i = (i + 1) & (size - 1)) {
            load_key(m, table[i] - 1, other);
            if (memcmp(key, other, sizeof key) == 0)
                break;
        }
        if (!table[i])
            table[i] = v + 1;
        same[v] = table[i] - 1;
    }
    for (uint32_t c = 0; table && same && c < m->corners; c++)
        m->weld[c] = same[m->part->indices[c]];
    bool ok = table && same;
    hg_free(table);
    hg_free(same);
    return ok;
}

// ---- frames ------------------------------------------------------------------------------------

static bool same_point(const float a[3], const float b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static void make_frame(const struct mikk *m, uint32_t triangle, struct frame *f)
{
    const float *p[3], *uv[3];
    for (int i = 0; i < 3; i++) {
        p[i] = position(m, triangle * 3 + i);
        uv[i] = m->uv + (size_t)m->part->indices[triangle * 3 + i] * 2;
    }
    f->any = true;
    f->degenerate = same_point(p[0], p[1]) || same_point(p[1], p[2]) || same_point(p[0], p[2]);
    float u1 = uv[1][0] - uv[0][0], v1 = uv[1][1] - uv[0][1];
    float u2 = uv[2][0] - uv[0][0], v2 = uv[2][1] - uv[0][1];
    float area = u1 * v2 - v1 * u2;
    f->orient = area > 0;
    if (!not_zero(area))
        return;
    for (int i = 0; i < 3; i++) {
        float d1 = p[1][i] - p[0][i], d2 = p[2][i] - p[0][i];
        f->s[i] = v2 * d1 - v1 * d2;
        f->t[i] = u1 * d2 - u2 * d1;
    }
    float length_s = sqrtf(hg_dot3(f->s, f->s)), length_t = sqrtf(hg_dot3(f->t, f->t));
    float sign = f->orient ? 1.0f : -1.0f;
    for (int i = 0; i < 3; i++) {
        f->s[i] *= not_zero(length_s) ? sign / length_s : 1;
        f->t[i] *= not_zero(length_t) ? sign / length_t : 1;
    }
    f->any = !(not_zero(length_s / fabsf(area)) && not_zero(length_t / fabsf(area)));
}

// ---- neighbours --------------------------------------------------------------------------------

static uint32_t next_corner(uint32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

static uint32_t previous_corner(uint32_t corner)
{
    return corner % 3 == 0 ? corner + 2 : corner - 1;
}

static struct edge_slot *find_edge(struct edge_slot *table, size_t size, uint64_t key)
{
    size_t i = hash_bytes(&key, sizeof key) & (size - 1);
    while (table[i].used && table[i].key != key)
        i = (i + 1) & (size - 1);
    return &table[i];
}

// Pairs each directed edge with the earliest unmatched opposite one.
static void match_edge(struct mikk *m, struct edge_slot *slot, uint32_t corner)
{
    int32_t first = slot->first;
    if (first != NONE && m->weld[first] != m->weld[corner]) { // the opposite direction
        m->neighbour[corner] = first / 3;
        m->neighbour[first] = (int32_t)(corner / 3);
        slot->first = m->next[first];
        return;
    }
    m->next[corner] = NONE;
    if (first == NONE)
        slot->first = (int32_t)corner;
    else
        m->next[slot->last] = (int32_t)corner;
    slot->last = (int32_t)corner;
}

static bool find_neighbours(struct mikk *m)
{
    size_t size = table_size(m->corners);
    struct edge_slot *table = hg_spill_scratch(size, sizeof *table);
    if (!table)
        return false;
    for (uint32_t c = 0; c < m->corners; c++) {
        m->neighbour[c] = NONE;
        if (m->frames[c / 3].degenerate)
            continue;
        uint32_t a = m->weld[c], b = m->weld[next_corner(c)];
        uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
        struct edge_slot *slot = find_edge(table, size, key);
        if (!slot->used)
            *slot = (struct edge_slot){.key = key, .first = NONE, .last = NONE, .used = true};
        match_edge(m, slot, c);
    }
    hg_free(table);
    return true;
}

// ---- groups ------------------------------------------------------------------------------------

static uint32_t find_corner(const struct mikk *m, uint32_t triangle, uint32_t vertex)
{
    uint32_t c = triangle * 3;
    while (m->weld[c] != vertex)
        c++;
    return c;
}

// Adds the triangle's corner to the group unless it is taken or turned the other way.
static bool join(struct mikk *m, uint32_t corner, bool orient)
{
    struct frame *f = &m->frames[corner / 3];
    if (m->group[corner])
        return false;
    if (f->any && !m->assigned_any[corner / 3])
        f->orient = orient; // the first group to touch it decides
    if (f->orient != orient)
        return false;
    m->group[corner] = m->group_count;
    m->assigned_any[corner / 3] = true;
    return true;
}

static int compare_u32(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

// Collects the group that begins at a corner; returns its corners in m->members, in order.
static uint32_t collect_group(struct mikk *m, uint32_t corner)
{
    uint32_t depth = 0, count = 0, vertex = m->weld[corner];
    bool orient = m->frames[corner / 3].orient;
    m->group_count++;
    m->stack[depth++] = corner / 3;
    while (depth) {
        uint32_t c = find_corner(m, m->stack[--depth], vertex);
        if (!join(m, c, orient))
            continue;
        m->members[count++] = c;
        int32_t left = m->neighbour[c], right = m->neighbour[previous_corner(c)];
        if (right != NONE)
            m->stack[depth++] = (uint32_t)right;
        if (left != NONE)
            m->stack[depth++] = (uint32_t)left;
    }
    qsort(m->members, count, sizeof *m->members, compare_u32);
    return count;
}

static float corner_angle(const struct mikk *m, uint32_t corner, const float n[3])
{
    const float *p = position(m, corner);
    const float *a = position(m, previous_corner(corner)), *b = position(m, next_corner(corner));
    float va[3], vb[3];
    for (int i = 0; i < 3; i++) {
        va[i] = a[i] - p[i];
        vb[i] = b[i] - p[i];
    }
    project(va, n, va);
    project(vb, n, vb);
    float c = hg_dot3(va, vb);
    return (float)acos(c > 1 ? 1 : c < -1 ? -1 : c);
}

// Angle-weighted mean of the members' tangents, each projected onto its vertex's plane. `keep`
// (NULL = all) chooses among them.
static void average(const struct mikk *m, uint32_t count, const bool *keep, float out[3])
{
    out[0] = out[1] = out[2] = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t c = m->members[i];
        const struct frame *f = &m->frames[c / 3];
        if (f->any || (keep && !keep[i]))
            continue;
        float s[3];
        project(f->s, normal(m, c), s);
        float angle = corner_angle(m, c, normal(m, c));
        for (int k = 0; k < 3; k++)
            out[k] += angle * s[k];
    }
    normalize(out);
}

// Tangents and bitangents of a group's members in the plane of their vertex, whose normal is the
// same for all of them.
struct flat {
    float s[MAX_EXACT_GROUP][3], t[MAX_EXACT_GROUP][3];
};

static void flatten(const struct mikk *m, uint32_t count, struct flat *flat)
{
    for (uint32_t i = 0; i < count; i++) {
        const struct frame *f = &m->frames[m->members[i] / 3];
        const float *n = normal(m, m->members[i]);
        project(f->s, n, flat->s[i]);
        project(f->t, n, flat->t[i]);
    }
}

// Members whose tangents are not exactly opposite to those of member `i` (threshold 180 degrees).
// True when that is all of them.
static bool choose_members(
    const struct mikk *m, uint32_t i, uint32_t count, const struct flat *flat, bool *keep)
{
    const bool any = m->frames[m->members[i] / 3].any;
    bool all = true;
    for (uint32_t j = 0; j < count; j++) {
        keep[j] = j == i || any || m->frames[m->members[j] / 3].any ||
                  (hg_dot3(flat->s[i], flat->s[j]) > -1 && hg_dot3(flat->t[i], flat->t[j]) > -1);
        all &= keep[j];
    }
    return all;
}

static void store(struct mikk *m, uint32_t corner, const float tangent[3], bool orient)
{
    memcpy(m->result + (size_t)corner * 4, tangent, 3 * sizeof(float));
    m->result[(size_t)corner * 4 + 3] = orient ? -1.0f : 1.0f;
}

static void solve_group(struct mikk *m, uint32_t corner)
{
    uint32_t count = collect_group(m, corner);
    bool orient = m->frames[corner / 3].orient;
    float mean[3], own[3];
    struct flat flat;
    const bool exact = count <= MAX_EXACT_GROUP;
    average(m, count, NULL, mean);
    if (exact)
        flatten(m, count, &flat);
    for (uint32_t i = 0; i < count; i++) {
        bool keep[MAX_EXACT_GROUP];
        const float *tangent = mean;
        if (exact && !choose_members(m, i, count, &flat, keep)) {
            average(m, count, keep, own);
            tangent = own;
        }
        store(m, m->members[i], tangent, orient);
    }
}

// Corners of triangles that collapse in space take the frame of a sound corner at their vertex.
static bool borrow_frames(struct mikk *m)
{
    int32_t *sound = hg_spill_scratch(m->part->vertex_count, sizeof *sound); // 1 + corner
    if (!sound)
        return false;
    for (uint32_t c = 0; c < m->corners; c++)
        if (!m->frames[c / 3].degenerate && !sound[m->weld[c]])
            sound[m->weld[c]] = (int32_t)c + 1;
    for (uint32_t c = 0; c < m->corners; c++)
        if (m->frames[c / 3].degenerate && sound[m->weld[c]])
            memcpy(m->result + (size_t)c * 4, m->result + (size_t)(sound[m->weld[c]] - 1) * 4,
                4 * sizeof(float));
    hg_free(sound);
    return true;
}

// ---- vertices ----------------------------------------------------------------------------------

// Makes every result a unit vector (a mean may vanish; then any direction in the surface does).
static void repair(const struct mikk *m, uint32_t corner)
{
    float *t = m->result + (size_t)corner * 4;
    if (isfinite(t[0] + t[1] + t[2]) && hg_normalize3(t))
        return;
    const float *n = normal(m, corner);
    float axis[3] = {fabsf(n[0]) < 0.9f ? 1.0f : 0.0f, fabsf(n[0]) < 0.9f ? 0.0f : 1.0f, 0};
    project(axis, n, t);
}

struct split {
    uint32_t *source;  // [capacity] old vertex
    uint32_t *sibling; // [capacity] next new vertex of the same old one, 0 = last
    float *tangents;   // [capacity * 4]
    bool *set;         // [vertex_count]
    uint32_t count;
};

static uint32_t place_corner(struct split *s, uint32_t vertex, const float tangent[4])
{
    if (!s->set[vertex]) {
        s->set[vertex] = true;
        memcpy(s->tangents + (size_t)vertex * 4, tangent, 4 * sizeof(float));
        return vertex;
    }
    uint32_t v = vertex;
    for (int compared = 0; compared < MAX_VARIANTS_COMPARED; compared++) {
        if (memcmp(s->tangents + (size_t)v * 4, tangent, 4 * sizeof(float)) == 0)
            return v;
        if (!s->sibling[v])
            break;
        v = s->sibling[v];
    }
    uint32_t fresh = s->count++;
    s->source[fresh] = vertex;
    s->sibling[fresh] = s->sibling[v];
    s->sibling[v] = fresh;
    memcpy(s->tangents + (size_t)fresh * 4, tangent, 4 * sizeof(float));
    return fresh;
}

static enum hg_status split_vertices(struct mikk *m, uint32_t target_count)
{
    struct hg_mesh_part *part = m->part;
    size_t capacity = (size_t)part->vertex_count + m->corners;
    struct split s = {.source = hg_spill_scratch(capacity, sizeof *s.source),
        .sibling = hg_spill_scratch(capacity, sizeof *s.sibling),
        .tangents = hg_spill_scratch(capacity, 4 * sizeof *s.tangents),
        .set = hg_spill_scratch(part->vertex_count, sizeof *s.set),
        .count = part->vertex_count};
    enum hg_status status = HG_E_NOMEM;
    if (s.source && s.sibling && s.tangents && s.set) {
        for (uint32_t v = 0; v < part->vertex_count; v++) {
            s.source[v] = v;
            s.tangents[(size_t)v * 4] = s.tangents[(size_t)v * 4 + 3] = 1;
        }
        for (uint32_t c = 0; c < m->corners; c++) {
            repair(m, c);
            part->indices[c] = place_corner(&s, part->indices[c], m->result + (size_t)c * 4);
        }
        hg_free(part->tangents);
        part->tangents = NULL;
        status = s.count == part->vertex_count
                     ? HG_OK
                     : hg_mesh_part_remap(part, target_count, s.source, s.count);
        part->tangents = s.tangents;
        s.tangents = NULL;
    }
    hg_free(s.source);
    hg_free(s.sibling);
    hg_free(s.tangents);
    hg_free(s.set);
    return status;
}

static bool init(struct mikk *m)
{
    m->weld = hg_spill_scratch(m->corners, sizeof *m->weld);
    m->frames = hg_spill_scratch(m->triangles, sizeof *m->frames);
    m->neighbour = hg_spill_scratch(m->corners, sizeof *m->neighbour);
    m->next = hg_spill_scratch(m->corners, sizeof *m->next);
    m->assigned_any = hg_spill_scratch(m->triangles, sizeof *m->assigned_any);
    m->group = hg_spill_scratch(m->corners, sizeof *m->group);
    m->stack = hg_spill_scratch((size_t)m->corners + 2, sizeof *m->stack);
    m->members = hg_spill_scratch(m->triangles, sizeof *m->members);
    m->result = hg_spill_scratch(m->corners, 4 * sizeof *m->result);
    return m->weld && m->frames && m->neighbour && m->next && m->assigned_any && m->group &&
           m->stack && m->members && m->result;
}

static void finish(struct mikk *m)
{
    hg_free(m->weld);
    hg_free(m->frames);
    hg_free(m->neighbour);
    hg_free(m->next);
    hg_free(m->assigned_any);
    hg_free(m->group);
    hg_free(m->stack);
    hg_free(m->members);
    hg_free(m->result);
}

enum hg_status hg_part_make_tangents(
    struct hg_mesh_part *part, uint32_t target_count, uint32_t uv_set)
{
    struct mikk m = {.part = part,
        .uv = part->uv[uv_set],
        .triangles = part->index_count / 3,
        .corners = part->index_count};
    enum hg_status status = HG_E_NOMEM;
    if (part->index_count > INT32_MAX - 3)
        return HG_E_LIMIT;
    if (!init(&m) || !weld_vertices(&m))
        goto done;
    for (uint32_t t = 0; t < m.triangles; t++)
        make_frame(&m, t, &m.frames[t]);
    if (!find_neighbours(&m))
        goto done;
    for (uint32_t c = 0; c < m.corners; c++) {
        static const float axis[3] = {1, 0, 0};
        store(&m, c, axis, false);
    }
    for (uint32_t c = 0; c < m.corners; c++)
        if (!m.frames[c / 3].degenerate && !m.frames[c / 3].any && !m.group[c])
            solve_group(&m, c);
    if (borrow_frames(&m))
        status = split_vertices(&m, target_count);
done:
    finish(&m);
    return status;
}
