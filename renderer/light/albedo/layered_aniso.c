// layered_aniso.c - attenuation of anisotropic bases by coats and sheens. See dfg.h,
// HG_OVER_ANISO_FIRST.
#include "renderer/light/albedo/vndf_quadrature.h"
#include "renderer/light/albedo/lobes.h"
#include "renderer/light/albedo/table.h"

// The isotropic loss that a shader looks up.
static struct hg_vec2 layer_loss(
    const struct hg_vec2 *table, const struct hg_layer *layer, float cosine, float roughness)
{
    enum { N = HG_LAYER_SIZE };
    const float at = layer->roughness * (HG_LAYER_ROUGHS - 1), x = sqrtf(cosine) * (N - 1);
    const uint32_t k = (uint32_t)fminf(at, HG_LAYER_ROUGHS - 2);
    const struct hg_vec2 *p = table + (layer->coat ? HG_COAT_FIRST : HG_CLOTH_FIRST) + k * N * N;
    return hg_table_between(hg_table_bilinear(p, N, N, x, roughness * (N - 1)),
        hg_table_bilinear(p + N * N, N, N, x, roughness * (N - 1)), at - (float)k);
}

// Direction i of those of an entry.
static void direction_of(uint32_t i, float v[3])
{
    enum { C = HG_OVER_ANISO_COSINES, A = HG_OVER_ANISO_AZIMUTHS };
    const float turn = hg_table_place(i / C, A);
    // Grazing ones are like their neighbours.
    hg_vndf_direction(hg_table_cosine(i % C > 0 ? i % C : 1, C), turn * turn, v);
}

// All layers over one base.
static void fill_base(struct hg_vec2 *table, uint32_t job)
{
    enum { S = HG_OVER_ANISO_STRENGTHS, L = HG_OVER_ANISO_LAYERS };
    const bool strong = job % S != 0;
    float alpha[2];
    hg_aniso_alpha(
        hg_table_place(job / S, HG_OVER_ANISO_ROUGHS), hg_table_place(job % S, S), alpha);
    const float roughness = hg_aniso_roughness(alpha);
    for (uint32_t i = 0; i < HG_OVER_ANISO_SIDE; i++) {
        struct hg_vndf_quadrature facets;
        float v[3], ab[2];
        direction_of(i, v);
        hg_vndf_init(&facets, v, alpha, strong ? 24 : 1, false);
        for (uint32_t k = 0; k < 2 * L; k++) {
            struct hg_layer layer = {
                .table = table, .coat = k < L, .roughness = hg_table_place(k % L, L)};
            layer.here = hg_layer_albedo(&layer, v[2]);
            hg_vndf_reflect(&facets, hg_layer_more, &layer, ab);
            const struct hg_vec2 guess = layer_loss(table, &layer, v[2], roughness);
            struct hg_vec2 *out = &table[HG_OVER_ANISO_FIRST +
                                         (k * HG_OVER_ANISO_BASES + job) * HG_OVER_ANISO_SIDE + i];
            out->x = strong ? hg_table_correction(ab[0] - guess.x) : 0.5f;
            out->y = strong ? hg_table_correction(ab[1] - guess.y) : 0.5f;
        }
    }
}

// dfg and what is lost of it, together, less that of the isotropic base.
static void fill_base_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { C = HG_OVER_ANISO_COSINES, A = HG_OVER_ANISO_AZIMUTHS, L = HG_OVER_ANISO_LAYERS };
    float alpha[2];
    double sum[2 * L] = {0};
    hg_aniso_alpha(hg_table_place(job / HG_OVER_ANISO_STRENGTHS, HG_OVER_ANISO_ROUGHS),
        hg_table_place(job % HG_OVER_ANISO_STRENGTHS, HG_OVER_ANISO_STRENGTHS), alpha);
    const float roughness = hg_aniso_roughness(alpha);
    for (uint32_t i = 0; i < HG_DFG_QUADRANT && job % HG_OVER_ANISO_STRENGTHS != 0; i++) {
        struct hg_vndf_quadrature facets;
        float s, turn, v[3], ab[2];
        const float weight = hg_dfg_quadrant(i, &s, &turn);
        hg_vndf_direction(s * s, turn, v);
        hg_vndf_init(&facets, v, alpha, 16, false);
        hg_vndf_reflect(&facets, NULL, NULL, ab);
        const struct hg_vec2 plain = hg_table_look_up(table, HG_DFG_SIZE, s * s, roughness);
        const float more = ab[0] + ab[1] - plain.x - plain.y;
        for (uint32_t k = 0; k < 2 * L; k++) {
            const struct hg_vec2 *entries =
                &table[HG_OVER_ANISO_FIRST + (k * HG_OVER_ANISO_BASES + job) * HG_OVER_ANISO_SIDE];
            const struct hg_vec2 e = hg_table_middle_off(
                hg_table_bilinear(entries, C, A, s * (C - 1), sqrtf(turn) * (A - 1)));
            const float taken =
                hg_table_layer_albedo(table, k < L, hg_table_place(k % L, L), s * s);
            sum[k] += (double)(weight * (more * taken + e.x + e.y));
        }
    }
    for (uint32_t k = 0; k < L; k++)
        table[HG_OVER_ANISO_MEANS + k * HG_OVER_ANISO_BASES + job] = (struct hg_vec2){
            hg_table_correction((float)sum[k]), hg_table_correction((float)sum[L + k])};
}

void hg_dfg_fill_layered_aniso(struct hg_vec2 *out)
{
    hg_dfg_each(out, HG_OVER_ANISO_BASES, fill_base);
    hg_dfg_each(out, HG_OVER_ANISO_BASES, fill_base_mean);
}
