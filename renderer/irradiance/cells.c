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

static int32_t cube_of(float at) // what is no number is at 0
{
    return at == at ? (int32_t)hg_clampf(floorf(at), -0x1p30f, 0x1p30f) : 0;
}

static uint64_t key_of_cube(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *p, const int32_t at[3], int level)
{
    return key_of(at, level, axis_of(p->normal), view_of(cells, at, level, p->eye));
}

// The key of the cube that a point lies in, at any level.
static uint64_t key_at(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p, int level)
{
    const float scale = 1 / cells->sides[level];
    int32_t at[3];
    for (int a = 0; a < 3; a++)
        at[a] = cube_of(p->position[a] * scale);
    return key_of_cube(cells, p, at, level);
}

uint64_t hg_irradiance_key(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point, int larger)
{
    struct hg_irradiance_point p = *point;
    const int level = point->level + larger;
    p.eye = NULL;
    return key_at(cells, &p, level < HG_IRRADIANCE_LEVELS ? level : HG_IRRADIANCE_LEVELS - 1);
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

static void fade(struct hg_irradiance_sums *s, float most)
{
    const float scale = s->samples > most ? most / s->samples : 1;
    for (int c = 0; c < 3; c++) {
        s->gathered[c] *= scale;
        s->without[c] *= scale;
    }
    s->samples *= scale;
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
        const int level = p->level + step;
        if (level >= 0 && level < HG_IRRADIANCE_LEVELS)
            slot = find(cells, key_at(cells, p, level));
    }
    return slot;
}

static uint32_t make(struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p)
{
    const uint64_t key = key_at(cells, p, p->level);
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

static uint32_t ask(struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point)
{
    uint32_t slot = find(cells, key_at(cells, point, point->level));
    if (slot == HG_IRRADIANCE_NONE)
        slot = make(cells, point);
    if (slot == HG_IRRADIANCE_NONE)
        return slot;
    struct hg_irradiance_cell *c = &cells->cells[slot];
    c->used = cells->picture;
    if (c->light != cells->light) {
        fade(&c->sums, OLD_SAMPLES);
        c->rays = 0;
    }
    c->light = cells->light;
    return slot;
}

bool hg_irradiance_ask(struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point,
    struct hg_irradiance_place *out)
{
    struct hg_irradiance_point larger = *point;
    larger.level += LARGER;
    out->cell = ask(cells, point);
    out->larger = larger.level < HG_IRRADIANCE_LEVELS ? ask(cells, &larger) : HG_IRRADIANCE_NONE;
    return out->cell != HG_IRRADIANCE_NONE;
}

void hg_irradiance_add(struct hg_irradiance_cells *cells, const struct hg_irradiance_place *place,
    const float gathered[3], const float without[3])
{
    const uint32_t both[2] = {place->cell, place->larger};
    for (int i = 0; i < 2; i++) {
        if (both[i] == HG_IRRADIANCE_NONE)
            continue;
        struct hg_irradiance_sums *s = &cells->cells[both[i]].sums;
        fade(s, MOST_SAMPLES - 1);
        for (int c = 0; c < 3; c++) {
            s->gathered[c] += gathered[c];
            s->without[c] += without[c];
        }
        s->samples += 1;
    }
}

// --- lookup --------------------------------------------------------------------------------------

// As at most so many samples.
static void add_sums(const struct hg_irradiance_cells *cells, uint32_t slot, const float weight[2],
    struct hg_irradiance_sums *out)
{
    const struct hg_irradiance_cell *c = &cells->cells[slot];
    const float most = c->light != cells->light ? fminf(weight[1], OLD_SAMPLES) : weight[1];
    const float w = c->sums.samples > most ? weight[0] * most / c->sums.samples : weight[0];
    for (int k = 0; k < 3; k++) {
        out->gathered[k] += w * c->sums.gathered[k];
        out->without[k] += w * c->sums.without[k];
    }
    out->samples += w * c->sums.samples;
}

static uint32_t find_cube(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, const int32_t at[3], int level)
{
    return find(cells, key_of_cube(cells, point, at, level));
}

static void find_corners(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, const int32_t low[3], struct hg_irradiance_corners *c)
{
    const int level = point->level + LARGER;
    const uint32_t axis = axis_of(point->normal);
    if (c->are_known && memcmp(low, c->low, sizeof c->low) == 0 && c->level == point->level &&
        c->axis == axis)
        return;
    *c = (struct hg_irradiance_corners){
        .low = {low[0], low[1], low[2]}, .level = point->level, .axis = axis, .are_known = true};
    for (int i = 0; i < 8; i++) {
        const int32_t at[3] = {low[0] + (i & 1), low[1] + (i >> 1 & 1), low[2] + (i >> 2)};
        const int32_t around[3] = {at[0] >> LARGER, at[1] >> LARGER, at[2] >> LARGER};
        c->cells[i] = find_cube(cells, point, at, point->level);
        c->larger[i] = level < HG_IRRADIANCE_LEVELS ? find_cube(cells, point, around, level)
                                                    : HG_IRRADIANCE_NONE;
    }
}

// A cell, and what is around it, which is less noise and says more where a cell is new.
static void add_corner(const struct hg_irradiance_cells *cells, const uint32_t slots[2],
    float weight, struct hg_irradiance_sums *out)
{
    if (slots[0] != HG_IRRADIANCE_NONE)
        add_sums(cells, slots[0], (const float[2]){weight, MOST_SAMPLES}, out);
    if (slots[1] != HG_IRRADIANCE_NONE)
        add_sums(cells, slots[1], (const float[2]){weight, LARGER_SAMPLES}, out);
}

void hg_irradiance_look_up(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, struct hg_irradiance_corners *corners,
    struct hg_irradiance_sums *out)
{
    const float scale = 1 / cells->sides[point->level];
    int32_t low[3];
    float f[3];
    *out = (struct hg_irradiance_sums){0};
    for (int a = 0; a < 3; a++) {
        const float at = point->position[a] * scale - 0.5f;
        low[a] = cube_of(at);
        f[a] = hg_clampf(at - (float)low[a], 0, 1);
    }
    find_corners(cells, point, low, corners);
    for (int i = 0; i < 8; i++) {
        const float w =
            (i & 1 ? f[0] : 1 - f[0]) * (i & 2 ? f[1] : 1 - f[1]) * (i & 4 ? f[2] : 1 - f[2]);
        const uint32_t slots[2] = {corners->cells[i], corners->larger[i]};
        if (w > 0.01f)
            add_corner(cells, slots, w, out);
    }
}
