// cells.c - see cells.h.
#include "renderer/irradiance/cells.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"

#define SLOTS          8      // that a key may be in
#define MOST_SAMPLES   128.0f // older ones fade
#define OLD_SAMPLES    4.0f   // that those of another light count as
#define FIRST_SAMPLES  64.0f  // that those of another cell count as in a new one
#define LARGER         2      // levels from a cell to that which counts beside it in lookups,
#define LARGER_SAMPLES 32.0f  // at most as so many samples
#define UNUSED         64     // pictures after which a cell may make room

#define AXIS_BITS   3
#define LEVEL_BITS  5
#define VIEW_BITS   7
#define ACROSS_FACE 4u // views along a side of a cube's face
#define OF_FACE     (ACROSS_FACE * ACROSS_FACE)
#define VIEWS       (6 * OF_FACE)
#define PLACE_BITS  16 // of each coordinate; farther away they repeat
#define VIEW_SHIFT  (AXIS_BITS + LEVEL_BITS)
#define PLACE_SHIFT (VIEW_SHIFT + VIEW_BITS)
#define SUMS        (sizeof(struct hg_irradiance_sums) / sizeof(float))
#define VIEW_MASK   ((UINT64_C(1) << VIEW_BITS) - 1)

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_irradiance_cells_init(struct hg_irradiance_cells *cells, float finest)
{
    *cells = (struct hg_irradiance_cells){.finest = finest};
    for (int level = 0; level < HG_IRRADIANCE_LEVELS; level++)
        cells->sides[level] = ldexpf(finest, level);
    cells->cells = hg_calloc(HG_IRRADIANCE_CELLS, sizeof *cells->cells);
    cells->keys = hg_calloc_aligned(SLOTS * sizeof *cells->keys, HG_IRRADIANCE_KEY_BYTES);
    return cells->cells && cells->keys ? HG_OK : HG_E_NOMEM;
}

void hg_irradiance_cells_finish(struct hg_irradiance_cells *cells)
{
    hg_free(cells->cells);
    hg_free(cells->keys);
    *cells = (struct hg_irradiance_cells){0};
}

void hg_irradiance_cells_clear(struct hg_irradiance_cells *cells)
{
    memset(cells->cells, 0, HG_IRRADIANCE_CELLS * sizeof *cells->cells);
    memset(cells->keys, 0, HG_IRRADIANCE_KEY_BYTES);
    memset(cells->answers, 0, sizeof cells->answers);
    cells->count = 0;
}

// --- keys ----------------------------------------------------------------------------------------

int hg_irradiance_level(const struct hg_irradiance_cells *cells, float metres)
{
    const float level = log2f(fmaxf(metres, cells->finest) / cells->finest) + 0.5f;
    return level < HG_IRRADIANCE_LEVELS - 1 ? (int)level : HG_IRRADIANCE_LEVELS - 1;
}

// 0 .. 5 for +x, -x, +y, ...
static uint32_t axis_of(const float n[3])
{
    const float a[3] = {fabsf(n[0]), fabsf(n[1]), fabsf(n[2])};
    const uint32_t axis = a[0] >= a[1] && a[0] >= a[2] ? 0 : a[1] >= a[2] ? 1 : 2;
    return 2 * axis + (n[axis] < 0);
}

// Which part of a face, from the coordinate along it over that of its axis.
static uint32_t part_of_face(float slope)
{
    return (uint32_t)hg_clampf((slope + 1) * (0.5f * ACROSS_FACE), 0, ACROSS_FACE - 1);
}

// From the middle of a cube to the eye: 1 .. VIEWS, OF_FACE to each of six axes; 0: diffuse light.
// It is the same all over a cube, so that lookups between cubes blend from one to the next.
static uint32_t view_of(
    const struct hg_irradiance_cells *cells, const int32_t at[3], int level, const float *eye)
{
    const float side = cells->sides[level];
    float to[3];
    if (!eye)
        return 0;
    for (int a = 0; a < 3; a++)
        to[a] = eye[a] - ((float)at[a] + 0.5f) * side;
    const uint32_t axis = axis_of(to), u = (axis / 2 + 1) % 3, v = (axis / 2 + 2) % 3;
    const float scale = 1 / fmaxf(fabsf(to[axis / 2]), FLT_MIN);
    return 1 + OF_FACE * axis + part_of_face(to[u] * scale) +
           ACROSS_FACE * part_of_face(to[v] * scale);
}

static uint64_t key_of(const int32_t at[3], int level, uint32_t axis, uint32_t view)
{
    const uint64_t mask = (UINT64_C(1) << PLACE_BITS) - 1;
    uint64_t key =
        (uint64_t)view << VIEW_SHIFT | (uint64_t)level << AXIS_BITS | (uint64_t)(axis + 1);
    for (int a = 0; a < 3; a++)
        key |= ((uint64_t)(uint32_t)at[a] & mask) << (PLACE_SHIFT + a * PLACE_BITS);
    return key;
}

// Rounded down; what is no number is at 0. (floorf is a call.)
static int32_t cube_of(float at)
{
    const float bound = 0x1p30f, high = at < bound ? at : bound;
    const float in = high > -bound ? high : -bound;
    const int32_t whole = at == at ? (int32_t)in : 0;
    return whole - ((float)whole > in);
}

// The cube that a point lies in, at its level.
struct cube {
    int32_t at[3];
    int level;
    uint32_t axis;
};

static struct cube cube_at(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p)
{
    const float scale = 1 / cells->sides[p->level];
    struct cube c = {.level = p->level, .axis = axis_of(p->normal)};
    for (int a = 0; a < 3; a++)
        c.at[a] = cube_of(p->position[a] * scale);
    return c;
}

static struct cube around(const struct cube *c, int levels)
{
    struct cube out = {.level = c->level + levels, .axis = c->axis};
    for (int a = 0; a < 3; a++)
        out.at[a] = c->at[a] >> levels;
    return out;
}

static uint64_t key_of_cube(
    const struct hg_irradiance_cells *cells, const struct cube *c, const float *eye)
{
    return key_of(c->at, c->level, c->axis, view_of(cells, c->at, c->level, eye));
}

uint64_t hg_irradiance_key(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point, int larger)
{
    const int room = HG_IRRADIANCE_LEVELS - 1 - point->level;
    const struct cube c = cube_at(cells, point), wide = around(&c, larger < room ? larger : room);
    return key_of_cube(cells, &wide, NULL);
}

static uint32_t first_slot(uint64_t key)
{
    return (uint32_t)(hg_hash_mix(0, key) >> 40) & (HG_IRRADIANCE_CELLS - 1) &
           ~(uint32_t)(SLOTS - 1);
}

static uint32_t find(const struct hg_irradiance_cells *cells, uint64_t key)
{
    const uint32_t first = first_slot(key);
    for (uint32_t i = first; i < first + SLOTS; i++)
        if (cells->keys[i] == key)
            return i;
    return HG_IRRADIANCE_NONE;
}

// --- asking --------------------------------------------------------------------------------------

static void add_scaled(
    const struct hg_irradiance_sums *from, float scale, struct hg_irradiance_sums *to)
{
    const float *in = from->gathered;
    float *out = to->gathered;
    for (int k = 0; k < (int)SUMS; k++)
        out[k] += scale * in[k];
}

static void fade(struct hg_irradiance_sums *s, float most)
{
    if (s->samples <= most)
        return;
    const struct hg_irradiance_sums before = *s;
    *s = (struct hg_irradiance_sums){0};
    add_scaled(&before, most / before.samples, s);
}

// An empty slot, else that of the cell that was not asked for longest.
static uint32_t make_room(const struct hg_irradiance_cells *cells, uint64_t key)
{
    const uint32_t first = first_slot(key);
    uint32_t oldest = first;
    for (uint32_t i = first; i < first + SLOTS; i++) {
        if (cells->keys[i] == 0)
            return i;
        if (cells->picture - cells->cells[i].used > cells->picture - cells->cells[oldest].used)
            oldest = i;
    }
    return cells->picture - cells->cells[oldest].used > UNUSED ? oldest : HG_IRRADIANCE_NONE;
}

// That was asked for last of the cells of the same cube for other views from `first` on.
static uint32_t find_newest_view(
    const struct hg_irradiance_cells *cells, uint64_t key, uint32_t first, uint32_t count)
{
    const uint64_t none = key & ~(VIEW_MASK << VIEW_SHIFT);
    uint32_t newest = HG_IRRADIANCE_NONE;
    for (uint64_t view = first; view < first + count; view++) {
        const uint64_t other = none | view << VIEW_SHIFT;
        const uint32_t slot = other != key ? find(cells, other) : HG_IRRADIANCE_NONE;
        if (slot == HG_IRRADIANCE_NONE)
            continue;
        const uint32_t age = cells->picture - cells->cells[slot].used;
        if (newest == HG_IRRADIANCE_NONE || age < cells->picture - cells->cells[newest].used)
            newest = slot;
    }
    return newest;
}

// From the same face of the cube if there is one.
static uint32_t find_other_view(const struct hg_irradiance_cells *cells, uint64_t key)
{
    const uint32_t view = (uint32_t)(key >> VIEW_SHIFT & VIEW_MASK);
    if (view == 0)
        return HG_IRRADIANCE_NONE;
    const uint32_t face = 1 + (view - 1) / OF_FACE * OF_FACE;
    const uint32_t slot = find_newest_view(cells, key, face, OF_FACE);
    return slot != HG_IRRADIANCE_NONE ? slot : find_newest_view(cells, key, 1, VIEWS);
}

// What knows most of a new cell: another view, a larger cell, which knows more about the
// surroundings than a smaller one.
static uint32_t find_like(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p, uint64_t key)
{
    uint32_t slot = find_other_view(cells, key);
    for (int step = 1; step >= -1 && slot == HG_IRRADIANCE_NONE; step -= 2) {
        struct hg_irradiance_point other = *p;
        other.level += step;
        if (other.level < 0 || other.level >= HG_IRRADIANCE_LEVELS)
            continue;
        const struct cube c = cube_at(cells, &other);
        slot = find(cells, key_of_cube(cells, &c, p->eye));
    }
    return slot;
}

static uint32_t make(
    struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p, uint64_t key)
{
    const uint32_t slot = make_room(cells, key), like = find_like(cells, p, key);
    if (slot == HG_IRRADIANCE_NONE)
        return slot;
    struct hg_irradiance_cell *c = &cells->cells[slot];
    struct hg_irradiance_cell made = {.key = key, .light = cells->light};
    if (like != HG_IRRADIANCE_NONE) {
        made.sums = cells->cells[like].sums;
        made.light = cells->cells[like].light;
        fade(&made.sums, FIRST_SAMPLES);
    }
    cells->count += c->key == 0;
    *c = made;
    cells->keys[slot] = key;
    return slot;
}

// In the picture and its light.
static void use(const struct hg_irradiance_cells *cells, struct hg_irradiance_cell *c)
{
    c->used = cells->picture;
    if (c->light != cells->light) {
        fade(&c->sums, OLD_SAMPLES);
        c->rays = 0;
    }
    c->light = cells->light;
}

static uint32_t ask(struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point,
    uint64_t key, struct hg_irradiance_answer *last)
{
    if (last->key == key && last->picture == cells->picture && last->light == cells->light)
        return last->cell;
    uint32_t slot = find(cells, key);
    if (slot == HG_IRRADIANCE_NONE)
        slot = make(cells, point, key);
    if (slot != HG_IRRADIANCE_NONE)
        use(cells, &cells->cells[slot]);
    *last = (struct hg_irradiance_answer){key, slot, cells->picture, cells->light};
    return slot;
}

struct hg_irradiance_query hg_irradiance_query(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point)
{
    const struct cube cube = cube_at(cells, point), wide = around(&cube, LARGER);
    struct hg_irradiance_query q = {.point = *point, .key = key_of_cube(cells, &cube, point->eye)};
    if (wide.level < HG_IRRADIANCE_LEVELS)
        q.larger = key_of_cube(cells, &wide, point->eye);
    __builtin_prefetch(&cells->keys[first_slot(q.key)]);
    __builtin_prefetch(&cells->keys[first_slot(q.larger)]);
    return q;
}

bool hg_irradiance_ask(struct hg_irradiance_cells *cells, const struct hg_irradiance_query *query,
    struct hg_irradiance_place *out)
{
    struct hg_irradiance_answer *last = &cells->answers[query->point.eye ? 2 : 0];
    struct hg_irradiance_point larger = query->point;
    larger.level += LARGER;
    out->cell = ask(cells, &query->point, query->key, &last[0]);
    out->larger =
        query->larger != 0 ? ask(cells, &larger, query->larger, &last[1]) : HG_IRRADIANCE_NONE;
    return out->cell != HG_IRRADIANCE_NONE;
}

struct hg_irradiance_turn hg_irradiance_take_turn(struct hg_irradiance_cells *cells, uint32_t cell)
{
    struct hg_irradiance_cell *c = &cells->cells[cell];
    return (struct hg_irradiance_turn){c->key, c->rays++};
}

void hg_irradiance_add(struct hg_irradiance_cells *cells, const struct hg_irradiance_place *place,
    const struct hg_irradiance_sums *sample)
{
    const uint32_t both[2] = {place->cell, place->larger};
    struct hg_irradiance_sums one = *sample;
    one.samples = 1;
    for (int i = 0; i < 2; i++) {
        if (both[i] == HG_IRRADIANCE_NONE)
            continue;
        struct hg_irradiance_sums *s = &cells->cells[both[i]].sums;
        fade(s, MOST_SAMPLES - 1);
        add_scaled(&one, 1, s);
    }
}

// --- lookup --------------------------------------------------------------------------------------

// As at most so many samples.
static void add_sums(const struct hg_irradiance_cells *cells, uint32_t slot, float most,
    struct hg_irradiance_sums *out)
{
    if (slot == HG_IRRADIANCE_NONE)
        return;
    const struct hg_irradiance_cell *c = &cells->cells[slot];
    if (c->light != cells->light)
        most = most < OLD_SAMPLES ? most : OLD_SAMPLES;
    add_scaled(&c->sums, c->sums.samples > most ? most / c->sums.samples : 1, out);
}

// Of the cells at the eight corners, then of what is around them: most have the same around.
static void make_keys(const struct hg_irradiance_cells *cells, const struct cube *low,
    const float *eye, uint64_t keys[16])
{
    struct cube before = {.level = -1};
    for (int i = 0; i < 8; i++) {
        struct cube cube = *low;
        cube.at[0] += i & 1;
        cube.at[1] += i >> 1 & 1;
        cube.at[2] += i >> 2;
        const struct cube wide = around(&cube, LARGER);
        const bool same = memcmp(&wide, &before, sizeof wide) == 0;
        before = wide;
        keys[i] = key_of_cube(cells, &cube, eye);
        if (same)
            keys[8 + i] = keys[7 + i];
        else
            keys[8 + i] = wide.level < HG_IRRADIANCE_LEVELS ? key_of_cube(cells, &wide, eye) : 0;
        __builtin_prefetch(&cells->keys[first_slot(keys[i])]);
        if (!same)
            __builtin_prefetch(&cells->keys[first_slot(keys[8 + i])]);
    }
}

// A cell, and what is around it, which is less noise and says more where a cell is new. All of them
// are asked for before the first is read: what they take is waiting for memory.
static void add_corners(const struct hg_irradiance_cells *cells, const struct cube *low,
    const float *eye, struct hg_irradiance_corners *c)
{
    uint64_t keys[16];
    uint32_t slots[16];
    make_keys(cells, low, eye, keys);
    for (int i = 0; i < 16; i++) {
        const bool same = i > 8 && keys[i] == keys[i - 1];
        slots[i] = same ? slots[i - 1] : keys[i] != 0 ? find(cells, keys[i]) : HG_IRRADIANCE_NONE;
        if (!same && slots[i] != HG_IRRADIANCE_NONE)
            __builtin_prefetch(&cells->cells[slots[i]].sums);
    }
    for (int i = 0; i < 8; i++) {
        add_sums(cells, slots[i], MOST_SAMPLES, &c->sums[i]);
        add_sums(cells, slots[8 + i], LARGER_SAMPLES, &c->sums[i]);
    }
}

static const struct hg_irradiance_corners *find_corners(const struct hg_irradiance_cells *cells,
    const struct cube *low, const float *eye, struct hg_irradiance_lookups *lookups)
{
    const uint32_t place = (uint32_t)low->at[0] + 5 * (uint32_t)low->at[1] +
                           19 * (uint32_t)low->at[2] + 7 * low->axis + (uint32_t)low->level;
    struct hg_irradiance_corners *c = &lookups->corners[place % HG_IRRADIANCE_LOOKUPS];
    const bool same = c->are_known && c->level == low->level && c->axis == low->axis &&
                      memcmp(low->at, c->low, sizeof c->low) == 0;
    if (same)
        return c;
    *c = (struct hg_irradiance_corners){.low = {low->at[0], low->at[1], low->at[2]},
        .level = low->level,
        .axis = low->axis,
        .are_known = true};
    add_corners(cells, low, eye, c);
    return c;
}

void hg_irradiance_look_up(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, struct hg_irradiance_lookups *lookups,
    struct hg_irradiance_sums *out)
{
    const float scale = 1 / cells->sides[point->level];
    struct cube low = {.level = point->level, .axis = axis_of(point->normal)};
    float f[3];
    *out = (struct hg_irradiance_sums){0};
    for (int a = 0; a < 3; a++) {
        const float at = point->position[a] * scale - 0.5f;
        low.at[a] = cube_of(at);
        f[a] = hg_clampf(at - (float)low.at[a], 0, 1);
    }
    const struct hg_irradiance_corners *c = find_corners(cells, &low, point->eye, lookups);
    for (int i = 0; i < 8; i++) {
        const float w =
            (i & 1 ? f[0] : 1 - f[0]) * (i & 2 ? f[1] : 1 - f[1]) * (i & 4 ? f[2] : 1 - f[2]);
        add_scaled(&c->sums[i], w, out);
    }
}
