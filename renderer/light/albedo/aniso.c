#include "renderer/light/albedo/vndf_quadrature.h"
#include "renderer/light/albedo/lobes.h"
#include "renderer/light/albedo/table.h"

static struct hg_vec2 aniso_guess(
    const struct hg_vec2 *table, const float v[3], const float alpha[2])
{
    const float roughness = hg_aniso_roughness(alpha);
    return hg_table_look_up(table, HG_DFG_SIZE, hg_aniso_cosine(v, alpha, roughness), roughness);
}

static void fill_aniso(struct hg_vec2 *table, uint32_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS, S = HG_ANISO_STRENGTHS };
    struct hg_vec2 *out = table + HG_ANISO_FIRST + job * A * C;
    const bool strong = job % S != 0;
    float alpha[2], v[3], ab[2];
    struct hg_vndf_quadrature facets;
    hg_aniso_alpha(hg_table_place(job / S, HG_ANISO_ROUGHS), hg_table_place(job % S, S), alpha);
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        hg_vndf_direction(
            hg_table_cosine(column, C), hg_table_place(i / C, A) * hg_table_place(i / C, A), v);
        hg_vndf_init(&facets, v, alpha, strong ? 28 : 1, false);
        hg_vndf_reflect(&facets, NULL, NULL, ab);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        out[i].x = strong ? hg_table_correction(ab[0] - guess.x) : 0.5f;
        out[i].y = strong ? hg_table_correction(ab[1] - guess.y) : 0.5f;
    }
}

// Cosine-weighted mean of hg_bsdf_dfg less that of the isotropic surface.
static void fill_aniso_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS, S = HG_ANISO_STRENGTHS };
    const struct hg_vec2 *delta = table + HG_ANISO_FIRST + job * A * C;
    float alpha[2], v[3];
    struct hg_vec2 sum = {0, 0};
    hg_aniso_alpha(hg_table_place(job / S, HG_ANISO_ROUGHS), hg_table_place(job % S, S), alpha);
    for (uint32_t k = 0; k < HG_DFG_QUADRANT; k++) {
        float s, turn;
        const float w = hg_dfg_quadrant(k, &s, &turn);
        hg_vndf_direction(s * s, turn, v);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        const struct hg_vec2 more =
            hg_table_middle_off(hg_table_bilinear(delta, C, A, s * (C - 1), sqrtf(turn) * (A - 1)));
        sum.x += w * (guess.x + more.x);
        sum.y += w * (guess.y + more.y);
    }
    const float at = hg_aniso_roughness(alpha) * (HG_DFG_SIZE - 1);
    const struct hg_vec2 mean =
        hg_table_bilinear(table + HG_DFG_SIZE * HG_DFG_SIZE, HG_DFG_SIZE, 1, at, 0);
    table[HG_ANISO_MEANS + job].x = hg_table_correction(sum.x - mean.x);
    table[HG_ANISO_MEANS + job].y = hg_table_correction(sum.y - mean.y);
}

// --- anisotropic glass ---------------------------------------------------------------------------

static float brushed_ior(uint32_t layer)
{
    return hg_table_ior(layer + 1, HG_BRUSHED_IORS + 1);
}

static float brushed_eta(uint32_t layer, bool inside)
{
    return inside ? 1 / brushed_ior(layer) : brushed_ior(layer);
}

static float glass_mean(const struct hg_vec2 *table, uint32_t layer, bool inside, float roughness)
{
    const float far = hg_table_place(layer + 1, HG_BRUSHED_IORS + 1) * (float)(HG_GLASS_IORS - 1);
    const uint32_t side = inside ? HG_GLASS_IORS * HG_GLASS_ROUGHS : 0;
    return hg_table_bilinear(table + HG_GLASS_MEANS + side, HG_GLASS_ROUGHS, HG_GLASS_IORS,
        roughness * (HG_GLASS_ROUGHS - 1), far)
        .x;
}

// Entries of one layer for job, a roughness and strength.
static struct hg_vec2 *brushed_at(struct hg_vec2 *table, uint32_t layer, uint32_t job)
{
    const uint32_t jobs = HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS;
    return table + HG_BRUSHED_FIRST +
           (layer * jobs + job) * HG_BRUSHED_AZIMUTHS * HG_BRUSHED_COSINES;
}

// Layers of one side that are integrated together.
struct brushed_layers {
    uint32_t first, count;
    bool inside;
};

// The correction of an anisotropic surface to the guess, for entry i of such layers.
static void brushed_more(struct hg_vec2 *table, uint32_t job, uint32_t i, const float alpha[2],
    struct brushed_layers layers)
{
    enum { C = HG_BRUSHED_COSINES, A = HG_BRUSHED_AZIMUTHS };
    const float roughness = hg_aniso_roughness(alpha);
    float eta[HG_BRUSHED_IORS], v[3];
    struct hg_vndf_quadrature facets;
    struct hg_vec2 glass[HG_BRUSHED_IORS];
    for (uint32_t k = 0; k < layers.count; k++)
        eta[k] = brushed_eta(layers.first + k, layers.inside);
    const float cosine = hg_glass_cosine(hg_table_place(i % C, C), eta[0]);
    const float lean = hg_brushed_lean(hg_table_place(i / C, A), cosine, eta[0]);
    const float sine = sqrtf(fmaxf(1 - cosine * cosine, 1e-6f));
    hg_vndf_direction(cosine, fminf(cosine * sinhf(lean) / sine, 1), v);
    hg_vndf_init(&facets, v, alpha, 32, false);
    hg_vndf_glass(&facets, layers.count, eta, glass);
    for (uint32_t k = 0; k < layers.count; k++) {
        struct hg_vec2 *out = &brushed_at(table, layers.first + k, job)[i];
        const float guess = hg_table_glass(table, hg_table_place(i % C, C), roughness, eta[k]).x;
        *(layers.inside ? &out->y : &out->x) = hg_table_correction(glass[k].x - guess);
    }
}

// The same for all layers: from outside cosines are the same for all of them.
static void fill_brushed_at(struct hg_vec2 *table, uint32_t job, uint32_t i, const float alpha[2])
{
    brushed_more(table, job, i, alpha, (struct brushed_layers){0, HG_BRUSHED_IORS, false});
    for (uint32_t k = 0; k < HG_BRUSHED_IORS; k++)
        brushed_more(table, job, i, alpha, (struct brushed_layers){k, 1, true});
}

static void fill_brushed(struct hg_vec2 *table, uint32_t job)
{
    enum { ENTRIES = HG_BRUSHED_COSINES * HG_BRUSHED_AZIMUTHS, S = HG_BRUSHED_STRENGTHS };
    float alpha[2];
    hg_aniso_alpha(hg_table_place(job / S, HG_BRUSHED_ROUGHS), hg_table_place(job % S, S), alpha);
    for (uint32_t i = 0; i < ENTRIES; i++)
        if (job % S != 0)
            fill_brushed_at(table, job, i, alpha);
        else
            for (uint32_t k = 0; k < HG_BRUSHED_IORS; k++)
                brushed_at(table, k, job)[i] = (struct hg_vec2){0.5f, 0.5f};
}

// Cosine-weighted mean of the corrected miss over that of the isotropic surface.
static void fill_brushed_mean(struct hg_vec2 *table, uint32_t index)
{
    enum { C = HG_BRUSHED_COSINES, A = HG_BRUSHED_AZIMUTHS, S = HG_BRUSHED_STRENGTHS };
    const uint32_t jobs = HG_BRUSHED_ROUGHS * S, job = index % jobs, layer = index / jobs;
    const struct hg_vec2 *delta = brushed_at(table, layer, job);
    float alpha[2], sum[2] = {0, 0}, mean[2];
    hg_aniso_alpha(hg_table_place(job / S, HG_BRUSHED_ROUGHS), hg_table_place(job % S, S), alpha);
    const float roughness = hg_aniso_roughness(alpha);
    for (uint32_t k = 0; k < 2 * HG_DFG_QUADRANT; k++) {
        float s, turn;
        const bool inside = k % 2 == 1;
        const float w = hg_dfg_quadrant(k / 2, &s, &turn);
        const float eta = brushed_eta(layer, inside);
        const float place = hg_glass_place(s * s, eta);
        const float lean = hg_lean(turn * sqrtf(1 - s * s * s * s), s * s);
        const float around = hg_brushed_place(lean, s * s, eta);
        const struct hg_vec2 more =
            hg_table_middle_off(hg_table_bilinear(delta, C, A, place * (C - 1), around * (A - 1)));
        const float guess = hg_table_glass(table, place, roughness, eta).x;
        sum[inside] += w * hg_clampf(guess + (inside ? more.y : more.x), 0, 1);
    }
    for (int i = 0; i < 2; i++)
        mean[i] = fmaxf(glass_mean(table, layer, i == 1, roughness) * HG_BRUSHED_MOST, 1e-9f);
    table[HG_BRUSHED_MEANS + index] =
        (struct hg_vec2){hg_clampf(sum[0] / mean[0], 0, 1), hg_clampf(sum[1] / mean[1], 0, 1)};
}

void hg_dfg_fill_aniso(struct hg_vec2 *out)
{
    hg_dfg_each(out, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_aniso);
    hg_dfg_each(out, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_aniso_mean);
    hg_dfg_each(out, HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS, fill_brushed);
    hg_dfg_each(out, HG_BRUSHED_IORS * HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS, fill_brushed_mean);
}
