// image_exr.h - EXR files as OpenImageIO sees them, for tests.
#ifndef HG_TESTS_UNIT_IMAGE_EXR_H
#define HG_TESTS_UNIT_IMAGE_EXR_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

struct exr_seen {
    char name[64], type[16], channel[64]; // of the part; the first channel in the file
    int width, height, channels;
    void *pixels; // as stored, half as float; free
    float world_to_camera[16];
    double seed; // -1: there is none of this type
};

// Number of parts read, -1 when one cannot be (said on the error stream).
int exr_read(const void *data, size_t size, struct exr_seen *parts, int max);

#ifdef __cplusplus
}
#endif
#endif
