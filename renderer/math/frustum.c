// frustum.c - see frustum.h.
#include "renderer/math/frustum.h"

#include <math.h>
#include <stdbool.h>

// Row r of a column-major matrix, times sign, added to row 3.
static void clip_plane(const float m[16], int row, float sign, bool with_w, float plane[4])
{
    for (int c = 0; c < 4; c++)
        plane[c] = sign * m[c * 4 + row] + (with_w ? m[c * 4 + 3] : 0.0f);
}

// Source: Gribb and Hartmann 2001, "Fast Extraction of Viewing Frustum Planes".
uint32_t hg_frustum_planes(const float m[16], float planes[6][4])
{
    clip_plane(m, 2, -1.0f, true, planes[0]); // near: z <= w (reversed depth)
    clip_plane(m, 0, 1.0f, true, planes[1]);
    clip_plane(m, 0, -1.0f, true, planes[2]);
    clip_plane(m, 1, 1.0f, true, planes[3]);
    clip_plane(m, 1, -1.0f, true, planes[4]);
    clip_plane(m, 2, 1.0f, false, planes[5]); // far: z >= 0; no plane at infinity
    uint32_t count = 0;
    for (int i = 0; i < 6; i++) {
        float *p = planes[i];
        const float length = sqrtf(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        if (!(length > 1e-20f))
            continue;
        for (int c = 0; c < 4; c++)
            planes[count][c] = p[c] / length;
        count++;
    }
    return count;
}
