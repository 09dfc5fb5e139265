// gi.h - diffuse light that bounces: fields of irradiance probes of a scene, filled by rays.
// Floor 2 (gi). Thread: the render thread; rays are shaded on jobs.
//
// A field is a grid of probes over the whole scene, and where that is coarse beside what a camera
// sees finer ones around that (cascades.h), for each of the cameras that were drawn last.
//
// A scene has two fields. That of rest is built from empty by a fixed schedule: rays in directions
// that follow from the probe's number and the round, waves of the same probes in the same order. It
// depends on the scene, its lights and the camera at rest alone; neither threads, nor how the work
// is cut into steps, nor what was seen before has a part in it. The moving one follows a scene that
// changes, under a budget of rays per picture, and never contributes to the other.
// docs/internals/gi.md.
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

// What a field is of.
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

enum hg_gi_field_kind { HG_GI_NO_FIELD, HG_GI_MOVING, HG_GI_REST };

// Between batches, after the scene was synced and posed and before culling. Casts about `rays` rays
// (whole waves) for the field of rest. The caller goes on until hg_gi_is_rest; it waits while the
// fields of other cameras are under way that take up all places. HG_E_LIMIT, HG_E_NOMEM, device
// errors: then there is no field of rest.
enum hg_status hg_gi_rest(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_gi_eye *eye, const struct hg_lighting_sources *sources, uint64_t rays,
    struct hg_error *err) HG_MUST_CHECK;
// The same for the moving field, which the picture of now is shown with. No rays once all of it has
// been updated often enough since the last change. Where the field of rest has the grid of the
// whole scene, or all that the camera needs, that is taken.
enum hg_status hg_gi_move(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_gi_eye *eye, const struct hg_lighting_sources *sources, uint64_t rays,
    struct hg_error *err) HG_MUST_CHECK;
// The field of rest is that of the key and the camera, and complete.
bool hg_gi_is_rest(
    const struct hg_gi *gi, const struct hg_gi_key *key, const struct hg_gi_eye *eye);
// The view's grids are in use; those unused for longest make room for others'.
void hg_gi_touch(struct hg_gi *gi, uint64_t view);

// view: whose camera it is. Of NO_FIELD: zeroed.
void hg_gi_fill(
    const struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view, struct hg_gpu_probes *out);

// What rays see, from means as the rays of probes do; origins as of the geometry room.
#define HG_GI_MOST_SIGHTS 4096
struct hg_gi_sight {
    bool hit;                     // a front; else all else is 0
    float albedo[3], emission[3]; // means of the material
    float light[3];               // irradiance over pi: direct and indirect
};
struct hg_gi_look {
    enum hg_gi_field_kind field;
    uint64_t view; // whose camera it is
    const struct hg_lighting_sources *sources;
    const struct hg_gpu_ray *rays; // [count]
    uint32_t count;                // <= HG_GI_MOST_SIGHTS
};
// After hg_gi_rest or hg_gi_move of the picture. Nothing is seen without a field. HG_E_NOMEM,
// device errors.
enum hg_status hg_gi_see(struct hg_gi *gi, const struct hg_gi_look *look, struct hg_gi_sight *out,
    struct hg_error *err) HG_MUST_CHECK;

// What rays of other passes meet, and what there is to light it with.
struct hg_gi_environment;
struct hg_gi_surfaces;
struct hg_gi_emissive;
struct hg_gi_field;
struct hg_gi_world {
    struct hg_trace *trace;                // NULL: there is none
    const struct hg_gi_environment *environment; // environment.h
    const struct hg_gi_surfaces *surfaces; // surfaces.h
    const struct hg_gi_emissive *emissive; // emissive.h
    const struct hg_gi_field *whole;       // field.h: the grid over the whole scene
    const struct hg_gi_field *field;       // the finest one of the view, that knows coarser ones
    uint64_t rounds; // updates of all probes of a moving field since the last change
};
// When hg_gi_rest and hg_gi_move may be called; borrowed until the geometry is synced. HG_E_LIMIT,
// HG_E_NOMEM, device errors, and without probes: *out is zeroed.
enum hg_status hg_gi_world(struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view,
    struct hg_gi_world *out, struct hg_error *err) HG_MUST_CHECK;

struct hg_gi_grid_stats {
    uint32_t probes, asleep;
    float spacing; // metres
};
struct hg_gi_stats {
    // Of the field of rest, or the moving one, with the finer grids of the camera drawn last.
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
