// window.c - see window.h.
#include "renderer/temporal/window.h"

#include <math.h>

#define RADIUS_PX 1.5f
#define LEAST     1e-3f // of samples outside of the window, where none lies inside
#define PI        3.14159265f

// Blackman-Harris window of radius 1.5 px at x px, 1 at 0: that of accumulated pictures
// (renderer/camera/camera.h).
static float window_at(float x)
{
    const float t = x / RADIUS_PX;
    if (fabsf(t) >= 1.0f)
        return 0.0f;
    return 0.35875f + 0.48829f * cosf(PI * t) + 0.14128f * cosf(2.0f * PI * t) +
           0.01168f * cosf(3.0f * PI * t);
}

void hg_temporal_taps_fill(
    struct hg_temporal_taps *taps, uint32_t pixels, uint32_t samples, float jitter)
{
    const float size = (float)pixels / (float)samples; // of a sample, px
    for (uint32_t i = 0; i < pixels; i++) {
        const float centre = (float)i + 0.5f;
        const float at = floorf(centre / size - jitter);
        const float middle = fminf(fmaxf(at, 0.0f), (float)(samples - 1));
        float weight[3], sum = 0.0f, most = 0.0f;
        for (int k = 0; k < 3; k++) {
            const float place = (middle + (float)(k - 1) + 0.5f + jitter) * size;
            const float inside = window_at(place - centre);
            weight[k] = inside + LEAST * window_at((place - centre) / size);
            sum += weight[k];
            most = fmaxf(most, inside);
        }
        for (int k = 0; k < 3; k++)
            taps->weight[(uint32_t)k * pixels + i] = weight[k] / sum;
        taps->first[i] = (uint32_t)middle;
        taps->trust[i] = most;
    }
}
