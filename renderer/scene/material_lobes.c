// material_lobes.c - which lobes of KHR_materials_* a material makes use of. See scene.h.
#include "renderer/scene/scene.h"
#include "shaders/shared/features.h"
#include "shaders/shared/light.h"

static bool is_black(const float color[3])
{
    return color[0] <= 0.0f && color[1] <= 0.0f && color[2] <= 0.0f;
}

static bool has_specular(const struct hg_material *m)
{
    const float *c = m->specular.color;
    return m->specular.factor != 1.0f || c[0] != 1.0f || c[1] != 1.0f || c[2] != 1.0f ||
           m->slots[HG_SLOT_SPECULAR].texture != NULL ||
           m->slots[HG_SLOT_SPECULAR_COLOR].texture != NULL;
}

static uint32_t factor_features(const struct hg_material *m)
{
    if (m->unlit)
        return 0;
    return (m->clearcoat.factor > 0.0f ? HG_FEATURE_CLEARCOAT : 0u) |
           (!is_black(m->sheen.color) ? HG_FEATURE_SHEEN : 0u) |
           (m->iridescence.factor > 0.0f ? HG_FEATURE_IRIDESCENCE : 0u) |
           (m->anisotropy.strength > 0.0f ? HG_FEATURE_ANISOTROPY : 0u) |
           (has_specular(m) ? HG_FEATURE_SPECULAR : 0u) |
           (m->transmission > 0.0f ? HG_FEATURE_TRANSMISSION : 0u) |
           (m->diffuse_transmission.factor > 0.0f ? HG_FEATURE_DIFFUSE_TRANSMISSION : 0u);
}

// The lobe that a slot belongs to; 0: shaded for every material.
static uint32_t slot_feature(enum hg_texture_slot slot)
{
    static const uint32_t features[HG_SLOT_COUNT] = {[HG_SLOT_CLEARCOAT] = HG_FEATURE_CLEARCOAT,
        [HG_SLOT_CLEARCOAT_ROUGHNESS] = HG_FEATURE_CLEARCOAT,
        [HG_SLOT_CLEARCOAT_NORMAL] = HG_FEATURE_CLEARCOAT,
        [HG_SLOT_SHEEN_COLOR] = HG_FEATURE_SHEEN,
        [HG_SLOT_SHEEN_ROUGHNESS] = HG_FEATURE_SHEEN,
        [HG_SLOT_TRANSMISSION] = HG_FEATURE_TRANSMISSION,
        [HG_SLOT_THICKNESS] = HG_FEATURE_TRANSMISSION | HG_FEATURE_DIFFUSE_TRANSMISSION,
        [HG_SLOT_SPECULAR] = HG_FEATURE_SPECULAR,
        [HG_SLOT_SPECULAR_COLOR] = HG_FEATURE_SPECULAR,
        [HG_SLOT_IRIDESCENCE] = HG_FEATURE_IRIDESCENCE,
        [HG_SLOT_IRIDESCENCE_THICKNESS] = HG_FEATURE_IRIDESCENCE,
        [HG_SLOT_ANISOTROPY] = HG_FEATURE_ANISOTROPY,
        [HG_SLOT_DIFFUSE_TRANSMISSION] = HG_FEATURE_DIFFUSE_TRANSMISSION,
        [HG_SLOT_DIFFUSE_TRANSMISSION_COLOR] = HG_FEATURE_DIFFUSE_TRANSMISSION};
    return features[slot];
}

bool hg_material_uses_slot(const struct hg_material *m, enum hg_texture_slot slot)
{
    const uint32_t lobe = slot_feature(slot);
    return m->slots[slot].texture != NULL && (lobe == 0 || (factor_features(m) & lobe) != 0);
}

uint32_t hg_material_lobes(const struct hg_material *m)
{
    uint32_t features = factor_features(m);
    for (int slot = HG_SLOT_EMISSIVE + 1; slot < HG_SLOT_COUNT && features != 0; slot++)
        if (hg_material_uses_slot(m, (enum hg_texture_slot)slot))
            features |= HG_FEATURE_LOBE_TEXTURES;
    return features;
}

uint32_t hg_material_mixes(const struct hg_material *m)
{
    const uint32_t lobes = factor_features(m);
    const bool layered = (lobes & (HG_FEATURE_CLEARCOAT | HG_FEATURE_SHEEN)) != 0;
    const bool anisotropic = (lobes & HG_FEATURE_ANISOTROPY) != 0;
    const uint32_t mixes = layered && anisotropic ? HG_MIX_LAYERED_ANISOTROPY : 0u;
    if ((lobes & HG_FEATURE_TRANSMISSION) == 0)
        return mixes;
    const float most = m->ior + HG_DISPERSION_HALF_SPREAD * (m->ior - 1.0f) * m->dispersion;
    const bool bends = m->ior >= 1.0f && most <= (1.0f + HG_GLASS_FAR) / (1.0f - HG_GLASS_FAR);
    const bool unusual = !bends || (lobes & (HG_FEATURE_IRIDESCENCE | HG_FEATURE_SPECULAR)) != 0;
    return mixes | (anisotropic ? HG_MIX_ANISOTROPIC_GLASS : 0u) |
           (layered ? HG_MIX_LAYERED_GLASS : 0u) | (unusual ? HG_MIX_UNUSUAL_GLASS : 0u);
}
