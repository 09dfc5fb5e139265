#include "renderer/scene/demo/demo_textures.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

// ---- noise -------------------------------------------------------------------------------------

static uint32_t hash2(uint32_t x, uint32_t y, uint32_t seed)
{
    uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ seed * 0xc2b2ae3du;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 12;
    h *= 0x297a2d39u;
    return h ^ h >> 15;
}

static float random2(uint32_t x, uint32_t y, uint32_t seed)
{
    return (float)(hash2(x, y, seed) >> 8) * (1.0f / 16777216.0f);
}

static float smooth(float t)
{
    return t * t * (3 - 2 * t);
}

static float mix(float a, float b, float t)
{
    return a + (b - a) * t;
}

static float step(float low, float high, float v)
{
    float t = (v - low) / (high - low);
    return smooth(t < 0 ? 0 : t > 1 ? 1 : t);
}

// Value noise over 0..1 that repeats, with `cells` cells a side.
static float noise(float u, float v, uint32_t cells, uint32_t seed)
{
    float x = (u - floorf(u)) * (float)cells, y = (v - floorf(v)) * (float)cells;
    uint32_t x0 = (uint32_t)x % cells, y0 = (uint32_t)y % cells;
    uint32_t x1 = (x0 + 1) % cells, y1 = (y0 + 1) % cells;
    float fx = smooth(x - floorf(x)), fy = smooth(y - floorf(y));
    return mix(mix(random2(x0, y0, seed), random2(x1, y0, seed), fx),
        mix(random2(x0, y1, seed), random2(x1, y1, seed), fx), fy);
}

static float fractal(float u, float v, uint32_t cells, int octaves, uint32_t seed)
{
    float sum = 0, weight = 0.5f;
    for (int o = 0; o < octaves; o++, weight *= 0.5f)
        sum += weight * noise(u, v, cells << o, seed + (uint32_t)o);
    return sum / (1 - powf(0.5f, (float)octaves));
}

// ---- patterns: what a surface is like at (u, v) in 0..1 -----------------------------------------

struct surface {
    float color[3]; // sRGB 0..1
    float height;   // in texture widths
    float occlusion, roughness, metallic;
};

static void set_color(struct surface *s, float r, float g, float b, float gain)
{
    s->color[0] = r * gain;
    s->color[1] = g * gain;
    s->color[2] = b * gain;
}

static void blend_color(struct surface *s, const float c[3], float t)
{
    for (int i = 0; i < 3; i++)
        s->color[i] = mix(s->color[i], c[i], t);
}

// Distance to the edge of a unit cell.
static float cell_edge(float x, float y)
{
    float fx = x - floorf(x), fy = y - floorf(y);
    return fminf(fminf(fx, 1 - fx), fminf(fy, 1 - fy));
}

// Four large slabs with small slate squares set diagonally where their corners meet.
static void tiles(float u, float v, struct surface *s)
{
    float x = u * 4, y = v * 4;
    float cx = x - floorf(x + 0.5f), cy = y - floorf(y + 0.5f);
    float inset = 0.19f - (fabsf(cx) + fabsf(cy));
    bool slate = inset > 0;
    float edge = slate ? inset * 0.7f : fminf(cell_edge(x, y), -inset * 0.7f);
    uint32_t tx = (uint32_t)floorf(slate ? x + 0.5f : x) % 4;
    uint32_t ty = (uint32_t)floorf(slate ? y + 0.5f : y) % 4;
    float tint = random2(tx, ty, slate ? 11 : 7);
    float grain = fractal(u + tint, v + tint * 3, 24, 4, 3);
    float stain = fractal(u, v, 5, 3, 19);
    float gain = 0.86f + 0.1f * tint + 0.14f * (grain - 0.5f) - 0.10f * stain;
    if (slate)
        set_color(s, 0.27f, 0.30f, 0.33f, gain);
    else
        set_color(s, 0.83f, 0.75f, 0.63f, gain);
    float joint = 1 - step(0.006f, 0.016f, edge);
    const float mortar[3] = {0.42f, 0.38f, 0.33f};
    blend_color(s, mortar, joint);
    s->height = 0.0035f * step(0, 0.03f, edge) + 0.0005f * grain;
    s->roughness = mix((slate ? 0.34f : 0.48f) + 0.25f * (stain - 0.4f), 0.9f, joint);
    s->occlusion = 1 - 0.5f * joint;
}

static void marble(float u, float v, struct surface *s)
{
    float warp = fractal(u, v, 4, 4, 31), warp2 = fractal(u, v, 3, 3, 47);
    float vein = fabsf(noise(u + 0.35f * warp, v + 0.3f * warp2, 5, 53) - 0.5f);
    float thin = fabsf(noise(u + 0.22f * warp2, v - 0.25f * warp, 9, 59) - 0.5f);
    float dark = 0.55f * (1 - step(0, 0.05f, vein)) + 0.3f * (1 - step(0, 0.025f, thin));
    float gain = 0.93f + 0.07f * warp;
    set_color(s, 0.90f, 0.87f, 0.82f, gain);
    const float blue[3] = {0.52f, 0.50f, 0.49f};
    blend_color(s, blue, dark * step(0.25f, 0.7f, warp2));
    s->height = 0.0002f * fractal(u, v, 40, 2, 61);
    s->roughness = 0.30f + 0.12f * warp + 0.08f * dark;
    s->occlusion = 1;
}

static void plaster(float u, float v, struct surface *s)
{
    float broad = fractal(u, v, 4, 4, 71), fine = fractal(u, v, 48, 3, 73);
    float trowel = fractal(u + 0.1f * broad, v * 2, 10, 3, 79);
    float gain = 0.90f + 0.16f * (broad - 0.5f) + 0.06f * (fine - 0.5f);
    set_color(s, 0.88f, 0.72f, 0.56f, gain);
    const float pale[3] = {0.90f, 0.80f, 0.68f};
    blend_color(s, pale, step(0.55f, 0.75f, broad) * 0.5f);
    s->height = 0.004f * trowel + 0.0012f * fine;
    s->roughness = 0.86f + 0.1f * (fine - 0.5f);
    s->occlusion = 0.92f + 0.08f * trowel;
}

static void cloth(float u, float v, struct surface *s)
{
    const float threads = 64;
    float x = u * threads, y = v * threads;
    bool over = ((uint32_t)x + (uint32_t)y) % 2 == 0; // warp on top
    float fx = x - floorf(x) - 0.5f, fy = y - floorf(y) - 0.5f;
    float across = over ? fx : fy, along = over ? fy : fx;
    float round = sqrtf(fmaxf(0, 1 - 3.2f * across * across));
    float bow = 1 - 1.6f * along * along;
    float fuzz = fractal(u, v, 128, 2, 83);
    float stripe = (float)((uint32_t)(u * 16) % 8);
    bool red = stripe < 3 || fabsf(stripe - 5) < 0.5f;
    float gain = 0.55f + 0.45f * round * bow + 0.15f * (fuzz - 0.5f);
    if (red)
        set_color(s, 0.60f, 0.13f, 0.11f, gain);
    else
        set_color(s, 0.88f, 0.80f, 0.66f, gain);
    if (!over && (uint32_t)(v * 16) % 8 == 2)
        set_color(s, 0.14f, 0.22f, 0.38f, gain);
    s->height = 0.005f * round * bow;
    s->roughness = 0.88f + 0.1f * (fuzz - 0.5f);
    s->occlusion = 0.55f + 0.45f * round;
}

static void brass(float u, float v, struct surface *s)
{
    float brush = noise(u, v * 0.999f, 4, 89) * 0.3f + noise(u * 1, v, 256, 97) * 0.7f;
    float age = step(0.52f, 0.74f, fractal(u, v, 6, 4, 101));
    set_color(s, 0.93f, 0.77f, 0.42f, 0.94f + 0.06f * brush);
    const float dull[3] = {0.50f, 0.36f, 0.18f};
    blend_color(s, dull, age * 0.55f);
    s->height = 0.0002f * brush;
    s->roughness = 0.20f + 0.06f * brush + 0.25f * age;
    s->metallic = 1;
    s->occlusion = 1;
}

static void water(float u, float v, struct surface *s)
{
    set_color(s, 0.10f, 0.17f, 0.18f, 1);
    float ring = 0;
    const float twice = 2 * (float)M_PI;
    ring += sinf(twice * (3 * u + 2 * v) + 2.0f * noise(u, v, 4, 103));
    ring += sinf(twice * (2 * u - 4 * v) + 3.0f * noise(u, v, 5, 107));
    ring += 0.6f * sinf(twice * (7 * u + 5 * v) + 4.0f * noise(u, v, 6, 109));
    s->height = 0.0011f * ring;
    s->roughness = 0.03f;
    s->occlusion = 1;
}

// Eight-pointed stars and crosses in cobalt on white, as on painted tiles.
static void glaze(float u, float v, struct surface *s)
{
    float x = u * 8, y = v * 4;
    float cx = x - floorf(x) - 0.5f, cy = y - floorf(y) - 0.5f;
    float square = fmaxf(fabsf(cx), fabsf(cy)), diamond = (fabsf(cx) + fabsf(cy)) * 0.7071f;
    float star = fminf(square, diamond), radius = hypotf(cx, cy);
    float pool = fractal(u, v, 12, 3, 113);
    set_color(s, 0.90f, 0.91f, 0.88f, 0.97f + 0.05f * (pool - 0.5f));
    const float cobalt[3] = {0.08f, 0.17f, 0.46f}, teal[3] = {0.10f, 0.42f, 0.44f};
    const float ochre[3] = {0.80f, 0.55f, 0.16f};
    float inside = 1 - step(0.335f, 0.345f, star), line = 1 - step(0.285f, 0.295f, star);
    blend_color(s, cobalt, inside - 0.85f * line + 0.5f * line * pool);
    blend_color(s, teal, 1 - step(0.19f, 0.20f, radius));
    blend_color(s, ochre, 1 - step(0.08f, 0.09f, radius));
    s->height = 0.0006f * inside + 0.0008f * pool;
    s->roughness = 0.08f + 0.10f * pool;
    s->occlusion = 1;
}

static void wood(float u, float v, struct surface *s)
{
    uint32_t board = (uint32_t)(u * 4);
    float shift = random2(board, 0, 127);
    float fx = u * 4 - (float)board, edge = fminf(fx, 1 - fx);
    float warp = noise(u, v + shift, 6, 131);
    float ring = sinf((u * 90 + 4 * warp + 3 * noise(u * 1, v + shift, 3, 137)) * 2);
    float pore = noise(u, v, 512, 139) * noise(u, v + shift, 8, 149);
    float gain = 0.85f + 0.12f * ring * 0.5f + 0.12f * (shift - 0.5f) - 0.15f * pore;
    set_color(s, 0.47f, 0.31f, 0.19f, gain);
    float joint = 1 - step(0.004f, 0.02f, edge);
    const float gap[3] = {0.10f, 0.07f, 0.05f};
    blend_color(s, gap, joint);
    s->height = 0.003f * step(0, 0.03f, edge) + 0.0005f * ring - 0.0006f * pore;
    s->roughness = 0.55f + 0.15f * pore;
    s->occlusion = 1 - 0.6f * joint;
}

typedef void pattern_fn(float u, float v, struct surface *s);

static const struct {
    pattern_fn *draw;
    uint32_t size;
} patterns[HG_DEMO_PATTERNS] = {
    [HG_DEMO_TILES] = {tiles, 1024},
    [HG_DEMO_MARBLE] = {marble, 512},
    [HG_DEMO_PLASTER] = {plaster, 512},
    [HG_DEMO_CLOTH] = {cloth, 512},
    [HG_DEMO_BRASS] = {brass, 512},
    [HG_DEMO_WATER] = {water, 512},
    [HG_DEMO_GLAZE] = {glaze, 512},
    [HG_DEMO_WOOD] = {wood, 512},
};

// ---- drawing -----------------------------------------------------------------------------------

struct drawing {
    pattern_fn *draw;
    uint32_t size;
    float *height; // [size * size]
    struct hg_demo_set *set;
};

static uint8_t to_byte(float v)
{
    return (uint8_t)((v < 0 ? 0 : v > 1 ? 1 : v) * 255 + 0.5f);
}

static void draw_row(void *user, size_t y)
{
    const struct drawing *d = user;
    float inverse = 1.0f / (float)d->size;
    for (uint32_t x = 0; x < d->size; x++) {
        struct surface s = {0};
        size_t i = y * d->size + x;
        d->draw(((float)x + 0.5f) * inverse, ((float)y + 0.5f) * inverse, &s);
        uint8_t *color = (uint8_t *)d->set->color.pixels + i * 4;
        uint8_t *orm = (uint8_t *)d->set->orm.pixels + i * 4;
        for (int c = 0; c < 3; c++)
            color[c] = to_byte(s.color[c]);
        orm[0] = to_byte(s.occlusion);
        orm[1] = to_byte(s.roughness);
        orm[2] = to_byte(s.metallic);
        color[3] = orm[3] = 255;
        d->height[i] = s.height;
    }
}

static void normal_row(void *user, size_t y)
{
    const struct drawing *d = user;
    uint32_t n = d->size;
    const float *up = d->height + (y + n - 1) % n * n, *down = d->height + (y + 1) % n * n;
    const float *row = d->height + y * n;
    for (uint32_t x = 0; x < n; x++) {
        float dx = (row[(x + 1) % n] - row[(x + n - 1) % n]) * (float)n / 2;
        float dy = (up[x] - down[x]) * (float)n / 2; // +Y is up, rows go down
        float scale = 1 / sqrtf(dx * dx + dy * dy + 1);
        uint8_t *out = (uint8_t *)d->set->normal.pixels + (y * n + x) * 4;
        out[0] = to_byte(0.5f - 0.5f * dx * scale);
        out[1] = to_byte(0.5f - 0.5f * dy * scale);
        out[2] = to_byte(0.5f + 0.5f * scale);
        out[3] = 255;
    }
}

static void for_rows(struct hg_jobs *jobs, size_t rows, hg_jobs_fn *fn, void *user)
{
    if (jobs)
        hg_jobs_for(jobs, rows, fn, user);
    else
        for (size_t y = 0; y < rows; y++)
            fn(user, y);
}

enum hg_status hg_demo_draw(
    enum hg_demo_pattern pattern, struct hg_jobs *jobs, struct hg_demo_set *out)
{
    memset(out, 0, sizeof *out);
    uint32_t size = patterns[pattern].size;
    struct drawing d = {.draw = patterns[pattern].draw, .size = size, .set = out};
    d.height = hg_calloc((size_t)size * size, sizeof *d.height);
    enum hg_status status = d.height ? HG_OK : HG_E_NOMEM;
    struct hg_image *images[] = {&out->color, &out->normal, &out->orm};
    for (int i = 0; !status && i < 3; i++)
        status = hg_image_create(size, size, HG_PIXEL_RGBA8, NULL, images[i]);
    if (!status) {
        for_rows(jobs, size, draw_row, &d);
        for_rows(jobs, size, normal_row, &d);
    }
    hg_free(d.height);
    return status;
}
