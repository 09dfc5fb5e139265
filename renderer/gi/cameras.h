// cameras.h - the finer grids of the cameras drawn last, of the settled and the dynamic field.
// Floor 2, private to renderer/gi. Thread: the render thread.
//
// Settled grids are built from coarse to fine once the whole scene's is complete, each lit by
// itself and coarser ones, so their bytes depend on the scene and the camera alone. Dynamic grids
// follow the camera: probes that stay keep their light, new ones begin with that of the coarser
// grids. Placing a grid takes hundreds of thousands of rays, so new grids are placed over several
// pictures, while the camera still has the old ones.
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
    struct hg_gi_finer settled, dynamic;
    struct hg_gi_finer next; // replaces `dynamic` once its probes have been relocated
    bool has_next;
    uint32_t turn; // of the dynamic grids: which one is updated next
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
// The grids of all cameras of one field.
void hg_gi_cameras_drop_settled(struct hg_gi_cameras *cameras, struct hg_gpu *gpu);
void hg_gi_cameras_drop_dynamic(struct hg_gi_cameras *cameras, struct hg_gpu *gpu);

struct hg_gi_camera_params {
    struct hg_gi_waves *waves; // in line with the key
    const struct hg_lighting_sources *sources;
    struct hg_gi_build *whole; // the grid over the whole scene
    bool is_settled;           // `whole` is the settled field's, and complete
    bool moves_on;             // as of HG_GI_MOVES
    bool on_lattice;           // the settled field's grids have the same lattice as `whole`
    const struct hg_gi_key *key;
    const struct hg_gi_eye *eye;
};

bool hg_gi_camera_is_settled(
    const struct hg_gi_camera *camera, const struct hg_gi_key *key, const struct hg_gi_eye *eye);
// The next waves of the settled field, about *rays of them. After an error there are no grids.
// HG_E_NOMEM, device errors.
enum hg_status hg_gi_camera_settle(struct hg_gi_camera *camera,
    const struct hg_gi_camera_params *params, uint64_t *rays, struct hg_error *err) HG_MUST_CHECK;
// Whether the dynamic grids need no rays for the next picture.
bool hg_gi_camera_is_still(
    const struct hg_gi_camera *camera, const struct hg_gi_key *key, const struct hg_gi_eye *eye);
// About `rays` rays for the dynamic grids, and for `whole` unless that is settled. Where the
// settled grids are those that the camera needs, they become the camera's and
// hg_gi_camera_is_settled holds. camera NULL: one without finer grids. Errors as above.
enum hg_status hg_gi_camera_update(struct hg_gi_camera *camera,
    const struct hg_gi_camera_params *params, uint64_t rays, struct hg_error *err) HG_MUST_CHECK;

#endif
