// lanes.h - eight pixels of a row at a time, for loops that compilers leave scalar (choices of
// several values by one comparison). Private to renderer/temporal. Pure.
//
// Rows have HG_TEMPORAL_ROW_PAD values before and behind them, so the last eight may reach beyond.
#ifndef HG_RENDERER_TEMPORAL_LANES_H
#define HG_RENDERER_TEMPORAL_LANES_H

#include <stdint.h>

#include "base/simd.h"

#define HG_LANES 8u
typedef float hg_lanes __attribute__((vector_size(32), aligned(4), may_alias));
typedef int32_t hg_lanes_int __attribute__((vector_size(32), aligned(4), may_alias));

#define HG_LANES_AT(row, i)     (*(const hg_lanes *)(const void *)((row) + (i)))
#define HG_LANES_PUT(row, i, v) (*(hg_lanes *)(void *)((row) + (i)) = (v))
// mask: of a comparison of lanes.
#define HG_LANES_PICK(mask, a, b)                                                                  \
    ((hg_lanes)(((hg_lanes_int)(a) & (mask)) | ((hg_lanes_int)(b) & ~(mask))))
#define HG_LANES_MAX(a, b)  HG_LANES_PICK((a) > (b), (a), (b))
#define HG_LANES_MIN(a, b)  HG_LANES_PICK((a) < (b), (a), (b))
#define HG_LANES_INT(v)     __builtin_convertvector((v), hg_lanes_int) // towards 0
#define HG_LANES_FLOAT(v)   __builtin_convertvector((v), hg_lanes)
#define HG_LANES_COUNT_FROM ((hg_lanes_int){0, 1, 2, 3, 4, 5, 6, 7})

#endif
