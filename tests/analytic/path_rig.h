// path_rig.h - views of HG_MODE_PATH over the scenes of rig.h, and a room that has a bit of all.
// Failures end the test with the reason.
#ifndef HG_TESTS_ANALYTIC_PATH_RIG_H
#define HG_TESTS_ANALYTIC_PATH_RIG_H

#include "renderer/scene/scene.h"
#include "tests/analytic/rig.h"

// A view of the scene as it stands now, that only settled pictures are wanted of.
struct hg_view *path_rig_view(struct rig *rig, const struct hg_view_params *params);
struct hg_view_report path_rig_report(const struct hg_view *view); // renderer/internal.h
// Up is +y, or +z when looking straight up or down.
void path_rig_look(struct hg_view *view, const float eye[3], const float target[3], float vfov_rad);
void path_rig_set_camera(struct hg_view *view, const struct hg_view_camera *camera);
void path_rig_settle(struct hg_view *view);
void path_rig_steps(struct hg_view *view, int steps); // fewer if it settles
// Free with hg_refbuf_unref.
struct hg_refbuf *path_rig_plane(struct hg_view *view, enum hg_plane plane);

// Means of the green channel of a picture as linear light, of squares of `cell` px, in rows.
// cells [width / cell * (height / cell)].
void path_rig_cells(struct hg_view *view, int width, int height, int cell, float *cells);
void path_rig_environment(struct rig *rig, float radiance); // the same from everywhere
// Base without any specular part: exactly Lambert.
struct hg_material *path_rig_lambert(struct rig *rig, float albedo);
// A square in y = 0 that faces up.
void path_rig_floor(struct rig *rig, struct hg_material *m, float half);
// A closed box; normals lead out.
void path_rig_box(struct rig *rig, struct hg_material *m, const float low[3], const float high[3]);
// Floor, mirror-like wall, sphere, lamp that shines to both sides, dim environment.
void path_rig_room(struct rig *rig);

struct hg_asset *path_rig_asset(struct rig *rig); // with the animation of the scene
// The scene's animation: linear keys of a node at 0, 1, ... seconds.
void path_rig_animate(struct rig *rig, struct hg_node *node, enum hg_anim_path path, uint32_t keys,
    const float *values);
void path_rig_pose(struct rig *rig, double time_s);

#endif
