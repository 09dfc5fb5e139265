// heightmap.h - height maps as terrain: SRTM tiles (.hgt) and 16-bit grey pictures.
// Floor 2, private to scene/. One load on one thread.
//
// Samples are metres above the plane y = 0: 16-bit big-endian signed in .hgt files (1201 or 3601
// squared, -32768 = void), unsigned in PNG and TIFF files. The first row is the north edge: x
// points east, z south, and the tile's middle is the origin. A name that begins as SRTM tiles do
// (N46E008) gives a tile of one degree at that latitude; otherwise samples are one metre apart.
// Voids take the lowest height there is, and a warning says how many there were.
#ifndef HG_RENDERER_SCENE_FORMATS_HEIGHTMAP_H
#define HG_RENDERER_SCENE_FORMATS_HEIGHTMAP_H

#include "renderer/scene/load.h"

// Whether the bytes of a file of that name are a height map.
bool hg_heightmap_knows(const char *label, const struct hg_refbuf *data);
// One node with one mesh of one part: positions, smooth normals, uv 0..1 over the tile.
// HG_E_FORMAT, HG_E_LIMIT (memory limit, fewer than 2 samples a side), HG_E_NOMEM, HG_E_CANCELLED.
enum hg_status hg_heightmap_load(const struct hg_load_params *params, const struct hg_refbuf *data,
    const char *label, struct hg_asset **out, struct hg_error *err) HG_MUST_CHECK;

#endif
