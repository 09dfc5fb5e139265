#include "renderer/light/env/environment.h"

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/light/env/cubemap.h"
#include "renderer/light/env/env_cache.h"
#include "renderer/light/env/irradiance.h"

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

// --- bright texels -------------------------------------------------------------------------------

// The sun fills one texel in a hundred thousand and holds half of the light. Importance sampling of
// a lobe meets it by chance; so what exceeds a threshold is taken out of the source and added to
// every lobe in closed form.
#define MAX_SOURCES 256

struct sources {
    uint32_t count;
    float x[MAX_SOURCES], y[MAX_SOURCES], z[MAX_SOURCES]; // directions
    hg_v4 flux[MAX_SOURCES];                              // excess radiance times solid angle
};

static float peak(hg_v4 v)
{
    return fmaxf(v[0], fmaxf(v[1], v[2]));
}

static double mean_peak(const struct hg_cubemap *cube, uint32_t level)
{
    const uint32_t s = cube->size >> level;
    double sum = 0, weight = 0;
    for (uint32_t i = 0; i < 6 * s * s; i++) {
        double w = (double)hg_cubemap_texel_solid_angle(s, i % s, i / s % s);
        sum += w * (double)peak(*hg_cubemap_texel(cube, level, i / (s * s), i % s, i / s % s));
        weight += w;
    }
    return sum / weight;
}

static uint32_t count_above(const struct hg_cubemap *cube, uint32_t level, float threshold)
{
    const uint32_t s = cube->size >> level;
    uint32_t count = 0;
    for (uint32_t i = 0; i < 6 * s * s; i++)
        count += peak(*hg_cubemap_texel(cube, level, i / (s * s), i % s, i / s % s)) > threshold;
    return count;
}

// Moves the excess over the lowest threshold (>= 8 means) that leaves at most MAX_SOURCES texels.
static void sources_take(
    struct sources *sources, struct hg_cubemap *cube, uint32_t level, struct hg_jobs *jobs)
{
    const uint32_t s = cube->size >> level;
    float threshold = 8 * (float)mean_peak(cube, level);
    sources->count = 0;
    if (!(threshold > 0))
        return;
    while (count_above(cube, level, threshold) > MAX_SOURCES)
        threshold *= 1.25f;
    for (uint32_t i = 0; i < 6 * s * s; i++) {
        hg_v4 *texel = hg_cubemap_texel(cube, level, i / (s * s), i % s, i / s % s);
        float p = peak(*texel), d[3];
        if (!(p > threshold))
            continue;
        hg_cubemap_direction(i / (s * s), (2 * (float)(i % s) + 1) / (float)s - 1,
            (2 * (float)(i / s % s) + 1) / (float)s - 1, d);
        hg_v4 kept = *texel * (threshold / p);
        uint32_t k = sources->count++;
        sources->x[k] = d[0];
        sources->y[k] = d[1];
        sources->z[k] = d[2];
        sources->flux[k] = (*texel - kept) * hg_cubemap_texel_solid_angle(s, i % s, i / s % s);
        *texel = kept;
    }
    hg_cubemap_shrink_from(cube, level, jobs);
}

// --- specular: GGX about the mirror direction ----------------------------------------------------

#define MAX_LOBE_SAMPLES 2048

struct lobe {
    float alpha2, scale; // D(h) n.l is divided by its integral: scale = alpha^2 / pi / integral
    float min_lod;
    uint32_t count;
    struct lobe_sample {
        float dir[3]; // tangent space, z = reflection direction
        float weight; // sums to 1
        float lod;    // of the source cube
    } samples[MAX_LOBE_SAMPLES];
};

// Directions with n = v = r, importance sampled from D(h) n.h; weight n.l. The lod gives every
// sample the share of the source that it stands for, its solid angle 4 / (N D).
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
            fmaxf((float)lod, lobe->min_lod)};
        sum += z;
    }
    for (uint32_t i = 0; i < lobe->count; i++)
        lobe->samples[i].weight = (float)((double)lobe->samples[i].weight / sum);
    // The integral of D n.l over l is the mean of n.l / pdf * D with pdf = D / 4.
    lobe->alpha2 = (float)a2;
    lobe->scale = (float)(a2 / HG_PI / (4 * sum / count));
}

struct specular_fill {
    const struct hg_cubemap *cube;
    const struct sources *sources;
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
    const uint32_t s = fill->size, face = (uint32_t)(index / s), y = (uint32_t)(index % s);
    for (uint32_t x = 0; x < s; x++)
        store_half(fill->out + (index * s + x) * 4, *hg_cubemap_texel(fill->cube, 0, face, x, y));
}

static hg_v4 lobe_radiance(const struct hg_cubemap *cube, const struct lobe *lobe, const float n[3])
{
    float t[3], b[3];
    hg_v4 sum = {0, 0, 0, 0};
    hg_basis3(n, t, b);
    for (uint32_t i = 0; i < lobe->count; i++) {
        const struct lobe_sample *p = &lobe->samples[i];
        float d[3];
        for (int c = 0; c < 3; c++)
            d[c] = t[c] * p->dir[0] + b[c] * p->dir[1] + n[c] * p->dir[2];
        sum += hg_cubemap_sample(cube, d, p->lod) * p->weight;
    }
    return sum;
}

// The lobe's share of all bright texels: D(h) n.l with (n.h)^2 = (1 + n.l) / 2.
static hg_v4 lobe_sources(const struct sources *s, const struct lobe *lobe, const float n[3])
{
    float weight[MAX_SOURCES];
    hg_v4 sum = {0, 0, 0, 0};
    for (uint32_t i = 0; i < s->count; i++) {
        float l = s->x[i] * n[0] + s->y[i] * n[1] + s->z[i] * n[2];
        // (n.h)^2 (a^2 - 1) + 1 with its digits kept where n.h is near 1.
        float sine2 = 0.5f - 0.5f * l, k = sine2 + lobe->alpha2 * (1 - sine2);
        weight[i] = (l > 0 ? l : 0) * lobe->scale / (k * k);
    }
    for (uint32_t i = 0; i < s->count; i++)
        sum += s->flux[i] * weight[i];
    return sum;
}

static void specular_row(void *user, size_t index)
{
    const struct specular_fill *fill = user;
    const uint32_t s = fill->size, face = (uint32_t)(index / s), y = (uint32_t)(index % s);
    for (uint32_t x = 0; x < s; x++) {
        float n[3];
        hg_cubemap_direction(
            face, (2 * (float)x + 1) / (float)s - 1, (2 * (float)y + 1) / (float)s - 1, n);
        store_half(fill->out + (index * s + x) * 4,
            lobe_radiance(fill->cube, fill->lobe, n) + lobe_sources(fill->sources, fill->lobe, n));
    }
}

struct specular_scratch {
    struct sources sources;
    struct lobe lobe;
};

static enum hg_status specular_levels(
    struct hg_environment_map *map, struct hg_cubemap *cube, struct hg_jobs *jobs)
{
    // Fewer texels per level, so more samples each.
    static const uint32_t counts[HG_ENVIRONMENT_LEVELS] = {0, 32, 96, 256, 512, 1024, 2048};
    struct specular_scratch *scratch = hg_calloc_aligned(16, sizeof *scratch);
    if (!scratch)
        return HG_E_NOMEM;
    struct specular_fill fill = {
        cube, &scratch->sources, &scratch->lobe, map->specular[0], map->face_size};
    hg_jobs_for(jobs, (size_t)6 * fill.size, mirror_row, &fill);
    uint32_t coarse = 0;
    while (cube->size >> coarse > HG_ENVIRONMENT_MIN_FACE)
        coarse++;
    sources_take(&scratch->sources, cube, coarse, jobs);
    for (uint32_t l = 1; l < HG_ENVIRONMENT_LEVELS; l++) {
        float r = hg_environment_roughness(l);
        fill.size = map->face_size >> l;
        fill.out = map->specular[l];
        scratch->lobe.min_lod = (float)coarse;
        lobe_make(&scratch->lobe, r * r, counts[l], map->face_size);
        hg_jobs_for(jobs, (size_t)6 * fill.size, specular_row, &fill);
    }
    hg_free(scratch);
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

// image: RGBA32F equirectangular. Convention of struct hg_environment (scene.h). NaN, infinite and
// negative values count as 0. HG_E_NOMEM. About 0.6 s of one core for a 1k image.
static enum hg_status map_create(
    struct hg_environment_map *map, const struct hg_image *image, struct hg_jobs *jobs)
{
    struct hg_cubemap cube = {0};
    struct hg_image clean = {0};
    *map = (struct hg_environment_map){.face_size = hg_environment_face_size(image->width)};
    enum hg_status status = take_memory(map);
    if (!status)
        status = clean_image(image, &clean);
    if (!status)
        status = hg_cubemap_create(&cube, &clean, map->face_size, jobs);
    if (!status)
        status = specular_levels(map, &cube, jobs);
    if (!status)
        status = hg_irradiance_fill(&clean, jobs, map->irradiance);
    hg_cubemap_finish(&cube);
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
    const uint8_t key[32], struct hg_store *store, struct hg_jobs *jobs, bool *cached)
{
    bool found = store && hg_env_cache_read(store, key, image->width, map);
    if (cached)
        *cached = found;
    if (found)
        return HG_OK;
    enum hg_status status = map_create(map, image, jobs);
    struct hg_error err = {0};
    if (status || !store)
        return status;
    enum hg_status kept = hg_env_cache_write(store, key, image->width, map, &err);
    if (kept && kept != HG_E_BUSY) // another process is writing the same
        hg_warn(LIGHT, "environment cache not written: %s: %s", err.what, err.reason);
    return status;
}
