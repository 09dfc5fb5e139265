#include "renderer/light/ltc/ltc.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/vec3d.h"
#include "renderer/math/vec.h"

enum {
    POINTS = 20, // per axis, of either sampling
    PARAMS = 3,
    STEPS = 90, // of the search
};

// --- the lobe that is fitted ---------------------------------------------------------------------

struct lobe {
    double alpha, v[3];
    double albedo, mean[3]; // of the part above the horizon
};

static void normalize(double a[3])
{
    const double l = sqrt(hg_dot3d(a, a));
    for (int i = 0; i < 3; i++)
        a[i] /= l;
}

// Lambda of Smith's masking. Heitz 2014, "Understanding the Masking-Shadowing Function", eq. 72.
static double lambda(double alpha, double cosine)
{
    const double tan2 = fmax(1 / (cosine * cosine) - 1, 0);
    return (sqrt(1 + alpha * alpha * tan2) - 1) / 2;
}

// D V n.l without Fresnel's term, and the density of sampling visible normals.
static double evaluate(const struct lobe *b, const double l[3], double *density)
{
    *density = 0;
    if (l[2] <= 0)
        return 0;
    double h[3] = {b->v[0] + l[0], b->v[1] + l[1], b->v[2] + l[2]};
    normalize(h);
    const double a2 = b->alpha * b->alpha, sine2 = h[0] * h[0] + h[1] * h[1];
    const double t = sine2 + a2 * h[2] * h[2]; // 1 - (1 - a2) cos^2, without cancelling
    const double d = a2 / (HG_PI * t * t);
    const double lv = lambda(b->alpha, b->v[2]), ll = lambda(b->alpha, l[2]);
    *density = d / ((1 + lv) * 4 * b->v[2]);
    return d / ((1 + lv + ll) * 4 * b->v[2]);
}

// Heitz 2018, "Sampling the GGX Distribution of Visible Normals".
static void sample(const struct lobe *b, double u, double w, double l[3])
{
    double v[3] = {b->alpha * b->v[0], b->alpha * b->v[1], b->v[2]};
    normalize(v);
    const double flat = v[0] * v[0] + v[1] * v[1];
    const double t1[3] = {flat > 0 ? -v[1] / sqrt(flat) : 1, flat > 0 ? v[0] / sqrt(flat) : 0, 0};
    const double t2[3] = {
        v[1] * t1[2] - v[2] * t1[1], v[2] * t1[0] - v[0] * t1[2], v[0] * t1[1] - v[1] * t1[0]};
    const double r = sqrt(u), phi = 2 * HG_PI * w, x = r * cos(phi), s = (1 + v[2]) / 2;
    const double y = (1 - s) * sqrt(fmax(0, 1 - x * x)) + s * r * sin(phi);
    const double z = sqrt(fmax(0, 1 - x * x - y * y));
    double h[3];
    for (int i = 0; i < 3; i++)
        h[i] = t1[i] * x + t2[i] * y + v[i] * z;
    h[0] *= b->alpha;
    h[1] *= b->alpha;
    h[2] = fmax(h[2], 0);
    normalize(h);
    const double vh = hg_dot3d(b->v, h);
    for (int i = 0; i < 3; i++)
        l[i] = 2 * vh * h[i] - b->v[i];
}

static void grid_point(int i, double out[2])
{
    out[0] = (i / POINTS + 0.5) / POINTS;
    out[1] = (i % POINTS + 0.5) / POINTS;
}

static struct lobe make_lobe(double n_dot_v, double alpha)
{
    struct lobe b = {.alpha = alpha, .v = {-sqrt(fmax(0, 1 - n_dot_v * n_dot_v)), 0, n_dot_v}};
    for (int i = 0; i < POINTS * POINTS; i++) {
        double u[2], l[3], density;
        grid_point(i, u);
        sample(&b, u[0], u[1], l);
        const double f = evaluate(&b, l, &density);
        const double weight = density > 0 ? f / density / (POINTS * POINTS) : 0;
        b.albedo += weight;
        b.mean[0] += weight * l[0];
        b.mean[2] += weight * l[2];
    }
    normalize(b.mean);
    return b;
}

// --- linearly transformed cosines ----------------------------------------------------------------

// w = M o.
static void transform(const struct hg_ltc *t, const double o[3], double w[3])
{
    const double x = t->m11 * o[0] + t->m13 * o[2], z = o[2];
    const double cosine = sqrt(fmax(0, 1 - t->sine * t->sine));
    w[0] = cosine * x + t->sine * z;
    w[1] = t->m22 * o[1];
    w[2] = -t->sine * x + cosine * z;
}

// Density of a direction, per steradian.
static double lobe_density(const struct hg_ltc *t, const double l[3])
{
    const double cosine = sqrt(fmax(0, 1 - t->sine * t->sine));
    const double x = cosine * l[0] - t->sine * l[2], z = t->sine * l[0] + cosine * l[2];
    const double o[3] = {(x - t->m13 * z) / t->m11, l[1] / t->m22, z};
    const double square = hg_dot3d(o, o);
    return z > 0 ? z / (HG_PI * t->m11 * t->m22 * square * square) : 0;
}

static struct hg_ltc with(const struct hg_ltc *from, const double p[PARAMS], bool isotropic)
{
    struct hg_ltc t = *from;
    t.m11 = fmax(fabs(p[0]), 1e-5);
    t.m22 = isotropic ? t.m11 : fmax(fabs(p[1]), 1e-5);
    t.m13 = isotropic ? 0 : p[2];
    return t;
}

// Both are sampled, as what one of them misses is an error as well. Squares of differences: third
// powers (Heitz et al. 2016, section 4.1) left twice the error beside the highlights of middle
// roughness.
static double error_of(const struct lobe *b, const struct hg_ltc *t)
{
    double sum = 0;
    for (int i = 0; i < 2 * POINTS * POINTS; i++) {
        double u[2], l[3], density;
        grid_point(i % (POINTS * POINTS), u);
        if (i < POINTS * POINTS) {
            sample(b, u[0], u[1], l);
        } else {
            const double r = sqrt(u[0]), phi = 2 * HG_PI * u[1];
            const double o[3] = {r * cos(phi), r * sin(phi), sqrt(1 - u[0])};
            transform(t, o, l);
            normalize(l);
        }
        const double f = evaluate(b, l, &density) / b->albedo, g = lobe_density(t, l);
        const double d = fabs(f - g), both = density + g;
        sum += both > 0 ? d * d / both : 0;
    }
    return sum;
}

// --- search --------------------------------------------------------------------------------------

struct vertex {
    double p[PARAMS], error;
};

static struct vertex try_at(
    const struct lobe *b, const struct hg_ltc *base, const double p[PARAMS], bool isotropic)
{
    struct vertex v;
    memcpy(v.p, p, sizeof v.p);
    const struct hg_ltc t = with(base, p, isotropic);
    v.error = error_of(b, &t);
    return v;
}

static void sort(struct vertex s[PARAMS + 1])
{
    for (int i = 1; i <= PARAMS; i++)
        for (int k = i; k > 0 && s[k].error < s[k - 1].error; k--) {
            const struct vertex t = s[k];
            s[k] = s[k - 1];
            s[k - 1] = t;
        }
}

// Of the mean of all but the worst, by `by` times the way from the worst.
static void along(const struct vertex s[PARAMS + 1], double by, double out[PARAMS])
{
    for (int a = 0; a < PARAMS; a++) {
        double mean = 0;
        for (int i = 0; i < PARAMS; i++)
            mean += s[i].p[a] / PARAMS;
        out[a] = mean + by * (mean - s[PARAMS].p[a]);
    }
}

// Nelder and Mead 1965, "A Simplex Method for Function Minimization".
static struct hg_ltc search(const struct lobe *b, const struct hg_ltc *start, bool isotropic)
{
    const double from[PARAMS] = {start->m11, start->m22, start->m13};
    struct vertex s[PARAMS + 1] = {try_at(b, start, from, isotropic)};
    for (int i = 0; i < PARAMS; i++) {
        double p[PARAMS];
        memcpy(p, from, sizeof p);
        p[i] = i < 2 ? p[i] * 1.15 : p[i] + 0.1 * fmin(start->m11, 1);
        s[i + 1] = try_at(b, start, p, isotropic);
    }
    for (int step = 0; step < STEPS; step++) {
        double p[PARAMS];
        sort(s);
        along(s, 1, p);
        const struct vertex mirrored = try_at(b, start, p, isotropic);
        struct vertex next = mirrored;
        if (mirrored.error < s[0].error) {
            along(s, 2, p);
            next = try_at(b, start, p, isotropic);
            next = next.error < mirrored.error ? next : mirrored;
        } else if (mirrored.error >= s[PARAMS - 1].error) {
            along(s, -0.5, p);
            next = try_at(b, start, p, isotropic);
        }
        if (next.error < s[PARAMS].error) {
            s[PARAMS] = next;
            continue;
        }
        for (int i = 1; i <= PARAMS; i++) {
            for (int a = 0; a < PARAMS; a++)
                p[a] = 0.5 * (s[0].p[a] + s[i].p[a]);
            s[i] = try_at(b, start, p, isotropic);
        }
    }
    sort(s);
    return with(start, s[0].p, isotropic);
}

// The fit to GGX with height-correlated Smith masking, times the cosine of the light, at a cosine
// of the eye in (0, 1] and an alpha in (0, 1]; near: where to begin, m11 and m22 above 0.
static struct hg_ltc fit_lobe(double n_dot_v, double alpha, const struct hg_ltc *near)
{
    const struct lobe b = make_lobe(n_dot_v, alpha);
    struct hg_ltc start = *near;
    const bool isotropic = n_dot_v >= 1;
    start.sine = isotropic ? 0 : fmin(fmax(b.mean[0], 0), 1);
    return search(&b, &start, isotropic);
}

// --- table ---------------------------------------------------------------------------------------

// To the nearest half float; finite, |v| < 65504.
static uint32_t half_of(double v)
{
    const float value = (float)v;
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint32_t sign = bits >> 16 & 0x8000, magnitude = bits & 0x7fffffff;
    if (magnitude < 0x38800000) // below the least normal one
        return sign | (uint32_t)lrintf(fabsf(value) * 16777216.0f);
    return sign | ((magnitude - 0x38000000 + 0x0fff + (magnitude >> 13 & 1)) >> 13);
}

void hg_ltc_fill(uint32_t out[HG_LTC_WORDS])
{
    static struct hg_ltc table[HG_LTC_SIZE][HG_LTC_SIZE];
    const double last = HG_LTC_SIZE - 1;
    for (int row = HG_LTC_SIZE - 1; row >= 0; row--) {
        const double roughness = fmax(row / last, HG_LTC_LEAST_ROUGHNESS);
        for (int i = HG_LTC_SIZE - 1; i >= 0; i--) {
            struct hg_ltc near = {.m11 = 1, .m22 = 1};
            if (i < HG_LTC_SIZE - 1) {
                near = table[row][i + 1];
            } else if (row < HG_LTC_SIZE - 1) { // alpha is the square of roughness
                const double before = fmax((row + 1) / last, HG_LTC_LEAST_ROUGHNESS);
                const double ratio = roughness * roughness / (before * before);
                near = table[row + 1][i];
                near.m11 *= ratio;
                near.m22 *= ratio;
            }
            const double s = i / last;
            table[row][i] = fit_lobe(fmax(s * s, 1e-3), roughness * roughness, &near);
        }
    }
    for (int i = 0; i < HG_LTC_SIZE * HG_LTC_SIZE; i++) {
        const int column = i % HG_LTC_SIZE, row = i / HG_LTC_SIZE;
        const struct hg_ltc *t = &table[row][column];
        const struct hg_ltc *leaning =
            column < HG_LTC_SIZE - 1 ? t : t - 1; // along the normal: as beside it
        const double s = (double)(leaning - table[row]) / last,
                     sine = sqrt(1 - fmax(pow(s, 4), 1e-6));
        out[2 * i] = half_of(t->m11) | half_of(t->m22) << 16;
        out[2 * i + 1] = half_of(leaning->m13 / sine) | half_of(leaning->sine / sine) << 16;
    }
}
