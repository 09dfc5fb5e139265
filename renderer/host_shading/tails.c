#include "renderer/host_shading/tails.h"

#include "base/alloc.h"
#include "renderer/math/vec.h"
#include "renderer/texture/cache/page_cache.h"
#include "renderer/texture/source/page_source.h"

struct tail { // zeroed: none
    struct hg_page_source_info info;
    uint8_t *page;
};

static float srgb_decode(float v)
{
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

// Of mip info.layout.tail + j.
static const uint8_t *texel_at(const struct tail *t, uint32_t j, uint32_t x, uint32_t y)
{
    const size_t at = (size_t)(HG_TAIL_Y(j) + HG_PAGE_BORDER + y) * HG_PAGE_PITCH + HG_TAIL_X(j) +
                      HG_PAGE_BORDER + x;
    return t->page + at * t->info.texel_bytes;
}

static bool read_page(struct hg_page_source *source, struct tail *out)
{
    struct hg_error err = {0};
    out->info = *hg_page_source_info(source);
    out->page = out->info.udim_columns == 0
                    ? hg_calloc((size_t)HG_PAGE_PITCH * HG_PAGE_PITCH, out->info.texel_bytes)
                    : NULL;
    return out->page && hg_page_source_wait(source, &err) == HG_OK &&
           hg_page_source_read(source, out->info.layout.tail, 0, 0, out->page, &err) == HG_OK;
}

// False: there is no texture, or none that can be read.
static bool read_tail(struct hg_textures *textures, const struct hg_texture *texture,
    enum hg_texture_use use, uint8_t cutoff, struct tail *out)
{
    struct hg_error err = {0};
    struct hg_page_source *source;
    if (!texture || !texture->image)
        return false;
    const struct hg_page_source_params params = {.image = texture->image,
        .use = use,
        .cutoff = cutoff,
        .wrap_s = texture->wrap_s,
        .wrap_t = texture->wrap_t};
    if (hg_page_source_open(
            hg_page_cache_sources(hg_textures_cache(textures)), &params, &source, &err) != HG_OK)
        return false;
    const bool read = read_page(source, out);
    hg_page_source_close(source);
    return read;
}

void hg_host_texture_mean(struct hg_textures *textures, const struct hg_material *m,
    enum hg_texture_slot slot, float out[4])
{
    const enum hg_texture_use use = hg_texture_slot_use(m, slot);
    struct tail t = {0};
    const bool read = read_tail(
        textures, m->slots[slot].texture, use == HG_TEXTURE_MASK ? HG_TEXTURE_BLEND : use, 0, &t);
    const uint8_t *texel =
        read ? texel_at(&t, t.info.layout.mips - 1 - t.info.layout.tail, 0, 0) : NULL;
    for (int c = 0; c < 4; c++) {
        uint16_t half;
        out[c] = 1;
        if (!read)
            continue;
        memcpy(&half, texel + 2 * (t.info.texel_bytes == 8 ? c : 0), sizeof half);
        out[c] = t.info.texel_bytes == 8 ? hg_half_to_float(half) : (float)texel[c] / 255;
        if (t.info.pool == HG_POOL_SRGB && c < 3)
            out[c] = srgb_decode(out[c]);
    }
    hg_free(t.page);
}

// --- masks ---------------------------------------------------------------------------------------

static uint32_t side_of(uint32_t side, uint32_t mip)
{
    return side >> mip > 0 ? side >> mip : 1;
}

struct hg_host_mask *hg_host_mask_create(struct hg_textures *textures, const struct hg_material *m)
{
    const struct hg_texture_ref *ref = &m->slots[HG_SLOT_BASE_COLOR];
    struct hg_host_mask *mask = NULL;
    struct tail t = {0};
    const float cutoff = hg_clampf(m->alpha_cutoff / fmaxf(m->base_color[3], 1e-6f), 0, 1.01f);
    const uint8_t least = (uint8_t)hg_clampf(roundf(m->alpha_cutoff * 255), 1, 255);
    if (m->alpha_mode != HG_ALPHA_MASK ||
        !read_tail(textures, ref->texture, HG_TEXTURE_MASK, least, &t))
        goto out;
    const uint32_t width = side_of(t.info.layout.width, t.info.layout.tail),
                   height = side_of(t.info.layout.height, t.info.layout.tail);
    if (t.info.texel_bytes == 4)
        mask = hg_calloc(1, sizeof *mask + (size_t)width * height);
    if (!mask)
        goto out;
    *mask = (struct hg_host_mask){.width = width,
        .height = height,
        .wrap_s = ref->texture->wrap_s,
        .wrap_t = ref->texture->wrap_t,
        .place = *ref,
        .cutoff = cutoff * 255};
    for (uint32_t i = 0; i < width * height; i++)
        mask->texels[i] = texel_at(&t, 0, i % width, i / width)[3];
out:
    hg_free(t.page);
    return mask;
}

static uint32_t wrap(float at, enum hg_wrap how, uint32_t side)
{
    const float whole = floorf(at);
    if (how == HG_WRAP_CLAMP)
        at = hg_clampf(at, 0, 1);
    else if (how == HG_WRAP_MIRROR && fmodf(whole, 2) != 0)
        at = 1 - (at - whole);
    else
        at -= whole;
    const float texel = at * (float)side;
    return texel > 0 ? (uint32_t)fminf(texel, (float)side - 1) : 0; // and where it is not a number
}

bool hg_host_mask_has_hole(const struct hg_host_mask *mask, const float uv[2])
{
    const float *m = mask->place.uv_transform;
    const uint32_t x = wrap(m[0] * uv[0] + m[1] * uv[1] + m[2], mask->wrap_s, mask->width);
    const uint32_t y = wrap(m[3] * uv[0] + m[4] * uv[1] + m[5], mask->wrap_t, mask->height);
    return (float)mask->texels[(size_t)y * mask->width + x] < mask->cutoff;
}
