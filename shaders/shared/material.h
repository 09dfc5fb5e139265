// material.h - materials as shaders read them. Floor 0, shared by C and GLSL (scalar layout).
#ifndef HG_SHADERS_SHARED_MATERIAL_H
#define HG_SHADERS_SHARED_MATERIAL_H

#include "shared/texture.h"

// Slots: the sRGB ones first. Same meaning as enum hg_texture_slot, other order.
#define HG_MATERIAL_BASE_COLOR 0 // rgb, a
#define HG_MATERIAL_EMISSIVE   1 // rgb
#define HG_MATERIAL_NORMAL     2 // tangent space xyz
#define HG_MATERIAL_MR         3 // g roughness, b metallic
#define HG_MATERIAL_OCCLUSION  4 // r
#define HG_MATERIAL_SLOTS      5

// hg_gpu_material.flags; bits 0..4: slot has a texture
#define HG_MATERIAL_HAS(slot)    (1u << (slot))
#define HG_MATERIAL_MASK         0x0100u // alpha < cutoff is not there
#define HG_MATERIAL_BLEND        0x0200u // alpha is coverage; neither: alpha is 1
#define HG_MATERIAL_DOUBLE_SIDED 0x0400u
#define HG_MATERIAL_UNLIT        0x0800u
#define HG_MATERIAL_TRANSMITS    0x1000u // light goes through (hg_gpu_lobes)
#define HG_MATERIAL_PACKED_ORM   0x2000u // occlusion is the red of the metallic-roughness texture

#define HG_MATERIAL_F0 0.0400000028312206 // f0 of an index of refraction of 1.5, as a float

struct hg_gpu_material {
    HG_VEC4 base_color;       // linear
    HG_VEC3 emissive;         // linear, strength included
    HG_UINT flags;            // HG_MATERIAL_*
    float metallic, roughness; // perceptual roughness
    float normal_scale, occlusion_strength;
    float alpha_cutoff;
    float f0;                 // dielectric reflectance at normal incidence: ((ior-1)/(ior+1))^2
    HG_STRUCT(hg_gpu_texture) slots[HG_MATERIAL_SLOTS]; // resolved copies of texture records
    float transforms[HG_MATERIAL_SLOTS * 6]; // row-major 2x3 per slot, if HG_TEX_TRANSFORM
    HG_UINT lobes; // 1 + number of its hg_gpu_lobes; 0: metallic-roughness alone
};
HG_SHARED_SIZE(hg_gpu_material, 240);

// What KHR_materials_* add, in a table of its own that most scenes do not have.
// Slots: the sRGB ones first. Same meaning as enum hg_texture_slot, other order.
#define HG_LOBES_SHEEN_COLOR                0 // rgb
#define HG_LOBES_SPECULAR_COLOR             1 // rgb
#define HG_LOBES_DIFFUSE_TRANSMISSION_COLOR 2 // rgb
#define HG_LOBES_CLEARCOAT                  3 // r
#define HG_LOBES_CLEARCOAT_ROUGHNESS        4 // g
#define HG_LOBES_CLEARCOAT_NORMAL           5 // tangent space xyz
#define HG_LOBES_SHEEN_ROUGHNESS            6 // a
#define HG_LOBES_TRANSMISSION               7 // r
#define HG_LOBES_THICKNESS                  8 // g
#define HG_LOBES_SPECULAR                   9 // a
#define HG_LOBES_IRIDESCENCE                10 // r
#define HG_LOBES_IRIDESCENCE_THICKNESS      11 // g
#define HG_LOBES_ANISOTROPY                 12 // rg direction, b strength
#define HG_LOBES_DIFFUSE_TRANSMISSION       13 // a
#define HG_LOBES_SLOTS                      14
#define HG_LOBES_SRGB_SLOTS                 3

// hg_gpu_lobes.flags; bits 0..13: slot has a texture
#define HG_LOBES_HAS(slot) (1u << (slot))
#define HG_LOBES_TEXTURES  0x3fffu

struct hg_gpu_lobes {
    HG_UINT flags; // HG_LOBES_*
    float ior;     // 10000 stands for infinity
    float specular;
    HG_VEC3 specular_color;
    float clearcoat, clearcoat_roughness, clearcoat_normal_scale;
    HG_VEC3 sheen_color;
    float sheen_roughness;
    float transmission;
    float thickness;     // metres in the space of the mesh; 0: thin-walled
    HG_VEC3 attenuation; // absorption of the volume, 1 / m of world space
    float dispersion;    // 20 / Abbe number
    float iridescence, iridescence_ior;
    float iridescence_min, iridescence_max; // thickness, nm
    float anisotropy;
    HG_VEC2 anisotropy_direction; // cosine and sine of the rotation from the tangent
    float diffuse_transmission;
    HG_VEC3 diffuse_transmission_color;
    HG_STRUCT(hg_gpu_texture) slots[HG_LOBES_SLOTS];
    float transforms[HG_LOBES_SLOTS * 6];
};
HG_SHARED_SIZE(hg_gpu_lobes, 624);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_material_list {
    hg_gpu_material v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_lobes_list {
    hg_gpu_lobes v[];
};
#endif

#endif
