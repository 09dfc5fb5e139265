// environment.c - image-based light against sums over the image, orientation, cache, sky.
#include <dirent.h>
#include <stdio.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "renderer/light/env/env_cache.h"
#include "renderer/light/env/environment.h"
#include "renderer/light/env/sky.h"
#include "tests/analytic/probe.h"
#include "tests/support/folder.h"
#include "tests/support/test_data.h"

#define PI 3.14159265358979

#define ROOM TEST_MODELS "/room.hdr"

static const char *const held[] = {"hdr/lightroom_14b_from_filament_ktx.hdr",
    "hdr/narrow_moonlit_road_1k.hdr", "hdr/noon_grass_1k.hdr", "hdr/royal_esplanade_1k.hdr"};

// path: NULL: nothing yet.
static void set_image(struct probe *probe, const char *path)
{
    struct hg_environment *env = &probe->scene->environment;
    struct hg_error err = {0};
    hg_image_finish(&env->image);
    memset(env->image_hash, 0, sizeof env->image_hash);
    env->kind = HG_ENV_IMAGE;
    env->intensity = 1;
    env->rotation_rad = 0;
    if (!path)
        return;
    if (hg_image_read_file(path, HG_PIXEL_RGBA32F, NULL, &env->image, &err))
        fail_msg("%s: %s", err.what, err.reason);
    probe_sync(probe);
}

// One bright texel on black.
static void set_texel(struct probe *probe, uint32_t w, uint32_t h, uint32_t x, uint32_t y)
{
    struct hg_environment *env = &probe->scene->environment;
    set_image(probe, NULL);
    assert_int_equal(hg_image_create(w, h, HG_PIXEL_RGBA32F, NULL, &env->image), HG_OK);
    float *p = (float *)env->image.pixels + ((size_t)y * w + x) * 4;
    p[0] = p[1] = p[2] = p[3] = 100;
}

enum { WIDTH_MAX = 1024 };

// cos and sin of the azimuth of each column of texels.
struct columns {
    double cosine[WIDTH_MAX], sine[WIDTH_MAX];
};

static struct columns columns_of(uint32_t width)
{
    struct columns columns;
    assert_true(width <= WIDTH_MAX);
    for (uint32_t x = 0; x < width; x++) {
        const double phi = ((x + 0.5) / width - 0.5) * 2 * PI;
        columns.cosine[x] = cos(phi);
        columns.sine[x] = sin(phi);
    }
    return columns;
}

static void texel_direction(double x, double y, uint32_t w, uint32_t h, struct hg_vec4 *out)
{
    double phi = (x / w - 0.5) * 2 * PI, theta = (0.5 - y / h) * PI;
    *out = (struct hg_vec4){
        (float)(cos(theta) * cos(phi)), (float)sin(theta), (float)(cos(theta) * sin(phi)), out->w};
}

static void spread(int i, int n, struct hg_vec4 *out)
{
    double y = 1 - 2 * (i + 0.5) / n, s = sqrt(1 - y * y), phi = i * 2.399963229728653;
    *out = (struct hg_vec4){(float)(s * cos(phi)), (float)y, (float)(s * sin(phi)), out->w};
}

static void test_color_is_exact(void **state)
{
    struct probe *probe = *state;
    struct hg_environment *env = &probe->scene->environment;
    struct hg_vec4 in[2] = {{0.6f, 0, 0.8f, 0.37f}, {0, 0, 0, 0}}, out[1];
    env->kind = HG_ENV_COLOR;
    env->color[0] = 0.25f;
    env->color[1] = 1.5f;
    env->color[2] = 3;
    env->intensity = 2;
    probe_sync(probe);
    const enum probe_op ops[] = {PROBE_RADIANCE, PROBE_IRRADIANCE, PROBE_PREFILTERED};
    for (int k = 0; k < 3; k++) {
        probe_run(probe, ops[k], 1, in, out);
        probe_near(out[0].x, 0.5, 0);
        probe_near(out[0].y, 3, 0);
        probe_near(out[0].z, 6, 0);
    }
    env->intensity = 1;
}

// A texel of the image is seen in its own direction, by the background and by a mirror, and turns
// with the rotation: counter-clockwise about +y.
static void test_orientation(void **state)
{
    struct probe *probe = *state;
    const uint32_t w = 1024, h = 512, texels[3][2] = {{597, 213}, {10, 400}, {300, 60}};
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 2; turn++) {
            struct hg_vec4 in[8] = {{0, 0, 0, 0}}, out[4];
            set_texel(probe, w, h, texels[k][0], texels[k][1]);
            double angle = turn ? 0.7 : 0;
            probe->scene->environment.rotation_rad = (float)angle;
            probe_sync(probe);
            const double around[4][2] = {{0.5, 0.5}, {3.5, 0.5}, {-2.5, 0.5}, {0.5, 4.5}};
            for (int i = 0; i < 4; i++) {
                struct hg_vec4 d = {0, 0, 0, 0};
                texel_direction(texels[k][0] + around[i][0], texels[k][1] + around[i][1], w, h, &d);
                double c = cos(angle), s = sin(angle);
                in[2 * i] = (struct hg_vec4){(float)(c * (double)d.x + s * (double)d.z), d.y,
                    (float)(c * (double)d.z - s * (double)d.x), 0};
            }
            probe_run(probe, PROBE_RADIANCE, 4, in, out);
            probe_near(out[0].x, 100, 3); // samplers have 8 bits between texels
            for (int i = 1; i < 4; i++)
                probe_near(out[i].x, 0, 1e-3);
            probe_run(probe, PROBE_PREFILTERED, 4, in, out);
            assert_true(out[0].x > 10); // texels are narrow near the poles
            for (int i = 1; i < 4; i++)
                assert_true(out[i].x < 3);
        }
}

// What a mirror shows is the image.
static void check_mirror(struct probe *probe, const char *path)
{
    enum { COUNT = 4096 };
    static struct hg_vec4 in[2 * COUNT], a[COUNT], b[COUNT];
    double error = 0, mean = 0;
    set_image(probe, path);
    for (int i = 0; i < COUNT; i++) {
        in[2 * i].w = 0;
        spread(i, COUNT, &in[2 * i]);
    }
    probe_run(probe, PROBE_RADIANCE, COUNT, in, a);
    probe_run(probe, PROBE_PREFILTERED, COUNT, in, b);
    for (int i = 0; i < COUNT; i++) {
        double x = fmin((double)a[i].y, 4), y = fmin((double)b[i].y, 4); // display range
        error += fabs(x - y);
        mean += x;
    }
    print_message("%s: mirror against source %.4f\n", path, error / mean);
    assert_true(error / mean < 0.03);
}

static void test_roughness_zero_is_the_source(void **state)
{
    check_mirror(*state, ROOM);
}

// All texels with their exact solid angles.
static double brute_irradiance(const struct hg_image *image, const struct hg_vec4 *n, int channel)
{
    const float *p = image->pixels;
    const struct columns columns = columns_of(image->width);
    double sum = 0;
    for (uint32_t y = 0; y < image->height; y++) {
        double t = PI * (0.5 - (y + 0.5) / image->height), half = PI / 2 / image->height;
        double area = 2 * PI / image->width * (sin(t + half) - sin(t - half));
        const double out = cos(t), up = sin(t) * (double)n->y;
        for (uint32_t x = 0; x < image->width; x++) {
            double c =
                out * (columns.cosine[x] * (double)n->x + columns.sine[x] * (double)n->z) + up;
            if (c > 0)
                sum += c * area * (double)p[((size_t)y * image->width + x) * 4 + channel];
        }
    }
    return sum / PI;
}

// Irradiance of nine harmonics (Ramamoorthi and Hanrahan 2001), for comparison.
static void harmonics(const double d[3], double out[9])
{
    const double v[9] = {0.282095, 0.488603 * d[1], 0.488603 * d[2], 0.488603 * d[0],
        1.092548 * d[0] * d[1], 1.092548 * d[1] * d[2], 0.315392 * (3 * d[2] * d[2] - 1),
        1.092548 * d[0] * d[2], 0.546274 * (d[0] * d[0] - d[1] * d[1])};
    memcpy(out, v, sizeof v);
}

static void project(const struct hg_image *image, double sh[9])
{
    const float *p = image->pixels;
    memset(sh, 0, 9 * sizeof *sh);
    for (uint32_t y = 0; y < image->height; y++) {
        double t = PI * (0.5 - (y + 0.5) / image->height), half = PI / 2 / image->height;
        double area = 2 * PI / image->width * (sin(t + half) - sin(t - half));
        for (uint32_t x = 0; x < image->width; x++) {
            double phi = ((x + 0.5) / image->width - 0.5) * 2 * PI, b[9];
            harmonics((double[3]){cos(t) * cos(phi), sin(t), cos(t) * sin(phi)}, b);
            for (int i = 0; i < 9; i++)
                sh[i] += b[i] * area * (double)p[((size_t)y * image->width + x) * 4 + 1];
        }
    }
}

static double sh_irradiance(const double sh[9], const struct hg_vec4 *n)
{
    const double band[9] = {
        PI, 2 * PI / 3, 2 * PI / 3, 2 * PI / 3, PI / 4, PI / 4, PI / 4, PI / 4, PI / 4};
    double b[9], sum = 0;
    harmonics((double[3]){(double)n->x, (double)n->y, (double)n->z}, b);
    for (int i = 0; i < 9; i++)
        sum += band[i] * sh[i] * b[i];
    return sum / PI;
}

static void check_irradiance(struct probe *probe, const char *path)
{
    enum { COUNT = 40 };
    struct hg_vec4 in[2 * COUNT] = {{0, 0, 0, 0}}, out[COUNT];
    double sh[9], map_error = 0, sh_error = 0, mean = 0, worst = 0, peak = 0;
    set_image(probe, path);
    const struct hg_image *image = &probe->scene->environment.image;
    project(image, sh);
    for (int i = 0; i < COUNT; i++)
        spread(i, COUNT, &in[2 * i]);
    probe_run(probe, PROBE_IRRADIANCE, COUNT, in, out);
    for (int i = 0; i < COUNT; i++) {
        double e = brute_irradiance(image, &in[2 * i], 1), d = fabs((double)out[i].y - e);
        map_error += d;
        worst = fmax(worst, d);
        sh_error += fabs(sh_irradiance(sh, &in[2 * i]) - e);
        mean += e;
        peak = fmax(peak, e);
    }
    print_message("%s: irradiance map %.5f (worst %.4f of the peak), nine harmonics %.4f\n", path,
        map_error / mean, worst / peak, sh_error / mean);
    assert_true(map_error / mean < 0.005);
    assert_true(worst / peak < 0.02);
    assert_true(sh_error > map_error); // the reason for a map
}

static void test_irradiance(void **state)
{
    check_irradiance(*state, ROOM);
}

static double brute_lobe(const struct hg_image *image, const struct hg_vec4 *n, double alpha)
{
    const float *p = image->pixels;
    const struct columns columns = columns_of(image->width);
    double sum = 0, weights = 0;
    for (uint32_t y = 0; y < image->height; y++) {
        double t = PI * (0.5 - (y + 0.5) / image->height);
        const double out = cos(t), up = sin(t) * (double)n->y;
        for (uint32_t x = 0; x < image->width; x++) {
            double c =
                out * (columns.cosine[x] * (double)n->x + columns.sine[x] * (double)n->z) + up;
            if (c <= 0)
                continue;
            double k = 0.5 * (1 + c) * (alpha * alpha - 1) + 1, w = c / (k * k) * out;
            sum += w * (double)p[((size_t)y * image->width + x) * 4 + 1];
            weights += w;
        }
    }
    return sum / weights;
}

// Every level of the prefiltered cube against the lobe summed over all texels.
static void check_prefilter(struct probe *probe, const char *path)
{
    enum { COUNT = 8 };
    struct hg_vec4 in[2 * COUNT] = {{0, 0, 0, 0}}, out[COUNT];
    set_image(probe, path);
    const struct hg_image *image = &probe->scene->environment.image;
    for (uint32_t level = 2; level < HG_ENVIRONMENT_LEVELS; level++) {
        float r = hg_environment_roughness(level);
        double error = 0, mean = 0;
        for (int i = 0; i < COUNT; i++) {
            in[2 * i].w = r;
            spread(i, COUNT, &in[2 * i]);
        }
        probe_run(probe, PROBE_PREFILTERED, COUNT, in, out);
        for (int i = 0; i < COUNT; i++) {
            double e = brute_lobe(image, &in[2 * i], (double)(r * r));
            error += fabs((double)out[i].y - e);
            mean += e;
        }
        print_message("%s: roughness %.3f error %.4f\n", path, (double)r, error / mean);
        assert_true(error / mean < 0.06);
    }
}

static void test_prefilter(void **state)
{
    check_prefilter(*state, ROOM);
}

// The same of images from outside.
static void test_environments_of_others(void **state)
{
    for (size_t f = 0; f < sizeof held / sizeof held[0]; f++) {
        const char *path = test_data(held[f]);
        check_mirror(*state, path);
        check_irradiance(*state, path);
        check_prefilter(*state, path);
    }
}

// Furnace through images: a constant image must act like a constant colour.
static void test_constant_image(void **state)
{
    enum { COUNT = 64 };
    struct hg_vec4 in[2 * COUNT] = {{0, 0, 0, 0}}, out[COUNT];
    struct probe *probe = *state;
    struct hg_environment *env = &probe->scene->environment;
    set_image(probe, NULL);
    assert_int_equal(hg_image_create(256, 128, HG_PIXEL_RGBA32F, NULL, &env->image), HG_OK);
    for (size_t i = 0; i < (size_t)256 * 128 * 4; i++)
        ((float *)env->image.pixels)[i] = 1;
    probe_sync(probe);
    for (int i = 0; i < COUNT; i++)
        in[2 * i] = (struct hg_vec4){
            (float)(i % 8) / 7, (float)(i % 3) / 2, 0.05f + 0.95f * (float)(i / 8) / 7, 1};
    probe_run(probe, PROBE_ENVIRONMENT, COUNT, in, out);
    for (int i = 0; i < COUNT; i++)
        probe_near(out[i].x, 1, 2e-3);
}

// The only entry of the store.
static void find_entry(const char *folder, char *path, size_t size)
{
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    int count = 0;
    for (struct dirent *e; (e = readdir(dir)) != NULL;)
        if (strstr(e->d_name, ".hgs") != NULL) {
            snprintf(path, size, "%s/%s", folder, e->d_name);
            count++;
        }
    closedir(dir);
    assert_int_equal(count, 1);
}

static void test_cache(void **state)
{
    (void)state;
    char folder[TEST_FOLDER_MAX];
    struct hg_environment_map made, read;
    struct hg_image image;
    struct hg_error err = {0};
    struct hg_jobs *jobs = hg_jobs_create(2);
    uint8_t key[32] = {7, 1, 2, 3};
    bool cached = true;
    assert_true(test_folder_make(folder, "environment"));
    struct hg_store *store;
    assert_int_equal(hg_store_open(&(struct hg_store_params){.dir = folder}, &store, &err), HG_OK);
    assert_int_equal(hg_image_read_file(ROOM, HG_PIXEL_RGBA32F, NULL, &image, &err), HG_OK);
    uint64_t begin = hg_clock_now_ns();
    assert_int_equal(hg_environment_map_load(&made, &image, key, store, jobs, &cached), HG_OK);
    uint64_t cold = hg_clock_now_ns() - begin;
    assert_false(cached);
    begin = hg_clock_now_ns();
    assert_int_equal(hg_environment_map_load(&read, &image, key, store, jobs, &cached), HG_OK);
    print_message("1k environment: %.0f ms cold, %.0f ms from the cache\n", (double)cold * 1e-6,
        (double)(hg_clock_now_ns() - begin) * 1e-6);
    assert_true(cached);
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++) {
        size_t s = made.face_size >> l;
        assert_memory_equal(made.specular[l], read.specular[l], 6 * s * s * 8);
    }
    assert_memory_equal(made.irradiance, read.irradiance,
        sizeof(struct hg_vec4) * HG_ENVIRONMENT_PITCH * HG_ENVIRONMENT_PITCH);
    hg_environment_map_finish(&read);

    // Damage and truncation are noticed, and the map is made again.
    uint8_t *data;
    size_t size;
    char path[512];
    find_entry(folder, path, sizeof path);
    assert_int_equal(hg_file_read(path, 1u << 30, &data, &size, &err), HG_OK);
    const size_t places[] = {0, 5, 20, 40, size / 2, size - 1};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        data[places[i]] ^= 1;
        assert_int_equal(hg_file_write_atomic(path, data, size, &err), HG_OK);
        assert_false(hg_env_cache_read(store, key, image.width, &read));
        data[places[i]] ^= 1;
    }
    const size_t cuts[] = {0, 31, 33, 100, size - 1};
    for (size_t i = 0; i < sizeof cuts / sizeof cuts[0]; i++) {
        assert_int_equal(hg_file_write_atomic(path, data, cuts[i], &err), HG_OK);
        assert_false(hg_env_cache_read(store, key, image.width, &read));
    }
    assert_int_equal(hg_environment_map_load(&read, &image, key, store, jobs, &cached), HG_OK);
    assert_false(cached);
    assert_memory_equal(made.specular[3], read.specular[3], 6 * 64 * 64 * 8);
    hg_environment_map_finish(&made);
    hg_environment_map_finish(&read);
    unlink(path);
    rmdir(folder);
    hg_free(data);
    hg_store_close(store);
    hg_image_finish(&image);
    hg_jobs_destroy(jobs);
}

// The background of a sky comes back as it was, for its own key and size, and not when it is damaged.
static void test_sky_cache(void **state)
{
    (void)state;
    enum { WIDTH = 64, HEIGHT = 32 };
    char folder[TEST_FOLDER_MAX], path[512];
    static uint16_t texels[WIDTH * HEIGHT * 4];
    struct hg_error err = {0};
    struct hg_store *store;
    uint8_t key[32] = {1}, other[32] = {2}, *data;
    size_t size;
    for (size_t i = 0; i < WIDTH * HEIGHT * 4; i++)
        texels[i] = (uint16_t)(i * 7);
    assert_true(test_folder_make(folder, "sky"));
    assert_int_equal(hg_store_open(&(struct hg_store_params){.dir = folder}, &store, &err), HG_OK);
    assert_null(hg_env_cache_read_sky(store, key, WIDTH, HEIGHT));
    assert_int_equal(hg_env_cache_write_sky(store, key, WIDTH, HEIGHT, texels, &err), HG_OK);
    uint16_t *read = hg_env_cache_read_sky(store, key, WIDTH, HEIGHT);
    assert_non_null(read);
    assert_memory_equal(read, texels, sizeof texels);
    hg_free(read);
    assert_null(hg_env_cache_read_sky(store, other, WIDTH, HEIGHT));
    assert_null(hg_env_cache_read_sky(store, key, HEIGHT, WIDTH));
    find_entry(folder, path, sizeof path);
    assert_int_equal(hg_file_read(path, 1u << 30, &data, &size, &err), HG_OK);
    data[size / 2] ^= 1;
    assert_int_equal(hg_file_write_atomic(path, data, size, &err), HG_OK);
    assert_null(hg_env_cache_read_sky(store, key, WIDTH, HEIGHT));
    hg_free(data);
    unlink(path);
    rmdir(folder);
    hg_store_close(store);
}

static double sky_luminance(const struct hg_image *image, double phi, double theta)
{
    uint32_t x = (uint32_t)((phi / (2 * PI) + 0.5) * image->width) % image->width;
    uint32_t y = (uint32_t)((0.5 - theta / PI) * image->height);
    const float *p = (const float *)image->pixels + ((size_t)y * image->width + x) * 4;
    return 0.2126 * (double)p[0] + 0.7152 * (double)p[1] + 0.0722 * (double)p[2];
}

// Known properties of clear skies: blue overhead, brighter around the sun, warm where a low sun
// stands, and about a tenth to a quarter of the sun's own illuminance by day.
static void test_sky(void **state)
{
    struct probe *probe = *state;
    struct hg_image day, dusk, again;
    float noon[3], low[3];
    struct hg_sky sky = {.sun_direction = {0.6f, 0.8f, 0}, .turbidity = 2};
    assert_int_equal(hg_sky_render(&sky, probe->jobs, &day), HG_OK);
    assert_int_equal(hg_sky_render(&sky, probe->jobs, &again), HG_OK);
    assert_memory_equal(day.pixels, again.pixels, day.size_bytes);
    hg_sky_sun_illuminance(&sky, noon);
    struct hg_vec4 zenith = {0, 1, 0, 0};
    double diffuse = brute_irradiance(&day, &zenith, 1) * PI;
    print_message("sky: sun %.2f %.2f %.2f lux, sky %.2f lux, zenith %.3f\n", (double)noon[0],
        (double)noon[1], (double)noon[2], diffuse, sky_luminance(&day, 2, 1.5));
    assert_true(noon[0] > noon[1] && noon[1] > noon[2] && noon[2] > 2);
    assert_true(diffuse > 0.1 * (double)noon[1] && diffuse < 0.3 * (double)noon[1]);
    const float *p = (const float *)day.pixels + ((size_t)40 * day.width + 200) * 4;
    assert_true(p[2] > 1.5f * p[0]);
    assert_true(sky_luminance(&day, 0.05, asin(0.8)) > 2 * sky_luminance(&day, PI, 0.8));

    sky.sun_direction[0] = 0.998f;
    sky.sun_direction[1] = 0.06f;
    assert_int_equal(hg_sky_render(&sky, probe->jobs, &dusk), HG_OK);
    hg_sky_sun_illuminance(&sky, low);
    assert_true(low[0] > 3 * low[2] && low[1] < 0.7f * noon[1]);
    uint32_t x = dusk.width / 2, y = dusk.height / 2 - 6;
    p = (const float *)dusk.pixels + ((size_t)y * dusk.width + x) * 4;
    assert_true(p[0] > p[2]);
    for (size_t i = 0; i < dusk.size_bytes / 4; i++)
        assert_true(((const float *)dusk.pixels)[i] >= 0 && ((const float *)dusk.pixels)[i] < 1e4f);

    // With its disc the sky holds the sun's own light too.
    sky.sun_direction[0] = 0.6f;
    sky.sun_direction[1] = 0.8f;
    sky.with_disc = true;
    hg_image_finish(&again);
    assert_int_equal(hg_sky_render(&sky, probe->jobs, &again), HG_OK);
    double all = brute_irradiance(&again, &zenith, 1) * PI;
    probe_near(all - diffuse, (double)noon[1] * 0.8, 0.03 * (double)noon[1]);
    hg_image_finish(&day);
    hg_image_finish(&dusk);
    hg_image_finish(&again);
}

// Chromaticity of the zenith and how it runs over the sky: Preetham, Shirley and Smits 1999, "A
// Practical Analytic Model for Daylight", appendix A.2.
static double preetham(bool y, double turbidity, double sun, double zenith, double gamma)
{
    static const double m[2][3][4] = {
        {{0.00166, -0.00375, 0.00209, 0}, {-0.02903, 0.06377, -0.03202, 0.00394},
            {0.11693, -0.21196, 0.06052, 0.25886}},
        {{0.00275, -0.00610, 0.00317, 0}, {-0.04214, 0.08970, -0.04153, 0.00516},
            {0.15346, -0.26756, 0.06670, 0.26688}}};
    static const double c[2][5][2] = {{{-0.0193, -0.2592}, {-0.0665, 0.0008}, {-0.0004, 0.2125},
                                          {-0.0641, -0.8989}, {-0.0033, 0.0452}},
        {{-0.0167, -0.2608}, {-0.0950, 0.0092}, {-0.0079, 0.2102}, {-0.0441, -1.6537},
            {-0.0109, 0.0529}}};
    double at_zenith = 0, k[5], f[2];
    for (int r = 0; r < 3; r++)
        for (int p = 0; p < 4; p++)
            at_zenith += pow(turbidity, 2 - r) * m[y][r][p] * pow(sun, 3 - p);
    for (int i = 0; i < 5; i++)
        k[i] = c[y][i][0] * turbidity + c[y][i][1];
    for (int i = 0; i < 2; i++) { // there; at the zenith
        double cosine = i ? 1 : cos(zenith), g = i ? sun : gamma;
        f[i] =
            (1 + k[0] * exp(k[1] / cosine)) * (1 + k[2] * exp(k[3] * g) + k[4] * cos(g) * cos(g));
    }
    return at_zenith * f[0] / f[1];
}

// Clear skies are as blue as the published model says, from the zenith to near the horizon.
static void test_sky_is_as_blue_as_published(void **state)
{
    struct probe *probe = *state;
    static const double directions[6][2] = {
        {89, 180}, {45, 180}, {45, 90}, {10, 180}, {10, 90}, {3, 180}}; // elevation, from the sun
    for (int k = 0; k < 4; k++) {
        const double turbidity = 2 + k % 2, sun = (k < 2 ? 40 : 60) * PI / 180;
        struct hg_image image;
        const struct hg_sky sky = {
            .sun_direction = {(float)sin(sun), (float)cos(sun), 0}, .turbidity = (float)turbidity};
        double worst = 0;
        assert_int_equal(hg_sky_render(&sky, probe->jobs, &image), HG_OK);
        for (int i = 0; i < 6; i++) {
            double up = directions[i][0] * PI / 180, turn = directions[i][1] * PI / 180;
            const double d[3] = {cos(up) * cos(turn), sin(up), cos(up) * sin(turn)};
            double gamma = acos(d[0] * sin(sun) + d[1] * cos(sun));
            uint32_t x = (uint32_t)((turn / (2 * PI) + 0.5) * image.width) % image.width;
            uint32_t y = (uint32_t)((0.5 - up / PI) * image.height);
            const float *p = (const float *)image.pixels + ((size_t)y * image.width + x) * 4;
            const double r = (double)p[0], g = (double)p[1], b = (double)p[2];
            double xyz[3] = {0.4124 * r + 0.3576 * g + 0.1805 * b,
                0.2126 * r + 0.7152 * g + 0.0722 * b, 0.0193 * r + 0.1192 * g + 0.9505 * b};
            double sum = xyz[0] + xyz[1] + xyz[2];
            for (int c = 0; c < 2; c++)
                worst = fmax(worst,
                    fabs(xyz[c] / sum - preetham(c == 1, turbidity, sun, PI / 2 - up, gamma)));
        }
        print_message("sky, turbidity %.0f, sun %.0f degrees from the zenith: chromaticity within "
                      "%.4f of Preetham's\n",
            turbidity, sun * 180 / PI, worst);
        assert_true(worst < 0.025);
        hg_image_finish(&image);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_color_is_exact),
        cmocka_unit_test(test_orientation),
        cmocka_unit_test(test_roughness_zero_is_the_source),
        cmocka_unit_test(test_irradiance),
        cmocka_unit_test(test_prefilter),
        cmocka_unit_test(test_environments_of_others),
        cmocka_unit_test(test_constant_image),
        cmocka_unit_test(test_cache),
        cmocka_unit_test(test_sky_cache),
        cmocka_unit_test(test_sky),
        cmocka_unit_test(test_sky_is_as_blue_as_published),
    };
    return test_run_group(tests, probe_setup, probe_teardown);
}
