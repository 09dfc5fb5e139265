#include "renderer/debug_environment.h"

#include <stdlib.h>
#include <string.h>

static bool is(const char *variable, const char *value)
{
    const char *given = getenv(variable);
    return given != NULL && strcmp(given, value) == 0;
}

static enum hg_override either(const char *variable)
{
    return is(variable, "off")  ? HG_OVERRIDE_OFF
           : is(variable, "on") ? HG_OVERRIDE_ON
                                : HG_OVERRIDE_AUTO;
}

struct hg_debug_overrides hg_debug_environment_read(void)
{
    return (struct hg_debug_overrides){
        .no_culling = is("HELIO_CULLING", "off"),
        .no_cpu_raster = is("HELIO_RASTER", "device"),
        .no_prefetch = is("HELIO_PREFETCH", "off"),
        .table_addresses = is("HELIO_GPU_TABLES", "off"),
        .short_shaders = either("HELIO_GPU_OPTIMISE"),
        .unlit_tiles = either("HELIO_DARK"),
        .no_irradiance_rays = is("HELIO_IRRADIANCE_RAYS", "off"),
    };
}
