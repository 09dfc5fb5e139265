// scene.h - scenes that are larger than memory, made on demand for the benchmarks.
// Private to renderer/bench. The same parameters give the same scene, byte for byte.
#ifndef HG_RENDERER_BENCH_SCENE_H
#define HG_RENDERER_BENCH_SCENE_H

#include "base/jobs.h"
#include "renderer/scene/scene.h"

struct hg_bench_pose;

// An endless picture of value noise: octaves that a mip cannot show are left out of it, so each mip
// is filtered by construction. Any texel of any mip can be made alone.
struct hg_bench_pattern {
    uint32_t seed;
};
// `width` texels of a row of a mip, from (x, y) on, as RGBA8.
void hg_bench_pattern_row(const struct hg_bench_pattern *pattern, uint32_t mip, uint32_t x,
    uint32_t y, uint32_t width, uint8_t *rgba);

struct hg_bench_scene {
    struct hg_scene *scene;
    struct hg_bench_pattern *patterns; // [tile_count], behind `tiles`
    struct hg_image_tiles *tiles;      // [tile_count]
    uint32_t tile_count;
    uint64_t next_id, texture_bytes; // of all mips, as RGBA8
    uint64_t unique_triangles;
};
void hg_bench_scene_finish(struct hg_bench_scene *scene); // accepts a zeroed one

// A corridor along -z, 8 m wide, panels of 4 x 4 m on both walls: made textures, then image files,
// over and over, under a sky. HG_E_NOMEM.
struct hg_bench_gallery {
    uint32_t made, side_px;       // made textures and their sides
    const char *const *images;    // [image_count] files
    uint32_t image_count, panels; // panels of both walls together
    uint64_t image_texels;        // of all files together, for texture_bytes
};
enum hg_status hg_bench_gallery_make(const struct hg_bench_gallery *gallery,
    struct hg_bench_scene *out, struct hg_error *err) HG_MUST_CHECK;
// Pose number `at` of `count` of a flight through it and back, looking from wall to wall.
void hg_bench_gallery_pose(const struct hg_bench_gallery *gallery, uint32_t at, uint32_t count,
    struct hg_bench_pose *pose);
// Pose number `at` of a walk along it: 0.2 m from one to the next, turning to either wall and back
// in 60 steps, 3 degrees at most from one to the next.
void hg_bench_gallery_walk(uint32_t at, struct hg_bench_pose *pose);

// One unlit picture of side_px in the plane z = 0, a millimetre a texel, centre at the origin.
enum hg_status hg_bench_sheet_make(
    uint32_t side_px, struct hg_bench_scene *out, struct hg_error *err) HG_MUST_CHECK;

// Terrain of `tiles` x `tiles` meshes and `statues` instances of one mesh standing on it. Each
// terrain tile has detail of its own; neighbours share their border.
struct hg_bench_terrain {
    const struct hg_image *heights; // RGBA16, grey: metres above -0; borrowed. NULL: made
    struct hg_asset *statue;        // taken, also on failure; NULL: a made one
    uint32_t tiles, statues;
    uint32_t cells;  // per side of a tile; statues that are made have about 16 cells^2 / 100
    uint32_t thin;   // tiles and statues have one triangle in so many; 0 = all
    uint32_t copies; // per side: the terrain goes on, so many times as wide, with tiles of the same
                     // meshes; 0 = 1
};
enum hg_status hg_bench_terrain_make(const struct hg_bench_terrain *terrain, struct hg_jobs *jobs,
    struct hg_bench_scene *out, struct hg_error *err) HG_MUST_CHECK;
// Pose of a flight over the first tile, which looks the same whatever lies beyond.
void hg_bench_terrain_pose(uint32_t at, uint32_t count, struct hg_bench_pose *pose);

#endif
