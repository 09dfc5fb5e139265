// view_look.h - how a view shows its scene, and what it shows at pixels. Part of the facade.
// Floor 5. Thread: the render thread.
//
// Views of one scene share its geometry, textures, shadows and light, and each has a look of its
// own: nodes that it hides, tints, selects or sees through, layers, material variants and clipping
// planes. All of that changes what the camera sees, in both modes, and nothing else: shadows,
// reflections and global illumination are those of the whole scene. Members:
// renderer/frame/look/look_params.h. Why: docs/decisions/0031-looks-of-views.md.
#ifndef HG_RENDERER_VIEW_LOOK_H
#define HG_RENDERER_VIEW_LOOK_H

#include "renderer/frame/look/look_params.h"
#include "renderer/renderer.h"

// Planes in place of those before; normals of any length but 0. HG_E_INVAL names the member that is
// not finite, or outside of its range; HG_E_NOMEM. On error the old ones stay.
enum hg_status hg_view_set_clip(
    struct hg_view *view, const struct hg_clip *clip, struct hg_error *err) HG_MUST_CHECK;
// Adds to the overrides of the view, or with `clear` takes their place. select_color: [3] of what
// is selected, NULL: as before. HG_E_INVAL, HG_E_LIMIT, HG_E_NOMEM: nothing changes.
struct hg_view_overrides {
    const struct hg_node_look *items;
    uint32_t count;
    bool clear;
    const float *select_color;
};
enum hg_status hg_view_set_overrides(struct hg_view *view,
    const struct hg_view_overrides *overrides, struct hg_error *err) HG_MUST_CHECK;
// Material variant of an asset; "" the file's own materials, NULL as the scene. HG_E_NOMEM.
enum hg_status hg_view_set_variant(
    struct hg_view *view, uint32_t asset, const char *name, struct hg_error *err) HG_MUST_CHECK;
// What of it settled pictures depend on; nothing for a view that shows the scene as it is.
enum hg_status hg_view_write_look(
    const struct hg_view *view, const struct hg_scene *scene, struct hg_writer *w) HG_MUST_CHECK;

// What one pixel shows.
struct hg_surface_point {
    uint64_t node, material;      // 0: nothing is there, or the default material
    float depth;                  // along the view direction, metres; infinite: nothing
    float normal[3], position[3]; // world space; normal towards the eye
};

// The surfaces at the pixels of a rectangle in the newest step (unjittered sample of the same
// state): `row` gets rows of `width` points from the top. HG_E_INVAL: it is not inside of the
// picture; HG_E_STATE: nothing was rendered yet; HG_E_NOMEM.
struct hg_surface_rect {
    uint32_t x, y, width, height; // px, width and height > 0
    void (*row)(void *user, uint32_t y, const struct hg_surface_point *points);
    void *user;
};
enum hg_status hg_view_surfaces(
    struct hg_view *view, const struct hg_surface_rect *rect, struct hg_error *err) HG_MUST_CHECK;
// The surfaces at the centres of equal cells of the picture, likewise: costs as much as a rectangle
// of so many pixels. HG_E_INVAL: more columns or rows than it has pixels, or none.
struct hg_surface_grid {
    uint32_t columns, rows;
    void (*row)(void *user, uint32_t y, const struct hg_surface_point *points); // [columns]
    void *user;
};
enum hg_status hg_view_surface_grid(
    struct hg_view *view, const struct hg_surface_grid *grid, struct hg_error *err) HG_MUST_CHECK;
uint64_t hg_view_shown_revision(const struct hg_view *view); // of the scene, in the newest step

#endif
