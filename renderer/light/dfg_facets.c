#include "renderer/light/dfg_facets.h"

#include "renderer/light/vec.h"

// --- visible normals -----------------------------------------------------------------------------

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

void hg_facets_init(
    struct hg_facets *c, const float v[3], const float alpha[2], uint32_t n, bool half)
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
    c->points = c->points < HG_FACETS_POINTS ? c->points : HG_FACETS_POINTS;
    c->span = (float)HG_PI * (half ? 1 : 2);
    for (uint32_t i = 0; i < c->points; i++) {
        const float phi = c->span * ((float)i + 0.5f) / (float)c->points;
        c->circle[i][0] = cosf(phi);
        c->circle[i][1] = sinf(phi);
    }
}

static struct facet facet_at(const struct hg_facets *c, uint32_t ring, uint32_t point)
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
static float unshadowed(const struct hg_facets *c, const float l[3])
{
    return c->one_and_lambda_v / (c->one_and_lambda_v + smith_lambda(l, c->alpha));
}

static bool mirrored(const struct hg_facets *c, const struct facet *f, float l[3])
{
    for (int i = 0; i < 3; i++)
        l[i] = 2 * f->v_dot_h * f->h[i] - c->v[i];
    return l[2] > 0;
}

static bool bent(const struct hg_facets *c, const struct facet *f, float eta, float l[3])
{
    const float k = 1 - (1 - f->v_dot_h * f->v_dot_h) / (eta * eta);
    if (k <= 0)
        return false;
    const float along = f->v_dot_h / eta - sqrtf(k);
    for (int i = 0; i < 3; i++)
        l[i] = f->h[i] * along - c->v[i] / eta;
    return l[2] < 0;
}

void hg_facets_direction(float cosine, float azimuth_cosine, float v[3])
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

void hg_facets_glass_miss(const struct hg_facets *c, uint32_t count, const float *eta, float *miss)
{
    double sum[HG_FACETS_ETAS] = {0};
    float l[3];
    for (uint32_t j = 0; j < c->rings; j++)
        for (uint32_t i = 0; i < c->points; i++) {
            const struct facet f = facet_at(c, j, i);
            const float back = mirrored(c, &f, l) ? f.weight * unshadowed(c, l) : 0;
            for (uint32_t k = 0; k < count; k++) {
                const float reflected = fresnel(fminf(f.v_dot_h, 1), eta[k]);
                sum[k] += (double)(reflected * back);
                if (reflected < 1 && bent(c, &f, eta[k], l))
                    sum[k] += (double)((1 - reflected) * f.weight * unshadowed(c, l));
            }
        }
    for (uint32_t k = 0; k < count; k++)
        miss[k] = hg_clampf(1 - (float)sum[k], 0, 1);
}

// Cosines at facets and their shares of all.
struct cosines {
    uint32_t count;
    double x[HG_FACETS_POINTS * HG_FACETS_POINTS / 8], w[HG_FACETS_POINTS * HG_FACETS_POINTS / 8];
};

static void cosines_fill(struct cosines *m, const struct hg_facets *c, bool lost)
{
    float l[3];
    double sum = 0;
    m->count = 0;
    for (uint32_t j = 0; j < c->rings; j++)
        for (uint32_t i = 0; i < c->points; i++) {
            const struct facet f = facet_at(c, j, i);
            const bool reflects = mirrored(c, &f, l);
            const float arrives = reflects ? unshadowed(c, l) : 0;
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

void hg_facets_angles(const struct hg_facets *c, bool lost, float out[3][2])
{
    struct cosines m;
    struct polynomials q;
    cosines_fill(&m, c, lost);
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

void hg_facets_reflect(
    const struct hg_facets *c, float (*kept)(const void *, float), const void *user, float ab[2])
{
    float l[3];
    double a = 0, b = 0;
    for (uint32_t j = 0; j < c->rings; j++)
        for (uint32_t i = 0; i < c->points; i++) {
            const struct facet f = facet_at(c, j, i);
            if (!mirrored(c, &f, l))
                continue;
            const float m = hg_clampf(1 - f.v_dot_h, 0, 1), m2 = m * m, schlick = m2 * m2 * m;
            const float share = kept ? kept(user, fminf(l[2], 1)) : 1;
            const float w = f.weight * unshadowed(c, l) * share;
            a += (double)(w * (1 - schlick));
            b += (double)(w * schlick);
        }
    ab[0] = (float)a;
    ab[1] = (float)b;
}
