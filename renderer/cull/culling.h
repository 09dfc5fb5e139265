// culling.h - what a camera or a light may see, as draws.
// Floor 2 (geometry). Thread: the render thread; selection is spread over jobs.
//
// The host selects runs of triangles by frustum and facing (meshlets of static parts; all else as a
// whole) and writes the indices of what is left of a part to a list of this frame, in the order of
// the part. Whole parts of consecutive instances are one instanced draw of the part's own indices.
// Only what cannot show is left out, so the picture is the one of drawing everything. On devices
// that draw in software single triangles that show at no sample are left out, too
// (triangle_cull.h).
//
// Occlusion, when there is much to draw: what was seen in the frame before is drawn first, a
// pyramid of its depth is made, and each of the remaining runs is drawn only where it is not behind
// that (its indirect draw gets no instance). Depth and ties decide what a pixel shows, never the
// phase: of surfaces at the same depth the first in draw order is seen. So what was drawn before
// changes the cost and not the picture. Sources: Greene, Kass and Miller 1993, "Hierarchical
// Z-Buffer Visibility"; Haar and Aaltonen 2015, "GPU-Driven Rendering Pipelines" (two phases).
//
// Use, per step: hg_culling_reset; hg_culling_add for each view; hg_culling_upload; then the items
// of each set in a batch, hg_culling_test between the phases of a set with late items.
#ifndef HG_RENDERER_CULL_CULLING_H
#define HG_RENDERER_CULL_CULLING_H

#include "base/jobs.h"
#include "renderer/geometry/geometry.h"
#include "shaders/shared/cluster.h"

struct hg_culling;

// HG_E_NOMEM. gpu is borrowed and must outlive it.
enum hg_status hg_culling_create(
    struct hg_gpu *gpu, struct hg_culling **out, struct hg_error *err) HG_MUST_CHECK;
void hg_culling_destroy(struct hg_culling *visible); // accepts NULL

// What the visibility pass does with positions, and where its samples are.
struct hg_culling_lens {
    float view_proj[16], clip[4]; // clip = view_proj * (position - eye, 0) + clip
    uint32_t width, height;       // px
    float shift_px;               // samples lie at most so far from the centres of pixels
};

struct hg_culling_view {
    float planes[6][4];       // inside: dot(xyz, p) + w >= 0; relative to the origin
    uint32_t plane_count;     // 0: everything is seen
    float eye[3], forward[3]; // relative to the origin; forward: orthographic views
    float px_scale;           // pixels per radian, or per metre when orthographic
    bool orthographic;
    bool both_sides;   // facing does not matter
    float error_px;    // greatest projected error of levels of detail; 0: none
    float near;        // metres, > 0: nothing is looked at from nearer than this
    bool wait;         // load what is missing now
    bool numbered;     // provoking vertex lists, where there are
    bool whole;        // with wait: never coarser than asked; what does not fit is missing, and
                       // then the set must not be drawn
    uint32_t share, shares; // with whole: one of that many shares of the chunks, which make up the
                            // whole cut; the first has the parts without chunks. 0 = all of it
    bool history;           // what the last view with history saw comes first, the rest may be late
    const struct hg_culling_lens *lens; // with numbered: drop triangles that show at no sample
    // What the host can draw it draws (hg_culling_draw_cpu): the whole picture without its jitter.
    // NULL: the device draws all. Of the first set that has some.
    const struct hg_culling_lens *host;
    bool host_parts; // not clusters of baked parts alone, but meshlets of others, too
    // [draws] as the view shows them (geometry/view_tables.h): none that are hidden, and the others
    // by these flags. NULL: as the scene has them.
    const struct hg_gpu_draw *shown;
    // Draws whose box lies on both sides of one of these planes alone; 0: all.
    float cuts[6][4]; // relative to the origin: dot(xyz, p) + w
    uint32_t cut_count;
};

// Consecutive draws of one part: vkCmdDrawIndexed(index_count, draw_count, 0, 0, first_draw) with
// u32 indices. In draw order: by class, then topology, sides, winding, part, instance.
struct hg_culling_item {
    uint32_t first_draw, draw_count;                    // one instance each
    uint32_t index_count, primitive_count, flags, part; // flags: HG_DRAW_* of all of them
    VkBuffer index_buffer;                              // NULL: of this frame
    uint64_t index_offset;                              // bytes
    VkDeviceAddress positions, vertices, extra;
    VkBuffer position_buffer; // of numbered items
    uint64_t position_offset; // bytes
    uint32_t first_primitive; // of its primitives in the list of ids; HG_CLUSTER_NONE: 0, 1, 2 ...
    uint32_t chunk, list, candidate; // private
    bool joins;                      // private
    uint32_t command;                // indirect draw; HG_CLUSTER_NONE: none
    // The first corner of a triangle is its number; positions are those of that list, and in
    // position_buffer. hg_culling_draw binds it as vertex buffer 0.
    bool numbered;
    bool listed; // numbered, and each position is followed by a word: the number, of first corners
};

struct hg_culling_set {
    uint32_t first_item, item_count; // in draw order
    uint32_t class_first[4];         // items of class c: [class_first[c], class_first[c + 1])
    uint32_t first_late, late_count; // in reverse draw order, opaque and masked
    uint32_t first_candidate, candidate_count; // of occlusion
    uint32_t missing;                          // chunks that should be there and are not
    bool crowded;                              // because the budget does not hold all of it
    float error_px;                            // >= that of the view: more did not fit the budget
    uint64_t triangles, late_triangles;        // triangles: of items that are not late; without
                                               // what is left out one by one, once uploaded
    bool numbered;                             // as in the view
    bool hosted;                               // the host draws some of it, not in its items
};

// The camera moved: what did not fit the budget may fit now. Views that do not wait and want more
// than it holds get a larger error from frame to frame; this lowers it by a step, once a few frames
// have had enough.
void hg_culling_relax(struct hg_culling *visible);
// Forgets all sets. The batch that used them is over.
void hg_culling_reset(struct hg_culling *visible);
// Adds a set; it is number hg_culling_count() - 1. HG_E_NOMEM.
enum hg_status hg_culling_add(struct hg_culling *visible, const struct hg_geometry *geometry,
    const struct hg_culling_view *view, struct hg_jobs *jobs, struct hg_error *err) HG_MUST_CHECK;
uint32_t hg_culling_count(const struct hg_culling *visible);
const struct hg_culling_set *hg_culling_set(const struct hg_culling *visible, uint32_t set);
// Item i of a list (first_item + i or first_late + i).
const struct hg_culling_item *hg_culling_item(const struct hg_culling *visible, uint32_t index);
// Brings all sets to the device. HG_E_NOMEM, device errors.
enum hg_status hg_culling_upload(
    struct hg_culling *visible, struct hg_jobs *jobs, struct hg_error *err) HG_MUST_CHECK;

// Binds the item's indices and draws it; pipeline and push constants are the caller's.
void hg_culling_draw(
    const struct hg_culling *visible, struct hg_gpu_cmd *cmd, const struct hg_culling_item *item);
// Push constants of an item. Depth and ids: of hg_culling_test.
void hg_culling_fill(
    const struct hg_culling *visible, const struct hg_culling_item *item, struct hg_gpu_item *out);

// An occlusion test between the two phases of a set.
struct hg_culling_test {
    uint32_t set;
    struct hg_gpu_image *depth, *visibility; // of the first phase
    uint32_t tables, features;               // specialisation constants
};

// Reads depth and visibility buffer, tests every candidate of the set with the camera of the frame
// block. Outside rendering. HG_E_NOMEM, device errors.
enum hg_status hg_culling_test(struct hg_culling *visible, struct hg_gpu_cmd *cmd,
    const struct hg_culling_test *test, struct hg_error *err) HG_MUST_CHECK;

// One sample of what the host draws.
struct hg_culling_sample {
    const struct hg_culling_lens *lens; // without shift
    uint32_t slot, slots;               // where it goes; slot < slots
};

// Of a set that is hosted: draws the host's part of one sample. Slots keep what they hold until
// slot 0 is drawn. HG_E_NOMEM, device errors.
enum hg_status hg_culling_draw_cpu(struct hg_culling *visible,
    const struct hg_culling_sample *sample, struct hg_jobs *jobs,
    struct hg_error *err) HG_MUST_CHECK;
// Copies a slot to the visibility buffer and its depth, all of it or `area` (zero: all). Outside
// rendering, and before the items are drawn.
void hg_culling_copy_cpu(const struct hg_culling *visible, struct hg_gpu_cmd *cmd, uint32_t slot,
    struct hg_gpu_image *visibility, struct hg_gpu_image *depth, VkRect2D area);

struct hg_culling_stats {
    uint32_t draws, late, hidden; // of the first set; draws: instances; hidden: by the newest test
    uint64_t triangles;           // drawn of the first set by the newest sample
    uint64_t hosted;              // of these by the host
    uint64_t bytes;               // of device memory
};
// After the batch is over.
void hg_culling_stats(const struct hg_culling *visible, struct hg_culling_stats *out);
// Triangles of a view from which occlusion is tested; 0 = the default. For tests.
void hg_culling_set_occlusion_from(struct hg_culling *visible, uint64_t triangles);

#endif
