// geometry.h - meshes, instances, materials and draws of a scene on the device.
// Floor 2 (geometry). Thread: the render thread.
//
// Parts are uploaded once and kept by {mesh id, revision}; instances, draws and materials are small
// tables that are compared with what the device has, and only ranges that differ are written.
// Skinned and morphed parts have output streams of their own per node; passes/skin.h fills them
// when their pose changed.
//
// Large worlds: node matrices are multiplied in the scene; here each instance's translation is
// taken relative to an origin in double precision before it becomes float. The origin is 0 until
// hg_geometry_set_origin is called, and moves in steps of HG_GEOMETRY_ORIGIN_STEP, so that nothing
// is written while the eye stays in one cell. Camera, lights and shadow matrices must be relative
// to the same origin. Shaders subtract the eye before they project (lib/vertex.glsl).
#ifndef HG_RENDERER_GEOMETRY_GEOMETRY_H
#define HG_RENDERER_GEOMETRY_GEOMETRY_H

#include "renderer/math/box.h"
#include "base/jobs.h"
#include "base/store/store.h"
#include "renderer/cluster/cluster_pool_stats.h"
#include "renderer/gpu/gpu.h"
#include "renderer/scene/scene.h"
#include "renderer/texture/textures.h"
#include "shaders/shared/geometry.h"

#define HG_GEOMETRY_ORIGIN_STEP 4096.0 // metres

struct hg_geometry;

#define HG_GEOMETRY_BAKE_NONE UINT32_MAX

struct hg_geometry_params {
    uint64_t budget_bytes; // of vertex, index, deformation and table memory; 0 = unlimited
    // Static parts of many triangles get levels of detail (lod.h), made in the background on jobs
    // and kept in the store. jobs NULL: none do; store NULL: they are kept in host memory.
    struct hg_jobs *jobs;
    struct hg_store *store;
    uint32_t bake_from; // triangles; 0 = the default, HG_GEOMETRY_BAKE_NONE = none
};

struct hg_geometry_stats {
    uint64_t budget_bytes, used_bytes, peak_bytes;
    uint64_t uploaded_bytes;  // by the newest sync
    uint64_t triangles_total; // of all visible instances
    uint32_t draws, instances, parts, materials, deforms;
    uint32_t parts_uploaded, deforms_changed; // by the newest sync
    uint32_t baking, proxies; // parts whose levels are being made; of them shown coarsely
    uint64_t facet_bytes;     // not of the budget, at most 64 MiB
    struct hg_cluster_pool_stats chunks;
};

// HG_E_NOMEM. `gpu` is borrowed and must outlive it.
enum hg_status hg_geometry_create(struct hg_gpu *gpu, const struct hg_geometry_params *params,
    struct hg_geometry **out, struct hg_error *err) HG_MUST_CHECK;
void hg_geometry_destroy(struct hg_geometry *geometry); // accepts NULL

// Moves the origin to the cell of eye_ws (scene space, metres); true when it changed. Cells have an
// overlap of a quarter step, so that an eye on a border does not flip.
bool hg_geometry_set_origin(struct hg_geometry *geometry, const double eye_ws[3]);
void hg_geometry_origin(const struct hg_geometry *geometry, double out[3]);

// Brings the device up to date with the scene (hg_scene_update was called, `textures` are synced).
// HG_E_LIMIT (geometry budget, before memory is taken; what was shown before stays), HG_E_NOMEM,
// device errors. Nothing is written when nothing changed.
enum hg_status hg_geometry_sync(struct hg_geometry *geometry, const struct hg_scene *scene,
    const struct hg_textures *textures, struct hg_error *err) HG_MUST_CHECK;
// In front of each frame: brings in what threads have made. True: sync again. Waits until
// all parts are baked or that time of hg_clock_now_ns has come; 0 = does not, HG_COND_FOREVER.
bool hg_geometry_poll(struct hg_geometry *geometry, uint64_t until_ns);
uint32_t hg_geometry_baking(const struct hg_geometry *geometry); // parts not baked yet
bool hg_geometry_has_levels(const struct hg_geometry *geometry); // of baked parts
// Shadow maps may show other levels than views: of baked parts or of posed ones.
bool hg_geometry_is_simplified(const struct hg_geometry *geometry);
bool hg_geometry_blends(const struct hg_geometry *geometry); // some draw blends or transmits
// All of it is what rays of gathering paths meet first: triangles that are opaque or masked.
bool hg_geometry_is_solid(const struct hg_geometry *geometry);
// Draws that rays do not hit (trace/ray_geometry.h): lines, and points that have no discs. shown:
// as a view has them, NULL: as the scene has.
struct hg_view_tables;
void hg_geometry_untraced(const struct hg_geometry *geometry, const struct hg_view_tables *shown,
    uint32_t *lines, uint32_t *points);
void hg_geometry_fill(const struct hg_geometry *geometry, struct hg_gpu_geometry *out);
void hg_geometry_stats(const struct hg_geometry *geometry, struct hg_geometry_stats *out);
// Grows whenever positions, transforms or visibility changed: cached shadow maps are stale.
uint64_t hg_geometry_shape_revision(const struct hg_geometry *geometry);
// World boxes, relative to the origin, outside of which all shadows are as they were when the shape
// revision was `since`: before and after, of all that moved, came or went. False: they may have
// changed anywhere. Valid until the next sync.
bool hg_geometry_moved_casters(const struct hg_geometry *geometry, uint64_t since,
    const struct hg_box **boxes, uint32_t *count);
// Grows with every change a picture could show (materials too).
uint64_t hg_geometry_revision(const struct hg_geometry *geometry);
// Box of a draw whose material transmits, relative to the origin; false: it does not.
bool hg_geometry_transmits(const struct hg_geometry *geometry, uint32_t draw, struct hg_box *box);
// True when the textures of each material agree in size (one address serves them all).
bool hg_geometry_one_shape(const struct hg_geometry *geometry);
// World bounds of everything drawn, relative to the origin. False when there is nothing.
bool hg_geometry_bounds(const struct hg_geometry *geometry, float min[3], float max[3]);

enum hg_draw_class { HG_DRAW_CLASS_OPAQUE, HG_DRAW_CLASS_MASK, HG_DRAW_CLASS_BLEND };

// --- picking -------------------------------------------------------------------------------------

struct hg_draw_info {
    const struct hg_node *node;
    const struct hg_mesh *mesh;
    const struct hg_material *material; // NULL: default material
    uint32_t part, instance;            // index in the mesh; of the node's instances
};
// False when there is no such draw. Valid until the next sync.
bool hg_geometry_draw_info(
    const struct hg_geometry *geometry, uint32_t draw, struct hg_draw_info *out);

// Primitives of visibility buffers are in the order of the device; the mesh's number of one. Where
// levels of detail are shown there may be none: then the source triangle nearest to `position`
// (relative to the origin), of equally near ones the first. So the number does not depend on what
// level was seen. Cost O(triangles) there, about 10 ms per million.
uint32_t hg_geometry_source_primitive(
    const struct hg_geometry *geometry, uint32_t draw, uint32_t primitive, const float position[3]);

// --- facets (recorded by passes/triangle_cache.h)
// ---------------------------------------------------------

// What shading reads of triangles on CPU devices (shaders/shared/triangle_cache.h): 96 bytes for
// each of at most 466,000. Points of facets are those of vertices but for rounding, and pictures do
// not depend on the budget: so facets are not of it.
struct hg_triangle_cache_job {
    uint32_t draw, first, count; // first: facet of the draw's first triangle
};
// After hg_geometry_sync. wanted: all draws are triangles without second uv sets and colours.
// Device errors.
enum hg_status hg_geometry_sync_triangle_cache(
    struct hg_geometry *geometry, bool wanted, struct hg_error *err) HG_MUST_CHECK;
// For HG_BIND_TRIANGLE_CACHE and HG_BIND_TEXELS; false: there are none.
bool hg_geometry_triangle_cache(const struct hg_geometry *geometry, struct hg_gpu_uniform *first,
    const struct hg_gpu_buffer **facets);
// Draws whose facets are not up to date.
uint32_t hg_geometry_facet_jobs(
    const struct hg_geometry *geometry, const struct hg_triangle_cache_job **jobs);
// Call when they were recorded into a batch that was submitted.
void hg_geometry_triangle_cache_done(struct hg_geometry *geometry);

// --- deformation (recorded by passes/skin.h) -----------------------------------------------------

// Deforms whose pose changed since they were last recorded; jobs are structs hg_gpu_deform at
// address + 256-byte stride.
struct hg_deform_job {
    VkDeviceAddress address;
    uint32_t vertex_count;
};
uint32_t hg_geometry_deform_count(const struct hg_geometry *geometry);
struct hg_deform_job hg_geometry_deform(const struct hg_geometry *geometry, uint32_t index);
// Call when they were recorded into a batch that was submitted.
void hg_geometry_deforms_done(struct hg_geometry *geometry);

#endif
