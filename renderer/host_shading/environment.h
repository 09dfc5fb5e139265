// environment.h - the environment as rays of probes see it: an even part, which rays that leave the
// scene bring, and its peaks (lamps, a sun), which few of them would find and rays of their own go
// to. Floor 2. Thread: the render thread; lookups from any.
#ifndef HG_RENDERER_HOST_SHADING_ENVIRONMENT_H
#define HG_RENDERER_HOST_SHADING_ENVIRONMENT_H

#include "renderer/light/lighting.h"

struct hg_host_environment { // zeroed: nothing is known
    uint64_t revision;
    uint32_t count; // texels
    bool is_known, has_peaks;
    float limit; // luminance of a texel from which on the rest belongs to a peak
    float *sums; // [count] of peaks' luminance times solid angle, up to each texel
};

// Brings it up to date with the environment of this revision. HG_E_NOMEM.
enum hg_status hg_host_environment_sync(struct hg_host_environment *environment,
    const struct hg_lighting_sources *sources, uint64_t revision) HG_MUST_CHECK;
void hg_host_environment_finish(struct hg_host_environment *environment);

// Radiance from a direction (unit), without that of peaks.
void hg_host_environment_even(const struct hg_host_environment *environment,
    const struct hg_lighting_sources *sources, const float direction[3], float out[3]);
// Irradiance over pi of all of it on a plane with this normal (unit), if nothing is in the way: as
// hg_environment_irradiance of lib/environment.glsl.
void hg_host_environment_irradiance(
    const struct hg_lighting_sources *sources, const float normal[3], float out[3]);
// A direction to a peak (unit) by three numbers in [0, 1), with a chance in proportion to its
// light, and the illuminance of all of them if they were there. Only where has_peaks.
void hg_host_environment_peak(const struct hg_host_environment *environment,
    const struct hg_lighting_sources *sources, const float xi[3], float direction[3],
    float light[3]);

#endif
