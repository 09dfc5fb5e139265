// debug_environment.h - debug overrides from environment variables, for the programs that render.
// A library of its own: the renderer does not read them.
#ifndef HG_RENDERER_DEBUG_ENVIRONMENT_H
#define HG_RENDERER_DEBUG_ENVIRONMENT_H

#include "renderer/scene_gpu/debug_overrides.h"

// HELIO_CULLING=off, HELIO_RASTER=device, HELIO_PREFETCH=off, HELIO_GPU_TABLES=off,
// HELIO_GPU_OPTIMISE=on|off, HELIO_DARK=on|off and HELIO_IRRADIANCE_RAYS=off; other values count as
// none. Before there are threads.
struct hg_debug_overrides hg_debug_environment_read(void);

#endif
