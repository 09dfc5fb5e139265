#include "renderer/light/albedo/vndf_quadrature.h"

#include "base/simd.h"
#include "renderer/math/vec.h"

// --- visible normals -----------------------------------------------------------------------------

// Smith's Lambda. Heitz 2014 eq. 72 and 80.
static inline float smith_lambda(float x, float y, float z, const float alpha[2])
{
    const float ax = x * alpha[0], ay = y * alpha[1], z2 = fmaxf(z * z, 1e-14f);
    return 0.5f * (sqrtf(1 + (ax * ax + ay * ay) / z2) - 1);
}

// Unshadowed share of the light that a visible microfacet reflects to a direction: G2 / G1(v),
// Heitz 2014 eq. 99.
static inline float unshadowed(const struct hg_vndf_quadrature *c, float x, float y, float z)
{
    return c->one_and_lambda_v / (c->one_and_lambda_v + smith_lambda(x, y, z, c->alpha));
}

// Azimuths of the normals of a ring.
struct ring {
    uint32_t points;
    float cosine[HG_VNDF_RING], sine[HG_VNDF_RING];
};

// Appends a ring of normals. u: share of the cap above it; weight of each.
HG_SIMD_LOOP static void ring_fill(struct hg_vndf_quadrature *c, const struct ring *ring, float u,
    float weight, const float stretched[3])
{
    const uint32_t first = c->count, points = ring->points;
    const float z = (1 - u) * (1 + stretched[2]) - stretched[2];
    const float r = sqrtf(hg_clampf(1 - z * z, 0, 1)), up = fmaxf(z + stretched[2], 1e-9f);
    for (uint32_t i = 0; i < points; i++) {
        const float x = (r * ring->cosine[i] + stretched[0]) * c->alpha[0];
        const float y = (r * ring->sine[i] + stretched[1]) * c->alpha[1];
        const float scale = 1 / sqrtf(x * x + y * y + up * up);
        c->h[0][first + i] = x * scale;
        c->h[1][first + i] = y * scale;
        c->h[2][first + i] = up * scale;
        c->weight[first + i] = weight;
        c->v_dot_h[first + i] = fminf((c->v[0] * x + c->v[1] * y + c->v[2] * up) * scale, 1);
    }
    c->count += points;
}

HG_SIMD_LOOP static void mirror_fill(struct hg_vndf_quadrature *c)
{
    for (uint32_t i = 0; i < c->count; i++) {
        const float twice = 2 * c->v_dot_h[i];
        const float x = twice * c->h[0][i] - c->v[0], y = twice * c->h[1][i] - c->v[1];
        const float z = twice * c->h[2][i] - c->v[2];
        const float share = c->weight[i] * unshadowed(c, x, y, z);
        c->mirror_cos[i] = fminf(z, 1);
        c->mirrored[i] = z > 0 ? share : 0;
    }
}

void hg_vndf_init(
    struct hg_vndf_quadrature *c, const float v[3], const float alpha[2], uint32_t n, bool half)
{
    const uint32_t all_points = half && n > 1 ? n / 2 : n;
    const uint32_t points = all_points < HG_VNDF_RING ? all_points : HG_VNDF_RING;
    struct ring ring = {.points = points};
    for (uint32_t i = 0; i < points; i++) {
        const float phi = (float)HG_PI * (half ? 1 : 2) * ((float)i + 0.5f) / (float)points;
        ring.cosine[i] = cosf(phi);
        ring.sine[i] = sinf(phi);
    }
    hg_copy3(v, c->v);
    for (int i = 0; i < 2; i++)
        c->alpha[i] = fmaxf(alpha[i], 1e-5f);
    float stretched[3] = {v[0] * c->alpha[0], v[1] * c->alpha[1], v[2]};
    hg_normalize3(stretched);
    c->one_and_lambda_v = 1 + smith_lambda(v[0], v[1], v[2], c->alpha);
    c->count = 0;
    for (uint32_t j = 0; j < n && c->count + points <= HG_VNDF_MOST; j++) {
        // Midpoints of t with u = t^2 (3 - 2 t): the ends, where integrands bend, lie denser.
        const float t = ((float)j + 0.5f) / (float)n, u = t * t * (3 - 2 * t);
        const float all = (float)n + 0.5f / (float)n; // of 6 t (1 - t) over the rings
        ring_fill(c, &ring, u, 6 * t * (1 - t) / (all * (float)points), stretched);
    }
    mirror_fill(c);
}

void hg_vndf_direction(float cosine, float azimuth_cosine, float v[3])
{
    const float s = sqrtf(fmaxf(0, 1 - cosine * cosine));
    v[0] = s * azimuth_cosine;
    v[1] = s * sqrtf(fmaxf(0, 1 - azimuth_cosine * azimuth_cosine));
    v[2] = cosine;
}

// --- integrals -----------------------------------------------------------------------------------

// Walter et al. 2007 eq. 22.
static inline float fresnel(float c, float eta)
{
    const float g2 = eta * eta - 1 + c * c, g = sqrtf(fmaxf(g2, 0)), a = (g - c) / (g + c);
    const float b = (c * (g + c) - 1) / (c * (g - c) + 1);
    const float r = 0.5f * a * a * (1 + b * b);
    return g2 > 0 ? r : 1;
}

// Share of what facet i would refract, if it let all of it through, that arrives behind; cosine
// there.
static inline float refracted(
    const struct hg_vndf_quadrature *c, uint32_t i, float eta, float *cosine)
{
    const float d = c->v_dot_h[i], k = 1 - (1 - d * d) / (eta * eta);
    const float along = d / eta - sqrtf(fmaxf(k, 0)), s = 1 / eta;
    const float x = c->h[0][i] * along - c->v[0] * s, y = c->h[1][i] * along - c->v[1] * s;
    const float z = c->h[2][i] * along - c->v[2] * s, share = c->weight[i] * unshadowed(c, x, y, z);
    *cosine = fminf(-z, 1);
    return k > 0 && z < 0 ? share : 0;
}

HG_SIMD_LOOP void hg_vndf_glass(
    const struct hg_vndf_quadrature *c, uint32_t count, const float *eta, struct hg_vec2 *out)
{
    static _Thread_local float reflected[HG_VNDF_MOST], through[HG_VNDF_MOST];
    for (uint32_t k = 0; k < count; k++) {
        double back = 0, behind = 0;
        for (uint32_t i = 0; i < c->count; i++) {
            float cosine;
            const float r = fresnel(c->v_dot_h[i], eta[k]);
            reflected[i] = r * c->mirrored[i];
            through[i] = (1 - r) * refracted(c, i, eta[k], &cosine);
        }
        for (uint32_t i = 0; i < c->count; i++) {
            back += (double)reflected[i];
            behind += (double)through[i];
        }
        out[k] = (struct hg_vec2){
            hg_clampf((float)(1 - back - behind), 0, 1), hg_clampf((float)back, 0, 1)};
    }
}

void hg_vndf_let_through(const struct hg_vndf_quadrature *c, float eta,
    void (*each)(void *user, float share, float cosine), void *user)
{
    for (uint32_t i = 0; i < c->count; i++) {
        float cosine, share = refracted(c, i, eta, &cosine);
        if (share > 0)
            each(user, (1 - fresnel(c->v_dot_h[i], eta)) * share, cosine);
    }
}

// Cosines at facets, where there is total reflection as x = sqrt(cosine - edge), and their weights
// in each of hg_vndf_node's measures.
enum { MIRRORED, REFRACTED, SMOOTH, MEASURES };
struct cosines {
    uint32_t count;
    double edge; // 0: x are cosines
    double x[HG_VNDF_MOST], weight[MEASURES][HG_VNDF_MOST];
};

static void cosines_init(struct cosines *m, float eta)
{
    m->count = 0;
    m->edge = eta > 0 && eta < 1 ? sqrt(1 - (double)(eta * eta)) : 0;
}

static void cosines_add(struct cosines *m, const struct hg_vndf_node *node)
{
    const double x = (double)node->cosine;
    m->x[m->count] = m->edge > 0 ? sqrt(fmax(x - m->edge, 0)) : x;
    m->weight[MIRRORED][m->count] = (double)node->mirrored;
    m->weight[REFRACTED][m->count] = (double)node->refracted;
    m->weight[SMOOTH][m->count++] = (double)node->smooth;
}

// The first orthogonal polynomials of all their measures together:
// p[k + 1] = (x - a[k]) p[k] - b[k] p[k - 1]. norm: integrals of p[k]^2.
enum { N = HG_MEAN_NODES };
_Static_assert(N >= HG_VNDF_NODES && N >= HG_ANGLE_NODES, "most nodes of a rule");
struct polynomials {
    double a[N], b[N], norm[N];
};

static void evaluate(const struct polynomials *q, double x, uint32_t most, double *p)
{
    p[0] = 1;
    for (uint32_t k = 0; k < most; k++)
        p[k + 1] = (x - q->a[k]) * p[k] - (k > 0 ? q->b[k] * p[k - 1] : 0);
}

// Stieltjes's procedure; Gautschi 2004, section 2.2.3.1.
static void orthogonalise(const struct cosines *m, uint32_t nodes, struct polynomials *q)
{
    for (uint32_t k = 0; k < nodes; k++) {
        double norm = 0, along = 0, p[N + 1];
        for (uint32_t i = 0; i < m->count; i++) {
            evaluate(q, m->x[i], k, p);
            double w = 0;
            for (int j = 0; j < MEASURES; j++)
                w += m->weight[j][i];
            w *= p[k] * p[k];
            norm += w;
            along += w * m->x[i];
        }
        q->a[k] = along / fmax(norm, 1e-300);
        q->b[k] = k > 0 ? norm / fmax(q->norm[k - 1], 1e-300) : 0;
        q->norm[k] = norm;
    }
}

static double root_between(const struct polynomials *q, uint32_t degree, double low, double high)
{
    double p[N + 1];
    evaluate(q, low, degree, p);
    const bool negative = p[degree] < 0;
    for (int i = 0; i < 40; i++) {
        const double middle = (low + high) / 2;
        evaluate(q, middle, degree, p);
        *((p[degree] < 0) == negative ? &low : &high) = middle;
    }
    return (low + high) / 2;
}

// Those of one degree lie between those of the one before.
static void roots_of(const struct polynomials *q, uint32_t nodes, double out[N])
{
    double ends[N + 1] = {0, 1};
    for (uint32_t degree = 1; degree <= nodes; degree++) {
        for (uint32_t i = 0; i < degree; i++)
            out[i] = root_between(q, degree, ends[i], ends[i + 1]);
        for (uint32_t i = 0; i < degree; i++)
            ends[i + 1] = out[i];
        if (degree < nodes)
            ends[degree + 1] = 1;
    }
}

static void rule_of(const struct cosines *m, uint32_t nodes, struct hg_vndf_node *out)
{
    struct polynomials q;
    double roots[N], along[MEASURES][N] = {{0}}, p[N + 1];
    orthogonalise(m, nodes, &q);
    roots_of(&q, nodes, roots);
    for (uint32_t i = 0; i < m->count; i++) {
        evaluate(&q, m->x[i], nodes - 1, p);
        for (int j = 0; j < MEASURES; j++)
            for (uint32_t k = 0; k < nodes; k++)
                along[j][k] += m->weight[j][i] * p[k];
    }
    bool narrow = false;
    for (uint32_t k = 1; k < nodes; k++)
        narrow = narrow || q.b[k] < 1e-8;
    for (uint32_t i = 0; i < nodes; i++) {
        const double x = narrow ? q.a[0] : roots[i];
        evaluate(&q, x, nodes - 1, p);
        double sum = 0, share[MEASURES] = {0};
        for (uint32_t k = 0; k < (narrow ? 1u : nodes); k++) {
            const double norm = fmax(q.norm[k], 1e-300);
            sum += p[k] * p[k] / norm;
            for (int j = 0; j < MEASURES; j++)
                share[j] += along[j][k] * p[k] / norm;
        }
        const double weight = narrow ? q.norm[0] / nodes : 1 / sum;
        out[i].cosine = hg_clampf((float)(m->edge > 0 ? m->edge + x * x : x), 0, 1);
        out[i].mirrored = (float)(weight * share[MIRRORED]);
        out[i].refracted = (float)(weight * share[REFRACTED]);
        out[i].smooth = (float)(weight * share[SMOOTH]);
    }
}

void hg_vndf_rule(
    const struct hg_vndf_quadrature *c, float eta, uint32_t nodes, struct hg_vndf_node *out)
{
    static _Thread_local struct cosines m;
    cosines_init(&m, eta);
    for (uint32_t i = 0; i < c->count; i++) {
        float cosine;
        const float refracts = eta > 0 ? refracted(c, i, eta, &cosine) : 0;
        if (eta <= 0 || fresnel(c->v_dot_h[i], eta) < 1)
            cosines_add(&m, &(struct hg_vndf_node){c->v_dot_h[i], c->mirrored[i], refracts, 0});
    }
    rule_of(&m, nodes, out);
}

void hg_vndf_rule_of_nodes(const struct hg_vndf_node *many, uint32_t count, float eta,
    uint32_t nodes, struct hg_vndf_node *out)
{
    static _Thread_local struct cosines m;
    cosines_init(&m, eta);
    for (uint32_t i = 0; i < count && i < HG_VNDF_MOST; i++)
        cosines_add(&m, &many[i]);
    rule_of(&m, nodes, out);
}

void hg_vndf_reflect(const struct hg_vndf_quadrature *c, float (*kept)(const void *, float),
    const void *user, float ab[2])
{
    double a = 0, b = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        if (c->mirrored[i] <= 0)
            continue;
        const float m = hg_clampf(1 - c->v_dot_h[i], 0, 1), m2 = m * m, schlick = m2 * m2 * m;
        const float w = c->mirrored[i] * (kept ? kept(user, c->mirror_cos[i]) : 1);
        a += (double)(w * (1 - schlick));
        b += (double)(w * schlick);
    }
    ab[0] = (float)a;
    ab[1] = (float)b;
}
