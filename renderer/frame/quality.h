// quality.h - quality governor: chooses the LOD error in motion for a target frame time.
// Floor 4. Pure; one object per view, zeroed = no frame seen yet.
//
// A feedback loop on frame time: a frame over the target raises the projected error, frames well
// below it lower it again, never below the view's own. Steps are multiplicative,
// because the number of triangles falls with a power of the error.
#ifndef HG_RENDERER_FRAME_QUALITY_H
#define HG_RENDERER_FRAME_QUALITY_H

#define HG_QUALITY_MOST 32.0f // times the view's own error

struct hg_quality {
    float factor; // on the view's error, 1 .. HG_QUALITY_MOST; 0 = 1
};

// Projected error of the next moving frame. error_px: the view's own; target_ms 0 = always that.
float hg_quality_error_px(const struct hg_quality *quality, float error_px, float target_ms);
// A moving frame took frame_ms.
void hg_quality_note(struct hg_quality *quality, float frame_ms, float target_ms);

#endif
