// spread.c - see spread.h.
#include "renderer/reflect/spread.h"

#include "renderer/gi/words.h"
#include "renderer/reflect/rays.h"

#define LEAST 1e-3f // weight of a block that is of the same surface by its distance alone

// Of the four blocks around a rough texel those of its surface.
static void blend_blocks(const struct hg_reflect_work *w, const struct hg_reflect_texel *t,
    uint32_t x, uint32_t y, hg_reflect_sums *out)
{
    const struct hg_reflect_level *l = &w->r->levels[HG_REFLECT_BLOCKS];
    const int columns = (int)l->image.columns, rows = (int)l->image.rows;
    const int bx = (int)(x + 1) / 2 - 1, by = (int)(y + 1) / 2 - 1;
    *out = (hg_reflect_sums){0};
    for (int k = 0; k < 4; k++) {
        const int qx = bx + (k & 1), qy = by + (k >> 1);
        if (qx < 0 || qy < 0 || qx >= columns || qy >= rows)
            continue;
        const struct hg_reflect_texel *q = &l->texels[(size_t)qy * l->image.columns + (size_t)qx];
        const hg_reflect_sums *s = &l->sums[(size_t)qy * l->image.columns + (size_t)qx];
        if (!q->mirrors || !((*s)[HG_REFLECT_WEIGHT] > 0))
            continue;
        const float near_x = qx == (int)x / 2 ? 0.75f : 0.25f;
        const float near_y = qy == (int)y / 2 ? 0.75f : 0.25f;
        const float off = fabsf(q->depth - t->depth) / t->depth;
        const float weight =
            hg_reflect_same(t, q->position, q->normal, q->roughness, HG_REFLECT_APART) +
            LEAST * hg_reflect_fall(0, 0.1f, off);
        *out += *s * (near_x * near_y * weight / (*s)[HG_REFLECT_WEIGHT]);
    }
}

static void spread_row(void *user, size_t y)
{
    const struct hg_reflect_work *w = user;
    const struct hg_reflect_level *l = &w->r->levels[HG_REFLECT_TEXELS];
    for (uint32_t x = 0; x < l->image.columns; x++) {
        const size_t i = y * l->image.columns + x;
        const uint32_t *light = w->p->light + 4 * i;
        uint32_t *out = w->out + 4 * i;
        hg_reflect_sums s = {0};
        struct hg_reflect_texel t = l->texels[i];
        memcpy(out, light, 4 * sizeof *out);
        if (t.mirrors) {
            s = l->sums[i];
        } else if (w->r->sources[i] != HG_REFLECT_NOTHING) {
            t.mirrors = true;
            hg_reflect_place(w, x, (uint32_t)y, &t);
            blend_blocks(w, &t, x, (uint32_t)y, &s);
        }
        if (!(s[HG_REFLECT_WEIGHT] > 1e-6f))
            continue;
        const float scale = 1 / s[HG_REFLECT_WEIGHT];
        const float open = hg_clampf(s[HG_REFLECT_OPEN] * scale, 0, 1);
        out[1] = hg_gi_rgb9e5(
            s[HG_REFLECT_RED] * scale, s[HG_REFLECT_GREEN] * scale, s[HG_REFLECT_BLUE] * scale);
        out[2] = (light[2] & 0xffffff) | (uint32_t)(open * 255 + 0.5f) << 24;
    }
}

void hg_reflect_spread(struct hg_reflect_work *w)
{
    const struct hg_reflect_image *image = &w->r->levels[HG_REFLECT_TEXELS].image;
    hg_jobs_for(w->r->jobs, image->rows, spread_row, w);
}
