// brdf.c - each term of the BRDF against its closed form or a numerical integral, on the device.
#include <math.h>

#include "renderer/light/albedo/dfg.h"
#include "tests/analytic/probe.h"

#define PI 3.14159265358979

static void test_d_is_normalised(void **state)
{
    struct hg_vec4 in[2 * 16] = {{0, 0, 0, 0}}, out[16];
    for (int i = 0; i < 16; i++) // alpha of roughness 0.045 .. 1
        in[2 * i].x = powf(0.045f + (1 - 0.045f) * (float)i / 15, 2);
    probe_run(*state, PROBE_D_INTEGRAL, 16, in, out);
    for (int i = 0; i < 16; i++)
        probe_near(out[i].x, 1, 1e-3);
}

static void test_smith_weak_white_furnace(void **state)
{
    struct hg_vec4 in[2 * 64] = {{0, 0, 0, 0}}, out[64];
    for (int i = 0; i < 64; i++) {
        in[2 * i].x = powf(0.1f + 0.9f * (float)(i % 8) / 7, 2);
        in[2 * i].y = 0.05f + 0.95f * (float)(i / 8) / 7;
    }
    probe_run(*state, PROBE_WHITE_FURNACE, 64, in, out);
    for (int i = 0; i < 64; i++)
        probe_near(out[i].x, 1, 1e-3);
}

// At n.h = 1: D = 1 / (pi alpha^2). At n.l = n.v = 1: V = 1 / 4.
static void test_d_and_v_closed_forms(void **state)
{
    struct hg_vec4 in[6] = {{1, 0.25f, 0, 0}, {0, 0, 0, 0}, {1, 1, 0, 0}, {0, 0, 0, 0},
        {0.5f, 1, 0, 0}, {0, 0, 0, 0}},
                   out[3];
    probe_run(*state, PROBE_D_VALUE, 3, in, out);
    probe_near(out[0].x, 1 / (PI * 0.0625), 1e-4);
    probe_near(out[0].y, 0.25, 1e-6);
    probe_near(out[1].x, 1 / PI, 1e-6);
    probe_near(out[2].y, 0.5 / (0.5 + 0.5), 1e-6); // alpha 1: each root is 1, times n.v
}

static void test_fresnel_values(void **state)
{
    struct hg_vec4 in[8] = {{0.04f, 1, 0, 0}, {0, 0, 0, 0}, {0.04f, 0, 0, 0}, {0, 0, 0, 0},
        {0.04f, 0.5f, 0, 0}, {0, 0, 0, 0}, {0.9f, 0.25f, 0, 0}, {0, 0, 0, 0}},
                   out[4];
    probe_run(*state, PROBE_FRESNEL, 4, in, out);
    probe_near(out[0].x, 0.04, 1e-7);
    probe_near(out[1].x, 1, 1e-7);
    probe_near(out[2].x, 0.04 + 0.96 / 32, 1e-6);
    probe_near(out[3].x, 0.9 + 0.1 * pow(0.75, 5), 1e-6);
}

static void test_reciprocity(void **state)
{
    enum { COUNT = 2048 };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++) {
        in[2 * i] = (struct hg_vec4){(float)(i % 16) / 15, (float)(i / 16 % 3) / 2, 0, 0};
        double g = 1.22074408460575947536; // R4 sequence, Roberts 2018
        float *u = &in[2 * i + 1].x;
        for (int k = 0; k < 4; k++)
            u[k] = (float)fmod(0.5 + (i + 1) * pow(1 / 1.16730397826141868, k + 1) * g, 1);
    }
    probe_run(*state, PROBE_RECIPROCITY, COUNT, in, out);
    for (int i = 0; i < COUNT; i++)
        probe_near(out[i].z, 0, 2e-3);
}

// What leaves under uniform light of 1, by importance sampling the BRDF itself: white surfaces of
// every roughness and metallic give everything back.
static void test_white_furnace_direct(void **state)
{
    enum { R = 9, V = 7, M = 3, COUNT = R * V * M };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++)
        in[2 * i] = (struct hg_vec4){0.1f + 0.9f * (float)(i % R) / (R - 1),
            (float)(i / (R * V)) / (M - 1), 0.1f + 0.9f * (float)(i / R % V) / (V - 1), 1};
    probe_run(*state, PROBE_ALBEDO, COUNT, in, out);
    double worst = 0;
    for (int i = 0; i < COUNT; i++) {
        worst = fmax(worst, fabs((double)out[i].x - 1));
        probe_near(out[i].x, 1, 0.01);
    }
    print_message("white furnace, direct: worst deviation %.4f\n", worst);
}

static void test_albedo_never_above_one(void **state)
{
    enum { R = 12, V = 12, COUNT = R * V * 2 };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++)
        in[2 * i] = (struct hg_vec4){0.05f + 0.95f * (float)(i % R) / (R - 1), (float)(i / (R * V)),
            0.02f + 0.98f * (float)(i / R % V) / (V - 1), 0.8f};
    probe_run(*state, PROBE_ALBEDO, COUNT, in, out);
    for (int i = 0; i < COUNT; i++)
        assert_true(out[i].x > 0 && out[i].x < 1.005f);
}

static void test_white_furnace_environment(void **state)
{
    enum { R = 17, V = 9, M = 3, COUNT = R * V * M };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    struct probe *probe = *state;
    struct hg_environment *env = &probe->scene->environment;
    env->kind = HG_ENV_COLOR;
    env->color[0] = env->color[1] = env->color[2] = 1;
    probe_sync(probe);
    for (int i = 0; i < COUNT; i++)
        in[2 * i] = (struct hg_vec4){(float)(i % R) / (R - 1), (float)(i / (R * V)) / (M - 1),
            0.05f + 0.95f * (float)(i / R % V) / (V - 1), 1};
    probe_run(probe, PROBE_ENVIRONMENT, COUNT, in, out);
    for (int i = 0; i < COUNT; i++)
        probe_near(out[i].x, 1, 1e-4);
}

static void test_dfg_table(void **state)
{
    enum { N = 24, COUNT = N * N };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++)
        in[2 * i] = (struct hg_vec4){powf(0.1f + 0.9f * ((float)(i % N) + 0.3f) / N, 2),
            0.1f + 0.9f * ((float)(i / N) + 0.6f) / N, 0, 0};
    probe_run(*state, PROBE_DFG, COUNT, in, out);
    for (int i = 0; i < COUNT; i++) {
        float ab[2], r = in[2 * i].y;
        hg_dfg_integrate(in[2 * i].x, r * r, 200, ab);
        probe_near(out[i].x, ab[0], 5e-3);
        probe_near(out[i].y, ab[1], 5e-3);
    }
}

// Known value: single-scattering albedo of a white GGX metal, cosine average, at alpha 1: 0.41 and
// at alpha 0.5: 0.70 (Kulla and Conty 2017).
static void test_dfg_average(void **state)
{
    struct hg_vec4 in[4] = {{1, 1, 0, 0}, {0, 0, 0, 0}, {1, 0.70710678f, 0, 0}, {0, 0, 0, 0}},
                   out[2];
    probe_run(*state, PROBE_DFG, 2, in, out);
    probe_near(out[0].z + out[0].w, 0.41, 0.01);
    probe_near(out[1].z + out[1].w, 0.70, 0.01);
}

// Pearson's test of sampled directions against the density, 16 x 8 cells of equal solid angle.
static void sampling_case(struct probe *probe, float roughness, float metallic, float n_dot_v)
{
    enum { X = 16, Z = 8, SAMPLES = 1 << 16, SUB = 24, FINE = X * Z * SUB * SUB };
    static struct hg_vec4 in[2 * FINE], out[FINE];
    static double expected[X * Z], seen[X * Z];
    const struct hg_vec4 material = {roughness, metallic, n_dot_v, 0};
    for (int i = 0; i < SAMPLES; i++) {
        in[2 * i] = material;
        in[2 * i + 1] =
            (struct hg_vec4){probe_random_float(), probe_random_float(), probe_random_float(), 0};
    }
    probe_run(probe, PROBE_SAMPLE, SAMPLES, in, out);
    for (int i = 0; i < X * Z; i++)
        seen[i] = expected[i] = 0;
    double outside = 0;
    for (int i = 0; i < SAMPLES; i++) {
        double phi = atan2((double)out[i].y, (double)out[i].x) / (2 * PI) + 0.5;
        int x = (int)(phi * X) % X, z = (int)((double)out[i].z * Z);
        if (out[i].z <= 0)
            outside++;
        else
            seen[(z < Z ? z : Z - 1) * X + x]++;
    }
    for (int i = 0; i < FINE; i++) {
        double phi = ((i % (X * SUB)) + 0.5) / (X * SUB) * 2 * PI - PI;
        double z = (i / (X * SUB) + 0.5) / (Z * SUB), s = sqrt(1 - z * z);
        in[2 * i] = material;
        in[2 * i + 1] = (struct hg_vec4){(float)(s * cos(phi)), (float)(s * sin(phi)), (float)z, 0};
    }
    probe_run(probe, PROBE_PDF, FINE, in, out);
    for (int i = 0; i < FINE; i++)
        expected[i / (X * SUB) / SUB * X + i % (X * SUB) / SUB] +=
            (double)out[i].x * 2 * PI / FINE * SAMPLES;
    double chi2 = 0, inside = 0;
    int cells = 0;
    for (int i = 0; i < X * Z; i++) {
        inside += expected[i];
        if (expected[i] < 20)
            continue;
        chi2 += (seen[i] - expected[i]) * (seen[i] - expected[i]) / expected[i];
        cells++;
    }
    probe_near(inside + outside, SAMPLES, SAMPLES * 0.005);
    // Mean = cells, deviation = sqrt(2 cells): five deviations.
    print_message("sampling r %.2f m %.0f n.v %.2f: chi^2 %.1f in %d cells\n", (double)roughness,
        (double)metallic, (double)n_dot_v, chi2, cells);
    assert_true(cells >= 8);
    assert_true(chi2 < cells + 5 * sqrt(2.0 * cells));
}

static void test_sampling_matches_density(void **state)
{
    struct probe *probe = *state;
    sampling_case(probe, 0.4f, 1, 0.9f);
    sampling_case(probe, 0.6f, 0, 0.5f);
    sampling_case(probe, 1.0f, 1, 0.2f);
    sampling_case(probe, 0.8f, 0, 1.0f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_d_is_normalised),
        cmocka_unit_test(test_smith_weak_white_furnace),
        cmocka_unit_test(test_d_and_v_closed_forms),
        cmocka_unit_test(test_fresnel_values),
        cmocka_unit_test(test_reciprocity),
        cmocka_unit_test(test_white_furnace_direct),
        cmocka_unit_test(test_albedo_never_above_one),
        cmocka_unit_test(test_white_furnace_environment),
        cmocka_unit_test(test_dfg_table),
        cmocka_unit_test(test_dfg_average),
        cmocka_unit_test(test_sampling_matches_density),
    };
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
