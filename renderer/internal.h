// internal.h - what the files of the facade share. Private to renderer/*.c and renderer/bench.
#ifndef HG_RENDERER_INTERNAL_H
#define HG_RENDERER_INTERNAL_H

#include "renderer/frame/view.h"
#include "renderer/graph/graph.h"
#include "renderer/pathtrace/path.h"
#include "renderer/renderer.h"

struct hg_renderer {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    char *cache_dir;
    struct hg_store *store; // NULL: no cache folder
    struct hg_frame_context context;
};

struct hg_view {
    struct hg_renderer *renderer;
    struct hg_view_state state;
    struct hg_view_params params; // as they were set, if has_params
    bool has_params;
    struct hg_look *look; // NULL: it shows the scene as it is
    struct hg_camera_optics
        optics; // of the scene's camera that it has; they stand for parameters of 0
};

// Statistics of a view for tests and benchmarks (stats.c).
struct hg_view_report {
    struct hg_geometry_stats geometry;
    struct hg_textures_stats textures;
    uint32_t prefetched; // pictures, since creation
    float unlit_share;   // of tiles, in the newest picture that they were looked for in
    struct {
        uint32_t strips;        // that the next batch is drawn in
        uint32_t without_lists; // pictures in motion, since one that had them
    } blend;                    // of blended surfaces
    bool field_is_settled;      // the field that settled pictures are lit by is complete
    bool traces;                // its picture, or planes of it
    struct hg_path_stats path;
    // [height][width][3] as of hg_temporal_motion, of the newest picture in motion, until the next
    // step; NULL unless hg_debug_overrides.keeps_motion asks for it.
    const float *motion;
};
void hg_view_get_report(const struct hg_view *view, struct hg_view_report *out);
// The rays of its scene. Lives as long as a view of the scene does.
struct hg_rays *hg_view_rays(const struct hg_view *view);
// The frame before is forgotten, as after a change of the size.
void hg_view_forget_history(struct hg_view *view);
bool hg_view_has_history(const struct hg_view *view);
// The graph of its newest frame (hg_graph_print). Nothing before the first step.
void hg_view_print_graph(
    const struct hg_view *view, enum hg_graph_format format, struct hg_writer *out);
// Exchanges the optics, and what follows from them. The errors of hg_view_set_params.
enum hg_status hg_view_set_optics(struct hg_view *view, const struct hg_camera_optics *optics,
    struct hg_error *err) HG_MUST_CHECK;
// Parameter layers (view_look.c). HG_E_NOMEM.
enum hg_status hg_view_set_layers(
    struct hg_view *view, uint32_t layers, struct hg_error *err) HG_MUST_CHECK;
// HG_E_INVAL of a value outside its range.
enum hg_status hg_renderer_out_of_range(struct hg_error *err, const char *what, const char *field);
// Only paths that follow light know this plane.
bool hg_plane_needs_light(uint32_t plane);
uint64_t hg_renderer_peak_rss_bytes(void); // of this process (stats.c)

#endif
