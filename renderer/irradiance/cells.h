// cells.h - a hash grid of cells on surfaces, and what rays from points in them gathered.
// Floor 2, private to renderer/irradiance. Lookups from any thread, all else from the render
// thread.
//
// A cell is a cube of a grid, for surfaces that face along one of six axes. Cubes are larger by
// powers of two the farther from the eye they were asked for (level). A new cell begins with what
// the cell twice as large, or half as large, has at that point. Where the table is full the cell
// that was not asked for longest makes room.
// Sources: Ward et al. 1988, "A Ray Tracing Solution for Diffuse Interreflection" (irradiance
// caching); Binder et al. 2019, "Massively Parallel Path Space Filtering" (cells by hashing).
#ifndef HG_RENDERER_IRRADIANCE_CELLS_H
#define HG_RENDERER_IRRADIANCE_CELLS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

#define HG_IRRADIANCE_CELLS  (1u << 17)
#define HG_IRRADIANCE_LEVELS 32
#define HG_IRRADIANCE_NONE   UINT32_MAX

// Sums over samples: what rays gathered (irradiance over pi), what was there without them, their
// number.
struct hg_irradiance_sums {
    float gathered[3], without[3], samples;
};

struct hg_irradiance_cell {
    uint64_t key; // 0: empty
    struct hg_irradiance_sums sums;
    uint32_t rays;  // sent since it was made: places in its own sequence
    uint32_t used;  // picture that asked for it last
    uint32_t light; // number of the light that its samples are of
};

struct hg_irradiance_cells {          // zeroed: none
    struct hg_irradiance_cell *cells; // [HG_IRRADIANCE_CELLS]
    float finest;                     // metres of a cube of level 0; > 0
    uint32_t picture, light;
    uint32_t count;
};

enum hg_status hg_irradiance_cells_init(
    struct hg_irradiance_cells *cells, float finest) HG_MUST_CHECK; // HG_E_NOMEM
void hg_irradiance_cells_finish(struct hg_irradiance_cells *cells);
void hg_irradiance_cells_clear(struct hg_irradiance_cells *cells);

// Where a point of a surface is: position relative to the geometry's origin, unit normal.
struct hg_irradiance_point {
    float position[3], normal[3];
    int level; // 0 .. HG_IRRADIANCE_LEVELS - 1
};
// The level whose cubes have about this side.
int hg_irradiance_level(const struct hg_irradiance_cells *cells, float metres);

// The cell of a point, which is made if there is none; HG_IRRADIANCE_NONE: there is no room. Its
// samples of another light than `light` count as few from then on.
uint32_t hg_irradiance_ask(
    struct hg_irradiance_cells *cells, const struct hg_irradiance_point *point);
void hg_irradiance_add(struct hg_irradiance_cells *cells, uint32_t cell, const float gathered[3],
    const float without[3]);
// Sums of the eight cells around a point, interpolated. All zero: nothing is known.
void hg_irradiance_look_up(const struct hg_irradiance_cells *cells,
    const struct hg_irradiance_point *point, struct hg_irradiance_sums *out);

#endif
