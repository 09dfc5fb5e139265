#include "renderer/light/env/env_device.h"

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/sha256.h"
#include "renderer/light/env/env_cache.h"
#include "renderer/light/env/environment.h"
#include "renderer/light/env/sky_cache.h"
#include "renderer/math/vec.h"

// --- what it is made of --------------------------------------------------------------------------

static bool is_zero(const uint8_t *bytes, size_t size)
{
    uint8_t any = 0;
    for (size_t i = 0; i < size; i++)
        any |= bytes[i];
    return !any;
}

// Names of the content: the file's hash, or the pixels' own when there was no file.
static enum hg_status image_key(const struct hg_environment *source, uint8_t key[32])
{
    if (is_zero(source->image_hash, 32))
        return hg_sha256(source->image.pixels, source->image.size_bytes, key);
    memcpy(key, source->image_hash, 32);
    return HG_OK;
}

static enum hg_status sky_key(const struct hg_sky *sky, uint8_t key[32])
{
    const struct {
        char name[8];
        float sun[3], turbidity;
        uint32_t disc, version;
    } text = {"hg sky", {sky->sun_direction[0], sky->sun_direction[1], sky->sun_direction[2]},
        sky->turbidity, sky->with_disc, 3};
    return hg_sha256(&text, sizeof text, key);
}

// --- upload --------------------------------------------------------------------------------------

struct half_rows {
    const struct hg_image *image;
    uint16_t *out;
    uint32_t step, width; // every texel of the result is the mean of step x step
};

static void half_row(void *user, size_t row)
{
    const struct half_rows *h = user;
    for (uint32_t x = 0; x < h->width; x++) {
        float sum[3] = {0, 0, 0}, scale = 1 / (float)(h->step * h->step);
        for (uint32_t k = 0; k < h->step * h->step; k++) {
            size_t sy = row * h->step + k / h->step, sx = (size_t)x * h->step + k % h->step;
            const float *p = (const float *)h->image->pixels + (sy * h->image->width + sx) * 4;
            for (int c = 0; c < 3; c++)
                sum[c] += p[c] > 0 ? p[c] * scale : 0;
        }
        uint16_t *out = h->out + (row * h->width + x) * 4;
        for (int c = 0; c < 3; c++)
            out[c] = hg_half(sum[c]);
        out[3] = 0x3c00;
    }
}

// The background as the device gets it.
struct radiance {
    uint16_t *texels; // RGBA16F
    uint32_t width, height;
};

// Halved until the device takes it.
static enum hg_status make_radiance(struct hg_gpu *gpu, const struct hg_image *image,
    struct hg_jobs *jobs, struct radiance *out, struct hg_error *err)
{
    const uint32_t limit = hg_gpu_get_caps(gpu)->max_image_side_px;
    struct half_rows rows = {image, NULL, 1, image->width};
    *out = (struct radiance){0};
    while (image->width / rows.step > limit || image->height / rows.step > limit)
        rows.step *= 2;
    rows.width = image->width / rows.step;
    uint32_t height = image->height / rows.step;
    rows.out = hg_calloc((size_t)rows.width * height, 8);
    if (!rows.out)
        return hg_error_set(err, HG_E_NOMEM, "environment", NULL, "no memory for its image");
    hg_jobs_for(jobs, height, half_row, &rows);
    *out = (struct radiance){rows.out, rows.width, height};
    return HG_OK;
}

static enum hg_status upload_radiance(struct hg_gpu *gpu, const struct radiance *radiance,
    struct hg_gpu_image *out, struct hg_error *err)
{
    struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_2D,
        .format = VK_FORMAT_R16G16B16A16_SFLOAT,
        .width = radiance->width,
        .height = radiance->height,
        .name = "environment radiance"};
    struct hg_gpu_region region = {.width = radiance->width, .height = radiance->height};
    enum hg_status status = hg_gpu_image_create(gpu, &params, out, err);
    if (!status)
        status = hg_gpu_image_upload(gpu, out, &region, radiance->texels, 0, err);
    if (status)
        hg_gpu_image_destroy(gpu, out);
    return status;
}

static enum hg_status upload_specular(struct hg_gpu *gpu, const struct hg_environment_map *map,
    struct hg_gpu_image *out, struct hg_error *err)
{
    struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_CUBE,
        .format = VK_FORMAT_R16G16B16A16_SFLOAT,
        .width = map->face_size,
        .height = map->face_size,
        .mips = HG_ENVIRONMENT_LEVELS,
        .name = "environment specular"};
    enum hg_status status = hg_gpu_image_create(gpu, &params, out, err);
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS && !status; l++) {
        uint32_t s = map->face_size >> l;
        struct hg_gpu_region region = {.mip = l, .width = s, .height = s};
        status = hg_gpu_image_upload_layers(gpu, out, &region, 6, map->specular[l], err);
    }
    if (status)
        hg_gpu_image_destroy(gpu, out);
    return status;
}

static enum hg_status upload_irradiance(struct hg_gpu *gpu, const struct hg_environment_map *map,
    struct hg_gpu_buffer *out, struct hg_error *err)
{
    const uint64_t bytes =
        (uint64_t)HG_ENVIRONMENT_PITCH * HG_ENVIRONMENT_PITCH * sizeof(struct hg_vec4);
    enum hg_status status =
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_DEVICE, bytes, "environment irradiance", out, err);
    if (!status)
        status = hg_gpu_buffer_upload(gpu, out, 0, map->irradiance, bytes, err);
    if (status)
        hg_gpu_buffer_destroy(gpu, out);
    return status;
}

static enum hg_status black_image(
    struct hg_gpu *gpu, enum hg_gpu_image_kind kind, struct hg_gpu_image *out, struct hg_error *err)
{
    static const uint16_t black[6 * 4];
    struct hg_gpu_image_params params = {.kind = kind,
        .format = VK_FORMAT_R16G16B16A16_SFLOAT,
        .width = 1,
        .height = 1,
        .name = "no environment"};
    struct hg_gpu_region region = {.width = 1, .height = 1};
    enum hg_status status = hg_gpu_image_create(gpu, &params, out, err);
    if (!status)
        status = hg_gpu_image_upload_layers(
            gpu, out, &region, kind == HG_GPU_IMAGE_CUBE ? 6 : 1, black, err);
    return status;
}

static void release(struct hg_env_device *env, struct hg_gpu *gpu)
{
    hg_gpu_image_destroy(gpu, &env->specular);
    hg_gpu_image_destroy(gpu, &env->radiance);
    hg_gpu_buffer_destroy(gpu, &env->irradiance);
}

// For rays on the host.
static enum hg_status keep_irradiance(const struct hg_environment_map *map, struct hg_vec4 **out)
{
    const size_t count = (size_t)HG_ENVIRONMENT_PITCH * HG_ENVIRONMENT_PITCH;
    if (!*out)
        *out = hg_calloc(count, sizeof **out);
    if (!*out)
        return HG_E_NOMEM;
    memcpy(*out, map->irradiance, count * sizeof **out);
    return HG_OK;
}

// Means of the sharpest level.
static enum hg_status make_coarse(const struct hg_environment_map *map, float **out)
{
    const uint32_t side = HG_ENV_COARSE_SIDE, step = map->face_size / side;
    float *coarse = hg_calloc((size_t)6 * side * side, 3 * sizeof *coarse);
    if (!coarse)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < 6 * side * side; i++) {
        const uint32_t face = i / (side * side), y0 = i / side % side * step, x0 = i % side * step;
        double sum[3] = {0};
        for (uint32_t y = y0; y < y0 + step; y++)
            for (uint32_t x = x0; x < x0 + step; x++) {
                const uint16_t *texel =
                    map->specular[0] +
                    (((size_t)face * map->face_size + y) * map->face_size + x) * 4;
                for (int c = 0; c < 3; c++)
                    sum[c] += (double)hg_half_to_float(texel[c]);
            }
        for (int c = 0; c < 3; c++)
            coarse[i * 3 + c] = (float)(sum[c] / ((double)step * step));
    }
    hg_free(*out);
    *out = coarse;
    return HG_OK;
}

// Replaces what is on the device; keeps it on failure.
static enum hg_status upload(struct hg_env_device *env, struct hg_gpu *gpu,
    const struct hg_environment_map *map, const struct radiance *radiance, struct hg_error *err)
{
    struct hg_env_device next = *env;
    next.specular = next.radiance = (struct hg_gpu_image){0};
    next.irradiance = (struct hg_gpu_buffer){0};
    enum hg_status status = upload_specular(gpu, map, &next.specular, err);
    if (!status)
        status = radiance->texels ? upload_radiance(gpu, radiance, &next.radiance, err)
                                  : black_image(gpu, HG_GPU_IMAGE_2D, &next.radiance, err);
    if (!status)
        status = upload_irradiance(gpu, map, &next.irradiance, err);
    if (status) {
        release(&next, gpu);
        return status;
    }
    release(env, gpu);
    *env = next;
    env->specular_lods = HG_ENVIRONMENT_LEVELS - 1;
    return HG_OK;
}

// --- the object ----------------------------------------------------------------------------------

enum hg_status hg_env_device_init(
    struct hg_env_device *env, struct hg_gpu *gpu, struct hg_error *err)
{
    *env = (struct hg_env_device){0};
    enum hg_status status = black_image(gpu, HG_GPU_IMAGE_CUBE, &env->specular, err);
    if (!status)
        status = black_image(gpu, HG_GPU_IMAGE_2D, &env->radiance, err);
    if (!status)
        status = hg_gpu_buffer_create(
            gpu, HG_GPU_BUFFER_DEVICE, 256, "no environment", &env->irradiance, err);
    if (status)
        hg_env_device_finish(env, gpu);
    return status;
}

void hg_env_device_finish(struct hg_env_device *env, struct hg_gpu *gpu)
{
    release(env, gpu);
    hg_free(env->coarse);
    hg_free(env->host_irradiance);
    *env = (struct hg_env_device){0};
}

// What an environment is on the host, before it is uploaded.
struct made {
    struct hg_environment_map map;
    struct radiance radiance;
    bool cached;
};

static void made_finish(struct made *made)
{
    hg_environment_map_finish(&made->map);
    hg_free(made->radiance.texels);
    *made = (struct made){0};
}

static enum hg_status make_map(const struct hg_env_maker *m, const struct hg_image *image,
    const uint8_t key[32], struct made *out, struct hg_error *err)
{
    enum hg_status status =
        hg_environment_map_load(&out->map, image, key, m->store, m->jobs, &out->cached);
    return status ? hg_error_set(err, status, "environment", NULL, "could not be prefiltered")
                  : HG_OK;
}

// An image without pages is shown itself.
static enum hg_status make_image(const struct hg_env_maker *m, const struct hg_environment *source,
    const uint8_t key[32], struct made *out, struct hg_error *err)
{
    enum hg_status status = make_map(m, &source->image, key, out, err);
    if (!status && !source->background.image)
        status = make_radiance(m->gpu, &source->image, m->jobs, &out->radiance, err);
    return status;
}

// A sky whose light and background are both in the store is not drawn at all.
static bool find_sky(
    struct hg_store *store, const uint8_t seen[32], const uint8_t light[32], struct made *out)
{
    if (!store)
        return false;
    out->radiance =
        (struct radiance){hg_env_cache_read_sky(store, seen, HG_SKY_WIDTH, HG_SKY_HEIGHT),
            HG_SKY_WIDTH, HG_SKY_HEIGHT};
    out->cached = out->radiance.texels && hg_env_cache_read(store, light, HG_SKY_WIDTH, &out->map);
    if (!out->cached)
        made_finish(out);
    return out->cached;
}

// What is seen of a sky: with the sun's disc, if it is to have it.
static enum hg_status make_seen(const struct hg_env_maker *m, const struct hg_sky *sky,
    const struct hg_image *drawn, struct radiance *out, struct hg_error *err)
{
    struct hg_image seen;
    if (!sky->with_disc)
        return make_radiance(m->gpu, drawn, m->jobs, out, err);
    if (hg_image_create(drawn->width, drawn->height, drawn->format, NULL, &seen))
        return hg_error_set(err, HG_E_NOMEM, "sky", NULL, "no memory");
    memcpy(seen.pixels, drawn->pixels, drawn->size_bytes);
    hg_sky_draw_disc(sky, &seen);
    const enum hg_status status = make_radiance(m->gpu, &seen, m->jobs, out, err);
    hg_image_finish(&seen);
    return status;
}

// What is seen has the sun's disc. What lights real-time pictures has not: lighting.c makes a
// directional light of it. key: of what is seen.
static enum hg_status make_sky(const struct hg_env_maker *m, const struct hg_sky *sky,
    const uint8_t key[32], struct made *out, struct hg_error *err)
{
    struct hg_sky without_disc = *sky;
    const struct hg_image *drawn;
    struct hg_error refused = {0};
    uint8_t light[32];
    without_disc.with_disc = false;
    if (sky_key(&without_disc, light))
        return hg_error_set(err, HG_E_NOMEM, "sky", NULL, "no memory");
    if (find_sky(m->store, key, light, out))
        return HG_OK;
    if (hg_sky_cache_render(m->sky, sky, m->jobs, &drawn))
        return hg_error_set(err, HG_E_NOMEM, "sky", NULL, "no memory");
    enum hg_status status = make_map(m, drawn, light, out, err);
    if (!status)
        status = make_seen(m, sky, drawn, &out->radiance, err);
    const struct radiance *r = &out->radiance;
    if (!status && m->store && r->width == HG_SKY_WIDTH &&
        hg_env_cache_write_sky(m->store, key, r->width, r->height, r->texels, &refused))
        hg_debug(LIGHT, "sky not kept: %s: %s", refused.what, refused.reason);
    return status;
}

enum hg_status hg_env_device_sync(struct hg_env_device *env, const struct hg_env_maker *maker,
    const struct hg_environment *source, bool has_sun, struct hg_error *err)
{
    if (source->kind == HG_ENV_NONE || source->kind == HG_ENV_COLOR) {
        env->kind = source->kind == HG_ENV_COLOR ? HG_ENV_KIND_COLOR : HG_ENV_KIND_NONE;
        return HG_OK;
    }
    if (source->kind == HG_ENV_IMAGE &&
        (!source->image.pixels || source->image.format != HG_PIXEL_RGBA32F))
        return hg_error_set(err, HG_E_INVAL, "environment", "image", "has no float pixels");
    const uint64_t begin = hg_clock_now_ns();
    const struct hg_sky sky = hg_sky_of(source, has_sun);
    uint8_t key[32];
    enum hg_status status =
        source->kind == HG_ENV_SKY ? sky_key(&sky, key) : image_key(source, key);
    if (status)
        return hg_error_set(err, status, "environment", NULL, "no memory");
    if (env->has_key && !memcmp(env->key, key, 32)) {
        env->kind = HG_ENV_KIND_IMAGE;
        return HG_OK;
    }
    struct made made = {0};
    status = source->kind == HG_ENV_SKY ? make_sky(maker, &sky, key, &made, err)
                                        : make_image(maker, source, key, &made, err);
    if (!status) {
        env->prefilter_ns = hg_clock_now_ns() - begin;
        status = upload(env, maker->gpu, &made.map, &made.radiance, err);
    }
    if (!status &&
        (make_coarse(&made.map, &env->coarse) || keep_irradiance(&made.map, &env->host_irradiance)))
        status = hg_error_set(err, HG_E_NOMEM, "environment", NULL, "no memory for a coarse copy");
    if (!status) {
        memcpy(env->key, key, 32);
        env->has_key = true;
        env->from_cache = made.cached;
        env->kind = HG_ENV_KIND_IMAGE;
    }
    made_finish(&made);
    return status;
}
