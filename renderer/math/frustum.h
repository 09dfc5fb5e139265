// frustum.h - the clip planes of a camera or a light.
// Floor 1 (math). Pure: any thread.
#ifndef HG_RENDERER_MATH_FRUSTUM_H
#define HG_RENDERER_MATH_FRUSTUM_H

#include <stdint.h>

// Six planes (near first; far at infinity is left out by count 5) of a column-major view-projection
// matrix with Vulkan clip space and reversed depth. Returns the number of planes.
// Source: Gribb and Hartmann 2001, "Fast Extraction of Viewing Frustum Planes".
uint32_t hg_frustum_planes(const float view_proj[16], float planes[6][4]);

#endif
