// sky.h - a clear sky by day and at dusk, as an equirectangular image.
// Floor 2 (light). Pure; the same bytes on every run and for every number of threads.
//
// Rayleigh and Mie scattering and ozone absorption above a round earth, single scattering by ray
// marching plus all further orders after Hillaire 2020, "A Scalable and Production Ready Sky and
// Atmosphere Rendering Technique" (multiple-scattering table, section 5.5); coefficients there,
// table 1. Chosen over Preetham 1999 and Hosek-Wilkie 2012 because it holds at and below the
// horizon, where the warm light of a low sun comes from.
//
// Scale: glTF scenes are lit with a few lux, not with the 120,000 of the true sun, and are looked
// at with exposure 0. Above the atmosphere the sun here gives HG_SKY_SUN_LUX: a white wall facing a
// high sun then comes out a little brighter than display white, a clear sky at about 0.2.
// hg_sky_sun_illuminance is what a directional light should have to go with the sky.
#ifndef HG_RENDERER_LIGHT_ENV_SKY_H
#define HG_RENDERER_LIGHT_ENV_SKY_H

#include "base/jobs.h"
#include "renderer/image/image.h"
#include "renderer/scene/scene.h"

#define HG_SKY_SUN_LUX 4.0f // perpendicular to the sun, outside the atmosphere
#define HG_SKY_WIDTH   1024
#define HG_SKY_HEIGHT  512

struct hg_sky {
    float sun_direction[3]; // towards the sun, unit
    float turbidity;        // 1 (pure air) .. 10 (haze); 0 = 2
    bool with_disc;         // draw the sun itself; off when a directional light stands for it
};

// The sky of an environment of kind SKY, in its own frame: rotation and intensity are applied to
// what it gives. A sun_direction of zero is straight up.
struct hg_sky hg_sky_of(const struct hg_environment *environment, bool scene_has_sun);

// RGBA32F, HG_SKY_WIDTH x HG_SKY_HEIGHT, convention of struct hg_environment. Directions below the
// horizon see a grey ground lit by sun and sky. HG_E_NOMEM. About 0.15 s of one core.
enum hg_status hg_sky_render(
    const struct hg_sky *sky, struct hg_jobs *jobs, struct hg_image *out) HG_MUST_CHECK;
// Adds the disc to the image of a sky that was made without.
void hg_sky_draw_disc(const struct hg_sky *sky, struct hg_image *image);

// Illuminance of the sun seen from the ground, facing it, linear Rec.709 lux.
void hg_sky_sun_illuminance(const struct hg_sky *sky, float out[3]);
// The disc as a directional light, of an environment as it stands in its scene. Zero-initialise:
// what is costly is kept from one update to the next.
struct hg_sky_disc {
    float sun_direction[3], turbidity; // that illuminance was made from
    float illuminance[3];
    float lux[3], towards_ws[3]; // 0: the sky has none
};
void hg_sky_disc_update(
    struct hg_sky_disc *sun, const struct hg_environment *environment, bool scene_has_sun);
static inline bool hg_sky_disc_is_there(const struct hg_sky_disc *sun)
{
    return sun->towards_ws[0] != 0 || sun->towards_ws[1] != 0 || sun->towards_ws[2] != 0;
}

// Luminance of a white diffuser that faces the sun of an environment; 0: it has none.
float hg_sky_sun_luminance(const struct hg_environment *environment, bool scene_has_sun);

#endif
