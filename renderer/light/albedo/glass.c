#include "renderer/light/albedo/vndf_quadrature.h"
#include "renderer/light/albedo/lobes.h"
#include "renderer/light/albedo/table.h"

// Of a surface that is as rough in all directions.
static void round_facets(struct hg_vndf_quadrature *facets, float cosine, float alpha, uint32_t n)
{
    float v[3];
    hg_vndf_direction(cosine, 1, v);
    hg_vndf_init(facets, v, (float[2]){alpha, alpha}, n, true);
}

// Index behind over that in front, from outside or from inside.
static float eta_of(uint32_t layer, uint32_t layers, bool inside)
{
    const float ior = hg_table_ior(layer, layers);
    return inside ? fminf(1 / ior, 0.99999f) : ior;
}

// One side of one layer for one roughness.
static void fill_glass(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_GLASS_COSINES, R = HG_GLASS_ROUGHS, L = HG_GLASS_IORS };
    const float rough = hg_table_place(job % R, R), eta = eta_of(job / R % L, L, job >= R * L);
    for (uint32_t i = 0; i < N; i++) {
        struct hg_vndf_quadrature facets;
        round_facets(&facets, hg_glass_cosine(hg_table_place(i, N), eta), rough * rough, 72);
        hg_vndf_glass(&facets, 1, &eta, &table[HG_GLASS_FIRST + job * N + i]);
    }
}

// Cosine-weighted mean of what lies at places of glass, linear between `size` entries.
static struct hg_vec2 mean_of(const struct hg_vec2 *entries, uint32_t size, float eta)
{
    enum { FINE = 64 };
    struct hg_vec2 mean = {0, 0};
    for (uint32_t k = 0; k < (size - 1) * FINE; k++) {
        const float at = ((float)k + 0.5f) / FINE, last = (float)(size - 1);
        const float low = hg_glass_cosine((float)k / FINE / last, eta);
        const float high = hg_glass_cosine((float)(k + 1) / FINE / last, eta);
        const struct hg_vec2 e = hg_table_bilinear(entries, size, 1, at, 0);
        mean.x += (high * high - low * low) * e.x;
        mean.y += (high * high - low * low) * e.y;
    }
    return mean;
}

static void fill_glass_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_GLASS_COSINES, R = HG_GLASS_ROUGHS, L = HG_GLASS_IORS };
    table[HG_GLASS_MEANS + job] =
        mean_of(table + HG_GLASS_FIRST + job * N, N, eta_of(job / R % L, L, job >= R * L));
}

// --- films ---------------------------------------------------------------------------------------

static void fill_angles(struct hg_vec2 *table, uint32_t row)
{
    enum { N = HG_ANGLES_SIZE };
    const float alpha = hg_table_place(row, N) * hg_table_place(row, N);
    for (uint32_t i = 0; i < N; i++) {
        struct hg_vndf_quadrature facets;
        struct hg_vndf_node nodes[HG_ANGLE_NODES];
        round_facets(&facets, hg_table_cosine(i, N), alpha, 48);
        hg_vndf_rule(&facets, 0, HG_ANGLE_NODES, nodes);
        for (uint32_t k = 0; k < HG_ANGLE_NODES; k++)
            table[HG_ANGLES_FIRST + (row * N + i) * HG_ANGLE_NODES + k] =
                (struct hg_vec2){sqrtf(nodes[k].cosine), nodes[k].mirrored};
    }
}

// Nodes for a film on glass: one side of one layer for one roughness.
static void fill_film(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_FILM_COSINES, R = HG_FILM_ROUGHS, L = HG_FILM_IORS };
    const float rough = hg_table_place(job % R, R), eta = eta_of(job / R % L, L, job >= R * L);
    const float edge = eta < 1 ? hg_glass_edge(eta) : 0;
    for (uint32_t i = 0; i < N; i++) {
        struct hg_vndf_quadrature facets;
        struct hg_vndf_node nodes[HG_VNDF_NODES];
        round_facets(&facets, hg_glass_cosine(hg_table_place(i, N), eta), rough * rough, 48);
        hg_vndf_rule(&facets, eta, HG_VNDF_NODES, nodes);
        for (uint32_t k = 0; k < HG_VNDF_NODES; k++) {
            const struct hg_vndf_node *n = &nodes[k];
            struct hg_vec2 *out = table + HG_FILM_FIRST + 2 * k * 2 * HG_FILM_WORDS + job * N + i;
            const float less = n->mirrored - n->refracted;
            out[0] = (struct hg_vec2){
                sqrtf(hg_clampf((n->cosine - edge) / (1 - edge), 0, 1)), 0.5f + 0.5f * n->mirrored};
            out[2 * HG_FILM_WORDS] = (struct hg_vec2){0.5f + 0.5f * less, 0};
        }
    }
}

// Those of one node of one direction, as fill_film stores them, between entries.
static struct hg_vndf_node film_node(
    const struct hg_vec2 *table, uint32_t job, uint32_t node, float at, float eta)
{
    const struct hg_vec2 *first =
        table + HG_FILM_FIRST + 2 * node * 2 * HG_FILM_WORDS + job * HG_FILM_COSINES;
    const struct hg_vec2 a = hg_table_bilinear(first, HG_FILM_COSINES, 1, at, 0);
    const struct hg_vec2 b =
        hg_table_bilinear(first + 2 * HG_FILM_WORDS, HG_FILM_COSINES, 1, at, 0);
    const float edge = eta < 1 ? hg_glass_edge(eta) : 0, mirrored = 2 * a.y - 1;
    return (struct hg_vndf_node){
        edge + (1 - edge) * a.x * a.x, mirrored, mirrored - (2 * b.x - 1), 0};
}

// Nodes of all directions, by their cosines.
static void fill_film_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { R = HG_FILM_ROUGHS, L = HG_FILM_IORS, FINE = 16 };
    static _Thread_local struct hg_vndf_node many[HG_VNDF_MOST];
    struct hg_vndf_node nodes[HG_MEAN_NODES];
    const float eta = eta_of(job / R % L, L, job >= R * L), last = HG_FILM_COSINES - 1;
    const float edge = eta < 1 ? hg_glass_edge(eta) : 0;
    uint32_t count = 0;
    for (uint32_t k = 0; k < (HG_FILM_COSINES - 1) * FINE; k++) {
        const float at = ((float)k + 0.5f) / FINE;
        const float low = hg_glass_cosine((float)k / FINE / last, eta);
        const float high = hg_glass_cosine((float)(k + 1) / FINE / last, eta);
        const float weight = high * high - low * low, cosine = hg_glass_cosine(at / last, eta);
        for (uint32_t i = 0; i < HG_VNDF_NODES; i++) {
            struct hg_vndf_node *n = &many[count++];
            *n = film_node(table, job, i, at, eta);
            n->mirrored *= weight;
            n->refracted *= weight;
        }
        if (cosine > edge)
            many[count++] = (struct hg_vndf_node){.cosine = cosine, .smooth = weight};
    }
    hg_vndf_rule_of_nodes(many, count, eta, HG_MEAN_NODES, nodes);
    for (uint32_t k = 0; k < HG_MEAN_NODES; k++) {
        const struct hg_vndf_node *n = &nodes[k];
        struct hg_vec2 *out = table + HG_FILM_MEANS + 2 * k * 2 * R * L + job;
        out[0] = (struct hg_vec2){
            sqrtf(hg_clampf((n->cosine - edge) / (1 - edge), 0, 1)), 0.5f + 0.5f * n->mirrored};
        out[2 * R * L] = (struct hg_vec2){
            0.5f + 0.5f * (n->mirrored - n->refracted), hg_clampf(n->smooth, 0, 1)};
    }
}

// --- layers --------------------------------------------------------------------------------------

// Attenuation of transmitted light by coats and sheens of all roughnesses.
struct held {
    const struct hg_vec2 *table;
    double all, sum[2][HG_HELD_LAYERS];
};

static void hold(void *user, float share, float cosine)
{
    struct held *h = user;
    h->all += (double)share;
    for (uint32_t k = 0; k < HG_HELD_LAYERS; k++)
        for (int coat = 0; coat < 2; coat++)
            h->sum[coat][k] += (double)(share * hg_table_layer_albedo(h->table, coat == 1,
                                                    hg_table_place(k, HG_HELD_LAYERS), cosine));
}

// Below layers of all roughnesses: one side of one index for one roughness.
static void fill_held(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_HELD_COSINES, R = HG_HELD_ROUGHS, L = HG_HELD_IORS };
    const float rough = hg_table_place(job % R, R), eta = eta_of(job / R % L, L, job >= R * L);
    for (uint32_t i = 0; i < N; i++) {
        struct hg_vndf_quadrature facets;
        struct held held = {.table = table};
        round_facets(&facets, hg_glass_cosine(hg_table_place(i, N), eta), rough * rough, 48);
        hg_vndf_let_through(&facets, eta, hold, &held);
        for (uint32_t k = 0; k < HG_HELD_LAYERS; k++) {
            // Where nothing leaves, what little did would graze, where layers hold all back.
            struct hg_vec2 *out =
                &table[HG_HELD_FIRST +
                       ((job / (R * L) * HG_HELD_LAYERS + k) * L * R + job % (R * L)) * N + i];
            *out = (struct hg_vec2){1, 1};
            if (held.all > 1e-9)
                *out = (struct hg_vec2){
                    (float)(held.sum[1][k] / held.all), (float)(held.sum[0][k] / held.all)};
        }
    }
}

// Of all light that leaves.
static void fill_held_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_HELD_COSINES, R = HG_HELD_ROUGHS, L = HG_HELD_IORS, FINE = 16 };
    const float eta = eta_of(job / R % L, L, job >= R * L * HG_HELD_LAYERS),
                rough = hg_table_place(job % R, R);
    const struct hg_vec2 *entries = table + HG_HELD_FIRST + job * N;
    double sum[2] = {0, 0}, all = 0;
    for (uint32_t k = 0; k < (N - 1) * FINE; k++) {
        const float at = ((float)k + 0.5f) / FINE, last = N - 1;
        const float low = hg_glass_cosine((float)k / FINE / last, eta);
        const float high = hg_glass_cosine((float)(k + 1) / FINE / last, eta);
        const struct hg_vec2 shares = hg_table_glass(table, at / last, rough, eta);
        const struct hg_vec2 e = hg_table_bilinear(entries, N, 1, at, 0);
        const float leaves = fmaxf(1 - shares.x - shares.y, 0) * (high * high - low * low);
        sum[0] += (double)(leaves * e.x);
        sum[1] += (double)(leaves * e.y);
        all += (double)leaves;
    }
    table[HG_HELD_MEANS + job] =
        (struct hg_vec2){(float)(sum[0] / fmax(all, 1e-12)), (float)(sum[1] / fmax(all, 1e-12))};
}

void hg_dfg_fill_glass(struct hg_vec2 *out)
{
    hg_dfg_each(out, 2 * HG_GLASS_IORS * HG_GLASS_ROUGHS, fill_glass);
    hg_dfg_each(out, 2 * HG_GLASS_IORS * HG_GLASS_ROUGHS, fill_glass_mean);
    hg_dfg_each(out, HG_ANGLES_SIZE, fill_angles);
    hg_dfg_each(out, 2 * HG_FILM_IORS * HG_FILM_ROUGHS, fill_film);
    hg_dfg_each(out, 2 * HG_FILM_IORS * HG_FILM_ROUGHS, fill_film_mean);
    hg_dfg_each(out, 2 * HG_HELD_IORS * HG_HELD_ROUGHS, fill_held);
    hg_dfg_each(out, 2 * HG_HELD_LAYERS * HG_HELD_IORS * HG_HELD_ROUGHS, fill_held_mean);
}
