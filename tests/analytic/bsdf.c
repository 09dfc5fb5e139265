// bsdf.c - lib/bsdf.glsl on the device: every lobe against closed forms and numerical integrals.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/light/albedo/dfg.h"
#include "tests/analytic/bsdf_probe.h"

#define PI 3.14159265358979

// --- materials -----------------------------------------------------------------------------------

struct named {
    const char *name;
    struct bsdf_material m;
};

static struct named list[40];
static int count;

static struct bsdf_material *add(const char *name, float roughness)
{
    list[count].name = name;
    list[count].m = bsdf_white;
    list[count].m.roughness = roughness;
    return &list[count++].m;
}

// One of each lobe and some of everything together.
static void fill(void)
{
    struct bsdf_material *m;
    count = 0;
    add("dielectric", 0.5f);
    m = add("metal", 0.4f);
    m->metallic = 1;
    m = add("half metal", 0.6f);
    m->metallic = 0.5f;
    m = add("specular colour", 0.5f);
    m->specular = 0.6f;
    memcpy(m->specular_color, (float[3]){0.9f, 0.5f, 0.2f}, 12);
    m = add("high ior", 0.5f);
    m->ior = 2.2f;
    m = add("clearcoat", 0.6f);
    m->clearcoat = 1;
    m->clearcoat_roughness = 0.3f;
    m = add("clearcoat on metal", 0.5f);
    m->clearcoat = 0.8f;
    m->clearcoat_roughness = 0.4f;
    m->metallic = 1;
    m = add("tilted clearcoat", 0.6f);
    m->clearcoat = 1;
    m->clearcoat_roughness = 0.35f;
    m->coat_tilt = 0.3f;
    m = add("sheen", 0.8f);
    memcpy(m->sheen, (float[3]){1, 1, 1}, 12);
    m->sheen_roughness = 0.5f;
    m = add("fine sheen", 0.8f);
    memcpy(m->sheen, (float[3]){0.8f, 0.8f, 0.8f}, 12);
    m->sheen_roughness = 0.25f;
    m = add("anisotropic metal", 0.4f);
    m->metallic = 1;
    m->anisotropy = 0.6f;
    m->tangent_angle = 0.5f;
    m = add("anisotropic dielectric", 0.5f);
    m->anisotropy = 0.5f;
    m = add("iridescent metal", 0.4f);
    m->metallic = 1;
    m->iridescence = 1;
    m->film_nm = 400;
    m = add("iridescent dielectric", 0.4f);
    m->iridescence = 1;
    m->film_nm = 500;
    m = add("thin glass", 0.5f);
    m->transmission = 1;
    m = add("half thin glass", 0.4f);
    m->transmission = 0.5f;
    m = add("glass", 0.5f);
    m->transmission = 1;
    m->thickness = 1;
    m = add("rough glass", 0.7f);
    m->transmission = 1;
    m->thickness = 1;
    m = add("anisotropic glass", 0.4f);
    m->transmission = 1;
    m->thickness = 1;
    m->anisotropy = 0.5f;
    m = add("glass in water", 0.4f);
    m->transmission = 1;
    m->thickness = 1;
    m->ior_outside = 1.33f;
    m = add("iridescent glass", 0.4f);
    m->transmission = 1;
    m->thickness = 1;
    m->iridescence = 1;
    m->film_nm = 350;
    m = add("coloured glass", 0.6f);
    m->transmission = 1;
    m->thickness = 1;
    memcpy(m->specular_color, (float[3]){1, 0.2f, 0.2f}, 12);
    m = add("glass without reflections", 0.7f);
    m->transmission = 1;
    m->thickness = 1;
    m->ior = 1.2f;
    m->specular = 0;
    m = add("leaf", 0.5f);
    m->diffuse_transmission = 0.6f;
    m = add("wax", 0.5f);
    m->diffuse_transmission = 0.7f;
    m->thickness = 1;
    m = add("coated glass", 0.4f);
    m->transmission = 1;
    m->thickness = 1;
    m->clearcoat = 1;
    m->clearcoat_roughness = 0.3f;
    m = add("everything", 0.5f);
    m->metallic = 0.3f;
    m->transmission = 0.5f;
    m->clearcoat = 0.6f;
    m->clearcoat_roughness = 0.4f;
    m->sheen_roughness = 0.5f;
    memcpy(m->sheen, (float[3]){0.5f, 0.4f, 0.3f}, 12);
    m->anisotropy = 0.4f;
    m->iridescence = 0.7f;
    m->film_nm = 300;
    m->diffuse_transmission = 0.4f;
    m->specular = 0.8f;
}

// Where the indices are nearly the same lobes that go through are narrow: their grids are finer.
static bool is_narrow(const struct bsdf_material *m)
{
    return m->ior_outside > 1;
}

// --- sampling ------------------------------------------------------------------------------------

// Pearson's test of sampled directions against the density, cells of equal solid angle on the
// sphere.
static void sampling_case(struct probe *probe, const struct named *n, struct hg_vec4 v)
{
    enum { X = 12, Z = 12, SAMPLES = 1 << 16, MOST = 22, FINEST = X * Z * MOST * MOST };
    static struct hg_vec4 in[2 * FINEST], out[2 * FINEST];
    static double expected[X * Z], seen[X * Z];
    for (int i = 0; i < SAMPLES; i++) {
        in[2 * i] = v;
        in[2 * i + 1] =
            (struct hg_vec4){probe_random_float(), probe_random_float(), probe_random_float(), 0};
    }
    static_assert(SAMPLES <= FINEST, "room for both");
    const int sub = is_narrow(&n->m) ? MOST : 15, fine = X * Z * sub * sub;
    double outside = 0;
    memset(seen, 0, sizeof seen);
    memset(expected, 0, sizeof expected);
    bsdf_run(probe, BSDF_SAMPLE, &n->m, SAMPLES, in, out);
    for (int i = 0; i < SAMPLES; i++) {
        const struct hg_vec4 d = out[2 * i];
        double phi = atan2((double)d.y, (double)d.x) / (2 * PI) + 0.5;
        int x = (int)(phi * X) % X, z = (int)((double)(d.z + 1) / 2 * Z);
        if (!(d.w > 0))
            outside++;
        else
            seen[(z < Z ? z : Z - 1) * X + x]++;
    }
    for (int i = 0; i < fine; i++) {
        double phi = ((i % (X * sub)) + 0.5) / (X * sub) * 2 * PI - PI;
        double z = (i / (X * sub) + 0.5) / (Z * sub) * 2 - 1, s = sqrt(1 - z * z);
        in[2 * i] = v;
        in[2 * i + 1] = (struct hg_vec4){(float)(s * cos(phi)), (float)(s * sin(phi)), (float)z, 0};
    }
    bsdf_run(probe, BSDF_EVALUATE, &n->m, (uint32_t)fine, in, out);
    for (int i = 0; i < fine; i++)
        expected[i / (X * sub) / sub * X + i % (X * sub) / sub] +=
            (double)out[2 * i].w * 4 * PI / fine * SAMPLES;
    double chi2 = 0, inside = 0;
    int cells = 0;
    for (int i = 0; i < X * Z; i++) {
        inside += expected[i];
        if (expected[i] < 20) {
            assert_true(seen[i] < 20 + 6 * sqrt(20.0));
            continue;
        }
        chi2 += (seen[i] - expected[i]) * (seen[i] - expected[i]) / expected[i];
        cells++;
    }
    print_message("%-24s v.z %+.2f: chi^2 %6.1f in %3d cells, ended %.4f, density %.4f\n", n->name,
        (double)v.z, chi2, cells, outside / SAMPLES, inside / SAMPLES);
    // What ends is below the horizon, or behind a facet.
    probe_near(inside + outside, SAMPLES, SAMPLES * 0.008);
    assert_true(cells >= 8);
    assert_true(chi2 < cells + 5.5 * sqrt(2.0 * cells));
}

static void test_sampling_matches_density(void **state)
{
    for (int i = 0; i < count; i++) {
        sampling_case(*state, &list[i], bsdf_direction(0.8f, 0.3f, true));
        sampling_case(*state, &list[i], bsdf_direction(0.35f, 2.0f, true));
        if (bsdf_goes_through(&list[i].m))
            sampling_case(*state, &list[i], bsdf_direction(-0.7f, 1.0f, list[i].m.thickness <= 0));
    }
}

// --- integrals -----------------------------------------------------------------------------------

// Over a grid of directions, of the first channel: what is reflected, what goes through (without
// its n^2), density.
struct integrals {
    double back, through, density;
};

static struct integrals integrals_of(
    struct probe *probe, const struct bsdf_material *m, struct hg_vec4 v)
{
    enum { MOST = 180, ALL = 2 * MOST * MOST };
    static struct hg_vec4 in[2 * ALL], out[2 * ALL];
    const int n = is_narrow(m) ? MOST : 150, all = 2 * n * n;
    const double share = 2 * PI / (n * n);
    struct integrals sum = {0, 0, 0};
    for (int i = 0; i < all; i++) {
        in[2 * i] = v;
        in[2 * i + 1] = bsdf_direction(((float)(i / n) + 0.5f) / (float)n - 1,
            2 * (float)PI * ((float)(i % n) + 0.5f) / (float)n, true);
    }
    bsdf_run(probe, BSDF_EVALUATE, m, (uint32_t)all, in, out);
    for (int i = 0; i < all; i++) {
        const bool behind = in[2 * i + 1].z < 0;
        *(behind ? &sum.through : &sum.back) += (double)out[2 * i].x * share;
        sum.density += (double)out[2 * i].w * share;
    }
    return sum;
}

// What samples estimate is what a grid of directions adds up to.
static void test_lobes_against_integrals(void **state)
{
    for (int i = 0; i < count; i++) {
        enum { N = 4 };
        struct hg_vec4 v[N], sampled[N][2];
        const struct bsdf_material *m = &list[i].m;
        for (int k = 0; k < N; k++)
            v[k] = bsdf_direction(0.25f + 0.24f * (float)k, 0.7f * (float)k, true);
        bsdf_albedo(*state, m, BSDF_SAMPLES, N, v, sampled);
        const double ratio = (double)(m->ior / m->ior_outside);
        const bool bent = m->transmission > 0 && m->thickness > 0;
        for (int k = 0; k < N; k++) {
            struct integrals grid = integrals_of(*state, m, v[k]);
            grid.through *= bent ? ratio * ratio : 1;
            print_message("%-24s v.z %.2f: sampled %.4f, integrals %.4f + %.4f, density %.4f\n",
                list[i].name, (double)v[k].z, (double)sampled[k][0].x, grid.back, grid.through,
                grid.density);
            probe_near(sampled[k][0].x, grid.back + grid.through, 0.01);
            probe_near(grid.density + (double)sampled[k][0].w, 1, 0.01);
        }
    }
}

// No lobe takes light away, in any channel, on any side.
static void test_never_negative(void **state)
{
    enum { N = 256 };
    static struct hg_vec4 in[2 * N], out[2 * N];
    for (int i = 0; i < count; i++)
        for (int side = 0; side < (bsdf_goes_through(&list[i].m) ? 2 : 1); side++) {
            for (int k = 0; k < N; k++) {
                const float a = 0.02f + 0.97f * probe_random_float();
                const bool front = side == 0 || list[i].m.thickness <= 0;
                in[2 * k] = bsdf_direction(front ? a : -a, probe_random_float() * 6.2832f, front);
                in[2 * k + 1] = bsdf_direction(
                    2 * probe_random_float() - 1, probe_random_float() * 6.2832f, true);
            }
            bsdf_run(*state, BSDF_EVALUATE, &list[i].m, N, in, out);
            for (int k = 0; k < N; k++)
                for (int c = 0; c < 4; c++) {
                    const float f = (&out[2 * k].x)[c];
                    if (!(f >= 0) || !isfinite(f))
                        fail_msg("%s, side %d: channel %d is %g", list[i].name, side, c, (double)f);
                }
        }
}

// --- reciprocity ---------------------------------------------------------------------------------

// Light that goes through a face of another index is n^2 times as much from there.
static float squeezed(const struct bsdf_material *m, struct hg_vec4 v, struct hg_vec4 l)
{
    const float ratio = m->ior / m->ior_outside;
    return v.z * l.z < 0 && m->thickness > 0 && m->transmission > 0 ? ratio * ratio : 1;
}

static void test_reciprocity(void **state)
{
    enum { N = 512 };
    static struct hg_vec4 in[2 * N], there[2 * N], back[2 * N];
    for (int i = 0; i < count; i++) {
        const bool through = bsdf_goes_through(&list[i].m);
        if (list[i].m.coat_tilt > 0)
            continue; // lobes about another normal than that of the irradiance are not
        for (int k = 0; k < N; k++) {
            const float a = 0.05f + 0.94f * probe_random_float(),
                        c = 0.05f + 0.94f * probe_random_float();
            in[2 * k] = bsdf_direction(a, probe_random_float() * 6.2832f, true);
            in[2 * k + 1] =
                bsdf_direction(through && k % 2 ? -c : c, probe_random_float() * 6.2832f, true);
        }
        bsdf_run(*state, BSDF_EVALUATE, &list[i].m, N, in, there);
        for (int k = 0; k < N; k++) {
            const struct hg_vec4 v = in[2 * k];
            in[2 * k] = in[2 * k + 1];
            in[2 * k].w = in[2 * k].z > 0; // the face that it sees
            in[2 * k + 1] = v;
        }
        bsdf_run(*state, BSDF_EVALUATE, &list[i].m, N, in, back);
        double worst = 0;
        int lit = 0;
        for (int k = 0; k < N; k++) {
            const struct hg_vec4 l = in[2 * k], v = in[2 * k + 1];
            const float square = squeezed(&list[i].m, v, l);
            const bool seen = there[2 * k].x * square / fabsf(l.z) > 1e-4f;
            lit += seen;
            for (int c = 0; c < 3 && seen; c++) {
                const double f = (double)((&there[2 * k].x)[c] * square / fabsf(l.z)),
                             g = (double)((&back[2 * k].x)[c] / fabsf(v.z));
                worst = fmax(worst, fabs(f - g) / fmax(fmax(f, g), 1e-6));
            }
        }
        print_message("reciprocity %-24s worst %.5f of %d\n", list[i].name, worst, lit);
        assert_true(lit > N / 4);
        assert_true(worst < 5e-3);
    }
}

// --- terms against closed forms ------------------------------------------------------------------

// Fresnel's equations in the form with angles.
static double fresnel(double cosine, double eta)
{
    const double s = sqrt(1 - cosine * cosine) / eta;
    if (s >= 1)
        return 1;
    const double i = acos(cosine), t = asin(s);
    if (i < 1e-6)
        return pow((eta - 1) / (eta + 1), 2);
    return 0.5 * (pow(sin(i - t) / sin(i + t), 2) + pow(tan(i - t) / tan(i + t), 2));
}

static void test_terms(void **state)
{
    enum { N = 48 };
    struct hg_vec4 in[2 * N], out[2 * N];
    for (int i = 0; i < N; i++) {
        in[2 * i] = (struct hg_vec4){0.02f + 0.98f * (float)i / (N - 1), 0, 0, 0};
        // film index, thickness or absorption, roughness or f0, relative index
        in[2 * i + 1] = (struct hg_vec4){1.5f, 0, 0.04f, i % 2 ? 1.5f : 1 / 1.5f};
    }
    bsdf_run(*state, BSDF_TERMS, &bsdf_white, N, in, out);
    for (int i = 0; i < N; i++) {
        const double c = (double)in[2 * i].x, w = pow(1 - c, 5);
        probe_near(out[2 * i].w, fresnel(c, (double)in[2 * i + 1].w), 2e-5);
        // A film without thickness is none, but for Schlick's term of its upper face. Luminance:
        // its white is that of equal energy.
        const struct hg_vec4 film = out[2 * i];
        const double y =
            0.2126 * (double)film.x + 0.7152 * (double)film.y + 0.0722 * (double)film.z;
        if (c > 0.85)
            probe_near(y, 0.04 + 0.96 * w, 4e-3);
        probe_near(out[2 * i + 1].y, 1, 1e-6);
    }
    for (int i = 0; i < N; i++)
        in[2 * i + 1] = (struct hg_vec4){1.5f, 2e5f, (float)(i % 8) / 7, 1.5f};
    bsdf_run(*state, BSDF_TERMS, &bsdf_white, N, in, out);
    for (int i = 0; i < N; i++) {
        const double c = (double)in[2 * i].x, cf = sqrt(1 - (1 - c * c) / 2.25);
        // So thick that colours are averaged: bounces between two mirrors of Schlick's reflectance.
        const double f0 = (double)in[2 * i + 1].z, root = sqrt(fmin(f0, 0.9999));
        const double n = (1 + root) / (1 - root), r = pow((n - 1.5) / (n + 1.5), 2);
        const double r12 = 0.04 + 0.96 * pow(1 - c, 5), r23 = r + (1 - r) * pow(1 - cf, 5);
        probe_near(out[2 * i].x, r12 + pow(1 - r12, 2) * r23 / (1 - fmin(r12 * r23, 0.9999)), 2e-3);
        // The sheen's table against its integral; coarse where single scattering gains energy.
        const float e = hg_sheen_integrate((float)c, in[2 * i + 1].z, 400);
        if (in[2 * i + 1].z > 0.25f && c > 0.03)
            probe_near(out[2 * i + 1].x, e, 0.012);
    }
    for (int i = 0; i < N; i++) // x metres of absorption y
        in[2 * i + 1] = (struct hg_vec4){0.1f * (float)i, 2.5f, 0.5f, 1.5f};
    bsdf_run(*state, BSDF_TERMS, &bsdf_white, N, in, out);
    for (int i = 0; i < N; i++)
        probe_near(out[2 * i + 1].y, exp(-2.5 * 0.1 * i), 1e-5);
}

// A smooth slab sends back what Fresnel says at its face, and lets the rest through without loss.
static void test_smooth_glass(void **state)
{
    enum { N = 4096 };
    static struct hg_vec4 in[2 * N], out[2 * N];
    struct bsdf_material m = bsdf_white;
    m.transmission = m.thickness = 1;
    m.roughness = 0;
    for (int side = 0; side < 2; side++) {
        for (int a = 1; a < 8; a++) {
            const float c = (float)a / 8 + 0.1f;
            const double eta = side ? 1 / 1.5 : 1.5, f = fresnel((double)c, eta);
            double back = 0, through = 0;
            for (int i = 0; i < N; i++) {
                in[2 * i] = bsdf_direction(side ? -c : c, 0, side == 0);
                in[2 * i + 1] = (struct hg_vec4){0.5f, 0.5f, ((float)i + 0.5f) / N, 0};
            }
            bsdf_run(*state, BSDF_SAMPLE, &m, N, in, out);
            for (int i = 0; i < N; i++) {
                const struct hg_vec4 d = out[2 * i], w = out[2 * i + 1];
                const bool goes = ((int)w.w & 4) != 0;
                assert_true(((int)w.w & 8) != 0 || w.w < 2);
                (goes ? (through += (double)w.x) : (back += (double)w.x));
                if (((int)w.w & 8) != 0) // Snell's law
                    probe_near(sqrt(fmax(0, 1 - (double)(d.z * d.z))),
                        sqrt(1 - (double)(c * c)) / (goes ? eta : 1), 1e-5);
            }
            probe_near(back / N, f, 0.004);
            probe_near(through / N, 1 - f, 0.004);
        }
    }
}

// Paths of one channel each: their mean is all of the light. Indices of KHR_materials_dispersion:
// the Abbe number (n_d - 1) / (n_F - n_C) is 20 / dispersion, red to blue.
static void test_dispersion(void **state)
{
    enum { N = 300 };
    static struct hg_vec4 in[2 * N], out[2 * N];
    double sum[3] = {0, 0, 0}, ior[3] = {0, 0, 0};
    for (int i = 0; i < N; i++)
        in[2 * i + 1] = (struct hg_vec4){1.5f, 4, ((float)i + 0.5f) / N, 0};
    bsdf_run(*state, BSDF_DISPERSION, &bsdf_white, N, in, out);
    for (int i = 0; i < N; i++) {
        const int channel = (int)out[2 * i + 1].y;
        sum[0] += (double)out[2 * i].x;
        sum[1] += (double)out[2 * i].y;
        sum[2] += (double)out[2 * i].z;
        ior[channel] = (double)out[2 * i + 1].x;
        probe_near(out[2 * i + 1].z, 1, 0);
        probe_near(out[2 * i + 1].w, 1, 0);
    }
    for (int k = 0; k < 3; k++)
        probe_near(sum[k] / N, 1, 1e-6);
    probe_near(ior[1], 1.5, 1e-6);
    probe_near((1.5 - 1) / (ior[2] - ior[0]), 20.0 / 4, 1e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_terms),
        cmocka_unit_test(test_smooth_glass),
        cmocka_unit_test(test_dispersion),
        cmocka_unit_test(test_lobes_against_integrals),
        cmocka_unit_test(test_never_negative),
        cmocka_unit_test(test_reciprocity),
        cmocka_unit_test(test_sampling_matches_density),
    };
    fill();
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
