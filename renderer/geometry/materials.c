// materials.c - materials as shaders read them. See materials.h.
#include <math.h>
#include <string.h>

#include "renderer/geometry/materials.h"

static const enum hg_texture_slot slots[HG_MATERIAL_SLOTS] = {
    [HG_MATERIAL_BASE_COLOR] = HG_SLOT_BASE_COLOR,
    [HG_MATERIAL_EMISSIVE] = HG_SLOT_EMISSIVE,
    [HG_MATERIAL_NORMAL] = HG_SLOT_NORMAL,
    [HG_MATERIAL_MR] = HG_SLOT_METALLIC_ROUGHNESS,
    [HG_MATERIAL_OCCLUSION] = HG_SLOT_OCCLUSION,
};

static const enum hg_texture_slot lobe_slots[HG_LOBES_SLOTS] = {
    [HG_LOBES_SHEEN_COLOR] = HG_SLOT_SHEEN_COLOR,
    [HG_LOBES_SPECULAR_COLOR] = HG_SLOT_SPECULAR_COLOR,
    [HG_LOBES_DIFFUSE_TRANSMISSION_COLOR] = HG_SLOT_DIFFUSE_TRANSMISSION_COLOR,
    [HG_LOBES_CLEARCOAT] = HG_SLOT_CLEARCOAT,
    [HG_LOBES_CLEARCOAT_ROUGHNESS] = HG_SLOT_CLEARCOAT_ROUGHNESS,
    [HG_LOBES_CLEARCOAT_NORMAL] = HG_SLOT_CLEARCOAT_NORMAL,
    [HG_LOBES_SHEEN_ROUGHNESS] = HG_SLOT_SHEEN_ROUGHNESS,
    [HG_LOBES_TRANSMISSION] = HG_SLOT_TRANSMISSION,
    [HG_LOBES_THICKNESS] = HG_SLOT_THICKNESS,
    [HG_LOBES_SPECULAR] = HG_SLOT_SPECULAR,
    [HG_LOBES_IRIDESCENCE] = HG_SLOT_IRIDESCENCE,
    [HG_LOBES_IRIDESCENCE_THICKNESS] = HG_SLOT_IRIDESCENCE_THICKNESS,
    [HG_LOBES_ANISOTROPY] = HG_SLOT_ANISOTROPY,
    [HG_LOBES_DIFFUSE_TRANSMISSION] = HG_SLOT_DIFFUSE_TRANSMISSION,
};

// False where the slot has no texture.
static bool pack_texture(const struct hg_material *m, const struct hg_textures *textures,
    enum hg_texture_slot slot, struct hg_gpu_texture *out, float transform[6])
{
    static const float identity[6] = {1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f};
    const struct hg_texture_ref *ref = &m->slots[slot];
    if (ref->texture == NULL || textures == NULL)
        return false;
    const uint32_t index =
        hg_textures_find(textures, ref->texture, hg_texture_slot_use(m, slot), m->alpha_cutoff);
    if (index == HG_TEXTURE_NONE)
        return false;
    *out = hg_textures_record(textures, index);
    if (ref->uv_set == 1)
        out->bits |= HG_TEX_UV1;
    memcpy(transform, ref->uv_transform, sizeof ref->uv_transform);
    if (memcmp(ref->uv_transform, identity, sizeof identity) != 0)
        out->bits |= HG_TEX_TRANSFORM;
    return true;
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
                 (m->unlit ? HG_MATERIAL_UNLIT : 0u) |
                 (m->transmission > 0.0f && !m->unlit ? HG_MATERIAL_TRANSMITS : 0u);
    for (uint32_t i = 0; i < HG_MATERIAL_SLOTS; i++)
        if (pack_texture(m, textures, slots[i], &out->slots[i], out->transforms + i * 6))
            out->flags |= HG_MATERIAL_HAS(i);
    merge_occlusion(out);
    return share_shape(out);
}

// --- lobes ---------------------------------------------------------------------------------------

static struct hg_vec3 vec3_of(const float v[3])
{
    return (struct hg_vec3){v[0], v[1], v[2]};
}

// Absorption per metre from the colour that is left after a distance (KHR_materials_volume); what
// lets nothing through becomes 2^-40 there.
static float absorption(float color, float distance)
{
    return isfinite(distance) ? -logf(fmaxf(fminf(color, 1.0f), 0x1p-40f)) / distance : 0.0f;
}

void hg_material_pack_lobes(
    const struct hg_material *m, const struct hg_textures *textures, struct hg_gpu_lobes *out)
{
    memset(out, 0, sizeof *out);
    const float *tint = m->volume.attenuation_color, distance = m->volume.attenuation_distance;
    *out = (struct hg_gpu_lobes){.ior = m->ior > 0.0f ? m->ior : 10000.0f,
        .specular = m->specular.factor,
        .specular_color = vec3_of(m->specular.color),
        .clearcoat = m->clearcoat.factor,
        .clearcoat_roughness = m->clearcoat.roughness,
        .clearcoat_normal_scale = m->clearcoat.normal_scale,
        .sheen_color = vec3_of(m->sheen.color),
        .sheen_roughness = m->sheen.roughness,
        .transmission = m->transmission,
        .thickness = m->volume.thickness,
        .attenuation = {absorption(tint[0], distance), absorption(tint[1], distance),
            absorption(tint[2], distance)},
        .dispersion = m->dispersion,
        .iridescence = m->iridescence.factor,
        .iridescence_ior = m->iridescence.ior,
        .iridescence_min = m->iridescence.thickness_min_nm,
        .iridescence_max = m->iridescence.thickness_max_nm,
        .anisotropy = m->anisotropy.strength,
        .anisotropy_direction = {cosf(m->anisotropy.rotation_rad),
            sinf(m->anisotropy.rotation_rad)},
        .diffuse_transmission = m->diffuse_transmission.factor,
        .diffuse_transmission_color = vec3_of(m->diffuse_transmission.color)};
    for (uint32_t i = 0; i < HG_LOBES_SLOTS; i++)
        if (hg_material_uses_slot(m, lobe_slots[i]) &&
            pack_texture(m, textures, lobe_slots[i], &out->slots[i], out->transforms + i * 6))
            out->flags |= HG_LOBES_HAS(i);
}
