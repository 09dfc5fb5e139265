// trace.h - ray tracing: acceleration structures of a scene and the backends that traverse them.
// Floor 2 (trace). Thread: the render thread; tracing is spread over jobs.
//
// Rays come as wavefronts (shaders/shared/ray.h) in buffers that host and device share. Three
// backends stand behind one interface: Embree on the host, a compute shader over a quantised BVH2,
// and ray queries of the device. Which triangles there are is said by ray geometry
// (ray_geometry.h): each draw at one level of detail, the same for all rays. Backends hit the same
// triangles but for rays that pass within rounding of an edge. Ray queries know no time: ray
// geometry in which something moves while the shutter is open are walked by the compute shader
// there, too.
//
// Lines, and points that have no discs, are not hit. Of hits at the same distance any one may be
// named, but always the same one for the same wave.
//
// Alpha is not evaluated here: masked and blended triangles are hit like others, and the shader
// that evaluates the hit continues the ray behind it (mask and t_min).
#ifndef HG_RENDERER_TRACE_TRACE_H
#define HG_RENDERER_TRACE_TRACE_H

#include "base/jobs.h"
#include "renderer/trace/ray_geometry.h"
#include "renderer/gpu/gpu.h"
#include "shaders/shared/ray.h"

struct hg_trace;

enum hg_trace_backend {
    HG_TRACE_AUTO, // Embree on CPU devices, else ray queries, else compute
    HG_TRACE_EMBREE,
    HG_TRACE_COMPUTE,
    HG_TRACE_KHR,
};

struct hg_trace_params {
    enum hg_trace_backend backend;
    struct hg_jobs *jobs;
    uint64_t budget_bytes; // of acceleration structures; 0 = unlimited
    // What moves without being animated leaves the structure of all that stands still, and has one
    // of its own from then on: of a move only that is built. Which triangle is named of several at
    // the same distance then depends on what moved before.
    bool apart;
};

// HG_E_DEVICE: the backend is not to be had here, with the reason. HG_E_NOMEM. `gpu` is borrowed.
enum hg_status hg_trace_create(struct hg_gpu *gpu, const struct hg_trace_params *params,
    struct hg_trace **out, struct hg_error *err) HG_MUST_CHECK;
void hg_trace_destroy(struct hg_trace *trace);                        // accepts NULL
enum hg_trace_backend hg_trace_backend(const struct hg_trace *trace); // never AUTO
const char *hg_trace_backend_name(enum hg_trace_backend backend);     // "embree", ...

// Syncs the structures with ray geometry; unchanged bodies are kept, moved ones are refitted. No
// batch may be open. HG_E_LIMIT (budget, checked before memory is taken),
// HG_E_NOMEM, device errors; then there is no scene until the next sync.
enum hg_status hg_trace_sync(struct hg_trace *trace, const struct hg_ray_geometry *geometry,
    struct hg_error *err) HG_MUST_CHECK;

// Draws of the newest sync that rays intersect in object space (instances): sets `mark` in their
// words, clears it in others. True when there are any. marks: [draws]
bool hg_trace_mark_placed(
    const struct hg_trace *trace, uint32_t *marks, uint32_t draws, uint32_t mark);

// Buffers that the host reaches (HG_GPU_BUFFER_READBACK).
struct hg_trace_wave {
    const struct hg_gpu_buffer *rays, *hits; // hits: of hg_trace_closest
    const struct hg_gpu_buffer *blocked;     // of hg_trace_blocked: [count] words, 0 or 1
    uint64_t first_ray, first_hit;    // index of the wave's first; first_hit: of blocked, too
    const struct hg_gpu_buffer *list; // [count] words, mapped: which rays; NULL: the first `count`
    uint32_t count;
    bool coherent; // neighbours are coherent: primary rays, shadow rays of one light
};

// Each returns when the results are there. No batch of commands may be open. HG_E_STATE: there are
// no structures yet; HG_E_INVAL: the wave is not in its buffers; device errors.
enum hg_status hg_trace_closest(
    struct hg_trace *trace, const struct hg_trace_wave *wave, struct hg_error *err) HG_MUST_CHECK;
// 1: anything of the ray's mask lies between t_min and t_max.
enum hg_status hg_trace_blocked(
    struct hg_trace *trace, const struct hg_trace_wave *wave, struct hg_error *err) HG_MUST_CHECK;

// For benchmarks: how long Embree itself takes for the wave, its rays laid out before and its hits
// left where they are. HG_E_STATE: another backend. Other statuses as above.
enum hg_status hg_trace_raw(struct hg_trace *trace, const struct hg_trace_wave *wave, bool any,
    uint64_t *ns, struct hg_error *err) HG_MUST_CHECK;

struct hg_trace_stats {
    uint64_t triangles, instances; // of the structures: unique, placed
    uint64_t bytes, peak_bytes;    // of the structures
    uint64_t build_ns, refit_ns;   // of the newest sync
    uint64_t built_triangles;      // of the newest sync: brought to new structures
    uint64_t refit_triangles;      // to structures that were there
    uint64_t rays, trace_ns;       // since creation
};
void hg_trace_stats(const struct hg_trace *trace, struct hg_trace_stats *out);

#endif
