// filter.h - the pixel filter: offsets of samples and splat weights. Private to the room.
// Floor 3.5. Pure functions, any thread.
#ifndef HG_RENDERER_PATHTRACE_FILTER_H
#define HG_RENDERER_PATHTRACE_FILTER_H

#include "renderer/denoise/denoise.h"
#include "renderer/pathtrace/path.h"
#include "shaders/shared/path.h"

// Samples are splatted to neighbouring pixels.
bool hg_path_filter_splats(const struct hg_path_settings *settings);
// Table of offsets of a filter for hg_gpu_path.
void hg_path_filter_fill(uint32_t filter, float radius_px, float out[HG_PATH_FILTER_STEPS + 1]);
// Subpixel offset of the samples of a pass, and their splat weights.
void hg_path_splat_fill(
    const struct hg_path_settings *settings, uint32_t pass, uint32_t seed, struct hg_gpu_path *out);
// Of what is known of whole pixels, after so many passes: 1, 2, ...
#define HG_PATH_RESTS 256
void hg_path_splat_rest(const struct hg_path_settings *settings, bool splats, uint32_t seed,
    struct hg_denoise_taps out[HG_PATH_RESTS]);

#endif
