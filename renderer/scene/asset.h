// asset.h - building assets: what every loader needs to make objects, charge memory and warn.
// Floor 2, private to scene/. One thread per asset. All memory is heap memory that
// hg_asset_destroy frees; a loader that fails just destroys the asset.
#ifndef HG_RENDERER_SCENE_ASSET_H
#define HG_RENDERER_SCENE_ASSET_H

#include "renderer/scene/load.h"

enum { HG_ASSET_MAX_WARNINGS = 64 };

// A zeroed asset. NULL: no memory.
struct hg_asset *hg_asset_create(uint32_t number, const char *label) HG_MUST_CHECK;
// Appends a warning; after HG_ASSET_MAX_WARNINGS they are only counted in the last one.
// `where` may be NULL. Running out of memory drops the warning.
void hg_asset_warn(struct hg_asset *asset, const char *where, const char *fmt, ...) HG_PRINTF(3, 4);
void hg_asset_warn_text(struct hg_asset *asset, const char *where, const char *reason);

// Makes the names of all objects UTF-8: once nothing is looked up by those of the file any more.
// False: no memory.
bool hg_asset_make_names_utf8(struct hg_asset *asset) HG_MUST_CHECK;

// Appends a zeroed object with its kind's defaults; its id is asset number << 32 | index. `name`
// may be NULL. NULL: no memory.
struct hg_node *hg_asset_add_node(struct hg_asset *asset, const char *name) HG_MUST_CHECK;
struct hg_mesh *hg_asset_add_mesh(struct hg_asset *asset, const char *name) HG_MUST_CHECK;
struct hg_material *hg_asset_add_material(struct hg_asset *asset, const char *name) HG_MUST_CHECK;
struct hg_texture *hg_asset_add_texture(struct hg_asset *asset, const char *name) HG_MUST_CHECK;
struct hg_light *hg_asset_add_light(struct hg_asset *asset, const char *name) HG_MUST_CHECK;
struct hg_camera *hg_asset_add_camera(struct hg_asset *asset, const char *name) HG_MUST_CHECK;
struct hg_skin *hg_asset_add_skin(struct hg_asset *asset) HG_MUST_CHECK;

// Moves the roots of an asset with an origin, which is about to be added to a scene, to where it
// belongs beside the first one there that has one: tiles of a survey fit together.
void hg_asset_align_origin(const struct hg_scene *scene, struct hg_asset *asset);
// Keeps what animations will change as it is now (hg_anim_channel.rest), and finds those that move
// the same things (hg_animation.conflicts). HG_E_NOMEM.
enum hg_status hg_asset_keep_rest(struct hg_asset *asset) HG_MUST_CHECK;
// Links child as the last child of parent. The caller has ruled out cycles.
void hg_node_append_child(struct hg_node *parent, struct hg_node *child);
// Puts one more node, behind those of the file, above the roots. HG_E_NOMEM.
enum hg_status hg_asset_transform_roots(
    struct hg_asset *asset, const float matrix[16]) HG_MUST_CHECK;
// Bounds of the chosen scene of an asset that need not be in a hg_scene; skins as modelled.
// False when there is no geometry.
bool hg_asset_bounds(const struct hg_asset *asset, float min[3], float max[3]);
// Memory of objects, arrays and encoded images that are not spilled (base/spill.h).
uint64_t hg_asset_resident_bytes(const struct hg_asset *asset);
// Defaults of a zeroed object.
void hg_node_set_defaults(struct hg_node *node);
void hg_light_set_defaults(struct hg_light *light);
void hg_camera_set_defaults(struct hg_camera *camera);
// Frees an object of a kind and what it owns (textures drop their image reference).
void hg_object_destroy(enum hg_object_kind kind, struct hg_object *object);

// A new image source with one reference; NULL: no memory.
struct hg_image_source *hg_image_source_create(const char *label) HG_MUST_CHECK;
struct hg_image_source *hg_image_source_ref(struct hg_image_source *source);
void hg_image_source_unref(struct hg_image_source *source); // accepts NULL

// Frees the arrays of a part; accepts a zeroed part.
void hg_mesh_part_finish(struct hg_mesh_part *part, uint32_t target_count);
// Recomputes bounds of positions, morph targets at full weight included.
void hg_mesh_part_update_bounds(struct hg_mesh_part *part, uint32_t target_count);
// Rebuilds all vertex arrays so that vertex i is a copy of old vertex source[i]; indices are the
// caller's. HG_E_NOMEM leaves a part that can only be finished.
enum hg_status hg_mesh_part_remap(struct hg_mesh_part *part, uint32_t target_count,
    const uint32_t *source, uint32_t count) HG_MUST_CHECK;

#endif
