// extent.h - where the geometry of a scene is, beyond its bounds: placed boxes, points, and whether
// a camera of the scene sees any of it.
// Floor 2. World space, metres. All calls follow hg_scene_update; the scene is only read.
#ifndef HG_RENDERER_SCENE_EXTENT_H
#define HG_RENDERER_SCENE_EXTENT_H

#include "renderer/scene/scene.h"

// Boxes that together hold a visible node's mesh as posed: matrix (column-major) times [min, max].
// Instances each have theirs; a skinned part lies in the hull of its boxes under all joints.
// Stops when `visit` returns true, which is then what is returned.
typedef bool hg_extent_box_fn(
    void *user, const float matrix[16], const float min[3], const float max[3]);
bool hg_extent_visit_boxes(const struct hg_node *node, hg_extent_box_fn *visit, void *user);

// Points whose hull is that of the visible geometry of a node's subtree (NULL = all): the vertices
// as posed by skins and morph targets. Of a scene with more than four million of them the remaining
// parts are represented by the corners of their boxes, which encloses them more loosely.
typedef void hg_extent_point_fn(void *user, const float point[3]);
void hg_extent_visit_points(
    const struct hg_scene *scene, const struct hg_node *top, hg_extent_point_fn *visit, void *user);

// Why a node's camera shows nothing in a picture of this aspect (width / height); NULL: some of the
// scene's boxes reach into its frustum, or the scene has no geometry at all.
const char *hg_extent_camera_fault(
    const struct hg_scene *scene, const struct hg_node *node, double aspect);

#endif
