#include <stdbool.h>

#include "renderer/light/albedo/facets.h"
#include "renderer/light/albedo/lobes.h"
#include "renderer/light/albedo/table.h"

// A coat or sheen, and the share that it takes at the cosine of v.
struct layer {
    const struct hg_vec2 *table;
    bool coat;
    float roughness, here;
};

static float layer_albedo(const struct layer *layer, float cosine)
{
    return hg_table_layer_albedo(layer->table, layer->coat, layer->roughness, cosine);
}

// What it holds back of light to this cosine beyond what it held back of that of v.
static float layer_more(const void *user, float cosine)
{
    const struct layer *layer = user;
    return fmaxf(layer_albedo(layer, cosine) - layer->here, 0);
}

static void fill_layer(struct hg_vec2 *out, struct layer *layer, float roughness)
{
    enum { N = HG_LAYER_SIZE };
    const float alpha = roughness * roughness;
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        float ab[2], v[3];
        layer->here = layer_albedo(layer, hg_table_cosine(i, N));
        hg_facets_direction(hg_table_cosine(i, N), 1, v);
        hg_facets_init(&facets, v, (float[2]){alpha, alpha}, 48, true);
        hg_facets_reflect(&facets, layer_more, layer, ab);
        out[i] = (struct hg_vec2){ab[0], ab[1]};
    }
}

// Base, or sheen, of one roughness below layers of one.
static void fill_layers(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_LAYER_SIZE };
    const float below = hg_table_place(job % N, N), over = hg_table_place(job / N, HG_LAYER_ROUGHS);
    struct layer coat = {.table = table, .coat = true, .roughness = over};
    struct layer cloth = {.table = table, .coat = false, .roughness = over};
    fill_layer(table + HG_COAT_FIRST + job * N, &coat, below);
    fill_layer(table + HG_CLOTH_FIRST + job * N, &cloth, below);
    for (uint32_t i = 0; i < N; i++) {
        const float cosine = hg_table_cosine(i, N);
        coat.here = layer_albedo(&coat, cosine);
        table[HG_COATED_FIRST + job * N + i].x =
            hg_sheen_kept(table, cosine, below, 48, layer_more, &coat);
    }
}

void hg_dfg_fill_layers(struct hg_vec2 *out)
{
    hg_dfg_each(out, HG_LAYER_ROUGHS * HG_LAYER_SIZE, fill_layers);
}
