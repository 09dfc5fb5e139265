// exposure.c - see exposure.h.
#include "renderer/camera/exposure.h"

#include <math.h>
#include <string.h>

// Of the bright part of a picture: the light of what is lit.
#define LOW_PERCENTILE  0.6
#define HIGH_PERCENTILE 0.95
// What is so many stops darker than this percentile is in shadow, and not lit.
#define KEY_PERCENTILE 0.98
#define SHADOW_STOPS   6.0
// Before light is averaged: greatest one, in stops above this percentile. A caustic's one path
// would else count in as many pixels as the average is of.
#define OUTLIER_PERCENTILE 0.98
#define OUTLIER_STOPS      3.0
#define MOST_REACH         12 // of the average, three standard deviations; px
// Surfaces that reflect less show highlights rather than their colour.
#define LEAST_ALBEDO 0.05
// Share of the geometry that has to reflect for emitters not to count.
#define LEAST_REFLECTING 0.05
#define LEAST_COVERAGE   1e-3 // of a pixel
#define NOMINAL_STOPS    1.0  // see hg_exposure_of_light
#define FULL_STOPS       2.0
#define STEPS_PER_STOP   32.0
#define SATURATION       1.2 // 78 / (100 * 0.65), cd/m^2 at EV100 0
// Below the light of the sun: open shade has about 2.2 stops less than what the sun lights, rooms
// more.
#define SHADE_STOPS  3.0
#define INDOOR_STOPS 5.0

// --- histogram -----------------------------------------------------------------------------------

void hg_exposure_histogram_add(struct hg_exposure_histogram *h, double luminance, double weight)
{
    const double lowest = HG_EXPOSURE_LOW_STOPS, highest = HG_EXPOSURE_HIGH_STOPS;
    const bool lit = isfinite(luminance) && luminance > 0.0;
    const double stops = lit ? fmin(fmax(log2(luminance), lowest), highest) : lowest;
    const int at = (int)((stops - lowest) * HG_EXPOSURE_BINS_PER_STOP);
    const int bin = at < HG_EXPOSURE_BINS ? at : HG_EXPOSURE_BINS - 1;
    h->weight[bin] += weight;
    h->sum[bin] += weight * stops;
    h->total += weight;
}

bool hg_exposure_histogram_mean(const struct hg_exposure_histogram *h, double floor_stops,
    double low, double high, double *stops)
{
    const double from = ceil((floor_stops - HG_EXPOSURE_LOW_STOPS) * HG_EXPOSURE_BINS_PER_STOP);
    const int first = from < 1.0 ? 1 : (int)fmin(from, HG_EXPOSURE_BINS); // bin 0 is black
    double total = 0.0, below = 0.0, weight = 0.0, sum = 0.0;
    *stops = 0.0;
    for (int i = first; i < HG_EXPOSURE_BINS; i++)
        total += h->weight[i];
    for (int i = first; i < HG_EXPOSURE_BINS; i++) {
        const double above = below + h->weight[i];
        const double part = fmin(above, high * total) - fmax(below, low * total);
        if (part > 0.0) {
            weight += part;
            sum += part * (h->sum[i] / h->weight[i]);
        }
        below = above;
    }
    if (!(weight > 0.0))
        return false;
    *stops = sum / weight;
    return true;
}

// --- exposure ------------------------------------------------------------------------------------

float hg_exposure_of_light(double stops)
{
    const double off = fabs(stops), span = FULL_STOPS - NOMINAL_STOPS;
    const double share = fmin(fmax((off - NOMINAL_STOPS) / span, 0.0), 1.0);
    const double ev = fmin(fmax(-stops * share, HG_EXPOSURE_LEAST_EV), HG_EXPOSURE_MOST_EV);
    return (float)(round(ev * STEPS_PER_STOP) / STEPS_PER_STOP + 0.0); // no negative zero
}

double hg_exposure_ev100(double f_number, double shutter_s, double iso)
{
    return log2(f_number * f_number / shutter_s * 100.0 / iso);
}

float hg_exposure_of_camera(double f_number, double shutter_s, double iso)
{
    return (float)-(hg_exposure_ev100(f_number, shutter_s, iso) + log2(SATURATION));
}

float hg_exposure_adapt(float from, float to, double seconds)
{
    const double constant = to < from ? HG_EXPOSURE_TO_BRIGHT_S : HG_EXPOSURE_TO_DARK_S;
    const double rest = ((double)from - (double)to) * exp(-fmax(seconds, 0.0) / constant);
    return fabs(rest) < 1.0 / STEPS_PER_STOP ? to : (float)((double)to + rest);
}

static double luminance(const float *c)
{
    return 0.2126 * (double)c[0] + 0.7152 * (double)c[1] + 0.0722 * (double)c[2];
}

// Light of the lit part, in stops. False: there is none.
static bool find_light(const struct hg_exposure_histogram *h, double *stops)
{
    double key;
    return hg_exposure_histogram_mean(h, HG_EXPOSURE_LOW_STOPS, KEY_PERCENTILE, 1.0, &key) &&
           hg_exposure_histogram_mean(
               h, key - SHADOW_STOPS, LOW_PERCENTILE, HIGH_PERCENTILE, stops);
}

// Unlit materials emit their base colour: as much as they would reflect of light 1. Of what is
// black besides its emission that counts as it is.
static double emitted_light(double emitted, double albedo)
{
    return emitted / (albedo < LEAST_ALBEDO ? 1.0 : albedo);
}

// Light that a picture is exposed for: the sun's, down to open shade, and what was metered indoors.
static double exposed_for(double stops, double sun_stops)
{
    if (!(stops < sun_stops))
        return stops;
    const double above = stops - (sun_stops - INDOOR_STOPS);
    const double share = fmin(fmax(above / (INDOOR_STOPS - SHADE_STOPS), 0.0), 1.0);
    return stops + share * (sun_stops - stops);
}

// --- picture -------------------------------------------------------------------------------------

// What surfaces get of light, and how much of a pixel they cover; 0 where emitters and backgrounds
// are.
struct light_map {
    uint32_t width, height;
    float light[HG_EXPOSURE_MOST_PIXELS], weight[HG_EXPOSURE_MOST_PIXELS];
};

static void limit_outliers(struct light_map *m, const struct hg_exposure_histogram *h)
{
    double stops;
    if (!hg_exposure_histogram_mean(
            h, HG_EXPOSURE_LOW_STOPS, OUTLIER_PERCENTILE - 0.01, OUTLIER_PERCENTILE, &stops))
        return;
    const float most = (float)exp2(stops + OUTLIER_STOPS);
    for (uint32_t i = 0; i < m->width * m->height; i++)
        m->light[i] = m->light[i] < most ? m->light[i] : most;
}

// One line of `values`, `count` of them `stride` apart, with a kernel that reaches `reach` to both
// sides. What lies beyond the ends is 0.
static void convolve(float *values, uint32_t count, uint32_t stride, const float *kernel, int reach)
{
    float line[HG_EXPOSURE_MOST_PIXELS];
    for (uint32_t i = 0; i < count; i++) {
        const int first = (int)i < reach ? -(int)i : -reach;
        const int last = (int)(count - 1 - i) < reach ? (int)(count - 1 - i) : reach;
        line[i] = 0.0f;
        for (int k = first; k <= last; k++)
            line[i] += kernel[k < 0 ? -k : k] * values[(size_t)((int)i + k) * stride];
    }
    for (uint32_t i = 0; i < count; i++)
        values[(size_t)i * stride] = line[i];
}

static void blur(float *values, uint32_t width, uint32_t height, double spread_px)
{
    float kernel[MOST_REACH + 1];
    const int reach = (int)fmin(ceil(3.0 * spread_px), MOST_REACH);
    for (int k = 0; k <= reach; k++)
        kernel[k] = (float)exp(-0.5 * k * k / (spread_px * spread_px));
    for (uint32_t y = 0; y < height; y++)
        convolve(values + (size_t)y * width, width, 1, kernel, reach);
    for (uint32_t x = 0; x < width; x++)
        convolve(values + x, height, width, kernel, reach);
}

// The histogram of the map's light, after it was averaged by weight.
static void average(struct light_map *m, double spread_px, struct hg_exposure_histogram *h)
{
    float weight[HG_EXPOSURE_MOST_PIXELS];
    const uint32_t count = m->width * m->height;
    limit_outliers(m, h);
    for (uint32_t i = 0; i < count; i++)
        m->light[i] *= m->weight[i];
    memcpy(weight, m->weight, count * sizeof *weight);
    blur(m->light, m->width, m->height, spread_px);
    blur(weight, m->width, m->height, spread_px);
    *h = (struct hg_exposure_histogram){0};
    for (uint32_t i = 0; i < count; i++)
        if (m->weight[i] > 0.0f)
            hg_exposure_histogram_add(
                h, (double)m->light[i] / (double)weight[i], (double)m->weight[i]);
}

// Of what reflects more than it emits, and of what emits more.
static void sort_pixels(const struct hg_exposure_picture *picture, struct light_map *map,
    struct hg_exposure_histogram *reflecting, struct hg_exposure_histogram *emitting)
{
    for (uint32_t i = 0; i < map->width * map->height; i++) {
        const double coverage = (double)picture->color[4 * (uint64_t)i + 3];
        map->light[i] = map->weight[i] = 0.0f;
        if (!(coverage > LEAST_COVERAGE))
            continue;
        const double whole = luminance(picture->color + 4 * (uint64_t)i) / coverage;
        const double emitted = luminance(picture->emission + 3 * (uint64_t)i) / coverage;
        const double albedo = luminance(picture->albedo + 3 * (uint64_t)i) / coverage;
        const double light = (whole - emitted) / fmax(albedo, LEAST_ALBEDO);
        if (emitted > whole - emitted) {
            hg_exposure_histogram_add(emitting, emitted_light(emitted, albedo), coverage);
            continue;
        }
        hg_exposure_histogram_add(reflecting, light, coverage);
        map->light[i] = isfinite(light) && light > 0.0 ? (float)light : 0.0f;
        map->weight[i] = (float)coverage;
    }
}

float hg_exposure_of_picture(const struct hg_exposure_picture *picture)
{
    struct hg_exposure_histogram reflecting = {0}, emitting = {0};
    struct light_map map = {.width = picture->width, .height = picture->height};
    double stops;
    sort_pixels(picture, &map, &reflecting, &emitting);
    if (picture->spread_px > 0.0)
        average(&map, picture->spread_px, &reflecting);
    const double all = reflecting.total + emitting.total;
    const bool reflects = reflecting.total >= LEAST_REFLECTING * all;
    if ((reflects && find_light(&reflecting, &stops)) || find_light(&emitting, &stops))
        return hg_exposure_of_light(exposed_for(stops, picture->sun_stops));
    return 0.0f;
}
