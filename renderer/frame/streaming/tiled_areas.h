// tiled_areas.h - areas of a picture that are drawn one after the other, and how they are cut.
// Floor 4. Pure.
#ifndef HG_RENDERER_FRAME_STREAMING_TILED_AREAS_H
#define HG_RENDERER_FRAME_STREAMING_TILED_AREAS_H

#include <stdbool.h>
#include <vulkan/vulkan.h>

#define HG_TILED_MAX_AREAS 64 // halving 16384 x 16384 px down to one takes 28

// All pixels inside have at least that many samples, or are in areas further up with an end. Shadow
// maps have no samples: depths of one share of the geometry after the other are added to them.
struct hg_tiled_area {
    VkRect2D rect;
    uint32_t samples;
    uint32_t end; // samples that it is drawn to, to catch up with the area around it; 0: all
    uint32_t share, shares; // of shadow maps: the share of the geometry; shares 0 or 1: all of it
};

// A stack; areas that are not in it are finished.
struct hg_tiled_areas {
    struct hg_tiled_area items[HG_TILED_MAX_AREAS];
    uint32_t count;
};

// Cuts the area on top in two, of which the first half is finished first. False when it is a single
// pixel already, or the stack is full.
bool hg_tiled_areas_split(struct hg_tiled_areas *areas);
// Cuts the share of the geometry on top in two. False when hardly more than a chunk can be in it.
bool hg_tiled_areas_share(struct hg_tiled_areas *areas);

#endif
