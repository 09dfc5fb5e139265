// Light that rays shaded on the host get from lights with a size, a profile or an image: means of
// many points of the lights against closed forms and integrals.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/host_shading/direct.h"
#include "renderer/light/lights.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/light_table.h"

enum { POINTS = 20000, STEPS = 128, TEXELS = 32 };

struct lit {
    struct hg_scene *scene;
    struct hg_light *light;
    struct hg_light_set set;
    uint32_t *words;
    struct hg_lighting_sources sources;
};

static struct hg_object *add(struct hg_scene *scene, enum hg_object_kind kind, uint64_t id)
{
    struct hg_object *object;
    assert_int_equal(hg_scene_add(scene, kind, id, &object), HG_OK);
    return object;
}

// A light at (0, 3, 0) that shines down, x of its frame along x.
static void begin(struct lit *l, unsigned kind)
{
    *l = (struct lit){0};
    assert_int_equal(hg_scene_create(&l->scene), HG_OK);
    struct hg_node *node = (struct hg_node *)add(l->scene, HG_OBJECT_NODE, 1);
    l->light = (struct hg_light *)add(l->scene, HG_OBJECT_LIGHT, 2);
    node->light = l->light;
    node->translation[1] = 3;
    node->rotation[0] = -sqrtf(0.5f);
    node->rotation[3] = sqrtf(0.5f);
    l->light->kind = kind;
    l->light->intensity = 10;
    l->light->casts_shadow = false;
    l->light->outer_cone_rad = 1;
    l->light->inner_cone_rad = 0.99f;
}

static void collect(struct lit *l)
{
    const double origin[3] = {0};
    hg_scene_update(l->scene);
    assert_int_equal(hg_light_set_collect(&l->set, l->scene, origin), HG_OK);
    assert_int_equal(l->set.count, 1);
    l->words = hg_calloc((size_t)l->set.word_count + 1, sizeof *l->words);
    assert_non_null(l->words);
    hg_light_set_tables(&l->set, l->words);
    l->sources = (struct hg_lighting_sources){.lights = l->set.items,
        .casts = l->set.casts,
        .tables = l->words,
        .count = 1,
        .directional_count = l->set.directional_count};
}

static void end(struct lit *l)
{
    hg_light_set_finish(&l->set);
    hg_free(l->words);
    hg_scene_destroy(l->scene);
}

// Mean radiance of white points of the plane y = 0 around a place.
static void mean_at(const struct lit *l, double x, double z, double rgb[3])
{
    memset(rgb, 0, 3 * sizeof *rgb);
    for (uint32_t i = 0; i < POINTS;
         i++) { // a point of the light is chosen by where the receiver is
        const struct hg_host_receiver r = {
            .position = {(float)(x + (i % 141) * 1e-5), 0, (float)(z + i / 141 * 1e-5)},
            .normal = {0, 1, 0},
            .lift = 1e-3f,
            .xi = ((float)i + 0.5f) / POINTS};
        struct hg_host_direct direct;
        hg_host_direct_at(&l->sources, &r, &direct);
        for (int k = 0; k < HG_HOST_SHADOW_RAYS; k++)
            for (int c = 0; c < 3; c++)
                rgb[c] += (double)direct.light[k][c] / POINTS;
    }
}

static void check(const struct lit *l, const char *name, double x, double z, const double wanted[3])
{
    double got[3];
    mean_at(l, x, z, got);
    print_message("%s at %.1f %.1f: %.4f %.4f %.4f, expected %.4f %.4f %.4f\n", name, x, z, got[0],
        got[1], got[2], wanted[0], wanted[1], wanted[2]);
    for (int c = 0; c < 3; c++)
        assert_true(fabs(got[c] - wanted[c]) <= 0.02 * wanted[c] + 1e-6);
}

static void grey(double e, double rgb[3])
{
    rgb[0] = rgb[1] = rgb[2] = e / M_PI;
}

// A sphere is as bright as a point, a sun with a disc as one without.
static void test_spheres(void **state)
{
    (void)state;
    struct lit l;
    double rgb[3];
    begin(&l, HG_LIGHT_POINT);
    l.light->radius = 0.5f;
    collect(&l);
    for (int x = 0; x < 3; x++) {
        grey(10 * 3 / pow(9 + x * x, 1.5), rgb);
        check(&l, "sphere", x, 0, rgb);
    }
    end(&l);
    begin(&l, HG_LIGHT_DIRECTIONAL);
    l.light->angular_diameter_rad = 0.3f;
    collect(&l);
    grey(10, rgb);
    check(&l, "sun", 1, 1, rgb);
    end(&l);
}

// --- surfaces ------------------------------------------------------------------------------------

static const double colors[4][3] = {{1, 0.5, 0}, {0, 1, 0.25}, {0.5, 0, 1}, {1, 1, 1}};

// Quarters of an image, u to the right and v down.
static const double *color_of(double u, double v)
{
    return colors[(u >= 0.5) + 2 * (v >= 0.5)];
}

static void give_texture(struct lit *l)
{
    struct hg_texture *texture = (struct hg_texture *)add(l->scene, HG_OBJECT_TEXTURE, 3);
    struct hg_error err = {0};
    texture->image = hg_image_source_create("quarters");
    assert_non_null(texture->image);
    struct hg_image *image = &texture->image->pixels;
    assert_int_equal(hg_image_create(TEXELS, TEXELS, HG_PIXEL_RGBA32F, NULL, image), HG_OK);
    for (int i = 0; i < TEXELS * TEXELS; i++)
        for (int c = 0; c < 3; c++)
            ((float *)image->pixels)[4 * i + c] =
                (float)color_of((i % TEXELS + 0.5) / TEXELS, (i / TEXELS + 0.5) / TEXELS)[c];
    assert_int_equal(hg_light_set_texture(l->light, texture, &err), HG_OK);
}

// Of a rectangle or disc that looks down: who faces it from below sees its image's u run to -x, v
// to -z, as x of its frame is x and up is -z.
static void flat(const struct hg_light *light, bool colored, double x, double z, double rgb[3])
{
    const bool disc = light->kind == HG_LIGHT_DISC;
    const double w = disc ? 2 * (double)light->radius : (double)light->width;
    const double h = disc ? w : (double)light->height, area = disc ? M_PI * w * w / 4 : w * h;
    memset(rgb, 0, 3 * sizeof *rgb);
    for (int i = 0; i < STEPS * STEPS; i++) {
        const double u = (i % STEPS + 0.5) / STEPS, v = (i / STEPS + 0.5) / STEPS;
        const double px = (u - 0.5) * w, py = (v - 0.5) * h;
        if (disc && px * px + py * py > w * w / 4)
            continue;
        const double dx = px - x, dz = -py - z, d2 = dx * dx + dz * dz + 9;
        for (int c = 0; c < 3; c++)
            rgb[c] += (colored ? color_of(1 - u, 1 - v)[c] : 1) * 10 / area * 9 / (d2 * d2) * w *
                      h / (STEPS * STEPS * M_PI);
    }
}

static void test_flat(void **state)
{
    (void)state;
    for (int i = 0; i < 4; i++) {
        struct lit l;
        double rgb[3];
        begin(&l, i % 2 ? HG_LIGHT_DISC : HG_LIGHT_RECTANGLE);
        l.light->width = 3;
        l.light->height = 2;
        l.light->radius = 1.5f;
        if (i >= 2)
            give_texture(&l);
        collect(&l);
        for (int k = 0; k < 2; k++) {
            flat(l.light, i >= 2, k, 0.5 * k - 0.5, rgb);
            check(&l, i % 2 ? "disc" : "rectangle", k, 0.5 * k - 0.5, rgb);
        }
        end(&l);
    }
}

// The mantle of a tube along x, by its parts that face the point.
static void test_tube(void **state)
{
    (void)state;
    struct lit l;
    double rgb[3], e = 0;
    begin(&l, HG_LIGHT_TUBE);
    l.light->radius = 0.3f;
    l.light->width = 2;
    collect(&l);
    for (int i = 0; i < STEPS * STEPS; i++) {
        const double x = ((i % STEPS + 0.5) / STEPS - 0.5) * 2,
                     phi = (i / STEPS + 0.5) / STEPS * 2 * M_PI;
        const double n[3] = {0, cos(phi), sin(phi)};
        const double d[3] = {0.5 - x, -3 - 0.3 * n[1], -0.3 * n[2]};
        const double d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        const double facing = n[1] * d[1] + n[2] * d[2];
        if (facing > 0)
            e += 10 / (2 * 0.3 * 2) * facing * -d[1] / (d2 * d2) * (2 * M_PI * 0.3 * 2) /
                 (STEPS * STEPS);
    }
    grey(e, rgb);
    check(&l, "tube", 0.5, 0, rgb);
    end(&l);
}

// --- profiles and projected images
// -----------------------------------------------------------------

static void test_profile(void **state)
{
    (void)state;
    struct lit l;
    float factors[181] = {0};
    double rgb[3];
    for (int i = 0; i <= 90; i++)
        factors[i] = powf(cosf((float)i * (float)M_PI / 180), 3);
    begin(&l, HG_LIGHT_POINT);
    assert_int_equal(hg_light_profile_create(factors, 181, 1, &l.light->profile), HG_OK);
    collect(&l);
    for (int x = 0; x < 4; x++) {
        grey(10 * pow(3 / sqrt(9 + x * x), 3) * 3 / pow(9 + x * x, 1.5), rgb);
        check(&l, "cos^3", x, 0, rgb);
    }
    end(&l);
}

// Down from a spot light u runs along x, and v along z, as up is -z.
static void test_projected(void **state)
{
    (void)state;
    struct lit l;
    static const unsigned kinds[] = {HG_LIGHT_SPOT, HG_LIGHT_DIRECTIONAL};
    for (int i = 0; i < 2; i++) {
        begin(&l, kinds[i]);
        l.light->width = l.light->height = 4;
        give_texture(&l);
        collect(&l);
        for (int k = 0; k < 4; k++) {
            const double x = k % 2 ? 0.8 : -0.8, z = k / 2 ? 0.8 : -0.8;
            const double e = kinds[i] == HG_LIGHT_SPOT ? 10 * 3 / pow(9 + x * x + z * z, 1.5) : 10;
            const double *color = color_of(0.5 + x, 0.5 + z);
            const double rgb[3] = {e * color[0] / M_PI, e * color[1] / M_PI, e * color[2] / M_PI};
            check(&l, "projected", x, z, rgb);
        }
        end(&l);
    }
}

// Of more tables than there is room for, the last lights do without; equal lights share one.
static void test_many_tables(void **state)
{
    (void)state;
    enum { LIGHTS = 1100 };
    struct lit l;
    float factors[4] = {1, 1, 1, 1};
    begin(&l, HG_LIGHT_POINT);
    assert_int_equal(hg_light_profile_create(factors, 4, 1, &l.light->profile), HG_OK);
    for (uint64_t i = 1; i < LIGHTS; i++) {
        struct hg_node *node = (struct hg_node *)add(l.scene, HG_OBJECT_NODE, 2 * i + 1);
        node->light = (struct hg_light *)add(l.scene, HG_OBJECT_LIGHT, 2 * i + 2);
        node->light->kind = HG_LIGHT_POINT;
        if (i == 1)
            node->light->profile = hg_light_table_ref(l.light->profile);
        else
            assert_int_equal(hg_light_profile_create(factors, 4, 1, &node->light->profile), HG_OK);
    }
    const double origin[3] = {0};
    hg_scene_update(l.scene);
    assert_int_equal(hg_light_set_collect(&l.set, l.scene, origin), HG_OK);
    assert_int_equal(l.set.count, LIGHTS);
    assert_int_equal(l.set.items[0].profile, 0);
    assert_int_equal(l.set.items[1].profile, 0);
    assert_int_equal(l.set.items[2].profile, 5);
    assert_int_equal(l.set.items[1024].profile, 5 * 1023);
    assert_int_equal(l.set.items[1025].profile, HG_LIGHT_NO_TABLE);
    assert_int_equal(l.set.left_out, LIGHTS - 1025);
    assert_int_equal(l.set.word_count, 5 * 1024);
    end(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_spheres), cmocka_unit_test(test_flat),
        cmocka_unit_test(test_tube), cmocka_unit_test(test_profile),
        cmocka_unit_test(test_projected), cmocka_unit_test(test_many_tables)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
