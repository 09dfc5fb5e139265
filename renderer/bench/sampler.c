#include "renderer/bench/sampler.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/residency/residency.h"

enum { PAGE_BYTES = HG_PAGE_PITCH * HG_PAGE_PITCH * 4 };

// Where the texels of a mip are: page (x, y) is number first + y * across + x, and texel (0, 0) of
// the mip lies at `at` in page (0, 0).
struct mip {
    float width, height;
    uint32_t last_x, last_y; // texels
    uint32_t first, across;
    float at_x, at_y; // of the texel's centre: half a texel less
    bool tail;
};

struct texture {
    struct hg_page_source *source;
    const struct hg_page_layout *layout;
    struct mip mips[HG_MIPS_MAX];
    uint32_t *slots; // [pages], HG_RESIDENCY_NONE: not in memory
    float side, last_mip;
};

struct hg_bench_sampler {
    struct texture *textures;
    uint32_t count;
    uint8_t *texels; // [slots][PAGE_BYTES]
    struct hg_residency *residency;
    uint64_t decoded_bytes;
    float decode[256];
};

// --- life ----------------------------------------------------------------------------------------

static void describe_mips(struct texture *t)
{
    const struct hg_page_layout *l = t->layout;
    for (uint32_t m = 0; m < l->mips; m++) {
        const uint32_t w = hg_mips_side(l->width, m), h = hg_mips_side(l->height, m);
        const bool tail = m >= l->tail;
        const int j = (int)m - (int)l->tail;
        t->mips[m] = (struct mip){.width = (float)w,
            .height = (float)h,
            .last_x = w - 1,
            .last_y = h - 1,
            .first = tail ? l->pages - 1 : hg_page_number(l, m, 0, 0),
            .across = tail ? 0 : hg_pages_across(l->width, m),
            .at_x = HG_PAGE_BORDER - 0.5f + (float)(tail ? HG_TAIL_X(j) : 0),
            .at_y = HG_PAGE_BORDER - 0.5f + (float)(tail ? HG_TAIL_Y(j) : 0),
            .tail = tail};
    }
}

static enum hg_status init_texture(
    struct texture *t, struct hg_page_source *source, struct hg_error *err)
{
    const struct hg_page_source_info *info = hg_page_source_info(source);
    if (info->texel_bytes != 4)
        return hg_error_set(err, HG_E_INVAL, "bench", NULL, "texels are not RGBA8");
    t->source = source;
    t->layout = &info->layout;
    t->side = (float)(info->layout.width > info->layout.height ? info->layout.width
                                                               : info->layout.height);
    t->last_mip = (float)(info->layout.mips - 1);
    describe_mips(t);
    t->slots = hg_calloc(info->layout.pages, sizeof *t->slots);
    if (t->slots == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for a list of pages");
    memset(t->slots, 0xff, info->layout.pages * sizeof *t->slots);
    return HG_OK;
}

static enum hg_status init_slots(
    struct hg_bench_sampler *s, uint64_t memory_bytes, struct hg_error *err)
{
    const uint32_t slots = (uint32_t)(memory_bytes / PAGE_BYTES);
    if (slots == 0)
        return hg_error_set(err, HG_E_INVAL, "bench", NULL, "no room for a page");
    s->texels = hg_calloc(slots, PAGE_BYTES);
    if (s->texels == NULL ||
        hg_residency_create(&(struct hg_residency_params){.slots = slots}, &s->residency) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for pages");
    return HG_OK;
}

enum hg_status hg_bench_sampler_create(struct hg_page_source *const *sources, uint32_t count,
    uint64_t memory_bytes, struct hg_bench_sampler **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_bench_sampler *s = hg_calloc(1, sizeof *s);
    if (s == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for a sampler");
    enum hg_status status = init_slots(s, memory_bytes, err);
    s->textures = hg_calloc(count > 0 ? count : 1, sizeof *s->textures);
    if (status == HG_OK && s->textures == NULL)
        status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for a sampler");
    for (; status == HG_OK && s->count < count; s->count++)
        status = init_texture(&s->textures[s->count], sources[s->count], err);
    for (int i = 0; i < 256; i++)
        s->decode[i] = (float)i / 255.0f;
    if (status != HG_OK)
        hg_bench_sampler_destroy(s);
    else
        *out = s;
    return status;
}

void hg_bench_sampler_destroy(struct hg_bench_sampler *s)
{
    if (s == NULL)
        return;
    for (uint32_t i = 0; i < s->count; i++)
        hg_free(s->textures[i].slots);
    hg_free(s->textures);
    hg_residency_destroy(s->residency);
    hg_free(s->texels);
    hg_free(s);
}

uint64_t hg_bench_sampler_decoded_bytes(const struct hg_bench_sampler *s)
{
    return s->decoded_bytes;
}

// --- pages ---------------------------------------------------------------------------------------

void hg_bench_sampler_begin(struct hg_bench_sampler *s)
{
    hg_residency_tick(s->residency);
}

// Reads a page into the slot of the one that was used longest ago.
static const uint8_t *read_page(
    struct hg_bench_sampler *s, uint32_t texture, uint32_t page, struct hg_error *err)
{
    struct texture *t = &s->textures[texture];
    uint32_t slot, x, y;
    uint64_t evicted;
    if (hg_residency_place(s->residency, (uint64_t)texture << 32 | page, HG_RESIDENCY_ANY, &slot,
            &evicted) != HG_OK)
        return NULL;
    if (evicted != HG_RESIDENCY_NO_KEY)
        s->textures[evicted >> 32].slots[(uint32_t)evicted] = HG_RESIDENCY_NONE;
    uint8_t *texels = s->texels + (size_t)slot * PAGE_BYTES;
    const uint32_t mip = hg_page_find(t->layout, page, &x, &y);
    if (hg_page_source_read(t->source, mip, x, y, texels, err) != HG_OK) {
        hg_residency_remove(s->residency, slot);
        return NULL;
    }
    t->slots[page] = slot;
    s->decoded_bytes += PAGE_BYTES;
    return texels;
}

static inline const uint8_t *find_page(
    struct hg_bench_sampler *s, uint32_t texture, uint32_t page, struct hg_error *err)
{
    const uint32_t slot = s->textures[texture].slots[page];
    if (slot == HG_RESIDENCY_NONE)
        return read_page(s, texture, page, err);
    hg_residency_use(s->residency, slot);
    return s->texels + (size_t)slot * PAGE_BYTES;
}

// --- samples -------------------------------------------------------------------------------------

// A bilinear sample of one mip, and its weight in a trilinear one.
struct tap {
    uint32_t texture, mip;
    float uv[2], weight;
};

static bool add_mip(
    struct hg_bench_sampler *s, const struct tap *tap, float rgba[4], struct hg_error *err)
{
    const struct mip *m = &s->textures[tap->texture].mips[tap->mip];
    const float fx = tap->uv[0] * m->width, fy = tap->uv[1] * m->height;
    const uint32_t ix = (uint32_t)fx < m->last_x ? (uint32_t)fx : m->last_x;
    const uint32_t iy = (uint32_t)fy < m->last_y ? (uint32_t)fy : m->last_y;
    const uint32_t px = m->tail ? 0 : ix / HG_PAGE_TEXELS, py = m->tail ? 0 : iy / HG_PAGE_TEXELS;
    const uint8_t *page = find_page(s, tap->texture, m->first + py * m->across + px, err);
    if (page == NULL)
        return false;
    const float x = fx - (float)(px * HG_PAGE_TEXELS) + m->at_x;
    const float y = fy - (float)(py * HG_PAGE_TEXELS) + m->at_y;
    const float bx = x - floorf(x), by = y - floorf(y);
    const uint8_t *p = page + ((size_t)y * HG_PAGE_PITCH + (size_t)x) * 4;
    const float weights[4] = {(1 - bx) * (1 - by), bx * (1 - by), (1 - bx) * by, bx * by};
    static const size_t offsets[4] = {0, 4, HG_PAGE_PITCH * 4, HG_PAGE_PITCH * 4 + 4};
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 4; i++)
            rgba[i] += tap->weight * weights[k] * s->decode[p[offsets[k] + (size_t)i]];
    return true;
}

bool hg_bench_sampler_sample(struct hg_bench_sampler *s, uint32_t texture, const float uv[2],
    float footprint, float rgba[4], struct hg_error *err)
{
    const struct texture *t = &s->textures[texture];
    float lod = log2f(footprint * t->side);
    lod = lod < 0 ? 0 : lod > t->last_mip ? t->last_mip : lod;
    const uint32_t mip = (uint32_t)lod;
    const float blend = lod - (float)mip;
    const struct tap fine = {texture, mip, {uv[0], uv[1]}, 1 - blend};
    const struct tap coarse = {texture, mip + 1, {uv[0], uv[1]}, blend};
    memset(rgba, 0, 4 * sizeof *rgba);
    return add_mip(s, &fine, rgba, err) && (blend == 0 || add_mip(s, &coarse, rgba, err));
}
