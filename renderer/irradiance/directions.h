// directions.h - which way the ray of a texel goes, and what it counts for.
// Floor 2, private to renderer/irradiance. Pure; any thread.
//
// Rays go over the cosine or to where light came from so far (guide.h), each half of the time.
// Rough surfaces mirror what is around them as well, so one in three of theirs goes by the specular
// lobe. All count for both by the density of these ways together (one-sample model: Veach and
// Guibas 1995, "Optimally Combining Sampling Techniques for Monte Carlo Rendering").
#ifndef HG_RENDERER_IRRADIANCE_DIRECTIONS_H
#define HG_RENDERER_IRRADIANCE_DIRECTIONS_H

#include <stdbool.h>

#include "renderer/host_shading/lobe.h"
#include "renderer/host_shading/texels.h"
#include "renderer/irradiance/cells.h"
#include "renderer/irradiance/guide.h"

struct hg_irradiance_surface { // of a texel
    float normal[3], facet[3]; // interpolated; of the triangle
    float mirror[3];           // that it mirrors about
    float view[3];             // to the eye, unit
    float roughness, f0;
    bool rough; // mirrors as a rough lobe; else reflections have rays of their own
};
// By its words (shaders/shared/reflect.h).
static inline bool hg_irradiance_is_rough(const uint32_t mirror[2])
{
    struct hg_host_texel_mirror m;
    hg_host_texel_mirror(mirror, &m);
    return m.roughness >= HG_LOBE_ROUGH && m.f0 > 0;
}
void hg_irradiance_surface_at(const struct hg_host_texels *texels, const uint32_t at[2],
    const uint32_t light[4], const uint32_t mirror[2], struct hg_irradiance_surface *out);

struct hg_irradiance_direction {
    float way[3];            // unit
    float diffuse, mirrored; // weights of what comes from there
    float xi[3];             // in [0, 1), that it was chosen by
};
// turn: of a cell (cells.h). guided: NULL where nothing is known of where light comes from.
void hg_irradiance_choose(const struct hg_irradiance_turn *turn,
    const struct hg_irradiance_surface *s, const struct hg_irradiance_distribution *guided,
    struct hg_irradiance_direction *out);

#endif
