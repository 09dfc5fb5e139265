// lighting.h - everything that lights one view: punctual lights in clusters, shadow maps, and the
// environment.
// Floor 2 (light). Thread: the render thread; heavy work is spread over `jobs`.
//
// Positions are relative to the origin of the geometry room (geometry.h), which the caller passes.
// What did not change is kept: the environment is prefiltered once per content (and kept on disk),
// shadow maps are drawn again only when their light, their projection or the casters changed.
#ifndef HG_RENDERER_LIGHT_LIGHTING_H
#define HG_RENDERER_LIGHT_LIGHTING_H

#include "base/jobs.h"
#include "renderer/gpu/gpu.h"
#include "renderer/math/box.h"
#include "renderer/scene/scene.h"
#include "base/store/store.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/light.h"

struct hg_lighting;

// What the views of one scene share: the environment, prefiltered, tables of albedo, and the
// atlases of shadow maps (shadow/shadow_atlas.h). sky: the last one drawn for any scene, borrowed,
// must outlive it; NULL: one of its own. HG_E_NOMEM, device errors.
struct hg_light_shared;
struct hg_sky_cache;
enum hg_status hg_light_shared_create(struct hg_gpu *gpu, struct hg_sky_cache *sky,
    struct hg_light_shared **out, struct hg_error *err) HG_MUST_CHECK;
void hg_light_shared_destroy(struct hg_light_shared *shared); // accepts NULL
// The one that it was created with; borrowed.
struct hg_sky_cache *hg_light_shared_sky(struct hg_light_shared *shared);

struct hg_lighting_params {   // zero of each field = default
    struct hg_light_shared *shared; // borrowed, must outlive it; NULL: it shares with none
    struct hg_store *store;   // prefiltered environments; borrowed; NULL = none
    uint32_t shadow_atlas_px; // side of the depth atlas, a power of two; default 4096
};

// The environment is a black 1x1 map and the atlas is empty until the first sync.
// HG_E_NOMEM, HG_E_LIMIT, device errors. gpu and jobs are borrowed and must outlive it.
enum hg_status hg_lighting_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    const struct hg_lighting_params *params, struct hg_lighting **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_lighting_destroy(struct hg_lighting *lighting); // accepts NULL

enum hg_shadow_paging {
    HG_PAGING_OFF,
    HG_PAGING_AUTO, // where much of what is seen is nearer than the texels of its whole map are for
    HG_PAGING_ON,
};

// What a view looks at.
struct hg_lighting_view {
    const struct hg_scene *scene;       // hg_scene_update was called
    const struct hg_gpu_camera *camera; // relative to origin; jitter does not matter
    uint32_t width, height;             // px
    double origin[3];                   // hg_geometry_origin
    uint64_t shape_revision;            // hg_geometry_shape_revision, or hg_geometry_revision when
                                        // textures of masked materials may have changed
    // Where casters moved since a revision, [*count], relative to origin; false: anywhere. NULL:
    // always anywhere.
    bool (*moved_since)(
        const void *shapes, uint64_t revision, const struct hg_box **moved, uint32_t *count);
    const void *shapes; // passed to it
    bool moves; // of many lamps maps may be left for later, and lists be short
    bool keeps; // maps are drawn over several steps: no other view may draw to their atlas
    bool once;  // they are for one picture at most: nothing is kept for the next step
    enum hg_shadow_paging paging;       // of a sun without a size, in place of finer cascades
    bool has_bounds;                    // hg_geometry_bounds returned true
    float bounds_min[3], bounds_max[3]; // relative to origin
    bool has_ground;                    // shadows are also looked up on a plane below the scene
    float ground_up[3], ground_height;  // unit; of its points along ground_up, relative to origin
};

// Brings lights, clusters, environment and the plan of shadow maps in line with the view. Call once
// per step, after hg_geometry_sync and before hg_gpu_begin. Uploads are recorded in front of the
// next batch. On error the state before stays. HG_E_NOMEM, HG_E_LIMIT, device errors.
enum hg_status hg_lighting_sync(struct hg_lighting *lighting, const struct hg_lighting_view *view,
    struct hg_error *err) HG_MUST_CHECK;

// The block of the frame. sample_index: of the accumulation, turns the shadow filter.
void hg_lighting_fill(
    const struct hg_lighting *lighting, uint32_t sample_index, struct hg_gpu_lighting *out);

// Its maps are complete, or no longer wanted: other views may draw to its atlas until the next
// sync.
void hg_lighting_rest(struct hg_lighting *lighting);
// Maps that were drawn over several steps are gone since the newest sync: another view took their
// place.
bool hg_lighting_is_lost(const struct hg_lighting *lighting);

// Bytes of the table of shadow maps, with that of pages.
uint64_t hg_lighting_shadow_table_bytes(const struct hg_lighting *lighting);

// Images for HG_BIND_ENV_SPECULAR, HG_BIND_ENV_RADIANCE and HG_BIND_SHADOW; never NULL.
// HG_BIND_DFG and HG_BIND_SHADOW_CMP are not used.
struct hg_gpu_image *hg_lighting_image_specular(struct hg_lighting *lighting);
struct hg_gpu_image *hg_lighting_image_radiance(struct hg_lighting *lighting);
struct hg_gpu_image *hg_lighting_image_shadow(struct hg_lighting *lighting);

struct hg_shadow_rect {
    uint32_t x0, y0, x1, y1; // texels of the atlas, x1 and y1 past the end
};

// One square of the atlas (passes/shadow.h draws them).
struct hg_shadow_map {
    struct hg_gpu_shadow gpu;
    float view_proj[16]; // column-major, Vulkan clip space, reversed depth; near planes kept
    bool stale;          // to be drawn in this step
    bool partly;         // stale: in `dirty` alone
    bool touched;        // it was drawn to since the newest sync
    bool own;            // coarser than other views may use it
    struct hg_shadow_rect dirty;
    bool refines;        // a finer cascade of a map that holds the whole scene
    bool deferred;       // not drawn in this step: for want of time, or out of sight
};
// Maps of the newest plan, in the order of hg_gpu_lighting.shadows, then pages that are due. Valid
// until the next sync.
struct hg_shadow_map *hg_lighting_shadow_maps(struct hg_lighting *lighting, uint32_t *count);
// Finer cascades of directional lights are stale, and drawing them takes a while.
bool hg_lighting_needs_cascades(struct hg_lighting *lighting);

// What the view showed: surfaces there ask for the pages of the next picture. Without pages nothing
// happens. camera: as it drew the picture, relative to the origin of the newest sync.
struct hg_shadow_depth {
    const float *rows; // [height][width], reversed; 0: nothing is there
    uint32_t width, height;
};
void hg_lighting_see(struct hg_lighting *lighting, const struct hg_gpu_camera *camera,
    const struct hg_shadow_depth *depth);
// The sun of the newest sync has pages.
bool hg_lighting_has_pages(const struct hg_lighting *lighting);
// All pages are to be drawn again; until then the map of the whole scene is used.
void hg_lighting_forget_pages(struct hg_lighting *lighting);
// RGBA of what a pixel of such a picture shows: the level of its page, from the coarsest on in the
// colours of mips, every other page darker; pale where it waits for a finer one; grey the map of
// the whole scene.
void hg_lighting_page_color(const struct hg_lighting *lighting, const struct hg_gpu_camera *camera,
    const struct hg_shadow_depth *depth, const uint32_t pixel[2], uint8_t out[4]);

// Changes whenever maps of the plan were drawn or it holds others; the pass that draws them notes
// that. Never 0 after it did.
uint64_t hg_lighting_atlas_revision(const struct hg_lighting *lighting);
void hg_lighting_note_drawn(struct hg_lighting *lighting);

// What lights rays that are shaded on the host, as of the newest sync: lights of the scene, among
// them a sky's sun, and the environment without it.
struct hg_lighting_sources {
    const struct hg_gpu_light *lights; // [count], those of kind DIRECTIONAL first
    const bool *casts;                 // [count]
    const uint32_t *tables;            // that their profiles and images are in
    uint32_t count, directional_count;
    uint32_t env_kind;  // HG_ENV_KIND_*
    float env_color[3]; // as of hg_gpu_lighting
    float env_rotation_cos, env_rotation_sin;
    const float
        *env_faces; // IMAGE: [6][env_side^2][3], in Vulkan's order of faces, rows from the top
    uint32_t env_side;
    const struct hg_vec4 *env_irradiance; // IMAGE: [(HG_IRRADIANCE_SIZE + 2)^2] as shaders have it
};
void hg_lighting_sources(const struct hg_lighting *lighting, struct hg_lighting_sources *out);

// Lamps without a size that ask for shadows, as of the newest sync.
uint32_t hg_lighting_shadowed_lamps(const struct hg_lighting *lighting);

// The sky brings a sun, which is the first light.
bool hg_lighting_has_sky_sun(const struct hg_lighting *lighting);

struct hg_shadow_page_stats {
    uint32_t room;  // pages that the pool has
    uint32_t held;  // of them, with pages of this picture
    uint32_t asked; // pages that surfaces of the picture before asked for
    uint32_t hits;  // of them, held already
    uint32_t drawn; // in this picture
    uint32_t evicted;
};

struct hg_lighting_stats {
    uint32_t lights, shadowed_lights;
    uint32_t local_lights;      // all but directional ones
    uint32_t sized_lights;      // that have a size
    uint32_t tabled_lights;     // that have a profile or an image
    uint32_t unshadowed_lights; // ask for a shadow but found no room in the atlas
    uint32_t shadow_maps, shadow_maps_stale;
    uint32_t shadow_maps_partly;        // of them, drawn again where casters moved alone
    uint32_t shadow_maps_deferred;      // left for later, their lamps have no shadow meanwhile
    uint32_t shadow_maps_unseen;        // not drawn: nothing in sight is shadowed by them
    uint32_t clusters, cluster_entries; // 0 when all lights are looped over
    bool hasty;               // lists are shorter than at rest, or maps were left for later
    uint32_t lights_in_lists; // `lights`, or fewer that stand for all (light_cut.h)
    uint64_t environment_ns;            // of the newest prefilter, 0 = from memory
    bool environment_cached;            // it came from the disk
    uint64_t device_bytes, atlas_bytes; // atlas: of it, all atlases of the scene
    struct hg_shadow_page_stats pages;
};
void hg_lighting_stats(const struct hg_lighting *lighting, struct hg_lighting_stats *out);

#endif
