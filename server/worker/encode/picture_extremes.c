#include "server/worker/encode/picture_extremes.h"

struct counts {
    uint64_t visible, black, clipped;
};

// Channels in the range of 0 to 255.
static void count_pixel(struct counts *counts, const float c[4])
{
    const float least = c[0] < c[1] ? (c[0] < c[2] ? c[0] : c[2]) : (c[1] < c[2] ? c[1] : c[2]);
    const float most = c[0] > c[1] ? (c[0] > c[2] ? c[0] : c[2]) : (c[1] > c[2] ? c[1] : c[2]);
    if (!(c[3] > 0))
        return;
    counts->visible++;
    counts->black += most <= 1;
    counts->clipped += least >= 253;
}

struct picture_extremes hg_picture_extremes(
    const void *pixels, uint64_t count, enum hg_pixel_format format)
{
    const uint8_t *bytes = pixels;
    const uint16_t *words = pixels;
    const float *floats = pixels;
    struct counts counts = {0};
    for (uint64_t i = 0; i < count; i++) {
        float c[4];
        for (uint64_t k = 0; k < 4; k++)
            c[k] = format == HG_PIXEL_RGBA8    ? (float)bytes[4 * i + k]
                   : format == HG_PIXEL_RGBA16 ? (float)words[4 * i + k] / 257
                   : k == 3                    ? floats[4 * i + k]
                   : floats[4 * i + k] > 0     ? 128 // radiance has no white
                                               : 0;
        count_pixel(&counts, c);
    }
    if (counts.visible == 0)
        return (struct picture_extremes){.black = 1};
    return (struct picture_extremes){
        .black = (float)((double)counts.black / (double)counts.visible),
        .clipped = (float)((double)counts.clipped / (double)counts.visible)};
}
