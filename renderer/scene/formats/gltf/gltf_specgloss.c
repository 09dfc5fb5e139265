#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/formats/gltf/gltf.h"
#include "renderer/scene/formats/gltf/spec_gloss.h"

// ---- the equations -----------------------------------------------------------------------------

static float brightness(const float c[3])
{
    return sqrtf(0.299f * c[0] * c[0] + 0.587f * c[1] * c[1] + 0.114f * c[2] * c[2]);
}

static float clamp01(float v)
{
    return v < 0 ? 0 : v > 1 ? 1 : v;
}

float hg_spec_gloss_convert(const float diffuse[3], const float specular[3], float base_color[3])
{
    const float f0 = 0.04f, epsilon = 1e-6f;
    float k = 1 - fmaxf(specular[0], fmaxf(specular[1], specular[2]));
    float d = brightness(diffuse), s = brightness(specular), m = 0;
    if (s >= f0) {
        float b = d * k / (1 - f0) + s - 2 * f0;
        float root = sqrtf(fmaxf(b * b - 4 * f0 * (f0 - s), 0));
        m = clamp01((root - b) / (2 * f0));
    }
    for (int i = 0; i < 3; i++) {
        float from_diffuse = diffuse[i] * k / (1 - f0) / fmaxf(1 - m, epsilon);
        float from_specular = (specular[i] - f0 * (1 - m)) / fmaxf(m, epsilon);
        base_color[i] = clamp01(from_diffuse + (from_specular - from_diffuse) * m * m);
    }
    return m;
}

// ---- textures ----------------------------------------------------------------------------------

struct conversion {
    struct hg_image diffuse, gloss; // RGBA8; width 0: no texture
    float diffuse_factor[4], specular_factor[3], gloss_factor;
    struct hg_image *base, *metal_rough;
    float linear[256];
};

static float srgb_to_linear(float v)
{
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

static uint8_t to_srgb8(float v)
{
    v = clamp01(v);
    v = v <= 0.0031308f ? v * 12.92f : 1.055f * powf(v, 1 / 2.4f) - 0.055f;
    return (uint8_t)(v * 255 + 0.5f);
}

// Nearest texel of an image scaled to the output's size.
static const uint8_t *texel(
    const struct hg_image *image, uint32_t x, uint32_t y, const struct hg_image *out)
{
    uint32_t sx = (uint32_t)((uint64_t)x * image->width / out->width);
    uint32_t sy = (uint32_t)((uint64_t)y * image->height / out->height);
    return (const uint8_t *)image->pixels + ((size_t)sy * image->width + sx) * 4;
}

static void convert_pixel(
    const struct conversion *c, uint32_t x, uint32_t y, uint8_t *base, uint8_t *metal_rough)
{
    float diffuse[4], specular[3], gloss = c->gloss_factor, color[3];
    memcpy(diffuse, c->diffuse_factor, sizeof diffuse);
    memcpy(specular, c->specular_factor, sizeof specular);
    if (c->diffuse.width) {
        const uint8_t *t = texel(&c->diffuse, x, y, c->base);
        for (int i = 0; i < 3; i++)
            diffuse[i] *= c->linear[t[i]];
        diffuse[3] *= (float)t[3] / 255;
    }
    if (c->gloss.width) {
        const uint8_t *t = texel(&c->gloss, x, y, c->base);
        for (int i = 0; i < 3; i++)
            specular[i] *= c->linear[t[i]];
        gloss *= (float)t[3] / 255;
    }
    float metallic = hg_spec_gloss_convert(diffuse, specular, color);
    for (int i = 0; i < 3; i++)
        base[i] = to_srgb8(color[i]);
    base[3] = (uint8_t)(clamp01(diffuse[3]) * 255 + 0.5f);
    metal_rough[0] = metal_rough[3] = 255;
    metal_rough[1] = (uint8_t)((1 - clamp01(gloss)) * 255 + 0.5f);
    metal_rough[2] = (uint8_t)(metallic * 255 + 0.5f);
}

static void convert_row(void *user, size_t y)
{
    const struct conversion *c = user;
    size_t row = y * c->base->width * 4;
    for (uint32_t x = 0; x < c->base->width; x++)
        convert_pixel(c, x, (uint32_t)y, (uint8_t *)c->base->pixels + row + (size_t)x * 4,
            (uint8_t *)c->metal_rough->pixels + row + (size_t)x * 4);
}

// Pixels of a referenced texture; a texture that cannot be read counts as absent (white).
static enum hg_status read_pixels(struct hg_gltf *g, const struct hg_gltf_at *at,
    const struct hg_texture_ref *ref, struct hg_image *out)
{
    const struct hg_image_source *source = ref->texture ? ref->texture->image : NULL;
    if (!source)
        return HG_OK;
    struct hg_error error = {0};
    struct hg_image_limits limits = {.max_side_px = 16384,
        .max_pixels = 1u << 28,
        .max_bytes = g->memory_limit - g->memory_used};
    enum hg_status status =
        source->path ? hg_image_read_file(source->path, HG_PIXEL_RGBA8, &limits, out, &error)
                     : hg_image_read_memory(&(struct hg_image_bytes){source->encoded->data,
                                                source->encoded->size, source->label},
                           HG_PIXEL_RGBA8, &limits, out, &error);
    if (status == HG_E_LIMIT || status == HG_E_NOMEM)
        return hg_gltf_fail(g, at, status, "%.200s", error.reason);
    if (status)
        hg_gltf_warn(g, at, "IMAGE_DATA_INVALID: %.180s; white is used", error.reason);
    return HG_OK;
}

static enum hg_status add_texture(struct hg_gltf *g, const struct hg_gltf_at *at, const char *kind,
    const struct hg_texture_ref *like, struct hg_texture_ref *out, struct hg_image **pixels)
{
    char label[64];
    snprintf(label, sizeof label, "%s of materials[%zu]", kind, at->up->up->index);
    struct hg_texture *texture = hg_asset_add_texture(g->asset, label);
    struct hg_image_source *source = texture ? hg_image_source_create(label) : NULL;
    if (!source)
        return hg_gltf_fail(g, at, HG_E_NOMEM, "no memory for a texture");
    const struct hg_texture *t = like->texture;
    texture->wrap_s = t->wrap_s;
    texture->wrap_t = t->wrap_t;
    texture->mag_nearest = t->mag_nearest;
    texture->min_nearest = t->min_nearest;
    texture->mip_nearest = t->mip_nearest;
    texture->mip_none = t->mip_none;
    texture->image = source;
    *out = *like;
    out->texture = texture;
    *pixels = &source->pixels;
    return HG_OK;
}

static enum hg_status make_textures(struct hg_gltf *g, const struct hg_gltf_at *at,
    struct conversion *c, const struct hg_texture_ref *like, struct hg_material *m)
{
    uint32_t width = c->diffuse.width > c->gloss.width ? c->diffuse.width : c->gloss.width;
    uint32_t height = c->diffuse.height > c->gloss.height ? c->diffuse.height : c->gloss.height;
    struct hg_texture_ref *base = &m->slots[HG_SLOT_BASE_COLOR];
    struct hg_texture_ref *rough = &m->slots[HG_SLOT_METALLIC_ROUGHNESS];
    enum hg_status status = add_texture(g, at, "base colour", like, base, &c->base);
    if (!status)
        status = add_texture(g, at, "metallic roughness", like, rough, &c->metal_rough);
    if (status)
        return status;
    base->texture->image->pixels_srgb = true;
    status = hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, c->base);
    if (!status)
        status = hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, c->metal_rough);
    if (status)
        return hg_gltf_fail(g, at, status, "no memory for converted textures");
    c->base->has_alpha = true;
    g->memory_used += 2 * c->base->size_bytes;
    for (int i = 0; i < 256; i++)
        c->linear[i] = srgb_to_linear((float)i / 255);
    if (g->params->jobs)
        hg_jobs_for(g->params->jobs, height, convert_row, c);
    else
        for (uint32_t y = 0; y < height; y++)
            convert_row(c, y);
    for (int i = 0; i < 4; i++)
        m->base_color[i] = 1;
    m->metallic = m->roughness = 1;
    return HG_OK;
}

static bool same_mapping(const struct hg_texture_ref *a, const struct hg_texture_ref *b)
{
    return a->uv_set == b->uv_set &&
           memcmp(a->uv_transform, b->uv_transform, sizeof a->uv_transform) == 0;
}

static void read_factors(const struct hg_gltf_at *at, struct conversion *c)
{
    for (int i = 0; i < 4; i++)
        c->diffuse_factor[i] = 1;
    for (int i = 0; i < 3; i++)
        c->specular_factor[i] = 1;
    hg_gltf_numbers(at, "diffuseFactor", c->diffuse_factor, 4);
    hg_gltf_numbers(at, "specularFactor", c->specular_factor, 3);
    c->gloss_factor = clamp01((float)hg_gltf_number(at, "glossinessFactor", 1));
    for (int i = 0; i < 4; i++)
        c->diffuse_factor[i] = clamp01(c->diffuse_factor[i]);
    for (int i = 0; i < 3; i++)
        c->specular_factor[i] = clamp01(c->specular_factor[i]);
}

enum hg_status hg_gltf_convert_spec_gloss(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *m)
{
    struct conversion c = {0};
    struct hg_material defaults;
    hg_material_set_defaults(memset(&defaults, 0, sizeof defaults));
    struct hg_texture_ref diffuse = defaults.slots[0], gloss = defaults.slots[0];
    read_factors(at, &c);
    hg_gltf_texture_ref(g, at, "diffuseTexture", &diffuse);
    hg_gltf_texture_ref(g, at, "specularGlossinessTexture", &gloss);
    m->slots[HG_SLOT_BASE_COLOR] = m->slots[HG_SLOT_METALLIC_ROUGHNESS] = defaults.slots[0];
    enum hg_status status = read_pixels(g, at, &diffuse, &c.diffuse);
    if (!status)
        status = read_pixels(g, at, &gloss, &c.gloss);
    if (!status && c.diffuse.width && c.gloss.width && !same_mapping(&diffuse, &gloss))
        hg_gltf_warn(g, at, "both textures are placed like the diffuse one");
    if (!status && (c.diffuse.width || c.gloss.width)) {
        status = make_textures(g, at, &c, c.diffuse.width ? &diffuse : &gloss, m);
    } else if (!status) {
        m->metallic = hg_spec_gloss_convert(c.diffuse_factor, c.specular_factor, m->base_color);
        m->base_color[3] = c.diffuse_factor[3];
        m->roughness = 1 - c.gloss_factor;
    }
    hg_image_finish(&c.diffuse);
    hg_image_finish(&c.gloss);
    return status;
}
