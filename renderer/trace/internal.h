// internal.h - what the files of renderer/trace/ share. Private to this room.
#ifndef HG_RENDERER_TRACE_INTERNAL_H
#define HG_RENDERER_TRACE_INTERNAL_H

#include "renderer/trace/layout.h"
#include "renderer/trace/trace.h"

// Rays of a wave that go to the device (or through it) at once.
struct hg_trace_piece {
    const struct hg_trace_wave *wave;
    bool any; // any-hit: only whether there is one
    uint32_t at, count;
};

// Where a piece lies on the device.
struct hg_trace_addresses {
    VkDeviceAddress rays, list, out; // list: 0 = none; out: words of `blocked`, or hits
};
struct hg_trace_addresses hg_trace_addresses(const struct hg_trace_piece *piece);

// Interface of a backend. `self` comes from create; the layout given to sync lives until the next.
struct hg_trace_ops {
    enum hg_status (*create)(struct hg_trace *trace, void **self, struct hg_error *err);
    void (*destroy)(void *self); // accepts NULL
    enum hg_status (*sync)(void *self, const struct hg_trace_layout *layout, struct hg_error *err);
    // *value: of the device's timeline when the results are there; 0: they are.
    enum hg_status (*submit)(
        void *self, const struct hg_trace_piece *piece, uint64_t *value, struct hg_error *err);
    uint32_t least_piece; // 0: a wave that is waited for goes in one piece
    // hg_trace_raw; NULL: not available.
    enum hg_status (*raw)(
        void *self, const struct hg_trace_wave *wave, bool any, uint64_t *ns, struct hg_error *err);
};
extern const struct hg_trace_ops hg_trace_embree, hg_trace_compute, hg_trace_khr;

struct hg_trace {
    struct hg_gpu *gpu;
    struct hg_trace_params params;
    const struct hg_trace_ops *ops;
    void *self;
    // Takes over scenes that the backend cannot show (HG_E_UNSUPPORTED: motion): the compute one.
    void *spare;
    bool uses_spare;
    struct hg_trace_layout layout;
    uint64_t revision; // of the ray geometry
    bool synced;
    uint32_t piece[2]; // rays of one that is waited for: nearest hits, any
    struct hg_trace_stats stats;
};

// A compute kernel over `groups` groups of rays, with `push` as its constants.
struct hg_trace_dispatch {
    const struct hg_gpu_pipeline_params *pipeline;
    const void *push;
    uint32_t push_bytes, groups;
};
// Submits it without a wait; *value: as of hg_trace_ops.submit. Device errors.
enum hg_status hg_trace_submit_dispatch(struct hg_gpu *gpu,
    const struct hg_trace_dispatch *dispatch, uint64_t *value, struct hg_error *err) HG_MUST_CHECK;

// Class of a draw as rays ask for it: HG_RAY_*.
uint32_t hg_trace_mask(uint32_t draw_flags);
// Invalid rays, which backends skip: not finite, without direction or interval.
bool hg_trace_is_ray(const struct hg_gpu_ray *ray);

#endif
