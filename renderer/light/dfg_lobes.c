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

static void fill_glass(void *user, size_t job)
{
    enum { N = HG_GLASS_SIZE };
    struct hg_vec2 *out = user;
    const uint32_t layer = (uint32_t)job / N, row = (uint32_t)job % N;
    const float s = place(layer, HG_GLASS_IORS), x = HG_GLASS_FAR * s * s, eta = (1 + x) / (1 - x);
    const float alpha = place(row, N) * place(row, N);
    struct hg_vec2 *miss = out + HG_GLASS_FIRST + job * N, mean = {0, 0};
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        round_facets(&facets, cosine_at(i, N), alpha, 20);
        miss[i].x = hg_facets_glass_miss(&facets, eta);
        miss[i].y = hg_facets_glass_miss(&facets, 1 / eta);
    }
    const uint32_t fine = 64; // over the linear pieces, as in hg_dfg
    for (uint32_t k = 0; k < (N - 1) * fine; k++) {
        const float at = ((float)k + 0.5f) / (float)fine, f = at - floorf(at), t = at / (N - 1);
        const float w = 4 * t * t * t / ((N - 1) * (float)fine);
        mean.x += w * (miss[k / fine].x * (1 - f) + miss[k / fine + 1].x * f);
        mean.y += w * (miss[k / fine].y * (1 - f) + miss[k / fine + 1].y * f);
    }
    out[HG_GLASS_MEANS + job] = mean;
}

static void fill_angles(void *user, size_t job)
{
    enum { N = HG_ANGLES_SIZE };
    const bool lost = job >= N;
    const uint32_t row = (uint32_t)job % N;
    const float alpha = place(row, N) * place(row, N);
    struct hg_vec2 *out = (struct hg_vec2 *)user + (lost ? HG_LOST_FIRST : HG_ANGLES_FIRST);
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        float angles[3][2];
        round_facets(&facets, cosine_at(i, N), alpha, 24);
        hg_facets_angles(&facets, lost, angles);
        for (uint32_t k = 0; k < 3; k++)
            out[(row * N + i) * 3 + k] = (struct hg_vec2){angles[k][0], angles[k][1]};
    }
}

// Between four entries; x and y in columns and rows.
static struct hg_vec2 bilinear(
    const struct hg_vec2 *table, uint32_t columns, uint32_t rows, float x, float y)
{
    const uint32_t i = (uint32_t)fminf(x, (float)(columns - 2));
    const uint32_t j = (uint32_t)fminf(y, (float)(rows - 2));
    const float f = x - (float)i, g = y - (float)j;
    const struct hg_vec2 *p = table + j * columns + i, *q = p + columns;
    return (struct hg_vec2){
        (p[0].x * (1 - f) + p[1].x * f) * (1 - g) + (q[0].x * (1 - f) + q[1].x * f) * g,
        (p[0].y * (1 - f) + p[1].y * f) * (1 - g) + (q[0].y * (1 - f) + q[1].y * f) * g};
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

static void aniso_alpha(size_t job, float alpha[2])
{
    const float r = place((uint32_t)job / HG_ANISO_STRENGTHS, HG_ANISO_ROUGHS);
    const float strength = place((uint32_t)job % HG_ANISO_STRENGTHS, HG_ANISO_STRENGTHS);
    alpha[1] = fmaxf(r * r, HG_MIN_ALPHA);
    alpha[0] = alpha[1] + (1 - alpha[1]) * strength * strength;
}

static float correction(float difference)
{
    return hg_clampf(0.5f + difference / (2 * HG_ANISO_RANGE), 0, 1);
}

// A table of anisotropy between its entries, its middle taken off.
static struct hg_vec2 aniso_delta(const struct hg_vec2 *delta, float root_cosine, float azimuth)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS };
    struct hg_vec2 d = bilinear(delta, C, A, root_cosine * (C - 1), azimuth * (A - 1));
    d.x = (d.x - 0.5f) * 2 * HG_ANISO_RANGE;
    d.y = (d.y - 0.5f) * 2 * HG_ANISO_RANGE;
    return d;
}

static void fill_aniso(void *user, size_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS };
    struct hg_vec2 *table = user, *out = table + HG_ANISO_FIRST + job * A * C;
    const bool strong = job % HG_ANISO_STRENGTHS != 0;
    float alpha[2], v[3], ab[2];
    struct hg_facets facets;
    aniso_alpha(job, alpha);
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        hg_facets_direction(cosine_at(column, C), place(i / C, A), v);
        hg_facets_init(&facets, v, alpha, strong ? 20 : 1, false);
        hg_facets_reflect(&facets, NULL, NULL, ab);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        out[i].x = strong ? correction(ab[0] - guess.x) : 0.5f;
        out[i].y = strong ? correction(ab[1] - guess.y) : 0.5f;
    }
}

// Cosine-weighted mean of hg_bsdf_dfg less that of the isotropic surface.
static void fill_aniso_mean(void *user, size_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS, FINE = 48, TURNS = 12 };
    struct hg_vec2 *table = user;
    const struct hg_vec2 *delta = table + HG_ANISO_FIRST + job * A * C;
    float alpha[2], v[3];
    double sum[2] = {0, 0};
    aniso_alpha(job, alpha);
    for (uint32_t k = 0; k < FINE * TURNS; k++) {
        const float s = ((float)(k / TURNS) + 0.5f) / FINE;
        const float turn = cosf((float)HG_PI * 0.5f * ((float)(k % TURNS) + 0.5f) / TURNS);
        const float w = 4 * s * s * s / (FINE * TURNS);
        hg_facets_direction(s * s, turn, v);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        const struct hg_vec2 more = aniso_delta(delta, s, turn);
        sum[0] += (double)(w * (guess.x + more.x));
        sum[1] += (double)(w * (guess.y + more.y));
    }
    const float at = aniso_roughness(alpha) * (HG_DFG_SIZE - 1);
    const uint32_t row = (uint32_t)fminf(at, HG_DFG_SIZE - 2);
    const float f = at - (float)row;
    const struct hg_vec2 *p = table + HG_DFG_SIZE * HG_DFG_SIZE + row;
    table[HG_ANISO_MEANS + job].x = correction((float)sum[0] - (p[0].x * (1 - f) + p[1].x * f));
    table[HG_ANISO_MEANS + job].y = correction((float)sum[1] - (p[0].y * (1 - f) + p[1].y * f));
}

// Miss of glass of HG_BRUSHED_IOR at the isotropic surface's cosine.
static struct hg_vec2 brushed_guess(
    const struct hg_vec2 *table, const float v[3], const float alpha[2])
{
    const float roughness = aniso_roughness(alpha);
    const float cosine = hg_clampf(aniso_cosine(v, alpha, roughness), 0, 1);
    const float ratio = (HG_BRUSHED_IOR - 1) / (HG_BRUSHED_IOR + 1);
    const float far = sqrtf(ratio / HG_GLASS_FAR) * (HG_GLASS_IORS - 1), f = far - floorf(far);
    const uint32_t layer = HG_GLASS_SIZE * HG_GLASS_SIZE;
    const struct hg_vec2 *p = table + HG_GLASS_FIRST + (uint32_t)far * layer;
    const struct hg_vec2 near = look_up(p, HG_GLASS_SIZE, cosine, roughness);
    const struct hg_vec2 next = look_up(p + layer, HG_GLASS_SIZE, cosine, roughness);
    return (struct hg_vec2){near.x * (1 - f) + next.x * f, near.y * (1 - f) + next.y * f};
}

static void fill_brushed(void *user, size_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS };
    struct hg_vec2 *table = user, *out = table + HG_BRUSHED_FIRST + job * A * C;
    float alpha[2], v[3];
    struct hg_facets facets;
    aniso_alpha(job, alpha);
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        out[i] = (struct hg_vec2){0.5f, 0.5f};
        if (job % HG_ANISO_STRENGTHS == 0)
            continue;
        hg_facets_direction(cosine_at(column, C), place(i / C, A), v);
        hg_facets_init(&facets, v, alpha, 20, false);
        const struct hg_vec2 guess = brushed_guess(table, v, alpha);
        out[i].x = correction(hg_facets_glass_miss(&facets, HG_BRUSHED_IOR) - guess.x);
        out[i].y = correction(hg_facets_glass_miss(&facets, 1 / HG_BRUSHED_IOR) - guess.y);
    }
}

// Cosine-weighted mean of the corrected miss over that of the isotropic surface.
static void fill_brushed_mean(void *user, size_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS, FINE = 48, TURNS = 12 };
    struct hg_vec2 *table = user, sum = {0, 0}, all = {0, 0};
    const struct hg_vec2 *delta = table + HG_BRUSHED_FIRST + job * A * C;
    float alpha[2], v[3];
    aniso_alpha(job, alpha);
    const float width = aniso_roughness(alpha) * aniso_roughness(alpha);
    for (uint32_t k = 0; k < FINE * TURNS; k++) {
        const float s = ((float)(k / TURNS) + 0.5f) / FINE;
        const float turn = cosf((float)HG_PI * 0.5f * ((float)(k % TURNS) + 0.5f) / TURNS);
        const float w = 4 * s * s * s;
        hg_facets_direction(s * s, turn, v);
        const struct hg_vec2 guess = brushed_guess(table, v, alpha);
        const struct hg_vec2 round = brushed_guess(table, v, (float[2]){width, width});
        const struct hg_vec2 more = aniso_delta(delta, s, turn);
        sum.x += w * hg_clampf(guess.x + more.x, 0, 1);
        sum.y += w * hg_clampf(guess.y + more.y, 0, 1);
        all.x += w * round.x;
        all.y += w * round.y;
    }
    table[HG_BRUSHED_MEANS + job].x =
        hg_clampf(sum.x / fmaxf(all.x * HG_BRUSHED_MOST, 1e-9f), 0, 1);
    table[HG_BRUSHED_MEANS + job].y =
        hg_clampf(sum.y / fmaxf(all.y * HG_BRUSHED_MOST, 1e-9f), 0, 1);
}

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

static void fill_layers(void *user, size_t job)
{
    enum { N = HG_LAYER_SIZE };
    struct hg_vec2 *table = user;
    const uint32_t top = (uint32_t)job / N % HG_LAYER_ROUGHS, row = (uint32_t)job % N;
    const float alpha = place(row, N) * place(row, N);
    struct layer layer = {.table = table,
        .coat = job < N * HG_LAYER_ROUGHS,
        .roughness = place(top, HG_LAYER_ROUGHS)};
    for (uint32_t i = 0; i < N; i++) {
        struct hg_facets facets;
        float ab[2];
        layer.here = layer_albedo(&layer, cosine_at(i, N));
        round_facets(&facets, cosine_at(i, N), alpha, 24);
        hg_facets_reflect(&facets, layer_more, &layer, ab);
        table[HG_COAT_FIRST + job * N + i] = (struct hg_vec2){ab[0], ab[1]};
    }
}

void hg_dfg_fill_lobes(struct hg_jobs *jobs, struct hg_vec2 out[HG_DFG_ENTRIES])
{
    hg_jobs_for(jobs, HG_GLASS_IORS * HG_GLASS_SIZE, fill_glass, out);
    hg_jobs_for(jobs, 2 * HG_ANGLES_SIZE, fill_angles, out);
    hg_jobs_for(jobs, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_aniso, out);
    hg_jobs_for(jobs, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_aniso_mean, out);
    hg_jobs_for(jobs, 2 * HG_LAYER_ROUGHS * HG_LAYER_SIZE, fill_layers, out);
    hg_jobs_for(jobs, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_brushed, out);
    hg_jobs_for(jobs, HG_ANISO_ROUGHS * HG_ANISO_STRENGTHS, fill_brushed_mean, out);
}
