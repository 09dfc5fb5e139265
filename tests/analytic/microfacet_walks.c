// microfacet_walks.c - light that rough metals reflect once or more, against walks from facet to
// facet.
//
// The walks are those of Heitz, Hanika, d'Eon and Dachsbacher 2016, "Multiple-Scattering Microfacet
// BSDFs with the Smith Model": a ray goes through a field of GGX facets at evenly distributed
// heights until it leaves. Nothing of it is shared with what it tests.
#include <math.h>

#include "tests/analytic/probe.h"

#define PI 3.14159265358979

enum { COLORS = 6, WALKS = 1 << 19, BOUNCES = 200 };

static const double f0s[COLORS] = {1, 0.9, 0.7, 0.5, 0.3, 0.15};

struct vec {
    double x, y, z;
};

static struct vec normalized(struct vec a)
{
    const double scale = 1 / sqrt(a.x * a.x + a.y * a.y + a.z * a.z);
    return (struct vec){a.x * scale, a.y * scale, a.z * scale};
}

// Smith's Lambda of GGX for rays that go up or down.
static double lambda(double cosine, double alpha)
{
    const double tan2 = (1 - cosine * cosine) / (cosine * cosine);
    return (-1 + copysign(sqrt(1 + alpha * alpha * tan2), cosine)) / 2;
}

// Takes a ray from its height, 0..1, to that of the facet it meets next; false: it leaves.
static bool next_facet(struct vec ray, double alpha, double *height)
{
    const double u = probe_random();
    if (ray.z > 0.9999999)
        return false;
    if (ray.z < -0.9999999) {
        *height *= u;
        return true;
    }
    const double l = lambda(ray.z, alpha);
    if (ray.z > 0 && u >= 1 - pow(*height, l))
        return false;
    *height = fmin(*height / pow(1 - u, 1 / l), 1);
    return true;
}

// A facet that the ray may meet, by its visible area: a spherical cap, stretched (Dupuy and Benyoub
// 2023), for rays that go up as well.
static struct vec visible_normal(struct vec to_viewer, double alpha)
{
    const struct vec w =
        normalized((struct vec){alpha * to_viewer.x, alpha * to_viewer.y, to_viewer.z});
    const double z = -w.z + (1 + w.z) * probe_random(), phi = 2 * PI * probe_random();
    const double sine = sqrt(fmax(0, 1 - z * z));
    return normalized(
        (struct vec){alpha * (sine * cos(phi) + w.x), alpha * (sine * sin(phi) + w.y), z + w.z});
}

// Weights of one walk from a direction of cosine-weighted light, for each f0.
static void walk(double alpha, double weights[COLORS])
{
    const double u = probe_random(), phi = 2 * PI * probe_random();
    struct vec ray = {-sqrt(1 - u) * cos(phi), -sqrt(1 - u) * sin(phi), -sqrt(u)};
    double height = 1;
    for (int i = 0; i < COLORS; i++)
        weights[i] = 1;
    for (int bounce = 0; bounce < BOUNCES && next_facet(ray, alpha, &height); bounce++) {
        const struct vec v = {-ray.x, -ray.y, -ray.z}, m = visible_normal(v, alpha);
        const double c = fmax(v.x * m.x + v.y * m.y + v.z * m.z, 0);
        ray = normalized((struct vec){2 * c * m.x - v.x, 2 * c * m.y - v.y, 2 * c * m.z - v.z});
        for (int i = 0; i < COLORS; i++)
            weights[i] *= f0s[i] + (1 - f0s[i]) * pow(1 - c, 5);
    }
}

// Albedo of a metal under even light from all sides, weighted with the cosine of the view: Gauss-
// Legendre over the square of the cosine.
static double albedo(struct probe *probe, float roughness, float f0)
{
    static const double x[4] = {0.06943184, 0.33000948, 0.66999052, 0.93056816};
    static const double w[4] = {0.17392742, 0.32607258, 0.32607258, 0.17392742};
    struct hg_vec4 in[8] = {{0, 0, 0, 0}}, out[4];
    for (int i = 0; i < 4; i++)
        in[2 * i] = (struct hg_vec4){roughness, 1, (float)sqrt(x[i]), f0};
    probe_run(probe, PROBE_ALBEDO, 4, in, out);
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += w[i] * (double)out[i].x;
    return sum;
}

static void test_metals(void **state)
{
    static const double roughnesses[4] = {0.4, 0.6, 0.8, 1};
    for (int k = 0; k < 4; k++) {
        const double roughness = roughnesses[k];
        double sums[COLORS] = {0};
        for (int i = 0; i < WALKS; i++) {
            double weights[COLORS];
            walk(roughness * roughness, weights);
            for (int c = 0; c < COLORS; c++)
                sums[c] += weights[c] / WALKS;
        }
        probe_near(sums[0], 1, 1e-4); // nothing is lost on the way
        for (int c = 0; c < COLORS; c++) {
            const double ratio = albedo(*state, (float)roughness, (float)f0s[c]) / sums[c];
            print_message("roughness %.1f f0 %.2f: walks %.4f, ratio %.4f\n", roughness, f0s[c],
                sums[c], ratio);
            probe_near(ratio, 1, 0.01);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_metals)};
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
