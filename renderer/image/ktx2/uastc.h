// uastc.h - blocks of UASTC LDR 4x4, the better of the two codings of Basis Universal.
// Floor 1, private to renderer/image. Pure; any thread.
// Source: Khronos Data Format Specification 1.3, chapters "UASTC Compressed Texture Image Format"
// and, for end points, weights and colours, "ASTC Compressed Texture Image Formats".
#ifndef HG_RENDERER_IMAGE_KTX2_UASTC_H
#define HG_RENDERER_IMAGE_KTX2_UASTC_H

#include <stdbool.h>
#include <stdint.h>

enum { HG_UASTC_BLOCK_BYTES = 16 };

// One block of 4 x 4 texels, RGBA8, rows from the top. `srgb`: the file's colours are sRGB, which
// decides how colours between end points are rounded (alpha is never sRGB). Every block decodes:
// what the format does not define is its error colour (255, 0, 255, 255).
void hg_uastc_decode(const uint8_t block[HG_UASTC_BLOCK_BYTES], bool srgb, uint8_t texels[16][4]);

#endif
