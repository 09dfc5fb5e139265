// cells.c - see cells.h.
#include "renderer/irradiance/cells.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"

#define SLOTS         8      // that a key may be in
#define MOST_SAMPLES  256.0f // older ones fade
#define OLD_SAMPLES   4.0f   // that those of another light count as
#define FIRST_SAMPLES 16.0f  // that those of a cell of another level count as
#define UNUSED        64     // pictures after which a cell may make room

#define AXIS_BITS  3
#define LEVEL_BITS 5
#define PLACE_BITS 18 // of each coordinate; farther away they repeat

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_irradiance_cells_init(struct hg_irradiance_cells *cells, float finest)
{
    *cells = (struct hg_irradiance_cells){.finest = finest};
    cells->cells = hg_calloc(HG_IRRADIANCE_CELLS, sizeof *cells->cells);
    return cells->cells ? HG_OK : HG_E_NOMEM;
}

void hg_irradiance_cells_finish(struct hg_irradiance_cells *cells)
{
    hg_free(cells->cells);
    *cells = (struct hg_irradiance_cells){0};
}

void hg_irradiance_cells_clear(struct hg_irradiance_cells *cells)
{
    memset(cells->cells, 0, HG_IRRADIANCE_CELLS * sizeof *cells->cells);
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

static uint64_t key_of(const int32_t at[3], int level, uint32_t axis)
{
    const uint64_t mask = (UINT64_C(1) << PLACE_BITS) - 1;
    uint64_t key = (uint64_t)level << AXIS_BITS | (axis + 1);
    for (int a = 0; a < 3; a++)
        key |= ((uint64_t)(uint32_t)at[a] & mask) << (AXIS_BITS + LEVEL_BITS + a * PLACE_BITS);
    return key;
}

static float side_of(const struct hg_irradiance_cells *cells, int level)
{
    return ldexpf(cells->finest, level);
}

static int32_t cube_of(float at) // what is no number is at 0
{
    return at == at ? (int32_t)hg_clampf(floorf(at), -0x1p30f, 0x1p30f) : 0;
}

// The key of the cube that a point lies in, at any level.
static uint64_t key_at(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p, int level)
{
    const float scale = 1 / side_of(cells, level);
    int32_t at[3];
    for (int a = 0; a < 3; a++)
        at[a] = cube_of(p->position[a] * scale);
    return key_of(at, level, axis_of(p->normal));
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
        if (cells->cells[i].key == key)
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
        if (cells->cells[i].key == 0)
            return i;
        if (cells->picture - cells->cells[i].used > cells->picture - cells->cells[oldest].used)
            oldest = i;
    }
    return cells->picture - cells->cells[oldest].used > UNUSED ? oldest : HG_IRRADIANCE_NONE;
}

static uint32_t make(struct hg_irradiance_cells *cells, const struct hg_irradiance_point *p)
{
    const uint64_t key = key_at(cells, p, p->level);
    const uint32_t slot = make_room(cells, key);
    if (slot == HG_IRRADIANCE_NONE)
        return slot;
    struct hg_irradiance_cell *c = &cells->cells[slot];
    cells->count += c->key == 0;
    *c = (struct hg_irradiance_cell){.key = key, .light = cells->light};
    for (int step = 1; step >= -1; step -= 2) { // the larger one knows more about the surroundings
        const int level = p->level + step;
        const bool there = level >= 0 && level < HG_IRRADIANCE_LEVELS;
        const uint32_t other = there ? find(cells, key_at(cells, p, level)) : HG_IRRADIANCE_NONE;
        if (other == HG_IRRADIANCE_NONE)
            continue;
        c->sums = cells->cells[other].sums;
        c->light = cells->cells[other].light;
        fade(&c->sums, FIRST_SAMPLES);
        break;
    }
    return slot;
}

uint32_t hg_irradiance_ask(
    struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point)
{
    uint32_t slot = find(cells, key_at(cells, point, point->level));
    if (slot == HG_IRRADIANCE_NONE)
        slot = make(cells, point);
    if (slot == HG_IRRADIANCE_NONE)
        return slot;
    struct hg_irradiance_cell *c = &cells->cells[slot];
    c->used = cells->picture;
    if (c->light != cells->light)
        fade(&c->sums, OLD_SAMPLES);
    c->light = cells->light;
    return slot;
}

void hg_irradiance_add(struct hg_irradiance_cells *cells, uint32_t cell, const float gathered[3],
    const float without[3])
{
    struct hg_irradiance_sums *s = &cells->cells[cell].sums;
    fade(s, MOST_SAMPLES - 1);
    for (int c = 0; c < 3; c++) {
        s->gathered[c] += gathered[c];
        s->without[c] += without[c];
    }
    s->samples += 1;
}

// --- lookup --------------------------------------------------------------------------------------

static void add_cell(const struct hg_irradiance_cells *cells, uint64_t key, float weight,
    struct hg_irradiance_sums *out)
{
    const uint32_t slot = find(cells, key);
    if (slot == HG_IRRADIANCE_NONE)
        return;
    const struct hg_irradiance_cell *c = &cells->cells[slot];
    const bool old = c->light != cells->light && c->sums.samples > OLD_SAMPLES;
    const float w = old ? weight * OLD_SAMPLES / c->sums.samples : weight;
    for (int k = 0; k < 3; k++) {
        out->gathered[k] += w * c->sums.gathered[k];
        out->without[k] += w * c->sums.without[k];
    }
    out->samples += w * c->sums.samples;
}

void hg_irradiance_look_up(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, struct hg_irradiance_sums *out)
{
    const float scale = 1 / side_of(cells, point->level);
    const uint32_t axis = axis_of(point->normal);
    int32_t low[3];
    float f[3];
    *out = (struct hg_irradiance_sums){0};
    for (int a = 0; a < 3; a++) {
        const float at = point->position[a] * scale - 0.5f;
        low[a] = cube_of(at);
        f[a] = hg_clampf(at - (float)low[a], 0, 1);
    }
    for (int i = 0; i < 8; i++) {
        const int32_t at[3] = {low[0] + (i & 1), low[1] + (i >> 1 & 1), low[2] + (i >> 2)};
        const float w =
            (i & 1 ? f[0] : 1 - f[0]) * (i & 2 ? f[1] : 1 - f[1]) * (i & 4 ? f[2] : 1 - f[2]);
        if (w > 0.01f)
            add_cell(cells, key_of(at, point->level, axis), w, out);
    }
}
