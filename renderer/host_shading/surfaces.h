// surfaces.h - what rays meet, shaded on the host from means: a diffuse albedo and emission per
// material, never its textures texel by texel.
// Floor 2. Thread: the render thread; lookups from any.
#ifndef HG_RENDERER_HOST_SHADING_SURFACES_H
#define HG_RENDERER_HOST_SHADING_SURFACES_H

#include "renderer/texture/textures.h"
#include "renderer/trace/ray_geometry.h"
#include "shaders/shared/ray.h"

// Transmission of a material, as of smooth surfaces (KHR_materials_transmission, _volume).
struct hg_host_glass {
    bool clear; // else it does not, or is rough
    bool thin;  // walls without a volume behind them
    float ior;
    float tint[3];       // of light that passes the surface
    float absorption[3]; // of the volume, 1 / m
};

struct hg_host_material {
    uint64_t id, revision;
    float albedo[3];   // of all light that comes back, mirrored or scattered
    float emission[3]; // radiance
    float emitted[3];  // of that what rays to lights find: colours of unlit surfaces are no light
    bool double_sided;
    struct hg_host_glass glass;
    struct hg_host_mask *mask; // tails.h; NULL: no holes
};

struct hg_host_surfaces { // zeroed: none
    const struct hg_ray_geometry_piece *pieces;
    uint32_t piece_count;
    uint32_t *piece_materials; // [pieces]
    uint32_t *first_pieces;    // [draws + 1]
    uint32_t draw_count;
    struct hg_host_material *materials;
    size_t material_count, material_capacity;
    bool has_masks;
    uint64_t rays_revision, geometry_revision; // that it is in line with; 0: none
    uint64_t built;                            // times
};

// Brings the surfaces up to date with ray geometry, which is borrowed until the next sync. Waits
// for textures that are seen for the first time to be decoded. HG_E_NOMEM.
enum hg_status hg_host_surfaces_sync(struct hg_host_surfaces *surfaces,
    const struct hg_geometry *geometry, const struct hg_ray_geometry *rays,
    struct hg_textures *textures) HG_MUST_CHECK;
void hg_host_surfaces_finish(struct hg_host_surfaces *surfaces);

struct hg_host_surface {
    float normal[3]; // geometric, unit, on the ray's side
    const struct hg_host_material *material;
    bool back;   // what has one side was met from behind
    bool inner;  // met from behind, whether it has one side or two: from inside of closed surfaces
    bool layers; // blends or transmits
};
// The surface at a hit; direction: of the ray, world space.
void hg_host_surface_at(const struct hg_host_surfaces *surfaces, const struct hg_gpu_hit *hit,
    const float direction[3], struct hg_host_surface *out);
// Whether the alpha mask has a hole at a hit.
bool hg_host_surface_is_hole(const struct hg_host_surfaces *surfaces, const struct hg_gpu_hit *hit);
// The interpolated normal there, unit, on the ray's side: the geometric one of deformed parts, and
// where the ray comes from behind it.
void hg_host_surface_normal(const struct hg_host_surfaces *surfaces, const struct hg_gpu_hit *hit,
    const float direction[3], const struct hg_host_surface *surface, float out[3]);

#endif
