// materials.h - materials as shaders read them.
// Floor 2 (geometry). Pure: any thread.
#ifndef HG_RENDERER_GEOMETRY_MATERIALS_H
#define HG_RENDERER_GEOMETRY_MATERIALS_H

#include "renderer/scene/scene.h"
#include "renderer/texture/textures.h"
#include "shaders/shared/material.h"

// False when it has textures of more than one shape.
bool hg_material_pack(const struct hg_material *material, const struct hg_textures *textures,
    struct hg_gpu_material *out);
// The second record, of materials with hg_material_features (geometry.h).
void hg_material_pack_lobes(const struct hg_material *material, const struct hg_textures *textures,
    struct hg_gpu_lobes *out);

#endif
