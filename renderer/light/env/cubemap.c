#include "renderer/light/env/cubemap.h"

#include "base/alloc.h"
#include "base/checked.h"

void hg_cubemap_direction(uint32_t face, float x, float y, float out[3])
{
    // Vulkan specification, table "Cube map face and coordinate selection", solved for the ray.
    const float rows[6][3] = {
        {1, -y, -x}, {-1, -y, x}, {x, 1, y}, {x, -1, -y}, {x, -y, 1}, {-x, -y, -1}};
    hg_copy3(rows[face], out);
    hg_normalize3(out);
}

// Face of a direction and its point there.
static uint32_t cube_face(const float d[3], float *x, float *y)
{
    float ax = fabsf(d[0]), ay = fabsf(d[1]), az = fabsf(d[2]);
    if (ax >= ay && ax >= az) {
        *x = (d[0] > 0 ? -d[2] : d[2]) / ax;
        *y = -d[1] / ax;
        return d[0] > 0 ? 0 : 1;
    }
    if (ay >= az) {
        *x = d[0] / ay;
        *y = (d[1] > 0 ? d[2] : -d[2]) / ay;
        return d[1] > 0 ? 2 : 3;
    }
    *x = (d[2] > 0 ? d[0] : -d[0]) / az;
    *y = -d[1] / az;
    return d[2] > 0 ? 4 : 5;
}

static hg_v4 load4(const float *p)
{
    hg_v4 v;
    memcpy(&v, p, sizeof v);
    return v;
}

// Bilinear radiance of an equirectangular image along a unit direction; wraps around in u.
static hg_v4 sample_equirect(const struct hg_image *image, const float dir[3])
{
    const int w = (int)image->width, h = (int)image->height;
    float u = atan2f(dir[2], dir[0]) * (float)(0.5 / HG_PI) + 0.5f;
    float v = 0.5f - asinf(hg_clampf(dir[1], -1, 1)) * (float)(1 / HG_PI);
    float x = u * (float)w - 0.5f, y = hg_clampf(v * (float)h - 0.5f, 0, (float)h - 1);
    int x0 = (int)floorf(x), y0 = (int)y;
    float fx = x - (float)x0, fy = y - (float)y0;
    int xa = (x0 + w) % w, xb = (x0 + 1) % w, yb = y0 + 1 < h ? y0 + 1 : y0;
    const float *p = image->pixels;
    size_t pitch = (size_t)w * 4;
    hg_v4 a = load4(p + (size_t)y0 * pitch + (size_t)xa * 4);
    hg_v4 b = load4(p + (size_t)y0 * pitch + (size_t)xb * 4);
    hg_v4 c = load4(p + (size_t)yb * pitch + (size_t)xa * 4);
    hg_v4 d = load4(p + (size_t)yb * pitch + (size_t)xb * 4);
    hg_v4 low = a + (b - a) * fx, high = c + (d - c) * fx;
    return low + (high - low) * fy;
}

struct cube_fill {
    struct hg_cubemap *cube;
    const struct hg_image *image;
    uint32_t level, grid; // grid: samples per texel and axis
};

// Rows of level 0, border included: it is sampled like any other texel, past the face's edge.
static void fill_row(void *user, size_t index)
{
    const struct cube_fill *fill = user;
    const uint32_t size = fill->cube->size, pitch = size + 2, n = fill->grid;
    const uint32_t face = (uint32_t)(index / pitch), row = (uint32_t)(index % pitch);
    hg_v4 *out = fill->cube->faces[0] + index * pitch;
    const float step = 2.0f / (float)(size * n), weight = 1.0f / (float)(n * n);
    for (uint32_t i = 0; i < pitch; i++) {
        hg_v4 sum = {0, 0, 0, 0};
        for (uint32_t k = 0; k < n * n; k++) {
            float x = ((float)(i * n + k % n) + 0.5f - (float)n) * step - 1, d[3];
            float y = ((float)(row * n + k / n) + 0.5f - (float)n) * step - 1;
            hg_cubemap_direction(face, x, y, d);
            sum += sample_equirect(fill->image, d);
        }
        out[i] = sum * weight;
    }
}

// Inner texels of level l from level l - 1.
static void shrink_face(void *user, size_t face)
{
    const struct cube_fill *fill = user;
    const uint32_t s = fill->cube->size >> fill->level, pitch = s + 2, above = 2 * s + 2;
    const hg_v4 *from = fill->cube->faces[fill->level - 1] + face * above * above;
    hg_v4 *to = fill->cube->faces[fill->level] + face * pitch * pitch;
    for (uint32_t y = 0; y < s; y++)
        for (uint32_t x = 0; x < s; x++) {
            const hg_v4 *p = from + (size_t)(2 * y + 1) * above + 2 * x + 1;
            to[(size_t)(y + 1) * pitch + x + 1] = (p[0] + p[1] + p[above] + p[above + 1]) * 0.25f;
        }
}

static hg_v4 *texel(const struct hg_cubemap *cube, uint32_t level, uint32_t face, int x, int y)
{
    const size_t pitch = (cube->size >> level) + 2;
    return cube->faces[level] + face * pitch * pitch + (size_t)(y + 1) * pitch + (size_t)(x + 1);
}

// Border texels of one level: the nearest inner texel of the neighbouring face.
static void fill_border(const struct hg_cubemap *cube, uint32_t level)
{
    const int s = (int)(cube->size >> level);
    for (uint32_t face = 0; face < 6; face++)
        for (int i = 0; i < 4 * (s + 1); i++) {
            int side = i / (s + 1), k = i % (s + 1);
            int x = side == 0 ? k - 1 : side == 1 ? s : side == 2 ? s - k : -1;
            int y = side == 0 ? -1 : side == 1 ? k - 1 : side == 2 ? s : s - k;
            float d[3], u, v;
            hg_cubemap_direction(
                face, (2 * (float)x + 1) / (float)s - 1, (2 * (float)y + 1) / (float)s - 1, d);
            uint32_t other = cube_face(d, &u, &v);
            int ox = (int)hg_clampf((u + 1) * 0.5f * (float)s, 0, (float)s - 1);
            int oy = (int)hg_clampf((v + 1) * 0.5f * (float)s, 0, (float)s - 1);
            *texel(cube, level, face, x, y) = *texel(cube, level, other, ox, oy);
        }
}

static enum hg_status take_memory(struct hg_cubemap *cube)
{
    for (uint32_t l = 0; l < cube->levels; l++) {
        size_t pitch = (cube->size >> l) + 2, bytes;
        if (!hg_mul_size(6 * pitch * pitch, sizeof(hg_v4), &bytes))
            return HG_E_NOMEM;
        cube->faces[l] = hg_calloc_aligned(16, bytes);
        if (!cube->faces[l])
            return HG_E_NOMEM;
    }
    return HG_OK;
}

enum hg_status hg_cubemap_create(
    struct hg_cubemap *cube, const struct hg_image *image, uint32_t size, struct hg_jobs *jobs)
{
    *cube = (struct hg_cubemap){.size = size};
    while (cube->levels < HG_CUBEMAP_MAX_LEVELS && size >> cube->levels)
        cube->levels++;
    enum hg_status status = take_memory(cube);
    if (status) {
        hg_cubemap_finish(cube);
        return status;
    }
    // A face spans 90 degrees; its texels are 4 / pi wider in the middle than on average.
    uint32_t grid = (image->width + 2 * size - 1) / (2 * size);
    struct cube_fill fill = {cube, image, 0, grid < 1 ? 1 : grid > 8 ? 8 : grid};
    hg_jobs_for(jobs, (size_t)6 * (cube->size + 2), fill_row, &fill);
    hg_cubemap_shrink_from(cube, 0, jobs);
    return HG_OK;
}

void hg_cubemap_shrink_from(struct hg_cubemap *cube, uint32_t level, struct hg_jobs *jobs)
{
    struct cube_fill fill = {cube, NULL, level + 1, 0};
    fill_border(cube, level);
    for (; fill.level < cube->levels; fill.level++) {
        hg_jobs_for(jobs, 6, shrink_face, &fill);
        fill_border(cube, fill.level);
    }
}

hg_v4 *hg_cubemap_texel(
    const struct hg_cubemap *cube, uint32_t level, uint32_t face, uint32_t x, uint32_t y)
{
    return texel(cube, level, face, (int)x, (int)y);
}

float hg_cubemap_texel_solid_angle(uint32_t s, uint32_t x, uint32_t y)
{
    float u = (2 * (float)x + 1) / (float)s - 1, v = (2 * (float)y + 1) / (float)s - 1;
    float d2 = 1 + u * u + v * v;
    return 4 / ((float)s * (float)s * d2 * sqrtf(d2));
}

void hg_cubemap_finish(struct hg_cubemap *cube)
{
    for (uint32_t l = 0; l < HG_CUBEMAP_MAX_LEVELS; l++)
        hg_free(cube->faces[l]);
    *cube = (struct hg_cubemap){0};
}

static hg_v4 sample_level(
    const struct hg_cubemap *cube, uint32_t level, uint32_t face, float u, float v)
{
    const size_t s = cube->size >> level, pitch = s + 2;
    float x = (u + 1) * 0.5f * (float)s + 0.5f, y = (v + 1) * 0.5f * (float)s + 0.5f;
    int ix = (int)x, iy = (int)y;
    float fx = x - (float)ix, fy = y - (float)iy;
    const hg_v4 *p = cube->faces[level] + face * pitch * pitch + (size_t)iy * pitch + (size_t)ix;
    hg_v4 low = p[0] + (p[1] - p[0]) * fx, high = p[pitch] + (p[pitch + 1] - p[pitch]) * fx;
    return low + (high - low) * fy;
}

hg_v4 hg_cubemap_sample(const struct hg_cubemap *cube, const float dir[3], float lod)
{
    float u, v, last = (float)(cube->levels - 1);
    uint32_t face = cube_face(dir, &u, &v);
    lod = hg_clampf(lod, 0, last);
    uint32_t level = (uint32_t)lod;
    float f = lod - (float)level;
    hg_v4 a = sample_level(cube, level, face, u, v);
    if (f <= 0)
        return a;
    return a + (sample_level(cube, level + 1, face, u, v) - a) * f;
}
