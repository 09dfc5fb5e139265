// image_files.h - image files of kinds that the library does not write: tiled ones with mips, and
// ones that are too large to be held. Tests only.
#ifndef HG_TESTS_UNIT_IMAGE_FILES_H
#define HG_TESTS_UNIT_IMAGE_FILES_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct tiled_layout {
    uint32_t width, height, tile; // tile: side
    bool is_float;
};
// RGB of the RGBA8 mips, as floats when is_float; the extension (.tif, .exr) decides the format.
bool write_tiled_file(const char *path, const struct tiled_layout *layout, uint32_t mips,
    const uint8_t *const levels[]);
// An RGB file of rows (png, tif, jpg) whose texel x, y is large_texel(x, y).
bool write_large_file(const char *path, uint32_t width, uint32_t height);

static inline void large_texel(uint32_t x, uint32_t y, uint8_t rgb[3])
{
    rgb[0] = (uint8_t)(x >> 3 ^ y >> 4);
    rgb[1] = (uint8_t)((x + y) >> 5);
    rgb[2] = (uint8_t)((x * 7 + y * 3) >> 6);
}

#ifdef __cplusplus
}
#endif

#endif
