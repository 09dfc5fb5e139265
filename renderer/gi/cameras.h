// cameras.h - the finer grids of the cameras that were drawn last: those of the field of rest and
// the moving ones. Floor 2, private to renderer/gi. Thread: the render thread.
//
// Grids of the field of rest are built from coarse to fine, each lit by itself and coarser ones,
// when the whole scene's is complete: what they hold depends on the scene and the camera alone.
// Moving ones follow the camera; probes that stay keep their light, others begin with that of the
// coarser grids. Placing a grid takes hundreds of thousands of rays, so the new grids are placed
// over some pictures, in which the camera has the old ones.
#ifndef HG_RENDERER_GI_CAMERAS_H
#define HG_RENDERER_GI_CAMERAS_H

#include "renderer/gi/build.h"
#include "renderer/gi/cascades.h"

#define HG_GI_CAMERAS 4 // that have finer grids at a time

struct hg_gi_finer { // zeroed: none
    struct hg_gi_placement at;
    struct hg_gi_build builds[HG_GI_FINER]; // as the boxes of `at`
    bool known;                             // `at` is the placement for:
    struct hg_gi_key key;
    struct hg_gi_eye eye;
};

struct hg_gi_camera {
    uint64_t view, touched; // touched: 0 = none
    struct hg_gi_finer rest, moving;
    struct hg_gi_finer next; // what the moving ones become once its probes have found their places
    bool has_next;
    uint32_t turn; // of the moving grids: which one is updated next
};

struct hg_gi_cameras {
    struct hg_gi_camera cameras[HG_GI_CAMERAS];
    uint64_t touches;
};

// NULL: it has none.
const struct hg_gi_camera *hg_gi_cameras_find(const struct hg_gi_cameras *cameras, uint64_t view);
// The one used last; NULL: none.
const struct hg_gi_camera *hg_gi_cameras_newest(const struct hg_gi_cameras *cameras);
// The view's, or that of the one unused for longest. NULL: all are in use.
struct hg_gi_camera *hg_gi_cameras_acquire(
    struct hg_gi_cameras *cameras, uint64_t view, struct hg_gpu *gpu);
void hg_gi_cameras_touch(struct hg_gi_cameras *cameras, uint64_t view);
uint64_t hg_gi_cameras_bytes(const struct hg_gi_cameras *cameras);
// The grids of all of them, of the field of rest or moving.
void hg_gi_cameras_drop_rest(struct hg_gi_cameras *cameras, struct hg_gpu *gpu);
void hg_gi_cameras_drop_moving(struct hg_gi_cameras *cameras, struct hg_gpu *gpu);

struct hg_gi_camera_params {
    struct hg_gi_waves *waves; // in line with the key
    const struct hg_lighting_sources *sources;
    struct hg_gi_build *whole; // the whole scene's grid; complete where it is that of rest
    bool at_rest;              // it is
    bool on_lattice;           // grids of the field of rest have its lattice
    const struct hg_gi_key *key;
    const struct hg_gi_eye *eye;
};

bool hg_gi_camera_is_rest(
    const struct hg_gi_camera *camera, const struct hg_gi_key *key, const struct hg_gi_eye *eye);
// The next waves of the field of rest, about *rays of them. After an error there are no grids.
// HG_E_NOMEM, device errors.
enum hg_status hg_gi_camera_rest(struct hg_gi_camera *camera,
    const struct hg_gi_camera_params *params, uint64_t *rays, struct hg_error *err) HG_MUST_CHECK;
// Nothing is to be done for a moving picture.
bool hg_gi_camera_is_still(
    const struct hg_gi_camera *camera, const struct hg_gi_key *key, const struct hg_gi_eye *eye);
// About `rays` rays for the moving grids, and for `whole` unless that is at rest. Where the grids
// of the field of rest are what the camera needs hg_gi_camera_is_rest is true then. NULL: a camera
// without finer grids. Errors as above.
enum hg_status hg_gi_camera_move(struct hg_gi_camera *camera,
    const struct hg_gi_camera_params *params, uint64_t rays, struct hg_error *err) HG_MUST_CHECK;

#endif
