#include <stdbool.h>

#include "renderer/light/albedo/vndf_quadrature.h"
#include "renderer/light/albedo/lobes.h"
#include "renderer/light/albedo/table.h"

float hg_layer_albedo(const struct hg_layer *layer, float cosine)
{
    return hg_table_layer_albedo(layer->table, layer->coat, layer->roughness, cosine);
}

float hg_layer_more(const void *user, float cosine)
{
    const struct hg_layer *layer = user;
    return fmaxf(hg_layer_albedo(layer, cosine) - layer->here, 0);
}

static void fill_layer(struct hg_vec2 *out, struct hg_layer *layer, float roughness)
{
    enum { N = HG_LAYER_SIZE };
    const float alpha = roughness * roughness;
    for (uint32_t i = 0; i < N; i++) {
        struct hg_vndf_quadrature facets;
        float ab[2], v[3];
        layer->here = hg_layer_albedo(layer, hg_table_cosine(i, N));
        hg_vndf_direction(hg_table_cosine(i, N), 1, v);
        hg_vndf_init(&facets, v, (float[2]){alpha, alpha}, 48, true);
        hg_vndf_reflect(&facets, hg_layer_more, layer, ab);
        out[i] = (struct hg_vec2){ab[0], ab[1]};
    }
}

// Base, or sheen, of one roughness below layers of one.
static void fill_layers(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_LAYER_SIZE };
    const float below = hg_table_place(job % N, N), over = hg_table_place(job / N, HG_LAYER_ROUGHS);
    struct hg_layer coat = {.table = table, .coat = true, .roughness = over};
    struct hg_layer cloth = {.table = table, .coat = false, .roughness = over};
    fill_layer(table + HG_COAT_FIRST + job * N, &coat, below);
    fill_layer(table + HG_CLOTH_FIRST + job * N, &cloth, below);
    for (uint32_t i = 0; i < N; i++) {
        const float cosine = hg_table_cosine(i, N);
        coat.here = hg_layer_albedo(&coat, cosine);
        table[HG_COATED_FIRST + job * N + i].x =
            hg_sheen_kept(table, cosine, below, 48, hg_layer_more, &coat);
    }
}

void hg_dfg_fill_layers(struct hg_vec2 *out)
{
    hg_dfg_each(out, HG_LAYER_ROUGHS * HG_LAYER_SIZE, fill_layers);
}
