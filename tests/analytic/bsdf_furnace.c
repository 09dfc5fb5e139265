// bsdf_furnace.c - lib/bsdf.glsl on the device: white surfaces send back all light, whatever their
// lobes.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/analytic/bsdf_probe.h"

// White surfaces send back all light that comes from everywhere, within the noise of the test and
// what is left between entries of tables: less than 0.002, or 0.004 in the tables of five
// coordinates (anisotropic glass from inside, layers on what is anisotropic), where two layers or a
// medium outside act on what leaves glass, and where glass reflects otherwise than Fresnel's
// equations say.
static double left_over(const struct bsdf_material *m, bool front)
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

static int looked_twice; // with all samples after some

static struct furnace furnace_with(
    struct probe *probe, const struct bsdf_material *m, bool front, uint32_t samples)
{
    enum { V = 6, P = 3 };
    struct hg_vec4 in[V * P], out[V * P][2];
    struct furnace f = {.least = 2};
    const bool outside = front || m->thickness <= 0;
    // Only anisotropic lobes depend on the azimuth: others see each cosine from one.
    const bool isotropic = m->anisotropy <= 0;
    const int directions = isotropic ? V : V * P;
    for (int i = 0; i < directions; i++) {
        in[i] = bsdf_direction((outside ? 1 : -1) * (0.1f + 0.89f * (float)(i % V) / (V - 1)),
            (float)(isotropic ? i : i / V) * 0.83f, outside);
    }
    bsdf_albedo(probe, m, samples, (uint32_t)directions, in, out);
    for (int i = 0; i < directions; i++)
        for (int k = 0; k < 3; k++) {
            f.least = fmin(f.least, (double)(&out[i][0].x)[k]);
            f.most = fmax(f.most, (double)(&out[i][0].x)[k]);
            f.noise = fmax(f.noise, (double)(&out[i][1].x)[k]);
        }
    return f;
}

// A quarter of the samples decides where it is clear: their noise is at most three times that of
// all of them (the standard deviation of sums of points of low discrepancy falls faster than with
// the root of their number, and slower than with their number), so that a surface which is within
// one deviation then is within three of all samples. All others are seen with all samples.
static struct furnace furnace_of(struct probe *probe, const struct bsdf_material *m, bool front)
{
    enum { ALL = BSDF_SAMPLES, FEW = ALL / 4 };
    struct furnace f = furnace_with(probe, m, front, FEW);
    f.off = fmax(1 - f.least, f.most - 1) > left_over(m, front) + f.noise || f.noise > 0.003;
    if (!f.off)
        return f;
    f = furnace_with(probe, m, front, ALL);
    // A test that is all noise shows nothing.
    f.off = fmax(1 - f.least, f.most - 1) > left_over(m, front) + 3 * f.noise || f.noise > 0.003;
    looked_twice++;
    return f;
}

static int furnaces_off; // of all, so that a failure shows every one that is off

static void furnace_from(struct probe *probe, const char *name, struct bsdf_material m, bool front)
{
    // Beside round values some that lie anywhere between entries of the tables.
    static const float roughness[] = {0, 0.1f, 0.17f, 0.45f, 0.6f, 0.93f, 1};
    double least = 2, most = 0;
    for (int i = 0; i < 7; i++) {
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

static void furnace(struct probe *probe, const char *name, struct bsdf_material m)
{
    furnace_from(probe, name, m, true);
    if (m.thickness > 0 && bsdf_goes_through(&m))
        furnace_from(probe, name, m, false);
}

static void furnaces_of_layers(struct probe *probe)
{
    struct bsdf_material m = bsdf_white;
    m.clearcoat = 1;
    furnace(probe, "smooth clearcoat", m);
    m.clearcoat_roughness = 0.5f;
    furnace(probe, "rough clearcoat", m);
    m.metallic = 1;
    furnace(probe, "rough clearcoat on metal", m);
    m = bsdf_white;
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
    m = bsdf_white;
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
    struct bsdf_material m = bsdf_white;
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
    struct bsdf_material m = bsdf_white;
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
    struct bsdf_material m = bsdf_white;
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
    struct bsdf_material m = bsdf_white;
    furnace(*state, "dielectric", m);
    m.metallic = 1;
    furnace(*state, "metal", m);
    m.anisotropy = 0.45f;
    furnace(*state, "anisotropic metal", m);
    m.anisotropy = 1;
    furnace(*state, "most anisotropic metal", m);
    m = bsdf_white;
    m.ior = 2.2f;
    furnace(*state, "dielectric of index 2.2", m);
    m = bsdf_white;
    m.specular = 0.5f;
    furnace(*state, "specular", m);
    m = bsdf_white;
    m.diffuse_transmission = 0.5f;
    furnace(*state, "diffuse transmission", m);
    m = bsdf_white;
    m.transmission = 1;
    furnace(*state, "thin glass", m);
    furnaces_of_layers(*state);
    furnaces_of_layered_anisotropy(*state);
    furnaces_of_films(*state);
    furnaces_of_glass(*state);
    print_message("with all samples: %d\n", looked_twice);
    assert_int_equal(furnaces_off, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_white_furnace)};
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
