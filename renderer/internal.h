// internal.h - what the files of the facade share. Private to renderer/*.c and renderer/bench.
#ifndef HG_RENDERER_INTERNAL_H
#define HG_RENDERER_INTERNAL_H

#include "renderer/frame/view.h"
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
};

// Statistics of a view for tests and benchmarks (stats.c).
struct hg_view_report {
    struct hg_geometry_stats geometry;
    struct hg_textures_stats textures;
    uint32_t prefetched; // pictures, since creation
    float unlit_share;   // of tiles, in the newest picture that they were looked for in
};
void hg_view_get_report(const struct hg_view *view, struct hg_view_report *out);
// HG_E_INVAL of a value outside its range.
enum hg_status hg_renderer_out_of_range(struct hg_error *err, const char *what, const char *field);
// Only paths that follow light know this plane.
bool hg_plane_needs_light(uint32_t plane);
uint64_t hg_renderer_peak_rss_bytes(void); // of this process (stats.c)

#endif
