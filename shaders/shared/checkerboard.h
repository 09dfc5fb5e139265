// checkerboard.h - pictures of which every second pixel of a row is shaded, in turn.
// Floor 0, shared by C and GLSL.
#ifndef HG_SHADERS_SHARED_CHECKERBOARD_H
#define HG_SHADERS_SHARED_CHECKERBOARD_H

#include "shared/types.h"

struct hg_gpu_checkerboard {
    HG_UINT number; // of the picture
    HG_UINT width;  // of the whole one, px
};
HG_SHARED_SIZE(hg_gpu_checkerboard, 8);

// First pixel of row y of picture `number` that is shaded: 0 or 1.
#define HG_CHECKERBOARD_FIRST(y, number) (((y) + (number)) & 1u)
#ifndef __STDC__
// Column of a texel of the shaded picture, which is half as wide.
#define HG_CHECKERBOARD_COLUMN(at, number, width)                                                  \
    min(2u * (at).x + HG_CHECKERBOARD_FIRST((at).y, number), (width)-1u)
#endif

#endif
