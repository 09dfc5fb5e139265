// rays.h - rays of a scene: structures that its views and passes share.
// Floor 2 (trace). Thread: the render thread.
//
// A scene has one service. Users take a reference to structures by a key: the backend and the level
// of detail (a lens). Users with the same key share structures. Passes use the default key: one
// level of detail of the scene, independent of cameras, and only moved bodies are rebuilt.
// Path-traced pictures use an exact key with their own camera, so that they do not depend on other
// views
// (docs/decisions/0020-rays-of-a-scene.md).
//
// Between two submissions: hg_rays_sync, then waves (hg_trace_closest and hg_trace_blocked of
// hg_rays_trace), on all backends alike. A sync may evict what culling sets of views were to draw:
// it comes before culling.
#ifndef HG_RENDERER_TRACE_RAYS_H
#define HG_RENDERER_TRACE_RAYS_H

#include "renderer/trace/trace.h"

struct hg_rays;       // of a scene
struct hg_rays_scene; // structures of one key

struct hg_rays_params {
    struct hg_jobs *jobs;
    uint64_t budget_bytes; // of structures of one key; 0 = unlimited
};

// HG_E_NOMEM. Everything is borrowed; it goes after all references and before the geometry.
enum hg_status hg_rays_create(struct hg_gpu *gpu, struct hg_geometry *geometry,
    const struct hg_rays_params *params, struct hg_rays **out, struct hg_error *err) HG_MUST_CHECK;
void hg_rays_destroy(struct hg_rays *rays); // accepts NULL

struct hg_rays_key {
    enum hg_trace_backend backend;
    // Hits depend on the geometry, backend and lens alone. Else which triangle is named of several
    // at the same distance depends on what moved before, and a move rebuilds only that.
    bool exact;
    const void *owner; // of poses other than the scene's, which are not shared; NULL = the scene's
    struct hg_ray_geometry_lens lens;
};

// For passes: as fine as the scene is in a picture of 2048 px of all of it, from anywhere. wait:
// for geometry that is not resident (at rest); else coarser levels stand in.
struct hg_rays_key hg_rays_default_key(
    const struct hg_rays *rays, enum hg_trace_backend backend, bool wait);

// *scene: a reference to structures of that key. What it was (NULL: none) is kept where it has that
// key, gets it where there is no other reference, and is let go otherwise. HG_E_NOMEM, HG_E_DEVICE:
// no such backend; then *scene is NULL.
enum hg_status hg_rays_ref(struct hg_rays *rays, const struct hg_rays_key *key,
    struct hg_rays_scene **scene, struct hg_error *err) HG_MUST_CHECK;
void hg_rays_unref(struct hg_rays_scene *scene); // accepts NULL

// Brings structures in line with the geometry, which is synced and posed; loads what the key waits
// for. Statuses as of hg_ray_geometry_make and hg_trace_sync.
enum hg_status hg_rays_sync(struct hg_rays_scene *scene, struct hg_error *err) HG_MUST_CHECK;
// hg_ray_geometry_open_shutter for keys with an owner and motion.
enum hg_status hg_rays_open_shutter(
    struct hg_rays_scene *scene, struct hg_error *err) HG_MUST_CHECK;

const struct hg_ray_geometry *hg_rays_geometry(const struct hg_rays_scene *scene);
struct hg_trace *hg_rays_trace(struct hg_rays_scene *scene);

struct hg_rays_stats {
    uint32_t scenes, references;
};
void hg_rays_stats(const struct hg_rays *rays, struct hg_rays_stats *out);

#endif
