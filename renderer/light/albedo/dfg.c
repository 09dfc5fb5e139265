#include "renderer/light/albedo/dfg.h"

#include "renderer/light/albedo/lobes.h"
#include "renderer/math/vec.h"

static float smith_g2_over_g1(float n_dot_l, float n_dot_v, float a2)
{
    // Heitz 2014, eq. 99 over eq. 43 with eq. 72.
    float sv = sqrtf(n_dot_v * n_dot_v * (1 - a2) + a2);
    float sl = sqrtf(n_dot_l * n_dot_l * (1 - a2) + a2);
    return n_dot_l * (n_dot_v + sv) / (n_dot_v * sl + n_dot_l * sv);
}

// One visible normal by spherical caps (Dupuy and Benyoub 2023): cosines of h to v and of l to n.
static void visible_normal(const float v[3], const float stretched[3], float alpha,
    const float circle[2], float z, float out[2])
{
    float r = sqrtf(hg_clampf(1 - z * z, 0, 1));
    float h[3] = {r * circle[0] + stretched[0], r * circle[1], z + stretched[2]};
    h[0] *= alpha;
    h[1] *= alpha;
    h[2] = fmaxf(h[2], 1e-9f);
    float scale = 1 / sqrtf(hg_dot3(h, h));
    out[0] = hg_dot3(v, h) * scale;
    out[1] = 2 * out[0] * h[2] * scale - v[2];
}

enum { most_points = 512 };

// Points of one height of the cap: cosines and sines of their azimuths.
struct ring {
    uint32_t count;
    float circle[most_points][2];
};

// Midpoints of n pieces of the half circle, which stands for both halves.
static void half_circle(struct ring *ring, uint32_t n)
{
    ring->count = n < most_points ? n : most_points;
    for (uint32_t i = 0; i < ring->count; i++) {
        const float phi = (float)HG_PI * ((float)i + 0.5f) / (float)ring->count;
        ring->circle[i][0] = cosf(phi);
        ring->circle[i][1] = sinf(phi);
    }
}

// Adds the points of one height of the cap.
static void integrate_ring(const struct ring *ring, const float v[3], const float stretched[3],
    float alpha, float u, double ab[2])
{
    float z = (1 - u) * (1 + stretched[2]) - stretched[2];
    for (uint32_t i = 0; i < ring->count; i++) {
        float c[2];
        visible_normal(v, stretched, alpha, ring->circle[i], z, c);
        if (c[1] <= 0)
            continue;
        float g = smith_g2_over_g1(c[1], v[2], alpha * alpha);
        float m = hg_clampf(1 - c[0], 0, 1), m2 = m * m, f = m2 * m2 * m;
        ab[0] += (double)(g * (1 - f));
        ab[1] += (double)(g * f);
    }
}

void hg_dfg_integrate(float n_dot_v, float alpha, uint32_t n, float ab[2])
{
    float v[3] = {sqrtf(fmaxf(0, 1 - n_dot_v * n_dot_v)), 0, n_dot_v};
    float stretched[3] = {v[0] * alpha, 0, v[2]};
    hg_normalize3(stretched);
    double sum[2] = {0, 0};
    struct ring ring;
    half_circle(&ring, n);
    n = ring.count;
    for (uint32_t j = 0; j < n; j++) {
        // Midpoints of t with u = t^2 (3 - 2 t): the ends, where the integrand bends, lie denser.
        float t = ((float)j + 0.5f) / (float)n, u = t * t * (3 - 2 * t);
        double part[2] = {0, 0};
        integrate_ring(&ring, v, stretched, alpha, u, part);
        sum[0] += part[0] * (double)(6 * t * (1 - t));
        sum[1] += part[1] * (double)(6 * t * (1 - t));
    }
    const double all = (double)n * n + 0.5; // the sum of these weights
    ab[0] = (float)(sum[0] / all);
    ab[1] = (float)(sum[1] / all);
}

static void fill_row(struct hg_vec2 *out, uint32_t row)
{
    float roughness = (float)row / (HG_DFG_SIZE - 1);
    for (uint32_t i = 0; i < HG_DFG_SIZE; i++) {
        float s = (float)i / (HG_DFG_SIZE - 1), ab[2];
        hg_dfg_integrate(fmaxf(s * s, 1e-4f), roughness * roughness, 48, ab);
        out[row * HG_DFG_SIZE + i] = (struct hg_vec2){ab[0], ab[1]};
    }
    // 2 integral of f(mu) mu over mu, over the linear pieces in s = sqrt(mu): 4 integral f s^3 ds.
    double sum[2] = {0, 0};
    const uint32_t fine = 64;
    for (uint32_t k = 0; k < (HG_DFG_SIZE - 1) * fine; k++) {
        double x = (k + 0.5) / fine, s = x / (HG_DFG_SIZE - 1);
        uint32_t i = (uint32_t)x;
        const struct hg_vec2 *p = out + row * HG_DFG_SIZE + i;
        double f = x - i, w = 4 * s * s * s / ((HG_DFG_SIZE - 1.0) * fine);
        sum[0] += w * ((double)p[0].x * (1 - f) + (double)p[1].x * f);
        sum[1] += w * ((double)p[0].y * (1 - f) + (double)p[1].y * f);
    }
    out[HG_DFG_SIZE * HG_DFG_SIZE + row] = (struct hg_vec2){(float)sum[0], (float)sum[1]};
}

// --- sheen ---------------------------------------------------------------------------------------

// Lambda of the distribution. Estevez and Kulla 2017, section 3, fitted.
static float sheen_l(float x, float alpha)
{
    const float t = (1 - alpha) * (1 - alpha);
    const float a = 21.5473f + t * (25.3245f - 21.5473f), b = 3.82987f + t * (3.32435f - 3.82987f);
    const float c = 0.19823f + t * (0.16801f - 0.19823f), d = -1.97760f + t * (1.97760f - 1.27393f);
    const float e = -4.32054f + t * (4.32054f - 4.85967f);
    return a / (1 + b * powf(x, c)) + d * x + e;
}

static float sheen_lambda(float x, float alpha)
{
    return x < 0.5f ? expf(sheen_l(x, alpha))
                    : expf(2 * sheen_l(0.5f, alpha) - sheen_l(1 - x, alpha));
}

// Sum of the distribution over directions of one cosine z, without its factor.
static double sheen_ring(const struct ring *ring, const float v[3], float z, float alpha)
{
    const float s = sqrtf(1 - z * z);
    double sum = 0;
    for (uint32_t i = 0; i < ring->count; i++) {
        const float *at = ring->circle[i];
        const float h[3] = {v[0] + s * at[0], s * at[1], v[2] + z};
        const float sin2 = (h[0] * h[0] + h[1] * h[1]) / hg_dot3(h, h);
        sum += (double)powf(sin2, 0.5f / alpha);
    }
    return sum;
}

float hg_sheen_integrate(float n_dot_v, float roughness, uint32_t n)
{
    const float alpha = fmaxf(roughness * roughness, HG_SHEEN_MIN_ALPHA);
    const float v[3] = {sqrtf(fmaxf(0, 1 - n_dot_v * n_dot_v)), 0, n_dot_v};
    const float lambda_v = sheen_lambda(n_dot_v, alpha);
    double sum = 0;
    struct ring ring;
    half_circle(&ring, n);
    n = ring.count;
    for (uint32_t j = 0; j < n; j++) {
        // Cosines t^2: grazing directions, which get most of it, lie denser.
        const float t = ((float)j + 0.5f) / (float)n, z = t * t;
        const float lambda = sheen_lambda(z, alpha) + lambda_v;
        sum += sheen_ring(&ring, v, z, alpha) * (double)(2 * t / ((1 + lambda) * 4 * n_dot_v));
    }
    // D of the rest: (2 + 1 / alpha) / 2 pi; both halves of the ring: 2 pi.
    return (float)(sum * (double)(2 + 1 / alpha) / ((double)n * n));
}

static void fill_sheen(struct hg_vec2 *out, uint32_t row)
{
    out += HG_SHEEN_FIRST + row * HG_SHEEN_SIZE;
    for (uint32_t i = 0; i < HG_SHEEN_SIZE; i++) {
        const float s = (float)i / (HG_SHEEN_SIZE - 1);
        const float roughness = (float)row / (HG_SHEEN_SIZE - 1);
        out[i].x =
            fminf(hg_sheen_integrate(fmaxf(s * s, 1e-3f), roughness, 128) / HG_SHEEN_MOST, 1);
    }
}

// x of hg_sheen_albedo in lib/lobes.glsl.
static float sheen_albedo(const struct hg_vec2 *table, float cosine, float roughness)
{
    enum { N = HG_SHEEN_SIZE };
    const float x = sqrtf(cosine) * (N - 1), y = roughness * (N - 1);
    const uint32_t i = (uint32_t)fminf(x, N - 2), j = (uint32_t)fminf(y, N - 2);
    const struct hg_vec2 *p = table + HG_SHEEN_FIRST + j * N + i;
    const float low = p[0].x + (p[1].x - p[0].x) * (x - (float)i);
    const float high = p[N].x + (p[N + 1].x - p[N].x) * (x - (float)i);
    return (low + (high - low) * (y - (float)j)) * HG_SHEEN_MOST;
}

float hg_sheen_kept(const struct hg_vec2 *table, float n_dot_v, float roughness, uint32_t n,
    float (*kept)(const void *user, float cosine), const void *user)
{
    const float alpha = fmaxf(roughness * roughness, HG_SHEEN_MIN_ALPHA);
    const float v[3] = {sqrtf(fmaxf(0, 1 - n_dot_v * n_dot_v)), 0, n_dot_v};
    const float albedo = sheen_albedo(table, n_dot_v, roughness), most = fmaxf(albedo, 1);
    double all = 0, sum = 0;
    struct ring ring;
    half_circle(&ring, n);
    n = ring.count;
    for (uint32_t j = 0; j < n; j++) {
        const float t = ((float)j + 0.5f) / (float)n, z = t * t;
        const float lambda = sheen_lambda(z, alpha) + sheen_lambda(n_dot_v, alpha);
        const double part = sheen_ring(&ring, v, z, alpha) * (double)(t / (1 + lambda));
        all += part;
        sum += part * (double)(kept ? kept(user, z) : 1) /
               (double)fmaxf(most, sheen_albedo(table, z, roughness));
    }
    return albedo * (float)(sum / fmax(all, 1e-300));
}

static void fill_sheen_kept(struct hg_vec2 *table, uint32_t row)
{
    struct hg_vec2 *out = table + HG_SHEEN_FIRST + row * HG_SHEEN_SIZE;
    const float roughness = (float)row / (HG_SHEEN_SIZE - 1);
    float most = 0;
    for (uint32_t i = 0; i < HG_SHEEN_SIZE; i++)
        most = fmaxf(most, out[i].x * HG_SHEEN_MOST);
    for (uint32_t i = 0; i < HG_SHEEN_SIZE; i++) {
        const float s = (float)i / (HG_SHEEN_SIZE - 1);
        out[i].y = out[i].x * HG_SHEEN_MOST;
        if (most > 1)
            out[i].y =
                fminf(hg_sheen_kept(table, fmaxf(s * s, 1e-3f), roughness, 96, NULL, NULL), 1);
    }
}

void hg_dfg_fill(struct hg_vec2 out[HG_DFG_WORDS])
{
    for (uint32_t row = 0; row < HG_DFG_SIZE; row++)
        fill_row(out, row);
    for (uint32_t row = 0; row < HG_SHEEN_SIZE; row++)
        fill_sheen(out, row);
    for (uint32_t row = 0; row < HG_SHEEN_SIZE; row++)
        fill_sheen_kept(out, row);
    hg_dfg_fill_layers(out);
    hg_dfg_fill_glass(out);
    hg_dfg_fill_aniso(out);
    hg_dfg_fill_layered_aniso(out);
}
