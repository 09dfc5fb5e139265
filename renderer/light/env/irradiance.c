#include "renderer/light/env/irradiance.h"

#include "base/alloc.h"
#include "renderer/math/vec.h"

#define CELLS_X 64
#define CELLS_Y 32
#define CELLS   (CELLS_X * CELLS_Y)

// Integral of radiance times direction over each cell, per channel, as planes of [CELLS].
struct moments {
    float v[3][3][CELLS]; // channel, axis
};

struct gather {
    const struct hg_image *image;
    struct moments *moments;
    struct hg_vec4 *out;
};

static void gather_texel(const struct hg_image *image, uint32_t x, uint32_t y, double sum[3][3])
{
    const float *p = (const float *)image->pixels + ((size_t)y * image->width + x) * 4;
    double top = HG_PI * (0.5 - (double)y / image->height);
    double low = HG_PI * (0.5 - (double)(y + 1) / image->height);
    double step = 2 * HG_PI / image->width, phi = ((double)x + 0.5) * step - HG_PI;
    // Exact moments of the texel: cos^2 over latitude for x and z, sin cos for y; over longitude
    // the chord sin(step / 2) / (step / 2).
    double wide = 0.5 * (top - low) + 0.25 * (sin(2 * top) - sin(2 * low));
    double chord = 2 * sin(step / 2);
    double d[3] = {wide * chord * cos(phi),
        0.5 * (sin(top) * sin(top) - sin(low) * sin(low)) * step, wide * chord * sin(phi)};
    for (int c = 0; c < 3; c++)
        for (int a = 0; a < 3; a++)
            sum[c][a] += (double)p[c] * d[a];
}

static void gather_cells(void *user, size_t row)
{
    const struct gather *g = user;
    const struct hg_image *image = g->image;
    for (uint32_t i = 0; i < CELLS_X; i++) {
        double sum[3][3] = {{0}};
        // Cells of images smaller than the grid hold no texel or one.
        uint32_t x0 = i * image->width / CELLS_X, x1 = (i + 1) * image->width / CELLS_X;
        uint32_t y0 = (uint32_t)row * image->height / CELLS_Y;
        uint32_t y1 = ((uint32_t)row + 1) * image->height / CELLS_Y;
        for (uint32_t y = y0; y < y1; y++)
            for (uint32_t x = x0; x < x1; x++)
                gather_texel(image, x, y, sum);
        for (int c = 0; c < 3; c++)
            for (int a = 0; a < 3; a++)
                g->moments->v[c][a][row * CELLS_X + i] = (float)sum[c][a];
    }
}

// Cell moments against a normal: eight partial sums keep the order fixed and the loop wide.
static float clamped_sum(
    const float x[CELLS], const float y[CELLS], const float z[CELLS], const float n[3])
{
    float part[8] = {0}, sum = 0;
    for (size_t i = 0; i < CELLS; i += 8)
        for (size_t k = 0; k < 8; k++) {
            float v = x[i + k] * n[0] + y[i + k] * n[1] + z[i + k] * n[2];
            part[k] += v > 0 ? v : 0;
        }
    for (size_t k = 0; k < 8; k++)
        sum += part[k];
    return sum;
}

// Octahedral square to direction; points past the edge fold over it.
static void octahedral_direction(float x, float y, float out[3])
{
    if (fabsf(x) > 1) {
        x = (x > 0 ? 2 : -2) - x;
        y = -y;
    }
    if (fabsf(y) > 1) {
        y = (y > 0 ? 2 : -2) - y;
        x = -x;
    }
    float h = 1 - fabsf(x) - fabsf(y);
    out[0] = h >= 0 ? x : (1 - fabsf(y)) * (x >= 0 ? 1.0f : -1.0f);
    out[2] = h >= 0 ? y : (1 - fabsf(x)) * (y >= 0 ? 1.0f : -1.0f);
    out[1] = h;
    hg_normalize3(out);
}

static void irradiance_row(void *user, size_t row)
{
    const struct gather *g = user;
    const size_t pitch = HG_IRRADIANCE_SIZE + 2;
    for (size_t i = 0; i < pitch; i++) {
        const float scale = 2.0f / HG_IRRADIANCE_SIZE;
        float n[3], e[3];
        octahedral_direction(((float)i - 0.5f) * scale - 1, ((float)row - 0.5f) * scale - 1, n);
        for (int c = 0; c < 3; c++)
            e[c] = clamped_sum(g->moments->v[c][0], g->moments->v[c][1], g->moments->v[c][2], n) *
                   (float)(1 / HG_PI);
        g->out[row * pitch + i] = (struct hg_vec4){e[0], e[1], e[2], 1};
    }
}

enum hg_status hg_irradiance_fill(
    const struct hg_image *image, struct hg_jobs *jobs, struct hg_vec4 *out)
{
    struct gather g = {image, hg_calloc(1, sizeof(struct moments)), out};
    if (!g.moments)
        return HG_E_NOMEM;
    hg_jobs_for(jobs, CELLS_Y, gather_cells, &g);
    hg_jobs_for(jobs, HG_IRRADIANCE_SIZE + 2, irradiance_row, &g);
    hg_free(g.moments);
    return HG_OK;
}
