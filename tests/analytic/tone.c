// tone.c - tone curves against equations written out in double precision, and sRGB.
#include <math.h>

#include "tests/analytic/probe.h"

enum { ACES, AGX, PBR_NEUTRAL, LINEAR };

static void mul(const double m[3][3], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
}

static double saturate(double x)
{
    return fmin(fmax(x, 0), 1);
}

// Hill's fit: rows as published (BakingLab, ACES.hlsl); exposure 1 / 0.6.
static void aces(const double c[3], double out[3])
{
    static const double in[3][3] = {
        {0.59719, 0.35458, 0.04823}, {0.07600, 0.90834, 0.01566}, {0.02840, 0.13383, 0.83777}};
    static const double back[3][3] = {{1.60475, -0.53108, -0.07367}, {-0.10208, 1.10813, -0.00605},
        {-0.00327, -0.07276, 1.07602}};
    double e[3] = {c[0] / 0.6, c[1] / 0.6, c[2] / 0.6}, v[3];
    mul(in, e, v);
    for (int i = 0; i < 3; i++)
        v[i] = (v[i] * (v[i] + 0.0245786) - 0.000090537) /
               (v[i] * (0.983729 * v[i] + 0.4329510) + 0.238081);
    mul(back, v, out);
}

// Sobotka's inset and outset, Wrensch's polynomial; rows.
static void agx(const double c[3], double out[3])
{
    static const double in[3][3] = {{0.842479062253094, 0.0784335999999992, 0.0792237451477643},
        {0.0423282422610123, 0.878468636469772, 0.0791661274605434},
        {0.0423756549057051, 0.0784336, 0.879142973793104}};
    static const double back[3][3] = {{1.19687900512017, -0.0980208811401368, -0.0990297440797205},
        {-0.0528968517574562, 1.15190312990417, -0.0989611768448433},
        {-0.0529716355144438, -0.0980434501171241, 1.15107367264116}};
    double v[3];
    mul(in, c, v);
    for (int i = 0; i < 3; i++) {
        double x = saturate((log2(fmax(v[i], 1e-10)) + 12.47393) / (4.026069 + 12.47393));
        v[i] = ((((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x) -
               0.00232;
    }
    mul(back, v, out);
    for (int i = 0; i < 3; i++)
        out[i] = pow(saturate(out[i]), 2.2);
}

// Khronos PBR Neutral, from the text of its specification.
static void pbr_neutral(const double c[3], double out[3])
{
    const double f90 = 0.04, ks = 0.8 - f90, kd = 0.15;
    double x = fmin(c[0], fmin(c[1], c[2])), f = x <= 2 * f90 ? x - x * x / (4 * f90) : f90;
    double p = fmax(c[0], fmax(c[1], c[2])) - f;
    double pn = 1 - (1 - ks) * (1 - ks) / (p + 1 - 2 * ks);
    double g = 1 / (kd * (p - pn) + 1);
    for (int i = 0; i < 3; i++) {
        double v = c[i] - f;
        out[i] = p <= ks ? v : v * pn / p * g + pn * (1 - g);
    }
}

static void reference(int op, const double c[3], double out[3])
{
    if (op == ACES)
        aces(c, out);
    else if (op == AGX)
        agx(c, out);
    else if (op == PBR_NEUTRAL)
        pbr_neutral(c, out);
    else
        for (int i = 0; i < 3; i++)
            out[i] = c[i];
    for (int i = 0; i < 3; i++)
        out[i] = saturate(out[i]);
}

static void test_curves_follow_their_equations(void **state)
{
    enum { COUNT = 4 * 512 };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++) {
        int k = i % 512;
        float peak = exp2f((float)(k / 8) / 3 - 12); // 2^-12 .. 2^9
        const float mix[8][3] = {{1, 1, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0.5f, 0.2f},
            {0.1f, 0.9f, 1}, {0.8f, 0.8f, 0.1f}, {0.3f, 0.2f, 1}};
        in[2 * i] = (struct hg_vec4){
            mix[k % 8][0] * peak, mix[k % 8][1] * peak, mix[k % 8][2] * peak, (float)(i / 512)};
    }
    probe_run(*state, PROBE_TONEMAP, COUNT, in, out);
    for (int i = 0; i < COUNT; i++) {
        double c[3] = {(double)in[2 * i].x, (double)in[2 * i].y, (double)in[2 * i].z}, e[3];
        reference(i / 512, c, e);
        // A quarter of an 8-bit step after encoding, at most.
        probe_near(out[i].x, e[0], 2e-4);
        probe_near(out[i].y, e[1], 2e-4);
        probe_near(out[i].z, e[2], 2e-4);
    }
}

static void test_known_values(void **state)
{
    struct hg_vec4 in[12] = {{0, 0, 0, 0}}, out[6];
    in[0] = (struct hg_vec4){0, 0, 0, ACES};
    in[2] = (struct hg_vec4){0.18f, 0.18f, 0.18f, AGX};
    in[4] = (struct hg_vec4){0.5f, 0.5f, 0.5f, PBR_NEUTRAL}; // 0.5 - 0.04, below compression
    in[6] = (struct hg_vec4){2, 0.25f, -1, LINEAR};
    in[8] = (struct hg_vec4){65504, 65504, 65504, ACES};
    in[10] = (struct hg_vec4){65504, 65504, 65504, PBR_NEUTRAL};
    probe_run(*state, PROBE_TONEMAP, 6, in, out);
    probe_near(out[0].x, 0, 1e-3);
    probe_near(pow((double)out[1].x, 1 / 2.2), 0.4967, 5e-3); // middle grey of AgX, by its authors
    probe_near(out[2].x, 0.46, 1e-5);
    probe_near(out[3].x, 1, 0);
    probe_near(out[3].y, 0.25, 0);
    probe_near(out[3].z, 0, 0);
    assert_true(out[4].x > 0.99f && out[4].x <= 1);
    assert_true(out[5].x > 0.99f && out[5].x <= 1);
}

static void test_curves_are_monotone(void **state)
{
    enum { STEPS = 1024, COUNT = 4 * STEPS };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++) {
        float v = exp2f((float)(i % STEPS) / 48 - 12);
        in[2 * i] = (struct hg_vec4){v, v, v, (float)(i / STEPS)};
    }
    probe_run(*state, PROBE_TONEMAP, COUNT, in, out);
    for (int i = 1; i < COUNT; i++)
        if (i % STEPS)
            assert_true(out[i].x >= out[i - 1].x - 1e-5f);
}

static void test_srgb(void **state)
{
    enum { COUNT = 1024 };
    static struct hg_vec4 in[2 * COUNT], out[COUNT];
    for (int i = 0; i < COUNT; i++)
        in[2 * i].x = (float)i / (COUNT - 1);
    probe_run(*state, PROBE_SRGB, COUNT, in, out);
    for (int i = 0; i < COUNT; i++) {
        double c = (double)in[2 * i].x;
        double e = c <= 0.0031308 ? 12.92 * c : 1.055 * pow(c, 1 / 2.4) - 0.055;
        probe_near(out[i].x, e, 2e-5); // a 16-bit step is 1.5e-5
        probe_near(out[i].y, c, 4e-5);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_curves_follow_their_equations),
        cmocka_unit_test(test_known_values),
        cmocka_unit_test(test_curves_are_monotone),
        cmocka_unit_test(test_srgb),
    };
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
