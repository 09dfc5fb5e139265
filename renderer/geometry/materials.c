// materials.c - materials as shaders read them. See internal.h.
#include <string.h>

#include "renderer/geometry/internal.h"

static const enum hg_texture_slot slots[HG_MATERIAL_SLOTS] = {
    [HG_MATERIAL_BASE_COLOR] = HG_SLOT_BASE_COLOR,
    [HG_MATERIAL_EMISSIVE] = HG_SLOT_EMISSIVE,
    [HG_MATERIAL_NORMAL] = HG_SLOT_NORMAL,
    [HG_MATERIAL_MR] = HG_SLOT_METALLIC_ROUGHNESS,
    [HG_MATERIAL_OCCLUSION] = HG_SLOT_OCCLUSION,
};

static void pack_slot(const struct hg_material *m, const struct hg_textures *textures,
    uint32_t slot, struct hg_gpu_material *out)
{
    static const float identity[6] = {1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f};
    const struct hg_texture_ref *ref = &m->slots[slots[slot]];
    if (ref->texture == NULL || textures == NULL)
        return;
    const uint32_t index = hg_textures_find(
        textures, ref->texture, hg_texture_slot_use(m, slots[slot]), m->alpha_cutoff);
    if (index == HG_TEXTURE_NONE)
        return;
    out->flags |= HG_MATERIAL_HAS(slot);
    out->slots[slot] = hg_textures_record(textures, index);
    if (ref->uv_set == 1)
        out->slots[slot].bits |= HG_TEX_UV1;
    memcpy(out->transforms + slot * 6, ref->uv_transform, sizeof ref->uv_transform);
    if (memcmp(ref->uv_transform, identity, sizeof identity) != 0)
        out->slots[slot].bits |= HG_TEX_TRANSFORM;
}

// Occlusion in the red of the metallic-roughness texture costs no lookup of its own.
static void merge_occlusion(struct hg_gpu_material *out)
{
    const uint32_t both = HG_MATERIAL_HAS(HG_MATERIAL_MR) | HG_MATERIAL_HAS(HG_MATERIAL_OCCLUSION);
    if ((out->flags & both) != both ||
        memcmp(&out->slots[HG_MATERIAL_MR], &out->slots[HG_MATERIAL_OCCLUSION],
            sizeof out->slots[0]) != 0 ||
        memcmp(out->transforms + HG_MATERIAL_MR * 6, out->transforms + HG_MATERIAL_OCCLUSION * 6,
            6 * sizeof(float)) != 0)
        return;
    out->flags &= ~HG_MATERIAL_HAS(HG_MATERIAL_OCCLUSION);
    out->flags |= HG_MATERIAL_PACKED_ORM;
}

// Absent slots take the place of one that is there, so that all slots have one shape where they
// can.
static bool share_shape(struct hg_gpu_material *out)
{
    const uint32_t pool = 3u << HG_TEX_POOL_SHIFT;
    const struct hg_gpu_texture *shape = NULL;
    bool one = true;
    for (uint32_t i = 0; i < HG_MATERIAL_SLOTS; i++) {
        if ((out->flags & HG_MATERIAL_HAS(i)) == 0)
            continue;
        shape = shape != NULL ? shape : &out->slots[i];
        one = one && out->slots[i].size == shape->size &&
              ((out->slots[i].bits ^ shape->bits) & ~pool) == 0;
    }
    for (uint32_t i = 0; i < HG_MATERIAL_SLOTS && one && shape != NULL; i++) {
        if ((out->flags & HG_MATERIAL_HAS(i)) == 0)
            out->slots[i] = *shape; // looked up with the others and thrown away
    }
    return one;
}

bool hg_material_pack(
    const struct hg_material *m, const struct hg_textures *textures, struct hg_gpu_material *out)
{
    memset(out, 0, sizeof *out);
    const float ratio = (m->ior - 1.0f) / (m->ior + 1.0f);
    out->base_color =
        (struct hg_vec4){m->base_color[0], m->base_color[1], m->base_color[2], m->base_color[3]};
    out->emissive = (struct hg_vec3){m->emissive[0], m->emissive[1], m->emissive[2]};
    out->metallic = m->metallic;
    out->roughness = m->roughness;
    out->normal_scale = m->normal_scale;
    out->occlusion_strength = m->occlusion_strength;
    out->alpha_cutoff = m->alpha_cutoff;
    out->f0 = m->ior > 0.0f ? ratio * ratio : 1.0f;
    out->flags = (m->alpha_mode == HG_ALPHA_MASK ? HG_MATERIAL_MASK : 0u) |
                 (m->alpha_mode == HG_ALPHA_BLEND ? HG_MATERIAL_BLEND : 0u) |
                 (m->double_sided ? HG_MATERIAL_DOUBLE_SIDED : 0u) |
                 (m->unlit ? HG_MATERIAL_UNLIT : 0u);
    for (uint32_t i = 0; i < HG_MATERIAL_SLOTS; i++)
        pack_slot(m, textures, i, out);
    merge_occlusion(out);
    return share_shape(out);
}
