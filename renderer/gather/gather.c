// gather.c - see gather.h. Its words are made in words.c.
#include "renderer/gather/film.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/simd.h"
#include "shaders/shared/gi.h"
#include "shaders/shared/path.h"

#define FINEST      16 // the widest step is at most this part of the picture's height, or 1 px,
#define FINEST_OF   4  // of so many samples; of more a smaller part,
#define FINEST_MOST 3  // down to this share of it
#define QUIET                                                                                      \
    0.01f // share of its light that a pixel's deviation is no more visible from; noisier
          // ones go on to the widest step of few samples
#define QUIET_SAMPLES 16u // and with more samples, as pictures then are so small that pixels differ
#define BLIND         2   // iterations that do not look at light: that of few samples is noise
#define SUNLIT_STEP   1   // the widest step of shares of directional lights, px
#define LAMPLIT_STEP  2   // of those of lamps
#define FEW_ASKED     2u  // times that, where less than one sample of a pixel asks for a lamp
#define ASKED_CELL    8u  // px
#define LAMP_PRIOR    0.02f
#define LAMP_FILLED   0.1f  // worth of a pixel that has its share of a lamp from others
#define STRIP         8     // rows that are filtered together
#define ENOUGH_ALBEDO 0.02f // of the brightest channel, from which on a pixel counts in full

// How far neighbours may differ.
#define NORMAL_SQUARINGS 3     // the cosine between normals to the power of 8
#define SLOPE_REACH      1.5f  // of what the depth's gradient explains
#define DEPTH_REACH      0.01f // of the depth itself, per px
#define ALIKE_COSINE     0.9f  // of pixels that tell each other's variance,
#define LIGHT_REACH      4.0f  // standard deviations of luminance
#define QUIET_REACH      2.5f  // beyond the widest step for so many samples
#define SUNLIT_REACH                                                                               \
    1.5f // those of shares of lights that many samples ask for: their edges are sharp
#define ROUGH_REACH 0.1f
#define LOBE_LEAST  0.03f // radians, what mirror directions of neighbours may differ by,
#define LOBE_SHARE  1.0f  // and half the squared share of alpha by which their normals may
#define ROUGH_PX    70.0f // px about a surface of roughness 1 that specular light may come from
#define GLASS_REACH 2.0f  // deviations of luminance, by way of glass

static const int colours[KINDS] = {WORTH, OPEN_RED, GREEN, GREEN}; // planes that are averaged

static size_t strips_of(const struct hg_gather *w)
{
    return (w->in.height + STRIP - 1) / STRIP;
}

// --- what the film has ---------------------------------------------------------------------------

static void set_guides(struct hg_gather *w, size_t at, float hits)
{
    const size_t pixels = hg_gather_pixels(w);
    const float *sums = w->in.sums, scale = 1 / hits;
    float along2 = 0;
    for (size_t c = 0; c < 3; c++) {
        const float n = sums[(HG_PATH_GUIDE_NORMAL + c) * pixels + at] * scale;
        w->guides[NORMAL_X + c][at] = n;
        along2 += n * n;
    }
    w->guides[ALONG][at] = fminf(sqrtf(along2), 1);
    w->guides[DEPTH][at] = expf(sums[HG_PATH_GUIDE_DEPTH * pixels + at] * scale);
    const float marked = sums[HG_PATH_GUIDE_ROUGHNESS * pixels + at];
    const float cloth = floorf(marked / HG_PATH_GUIDE_CLOTH); // samples that met some
    w->guides[CLOTH][at] = 2 * cloth >= hits ? 1.0f : 0.0f;
    w->guides[ROUGHNESS][at] = (marked - cloth * HG_PATH_GUIDE_CLOTH) * scale;
}

static void add3(const float *planes, size_t first, size_t pixels, size_t at, float out[3])
{
    for (size_t c = 0; c < 3; c++)
        out[c] += planes[(first + c) * pixels + at];
}

// What samples brought, and the variance of their mean: a quarter of the squared difference of the
// two halves' means.
static void set_light(struct hg_gather *w, int kind, size_t at)
{
    const struct hg_gather_input *in = &w->in;
    const size_t pixels = hg_gather_pixels(w);
    const size_t lobe = kind == SCATTERED ? HG_PATH_GUIDE_DIRECT : HG_PATH_GUIDE_SPECULAR;
    const size_t albedo_at = kind == SCATTERED ? HG_PATH_GUIDE_ALBEDO : HG_PATH_GUIDE_REFLECTION;
    const float first = (float)in->first_half, second = (float)(in->samples - in->first_half);
    float all[3] = {0}, half[3] = {0}, albedo[3] = {0}, worth = 0, differs[3] = {0};
    add3(in->sums, lobe, pixels, at, all);
    add3(in->halves, lobe, pixels, at, half);
    add3(in->sums, albedo_at, pixels, at, albedo);
    float open[3] = {0}, sky[3] = {0};
    // Cloth does not weigh light by the cosine alone, as the irradiance that shading knows does.
    if (kind == SCATTERED && w->guides[CLOTH][at] <= 0) {
        add3(in->sums, HG_PATH_GUIDE_OPEN_SKY, pixels, at, open);
        add3(in->sums, HG_PATH_GUIDE_SEEN_SKY, pixels, at, sky);
    }
    for (int c = 0; c < 3; c++) {
        const float a = fmaxf(albedo[c], LEAST_ALBEDO * (float)in->samples);
        const float mean = a / (float)in->samples;
        w->from[kind][RED + c][at] = all[c] / a;
        sky[c] /= a;
        if (kind == SCATTERED)
            w->from[kind][OPEN_RED + c][at] = open[c] / a;
        if (first > 0 && second > 0)
            differs[c] = (half[c] / first - (all[c] - half[c]) / second) / mean;
        worth = fmaxf(worth, albedo[c] / (ENOUGH_ALBEDO * (float)in->samples));
    }
    const float d = hg_luminance(differs);
    if (kind == SCATTERED)
        w->from[kind][SKY][at] = hg_luminance(sky);
    w->from[kind][WORTH][at] = fminf(worth, 1);
    w->from[kind][VARIANCE][at] = 0.25f * d * d;
}

// Of pixels with one sample: half the mean squared difference from the pixels next to it that show
// much the same surface.
static float variance_beside(const struct hg_gather *w, int kind, size_t x, size_t y)
{
    const size_t width = w->in.width, at = y * width + x;
    const size_t beside[4] = {x > 0 ? at - 1 : at, x + 1 < width ? at + 1 : at,
        y > 0 ? at - width : at, y + 1 < w->in.height ? at + width : at};
    float *const *g = w->guides, *const *light = w->from[kind];
    const float own[3] = {light[RED][at], light[GREEN][at], light[BLUE][at]};
    float sum = 0, count = 1e-6f;
    for (int i = 0; i < 4; i++) {
        const size_t q = beside[i];
        const float cosine = g[NORMAL_X][at] * g[NORMAL_X][q] + g[NORMAL_Y][at] * g[NORMAL_Y][q] +
                             g[NORMAL_Z][at] * g[NORMAL_Z][q];
        const float c[3] = {light[RED][q], light[GREEN][q], light[BLUE][q]};
        if (q == at || cosine < ALIKE_COSINE ||
            fabsf(g[DEPTH][q] - g[DEPTH][at]) > ALIKE_DEPTH * g[DEPTH][at])
            continue;
        const float d = hg_luminance(c) - hg_luminance(own);
        sum += d * d;
        count += 1;
    }
    return 0.5f * sum / count;
}

// Share of directional lights that is seen. Nothing is known where none is faced: such pixels count
// for no other.
static void set_sun(struct hg_gather *w, size_t at)
{
    const size_t open_at = HG_PATH_GUIDE_OPEN_SUN * hg_gather_pixels(w) + at;
    const size_t seen_at = HG_PATH_GUIDE_SEEN_SUN * hg_gather_pixels(w) + at;
    const float open = w->in.sums[open_at], seen = w->in.sums[seen_at];
    const float half_open = w->in.halves[open_at], half_seen = w->in.halves[seen_at];
    if (!(open > 0))
        return;
    const float rest = fmaxf(open - half_open, 0);
    const float first = half_seen / fmaxf(half_open, 1e-6f * open);
    const float second = fmaxf(seen - half_seen, 0) / fmaxf(rest, 1e-6f * open);
    const float d = fminf(first, 1) - fminf(second, 1);
    w->from[SUNLIT][RED][at] = fminf(seen / open, 1);
    w->from[SUNLIT][WORTH][at] = 1;
    w->from[SUNLIT][VARIANCE][at] = 0.25f * d * d;
}

// Share of the lamps of a number that is seen, of the samples that asked. Light either arrives or
// does not: with LAMP_PRIOR of a sample of each before (a beta distribution) few that agree are
// believed nearly as much as many, so that edges stay hard. Pixels of which none asked believe any,
// and count little once they have a share from others: of many lamps each is asked for by few.
static void set_lamp(struct hg_gather *w, size_t at)
{
    const float packed = w->in.lamps[w->lamp * hg_gather_pixels(w) + at];
    const float seen = floorf(packed / HG_PATH_LAMP_SEEN) / 16;
    const float asked = packed - seen * (16 * HG_PATH_LAMP_SEEN);
    const float a = seen + LAMP_PRIOR, b = asked - seen + LAMP_PRIOR, both = a + b;
    w->from[LAMPLIT][RED][at] = asked > 0 ? fminf(seen / asked, 1) : LAMP_UNKNOWN;
    w->from[LAMPLIT][WORTH][at] = asked > 0 ? 1 : 0;
    w->from[LAMPLIT][VARIANCE][at] = a * b / (both * both * (both + 1));
}

static void lamp_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    for (size_t at = y * w->in.width; at < (y + 1) * (size_t)w->in.width; at++)
        set_lamp(w, at);
}

// Samples of a pixel that asked for the lamps of this number, in the mean over the cells in which
// some did. 0: there are none, or none reaches anything.
static float asked_per_pixel(const struct hg_gather *w)
{
    const float *packed = w->in.lamps + w->lamp * hg_gather_pixels(w);
    double asked = 0, pixels = 0;
    for (uint32_t top = 0; top < w->in.height && w->lamp < w->in.lamp_count; top += ASKED_CELL)
        for (uint32_t left = 0; left < w->in.width; left += ASKED_CELL) {
            double here = 0, count = 0;
            for (uint32_t y = top; y < top + ASKED_CELL && y < w->in.height; y++)
                for (uint32_t x = left; x < left + ASKED_CELL && x < w->in.width; x++) {
                    const size_t at = (size_t)y * w->in.width + x;
                    const float seen = floorf(packed[at] / HG_PATH_LAMP_SEEN);
                    here += (double)(packed[at] - seen * HG_PATH_LAMP_SEEN);
                    count += w->guides[DEPTH][at] > 0 ? 1 : 0;
                }
            asked += here;
            pixels += here > 0 ? count : 0;
        }
    return pixels > 0 ? (float)(asked / pixels) : 0;
}

static void load_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    const size_t width = w->in.width, pixels = hg_gather_pixels(w);
    for (size_t at = y * width; at < (y + 1) * width; at++) {
        const float hits = w->in.sums[HG_PATH_GUIDE_HITS * pixels + at];
        if (!(hits > 0)) // planes are zero
            continue;
        set_guides(w, at, hits);
        set_light(w, SCATTERED, at);
        set_light(w, MIRRORED, at);
        set_sun(w, at);
    }
}

static void set_variances_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    for (size_t x = 0; x < w->in.width; x++)
        for (int kind = SCATTERED; kind <= MIRRORED; kind++)
            w->from[kind][VARIANCE][y * w->in.width + x] = variance_beside(w, kind, x, y);
}

// The smaller of the two one-sided differences; 0 next to nothing.
static float slope(const float *z, size_t at, ptrdiff_t by, bool before, bool after)
{
    const float here = z[at];
    const float back =
        before && z[(ptrdiff_t)at - by] > 0 ? here - z[(ptrdiff_t)at - by] : INFINITY;
    const float on = after && z[(ptrdiff_t)at + by] > 0 ? z[(ptrdiff_t)at + by] - here : INFINITY;
    const float least = fabsf(back) < fabsf(on) ? back : on;
    return here > 0 && isfinite(least) ? least : 0;
}

#define ABOUT 3 // px around a pixel whose variances are averaged, at most

// Of each pixel of a row the mean of the variances around it, by sums of columns.
static void set_variance_about(struct hg_gather *w, int kind, size_t y, size_t reach)
{
    const size_t width = w->in.width, side = 2 * reach + 1;
    const size_t y0 = y > reach ? y - reach : 0;
    const size_t y1 = y + reach < w->in.height ? y + reach + 1 : w->in.height;
    float sums[2 * ABOUT + 1] = {0}, counts[2 * ABOUT + 1] = {0}; // of the newest columns
    for (size_t u = 0; u < width + reach; u++) {
        float column = 0, count = 0;
        for (size_t v = y0; u < width && v < y1; v++) {
            column += w->from[kind][VARIANCE][v * width + u];
            count += w->guides[DEPTH][v * width + u] > 0 ? 1.0f : 0.0f;
        }
        sums[u % side] = column;
        counts[u % side] = count;
        if (u < reach)
            continue;
        column = 0;
        count = 1e-6f;
        for (size_t i = 0; i < side; i++) {
            column += sums[i];
            count += counts[i];
        }
        w->to[kind][VARIANCE][y * width + u - reach] = column / count;
    }
}

// Slopes, and variances that are means over 7 x 7 px, as those of single pixels are noise
// themselves; penumbrae are narrow.
static void prepare_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    const size_t width = w->in.width, height = w->in.height;
    for (size_t x = 0; x < width; x++) {
        const size_t at = y * width + x;
        w->guides[SLOPE_X][at] = slope(w->guides[DEPTH], at, 1, x > 0, x + 1 < width);
        w->guides[SLOPE_Y][at] =
            slope(w->guides[DEPTH], at, (ptrdiff_t)width, y > 0, y + 1 < height);
    }
    for (int kind = 0; kind < LAMPLIT; kind++)
        set_variance_about(w, kind, y, kind == SUNLIT ? 1 : ABOUT);
}

// --- one iteration -------------------------------------------------------------------------------

// Sums of one row.
struct row {
    float *restrict sums[LIGHT_PLANES]; // WORTH: of weights
    float *restrict weights;            // of one tap
};

struct tap {
    ptrdiff_t to;     // from a pixel to its neighbour
    float dx, dy, px; // px
    float kernel;
};

static inline float approach_zero(float x) // about exp(-x); 0 from x = 4 on
{
    const float y = 1 - (x < 4 ? x : 4) * 0.25f, y2 = y * y;
    return y2 * y2;
}

// What one neighbour of each pixel [begin, end) is worth to it; indices begin at the first pixel of
// a row. lobe, looks (at light): constants of the caller, which a loop without them is for.
enum lobe { NO_LOBE, MIRRORS, TRANSMITS };
__attribute__((always_inline)) static inline void weigh(const struct hg_gather *w, size_t row,
    size_t begin, size_t end, const struct tap *tap, const struct row *out, enum lobe lobe,
    bool looks)
{
    float *const *light = w->from[w->kind];
    const float *restrict nx = w->guides[NORMAL_X] + row, *restrict ny = w->guides[NORMAL_Y] + row;
    const float *restrict nz = w->guides[NORMAL_Z] + row, *restrict z = w->guides[DEPTH] + row;
    const float *restrict along = w->guides[ALONG] + row;
    const float *restrict zx = w->guides[SLOPE_X] + row, *restrict zy = w->guides[SLOPE_Y] + row;
    const float *restrict rough = w->guides[ROUGHNESS] + row;
    const float *restrict cloth = w->guides[CLOTH] + row;
    const float *restrict r = light[RED] + row, *restrict g = light[GREEN] + row;
    const float *restrict b = light[BLUE] + row, *restrict worth = light[WORTH] + row;
    const float *restrict variance = light[VARIANCE] + row;
    float *restrict sw = out->sums[WORTH], *restrict sv = out->sums[VARIANCE];
    float *restrict weights = out->weights;
    const ptrdiff_t to = tap->to;
    const float dx = tap->dx, dy = tap->dy, px = tap->px, kernel = tap->kernel;
    const bool sharp = w->kind == SUNLIT || (w->kind == LAMPLIT && w->lamp_asked >= 1);
    const bool gradual = w->kind == SCATTERED && w->step > w->widest;
    const float deviations = w->glass_px > 0 ? GLASS_REACH
                             : sharp         ? SUNLIT_REACH
                             : gradual       ? QUIET_REACH
                                             : LIGHT_REACH;
    const float glass_px = w->glass_px;
    HG_SIMD_APART
    for (ptrdiff_t x = (ptrdiff_t)begin; x < (ptrdiff_t)end; x++) {
        const ptrdiff_t q = x + to;
        // Means of few normals of leaves or bumps differ, however alike the surfaces are.
        const float unsure = 1 - along[x] * along[q];
        const float cosine = nx[x] * nx[q] + ny[x] * ny[q] + nz[x] * nz[q] + unsure;
        float n = cosine > 0 ? cosine : 0;
        for (int i = 0; i < NORMAL_SQUARINGS; i++)
            n *= n;
        const float plane = z[x] + zx[x] * dx + zy[x] * dy;
        const float apart = fabsf(z[q] - plane);
        const float may = SLOPE_REACH * (fabsf(zx[x] * dx) + fabsf(zy[x] * dy)) * 0.25f +
                          DEPTH_REACH * px * z[x] + 1e-6f;
        const float same = 1 - fabsf(cloth[x] - cloth[q]);
        float weight = kernel * n * approach_zero(apart / may) * same * worth[q];
        if (looks) {
            const float lx = 0.2126f * r[x] + 0.7152f * g[x] + 0.0722f * b[x];
            const float lq = 0.2126f * r[q] + 0.7152f * g[q] + 0.0722f * b[q];
            const float deviation =
                deviations * sqrtf(variance[x] + variance[q]) + 1e-2f * lx + 1e-7f;
            weight *= approach_zero(fabsf(lx - lq) / deviation);
        }
        if (lobe != NO_LOBE) {
            const float reach = lobe == TRANSMITS ? px / (glass_px * rough[x] * rough[x] + 0.1f)
                                                  : px / (ROUGH_PX * rough[x] + 0.1f);
            const float other = fabsf(rough[x] - rough[q]) * (1 / ROUGH_REACH);
            const float width = rough[x] * rough[x] + LOBE_LEAST;
            const float bend = (1 - cosine) / (LOBE_SHARE * width * width);
            weight *= approach_zero(2 * reach) * approach_zero(2 * other) * approach_zero(bend);
        }
        weights[x] = weight;
        sw[x] += weight;
        sv[x] += weight * weight * variance[q];
    }
}

#define WEIGH(name, lobe, looks)                                                                   \
    HG_SIMD_LOOP static void name(const struct hg_gather *w, size_t row, size_t begin, size_t end, \
        const struct tap *tap, const struct row *out)                                              \
    {                                                                                              \
        weigh(w, row, begin, end, tap, out, lobe, looks);                                          \
    }
WEIGH(weigh_scattered, NO_LOBE, false)
WEIGH(weigh_scattered_light, NO_LOBE, true)
WEIGH(weigh_mirrored, MIRRORS, false)
WEIGH(weigh_mirrored_light, MIRRORS, true)
WEIGH(weigh_glass, TRANSMITS, false)
WEIGH(weigh_glass_light, TRANSMITS, true)

static void weigh_tap(const struct hg_gather *w, size_t row, size_t begin, size_t end,
    const struct tap *tap, const struct row *out)
{
    const bool looks = w->kind >= SUNLIT || w->step >> BLIND > 0;
    if (w->kind == MIRRORED && w->glass_px > 0)
        (looks ? weigh_glass_light : weigh_glass)(w, row, begin, end, tap, out);
    else if (w->kind == MIRRORED)
        (looks ? weigh_mirrored_light : weigh_mirrored)(w, row, begin, end, tap, out);
    else
        (looks ? weigh_scattered_light : weigh_scattered)(w, row, begin, end, tap, out);
}

HG_SIMD_LOOP static void add_weighted(float *restrict sums, const float *restrict weights,
    const float *from, size_t begin, size_t end)
{
    for (size_t x = begin; x < end; x++)
        sums[x] += weights[x] * from[x];
}

// Beyond the widest step for so many samples only what is noisy still takes from others.
HG_SIMD_LOOP static void hold_back_row(
    const struct hg_gather *w, size_t row, size_t width, const struct row *sums)
{
    float *const *light = w->from[w->kind];
    const float *restrict r = light[RED] + row, *restrict g = light[GREEN] + row;
    const float *restrict b = light[BLUE] + row, *restrict variance = light[VARIANCE] + row;
    float *restrict own = sums->weights;
    for (size_t x = 0; x < width; x++) {
        const float luminance = 0.2126f * r[x] + 0.7152f * g[x] + 0.0722f * b[x];
        const float noise = sqrtf(variance[x]) / (QUIET * luminance + 1e-12f) - 1;
        const float more = noise > 0 ? noise < 1 ? noise : 1 : 0;
        own[x] = 1 - more;
    }
    for (int c = RED; c < colours[w->kind]; c++) {
        const float *restrict before = light[c] + row;
        float *restrict to = w->to[w->kind][c] + row;
        for (size_t x = 0; x < width; x++)
            to[x] += own[x] * (before[x] - to[x]);
    }
    float *restrict to = w->to[w->kind][VARIANCE] + row;
    for (size_t x = 0; x < width; x++)
        to[x] += own[x] * (variance[x] - to[x]);
}

HG_SIMD_LOOP static void finish_row(
    const struct hg_gather *w, size_t row, size_t width, const struct row *sums)
{
    float *const *light = w->from[w->kind];
    float *const *to = w->to[w->kind];
    const float filled = w->kind == LAMPLIT ? LAMP_FILLED : 0;
    for (size_t x = 0; x < width; x++) {
        const float weight = sums->sums[WORTH][x];
        const float scale = weight > 1e-12f ? 1 / weight : 0, keep = weight > 1e-12f ? 0.0f : 1.0f;
        for (int c = RED; c < colours[w->kind]; c++)
            to[c][row + x] = sums->sums[c][x] * scale + keep * light[c][row + x];
        to[WORTH][row + x] = fmaxf(light[WORTH][row + x], filled * (1 - keep));
        to[VARIANCE][row + x] =
            sums->sums[VARIANCE][x] * scale * scale + keep * light[VARIANCE][row + x];
    }
}

static void filter_row(const struct hg_gather *w, size_t y, const struct row *row)
{
    static const float kernel[2] = {0.5f, 0.25f}; // of a B-spline of three taps
    const size_t width = w->in.width, height = w->in.height, step = w->step;
    for (int plane = 0; plane < LIGHT_PLANES; plane++)
        memset(row->sums[plane], 0, width * sizeof(float));
    for (int j = -1; j <= 1; j++) {
        if ((j < 0 && y < step) || (j > 0 && y + step >= height))
            continue;
        for (int i = -1; i <= 1; i++) {
            const float dx = (float)i * (float)step, dy = (float)j * (float)step;
            const struct tap tap = {.to = (ptrdiff_t)step * (i + j * (ptrdiff_t)width),
                .dx = dx,
                .dy = dy,
                .px = sqrtf(dx * dx + dy * dy),
                .kernel = kernel[i != 0] * kernel[j != 0]};
            const size_t begin = i < 0 ? step : 0;
            const size_t end = i > 0 ? (width > step ? width - step : 0) : width;
            if (begin >= end)
                continue;
            weigh_tap(w, y * width, begin, end, &tap, row);
            for (int c = RED; c < colours[w->kind]; c++)
                add_weighted(row->sums[c], row->weights,
                    w->from[w->kind][c] + y * width + (size_t)tap.to, begin, end);
        }
    }
    finish_row(w, y * width, width, row);
    if (w->step > w->widest && w->kind == SCATTERED)
        hold_back_row(w, y * width, width, row);
}

static void filter_strip(void *user, size_t strip)
{
    struct hg_gather *w = user;
    const size_t width = w->in.width, height = w->in.height, first = strip * STRIP;
    struct row row;
    float *next = w->rows + strip * (LIGHT_PLANES + 1) * width;
    for (size_t p = 0; p < LIGHT_PLANES; p++, next += width)
        row.sums[p] = next;
    row.weights = next;
    for (size_t y = first; y < first + STRIP && y < height; y++)
        filter_row(w, y, &row);
}

// --- all of it -----------------------------------------------------------------------------------

static void swap_planes(struct hg_gather *w, int kind, int plane)
{
    float *other = w->from[kind][plane];
    w->from[kind][plane] = w->to[kind][plane];
    w->to[kind][plane] = other;
}

static uint32_t part_of_height(const struct hg_gather_input *in, uint32_t part)
{
    return in->height > part ? in->height / part : 1;
}

static uint32_t widest_step(const struct hg_gather_input *in)
{
    const uint32_t more = in->samples / FINEST_OF;
    const uint32_t part = FINEST * (more < 1 ? 1 : more < FINEST_MOST ? more : FINEST_MOST);
    return part_of_height(in, part);
}

void hg_gather_filter_kind(struct hg_gather *w, struct hg_jobs *jobs, int kind, uint32_t most)
{
    w->kind = kind;
    for (w->step = 1; w->step <= most; w->step *= 2) {
        hg_jobs_for(jobs, strips_of(w), filter_strip, w);
        for (int plane = 0; plane < LIGHT_PLANES; plane++)
            swap_planes(w, kind, plane);
    }
}

static void filter(struct hg_gather *w, struct hg_jobs *jobs)
{
    const size_t height = w->in.height;
    const uint32_t widest = widest_step(&w->in);
    const uint32_t noisy = w->in.samples > QUIET_SAMPLES ? widest : part_of_height(&w->in, FINEST);
    w->widest = widest;
    for (int kind = 0; kind < LAMPLIT; kind++) {
        hg_gather_filter_kind(w, jobs, kind,
            kind == SUNLIT      ? SUNLIT_STEP
            : kind == SCATTERED ? noisy
                                : widest);
    }
    for (w->lamp = 0; w->lamp < HG_GATHERED_LAMPS && w->in.lamps != NULL; w->lamp++) {
        w->lamp_asked = asked_per_pixel(w);
        if (w->lamp_asked > 0) {
            hg_jobs_for(jobs, height, lamp_row, w);
            hg_gather_filter_kind(
                w, jobs, LAMPLIT, w->lamp_asked < 1 ? FEW_ASKED * LAMPLIT_STEP : LAMPLIT_STEP);
        }
        hg_jobs_for(jobs, height, hg_gather_pack_lamp_row, w);
    }
    hg_jobs_for(jobs, height, hg_gather_part_row, w);
    hg_jobs_for(jobs, height, hg_gather_despeckle_row, w);
    hg_jobs_for(jobs, height, hg_gather_pack_row, w);
}

// Gives the planes of light their places in memory; without it says how much they take.
static size_t lay_out(const struct hg_gather *w, float *memory, float *planes[KINDS][LIGHT_PLANES])
{
    size_t count = 0;
    const int kinds = w->in.lamps != NULL ? KINDS : LAMPLIT;
    for (int kind = 0; kind < kinds; kind++)
        for (int plane = 0; plane < LIGHT_PLANES; plane++) {
            if (plane >= colours[kind] && plane < WORTH) {
                if (memory != NULL && kind >= SUNLIT && plane <= BLUE) // luminance is the share
                    planes[kind][plane] = planes[kind][RED];
                continue;
            }
            if (memory != NULL)
                planes[kind][plane] = memory + count * hg_gather_pixels(w);
            count++;
        }
    return count * hg_gather_pixels(w);
}

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "gathered light", NULL, "out of host memory");
}

enum hg_status hg_gather_load(struct hg_jobs *jobs, const struct hg_gather_input *input,
    struct hg_gather **out, struct hg_error *err)
{
    struct hg_gather *w = hg_calloc(1, sizeof *w);
    *out = w;
    if (w == NULL)
        return no_memory(err);
    w->in = *input;
    const size_t pixels = hg_gather_pixels(w), light = lay_out(w, NULL, NULL);
    const size_t lamps = input->lamps != NULL ? input->lamp_count * pixels : 0;
    w->loaded = hg_calloc(GUIDES * pixels + light + lamps, sizeof *w->loaded);
    if (w->loaded == NULL) {
        hg_gather_free(w);
        *out = NULL;
        return no_memory(err);
    }
    for (size_t i = 0; i < GUIDES; i++)
        w->guides[i] = w->loaded + i * pixels;
    lay_out(w, w->loaded + GUIDES * pixels, w->from);
    hg_jobs_for(jobs, input->height, load_row, w);
    if (input->samples == 1)
        hg_jobs_for(jobs, input->height, set_variances_row, w);
    w->in.sums = w->in.halves = NULL;
    if (lamps > 0) {
        float *own = w->loaded + GUIDES * pixels + light;
        memcpy(own, input->lamps, lamps * sizeof *own);
        w->in.lamps = own;
    }
    return HG_OK;
}

enum hg_status hg_gather_prepare(struct hg_gather *w, struct hg_jobs *jobs, struct hg_error *err)
{
    const size_t light = lay_out(w, NULL, NULL);
    const size_t rows = strips_of(w) * (LIGHT_PLANES + 1) * w->in.width;
    w->more = hg_calloc(light + rows, sizeof *w->more);
    if (w->more == NULL)
        return no_memory(err);
    lay_out(w, w->more, w->to);
    w->rows = w->more + light;
    hg_jobs_for(jobs, w->in.height, prepare_row, w);
    for (int kind = 0; kind < LAMPLIT; kind++)
        swap_planes(w, kind, VARIANCE);
    return HG_OK;
}

enum hg_status hg_gather_filter(
    struct hg_gather *w, struct hg_jobs *jobs, uint32_t *words, struct hg_error *err)
{
    const enum hg_status status = hg_gather_prepare(w, jobs, err);
    if (status != HG_OK)
        return status;
    w->out = words;
    filter(w, jobs);
    return HG_OK;
}

uint32_t hg_gather_rows(uint32_t height, bool lamps)
{
    return lamps ? 2 * height : height;
}

void hg_gather_free(struct hg_gather *w)
{
    if (w == NULL)
        return;
    hg_free(w->loaded);
    hg_free(w->more);
    hg_free(w);
}
