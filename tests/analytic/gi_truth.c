// gi_truth.c - settled pictures with gathered light against path tracing, region by region: rooms
// where nearly all light is indirect.
//
// Means of regions by paths are in references/gi_truth.txt. With GI_TRUTH_SAMPLES=N in the
// environment scenes that are missing there are rendered with N samples per pixel and appended; to
// make one again, delete its lines.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/analytic/gi_rig.h"

enum { WIDTH = 96, HEIGHT = 72, COLUMNS = 6, ROWS = 4 };

// --- scenes --------------------------------------------------------------------------------------

static struct hg_material *painted(struct rig *rig, float red, float green, float blue)
{
    struct hg_material *m = rig_material(rig);
    const float albedo[3] = {red, green, blue};
    for (int c = 0; c < 3; c++)
        m->base_color[c] = albedo[c];
    return m;
}

static struct hg_material *lamp(struct rig *rig, float radiance)
{
    struct hg_material *m = painted(rig, 0, 0, 0);
    for (int c = 0; c < 3; c++)
        m->emissive[c] = radiance;
    return m;
}

static void faces(
    struct rig *rig, struct hg_material *m, const float box[2][3], int side, unsigned which)
{
    for (int i = 0; i < 6; i++)
        if (which >> i & 1)
            rig_face(rig, m, box, side, i);
}

enum { LOW_X = 1, HIGH_X = 2, FLOOR = 4, CEILING = 8, LOW_Z = 16, HIGH_Z = 32, ALL = 63 };

// A block that stands on the floor, turned about the vertical axis.
static void block(
    struct rig *rig, struct hg_material *m, const float at[2], const float size[3], float turn_rad)
{
    const float c = cosf(turn_rad), s = sinf(turn_rad);
    float p[8][3];
    for (int i = 0; i < 8; i++) {
        const float x = (i & 1 ? 0.5f : -0.5f) * size[0], z = (i & 4 ? 0.5f : -0.5f) * size[2];
        p[i][0] = at[0] + c * x + s * z;
        p[i][1] = i & 2 ? size[1] : 0;
        p[i][2] = at[1] + c * z - s * x;
    }
    static const int sides[5][4] = {
        {0, 2, 3, 1}, {5, 7, 6, 4}, {4, 6, 2, 0}, {1, 3, 7, 5}, {2, 6, 7, 3}};
    for (int i = 0; i < 5; i++) {
        float corners[4][3];
        for (int k = 0; k < 4; k++)
            for (int a = 0; a < 3; a++)
                corners[k][a] = p[sides[i][k]][a];
        rig_quad(rig, m, corners);
    }
}

// Cornell's box: white, a red and a green wall, two blocks, a lamp in the ceiling. Source of sizes
// and colours: Cornell University Program of Computer Graphics, "The Cornell Box".
static struct rig_camera cornell(struct rig *rig)
{
    const float box[2][3] = {{-2.78f, 0, -5.59f}, {2.78f, 5.49f, 0}};
    const float panel[2][3] = {{-0.65f, 5.46f, -3.32f}, {0.65f, 5.48f, -2.27f}};
    struct hg_material *white = painted(rig, 0.74f, 0.74f, 0.74f);
    faces(rig, white, box, 1, FLOOR | CEILING | LOW_Z);
    faces(rig, painted(rig, 0.57f, 0.06f, 0.05f), box, 1, LOW_X);
    faces(rig, painted(rig, 0.12f, 0.38f, 0.12f), box, 1, HIGH_X);
    block(
        rig, white, (const float[2]){0.93f, -1.69f}, (const float[3]){1.65f, 1.65f, 1.65f}, 0.29f);
    block(
        rig, white, (const float[2]){-0.93f, -3.51f}, (const float[3]){1.65f, 3.3f, 1.65f}, -0.37f);
    faces(rig, lamp(rig, 15), panel, -1, FLOOR);
    return (struct rig_camera){.eye = {0, 2.73, 8.0}, .target = {0, 2.73, 0}, .vfov_rad = 0.66};
}

// A corridor around two corners: the lamp is in the first leg, the eye at the end of the third.
static struct rig_camera corridor(struct rig *rig)
{
    struct hg_material *m = painted(rig, 0.7f, 0.7f, 0.7f);
    // Seen from above: the first leg along x (z from 0 to 2, x from 0 to 6), the second along -z at
    // its end (x from 4 to 6, z from -3 to 0), the third along x again (z from -5 to -3, x from 4
    // to 9).
    const float legs[3][2][3] = {
        {{0, 0, 0}, {6, 2.5f, 2}}, {{4, 0, -3}, {6, 2.5f, 0}}, {{4, 0, -5}, {9, 2.5f, -3}}};
    faces(rig, m, legs[0], 1, FLOOR | CEILING | LOW_X | HIGH_X | HIGH_Z);
    faces(rig, m, (const float[2][3]){{0, 0, 0}, {4, 2.5f, 2}}, 1, LOW_Z);
    faces(rig, m, legs[1], 1, FLOOR | CEILING | LOW_X | HIGH_X);
    faces(rig, m, legs[2], 1, FLOOR | CEILING | LOW_X | HIGH_X | LOW_Z);
    faces(rig, m, (const float[2][3]){{6, 0, -5}, {9, 2.5f, -3}}, 1, HIGH_Z);
    const float panel[2][3] = {{1, 2.4f, 0.5f}, {3, 2.45f, 1.5f}};
    faces(rig, lamp(rig, 40), panel, -1, FLOOR);
    return (struct rig_camera){.eye = {8.8, 1.3, -4.2}, .target = {5, 1.2, -3.8}, .vfov_rad = 1.0};
}

// A room of walls without thickness, 200 times darker than the sky that its window shows: light of
// probes before walls would be most of it.
static struct rig_camera window_room(struct rig *rig)
{
    struct hg_material *m = painted(rig, 0.7f, 0.7f, 0.7f);
    m->double_sided = true; // so that probes outside are not inside of something
    const float box[2][3] = {{-3, 0, -4}, {3, 2.8f, 4}};
    const float around[4][2][3] = {{{-3, 0, -4}, {3, 1.2f, 4}}, {{-3, 1.8f, -4}, {3, 2.8f, 4}},
        {{-3, 1.2f, -4}, {3, 1.8f, -1}}, {{-3, 1.2f, 0}, {3, 1.8f, 4}}};
    faces(rig, m, box, 1, ALL & ~LOW_X);
    for (int i = 0; i < 4; i++)
        faces(rig, m, around[i], 1, LOW_X);
    gi_sky(rig, 1);
    return (struct rig_camera){.eye = {-2.6, 1.5, 3.6}, .target = {2, 1.2, -1}, .vfov_rad = 1.0};
}

static void panel_room(struct rig *rig, struct hg_material *floor, unsigned walls)
{
    const float box[2][3] = {{-2, 0, -3}, {2, 3, 3}};
    const float panel[2][3] = {{-1, 2.9f, -1.5f}, {1, 2.95f, 1.5f}};
    faces(rig, floor, box, 1, ALL & ~walls);
    faces(rig, painted(rig, 0.6f, 0.6f, 0.6f), box, 1, walls & ~(LOW_X | LOW_Z));
    faces(rig, painted(rig, 0.6f, 0.3f, 0.2f), box, 1, walls & LOW_X);
    faces(rig, painted(rig, 0.2f, 0.4f, 0.6f), box, 1, walls & LOW_Z);
    faces(rig, lamp(rig, 5), panel, -1, FLOOR);
    block(rig, painted(rig, 0.5f, 0.5f, 0.2f), (const float[2]){-0.6f, -1},
        (const float[3]){1, 1, 1}, 0.4f);
}

static struct rig_camera glossy_floor(struct rig *rig)
{
    struct hg_material *m = painted(rig, 0.3f, 0.3f, 0.3f);
    m->roughness = 0.25f;
    panel_room(rig, m, ALL & ~FLOOR);
    return (struct rig_camera){.eye = {0, 1.5, 2.6}, .target = {0, 0.9, -3}, .vfov_rad = 1.1};
}

// Two long walls are mirrors that face each other.
static struct rig_camera mirror_hall(struct rig *rig)
{
    struct hg_material *m = painted(rig, 0.9f, 0.9f, 0.9f);
    m->metallic = 1;
    m->roughness = 0;
    panel_room(rig, m, ALL & ~(LOW_X | HIGH_X));
    return (struct rig_camera){.eye = {1, 1.5, 2.6}, .target = {-1.6, 0.9, -2}, .vfov_rad = 1.1};
}

// --- against paths -------------------------------------------------------------------------------

typedef float regions[ROWS][COLUMNS][3]; // means

static void look(const struct hg_refbuf *pixels, regions out)
{
    const float *p = (const float *)(const void *)pixels->data;
    const int width = WIDTH / COLUMNS, height = HEIGHT / ROWS;
    memset(out, 0, sizeof(regions));
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            for (int c = 0; c < 3; c++)
                out[y / height][x / width][c] +=
                    p[(y * WIDTH + x) * 4 + c] / (float)(width * height);
}

static FILE *open_references(const char *mode)
{
    char path[4096];
    const char *root = getenv("HELIO_SOURCE_DIR");
    snprintf(path, sizeof path, "%s/tests/analytic/references/gi_truth.txt", root ? root : ".");
    return fopen(path, mode);
}

static bool read_reference(const char *name, regions out)
{
    FILE *file = open_references("r");
    char line[256];
    bool found = false;
    while (file != NULL && !found && fgets(line, sizeof line, file) != NULL) {
        line[strcspn(line, ":")] = '\0';
        found = strcmp(line, name) == 0;
    }
    float *values = &out[0][0][0];
    for (int i = 0; i < ROWS * COLUMNS * 3 && found; i++)
        assert_int_equal(fscanf(file, "%f", &values[i]), 1);
    if (file != NULL)
        fclose(file);
    return found;
}

static void write_reference(const char *name, uint32_t samples, regions means)
{
    FILE *file = open_references("a");
    assert_non_null(file);
    fprintf(file, "%s: %u samples\n", name, samples);
    for (int row = 0; row < ROWS; row++)
        for (int column = 0; column < COLUMNS; column++)
            fprintf(file, "%.6g %.6g %.6g\n", (double)means[row][column][0],
                (double)means[row][column][1], (double)means[row][column][2]);
    assert_int_equal(fclose(file), 0);
}

struct scene {
    const char *name;
    struct rig_camera (*make)(struct rig *rig);
    double limits[2]; // of the worst region; of the mean
};

static void find_reference(
    struct rig *rig, const struct scene *scene, struct rig_camera camera, regions out)
{
    if (read_reference(scene->name, out))
        return;
    const char *wanted = getenv("GI_TRUTH_SAMPLES");
    if (wanted == NULL)
        fail_msg("tests/analytic/references/gi_truth.txt has no \"%s\"", scene->name);
    camera.mode = HG_MODE_PATH;
    camera.max_bounces = 64;
    camera.samples = (uint32_t)atoi(wanted);
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    look(pixels, out);
    hg_refbuf_unref(pixels);
    write_reference(scene->name, camera.samples, out);
}

static void against_paths(struct rig *rig, const struct scene *scene)
{
    rig_scene(rig);
    struct rig_camera camera = scene->make(rig);
    regions got, want;
    camera.width = WIDTH;
    camera.height = HEIGHT;
    find_reference(rig, scene, camera, want);
    camera.samples = 32;
    camera.gi = HG_GI_RAYS;
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    look(pixels, got);
    hg_refbuf_unref(pixels);
    double worst = 0, sums[2] = {0};
    for (int row = 0; row < ROWS; row++) {
        for (int column = 0; column < COLUMNS; column++) {
            double off = 0;
            for (int c = 0; c < 3; c++) {
                const double a = (double)got[row][column][c], b = (double)want[row][column][c];
                off = fabs(a / b - 1) > fabs(off) ? a / b - 1 : off;
                sums[0] += a;
                sums[1] += b;
            }
            print_message("%6.1f", 100 * off);
            worst = fmax(worst, fabs(off));
        }
        print_message("\n");
    }
    const double total = sums[0] / sums[1] - 1;
    print_message("%s: worst region off by %.1f %%, all by %+.1f %%\n", scene->name, 100 * worst,
        100 * total);
    assert_true(worst <= scene->limits[0]);
    assert_true(fabs(total) <= scene->limits[1]);
}

static void test_cornell(void **state)
{
    against_paths(*state, &(struct scene){"Cornell's box", cornell, {0.05, 0.03}});
}

static void test_corridor(void **state)
{
    against_paths(*state, &(struct scene){"corridor", corridor, {0.05, 0.03}});
}

static void test_window_room(void **state)
{
    against_paths(*state, &(struct scene){"room with a window", window_room, {0.09, 0.03}});
}

static void test_glossy_floor(void **state)
{
    against_paths(*state, &(struct scene){"glossy floor", glossy_floor, {0.05, 0.03}});
}

static void test_mirror_hall(void **state)
{
    against_paths(*state, &(struct scene){"mirror hall", mirror_hall, {0.05, 0.03}});
}

// By few samples what mirrors show has hardly any noise, as it is not filtered: pixels of pictures
// of two seeds, by what they differ over their mean.
static void test_mirror_noise(void **state)
{
    struct rig *rig = *state;
    struct hg_refbuf *pictures[2];
    double squares = 0, mean = 0;
    size_t count = 0;
    rig_scene(rig);
    struct rig_camera camera = mirror_hall(rig);
    camera.width = 2 * WIDTH + 64;
    camera.height = 2 * HEIGHT + 48;
    camera.samples = 32;
    camera.gi = HG_GI_RAYS;
    for (uint32_t i = 0; i < 2; i++) {
        camera.seed = i + 1;
        pictures[i] = rig_render(rig, &camera);
    }
    const float *a = (const float *)(const void *)pictures[0]->data;
    const float *b = (const float *)(const void *)pictures[1]->data;
    for (uint32_t y = camera.height / 3; y < camera.height * 2 / 3; y++)
        for (uint32_t x = 0; x < camera.width / 4; x++) { // of the mirror on the left
            const size_t at = 4 * ((size_t)y * camera.width + x) + 1;
            squares += (double)((a[at] - b[at]) * (a[at] - b[at])) / 2;
            mean += (double)(a[at] + b[at]) / 2;
            count++;
        }
    const double noise = sqrt(squares / (double)count) / (mean / (double)count);
    print_message("mirror: noise %.3f of the mean\n", noise);
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
    assert_true(noise <= 0.1);
}

int main(void)
{
    cmocka_set_test_filter(getenv("GI_ONLY")); // NULL: all
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cornell),
        cmocka_unit_test(test_corridor),
        cmocka_unit_test(test_window_room),
        cmocka_unit_test(test_glossy_floor),
        cmocka_unit_test(test_mirror_hall),
        cmocka_unit_test(test_mirror_noise),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
