#include "renderer/light/dfg_lobes.h"

#include "renderer/light/dfg_facets.h"
#include "renderer/light/vec.h"

static float place(uint32_t i, uint32_t size)
{
    return (float)i / (float)(size - 1);
}

// Cosine at a place, but for the one at 0, where there is nothing to integrate.
static float cosine_at(uint32_t i, uint32_t size)
{
    return fmaxf(place(i, size) * place(i, size), 1e-3f);
}

// Of a surface that is as rough in all directions.
static void round_facets(struct hg_facets *facets, float cosine, float alpha, uint32_t n)
{
    float v[3];
    hg_facets_direction(cosine, 1, v);
    hg_facets_init(facets, v, (float[2]){alpha, alpha}, n, true);
}

// Both sides of all layers for one roughness.
static void fill_glass(struct hg_vec2 *table, uint32_t row)
{
    enum { N = HG_GLASS_SIZE, LAYERS = HG_GLASS_IORS };
    const float alpha = place(row, N) * place(row, N);
    float eta[2 * LAYERS], miss[2 * LAYERS];
    for (uint32_t k = 0; k < LAYERS; k++) {
        const float s = place(k, LAYERS), x = HG_GLASS_FAR * s * s;
        eta[2 * k] = (1 + x) / (1 - x);
        eta[2 * k + 1] = 1 / eta[2 * k];
    }
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        round_facets(&facets, cosine_at(i, N), alpha, 72);
        hg_facets_glass_miss(&facets, 2 * LAYERS, eta, miss);
        for (uint32_t k = 0; k < LAYERS; k++)
            table[HG_GLASS_FIRST + (k * N + row) * N + i] =
                (struct hg_vec2){miss[2 * k], miss[2 * k + 1]};
    }
}

static void fill_glass_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_GLASS_SIZE };
    const struct hg_vec2 *miss = table + HG_GLASS_FIRST + job * N;
    struct hg_vec2 mean = {0, 0};
    const uint32_t fine = 64; // over the linear pieces, as in hg_dfg
    for (uint32_t k = 0; k < (N - 1) * fine; k++) {
        const float at = ((float)k + 0.5f) / (float)fine, f = at - floorf(at), t = at / (N - 1);
        const float w = 4 * t * t * t / ((N - 1) * (float)fine);
        mean.x += w * (miss[k / fine].x * (1 - f) + miss[k / fine + 1].x * f);
        mean.y += w * (miss[k / fine].y * (1 - f) + miss[k / fine + 1].y * f);
    }
    table[HG_GLASS_MEANS + job] = mean;
}

static void fill_angles(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_ANGLES_SIZE };
    const bool lost = job >= N;
    const uint32_t row = job % N;
    const float alpha = place(row, N) * place(row, N);
    struct hg_vec2 *out = table + (lost ? HG_LOST_FIRST : HG_ANGLES_FIRST);
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        float angles[3][2];
        round_facets(&facets, cosine_at(i, N), alpha, 48);
        hg_facets_angles(&facets, lost, angles);
        for (uint32_t k = 0; k < 3; k++)
            out[(row * N + i) * 3 + k] = (struct hg_vec2){angles[k][0], angles[k][1]};
    }
}

static struct hg_vec2 between(struct hg_vec2 a, struct hg_vec2 b, float f)
{
    return (struct hg_vec2){a.x * (1 - f) + b.x * f, a.y * (1 - f) + b.y * f};
}

// Between four entries, of a single row between two; x and y in columns and rows.
static struct hg_vec2 bilinear(
    const struct hg_vec2 *table, uint32_t columns, uint32_t rows, float x, float y)
{
    const uint32_t i = (uint32_t)fminf(x, (float)(columns - 2));
    const uint32_t j = rows > 1 ? (uint32_t)fminf(y, (float)(rows - 2)) : 0;
    const struct hg_vec2 *p = table + j * columns + i;
    const struct hg_vec2 low = between(p[0], p[1], x - (float)i);
    if (rows == 1)
        return low;
    return between(low, between(p[columns], p[columns + 1], x - (float)i), y - (float)j);
}

// Of a table of n x n by cosine and roughness.
static struct hg_vec2 look_up(
    const struct hg_vec2 *table, uint32_t n, float cosine, float roughness)
{
    const float last = (float)(n - 1);
    return bilinear(
        table, n, n, hg_clampf(sqrtf(cosine), 0, 1) * last, hg_clampf(roughness, 0, 1) * last);
}

// hg_aniso_roughness of lib/lobes.glsl.
static float aniso_roughness(const float alpha[2])
{
    const float rms = sqrtf(0.5f * (alpha[0] * alpha[0] + alpha[1] * alpha[1]));
    return sqrtf(rms + (0.5f * (alpha[0] + alpha[1]) - rms) * 0.15f);
}

// hg_aniso_cosine of lib/lobes.glsl.
static float aniso_cosine(const float v[3], const float alpha[2], float roughness)
{
    const float width = roughness * roughness, x = v[0] * alpha[0], y = v[1] * alpha[1];
    const float k = v[2] * v[2] + (x * x + y * y) / fmaxf(width * width, 1e-12f);
    return v[2] / sqrtf(fmaxf(k, 1e-12f));
}

static struct hg_vec2 aniso_guess(
    const struct hg_vec2 *table, const float v[3], const float alpha[2])
{
    const float roughness = aniso_roughness(alpha);
    return look_up(table, HG_DFG_SIZE, aniso_cosine(v, alpha, roughness), roughness);
}

// hg_aniso_alpha of lib/lobes.glsl.
static void aniso_alpha(float r, float strength, float alpha[2])
{
    alpha[1] = fmaxf(r * r, HG_MIN_ALPHA);
    alpha[0] = alpha[1] + (1 - alpha[1]) * strength * strength;
}

static float correction(float difference)
{
    return hg_clampf(0.5f + difference / (2 * HG_ANISO_RANGE), 0, 1);
}

static struct hg_vec2 middle_off(struct hg_vec2 entry)
{
    return (struct hg_vec2){
        (entry.x - 0.5f) * 2 * HG_ANISO_RANGE, (entry.y - 0.5f) * 2 * HG_ANISO_RANGE};
}

// Directions of a quadrant, FINE by root of the cosine and TURNS by azimuth, and what each weighs
// in cosine-weighted means.
enum { FINE = 48, TURNS = 12 };

static float quadrant(uint32_t k, float *root_cosine, float *azimuth_cosine)
{
    const float s = ((float)(k / TURNS) + 0.5f) / FINE;
    *root_cosine = s;
    *azimuth_cosine = cosf((float)HG_PI * 0.5f * ((float)(k % TURNS) + 0.5f) / TURNS);
    return 4 * s * s * s / (FINE * TURNS);
}

static void fill_aniso(struct hg_vec2 *table, uint32_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS, S = HG_ANISO_STRENGTHS };
    struct hg_vec2 *out = table + HG_ANISO_FIRST + job * A * C;
    const bool strong = job % S != 0;
    float alpha[2], v[3], ab[2];
    struct hg_facets facets;
    aniso_alpha(place(job / S, HG_ANISO_ROUGHS), place(job % S, S), alpha);
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        hg_facets_direction(cosine_at(column, C), place(i / C, A) * place(i / C, A), v);
        hg_facets_init(&facets, v, alpha, strong ? 32 : 1, false);
        hg_facets_reflect(&facets, NULL, NULL, ab);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        out[i].x = strong ? correction(ab[0] - guess.x) : 0.5f;
        out[i].y = strong ? correction(ab[1] - guess.y) : 0.5f;
    }
}

// Cosine-weighted mean of hg_bsdf_dfg less that of the isotropic surface.
static void fill_aniso_mean(struct hg_vec2 *table, uint32_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS, S = HG_ANISO_STRENGTHS };
    const struct hg_vec2 *delta = table + HG_ANISO_FIRST + job * A * C;
    float alpha[2], v[3];
    struct hg_vec2 sum = {0, 0};
    aniso_alpha(place(job / S, HG_ANISO_ROUGHS), place(job % S, S), alpha);
    for (uint32_t k = 0; k < FINE * TURNS; k++) {
        float s, turn;
        const float w = quadrant(k, &s, &turn);
        hg_facets_direction(s * s, turn, v);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        const struct hg_vec2 more =
            middle_off(bilinear(delta, C, A, s * (C - 1), sqrtf(turn) * (A - 1)));
        sum.x += w * (guess.x + more.x);
        sum.y += w * (guess.y + more.y);
    }
    const float at = aniso_roughness(alpha) * (HG_DFG_SIZE - 1);
    const struct hg_vec2 mean = bilinear(table + HG_DFG_SIZE * HG_DFG_SIZE, HG_DFG_SIZE, 1, at, 0);
    table[HG_ANISO_MEANS + job].x = correction(sum.x - mean.x);
    table[HG_ANISO_MEANS + job].y = correction(sum.y - mean.y);
}

// --- anisotropic glass ---------------------------------------------------------------------------

// Place of a layer among those of HG_GLASS_FIRST, and its index.
static float brushed_place(uint32_t layer)
{
    return (float)(layer + 1) / HG_BRUSHED_IORS;
}

static float brushed_ior(uint32_t layer)
{
    const float s = brushed_place(layer), x = HG_GLASS_FAR * s * s;
    return (1 + x) / (1 - x);
}

// hg_glass_miss and its mean of a layer.
static struct hg_vec2 glass_miss(
    const struct hg_vec2 *table, uint32_t layer, float cosine, float roughness)
{
    const float far = brushed_place(layer) * (HG_GLASS_IORS - 1);
    const uint32_t i = (uint32_t)fminf(far, HG_GLASS_IORS - 2),
                   size = HG_GLASS_SIZE * HG_GLASS_SIZE;
    const struct hg_vec2 *p = table + HG_GLASS_FIRST + i * size;
    return between(look_up(p, HG_GLASS_SIZE, cosine, roughness),
        look_up(p + size, HG_GLASS_SIZE, cosine, roughness), far - (float)i);
}

static struct hg_vec2 glass_mean(const struct hg_vec2 *table, uint32_t layer, float roughness)
{
    return bilinear(table + HG_GLASS_MEANS, HG_GLASS_SIZE, HG_GLASS_IORS,
        roughness * (HG_GLASS_SIZE - 1), brushed_place(layer) * (HG_GLASS_IORS - 1));
}

// The miss of an isotropic surface at the cosine that hg_aniso_cosine chooses.
static struct hg_vec2 brushed_guess(
    const struct hg_vec2 *table, uint32_t layer, const float v[3], const float alpha[2])
{
    const float roughness = aniso_roughness(alpha);
    return glass_miss(table, layer, hg_clampf(aniso_cosine(v, alpha, roughness), 0, 1), roughness);
}

// Entries of one layer for job, a roughness and strength.
static struct hg_vec2 *brushed_at(struct hg_vec2 *table, uint32_t layer, uint32_t job)
{
    const uint32_t jobs = HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS;
    return table + HG_BRUSHED_FIRST +
           (layer * jobs + job) * HG_BRUSHED_AZIMUTHS * HG_BRUSHED_COSINES;
}

static void fill_brushed(struct hg_vec2 *table, uint32_t job)
{
    enum { C = HG_BRUSHED_COSINES, A = HG_BRUSHED_AZIMUTHS, S = HG_BRUSHED_STRENGTHS };
    enum { LAYERS = HG_BRUSHED_IORS };
    float alpha[2], v[3], eta[2 * LAYERS], miss[2 * LAYERS];
    struct hg_facets facets;
    aniso_alpha(place(job / S, HG_BRUSHED_ROUGHS), place(job % S, S), alpha);
    for (uint32_t k = 0; k < LAYERS; k++) {
        eta[2 * k] = brushed_ior(k);
        eta[2 * k + 1] = 1 / eta[2 * k];
    }
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        hg_facets_direction(cosine_at(column, C), place(i / C, A) * place(i / C, A), v);
        hg_facets_init(&facets, v, alpha, 32, false);
        if (job % S != 0)
            hg_facets_glass_miss(&facets, 2 * LAYERS, eta, miss);
        for (uint32_t k = 0; k < LAYERS; k++) {
            const struct hg_vec2 guess = brushed_guess(table, k, v, alpha);
            const struct hg_vec2 more = {miss[2 * k] - guess.x, miss[2 * k + 1] - guess.y};
            brushed_at(table, k, job)[i] = (struct hg_vec2){
                job % S != 0 ? correction(more.x) : 0.5f, job % S != 0 ? correction(more.y) : 0.5f};
        }
    }
}

// Cosine-weighted mean of the corrected miss over that of the isotropic surface.
static void fill_brushed_mean(struct hg_vec2 *table, uint32_t index)
{
    enum { C = HG_BRUSHED_COSINES, A = HG_BRUSHED_AZIMUTHS, S = HG_BRUSHED_STRENGTHS };
    const uint32_t jobs = HG_BRUSHED_ROUGHS * S, job = index % jobs, layer = index / jobs;
    const struct hg_vec2 *delta = brushed_at(table, layer, job);
    float alpha[2], v[3];
    struct hg_vec2 sum = {0, 0};
    aniso_alpha(place(job / S, HG_BRUSHED_ROUGHS), place(job % S, S), alpha);
    for (uint32_t k = 0; k < FINE * TURNS; k++) {
        float s, turn;
        const float w = quadrant(k, &s, &turn);
        hg_facets_direction(s * s, turn, v);
        const struct hg_vec2 guess = brushed_guess(table, layer, v, alpha);
        const struct hg_vec2 more =
            middle_off(bilinear(delta, C, A, s * (C - 1), sqrtf(turn) * (A - 1)));
        sum.x += w * hg_clampf(guess.x + more.x, 0, 1);
        sum.y += w * hg_clampf(guess.y + more.y, 0, 1);
    }
    const struct hg_vec2 mean = glass_mean(table, layer, aniso_roughness(alpha));
    table[HG_BRUSHED_MEANS + index] =
        (struct hg_vec2){hg_clampf(sum.x / fmaxf(mean.x * HG_BRUSHED_MOST, 1e-9f), 0, 1),
            hg_clampf(sum.y / fmaxf(mean.y * HG_BRUSHED_MOST, 1e-9f), 0, 1)};
}

// --- layers --------------------------------------------------------------------------------------

// A coat or sheen, and the share that it takes at the cosine of v.
struct layer {
    const struct hg_vec2 *table;
    bool coat;
    float roughness, here;
};

static float layer_albedo(const struct layer *layer, float cosine)
{
    if (!layer->coat)
        return look_up(layer->table + HG_SHEEN_FIRST, HG_SHEEN_SIZE, cosine, layer->roughness).y;
    const struct hg_vec2 dfg = look_up(layer->table, HG_DFG_SIZE, cosine, layer->roughness);
    return 0.04f * dfg.x + dfg.y;
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
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        float ab[2];
        layer->here = layer_albedo(layer, cosine_at(i, N));
        round_facets(&facets, cosine_at(i, N), roughness * roughness, 48);
        hg_facets_reflect(&facets, layer_more, layer, ab);
        out[i] = (struct hg_vec2){ab[0], ab[1]};
    }
}

// Base, or sheen, of one roughness below layers of one.
static void fill_layers(struct hg_vec2 *table, uint32_t job)
{
    enum { N = HG_LAYER_SIZE };
    const float below = place(job % N, N), over = place(job / N, HG_LAYER_ROUGHS);
    struct layer coat = {.table = table, .coat = true, .roughness = over};
    struct layer cloth = {.table = table, .coat = false, .roughness = over};
    fill_layer(table + HG_COAT_FIRST + job * N, &coat, below);
    fill_layer(table + HG_CLOTH_FIRST + job * N, &cloth, below);
    for (uint32_t i = 0; i < N; i++) {
        coat.here = layer_albedo(&coat, cosine_at(i, N));
        table[HG_COATED_FIRST + job * N + i].x =
            hg_sheen_kept(table, cosine_at(i, N), below, 48, layer_more, &coat);
    }
}

static void fill(
    struct hg_vec2 *out, uint32_t count, void (*row)(struct hg_vec2 *out, uint32_t job))
{
    for (uint32_t i = 0; i < count; i++)
        row(out, i);
}

void hg_dfg_fill_lobes(struct hg_vec2 out[HG_DFG_WORDS])
{
    fill(out, HG_GLASS_SIZE, fill_glass);
    fill(out, HG_GLASS_IORS * HG_GLASS_SIZE, fill_glass_mean);
    fill(out, 2 * HG_ANGLES_SIZE, fill_angles);
    fill(out, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_aniso);
    fill(out, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_aniso_mean);
    fill(out, HG_LAYER_ROUGHS * HG_LAYER_SIZE, fill_layers);
    fill(out, HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS, fill_brushed);
    fill(out, HG_BRUSHED_IORS * HG_BRUSHED_ROUGHS * HG_BRUSHED_STRENGTHS, fill_brushed_mean);
}
