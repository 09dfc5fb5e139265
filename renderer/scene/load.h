// load.h - files to assets. glTF 2.0, PLY, STL, OBJ, OFF and height maps have readers here
// (formats/formats.h); FBX and Collada go through assimp. Any but glTF may be gzipped.
// Floor 2. Any thread; one load uses only its own memory until it returns.
#ifndef HG_RENDERER_SCENE_LOAD_H
#define HG_RENDERER_SCENE_LOAD_H

#include "base/jobs.h"
#include "renderer/scene/scene.h"

// What is read, for messages.
#define HG_LOAD_FORMATS                                                                            \
    "glTF 2.0 (.gltf, .glb), OBJ, PLY, STL, OFF, FBX, Collada (.dae) and height maps (.hgt, "      \
    "16-bit "                                                                                      \
    "grey "                                                                                        \
    ".png and .tif)"

#define HG_LOAD_LIMIT_RESIDENT "resident"

// Fetches a file that an asset refers to (already percent-decoded, relative to the main file).
// HG_E_NOTFOUND, HG_E_PERM (outside the roots), HG_E_LIMIT, HG_E_IO with *err filled.
typedef enum hg_status hg_load_fetch_fn(void *user, const char *uri, uint64_t limit_bytes,
    struct hg_refbuf **out, struct hg_error *err);

struct hg_load_params {
    const char *path;        // main file; also its name in messages. "demo:" = the built-in scene
    hg_load_fetch_fn *fetch; // NULL: files beside `path`, not above its folder unless in `roots`
    void *fetch_user;
    const char *const *roots; // [root_count] folders that files may lie in; 0 = the file's folder
    uint32_t root_count;
    uint32_t asset_number;       // >= 1
    int32_t scene_index;         // -1 = the file's default
    enum hg_up_axis up;          // turned to +Y; 0 = not turned
    float point_scale, point_diameter; // of hg_mesh_part; 0 = by spacing
    uint64_t memory_limit_bytes; // of the decoded asset; 0 = 8 GiB
    // Of what of it is in memory and not spilled (hg_asset_resident_bytes); 0 = no limit.
    // HG_E_LIMIT with err->limit HG_LOAD_LIMIT_RESIDENT.
    uint64_t resident_limit_bytes;
    struct hg_jobs *jobs;        // NULL: single-threaded
    // Progress: stage name, done, total; return false to cancel (HG_E_CANCELLED). May be NULL.
    bool (*progress)(void *user, const char *stage, uint64_t done, uint64_t total);
    void *progress_user;
};

// HG_E_FORMAT, HG_E_UNSUPPORTED (required unknown extension), HG_E_LIMIT, HG_E_NOTFOUND,
// HG_E_NOMEM, HG_E_IO, HG_E_PERM: err->what = file, err->where = JSON pointer or "byte N",
// err->reason. *out is NULL on failure. Images are not decoded here, only their headers are
// checked.
enum hg_status hg_load_asset(
    const struct hg_load_params *params, struct hg_asset **out, struct hg_error *err) HG_MUST_CHECK;

// The environment that belongs to the demo scene: a sky whose sun stands where the scene's
// directional light does. Fields other than kind, sun, turbidity and intensity are untouched.
void hg_demo_environment(struct hg_environment *environment);

// One JSON object describing an asset (helio info --json): see docs/client.md for the keys.
enum hg_status hg_asset_describe(const struct hg_asset *asset, char **json_text) HG_MUST_CHECK;

#endif
