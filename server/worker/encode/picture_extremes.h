// picture_extremes.h - how much of a picture is black or clipped.
// Floor 6, private to server/worker. Pure; any thread.
#ifndef HG_SERVER_WORKER_ENCODE_PICTURE_EXTREMES_H
#define HG_SERVER_WORKER_ENCODE_PICTURE_EXTREMES_H

#include "renderer/image/image.h"

// Shares of the pixels that are not transparent. A picture without such pixels is black.
struct picture_extremes {
    float black;   // at most one of 255 in every channel; of linear pixels 0
    float clipped; // white to at most two of 255 in every channel; linear pixels are never clipped
};

// pixels [count * 4] as hg_view_read_pixels has them.
struct picture_extremes hg_picture_extremes(
    const void *pixels, uint64_t count, enum hg_pixel_format format);

#endif
