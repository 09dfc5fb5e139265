// path.h - pictures made by following light (HG_MODE_PATH).
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_PATH_H
#define HG_RENDERER_FRAME_PATH_H

#include <stdint.h>

// What a path-traced picture depends on besides the settings of every view. Compared as bytes.
struct hg_path_settings {
    uint32_t trace;  // enum hg_trace_backend
    uint32_t filter; // enum hg_filter of renderer.h
    uint32_t max_bounces;
    uint32_t planes; // 1 << enum hg_plane of renderer.h
    float filter_radius_px, noise, time_s, clamp_indirect;
};

#endif
