// Materials and textures of imported files.
//
// Physically based keys are taken as they are. Phong and Blinn-Phong materials become dielectrics:
// diffuse is the base colour, and a specular exponent n becomes perceptual roughness r by matching
// the normalised Blinn-Phong lobe to GGX, alpha^2 = 2 / (n + 2), r = sqrt(alpha)
// (B. Walter et al. 2007, "Microfacet Models for Refraction"; B. Karis 2013).
#include <assimp/cimport.h>
#include <assimp/material.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/formats/import/import.h"
#include "renderer/scene/formats/texture_file.h"

static float unit(float v)
{
    return v > 0 ? (v < 1 ? v : 1) : 0;
}

// The AI_MATKEY_ names stand for key, type and index.
static bool get_float(
    const struct aiMaterial *m, const char *key, unsigned type, unsigned index, float *out)
{
    ai_real v;
    unsigned count = 1;
    if (aiGetMaterialFloatArray(m, key, type, index, &v, &count) != aiReturn_SUCCESS ||
        !isfinite(v))
        return false;
    *out = v;
    return true;
}

static bool get_color(
    const struct aiMaterial *m, const char *key, unsigned type, unsigned index, float *out)
{
    struct aiColor4D c;
    if (aiGetMaterialColor(m, key, type, index, &c) != aiReturn_SUCCESS)
        return false;
    out[0] = unit(c.r);
    out[1] = unit(c.g);
    out[2] = unit(c.b);
    return true;
}

static void read_factors(struct hg_import *im, const struct aiMaterial *from, struct hg_material *m)
{
    float opacity = 1, exponent = 0;
    m->metallic = 0;
    if (!get_color(from, AI_MATKEY_BASE_COLOR, m->base_color))
        get_color(from, AI_MATKEY_COLOR_DIFFUSE, m->base_color);
    if (get_float(from, AI_MATKEY_METALLIC_FACTOR, &m->metallic))
        m->metallic = unit(m->metallic);
    if (get_float(from, AI_MATKEY_ROUGHNESS_FACTOR, &m->roughness))
        m->roughness = unit(m->roughness);
    else if (get_float(from, AI_MATKEY_SHININESS, &exponent) && exponent > 0)
        m->roughness = powf(2 / (exponent + 2), 0.25f);
    get_color(from, AI_MATKEY_COLOR_EMISSIVE, m->emissive);
    if (get_float(from, AI_MATKEY_OPACITY, &opacity) && opacity <= 0) {
        // Exporters disagree on what 0 and 1 mean; a material that cannot be seen is not meant.
        hg_asset_warn(
            im->asset, m->head.name, "the material is wholly transparent: it is shown as opaque");
    } else if (opacity < 1) {
        m->base_color[3] = unit(opacity);
        m->alpha_mode = HG_ALPHA_BLEND;
    }
    // assimp says "one-sided" of Collada files that say nothing.
    int two_sided = 0;
    unsigned count = 1;
    m->double_sided = !im->states_sides ||
                      aiGetMaterialIntegerArray(from, AI_MATKEY_TWOSIDED, &two_sided, &count) !=
                          aiReturn_SUCCESS ||
                      two_sided != 0;
}

// ---- textures ----------------------------------------------------------------------------------

// "*3" is the fourth embedded texture; FBX names them like files.
static const struct aiTexture *find_embedded(const struct aiScene *scene, const char *name)
{
    char *end;
    unsigned long index = name[0] == '*' ? strtoul(name + 1, &end, 10) : ULONG_MAX;
    if (name[0] == '*')
        return *end == 0 && end > name + 1 && index < scene->mNumTextures ? scene->mTextures[index]
                                                                          : NULL;
    for (unsigned i = 0; i < scene->mNumTextures; i++)
        if (scene->mTextures[i]->mFilename.length &&
            strcmp(scene->mTextures[i]->mFilename.data, name) == 0)
            return scene->mTextures[i];
    return NULL;
}

static enum hg_status embedded_image(
    struct hg_import *im, const struct aiTexture *from, struct hg_image_source *source)
{
    if (from->mHeight == 0) { // a whole image file
        source->encoded = hg_refbuf_create_spilled(from->mWidth);
        if (!source->encoded)
            return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a texture");
        memcpy(source->encoded->data, from->pcData, from->mWidth);
        im->memory_used += from->mWidth;
        return HG_OK;
    }
    enum hg_status status =
        hg_image_create(from->mWidth, from->mHeight, HG_PIXEL_RGBA8, NULL, &source->pixels);
    if (status)
        return hg_import_fail(im, status, NULL, "an embedded texture is too large");
    uint8_t *out = source->pixels.pixels;
    for (size_t i = 0; i < (size_t)from->mWidth * from->mHeight; i++) {
        const struct aiTexel *t = &from->pcData[i];
        const uint8_t rgba[4] = {t->r, t->g, t->b, t->a};
        memcpy(out + i * 4, rgba, 4);
    }
    source->pixels_srgb = true;
    return HG_OK;
}

static enum hg_wrap wrap_of(enum aiTextureMapMode mode)
{
    return mode == aiTextureMapMode_Mirror ? HG_WRAP_MIRROR
           : mode == aiTextureMapMode_Wrap ? HG_WRAP_REPEAT
                                           : HG_WRAP_CLAMP;
}

static enum hg_status make_texture(
    struct hg_import *im, struct aiString *path, struct hg_texture **out)
{
    *out = hg_texture_find(im->asset, path->data);
    if (*out)
        return HG_OK;
    struct hg_texture *texture = hg_asset_add_texture(im->asset, path->data);
    struct hg_image_source *source = texture ? hg_image_source_create(path->data) : NULL;
    if (!source)
        return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a texture");
    texture->image = source;
    const struct aiTexture *embedded = find_embedded(im->scene, path->data);
    const enum hg_status status = embedded ? embedded_image(im, embedded, source) : HG_OK;
    if (status && !im->err->status)
        return hg_import_fail(im, status, NULL, "no memory for a texture");
    *out = texture;
    return status;
}

static enum hg_status read_slot(struct hg_import *im, const struct aiMaterial *from,
    enum aiTextureType type, struct hg_texture_ref *slot)
{
    struct aiString path;
    unsigned uv_index = 0;
    enum aiTextureMapMode modes[3] = {
        aiTextureMapMode_Wrap, aiTextureMapMode_Wrap, aiTextureMapMode_Wrap};
    if (slot->texture || aiGetMaterialTexture(from, type, 0, &path, NULL, &uv_index, NULL, NULL,
                             modes, NULL) != aiReturn_SUCCESS)
        return HG_OK;
    enum hg_status status = make_texture(im, &path, &slot->texture);
    if (status)
        return status;
    slot->texture->wrap_s = wrap_of(modes[0]);
    slot->texture->wrap_t = wrap_of(modes[1]);
    slot->uv_set = uv_index == 1;
    return HG_OK;
}

static enum hg_status read_textures(
    struct hg_import *im, const struct aiMaterial *from, struct hg_material *m)
{
    static const struct {
        enum aiTextureType type;
        enum hg_texture_slot slot;
    } table[] = {{aiTextureType_BASE_COLOR, HG_SLOT_BASE_COLOR},
        {aiTextureType_DIFFUSE, HG_SLOT_BASE_COLOR}, {aiTextureType_NORMALS, HG_SLOT_NORMAL},
        {aiTextureType_NORMAL_CAMERA, HG_SLOT_NORMAL}, {aiTextureType_EMISSIVE, HG_SLOT_EMISSIVE},
        {aiTextureType_EMISSION_COLOR, HG_SLOT_EMISSIVE},
        {aiTextureType_AMBIENT_OCCLUSION, HG_SLOT_OCCLUSION},
        {aiTextureType_LIGHTMAP, HG_SLOT_OCCLUSION}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        enum hg_status status = read_slot(im, from, table[i].type, &m->slots[table[i].slot]);
        if (status)
            return status;
    }
    // One image for both, as glTF packs them; separate ones have no slot.
    struct aiString metal, rough;
    bool has_metal = aiGetMaterialTexture(from, aiTextureType_METALNESS, 0, &metal, NULL, NULL,
                         NULL, NULL, NULL, NULL) == aiReturn_SUCCESS;
    bool has_rough = aiGetMaterialTexture(from, aiTextureType_DIFFUSE_ROUGHNESS, 0, &rough, NULL,
                         NULL, NULL, NULL, NULL, NULL) == aiReturn_SUCCESS;
    if (has_metal && has_rough && strcmp(metal.data, rough.data) == 0)
        return read_slot(im, from, aiTextureType_METALNESS, &m->slots[HG_SLOT_METALLIC_ROUGHNESS]);
    if (has_metal || has_rough)
        hg_asset_warn(im->asset, m->head.name,
            "separate metalness and roughness textures are not read; the factors are used");
    return HG_OK;
}

enum hg_status hg_import_materials(struct hg_import *im)
{
    for (unsigned i = 0; i < im->scene->mNumMaterials; i++) {
        const struct aiMaterial *from = im->scene->mMaterials[i];
        struct aiString name = {0};
        (void)aiGetMaterialString(from, AI_MATKEY_NAME, &name);
        struct hg_material *m = hg_asset_add_material(im->asset, name.data);
        if (!m)
            return hg_import_fail(im, HG_E_NOMEM, NULL, "no memory for a material");
        read_factors(im, from, m);
        enum hg_status status = read_textures(im, from, m);
        if (status)
            return status;
        if (m->slots[HG_SLOT_EMISSIVE].texture &&
            m->emissive[0] + m->emissive[1] + m->emissive[2] == 0)
            m->emissive[0] = m->emissive[1] = m->emissive[2] = 1;
    }
    return HG_OK;
}
