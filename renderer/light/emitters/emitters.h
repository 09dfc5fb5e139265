// emitters.h - emitters, in tables that light sampling reads (lib/emitters.glsl).
// Floor 2 (light). Thread: the render thread; building is spread over jobs. The same bytes for any
// number of threads and whatever is resident.
//
// Positional punctual lights and emissive triangles are leaves of one tree (light_tree.h);
// directional lights and the environment are outside of it. Unchanged parts are kept: while only
// the camera moves nothing is rebuilt, unless the LOD cut of ray geometry changes.
//
// Memory: 108 bytes per leaf. When there are too many triangles for the budget, leaves hold runs of
// 2, 4, ... 256 consecutive triangles (which lie side by side), chosen within a leaf by their area,
// for 2 bytes per triangle. Emitters that still do not fit are left out with a warning: only BSDF
// sampling finds them, with more noise but without bias.
//
// The power of a triangle is estimated from a coarse mip of its emissive texture; triangles that
// are black there are left out in the same way.
#ifndef HG_RENDERER_LIGHT_EMITTERS_EMITTERS_H
#define HG_RENDERER_LIGHT_EMITTERS_EMITTERS_H

#include "base/jobs.h"
#include "renderer/trace/ray_geometry.h"
#include "renderer/gpu/gpu.h"
#include "renderer/texture/textures.h"
#include "shaders/shared/emitters.h"

struct hg_emitters;
struct hg_sky_cache;

struct hg_emitters_params { // zero of each field = default
    uint64_t budget_bytes;  // of the tables on the device; default 96 MiB
    struct hg_sky_cache *sky; // skies are taken from; borrowed; NULL: drawn each time
};

// HG_E_NOMEM. gpu and jobs are borrowed and must outlive it.
enum hg_status hg_emitters_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    const struct hg_emitters_params *params, struct hg_emitters **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_emitters_destroy(struct hg_emitters *emitters); // accepts NULL

// Possibly emissive triangles of one draw.
struct hg_emitter_part {
    const struct hg_ray_geometry_piece *piece;
    const struct hg_material *material; // NULL: the default one, which is dark
    // Texture coordinates of the emissive slot's set: uv_stride floats from vertex to vertex. NULL:
    // all of the texture is taken for each triangle.
    const float *uv;
    uint32_t uv_stride;
};

struct hg_emitter_input {
    const struct hg_scene *scene;        // lights and environment; hg_scene_update was called
    double origin[3];                    // hg_geometry_origin
    const struct hg_emitter_part *parts; // by draw, then primitive
    uint32_t part_count, draw_count;
    uint64_t poses;               // differs when parts that deform have moved
    struct hg_textures *textures; // reads emissive textures; NULL: they are taken as white
};

// Pieces whose positions or indices the host does not have (hg_ray_geometry_lens.addresses) are
// left out.
//
// Updates the tables. No batch may be open; uploads are recorded before the next one.
// Waits for emissive textures that are seen for the first time to be decoded. On error the tables
// are empty until the next call. HG_E_NOMEM, device errors.
enum hg_status hg_emitters_update(struct hg_emitters *emitters,
    const struct hg_emitter_input *input, struct hg_error *err) HG_MUST_CHECK;
// The same for all ray geometry.
enum hg_status hg_emitters_sync(struct hg_emitters *emitters, const struct hg_geometry *geometry,
    const struct hg_ray_geometry *rays, const struct hg_scene *scene, struct hg_textures *textures,
    struct hg_error *err) HG_MUST_CHECK;

// Motion blur: punctual lights move between their states at shutter opening and closing, borrowed.
// NULL: they are static.
struct hg_light_set;
void hg_emitters_move_lights(struct hg_emitters *emitters, const struct hg_light_set *opening,
    const struct hg_light_set *closing);

void hg_emitters_fill(const struct hg_emitters *emitters, struct hg_gpu_emitters *out);

struct hg_emitters_stats {
    uint32_t directional, punctual; // lights
    uint64_t triangles;             // that belong to emissive parts
    uint64_t left_out;              // left out for lack of budget
    uint32_t leaves, depth;         // of the tree
    uint32_t run;                   // triangles per leaf
    uint32_t builds, warps;         // since creation: of the tree, of the environment
    uint64_t build_ns, warp_ns;     // newest ones
    uint64_t bytes, peak_bytes;     // on the device
};
void hg_emitters_stats(const struct hg_emitters *emitters, struct hg_emitters_stats *out);

#endif
