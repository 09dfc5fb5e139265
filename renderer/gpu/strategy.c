// strategy.c - see strategy.h.
#include "renderer/gpu/strategy.h"

struct hg_device_strategy hg_device_strategy_choose(
    bool is_cpu, const struct hg_device_overrides *overrides)
{
    if (!is_cpu)
        return (struct hg_device_strategy){.short_shaders = overrides->short_shaders};
    return (struct hg_device_strategy){.host_reads = true,
        .huge_pages = true,
        .host_raster = !overrides->no_host_raster,
        .host_triangle_cull = !overrides->no_host_triangle_cull,
        .provoking_vertices = true,
        .uniform_tables = !overrides->no_uniform_tables,
        .exact_pipelines = true,
        .unlit_tiles = true,
        .flat_shading = true,
        .host_film = true,
        .host_rays = true,
        .short_shaders = !overrides->no_short_shaders,
        .lazy_pipelines = true};
}
