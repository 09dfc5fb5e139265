// look_params.h - what callers say of how a view shows its scene (look.h). Free of Vulkan types.
// Floor 4.
#ifndef HG_RENDERER_FRAME_LOOK_LOOK_PARAMS_H
#define HG_RENDERER_FRAME_LOOK_LOOK_PARAMS_H

#include <stdbool.h>
#include <stdint.h>

#define HG_CLIP_MOST_PLANES 6
#define HG_LOOK_MOST_NODES  65536

enum hg_cap_style { HG_CAPS_MATERIAL, HG_CAPS_COLOR, HG_CAPS_HATCH, HG_CAPS_NONE };

struct hg_clip {
    uint32_t count;
    float planes[HG_CLIP_MOST_PLANES][4]; // unit normal; shown: dot(normal, p) >= [3], metres
    enum hg_cap_style caps;
    float cap_color[3]; // linear, 0..1
    float hatch_px;     // > 0
};

// Properties that an override sets.
#define HG_LOOK_HIDDEN   1u
#define HG_LOOK_TINT     2u
#define HG_LOOK_SELECTED 4u
#define HG_LOOK_ALPHA    8u

struct hg_node_look {
    uint64_t node;
    uint32_t set; // HG_LOOK_*; 0: no override any more
    bool hidden, selected;
    float tint[4]; // linear colour, 0..1; strength, 0..1
    float alpha;   // 0..1
};

#endif
