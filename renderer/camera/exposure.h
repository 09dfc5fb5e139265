// exposure.h - automatic exposure: from a small linear picture to stops.
// Floor 1. Pure functions, any thread; the same result on every run.
//
// The meter works as an incident-light meter does (ISO 2720): what is measured is not how bright
// surfaces are but how much light they get, which is their radiance divided by the share of light
// that they reflect. White subjects stay white and black ones black, where a meter of reflected
// light makes both of them grey. Pixels without geometry do not count, so a white backdrop does not
// darken what stands before it. Light 1 is nominal: the radiance of a white diffuser is 1 then.
//
// The light of a picture is the mean logarithm between two percentiles of a histogram of log
// luminance (as in Lagarde and de Rousiers 2014, "Moving Frostbite to Physically Based Rendering",
// section 5.1.2, after Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images").
// Both lie in the bright part, so that the light that a scene is lit with is what counts, and
// shadows and nights stay dark; highlights and noise above the upper one do not count.
#ifndef HG_RENDERER_CAMERA_EXPOSURE_H
#define HG_RENDERER_CAMERA_EXPOSURE_H

#include <stdbool.h>
#include <stdint.h>

#define HG_EXPOSURE_LOW_STOPS     -30 // of a histogram; what is darker or brighter counts at its end
#define HG_EXPOSURE_HIGH_STOPS    30
#define HG_EXPOSURE_BINS_PER_STOP 8
#define HG_EXPOSURE_BINS                                                                           \
    ((HG_EXPOSURE_HIGH_STOPS - HG_EXPOSURE_LOW_STOPS) * HG_EXPOSURE_BINS_PER_STOP)

// Weights by log2 of luminance. A zeroed one is empty.
struct hg_exposure_histogram {
    double weight[HG_EXPOSURE_BINS];
    double sum[HG_EXPOSURE_BINS]; // of weight times log2 of luminance
    double total;                 // weight of all
};

// weight >= 0. What is no positive finite luminance counts in the lowest bin.
void hg_exposure_histogram_add(
    struct hg_exposure_histogram *histogram, double luminance, double weight);
// Mean log2 of what lies between two percentiles, 0 <= low < high <= 1, of the weight of all that
// is brighter than `floor_stops`. False: that is nothing.
bool hg_exposure_histogram_mean(const struct hg_exposure_histogram *histogram, double floor_stops,
    double low, double high, double *stops);

// Stops of exposure for light of so many stops above the nominal one: none within one stop of it,
// so that scenes that are lit by the conventions of glTF are shown as they are; all that it takes
// from two stops on; between them in proportion. Clamped to HG_EXPOSURE_LEAST_EV and _MOST_EV, and
// rounded to 1/32.
#define HG_EXPOSURE_LEAST_EV -24.0
#define HG_EXPOSURE_MOST_EV  12.0
float hg_exposure_of_light(double stops);

// EV100 of a camera's settings, log2(N^2 / t * 100 / S), and its exposure in stops: radiance in
// cd/m^2 that saturates the sensor by ISO 12232 (saturation-based speed, 78 / H, with 0.65 of the
// light that reaches it), 1.2 * 2^EV100, is 1. Lagarde and de Rousiers 2014, section 5.1.1.
double hg_exposure_ev100(double f_number, double shutter_s, double iso);
float hg_exposure_of_camera(double f_number, double shutter_s, double iso);

// An exposure so many seconds later on its way from one to another, in stops. Both are logarithms,
// which approach exponentially, as in Lagarde and de Rousiers 2014, section 5.1.2, and with two
// rates as eyes have them (Pattanaik et al. 2000, "Time-Dependent Visual Adaptation for Fast
// Realistic Image Display"): to bright light, which is a lower exposure, they adapt sooner than to
// the dark. It arrives once the rest is less than a step of hg_exposure_of_light.
#define HG_EXPOSURE_TO_BRIGHT_S 0.3 // time constants
#define HG_EXPOSURE_TO_DARK_S   0.6
float hg_exposure_adapt(float from, float to, double seconds);

// Means over the samples of each pixel, rows one after the other.
#define HG_EXPOSURE_MOST_PIXELS 4096u
struct hg_exposure_picture {
    uint32_t width, height; // width * height <= HG_EXPOSURE_MOST_PIXELS
    const float *color;    // [4]: radiance and coverage by geometry; the background is left out
    const float *albedo;   // [3]: base colour times coverage
    const float *emission; // [3]: the part of `color` that surfaces emit
    // Light on what faces the sun of a sky, above the nominal one; -INFINITY: none.
    double sun_stops;
    // Of pictures of few samples: standard deviation of the Gaussian that the light of neighbours
    // is averaged with; 0 = none, 4 at most. The percentiles of noise are those of its bright
    // outliers: rooms that get their light by a small window would be metered stops too bright.
    double spread_px;
};
// Stops; 0 where there is nothing to meter: no geometry, no light. Under a sky with a sun, a view
// of what lies in open shade is exposed for the sun, as a view from the other side is; one from
// indoors is not. Surfaces that emit more than they reflect count only where there are hardly any
// others.
float hg_exposure_of_picture(const struct hg_exposure_picture *picture);

#endif
