// emissive.h - emissive triangles as rays of the dynamic field and of irradiance see them: few rays
// meet small ones by chance, so rays of their own go there (next event estimation).
// Floor 2. Thread: the render thread; lookups from any.
//
// A point is chosen by resampled importance sampling (Talbot, Cline and Egbert 2005, "Importance
// Resampling for Global Illumination"): some candidates by the power of their triangles, one of
// them by what it would bring if nothing were in the way. Large emitters and near ones are better
// met by chance, so light is shared by the densities of both ways (balance heuristic: Veach and
// Guibas 1995, "Optimally Combining Sampling Techniques for Monte Carlo Rendering"), of which that
// of the candidates stands for that of the chosen ones: the shares add up to one whatever it is.
#ifndef HG_RENDERER_HOST_SHADING_EMISSIVE_H
#define HG_RENDERER_HOST_SHADING_EMISSIVE_H

#include "renderer/host_shading/surfaces.h"

#define HG_HOST_MOST_EMISSIVE (1u << 18) // triangles; of scenes with more, none is known

struct hg_host_emissive_triangle {
    uint32_t piece, triangle;
};

struct hg_host_emissive {                        // zeroed: none
    const struct hg_host_surfaces *surfaces;     // borrowed
    struct hg_host_emissive_triangle *triangles; // [count]
    float *sums;    // [count] of luminance times area, up to each triangle
    uint32_t count; // 0: what rays meet shines by itself
    uint64_t state; // hash of where the triangles are and of what they send
    size_t triangle_capacity, sum_capacity;
    const struct hg_ray_geometry_piece *pieces; // of the surfaces that it is in line with,
    uint64_t built;                             // when they were built that often
};

// Brings the emitters up to date with surfaces that were synced. HG_E_NOMEM.
enum hg_status hg_host_emissive_sync(
    struct hg_host_emissive *emissive, const struct hg_host_surfaces *surfaces) HG_MUST_CHECK;
void hg_host_emissive_finish(struct hg_host_emissive *emissive);

// What the light is for: a surface, or a probe, which has no normal.
struct hg_host_emissive_receiver {
    float position[3];
    const float *normal; // unit; its other rays go over the cosine. NULL: light from everywhere
                         // counts, and its other rays have this density, for each of these:
    float density;       // 1 / sr
    uint64_t seed;       // another one: another point
};
// Where the ray goes, and its share of what it would bring if nothing were in the way.
struct hg_host_emissive_ray {
    float direction[3], distance; // unit; metres to just before the point
    float light[3];               // irradiance over pi; of probes illuminance across the direction
};
// False: nothing there shines this way. Only where count > 0.
bool hg_host_emissive_choose(const struct hg_host_emissive *emissive,
    const struct hg_host_emissive_receiver *receiver, struct hg_host_emissive_ray *out);

// Share of the radiance of an emitter that these rays bring; the rest is that of a ray of the
// density `other` which met it at the distance under this cosine of its normal. 0 where count is 0.
float hg_host_emissive_share(const struct hg_host_emissive *emissive, const float emitted[3],
    float distance, float cosine, float other);

#endif
