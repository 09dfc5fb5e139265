// light_tint.h - profiles and images of lights as the host evaluates them: what
// lib/light_table.glsl does. Floor 2 (light). Pure functions, any thread.
#ifndef HG_RENDERER_LIGHT_LIGHT_TINT_H
#define HG_RENDERER_LIGHT_LIGHT_TINT_H

#include <stdbool.h>
#include <stdint.h>

#include "shaders/shared/light.h"

// Whether a light has any; the others are 1.
bool hg_light_is_tinted(const struct hg_gpu_light *light);
// What profile and projected image leave of a light at a point. tables: hg_lighting_sources.tables.
void hg_light_tint(const struct hg_gpu_light *light, const uint32_t *tables,
    const float position_ws[3], float out[3]);
// Colour of the surface of a rectangle or disc at an offset from its middle.
void hg_light_surface_tint(const struct hg_gpu_light *light, const uint32_t *tables,
    const float offset_ws[3], float out[3]);

#endif
