// formats.h - the readers of file formats, as load.c calls them: the only header of formats/ that
// is included from outside. Each makes an asset (asset.h) of the bytes of one file.
// Floor 2, private to scene/. One load on one thread; readers of different formats do not include
// each other.
//
// All: `main` (borrowed) are the bytes of params->path, `label` is its name in messages.
// HG_E_FORMAT, HG_E_LIMIT (the load's memory), HG_E_NOMEM, HG_E_CANCELLED with place and reason;
// *out is NULL then.
#ifndef HG_RENDERER_SCENE_FORMATS_FORMATS_H
#define HG_RENDERER_SCENE_FORMATS_FORMATS_H

#include "base/isolate.h"
#include "renderer/scene/load.h"

typedef enum hg_status hg_format_load_fn(const struct hg_load_params *params,
    const struct hg_refbuf *main, const char *label, struct hg_asset **out, struct hg_error *err);

// gltf/: glTF 2.0, text or binary. Also HG_E_UNSUPPORTED (a required extension), and the errors of
// params->fetch. References `main`.
enum hg_status hg_gltf_load(const struct hg_load_params *params, struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err) HG_MUST_CHECK;
hg_isolate_serve_fn hg_draco_serve HG_MUST_CHECK; // of HG_ISOLATE_DRACO and HG_ISOLATE_DRACO_VALUES

// mesh/
hg_format_load_fn hg_ply_load HG_MUST_CHECK;
hg_format_load_fn hg_stl_load HG_MUST_CHECK;
hg_format_load_fn hg_obj_load HG_MUST_CHECK;
hg_format_load_fn hg_off_load HG_MUST_CHECK;

// import/: FBX and Collada through assimp, in a process of its own where there is one
// (base/isolate.h). Whether the name's ending is one of these; also HG_E_UNSUPPORTED.
bool hg_import_knows(const char *path);
hg_format_load_fn hg_import_load HG_MUST_CHECK;
hg_isolate_serve_fn hg_import_serve HG_MUST_CHECK; // of HG_ISOLATE_IMPORT, in that process
// Inflates a gzip file. HG_E_FORMAT, HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_import_gunzip(const struct hg_refbuf *in, uint64_t limit_bytes, const char *label,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;

// heightmap.c: terrain from SRTM tiles (.hgt) and 16-bit grey pictures; one node with one mesh of
// one part: positions, smooth normals, uv 0..1 over the tile.
//
// Samples are metres above the plane y = 0: 16-bit big-endian signed in .hgt files (1201 or 3601
// squared, -32768 = void), unsigned in PNG and TIFF files. The first row is the north edge: x
// points east, z south, and the tile's middle is the origin. A name that begins as SRTM tiles do
// (N46E008) gives a tile of one degree at that latitude; otherwise samples are one metre apart.
// Voids take the lowest height there is, and a warning says how many there were. HG_E_LIMIT also
// for fewer than 2 samples a side.
bool hg_heightmap_knows(const char *label, const struct hg_refbuf *data);
hg_format_load_fn hg_heightmap_load HG_MUST_CHECK;

#endif
