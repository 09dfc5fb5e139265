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
    HG_UINT reserved;
};
HG_SHARED_SIZE(hg_gpu_material, 240);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_material_list {
    hg_gpu_material v[];
};
#endif

#endif
