// waves.h - waves of rays from probes: directions, hits, shading, sums.
// Floor 2, private to renderer/gi. Thread: the render thread; rays are shaded on jobs.
#ifndef HG_RENDERER_GI_WAVES_H
#define HG_RENDERER_GI_WAVES_H

#include "renderer/gi/field.h"
#include "renderer/gi/gi.h"
#include "renderer/host_shading/caster.h"
#include "renderer/host_shading/direct.h"
#include "renderer/host_shading/emissive.h"
#include "renderer/host_shading/environment.h"
#include "renderer/host_shading/surfaces.h"

#define HG_GI_WAVE_PROBES 128
#define HG_GI_MOST_RAYS   96 // of a probe in a wave

struct hg_gi_waves {
    struct hg_gi_params params;
    struct hg_rays_scene *rays;
    bool exact; // of `rays`: they depend on the scene alone
    struct hg_host_surfaces surfaces;
    struct hg_host_caster caster; // against these
    struct hg_host_emissive emissive;
    struct hg_host_environment environment;
    struct hg_gpu_buffer probe_rays, probe_hits, shadow_rays, blocked, peak_rays, peak_blocked;
    struct hg_gi_ray *brought; // [HG_GI_WAVE_PROBES * HG_GI_MOST_RAYS]
    struct hg_gi_peak *peaks;  // of the environment, then emissive triangles
    struct hg_host_direct *direct;
    float around[HG_GI_MOST_RAYS][3]; // `around_count` directions that are spread evenly
    uint32_t around_count;
    struct hg_gi_stats stats;
};

// HG_E_NOMEM, device errors. Finish accepts zeroed and half-built ones.
enum hg_status hg_gi_waves_init(struct hg_gi_waves *waves, const struct hg_gi_params *params,
    struct hg_error *err) HG_MUST_CHECK;
void hg_gi_waves_finish(struct hg_gi_waves *waves);
// What rays meet is that of the scene as it is. exact: it depends on that alone. Statuses as of
// hg_rays_sync.
enum hg_status hg_gi_waves_sync_surfaces(
    struct hg_gi_waves *waves, bool exact, struct hg_error *err) HG_MUST_CHECK;
// The same, and the environment.
enum hg_status hg_gi_waves_sync(struct hg_gi_waves *waves, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, bool exact, struct hg_error *err) HG_MUST_CHECK;

struct hg_gi_wave {
    const struct hg_lighting_sources *sources;
    struct hg_gi_field *field;
    const struct hg_gi_field *light; // of what rays meet; its coarser ones with it
    const uint32_t *probes;          // [count]
    uint32_t count;                  // at most HG_GI_WAVE_PROBES
    uint32_t rays;                   // of each, at most HG_GI_MOST_RAYS
    uint32_t round;                  // another one: other directions
    float keep;  // of what probes hold; < 0: by what each has seen since the last change
    bool places; // finds out where probes stand; no light
    bool last;   // for the last time
};
// Device errors.
enum hg_status hg_gi_waves_run(
    struct hg_gi_waves *waves, const struct hg_gi_wave *wave, struct hg_error *err) HG_MUST_CHECK;

// Of `count` directions that are spread evenly.
void hg_gi_sphere_point(uint32_t i, uint32_t count, float out[3]);
// Where `count` rays (at most HG_GI_WAVE_PROBES * HG_GI_MOST_RAYS) end that are laid out in
// probe_rays; distances in metres, FLT_MAX: nothing is met. Device errors.
enum hg_status hg_gi_waves_distances(struct hg_gi_waves *waves, uint32_t count, float *distances,
    struct hg_error *err) HG_MUST_CHECK;

#endif
