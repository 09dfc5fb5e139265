// cpu_visibility.h - the part of a set that the host draws itself (raster.h), on devices that draw
// in software. Floor 2 (geometry). Private to the room. Thread: the render thread.
//
// It takes opaque clusters of baked parts whose box lies where no triangle is cut. That depends on
// the scene, the view without its jitter and the cluster alone, never on time or on what else is
// drawn, so that a picture has the same bytes however it comes about. All else stays with the
// device, which draws over what is there; at the same depth what the host drew is seen. For
// pictures in motion (hg_culling_view.host_parts) it takes meshlets of other parts as well.
#ifndef HG_RENDERER_CULL_CPU_VISIBILITY_H
#define HG_RENDERER_CULL_CPU_VISIBILITY_H

#include "renderer/cpu_raster/raster.h"
#include "renderer/cull/select.h"

struct hg_cpu_visibility_source {
    struct hg_cluster_mesh *mesh; // NULL: a meshlet of a part without clusters
    uint32_t chunk, bit;
};

struct hg_cpu_visibility { // zeroed = empty; keeps its memory
    struct hg_raster *raster;
    struct hg_raster_run *runs;
    struct hg_cpu_visibility_source *sources;
    uint8_t *takes, *marks;
    size_t run_capacity, source_capacity, take_capacity, mark_capacity;
    uint32_t count, set;
    float eye[3];
    struct hg_gpu_buffer pixels; // ids of all slots, then depth of all slots
    uint32_t width, height, slots;
    bool drawn; // by a sample at least
};

// Bits of runs that were seen before; words NULL: nothing is known.
struct hg_cpu_visibility_history {
    uint32_t *words;
    uint32_t bits;
};

// The set that runs are taken from.
struct hg_cpu_visibility_set {
    const struct hg_geometry *geometry;
    const struct hg_culling_view *view;
    struct hg_cpu_visibility_history history;
    uint32_t number;
};

void hg_cpu_visibility_finish(struct hg_gpu *gpu, struct hg_cpu_visibility *hosted);
// Forgets all runs; what the samples saw goes to the history.
void hg_cpu_visibility_reset(
    struct hg_cpu_visibility *hosted, const struct hg_cpu_visibility_history *history);
// Moves runs from the selection of a set here. jobs may be NULL. HG_E_NOMEM.
enum hg_status hg_cpu_visibility_take(struct hg_cpu_visibility *hosted,
    const struct hg_cpu_visibility_set *set, struct hg_jobs *jobs,
    struct hg_selection *runs) HG_MUST_CHECK;
// Marks the chunks as used in this frame.
void hg_cpu_visibility_use(
    const struct hg_cpu_visibility *hosted, const struct hg_geometry *geometry);
// Draws one sample to its slot. HG_E_NOMEM, device errors.
enum hg_status hg_cpu_visibility_draw(struct hg_cpu_visibility *hosted, struct hg_gpu *gpu,
    const struct hg_culling_sample *sample, struct hg_jobs *jobs,
    struct hg_error *err) HG_MUST_CHECK;
// Copies a slot to images, all of it or `area` (zero: all).
void hg_cpu_visibility_copy(const struct hg_cpu_visibility *hosted, struct hg_gpu_cmd *cmd,
    uint32_t slot, struct hg_gpu_image *visibility, struct hg_gpu_image *depth, VkRect2D area);
// Triangles that the newest samples looked at.
uint64_t hg_cpu_visibility_triangles(const struct hg_cpu_visibility *hosted);

#endif
