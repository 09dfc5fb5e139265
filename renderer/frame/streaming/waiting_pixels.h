// waiting_pixels.h - pixels of a picture that wait for texture pages: which samples they have, and
// where they lie.
// Floor 4. Pure; any thread.
#ifndef HG_RENDERER_FRAME_STREAMING_WAITING_PIXELS_H
#define HG_RENDERER_FRAME_STREAMING_WAITING_PIXELS_H

#include <vulkan/vulkan.h>

#define HG_WAITING_MOST_RECTS 6

struct hg_waiting_pixels {
    const uint32_t *progress; // [height][width] words (HG_PROGRESS_* of shaders/shared/texture.h)
    uint32_t width;
    uint32_t samples;       // that all pixels are to have
    const uint32_t *counts; // [rows][columns] that are enough for blocks; NULL: `samples` for all
    uint32_t columns;       // of blocks (shaders/shared/sample_blocks.h)
};

// Least number of samples of the pixels of a rectangle; those with samples enough have all.
uint32_t hg_waiting_pixels_least(const struct hg_waiting_pixels *waiting, VkRect2D rect);
// Rectangles that hold all pixels of `rect` with fewer samples than `reached`, and than are enough
// for them. Their edges lie at multiples of 64 px, the tiles of Mesa's llvmpipe, or are those of
// `rect`. Returns their number; 0: drawing them would save little beside drawing all of
// `rect`.
uint32_t hg_waiting_pixels_rects(const struct hg_waiting_pixels *waiting, VkRect2D rect,
    uint32_t reached, VkRect2D out[HG_WAITING_MOST_RECTS]);

#endif
