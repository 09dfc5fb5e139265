#include "renderer/debug_environment.h"

#include <stdlib.h>
#include <string.h>

static bool is(const char *variable, const char *value)
{
    const char *given = getenv(variable);
    return given != NULL && strcmp(given, value) == 0;
}

struct hg_debug_overrides hg_debug_environment_read(void)
{
    return (struct hg_debug_overrides){
        .no_culling = is("HELIO_CULLING", "off"),
        .no_cpu_raster = is("HELIO_RASTER", "device"),
        .no_prefetch = is("HELIO_PREFETCH", "off"),
        .table_addresses = is("HELIO_GPU_TABLES", "off"),
        .unlit_tiles = is("HELIO_DARK", "off")  ? HG_OVERRIDE_OFF
                       : is("HELIO_DARK", "on") ? HG_OVERRIDE_ON
                                                : HG_OVERRIDE_AUTO,
    };
}
