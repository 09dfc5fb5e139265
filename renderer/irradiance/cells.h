// cells.h - a hash grid of cells on surfaces, and what rays from points in them gathered.
// Floor 2, private to renderer/irradiance. Lookups from any thread, all else from the render
// thread.
//
// A cell is a cube of a grid, for surfaces that face along one of six axes. Cubes are larger by
// powers of two the farther from the eye they were asked for (level). What surfaces scatter evenly
// is the same from all sides; what rough ones mirror has cells of its own, by where the eye is. A
// new cell begins with what the cell twice as large, or half as large, has at that point, or with
// what was seen there from another side. What comes is kept by a cell four times as large, too:
// lookups take both, as that has less noise. Where the table is full the cell that was not
// asked for longest makes room.
// Sources: Ward et al. 1988, "A Ray Tracing Solution for Diffuse Interreflection" (irradiance
// caching); Binder et al. 2019, "Massively Parallel Path Space Filtering" (cells by hashing).
#ifndef HG_RENDERER_IRRADIANCE_CELLS_H
#define HG_RENDERER_IRRADIANCE_CELLS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

#define HG_IRRADIANCE_CELLS  (1u << 17)
#define HG_IRRADIANCE_KEY_BYTES (sizeof(uint64_t) * HG_IRRADIANCE_CELLS)
#define HG_IRRADIANCE_LEVELS 32
#define HG_IRRADIANCE_NONE   UINT32_MAX

// Sums over samples and their number. Of diffuse light, irradiance over pi: what rays gathered from
// surfaces, what was there without them, what of the environment they saw, and all of it if nothing
// were in the way; weights, and how much near things left unoccluded times these. Of a rough lobe:
// radiance of surfaces times weight; weight, and the environment's luminance that rays saw, and all
// of it.
struct hg_irradiance_sums {
    float gathered[3], without[3], samples;
    float seen[3], all[3], weight, unoccluded;
};

struct hg_irradiance_cell {
    uint64_t key; // 0: empty
    struct hg_irradiance_sums sums;
    uint32_t rays;  // sent in the present light: places in its own sequence
    uint32_t used;  // picture that asked for it last
    uint32_t light; // number of the light that its samples are of
};

// What was asked last in a picture: points asked for one after the other mostly lie in one cell.
struct hg_irradiance_answer { // by kind: diffuse or lobe, the cell or the larger one
    uint64_t key;
    uint32_t cell, picture, light;
};
#define HG_IRRADIANCE_ANSWERS 4

struct hg_irradiance_cells {          // zeroed: none
    struct hg_irradiance_cell *cells; // [HG_IRRADIANCE_CELLS]
    uint64_t *keys;                   // theirs, so that a search reads one line of cache
    float finest;                     // metres of a cube of level 0; > 0
    float sides[HG_IRRADIANCE_LEVELS];
    uint32_t picture, light;
    uint32_t count;
    struct hg_irradiance_answer answers[HG_IRRADIANCE_ANSWERS];
};

enum hg_status hg_irradiance_cells_init(
    struct hg_irradiance_cells *cells, float finest) HG_MUST_CHECK; // HG_E_NOMEM
void hg_irradiance_cells_finish(struct hg_irradiance_cells *cells);
void hg_irradiance_cells_clear(struct hg_irradiance_cells *cells);

// Where a point of a surface is: position relative to the geometry's origin, unit normal.
struct hg_irradiance_point {
    float position[3], normal[3];
    int level;        // 0 .. HG_IRRADIANCE_LEVELS - 1
    const float *eye; // where a rough lobe is seen from; NULL: diffuse light
};
// The level whose cubes have about this side.
int hg_irradiance_level(const struct hg_irradiance_cells *cells, float metres);

// The key of the cube so many levels larger that it lies in, of diffuse light. Never 0.
uint64_t hg_irradiance_key(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point, int larger);

// Asks the memory for where the cells of a point are, so that whoever asks for many points does not
// wait for each.
struct hg_irradiance_query {
    struct hg_irradiance_point point;
    uint64_t key, larger; // larger 0: there is none
};
struct hg_irradiance_query hg_irradiance_query(
    const struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point);

struct hg_irradiance_place {
    uint32_t cell, larger; // HG_IRRADIANCE_NONE: there is no room
};
// The cells of a point, which are made if there are none. Their samples of another light than
// `light` count as few from then on. False: there is no room.
bool hg_irradiance_ask(struct hg_irradiance_cells *cells, const struct hg_irradiance_query *query,
    struct hg_irradiance_place *out);
// A point of a cell's sequence: each turn is taken once.
struct hg_irradiance_turn {
    uint64_t key;
    uint32_t number;
};
struct hg_irradiance_turn hg_irradiance_take_turn(struct hg_irradiance_cells *cells, uint32_t cell);

// To cells of one kind (diffuse, lobe) from one thread at a time. One sample, whatever it says.
void hg_irradiance_add(struct hg_irradiance_cells *cells, const struct hg_irradiance_place *place,
    const struct hg_irradiance_sums *sample);
// What lookups found, for the next ones, whose points may lie between the same cells. Zeroed:
// nothing. Of one set of cells, to which nothing is added meanwhile, and one eye.
struct hg_irradiance_corners {
    int32_t low[3];
    int level;
    uint32_t axis;
    bool are_known;
    struct hg_irradiance_sums sums[8]; // of each corner, as much of it as counts
};
#define HG_IRRADIANCE_LOOKUPS 32
struct hg_irradiance_lookups {
    struct hg_irradiance_corners corners[HG_IRRADIANCE_LOOKUPS];
};
// Sums of the eight cells around a point, interpolated. All zero: nothing is known.
void hg_irradiance_look_up(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, struct hg_irradiance_lookups *lookups,
    struct hg_irradiance_sums *out);

#endif
