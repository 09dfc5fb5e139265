// field.h - a field of irradiance probes on the host: where probes stand, what their rays brought.
// Floor 2, for renderer/gi and renderer/reflect. Thread: the render thread; probes may be gathered
// in parallel.
//
// Source: Majercik et al. 2019 and 2021 (shaders/lib/probes.glsl).
#ifndef HG_RENDERER_GI_FIELD_H
#define HG_RENDERER_GI_FIELD_H

#include "renderer/gi/walls.h"
#include "renderer/gpu/gpu.h"
#include "shaders/shared/gi.h"

#define HG_GI_MOST_PROBES 2048 // of a grid
#define HG_GI_FARTHEST    3.0f // distances in moments end there, in spacings

// Sums over rays, weighted by the cosine about the texel's direction.
struct hg_gi_irradiance {
    float light[3][HG_PROBE_IRRADIANCE_TEXELS];    // radiance
    float surfaces[3][HG_PROBE_IRRADIANCE_TEXELS]; // of rays that hit
    float emitters[3][HG_PROBE_IRRADIANCE_TEXELS]; // of emitters that rays met
    float even[3][HG_PROBE_IRRADIANCE_TEXELS];     // of the environment, if nothing were in the way
    float sky[HG_PROBE_IRRADIANCE_TEXELS];         // 1 of rays that missed
    float weight[HG_PROBE_IRRADIANCE_TEXELS];
};

// Weighted by a narrow lobe about the texel's direction; spacings. A ray adds to few texels.
struct hg_gi_moments {
    struct hg_gi_moment {
        float distance, squared, weight;
    } texels[HG_PROBE_MOMENT_TEXELS];
};

// What lookups on the host read: the means of both.
struct hg_gi_means {
    float light[HG_PROBE_IRRADIANCE_TEXELS][4]; // and the weight of its sums
    float reach[HG_PROBE_MOMENT_TEXELS][2]; // of distances, and their variance
};

struct hg_gi_lobes { // directions of texels
    float irradiance[3][HG_PROBE_IRRADIANCE_TEXELS];
    float moments[HG_PROBE_MOMENT_TEXELS][3];
};

struct hg_gi_field { // zeroed: none
    uint32_t counts[3], count;
    float origin[3], spacing;
    const struct hg_gi_field *coarser; // for what lies beyond the grid; NULL: it is the coarsest
    uint32_t salt;                     // fields of different ones have other random numbers
    float (*offsets)[3]; // [count] from the grid, in spacings
    struct hg_gi_wall *walls; // [count]
    bool *inside;        // [count] of something solid, where probes were placed
    bool *covered;       // [count] by something solid that moved there; lookups pass them
    bool follows;        // geometry has moved since probes were placed
    bool *needed;        // [count] surfaces are near (occupancy.h); set by who places the field
    uint32_t *updates;   // [count] since what they hold was last out of date
    bool *doubted;       // [count] geometry has moved since the last update
    struct hg_gi_irradiance *irradiance;
    struct hg_gi_moments *moments;
    struct hg_gi_means *means;
    struct hg_gi_lobes lobes;
    uint32_t *words; // as the device reads them
    bool *stale;     // [count] the probe's tables have changed since they were uploaded
    struct hg_gpu_buffer buffer;
};

// counts, count, origin and spacing for these bounds.
void hg_gi_field_grid(struct hg_gi_field *field, const float min[3], const float max[3]);
// Empty probes for a grid: counts, count, origin and spacing are those of `grid`, as are coarser
// and salt. All are needed; of a grid with a coarser one none is until relocation finds surfaces
// near. HG_E_NOMEM.
enum hg_status hg_gi_field_place_grid(
    struct hg_gi_field *field, const struct hg_gi_field *grid) HG_MUST_CHECK;
// A probe becomes what that of another grid with the same spacing is.
void hg_gi_probe_copy(
    struct hg_gi_field *field, uint32_t probe, const struct hg_gi_field *from, uint32_t from_probe);
// An empty probe begins with the light of the coarser grids, if they have any; it counts as much as
// a few rays.
void hg_gi_probe_seed(struct hg_gi_field *field, uint32_t probe);
void hg_gi_field_finish(struct hg_gi_field *field, struct hg_gpu *gpu);
uint64_t hg_gi_field_bytes(const struct hg_gi_field *field);
// What a field of so many probes takes, on the host and the device together.
uint64_t hg_gi_field_bytes_of(uint32_t probes);

// The probe takes part: it is updated, and lookups read it once it has been, unless it is covered.
static inline bool hg_gi_probe_is_awake(const struct hg_gi_field *field, uint32_t probe)
{
    return field->needed[probe] && !field->inside[probe];
}
static inline bool hg_gi_probe_is_read(const struct hg_gi_field *field, uint32_t probe)
{
    return hg_gi_probe_is_awake(field, probe) && !field->covered[probe];
}
// Rays have come to it from all around: every direction has its share.
bool hg_gi_probe_is_lit(const struct hg_gi_field *field, uint32_t probe);
void hg_gi_probe_position(const struct hg_gi_field *field, uint32_t probe, float out[3]);
// Moves a probe out of and away from what its rays met, and says whether it is inside of something.
// Of a grid with a coarser one: needed where surfaces are so near that lookups read it. last: the
// distances go to the moments of a probe that stays, so that light does not leak before it has
// been updated a few times.
void hg_gi_probe_relocate(struct hg_gi_field *field, uint32_t probe, const struct hg_gi_ray *rays,
    uint32_t count, bool last);
// What a ray to a peak of the environment, or to an emitter, brings if nothing hides it:
// illuminance across the direction.
struct hg_gi_peak {
    float direction[3], light[3];
    bool hidden;
};
struct hg_gi_brought { // rays from all around; those to peaks and to emitters, of whose light the
                       // mean counts
    const float (*sky)[HG_PROBE_IRRADIANCE_TEXELS]; // [3] irradiance over pi of the environment, if
                                                    // nothing is in the way
    const struct hg_gi_ray *rays;
    const struct hg_gi_peak *peaks, *emitters;
    uint32_t count, peak_count, emitter_count;
};
// Adds rays to sums of light that are multiplied by `keep` first, and to the moments. What of the
// environment reaches the probe is the share that its rays see of what they would meet with nothing
// in the way, times `sky`: where all of it is seen that has no noise (ratio estimator).
void hg_gi_probe_gather(
    struct hg_gi_field *field, uint32_t probe, const struct hg_gi_brought *brought, float keep);

// Mean over some probes of the logarithm of their light, from wherever: how much it grows from
// round to round tells how much of what bounces is still to come.
double hg_gi_field_log_light(
    const struct hg_gi_field *field, const uint32_t *probes, uint32_t count);

// Geometry has changed: what rays meet from now on counts more than the distances that the probes
// hold which were updated since it last did.
void hg_gi_field_doubt_distances(struct hg_gi_field *field);

// Irradiance over pi on a surface: of the field where its grid is, of coarser ones towards its edge
// and beyond, and where no probe of it sees the surface. xi: three numbers in [0, 1), as in the
// shader.
struct hg_gi_point {
    float position[3], normal[3], view[3];
};
// Returns how much of it is known: 1, less where no probe has light.
float hg_gi_field_irradiance(const struct hg_gi_field *field, const struct hg_gi_point *point,
    const float xi[3], float out[3]);

// Packs and uploads what has changed. HG_E_NOMEM, device errors.
enum hg_status hg_gi_field_upload(struct hg_gi_field *field, struct hg_gpu *gpu,
    struct hg_jobs *jobs, struct hg_error *err) HG_MUST_CHECK;

#endif
