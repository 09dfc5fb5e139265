// bsdf.c - lib/bsdf.glsl on the device: every lobe against closed forms and numerical integrals.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/albedo/dfg.h"
#include "tests/analytic/probe.h"

#define PI 3.14159265358979

enum op { SAMPLE, EVALUATE, ALBEDO, INTEGRALS, RECIPROCITY, TERMS, DISPERSION }; // of bsdf.comp

struct material { // as bsdf.comp reads it
    float base[3], metallic;
    float roughness, ior, specular, transmission;
    float specular_color[3], thickness;
    float clearcoat, clearcoat_roughness, anisotropy, diffuse_transmission;
    float sheen[3], sheen_roughness;
    float iridescence, film_ior, film_nm, dispersion;
    float behind[3], ior_outside;
    float coat_tilt, tangent_angle, unused[2];
};
#define HEAD (sizeof(struct material) / sizeof(struct hg_vec4))

static const struct material white = {.base = {1, 1, 1},
    .roughness = 0.5f,
    .ior = 1.5f,
    .specular = 1,
    .specular_color = {1, 1, 1},
    .film_ior = 1.3f,
    .behind = {1, 1, 1},
    .ior_outside = 1};

// pairs: [count][2] inputs; out: [count][2].
static void run(struct probe *probe, enum op op, const struct material *m, uint32_t count,
    const struct hg_vec4 *pairs, struct hg_vec4 *out)
{
    struct hg_vec4 *in = hg_calloc(HEAD + 2 * count, sizeof *in);
    assert_non_null(in);
    memcpy(in, m, sizeof *m);
    memcpy(in + HEAD, pairs, 2 * count * sizeof *pairs);
    probe_run_shader(probe, "bsdf.comp", op, count, in, (uint32_t)HEAD + 2 * count, out, 2 * count);
    hg_free(in);
}

enum { PARTS = 50, SHIFTED = 5, SHIFTS = PARTS / SHIFTED }; // of bsdf.comp

// Of SHIFTS sums of samples: deviation of their mean.
static float noise_of(const struct hg_vec4 *sums, int channel)
{
    double sum = 0, squares = 0;
    for (int i = 0; i < SHIFTS; i++) {
        double one = 0;
        for (int k = 0; k < SHIFTED; k++)
            one += (double)(&sums[2 * (i * SHIFTED + k)].x)[channel] * SHIFTS;
        sum += one / SHIFTS;
        squares += one * one / SHIFTS;
    }
    return (float)sqrt(fmax(squares - sum * sum, 0) / (SHIFTS - 1));
}

// The first of the two results of ALBEDO and INTEGRALS, sums in parts of bsdf.comp, and its noise:
// one standard deviation.
static void add_up(struct probe *probe, enum op op, const struct material *m, uint32_t count,
    const struct hg_vec4 *pairs, struct hg_vec4 *out)
{
    struct hg_vec4 *in = hg_calloc((size_t)2 * PARTS * count, 2 * sizeof *in);
    assert_non_null(in);
    struct hg_vec4 *sums = in + (size_t)2 * PARTS * count;
    for (uint32_t i = 0; i < PARTS * count; i++) {
        in[2 * i] = pairs[i / PARTS * 2];
        in[2 * i + 1].x = (float)(i % PARTS);
    }
    run(probe, op, m, PARTS * count, in, sums);
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_vec4 *parts = &sums[2 * i * PARTS];
        float *sum = &out[2 * i].x, *noise = &out[2 * i + 1].x;
        for (int c = 0; c < 4; c++) {
            double all = 0;
            for (uint32_t k = 0; k < PARTS; k++)
                all += (double)(&parts[2 * k].x)[c];
            sum[c] = (float)all;
            noise[c] = noise_of(parts, c);
        }
    }
    hg_free(in);
}

// A direction at this cosine (below 0: from behind) and azimuth; w: whether it sees the front.
static struct hg_vec4 tilted(float cosine, float phi, bool front)
{
    const float s = sqrtf(fmaxf(0, 1 - cosine * cosine));
    return (struct hg_vec4){s * cosf(phi), s * sinf(phi), cosine, front ? 1 : 0};
}

// --- materials -----------------------------------------------------------------------------------

struct named {
    const char *name;
    struct material m;
};

static struct named list[40];
static int count;

static struct material *add(const char *name, float roughness)
{
    list[count].name = name;
    list[count].m = white;
    list[count].m.roughness = roughness;
    return &list[count++].m;
}

// One of each lobe and some of everything together.
static void fill(void)
{
    struct material *m;
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

static bool goes_through(const struct material *m)
{
    return m->transmission > 0 || m->diffuse_transmission > 0;
}

// --- sampling ------------------------------------------------------------------------------------

// Pearson's test of sampled directions against the density, cells of equal solid angle on the
// sphere.
static void sampling_case(struct probe *probe, const struct named *n, struct hg_vec4 v)
{
    enum { X = 12, Z = 12, SAMPLES = 1 << 16, SUB = 22, FINE = X * Z * SUB * SUB };
    static struct hg_vec4 in[2 * FINE], out[2 * FINE];
    static double expected[X * Z], seen[X * Z];
    for (int i = 0; i < SAMPLES; i++) {
        in[2 * i] = v;
        in[2 * i + 1] =
            (struct hg_vec4){probe_random_float(), probe_random_float(), probe_random_float(), 0};
    }
    static_assert(SAMPLES <= FINE, "room for both");
    double outside = 0;
    memset(seen, 0, sizeof seen);
    memset(expected, 0, sizeof expected);
    run(probe, SAMPLE, &n->m, SAMPLES, in, out);
    for (int i = 0; i < SAMPLES; i++) {
        const struct hg_vec4 d = out[2 * i];
        double phi = atan2((double)d.y, (double)d.x) / (2 * PI) + 0.5;
        int x = (int)(phi * X) % X, z = (int)((double)(d.z + 1) / 2 * Z);
        if (!(d.w > 0))
            outside++;
        else
            seen[(z < Z ? z : Z - 1) * X + x]++;
    }
    for (int i = 0; i < FINE; i++) {
        double phi = ((i % (X * SUB)) + 0.5) / (X * SUB) * 2 * PI - PI;
        double z = (i / (X * SUB) + 0.5) / (Z * SUB) * 2 - 1, s = sqrt(1 - z * z);
        in[2 * i] = v;
        in[2 * i + 1] = (struct hg_vec4){(float)(s * cos(phi)), (float)(s * sin(phi)), (float)z, 0};
    }
    run(probe, EVALUATE, &n->m, FINE, in, out);
    for (int i = 0; i < FINE; i++)
        expected[i / (X * SUB) / SUB * X + i % (X * SUB) / SUB] +=
            (double)out[2 * i].w * 4 * PI / FINE * SAMPLES;
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
        sampling_case(*state, &list[i], tilted(0.8f, 0.3f, true));
        sampling_case(*state, &list[i], tilted(0.35f, 2.0f, true));
        if (goes_through(&list[i].m))
            sampling_case(*state, &list[i], tilted(-0.7f, 1.0f, list[i].m.thickness <= 0));
    }
}

// --- integrals -----------------------------------------------------------------------------------

// What samples estimate is what a grid of directions adds up to.
static void test_lobes_against_integrals(void **state)
{
    for (int i = 0; i < count; i++) {
        enum { N = 4 };
        struct hg_vec4 in[2 * N] = {{0, 0, 0, 0}}, sampled[2 * N], grid[2 * N];
        struct material m = list[i].m;
        for (int k = 0; k < N; k++)
            in[2 * k] = tilted(0.25f + 0.24f * (float)k, 0.7f * (float)k, true);
        add_up(*state, ALBEDO, &m, N, in, sampled);
        add_up(*state, INTEGRALS, &m, N, in, grid);
        const float ratio = m.ior / m.ior_outside;
        const bool bent = m.transmission > 0 && m.thickness > 0;
        for (int k = 0; k < N; k++) {
            const float through = grid[2 * k].y * (bent ? ratio * ratio : 1);
            print_message("%-24s v.z %.2f: sampled %.4f, integrals %.4f + %.4f, density %.4f\n",
                list[i].name, (double)in[2 * k].z, (double)sampled[2 * k].x, (double)grid[2 * k].x,
                (double)through, (double)grid[2 * k].z);
            probe_near(sampled[2 * k].x, grid[2 * k].x + through, 0.01);
            probe_near(grid[2 * k].z + sampled[2 * k].w, 1, 0.01);
        }
    }
}

// --- energy --------------------------------------------------------------------------------------

// White surfaces send back all light that comes from everywhere, within the noise of the test and
// what is left between entries of tables: less than 0.002, or 0.004 in the tables of five
// coordinates (anisotropic glass from inside, layers on what is anisotropic), where two layers or a
// medium outside act on what leaves glass, and where glass reflects otherwise than Fresnel's
// equations say.
static double left_over(const struct material *m, bool front)
{
    const bool two = m->clearcoat > 0 && (m->sheen[0] > 0 || m->ior_outside > 1);
    if (m->anisotropy > 0 && (m->clearcoat > 0 || m->sheen[0] > 0))
        return 0.004;
    const bool other = m->transmission > 0 && (m->iridescence > 0 || m->specular < 1 || m->ior > 3);
    return other || (!front && (m->anisotropy > 0 || two)) ? 0.004 : 0.002;
}

// Of all directions and channels.
struct furnace {
    double least, most, noise; // noise: largest standard deviation
    bool off;                  // by more than what is left over and three deviations
};

static struct furnace furnace_of(struct probe *probe, const struct material *m, bool front)
{
    enum { V = 6, P = 3 };
    struct hg_vec4 in[2 * V * P] = {{0, 0, 0, 0}}, out[2 * V * P];
    struct furnace f = {.least = 2};
    const bool outside = front || m->thickness <= 0;
    for (int i = 0; i < V * P; i++)
        in[2 * i] = tilted((outside ? 1 : -1) * (0.1f + 0.89f * (float)(i % V) / (V - 1)),
            (float)(i / V) * 0.83f, outside);
    add_up(probe, ALBEDO, m, V * P, in, out);
    for (int i = 0; i < V * P; i++)
        for (int k = 0; k < 3; k++) {
            f.least = fmin(f.least, (double)(&out[2 * i].x)[k]);
            f.most = fmax(f.most, (double)(&out[2 * i].x)[k]);
            f.noise = fmax(f.noise, (double)(&out[2 * i + 1].x)[k]);
        }
    // A test that is all noise shows nothing.
    f.off = fmax(1 - f.least, f.most - 1) > left_over(m, front) + 3 * f.noise || f.noise > 0.003;
    return f;
}

static int furnaces_off; // of all, so that a failure shows every one that is off

static void furnace_from(struct probe *probe, const char *name, struct material m, bool front)
{
    // Beside round values some that lie anywhere between entries of the tables.
    static const float roughness[] = {0, 0.1f, 0.17f, 0.3f, 0.45f, 0.6f, 0.77f, 0.93f, 1};
    double least = 2, most = 0;
    for (int i = 0; i < 9; i++) {
        m.roughness = roughness[i];
        const struct furnace f = furnace_of(probe, &m, front);
        print_message("furnace %s%s, roughness %.2f: %.4f .. %.4f, noise %.4f%s\n", name,
            front ? "" : " from inside", (double)m.roughness, f.least, f.most, f.noise,
            f.off ? " OFF" : "");
        furnaces_off += f.off;
        least = fmin(least, f.least);
        most = fmax(most, f.most);
    }
    print_message(
        "furnace of all %s%s: %.4f .. %.4f\n", name, front ? "" : " from inside", least, most);
}

static void furnace(struct probe *probe, const char *name, struct material m)
{
    furnace_from(probe, name, m, true);
    if (m.thickness > 0 && goes_through(&m))
        furnace_from(probe, name, m, false);
}

static void furnaces_of_layers(struct probe *probe)
{
    struct material m = white;
    m.clearcoat = 1;
    furnace(probe, "smooth clearcoat", m);
    m.clearcoat_roughness = 0.5f;
    furnace(probe, "rough clearcoat", m);
    m.metallic = 1;
    furnace(probe, "rough clearcoat on metal", m);
    m = white;
    for (int i = 0; i < 3; i++)
        m.sheen[i] = 1;
    m.sheen_roughness = 0.5f;
    furnace(probe, "sheen", m);
    m.sheen_roughness = 0.2f;
    furnace(probe, "fine sheen", m);
    m.sheen_roughness = 0.8f;
    m.metallic = 1;
    furnace(probe, "sheen on metal", m);
    m.clearcoat = 1;
    m.clearcoat_roughness = 0.3f;
    furnace(probe, "clearcoat over sheen on metal", m);
    m.metallic = 0;
    furnace(probe, "clearcoat over sheen", m);
    m.clearcoat_roughness = 0.12f;
    m.sheen_roughness = 0.35f;
    m.metallic = 0.4f;
    furnace(probe, "smoother coat, finer sheen", m);
    m.clearcoat = 0.7f;
    m.clearcoat_roughness = 0.55f;
    m.sheen_roughness = 0.95f;
    m.metallic = 1;
    furnace(probe, "rougher coat and sheen", m);
    m.metallic = 0;
    m.transmission = m.thickness = 1;
    furnace(probe, "rougher coat and sheen on glass", m);
    m = white;
    m.clearcoat = m.transmission = 1;
    m.clearcoat_roughness = 0.3f;
    furnace(probe, "clearcoat on thin glass", m);
    m.thickness = 1;
    furnace(probe, "clearcoat on glass", m);
    m.ior = 1.31f;
    m.ior_outside = 1.5f;
    furnace_from(probe, "clearcoat on ice in glass", m, false);
    m.ior_outside = 1;
    m.clearcoat_roughness = 0;
    m.ior = 1.8f;
    furnace(probe, "smooth clearcoat on dense glass", m);
}

static void furnaces_of_layered_anisotropy(struct probe *probe)
{
    struct material m = white;
    m.metallic = 1;
    m.anisotropy = 0.64f;
    m.clearcoat = 1;
    m.clearcoat_roughness = 0.1f;
    furnace(probe, "clearcoat on anisotropic metal", m);
    m.anisotropy = 0.9f;
    m.clearcoat_roughness = 0.5f;
    furnace(probe, "rough clearcoat on more anisotropic metal", m);
    for (int i = 0; i < 3; i++)
        m.sheen[i] = 1;
    m.sheen_roughness = 0.35f;
    furnace(probe, "clearcoat over sheen on more anisotropic metal", m);
    m.clearcoat = 0;
    m.anisotropy = 0.4f;
    furnace(probe, "sheen on anisotropic metal", m);
    m.clearcoat = 1;
    m.sheen[0] = m.sheen[1] = m.sheen[2] = m.metallic = 0;
    furnace(probe, "clearcoat on anisotropic dielectric", m);
    m.clearcoat = 0;
    furnace(probe, "anisotropic dielectric", m);
}

static void furnaces_of_films(struct probe *probe)
{
    static const float film_nm[] = {250, 400, 550};
    struct material m = white;
    m.iridescence = 1;
    for (int i = 0; i < 3; i++) {
        m.film_nm = film_nm[i];
        m.film_ior = 1.3f;
        furnace(probe, "film", m);
        m.film_ior = 1.8f;
        furnace(probe, "dense film", m);
    }
    m.film_ior = 1.3f;
    m.film_nm = 400;
    m.metallic = 1;
    furnace(probe, "film on metal", m);
    m.metallic = 0.5f;
    furnace(probe, "film on half metal", m);
    m.metallic = 0;
    m.transmission = m.thickness = 1;
    furnace(probe, "film on glass", m);
    m.transmission = 0.5f;
    furnace(probe, "film on half glass", m);
    m.transmission = 1;
    m.metallic = 0.5f;
    furnace(probe, "film on glass that is half metal", m);
    m.metallic = 0;
    m.clearcoat = 1;
    m.clearcoat_roughness = 0.3f;
    furnace(probe, "clearcoat on a film on glass", m);
    m.clearcoat = 0;
    m.film_ior = 1.8f;
    m.film_nm = 250;
    m.ior = 1.2f;
    furnace(probe, "dense film on light glass", m);
}

static void furnaces_of_glass(struct probe *probe)
{
    static const float ior[] = {1.07f, 1.21f, 1.5f, 1.83f, 2.4f};
    struct material m = white;
    m.transmission = m.thickness = 1;
    for (int i = 0; i < 5; i++) {
        char name[32];
        m.ior = ior[i];
        snprintf(name, sizeof name, "glass of index %.2f", (double)m.ior);
        furnace(probe, name, m);
    }
    m.ior = 1.5f;
    m.anisotropy = 0.55f;
    furnace(probe, "anisotropic glass", m);
    m.ior = 1.2f;
    furnace(probe, "anisotropic glass of index 1.2", m);
    m.ior = 2;
    m.anisotropy = 0.87f;
    furnace(probe, "more anisotropic glass of index 2", m);
    m.ior = 1.5f;
    m.anisotropy = 0.55f;
    m.clearcoat = 1;
    m.clearcoat_roughness = 0.3f;
    furnace_from(probe, "clearcoat on anisotropic glass", m, true);
    m.clearcoat = m.anisotropy = 0;
    m.transmission = 0.5f;
    furnace(probe, "half glass", m);
    m.specular = 0.5f;
    furnace(probe, "half glass that reflects half", m);
    m.transmission = 1;
    furnace(probe, "glass that reflects half", m);
    m.specular = 0;
    m.ior = 1.2f;
    furnace(probe, "glass that reflects nothing", m);
    m.specular = 1;
    m.ior = 10000; // glTF's index 0
    furnace(probe, "glass of index 0", m);
}

static void test_white_furnace(void **state)
{
    struct material m = white;
    furnace(*state, "dielectric", m);
    m.metallic = 1;
    furnace(*state, "metal", m);
    m.anisotropy = 0.45f;
    furnace(*state, "anisotropic metal", m);
    m.anisotropy = 1;
    furnace(*state, "most anisotropic metal", m);
    m = white;
    m.ior = 2.2f;
    furnace(*state, "dielectric of index 2.2", m);
    m = white;
    m.specular = 0.5f;
    furnace(*state, "specular", m);
    m = white;
    m.diffuse_transmission = 0.5f;
    furnace(*state, "diffuse transmission", m);
    m = white;
    m.transmission = 1;
    furnace(*state, "thin glass", m);
    furnaces_of_layers(*state);
    furnaces_of_layered_anisotropy(*state);
    furnaces_of_films(*state);
    furnaces_of_glass(*state);
    assert_int_equal(furnaces_off, 0);
}

// No lobe takes light away, in any channel, on any side.
static void test_never_negative(void **state)
{
    enum { N = 256 };
    static struct hg_vec4 in[2 * N], out[2 * N];
    for (int i = 0; i < count; i++)
        for (int side = 0; side < (goes_through(&list[i].m) ? 2 : 1); side++) {
            for (int k = 0; k < N; k++) {
                const float a = 0.02f + 0.97f * probe_random_float();
                const bool front = side == 0 || list[i].m.thickness <= 0;
                in[2 * k] = tilted(front ? a : -a, probe_random_float() * 6.2832f, front);
                in[2 * k + 1] =
                    tilted(2 * probe_random_float() - 1, probe_random_float() * 6.2832f, true);
            }
            run(*state, EVALUATE, &list[i].m, N, in, out);
            for (int k = 0; k < N; k++)
                for (int c = 0; c < 4; c++) {
                    const float f = (&out[2 * k].x)[c];
                    if (!(f >= 0) || !isfinite(f))
                        fail_msg("%s, side %d: channel %d is %g", list[i].name, side, c, (double)f);
                }
        }
}

// --- reciprocity ---------------------------------------------------------------------------------

static void test_reciprocity(void **state)
{
    enum { N = 512 };
    static struct hg_vec4 in[2 * N], out[2 * N];
    for (int i = 0; i < count; i++) {
        const bool through = goes_through(&list[i].m);
        if (list[i].m.coat_tilt > 0)
            continue; // lobes about another normal than that of the irradiance are not
        for (int k = 0; k < N; k++) {
            const float a = 0.05f + 0.94f * probe_random_float(),
                        c = 0.05f + 0.94f * probe_random_float();
            in[2 * k] = tilted(a, probe_random_float() * 6.2832f, true);
            in[2 * k + 1] = tilted(through && k % 2 ? -c : c, probe_random_float() * 6.2832f, true);
        }
        run(*state, RECIPROCITY, &list[i].m, N, in, out);
        double worst = 0;
        int lit = 0;
        for (int k = 0; k < N; k++) {
            lit += out[2 * k].x > 1e-4f;
            if (out[2 * k].x > 1e-4f)
                worst = fmax(worst, (double)out[2 * k].z);
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
    run(*state, TERMS, &white, N, in, out);
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
    run(*state, TERMS, &white, N, in, out);
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
    run(*state, TERMS, &white, N, in, out);
    for (int i = 0; i < N; i++)
        probe_near(out[2 * i + 1].y, exp(-2.5 * 0.1 * i), 1e-5);
}

// A smooth slab sends back what Fresnel says at its face, and lets the rest through without loss.
static void test_smooth_glass(void **state)
{
    enum { N = 4096 };
    static struct hg_vec4 in[2 * N], out[2 * N];
    struct material m = white;
    m.transmission = m.thickness = 1;
    m.roughness = 0;
    for (int side = 0; side < 2; side++) {
        for (int a = 1; a < 8; a++) {
            const float c = (float)a / 8 + 0.1f;
            const double eta = side ? 1 / 1.5 : 1.5, f = fresnel((double)c, eta);
            double back = 0, through = 0;
            for (int i = 0; i < N; i++) {
                in[2 * i] = tilted(side ? -c : c, 0, side == 0);
                in[2 * i + 1] = (struct hg_vec4){0.5f, 0.5f, ((float)i + 0.5f) / N, 0};
            }
            run(*state, SAMPLE, &m, N, in, out);
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
    run(*state, DISPERSION, &white, N, in, out);
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
        cmocka_unit_test(test_white_furnace),
        cmocka_unit_test(test_lobes_against_integrals),
        cmocka_unit_test(test_never_negative),
        cmocka_unit_test(test_reciprocity),
        cmocka_unit_test(test_sampling_matches_density),
    };
    fill();
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
