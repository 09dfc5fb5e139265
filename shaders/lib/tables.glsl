// tables.glsl - the tables of a scene, from uniform blocks where they fit, else by address.
//
// Which ones fit is a specialisation constant, so that the other way costs nothing: software
// rasterisers run both sides of a branch.
#ifndef HG_LIB_TABLES_GLSL
#define HG_LIB_TABLES_GLSL

#include "lib/frame.glsl"
#include "shared/features.h"

layout(constant_id = 1) const uint hg_tables = 0u; // HG_TABLE_BIT of each table that fits
layout(constant_id = 2) const uint hg_features = HG_FEATURE_ALL; // HG_FEATURE_*: what may occur

layout(constant_id = 5) const uint hg_features2 = HG_FEATURE2_ALL; // HG_MIX_* and HG_FEATURE2_*

#define HG_HAS(feature) ((hg_features & (feature)) != 0u)
#define HG_HAS2(feature) ((hg_features2 & (feature)) != 0u)
#define HG_HAS_MIX(kind) ((hg_features2 & (kind)) != 0u)

#define HG_TABLE(slot, type, bytes, name) \
    layout(set = 0, binding = slot, scalar) uniform hg_block_##name \
    { \
        type hg_table_##name[HG_TABLE_BYTES / bytes]; \
    };
HG_TABLE(HG_BIND_DRAWS, hg_gpu_draw, 16, draws)
HG_TABLE(HG_BIND_INSTANCES, hg_gpu_instance, 112, instances)
HG_TABLE(HG_BIND_PARTS, hg_gpu_part, 32, parts)
HG_TABLE(HG_BIND_MATERIALS, hg_gpu_material, 240, materials)
HG_TABLE(HG_BIND_PAGE_TABLE, uint, 4, pages)
HG_TABLE(HG_BIND_LIGHTS, hg_gpu_light, 64, lights)
HG_TABLE(HG_BIND_SHADOWS, hg_gpu_shadow, 80, shadows)
HG_TABLE(HG_BIND_SHADOWS, uint, 4, shadow_words) // the same, with the table of pages behind it
HG_TABLE(HG_BIND_DFG_TABLE, uint, 4, dfg)
HG_TABLE(HG_BIND_IRRADIANCE, vec4, 16, irradiance)
HG_TABLE(HG_BIND_TRIANGLE_CACHE, uint, 4, facets)

#define HG_IN_UNIFORM(binding) ((hg_tables & HG_TABLE_BIT(binding)) != 0u)

hg_gpu_draw hg_draw_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_DRAWS))
        return hg_table_draws[i];
    return hg_frame.geometry.draws.v[i];
}

mat4x3 hg_world_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_INSTANCES))
        return hg_table_instances[i].world;
    return hg_frame.geometry.instances.v[i].world;
}

hg_gpu_part hg_part_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_PARTS))
        return hg_table_parts[i];
    return hg_frame.geometry.parts.v[i];
}

// One field of a material, so that only what is used is read.
#define HG_MATERIAL_AT(i, field) \
    (HG_IN_UNIFORM(HG_BIND_MATERIALS) ? hg_table_materials[i].field \
                                      : hg_frame.geometry.materials.v[i].field)

hg_gpu_texture hg_material_texture_at(uint i, uint slot)
{
    if (HG_IN_UNIFORM(HG_BIND_MATERIALS))
        return hg_table_materials[i].slots[slot];
    return hg_frame.geometry.materials.v[i].slots[slot];
}

uint hg_page_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_PAGE_TABLE))
        return hg_table_pages[i];
    return hg_frame.textures.table.v[i];
}

hg_gpu_light hg_light_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_LIGHTS))
        return hg_table_lights[i];
    return hg_frame.lighting.lights.v[i];
}

hg_gpu_shadow hg_shadow_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_SHADOWS))
        return hg_table_shadows[i];
    return hg_frame.lighting.shadows.v[i];
}

// Word of the table of pages.
uint hg_shadow_page_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_SHADOWS))
        return hg_table_shadow_words[hg_frame.lighting.pages.first + i];
    return hg_frame.lighting.pages.table.v[i];
}

// Up to HG_DFG_BLOCK_WORDS.
vec2 hg_dfg_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_DFG_TABLE))
        return unpackUnorm2x16(hg_table_dfg[i]);
    return unpackUnorm2x16(hg_frame.lighting.dfg.v[i]);
}

// From there on, between 2, 4, 8, 16 entries of a table of that many coordinates, the first one
// fastest. place: 0..1.
vec2 hg_table_1(uint first, float place, uint size)
{
    float p = clamp(place, 0.0, 1.0) * float(size - 1u);
    uint i = min(uint(p), size - 2u), k = first + i;
    vec2 low = unpackUnorm2x16(hg_frame.lighting.dfg.v[k]);
    return mix(low, unpackUnorm2x16(hg_frame.lighting.dfg.v[k + 1u]), p - float(i));
}

vec2 hg_table_2(uint first, vec2 place, uvec2 size)
{
    float p = clamp(place.y, 0.0, 1.0) * float(size.y - 1u);
    uint i = min(uint(p), size.y - 2u), k = first + i * size.x;
    return mix(hg_table_1(k, place.x, size.x), hg_table_1(k + size.x, place.x, size.x), p - float(i));
}

vec2 hg_table_3(uint first, vec3 place, uvec3 size)
{
    float p = clamp(place.z, 0.0, 1.0) * float(size.z - 1u);
    uint i = min(uint(p), size.z - 2u), layer = size.x * size.y, k = first + i * layer;
    return mix(hg_table_2(k, place.xy, size.xy), hg_table_2(k + layer, place.xy, size.xy),
        p - float(i));
}

vec2 hg_table_4(uint first, vec4 place, uvec4 size)
{
    float p = clamp(place.w, 0.0, 1.0) * float(size.w - 1u);
    uint i = min(uint(p), size.w - 2u), block = size.x * size.y * size.z, k = first + i * block;
    return mix(hg_table_3(k, place.xyz, size.xyz), hg_table_3(k + block, place.xyz, size.xyz),
        p - float(i));
}

// Only where there are facets, which is where they fit (HG_FEATURE_NO_TRIANGLE_CACHE).
uint hg_triangle_cache_first_at(uint draw)
{
    return hg_table_facets[draw];
}

vec3 hg_irradiance_at(uint i)
{
    if (HG_IN_UNIFORM(HG_BIND_IRRADIANCE))
        return hg_table_irradiance[i].rgb;
    return hg_frame.lighting.irradiance.v[i].rgb;
}

#endif
