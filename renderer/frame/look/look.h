// look.h - how one view shows its scene: clipping planes, and nodes that it hides, tints, selects,
// sees through or shows with the materials of another variant.
// Floor 4. Thread: the render thread. Declared to callers in renderer/view_look.h.
//
// All of it changes what the camera of the view sees. Shadows, reflections and global illumination
// are those of the whole scene, which views share. A view without any of it has no struct hg_look,
// and draws with the tables of the scene.
#ifndef HG_RENDERER_FRAME_LOOK_LOOK_H
#define HG_RENDERER_FRAME_LOOK_LOOK_H

#include "base/bytes.h"
#include "renderer/frame/look/look_params.h"
#include "renderer/geometry/view_tables.h"
#include "renderer/scene_gpu/scene_gpu.h"

struct hg_overlay;

struct hg_look_variant {
    uint32_t asset;
    char *name; // "": the file's own materials
};

struct hg_look_key {
    uint64_t look, scene, geometry, draws;
};

struct hg_look {
    struct hg_clip clip;
    struct hg_node_look *nodes; // by id
    size_t node_capacity;
    uint32_t node_count;
    float select_color[3];
    struct hg_look_variant *variants;
    size_t variant_capacity;
    uint32_t variant_count;
    uint32_t layers;   // that are shown, a bit each; 0 = all
    uint64_t revision; // of all of these

    // Made of these for the geometry as it is.
    struct hg_look_key key;
    struct hg_view_tables tables;
    uint8_t *selected; // [draws] 1: has the outline
    size_t selected_capacity;
    bool selects;               // some draw is selected
    struct hg_overlay *overlay; // overlay.h; NULL: none yet
};

void hg_overlay_destroy(struct hg_overlay *overlay); // accepts NULL

// Zeroed but for defaults. HG_E_NOMEM.
enum hg_status hg_look_create(struct hg_look **out) HG_MUST_CHECK;
void hg_look_destroy(struct hg_gpu *gpu, struct hg_look *look); // accepts NULL

// Overrides that are set, in the order of ids; all of `items` or none. HG_E_LIMIT: more than
// HG_LOOK_MOST_NODES nodes. HG_E_NOMEM.
enum hg_status hg_look_set_nodes(struct hg_look *look, const struct hg_node_look *items,
    uint32_t count, bool clear, struct hg_error *err) HG_MUST_CHECK;
// name NULL: as the scene. HG_E_NOMEM.
enum hg_status hg_look_set_variant(
    struct hg_look *look, uint32_t asset, const char *name, struct hg_error *err) HG_MUST_CHECK;

// Tables for the geometry as it was synced last; nothing happens when they are. HG_E_NOMEM, device
// errors.
enum hg_status hg_look_sync(
    struct hg_look *look, const struct hg_scene_gpu *scene_gpu, struct hg_error *err) HG_MUST_CHECK;
// [draws] as the view shows them; NULL: as the scene has them. look may be NULL.
const struct hg_gpu_draw *hg_look_draws(const struct hg_look *look);
// It draws surfaces in layers that the scene does not.
bool hg_look_sees_through(const struct hg_look *look);
bool hg_look_clips(const struct hg_look *look);

// Writes what settled pictures depend on, the same for equal looks of equal scenes; nothing for
// NULL. HG_E_NOMEM.
enum hg_status hg_look_write_key(
    const struct hg_look *look, const struct hg_scene *scene, struct hg_writer *w) HG_MUST_CHECK;

#endif
