#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <string.h>

static float clamp(double v, double low, double high)
{
    return (float)(v < low ? low : v > high ? high : v);
}

static float unit(const struct hg_gltf_at *at, const char *key, double fallback)
{
    return clamp(hg_gltf_number(at, key, fallback), 0, 1);
}

static void color(const struct hg_gltf_at *at, const char *key, float *out, size_t count)
{
    hg_gltf_numbers(at, key, out, count);
    for (size_t i = 0; i < count; i++)
        out[i] = out[i] > 0 && isfinite(out[i]) ? out[i] : 0;
}

static void read_metallic_roughness(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    struct hg_gltf_at pbr = hg_gltf_key(at, "pbrMetallicRoughness");
    color(&pbr, "baseColorFactor", m->base_color, 4);
    m->metallic = unit(&pbr, "metallicFactor", 1);
    m->roughness = unit(&pbr, "roughnessFactor", 1);
    hg_gltf_texture_ref(g, &pbr, "baseColorTexture", &m->slots[HG_SLOT_BASE_COLOR]);
    hg_gltf_texture_ref(g, &pbr, "metallicRoughnessTexture", &m->slots[HG_SLOT_METALLIC_ROUGHNESS]);
}

static void read_core(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    read_metallic_roughness(g, at, m);
    struct hg_gltf_at normal = hg_gltf_key(at, "normalTexture");
    struct hg_gltf_at occlusion = hg_gltf_key(at, "occlusionTexture");
    m->normal_scale = (float)hg_gltf_number(&normal, "scale", 1);
    m->occlusion_strength = unit(&occlusion, "strength", 1);
    color(at, "emissiveFactor", m->emissive, 3);
    hg_gltf_texture_ref(g, at, "normalTexture", &m->slots[HG_SLOT_NORMAL]);
    hg_gltf_texture_ref(g, at, "occlusionTexture", &m->slots[HG_SLOT_OCCLUSION]);
    hg_gltf_texture_ref(g, at, "emissiveTexture", &m->slots[HG_SLOT_EMISSIVE]);
    const char *mode = hg_gltf_string(at, "alphaMode");
    if (mode && strcmp(mode, "MASK") == 0)
        m->alpha_mode = HG_ALPHA_MASK;
    else if (mode && strcmp(mode, "BLEND") == 0)
        m->alpha_mode = HG_ALPHA_BLEND;
    m->alpha_cutoff = (float)hg_gltf_number(at, "alphaCutoff", 0.5);
    m->double_sided = hg_gltf_bool(at, "doubleSided", false);
}

// ---- KHR_materials_* ---------------------------------------------------------------------------

typedef void extension_fn(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m);

static void read_unlit(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    (void)g;
    (void)at;
    m->unlit = true;
}

static void read_emissive_strength(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    (void)g;
    float strength = clamp(hg_gltf_number(at, "emissiveStrength", 1), 0, 1e9);
    for (int i = 0; i < 3; i++)
        m->emissive[i] *= strength;
}

static void read_clearcoat(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->clearcoat.factor = unit(at, "clearcoatFactor", 0);
    m->clearcoat.roughness = unit(at, "clearcoatRoughnessFactor", 0);
    struct hg_gltf_at normal = hg_gltf_key(at, "clearcoatNormalTexture");
    m->clearcoat.normal_scale = (float)hg_gltf_number(&normal, "scale", 1);
    hg_gltf_texture_ref(g, at, "clearcoatTexture", &m->slots[HG_SLOT_CLEARCOAT]);
    hg_gltf_texture_ref(g, at, "clearcoatRoughnessTexture", &m->slots[HG_SLOT_CLEARCOAT_ROUGHNESS]);
    hg_gltf_texture_ref(g, at, "clearcoatNormalTexture", &m->slots[HG_SLOT_CLEARCOAT_NORMAL]);
}

static void read_sheen(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    color(at, "sheenColorFactor", m->sheen.color, 3);
    m->sheen.roughness = unit(at, "sheenRoughnessFactor", 0);
    hg_gltf_texture_ref(g, at, "sheenColorTexture", &m->slots[HG_SLOT_SHEEN_COLOR]);
    hg_gltf_texture_ref(g, at, "sheenRoughnessTexture", &m->slots[HG_SLOT_SHEEN_ROUGHNESS]);
}

static void read_transmission(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->transmission = unit(at, "transmissionFactor", 0);
    hg_gltf_texture_ref(g, at, "transmissionTexture", &m->slots[HG_SLOT_TRANSMISSION]);
}

static void read_volume(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->volume.thickness = clamp(hg_gltf_number(at, "thicknessFactor", 0), 0, 1e30);
    double distance = hg_gltf_number(at, "attenuationDistance", INFINITY);
    m->volume.attenuation_distance = distance > 0 ? (float)distance : INFINITY;
    color(at, "attenuationColor", m->volume.attenuation_color, 3);
    hg_gltf_texture_ref(g, at, "thicknessTexture", &m->slots[HG_SLOT_THICKNESS]);
}

static void read_ior(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    (void)g;
    double ior = hg_gltf_number(at, "ior", 1.5);
    m->ior = ior == 0 ? 0 : clamp(ior, 1, 100); // 0: no Fresnel effect at normal incidence
    m->has_ior = true;
}

static void read_specular(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->specular.factor = unit(at, "specularFactor", 1);
    color(at, "specularColorFactor", m->specular.color, 3);
    m->specular.is_set = true;
    hg_gltf_texture_ref(g, at, "specularTexture", &m->slots[HG_SLOT_SPECULAR]);
    hg_gltf_texture_ref(g, at, "specularColorTexture", &m->slots[HG_SLOT_SPECULAR_COLOR]);
}

static void read_iridescence(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->iridescence.factor = unit(at, "iridescenceFactor", 0);
    m->iridescence.ior = clamp(hg_gltf_number(at, "iridescenceIor", 1.3), 1, 100);
    m->iridescence.thickness_min_nm =
        clamp(hg_gltf_number(at, "iridescenceThicknessMinimum", 100), 0, 1e9);
    m->iridescence.thickness_max_nm =
        clamp(hg_gltf_number(at, "iridescenceThicknessMaximum", 400), 0, 1e9);
    hg_gltf_texture_ref(g, at, "iridescenceTexture", &m->slots[HG_SLOT_IRIDESCENCE]);
    hg_gltf_texture_ref(
        g, at, "iridescenceThicknessTexture", &m->slots[HG_SLOT_IRIDESCENCE_THICKNESS]);
}

static void read_anisotropy(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->anisotropy.strength = unit(at, "anisotropyStrength", 0);
    m->anisotropy.rotation_rad = (float)hg_gltf_number(at, "anisotropyRotation", 0);
    hg_gltf_texture_ref(g, at, "anisotropyTexture", &m->slots[HG_SLOT_ANISOTROPY]);
}

static void read_dispersion(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    (void)g;
    m->dispersion = clamp(hg_gltf_number(at, "dispersion", 0), 0, 1e6);
}

static void read_diffuse_transmission(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    m->diffuse_transmission.factor = unit(at, "diffuseTransmissionFactor", 0);
    color(at, "diffuseTransmissionColorFactor", m->diffuse_transmission.color, 3);
    hg_gltf_texture_ref(
        g, at, "diffuseTransmissionTexture", &m->slots[HG_SLOT_DIFFUSE_TRANSMISSION]);
    hg_gltf_texture_ref(
        g, at, "diffuseTransmissionColorTexture", &m->slots[HG_SLOT_DIFFUSE_TRANSMISSION_COLOR]);
}

static void read_extensions(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    static const struct {
        const char *name;
        extension_fn *read;
    } table[] = {{"KHR_materials_unlit", read_unlit},
        {"KHR_materials_emissive_strength", read_emissive_strength},
        {"KHR_materials_clearcoat", read_clearcoat}, {"KHR_materials_sheen", read_sheen},
        {"KHR_materials_transmission", read_transmission}, {"KHR_materials_volume", read_volume},
        {"KHR_materials_ior", read_ior}, {"KHR_materials_specular", read_specular},
        {"KHR_materials_iridescence", read_iridescence},
        {"KHR_materials_anisotropy", read_anisotropy},
        {"KHR_materials_dispersion", read_dispersion},
        {"KHR_materials_diffuse_transmission", read_diffuse_transmission}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        struct hg_gltf_at extensions;
        struct hg_gltf_at extension = hg_gltf_extension(at, table[i].name, &extensions);
        if (json_is_object(extension.json))
            table[i].read(g, &extension, m);
    }
}

enum hg_status hg_gltf_load_materials(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "materials");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i), extensions;
        struct hg_material *material = hg_asset_add_material(g->asset, hg_gltf_string(&at, "name"));
        if (!material)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a material");
        read_core(g, &at, material);
        struct hg_gltf_at gloss =
            hg_gltf_extension(&at, "KHR_materials_pbrSpecularGlossiness", &extensions);
        if (json_is_object(gloss.json)) {
            enum hg_status status = hg_gltf_convert_spec_gloss(g, &gloss, material);
            if (status)
                return status;
        }
        read_extensions(g, &at, material);
    }
    return HG_OK;
}
