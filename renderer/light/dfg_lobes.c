#include "renderer/light/dfg_lobes.h"

#include "renderer/light/vec.h"

enum { most_points = 128 };

// --- visible normals -----------------------------------------------------------------------------

// All points of the integrals: rings of spherical caps (Dupuy and Benyoub 2023).
struct caps {
    float v[3], alpha[2];
    float stretched[3];
    float one_and_lambda_v;
    uint32_t rings, points;
    float span; // azimuths 0..span; half of the circle where both halves are alike
    float circle[most_points][2];
};

// One visible normal: v.h, its share of all, and h itself.
struct facet {
    float h[3], v_dot_h;
    float weight;
};

// Smith's Lambda. Heitz 2014 eq. 72 and 80.
static float smith_lambda(const float w[3], const float alpha[2])
{
    const float x = w[0] * alpha[0], y = w[1] * alpha[1], z2 = fmaxf(w[2] * w[2], 1e-14f);
    return 0.5f * (sqrtf(1 + (x * x + y * y) / z2) - 1);
}

static void caps_init(struct caps *c, const float v[3], const float alpha[2], uint32_t n, bool half)
{
    for (int i = 0; i < 3; i++)
        c->v[i] = v[i];
    for (int i = 0; i < 2; i++)
        c->alpha[i] = fmaxf(alpha[i], 1e-5f);
    c->stretched[0] = v[0] * c->alpha[0];
    c->stretched[1] = v[1] * c->alpha[1];
    c->stretched[2] = v[2];
    hg_normalize3(c->stretched);
    c->one_and_lambda_v = 1 + smith_lambda(v, c->alpha);
    c->rings = n;
    c->points = half ? n / 2 : n;
    c->points = c->points < most_points ? c->points : most_points;
    c->span = (float)HG_PI * (half ? 1 : 2);
    for (uint32_t i = 0; i < c->points; i++) {
        const float phi = c->span * ((float)i + 0.5f) / (float)c->points;
        c->circle[i][0] = cosf(phi);
        c->circle[i][1] = sinf(phi);
    }
}

static struct facet caps_at(const struct caps *c, uint32_t ring, uint32_t point)
{
    // Midpoints of t with u = t^2 (3 - 2 t): the ends, where integrands bend, lie denser.
    const float t = ((float)ring + 0.5f) / (float)c->rings, u = t * t * (3 - 2 * t);
    const float z = (1 - u) * (1 + c->stretched[2]) - c->stretched[2];
    const float r = sqrtf(hg_clampf(1 - z * z, 0, 1));
    const float all = (float)c->rings + 0.5f / (float)c->rings; // of 6 t (1 - t) over the rings
    struct facet f = {.weight = 6 * t * (1 - t) / (all * (float)c->points)};
    f.h[0] = (r * c->circle[point][0] + c->stretched[0]) * c->alpha[0];
    f.h[1] = (r * c->circle[point][1] + c->stretched[1]) * c->alpha[1];
    f.h[2] = fmaxf(z + c->stretched[2], 1e-9f);
    hg_normalize3(f.h);
    f.v_dot_h = hg_dot3(c->v, f.h);
    return f;
}

// What is not in shadow of the light that a visible facet sends to l: G2 / G1(v), Heitz 2014
// eq. 99.
static float unshadowed(const struct caps *c, const float l[3])
{
    return c->one_and_lambda_v / (c->one_and_lambda_v + smith_lambda(l, c->alpha));
}

static bool mirrored(const struct caps *c, const struct facet *f, float l[3])
{
    for (int i = 0; i < 3; i++)
        l[i] = 2 * f->v_dot_h * f->h[i] - c->v[i];
    return l[2] > 0;
}

static bool bent(const struct caps *c, const struct facet *f, float eta, float l[3])
{
    const float k = 1 - (1 - f->v_dot_h * f->v_dot_h) / (eta * eta);
    if (k <= 0)
        return false;
    const float along = f->v_dot_h / eta - sqrtf(k);
    for (int i = 0; i < 3; i++)
        l[i] = f->h[i] * along - c->v[i] / eta;
    return l[2] < 0;
}

static void direction(float cosine, float azimuth_cosine, float v[3])
{
    const float s = sqrtf(fmaxf(0, 1 - cosine * cosine));
    v[0] = s * azimuth_cosine;
    v[1] = s * sqrtf(fmaxf(0, 1 - azimuth_cosine * azimuth_cosine));
    v[2] = cosine;
}

// --- integrals -----------------------------------------------------------------------------------

// Walter et al. 2007 eq. 22.
static float fresnel(float c, float eta)
{
    const float g2 = eta * eta - 1 + c * c;
    if (g2 <= 0)
        return 1;
    const float g = sqrtf(g2), a = (g - c) / (g + c);
    const float b = (c * (g + c) - 1) / (c * (g - c) + 1);
    return 0.5f * a * a * (1 + b * b);
}

static float glass_miss(const struct caps *c, float eta)
{
    double sum = 0;
    float l[3];
    for (uint32_t j = 0; j < c->rings; j++)
        for (uint32_t i = 0; i < c->points; i++) {
            const struct facet f = caps_at(c, j, i);
            const float reflected = fresnel(fminf(f.v_dot_h, 1), eta);
            if (mirrored(c, &f, l))
                sum += (double)(f.weight * reflected * unshadowed(c, l));
            if (reflected < 1 && bent(c, &f, eta, l))
                sum += (double)(f.weight * (1 - reflected) * unshadowed(c, l));
        }
    return hg_clampf(1 - (float)sum, 0, 1);
}

float hg_glass_miss_integrate(float n_dot_v, float alpha, float eta, uint32_t n)
{
    struct caps c;
    float v[3];
    direction(n_dot_v, 1, v);
    caps_init(&c, v, (float[2]){alpha, alpha}, n, true);
    return glass_miss(&c, eta);
}

// Cosines at facets and their shares of all.
struct cosines {
    uint32_t count;
    double x[most_points * most_points / 8], w[most_points * most_points / 8];
};

static void cosines_fill(struct cosines *m, float n_dot_v, float alpha, uint32_t n, bool lost)
{
    struct caps c;
    float v[3], l[3];
    double sum = 0;
    direction(n_dot_v, 1, v);
    caps_init(&c, v, (float[2]){alpha, alpha}, n, true);
    m->count = 0;
    for (uint32_t j = 0; j < c.rings; j++)
        for (uint32_t i = 0; i < c.points; i++) {
            const struct facet f = caps_at(&c, j, i);
            const bool reflects = mirrored(&c, &f, l);
            const float arrives = reflects ? unshadowed(&c, l) : 0;
            if (m->count == sizeof m->x / sizeof *m->x)
                continue;
            m->x[m->count] = (double)f.v_dot_h;
            m->w[m->count] = (double)(f.weight * (lost ? 1 - arrives : arrives));
            sum += m->w[m->count++];
        }
    for (uint32_t i = 0; i < m->count; i++)
        m->w[i] /= fmax(sum, 1e-300);
}

// The first three orthogonal polynomials of a measure: p[k + 1] = (x - a[k]) p[k] - b[k] p[k - 1].
struct polynomials {
    double a[3], b[3];
};

static void evaluate(const struct polynomials *q, double x, double p[4])
{
    p[0] = 1;
    p[1] = x - q->a[0];
    p[2] = (x - q->a[1]) * p[1] - q->b[1];
    p[3] = (x - q->a[2]) * p[2] - q->b[2] * p[1];
}

// Stieltjes's procedure; Gautschi 2004, section 2.2.3.1.
static void orthogonalise(const struct cosines *m, struct polynomials *q)
{
    double before = 1;
    *q = (struct polynomials){{0}, {0}};
    for (int k = 0; k < 3; k++) {
        double norm = 0, along = 0, p[4];
        for (uint32_t i = 0; i < m->count; i++) {
            evaluate(q, m->x[i], p);
            norm += m->w[i] * p[k] * p[k];
            along += m->w[i] * p[k] * p[k] * m->x[i];
        }
        q->a[k] = along / fmax(norm, 1e-300);
        q->b[k] = norm / before;
        before = fmax(norm, 1e-300);
    }
}

static double root_between(const struct polynomials *q, double low, double high)
{
    double p[4];
    evaluate(q, low, p);
    const bool negative = p[3] < 0;
    for (int i = 0; i < 40; i++) {
        const double middle = (low + high) / 2;
        evaluate(q, middle, p);
        *((p[3] < 0) == negative ? &low : &high) = middle;
    }
    return (low + high) / 2;
}

void hg_facet_angles(float n_dot_v, float alpha, uint32_t n, bool lost, float out[3][2])
{
    struct cosines m;
    struct polynomials q;
    cosines_fill(&m, n_dot_v, alpha, n, lost);
    orthogonalise(&m, &q);
    const bool narrow = q.b[1] < 1e-8 || q.b[2] < 1e-10;
    // Between the two roots of p[2] and around them.
    const double middle = (q.a[0] + q.a[1]) / 2, half = (q.a[0] - q.a[1]) / 2;
    const double root = sqrt(half * half + q.b[1]);
    const double ends[4] = {0, middle - root, middle + root, 1};
    for (int i = 0; i < 3; i++) {
        double p[4];
        const double x = narrow ? q.a[0] : root_between(&q, ends[i], ends[i + 1]);
        evaluate(&q, x, p);
        const double w = 1 / (1 + p[1] * p[1] / q.b[1] + p[2] * p[2] / (q.b[1] * q.b[2]));
        out[i][0] = hg_clampf((float)x, 0, 1);
        out[i][1] = narrow ? (i == 1 ? 2.0f / 3 : 1.0f / 6) : (float)w;
    }
}

void hg_aniso_integrate(const float v[3], const float alpha[2], uint32_t n, float ab[2])
{
    struct caps c;
    float l[3];
    double a = 0, b = 0;
    caps_init(&c, v, alpha, n, false);
    for (uint32_t j = 0; j < c.rings; j++)
        for (uint32_t i = 0; i < c.points; i++) {
            const struct facet f = caps_at(&c, j, i);
            if (!mirrored(&c, &f, l))
                continue;
            const float m = hg_clampf(1 - f.v_dot_h, 0, 1), m2 = m * m, schlick = m2 * m2 * m;
            const float w = f.weight * unshadowed(&c, l);
            a += (double)(w * (1 - schlick));
            b += (double)(w * schlick);
        }
    ab[0] = (float)a;
    ab[1] = (float)b;
}

// --- tables --------------------------------------------------------------------------------------

static float place(uint32_t i, uint32_t size)
{
    return (float)i / (float)(size - 1);
}

// Cosine at a place, but for the one at 0, where there is nothing to integrate.
static float cosine_at(uint32_t i, uint32_t size)
{
    return fmaxf(place(i, size) * place(i, size), 1e-3f);
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
        miss[i].x = hg_glass_miss_integrate(cosine_at(i, N), alpha, eta, 20);
        miss[i].y = hg_glass_miss_integrate(cosine_at(i, N), alpha, 1 / eta, 20);
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
    struct hg_vec2 *out = (struct hg_vec2 *)user + (lost ? HG_LOST_FIRST : HG_ANGLES_FIRST);
    for (uint32_t i = 0; i < N; i++) {
        const float r = place(row, N);
        float angles[3][2];
        hg_facet_angles(cosine_at(i, N), r * r, 24, lost, angles);
        for (uint32_t k = 0; k < 3; k++)
            out[(row * N + i) * 3 + k] = (struct hg_vec2){angles[k][0], angles[k][1]};
    }
}

// hg_dfg of lib/brdf.glsl.
static struct hg_vec2 isotropic(const struct hg_vec2 *table, float cosine, float roughness)
{
    const float last = HG_DFG_SIZE - 1;
    const float x = hg_clampf(sqrtf(cosine), 0, 1) * last, y = hg_clampf(roughness, 0, 1) * last;
    const uint32_t i = (uint32_t)fminf(x, last - 1), j = (uint32_t)fminf(y, last - 1);
    const float f = x - (float)i, g = y - (float)j;
    const struct hg_vec2 *p = table + j * HG_DFG_SIZE + i, *q = p + HG_DFG_SIZE;
    return (struct hg_vec2){
        (p[0].x * (1 - f) + p[1].x * f) * (1 - g) + (q[0].x * (1 - f) + q[1].x * f) * g,
        (p[0].y * (1 - f) + p[1].y * f) * (1 - g) + (q[0].y * (1 - f) + q[1].y * f) * g};
}

// hg_aniso_roughness and hg_aniso_cosine of lib/lobes.glsl, and the isotropic albedo there.
static float aniso_roughness(const float alpha[2])
{
    const float rms = sqrtf(0.5f * (alpha[0] * alpha[0] + alpha[1] * alpha[1]));
    return sqrtf(rms + (0.5f * (alpha[0] + alpha[1]) - rms) * 0.15f);
}

static struct hg_vec2 aniso_guess(
    const struct hg_vec2 *table, const float v[3], const float alpha[2])
{
    const float roughness = aniso_roughness(alpha), width = roughness * roughness;
    const float x = v[0] * alpha[0], y = v[1] * alpha[1];
    const float k = v[2] * v[2] + (x * x + y * y) / fmaxf(width * width, 1e-12f);
    return isotropic(table, v[2] / sqrtf(fmaxf(k, 1e-12f)), roughness);
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

static void fill_aniso(void *user, size_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS };
    struct hg_vec2 *table = user, *out = table + HG_ANISO_FIRST + job * A * C;
    const bool strong = job % HG_ANISO_STRENGTHS != 0;
    float alpha[2], v[3], ab[2];
    aniso_alpha(job, alpha);
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        direction(cosine_at(column, C), place(i / C, A), v);
        hg_aniso_integrate(v, alpha, strong ? 20 : 1, ab);
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
        const float x = s * (C - 1), y = turn * (A - 1);
        const uint32_t i = (uint32_t)x, j = (uint32_t)y;
        const float f = x - (float)i, g = y - (float)j, w = 4 * s * s * s / (FINE * TURNS);
        const struct hg_vec2 *p = delta + j * C + i, *q = p + C;
        direction(s * s, turn, v);
        const struct hg_vec2 guess = aniso_guess(table, v, alpha);
        const float dx =
            (p[0].x * (1 - f) + p[1].x * f) * (1 - g) + (q[0].x * (1 - f) + q[1].x * f) * g;
        const float dy =
            (p[0].y * (1 - f) + p[1].y * f) * (1 - g) + (q[0].y * (1 - f) + q[1].y * f) * g;
        sum[0] += (double)(w * (guess.x + (dx - 0.5f) * 2 * HG_ANISO_RANGE));
        sum[1] += (double)(w * (guess.y + (dy - 0.5f) * 2 * HG_ANISO_RANGE));
    }
    const float at = aniso_roughness(alpha) * (HG_DFG_SIZE - 1);
    const uint32_t row = (uint32_t)fminf(at, HG_DFG_SIZE - 2);
    const float f = at - (float)row;
    const struct hg_vec2 *p = table + HG_DFG_SIZE * HG_DFG_SIZE + row;
    table[HG_ANISO_MEANS + job].x = correction((float)sum[0] - (p[0].x * (1 - f) + p[1].x * f));
    table[HG_ANISO_MEANS + job].y = correction((float)sum[1] - (p[0].y * (1 - f) + p[1].y * f));
}

// One layer of hg_glass_miss of lib/lobes.glsl.
static struct hg_vec2 glass_layer(const struct hg_vec2 *p, float x, float y)
{
    const float last = HG_GLASS_SIZE - 1;
    const uint32_t i = (uint32_t)fminf(x, last - 1), j = (uint32_t)fminf(y, last - 1);
    const float f = x - (float)i, g = y - (float)j;
    p += j * HG_GLASS_SIZE + i;
    const struct hg_vec2 *q = p + HG_GLASS_SIZE;
    return (struct hg_vec2){
        (p[0].x * (1 - f) + p[1].x * f) * (1 - g) + (q[0].x * (1 - f) + q[1].x * f) * g,
        (p[0].y * (1 - f) + p[1].y * f) * (1 - g) + (q[0].y * (1 - f) + q[1].y * f) * g};
}

// Miss of glass of HG_BRUSHED_IOR at the isotropic surface's cosine.
static struct hg_vec2 brushed_guess(
    const struct hg_vec2 *table, const float v[3], const float alpha[2])
{
    const float roughness = aniso_roughness(alpha), width = roughness * roughness;
    const float x = v[0] * alpha[0], y = v[1] * alpha[1], last = HG_GLASS_SIZE - 1;
    const float k = v[2] * v[2] + (x * x + y * y) / fmaxf(width * width, 1e-12f);
    const float cosine = hg_clampf(v[2] / sqrtf(fmaxf(k, 1e-12f)), 0, 1);
    const float ratio = (HG_BRUSHED_IOR - 1) / (HG_BRUSHED_IOR + 1);
    const float far = sqrtf(ratio / HG_GLASS_FAR) * (HG_GLASS_IORS - 1), f = far - floorf(far);
    const struct hg_vec2 *p =
        table + HG_GLASS_FIRST + (uint32_t)far * HG_GLASS_SIZE * HG_GLASS_SIZE;
    const float s = sqrtf(cosine) * last, r = hg_clampf(roughness, 0, 1) * last;
    const struct hg_vec2 near = glass_layer(p, s, r);
    const struct hg_vec2 next = glass_layer(p + HG_GLASS_SIZE * HG_GLASS_SIZE, s, r);
    return (struct hg_vec2){near.x * (1 - f) + next.x * f, near.y * (1 - f) + next.y * f};
}

static void fill_brushed(void *user, size_t job)
{
    enum { C = HG_ANISO_COSINES, A = HG_ANISO_AZIMUTHS };
    struct hg_vec2 *table = user, *out = table + HG_BRUSHED_FIRST + job * A * C;
    float alpha[2], v[3];
    struct caps c;
    aniso_alpha(job, alpha);
    for (uint32_t i = 0; i < A * C; i++) {
        const uint32_t column = i % C > 0 ? i % C : 1; // grazing ones are like their neighbours
        out[i] = (struct hg_vec2){0.5f, 0.5f};
        if (job % HG_ANISO_STRENGTHS == 0)
            continue;
        direction(cosine_at(column, C), place(i / C, A), v);
        caps_init(&c, v, alpha, 20, false);
        const struct hg_vec2 guess = brushed_guess(table, v, alpha);
        out[i].x = correction(glass_miss(&c, HG_BRUSHED_IOR) - guess.x);
        out[i].y = correction(glass_miss(&c, 1 / HG_BRUSHED_IOR) - guess.y);
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
        const float x = s * (C - 1), y = turn * (A - 1), w = 4 * s * s * s;
        const uint32_t i = (uint32_t)x, j = (uint32_t)y;
        const float f = x - (float)i, g = y - (float)j;
        const struct hg_vec2 *p = delta + j * C + i, *q = p + C;
        direction(s * s, turn, v);
        const struct hg_vec2 guess = brushed_guess(table, v, alpha);
        const struct hg_vec2 round = brushed_guess(table, v, (float[2]){width, width});
        const float dx =
            (p[0].x * (1 - f) + p[1].x * f) * (1 - g) + (q[0].x * (1 - f) + q[1].x * f) * g;
        const float dy =
            (p[0].y * (1 - f) + p[1].y * f) * (1 - g) + (q[0].y * (1 - f) + q[1].y * f) * g;
        sum.x += w * hg_clampf(guess.x + (dx - 0.5f) * 2 * HG_ANISO_RANGE, 0, 1);
        sum.y += w * hg_clampf(guess.y + (dy - 0.5f) * 2 * HG_ANISO_RANGE, 0, 1);
        all.x += w * round.x;
        all.y += w * round.y;
    }
    table[HG_BRUSHED_MEANS + job].x =
        hg_clampf(sum.x / fmaxf(all.x * HG_BRUSHED_MOST, 1e-9f), 0, 1);
    table[HG_BRUSHED_MEANS + job].y =
        hg_clampf(sum.y / fmaxf(all.y * HG_BRUSHED_MOST, 1e-9f), 0, 1);
}

// Share that a layer of this roughness takes at a cosine: of HG_COAT_FIRST or HG_CLOTH_FIRST.
static float layer_albedo(const struct hg_vec2 *table, bool coat, float cosine, float roughness)
{
    if (coat) {
        const struct hg_vec2 dfg = isotropic(table, cosine, roughness);
        return 0.04f * dfg.x + dfg.y;
    }
    const float last = HG_SHEEN_SIZE - 1;
    const float x = hg_clampf(sqrtf(cosine), 0, 1) * last, y = hg_clampf(roughness, 0, 1) * last;
    const uint32_t i = (uint32_t)fminf(x, last - 1), j = (uint32_t)fminf(y, last - 1);
    const float f = x - (float)i, g = y - (float)j;
    const struct hg_vec2 *p = table + HG_SHEEN_FIRST + j * HG_SHEEN_SIZE + i,
                         *q = p + HG_SHEEN_SIZE;
    return (p[0].y * (1 - f) + p[1].y * f) * (1 - g) + (q[0].y * (1 - f) + q[1].y * f) * g;
}

static struct hg_vec2 layer_lost(
    const struct hg_vec2 *table, bool coat, float cosine, float alpha, float roughness)
{
    struct caps c;
    float v[3], l[3];
    struct hg_vec2 lost = {0, 0};
    const float here = layer_albedo(table, coat, cosine, roughness);
    direction(cosine, 1, v);
    caps_init(&c, v, (float[2]){alpha, alpha}, 24, true);
    for (uint32_t j = 0; j < c.rings; j++)
        for (uint32_t i = 0; i < c.points; i++) {
            const struct facet f = caps_at(&c, j, i);
            if (!mirrored(&c, &f, l))
                continue;
            const float m = hg_clampf(1 - f.v_dot_h, 0, 1), m2 = m * m, schlick = m2 * m2 * m;
            const float more = layer_albedo(table, coat, fminf(l[2], 1), roughness) - here;
            const float w = f.weight * unshadowed(&c, l) * fmaxf(more, 0);
            lost.x += w * (1 - schlick);
            lost.y += w * schlick;
        }
    return lost;
}

static void fill_layers(void *user, size_t job)
{
    enum { N = HG_LAYER_SIZE };
    struct hg_vec2 *table = user;
    const uint32_t top = (uint32_t)job / N % HG_LAYER_ROUGHS, row = (uint32_t)job % N;
    const float r = place(row, N);
    for (uint32_t i = 0; i < N; i++)
        table[HG_COAT_FIRST + job * N + i] = layer_lost(
            table, job < N * HG_LAYER_ROUGHS, cosine_at(i, N), r * r, place(top, HG_LAYER_ROUGHS));
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
