// gi.h - diffuse global illumination: fields of irradiance probes of a scene, filled by rays.
// Floor 2 (gi). Thread: the render thread; rays are shaded on jobs.
//
// A field is a grid of probes over the whole scene and, where that is coarse beside what a camera
// sees, finer grids around that (cascades.h) for each of the cameras drawn last.
//
// A scene has two fields:
//   settled  for pictures at rest. Built from empty by a fixed schedule: ray directions follow from
//            the probe's number and the round, waves are the same probes in the same order. Its
//            bytes depend on the scene, its lights and the camera at rest alone, not on threads,
//            the length of steps or earlier pictures.
//   dynamic  for pictures in motion of a scene that changes, under a budget of rays per picture. It
//            never contributes to the settled field.
//
// Source: Majercik et al. 2019, "Dynamic Diffuse Global Illumination with Ray-Traced Irradiance
// Fields". docs/internals/gi.md.
#ifndef HG_RENDERER_GI_GI_H
#define HG_RENDERER_GI_GI_H

#include "base/jobs.h"
#include "renderer/light/lighting.h"
#include "renderer/texture/textures.h"
#include "renderer/trace/rays.h"
#include "shaders/shared/gi.h"

struct hg_gi;

// All borrowed.
struct hg_gi_params {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_geometry *geometry;
    struct hg_textures *textures;
    struct hg_rays *rays;
    uint64_t budget_bytes; // of each field, as of structures of rays; 0 = unlimited
};
// HG_E_NOMEM.
enum hg_status hg_gi_create(
    const struct hg_gi_params *params, struct hg_gi **out, struct hg_error *err) HG_MUST_CHECK;
void hg_gi_destroy(struct hg_gi *gi); // accepts NULL; before the rays

// The state of the scene that a field is built for.
struct hg_gi_key {
    uint64_t scene, environment, geometry; // revisions
};

// A camera, by the rays of its picture (relative to the geometry's origin): from `eye` in the
// direction corner + x across + y down, or when parallel from there in the direction `eye`; x, y in
// 0..1.
struct hg_gi_eye {
    uint64_t view; // whose camera it is
    float eye[3], corner[3], across[3], down[3];
    uint32_t parallel; // 0 or 1
    uint32_t zero;
};

enum hg_gi_field_kind { HG_GI_NO_FIELD, HG_GI_DYNAMIC, HG_GI_SETTLED };

// One slice of building the settled field: about `rays` rays, in whole waves. Call between batches,
// after the scene was synced and posed and before culling, until hg_gi_is_settled. No rays are cast
// while other cameras in use have all places for finer grids. HG_E_LIMIT (budget),
// HG_E_NOMEM, device errors: then there is no settled field.
enum hg_status hg_gi_settle(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_gi_eye *eye, const struct hg_lighting_sources *sources, uint64_t rays,
    struct hg_error *err) HG_MUST_CHECK;
// Brings the dynamic field up to date for the next picture, by about `rays` rays. No rays once all
// probes have been updated often enough since the last change. Grids that the settled field already
// has (the whole scene's, or all that the camera needs) are used instead. Errors as above.
enum hg_status hg_gi_update(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_gi_eye *eye, const struct hg_lighting_sources *sources, uint64_t rays,
    struct hg_error *err) HG_MUST_CHECK;
// Whether the settled field is complete, and is that of the key and the camera.
bool hg_gi_is_settled(
    const struct hg_gi *gi, const struct hg_gi_key *key, const struct hg_gi_eye *eye);
// Marks the view's grids as in use; those unused for longest make room for others.
void hg_gi_touch(struct hg_gi *gi, uint64_t view);

// Fills the block that shaders read: the grids of a field for the view's camera. NO_FIELD: zeroed.
void hg_gi_fill(
    const struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view, struct hg_gpu_probes *out);

// Hits of camera rays (for metering), shaded from means of materials as those of probe rays are.
// Rays are relative to the geometry's origin.
#define HG_GI_MOST_CAMERA_RAYS 4096
struct hg_gi_camera_hit {
    bool hit;                     // the front of a surface; else all others are 0
    float albedo[3], emission[3]; // means of the material
    float light[3];               // irradiance over pi: direct and indirect
};
struct hg_gi_camera_rays {
    enum hg_gi_field_kind field;
    uint64_t view; // whose camera it is
    const struct hg_lighting_sources *sources;
    const struct hg_gpu_ray *rays; // [count]
    uint32_t count;                // <= HG_GI_MOST_CAMERA_RAYS
};
// out: [count]. After hg_gi_settle or hg_gi_update of the picture; without a field nothing is hit.
// HG_E_NOMEM, device errors.
enum hg_status hg_gi_trace_camera(struct hg_gi *gi, const struct hg_gi_camera_rays *camera,
    struct hg_gi_camera_hit *out, struct hg_error *err) HG_MUST_CHECK;

// For passes that send rays of their own: the surfaces they hit, and the light there.
struct hg_host_caster;
struct hg_host_environment;
struct hg_host_surfaces;
struct hg_host_emissive;
struct hg_gi_field;
struct hg_gi_world {
    struct hg_host_caster *caster;                 // caster.h; NULL: there is none
    const struct hg_host_environment *environment; // environment.h
    const struct hg_host_surfaces *surfaces;       // surfaces.h
    const struct hg_host_emissive *emissive;       // emissive.h
    const struct hg_gi_field *whole;       // field.h: the grid over the whole scene
    const struct hg_gi_field *field;       // the finest one of the view, that knows coarser ones
    uint64_t rounds; // updates of all probes of a dynamic field since the last change
    bool moves_on;   // geometry moves from picture to picture, and no emitter with it
};
// When hg_gi_settle and hg_gi_update may be called; borrowed until the geometry is synced.
// HG_E_LIMIT, HG_E_NOMEM, device errors, and without probes: *out is zeroed.
enum hg_status hg_gi_world(struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view,
    struct hg_gi_world *out, struct hg_error *err) HG_MUST_CHECK;

struct hg_gi_grid_stats {
    uint32_t probes, asleep;
    float spacing; // metres
};
struct hg_gi_stats {
    // Of the settled field, or the dynamic one, with the finer grids of the camera drawn last.
    uint32_t probes, asleep;
    uint32_t inside, moved; // asleep inside of something; awake off their place
    uint32_t grid_count;
    struct hg_gi_grid_stats grids[HG_PROBE_GRIDS]; // from coarse to fine
    uint64_t rays, shadow_rays, misses; // since creation
    uint64_t shaded;                    // hits: not while probes are placed, nor backs
    uint64_t updates;                   // of probes
    uint64_t ns, bytes;                 // bytes: of all fields
    uint64_t structure_bytes;           // of what rays meet
};
void hg_gi_stats(const struct hg_gi *gi, struct hg_gi_stats *out); // gi NULL: zeroed

#endif
