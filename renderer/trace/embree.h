// embree.h - Embree 3 and 4 by one set of names, and scenes of a layout. Private to
// renderer/trace/. Floor 2 (trace). Thread: the render thread builds; any thread may trace
// meanwhile nothing is.
//
// Source: Wald et al. 2014, "Embree: A Kernel Framework for Efficient CPU Ray Tracing".
#ifndef HG_RENDERER_TRACE_EMBREE_H
#define HG_RENDERER_TRACE_EMBREE_H

#include <stdatomic.h>

#if HELIO_EMBREE == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "renderer/trace/internal.h"

// Maps a geometry of a scene to draws.
struct hg_embree_geometry {
    uint32_t draw, first_primitive; // draw: of flat ones
};

struct hg_embree_body {
    uint64_t key;
    uint64_t shape; // hash of where its input lies
    RTCScene scene; // of the body's own space
    struct hg_embree_geometry *geometries;
    uint32_t geometry_count;
    uint32_t refits;
};

struct hg_embree_instance {
    uint32_t draw;
    const struct hg_embree_body *body;
};

struct hg_embree {
    struct hg_trace *trace;
    RTCDevice device;
    _Atomic int64_t bytes, peak_bytes;
    int64_t limit_bytes; // 0 = none
    _Atomic bool refused;
    uint32_t packet; // rays of a packet: 1, 8 or 16

    struct hg_embree_body flat; // in world space
    bool flat_there;
    // Of the flat ones those that are not opaque once more, by the same numbers, for rays that look
    // for nothing else; NULL: there are none.
    RTCScene flat_alpha_mask;
    struct hg_embree_body *bodies; // that are placed, by key
    uint32_t body_count;
    RTCScene top; // of instances; NULL: there are none
    struct hg_embree_instance *instances;
    size_t instance_capacity;
};

// HG_E_LIMIT when the memory monitor refused, HG_E_NOMEM or HG_E_INTERNAL when Embree has an error.
enum hg_status hg_embree_check(struct hg_embree *e, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_embree_build(
    struct hg_embree *e, const struct hg_trace_layout *layout, struct hg_error *err) HG_MUST_CHECK;
void hg_embree_clear(struct hg_embree *e);
// Rays [first, first + count) of a wave. Thread-safe.
void hg_embree_trace(const struct hg_embree *e, const struct hg_trace_wave *wave, bool any,
    uint32_t first, uint32_t count);
// The two halves of it, for hg_trace_raw: rays to packets of hg_embree_packet_bytes for every 16
// rays, and packets through the scene.
#define HG_EMBREE_PACKET 16u
size_t hg_embree_packet_bytes(void);
void hg_embree_lay_out(const struct hg_embree *e, const struct hg_trace_wave *wave, uint32_t first,
    uint32_t count, void *packets);
void hg_embree_walk(const struct hg_embree *e, const struct hg_trace_wave *wave, bool any,
    void *packets, uint32_t count);

#endif
