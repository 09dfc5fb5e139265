// view_bytes.h - what the images of a view take.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_VIEW_BYTES_H
#define HG_RENDERER_FRAME_VIEW_BYTES_H

#include <stdint.h>

struct hg_view_state;

// Images and buffers of the size of the picture: on the device, and read back or kept by the host.
// Not in it: what the view shares with others (shadow maps, probes, textures, geometry), its lists
// of draws, and the film of path mode.
struct hg_view_bytes {
    uint64_t still;  // drawn to, accumulated, gathered, converted
    uint64_t motion; // of pictures in motion alone: smaller targets, history, reflections, glass
};

void hg_view_bytes_get(const struct hg_view_state *view, struct hg_view_bytes *out);

#endif
