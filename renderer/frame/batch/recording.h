// recording.h - one batch while its passes are declared and recorded: between graph.c and
// blend.c.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_BATCH_RECORDING_H
#define HG_RENDERER_FRAME_BATCH_RECORDING_H

#include "renderer/frame/batch/batch.h"

// What passes are recorded with, and their resources (0 = not in this batch).
struct hg_batch {
    struct hg_draw *draw;
    struct hg_graph *graph;
    struct hg_pass pass; // of the sample that is recorded
    uint32_t sample, slot, slots, first_shadow_set;
    bool alone; // the sample is not added to others
    uint32_t visibility, depth, atlas, gathered, probe_light, behind, accumulated, picture, counts;
    uint32_t deformed, cache, progress, late_draws;
    uint32_t shaded_depth; // of the pixels that are shaded
    struct {
        bool skips;
        uint32_t tiles;
    } unlit; // tiles
    struct {
        uint32_t looked_up, surfaces; // probe light before reflections, what it is of
        uint32_t mirrored;            // of planar mirrors
        struct {
            uint32_t visibility, depth, light;
        } planes[HG_MIRROR_PLANES];
    } mirrors;
    struct {
        uint32_t visibility, color, depth, lists, glass, rays;
    } blend; // blended surfaces in front of the opaque scene
};

static inline struct hg_batch *hg_batch_of(const struct hg_graph_run *run)
{
    return run->data;
}

static inline void hg_batch_add(struct hg_batch *f, const struct hg_graph_pass *pass)
{
    hg_graph_pass(f->graph, pass);
}

static inline uint32_t hg_batch_image(struct hg_batch *f, const char *name, VkFormat format)
{
    return hg_graph_image(
        f->graph, &(struct hg_graph_image_params){.name = name, .format = format});
}

// --- blend.c -------------------------------------------------------------------------------------

// Memory of the lists for the next batch, before its frame block is filled. HG_E_NOMEM.
enum hg_status hg_batch_reserve_blend(struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// After the visibility buffer: blended surfaces to blend.color, front to back; where one hides all
// behind it, to the visibility buffer.
void hg_batch_declare_blend(struct hg_batch *f);

// --- sample_blocks.c -----------------------------------------------------------------------------

// After all that needs depth but shading: pixels with samples enough are taken out of it.
void hg_batch_declare_blocks(struct hg_batch *f);
// Some blocks have samples enough without the one that is recorded.
bool hg_batch_has_enough(const struct hg_batch *f);

// --- reflect_view.c ------------------------------------------------------------------------------

// Memory of what is read back and of the result. HG_E_NOMEM, device errors.
enum hg_status hg_batch_reserve_reflections(
    struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// After probe light with what mirrors: probe_light has reflections from here on.
void hg_batch_declare_reflections(struct hg_batch *f);

// --- mirror_view.c -------------------------------------------------------------------------------

// After reflections were declared.
void hg_batch_declare_mirrors(struct hg_batch *f);
// In their pause: planes are chosen, and rays find what they mirror. What was read back: probe
// light and what mirrors (shaders/shared/reflect.h). Without memory there are no mirrors. Device
// errors.
enum hg_status hg_batch_look_into_mirrors(struct hg_batch *f, const uint32_t *light,
    const uint32_t *surfaces, struct hg_error *err) HG_MUST_CHECK;
// What shading samples; NULL: this picture has no mirrors. The pass declares it.
struct hg_gpu_image *hg_batch_mirrored(const struct hg_graph_run *run);

// --- glass_view.c --------------------------------------------------------------------------------

// Memory of what is read back and of the result. HG_E_NOMEM, device errors.
enum hg_status hg_batch_reserve_glass(struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// After the opaque scene behind layers was shaded: blend.rays is what clear glass shows.
void hg_batch_declare_glass(struct hg_batch *f);

// --- temporal_view.c -----------------------------------------------------------------------------

// Memory of what is read back. HG_E_NOMEM.
enum hg_status hg_batch_reserve_motion(struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// After all that writes depth, before unlit cells move it: what motion vectors need is read back.
void hg_batch_declare_motion(struct hg_batch *f);

#endif
