#include "renderer/light/environment.h"

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/light/cube.h"
#include "renderer/light/env_cache.h"
#include "renderer/light/irradiance.h"

float hg_environment_roughness(uint32_t level)
{
    float t = (float)level / (HG_ENVIRONMENT_LEVELS - 1);
    return level ? (1.7f - sqrtf(hg_clampf(2.89f - 2.8f * t, 0, 3))) / 1.4f : 0;
}

uint32_t hg_environment_face_size(uint32_t image_width)
{
    uint32_t size = HG_ENVIRONMENT_MIN_FACE;
    while (size < HG_ENVIRONMENT_MAX_FACE && size < image_width / 2)
        size *= 2;
    return size;
}

// --- specular: GGX about the mirror direction ----------------------------------------------------

#define MAX_LOBE_SAMPLES 1024

struct lobe {
    uint32_t count;
    struct lobe_sample {
        float dir[3]; // tangent space, z = reflection direction
        float weight; // sums to 1
        float lod;    // of the source cube
    } samples[MAX_LOBE_SAMPLES];
};

// Directions with n = v = r, importance sampled from D(h) n.h; weight n.l. The lod gives every
// sample the share of the source it stands for (its solid angle 4 / (N D)), one level finer so that
// neighbouring footprints overlap.
// Source: Karis 2013 (prefilter); Krivanek and Colbert 2008, "Real-time Shading with Filtered
// Importance Sampling", eq. 4..7.
static void lobe_make(struct lobe *lobe, float alpha, uint32_t count, uint32_t size)
{
    const double texel = 4 * HG_PI / (6.0 * size * size), a2 = (double)alpha * (double)alpha;
    double sum = 0;
    lobe->count = 0;
    for (uint32_t i = 0; i < count; i++) {
        double u = (i + 0.5) / count, phi = 2 * HG_PI * fmod(i * 0.6180339887498949, 1);
        double c2 = (1 - u) / (1 + (a2 - 1) * u), c = sqrt(c2), s = sqrt(fmax(0, 1 - c2));
        double z = 2 * c2 - 1; // n.l
        if (z <= 0)
            continue;
        double k = c2 * (a2 - 1) + 1, d = a2 / (HG_PI * k * k);
        double lod = 0.5 * log2(4 / (count * d) / texel);
        struct lobe_sample *out = &lobe->samples[lobe->count++];
        *out = (struct lobe_sample){
            {(float)(2 * c * s * cos(phi)), (float)(2 * c * s * sin(phi)), (float)z}, (float)z,
            (float)fmax(0, lod)};
        sum += z;
    }
    for (uint32_t i = 0; i < lobe->count; i++)
        lobe->samples[i].weight = (float)((double)lobe->samples[i].weight / sum);
}

struct specular_fill {
    const struct hg_cube *cube;
    const struct lobe *lobe;
    uint16_t *out;
    uint32_t size;
};

static void store_half(uint16_t *out, hg_v4 v)
{
    for (int c = 0; c < 3; c++)
        out[c] = hg_half(v[c]);
    out[3] = 0x3c00; // 1
}

static void mirror_row(void *user, size_t index)
{
    const struct specular_fill *fill = user;
    const size_t s = fill->size, pitch = s + 2, face = index / s, y = index % s;
    const hg_v4 *from = fill->cube->faces[0] + (face * pitch + y + 1) * pitch + 1;
    for (size_t x = 0; x < s; x++)
        store_half(fill->out + (index * s + x) * 4, from[x]);
}

static hg_v4 lobe_radiance(const struct hg_cube *cube, const struct lobe *lobe, const float n[3])
{
    float t[3], b[3];
    hg_v4 sum = {0, 0, 0, 0};
    hg_basis3(n, t, b);
    for (uint32_t i = 0; i < lobe->count; i++) {
        const struct lobe_sample *p = &lobe->samples[i];
        float d[3];
        for (int c = 0; c < 3; c++)
            d[c] = t[c] * p->dir[0] + b[c] * p->dir[1] + n[c] * p->dir[2];
        sum += hg_cube_sample(cube, d, p->lod) * p->weight;
    }
    return sum;
}

static void specular_row(void *user, size_t index)
{
    const struct specular_fill *fill = user;
    const uint32_t s = fill->size, face = (uint32_t)(index / s), y = (uint32_t)(index % s);
    for (uint32_t x = 0; x < s; x++) {
        float n[3];
        hg_cube_direction(
            face, (2 * (float)x + 1) / (float)s - 1, (2 * (float)y + 1) / (float)s - 1, n);
        store_half(fill->out + (index * s + x) * 4, lobe_radiance(fill->cube, fill->lobe, n));
    }
}

static enum hg_status specular_levels(
    struct hg_environment_map *map, const struct hg_cube *cube, struct hg_jobs *jobs)
{
    // Fewer texels per level, so more samples each.
    static const uint32_t counts[HG_ENVIRONMENT_LEVELS] = {0, 32, 64, 128, 256, 512, 1024};
    struct lobe *lobe = hg_calloc(1, sizeof *lobe);
    if (!lobe)
        return HG_E_NOMEM;
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++) {
        const uint32_t s = map->face_size >> l;
        struct specular_fill fill = {cube, lobe, map->specular[l], s};
        float r = hg_environment_roughness(l);
        if (l)
            lobe_make(lobe, r * r, counts[l], map->face_size);
        hg_jobs_for(jobs, (size_t)6 * s, l ? specular_row : mirror_row, &fill);
    }
    hg_free(lobe);
    return HG_OK;
}

// --- the map -------------------------------------------------------------------------------------

static enum hg_status take_memory(struct hg_environment_map *map)
{
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++) {
        size_t s = map->face_size >> l;
        map->specular[l] = hg_calloc(6 * s * s * 4, sizeof(uint16_t));
        if (!map->specular[l])
            return HG_E_NOMEM;
    }
    map->irradiance =
        hg_calloc((size_t)HG_ENVIRONMENT_PITCH * HG_ENVIRONMENT_PITCH, sizeof *map->irradiance);
    return map->irradiance ? HG_OK : HG_E_NOMEM;
}

// A copy without values that no light has.
static enum hg_status clean_image(const struct hg_image *image, struct hg_image *out)
{
    enum hg_status status =
        hg_image_create(image->width, image->height, HG_PIXEL_RGBA32F, NULL, out);
    if (status)
        return status;
    const float *from = image->pixels;
    float *to = out->pixels;
    for (size_t i = 0; i < (size_t)image->width * image->height * 4; i++)
        to[i] = from[i] > 0 && from[i] <= 1e12f ? from[i] : 0;
    return HG_OK;
}

enum hg_status hg_environment_map_create(
    struct hg_environment_map *map, const struct hg_image *image, struct hg_jobs *jobs)
{
    struct hg_cube cube = {0};
    struct hg_image clean = {0};
    *map = (struct hg_environment_map){.face_size = hg_environment_face_size(image->width)};
    enum hg_status status = take_memory(map);
    if (!status)
        status = clean_image(image, &clean);
    if (!status)
        status = hg_cube_create(&cube, &clean, map->face_size, jobs);
    if (!status)
        status = specular_levels(map, &cube, jobs);
    if (!status)
        status = hg_irradiance_fill(&clean, jobs, map->irradiance);
    hg_cube_finish(&cube);
    hg_image_finish(&clean);
    if (status)
        hg_environment_map_finish(map);
    return status;
}

void hg_environment_map_finish(struct hg_environment_map *map)
{
    for (uint32_t l = 0; l < HG_ENVIRONMENT_LEVELS; l++)
        hg_free(map->specular[l]);
    hg_free(map->irradiance);
    *map = (struct hg_environment_map){0};
}

enum hg_status hg_environment_map_load(struct hg_environment_map *map, const struct hg_image *image,
    const uint8_t key[32], const char *cache_dir, struct hg_jobs *jobs)
{
    if (cache_dir && hg_env_cache_read(cache_dir, key, image->width, map))
        return HG_OK;
    enum hg_status status = hg_environment_map_create(map, image, jobs);
    if (status || !cache_dir)
        return status;
    struct hg_error err = {0};
    if (hg_env_cache_write(cache_dir, key, image->width, map, &err))
        hg_warn(LIGHT, "environment cache not written: %s: %s", err.what, err.reason);
    return HG_OK;
}
