// scene_gpu.h - what the device holds of one scene, shared by its views: textures, geometry, light.
// Floor 2 (scene_gpu). Thread: the render thread.
#ifndef HG_RENDERER_SCENE_GPU_SCENE_GPU_H
#define HG_RENDERER_SCENE_GPU_SCENE_GPU_H

#include "base/jobs.h"
#include "renderer/camera/camera.h"
#include "renderer/geometry/geometry.h"
#include "renderer/gi/gi.h"
#include "renderer/irradiance/irradiance.h"
#include "renderer/reflect/cache.h"
#include "renderer/gpu/gpu.h"
#include "renderer/gpu/readback.h"
#include "renderer/light/env/sky_cache.h"
#include "renderer/light/lighting.h"
#include "renderer/scene/scene.h"
#include "renderer/scene_gpu/debug_overrides.h"
#include "base/store/store.h"
#include "renderer/texture/cache/page_cache.h"
#include "renderer/texture/textures.h"
#include "renderer/trace/rays.h"

// What views need of their renderer.
struct hg_frame_context {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    const char *cache_dir;                                                   // NULL = none
    uint64_t texture_budget_bytes, geometry_budget_bytes, host_budget_bytes; // 0 = unlimited
    struct hg_store *store;         // page packs and cluster files on disk; NULL = none
    struct hg_page_cache *pages;    // of all scenes; made on first use
    struct hg_sky_cache sky;        // the last one drawn, for any of them
    struct hg_scene_gpu *scene_gpu; // list of all scenes in use
    struct hg_gpu_lent *lent;       // pixels of views that are gone, which are still read
    uint32_t bake_from;             // as of struct hg_geometry_params
    struct hg_debug_overrides overrides;
};

// A view whose paths take memory while it rests (frame/paths/path_lease.h).
enum { HG_PATH_LEASES = 2 };
struct hg_view_state;
struct hg_path_lease {
    struct hg_view_state *view; // NULL: free
    uint64_t used_ns;           // newest step
};

struct hg_scene_gpu {
    struct hg_scene_gpu *next;
    struct hg_scene *scene;
    uint32_t refs;
    uint32_t features;          // HG_FEATURE_* of its materials and meshes
    uint32_t mixes;             // HG_MIX_* of its materials
    bool has_holes;             // some surface that is drawn in layers is not there everywhere
    uint64_t scene_revision;    // brought to the device, UINT64_MAX = none
    uint64_t shown_revision;    // of the geometry when it last showed something new
    uint64_t geometry_revision; // of that and the origin: a view whose own comes back goes on
    const void *posed;          // the owner of a pose other than the scene's; NULL: none
    struct hg_textures *textures;
    struct hg_geometry *geometry;
    struct hg_rays *rays; // of its views and passes
    struct hg_light_shared *light;
    struct hg_gi *gi;     // made on first use; NULL: none yet
    struct hg_irradiance *irradiance;   // the same
    struct hg_radiance_cache *radiance; // the same
    struct hg_path_lease leases[HG_PATH_LEASES];
};

// Takes a reference to what the device holds of the scene, which is made by the first one.
enum hg_status hg_scene_gpu_ref(struct hg_frame_context *context, struct hg_scene *scene,
    struct hg_scene_gpu **out, struct hg_error *err) HG_MUST_CHECK;
void hg_scene_gpu_unref(
    struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu); // accepts NULL

// Frees what scenes shared: after the last hg_scene_gpu_unref, before the device is destroyed.
// Accepts a zeroed context.
void hg_frame_context_finish(struct hg_frame_context *context);

// Syncs textures and geometry with the scene; no batch may be open. Nothing happens when
// the scene's revision is known already and nothing came in from threads. eye_ws: scene space.
// Waits for levels of detail that are being made, at most until that time of hg_clock_now_ns; 0 =
// does not.
enum hg_status hg_scene_gpu_sync(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu,
    const double eye_ws[3], uint64_t until_ns, struct hg_error *err) HG_MUST_CHECK;

// The geometry shows another time of the scene until the next sync, which puts things back; that is
// no change of geometry_revision. hg_scene_update was called in the pose; `who` is only compared.
enum hg_status hg_scene_gpu_pose(
    struct hg_scene_gpu *scene_gpu, const void *who, struct hg_error *err) HG_MUST_CHECK;
// Whether it is still posed for `who`, and a sync would find nothing else to do.
bool hg_scene_gpu_is_posed(const struct hg_scene_gpu *scene_gpu, const void *who);

// A camera for a picture of that size, relative to the geometry's origin, its depth fitted to what
// the geometry shows now; no jitter.
struct hg_camera_setup hg_scene_gpu_camera(const struct hg_scene_gpu *scene_gpu,
    const struct hg_view_camera_state *camera, uint32_t width, uint32_t height);

#endif
