// raster_kernel.h - the inner loops of raster.c. Private to it. Pure: any thread.
//
// All kernels give the same bytes. Arithmetic follows llvmpipe: sums of products from the last to
// the first, x / w as a product with 1 / w; where it asks its compiler for fused multiply-adds,
// they are fused on processors that can.
#ifndef HG_RENDERER_CPU_RASTER_RASTER_KERNEL_H
#define HG_RENDERER_CPU_RASTER_RASTER_KERNEL_H

#include <stdbool.h>
#include <stdint.h>

#define HG_RASTER_WIDE_SHIFT 8 // of tiles: 256 x 128 px
#define HG_RASTER_HIGH_SHIFT 7
#define HG_RASTER_WIDE       (1 << HG_RASTER_WIDE_SHIFT)
#define HG_RASTER_HIGH       (1 << HG_RASTER_HIGH_SHIFT)

#define HG_RASTER_SHOWS_CCW 1u // counter-clockwise on the screen
#define HG_RASTER_SHOWS_CW  2u

#define HG_RASTER_MOST_VERTICES 384u       // of a shot: three for each of 128 triangles
#define HG_RASTER_LARGE         (64 * 256) // 1/256 px: longer triangles are drawn by themselves

// A run as one sample sees it.
struct hg_raster_shot {
    float rotate[9], shift[3];     // columns: relative to the eye
    float project[12], clip[4];    // columns of x, y and z; the last one
    float half_width, half_height; // px
    const float *positions;        // [vertex_count * 3]
    const uint32_t *indices;       // [count * 3], less first_vertex of positions
    uint32_t first_vertex, vertex_count, count;
    uint32_t order;       // key of the first triangle, of the others one less each
    uint32_t sides;       // HG_RASTER_SHOWS_*
    bool fused;           // the processor has fused multiply-adds
    const uint64_t *pack; // [256] byte i of entry m: place of the i-th bit that is set in m
};

// Vertices on the screen: pixels from the corner of the image, depth.
struct hg_raster_vertices {
    float x[HG_RASTER_MOST_VERTICES + 8], y[HG_RASTER_MOST_VERTICES + 8];
    float z[HG_RASTER_MOST_VERTICES + 8];
};

// Keys: bits of the depth, then order. The largest is seen.
struct hg_raster_tile {
    uint64_t *keys;       // rows of HG_RASTER_WIDE
    int32_t x, y;         // px, of keys[0]
    int32_t end_x, end_y; // px
};

typedef void hg_raster_kernel(const struct hg_raster_shot *shot, const struct hg_raster_tile *tile);

hg_raster_kernel hg_raster_plain;
// Only where hg_raster_has_avx2().
hg_raster_kernel hg_raster_avx2;
bool hg_raster_has_avx2(void);
bool hg_raster_has_fma(void);

// One triangle of any size (raster_plain.c).
void hg_raster_triangle(const struct hg_raster_shot *shot, const struct hg_raster_tile *tile,
    const struct hg_raster_vertices *vertices, uint32_t triangle);

#endif
