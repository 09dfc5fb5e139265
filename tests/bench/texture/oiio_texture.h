// oiio_texture.h - OpenImageIO's texture system, callable from C. The benchmark's other half.
#ifndef HG_TESTS_BENCH_OIIO_TEXTURE_H
#define HG_TESTS_BENCH_OIIO_TEXTURE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct oiio_textures;

struct oiio_textures *oiio_textures_create(float memory_mb);
void oiio_textures_destroy(struct oiio_textures *t, uint64_t *bytes_read, uint64_t *peak_bytes);
// Trilinear, repeating; footprint: side of the square that a sample covers, in texture coordinates.
bool oiio_textures_sample(struct oiio_textures *t, const char *const *paths, uint32_t texture,
    float u, float v, float footprint, float rgba[4]);

// A tiled TIFF (64 x 64, zip) with these RGBA8 mips: what maketx makes.
bool oiio_write_tx(const char *path, uint32_t width, uint32_t height, uint32_t mips,
    const uint8_t *const levels[]);
// A TIFF of rows with detail at every scale, never held whole.
bool oiio_write_large(const char *path, uint32_t width, uint32_t height);

#ifdef __cplusplus
}
#endif

#endif
