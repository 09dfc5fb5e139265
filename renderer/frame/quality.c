#include "renderer/frame/quality.h"

#include <math.h>

// Below this share of the target there is room for finer geometry; between it and 1 nothing
// changes.
#define ROOM         0.8f
#define LARGEST_UP   2.0f // of one frame: one slow frame (a load, another process) does little harm
#define LARGEST_DOWN 0.87f

float hg_quality_error_px(const struct hg_quality *quality, float error_px, float target_ms)
{
    return target_ms > 0.0f && quality->factor > 1.0f ? error_px * quality->factor : error_px;
}

void hg_quality_note(struct hg_quality *quality, float frame_ms, float target_ms)
{
    float factor = fmaxf(quality->factor, 1.0f);
    if (target_ms <= 0.0f)
        factor = 1.0f;
    else if (frame_ms > target_ms)
        factor *= fminf(sqrtf(frame_ms / target_ms), LARGEST_UP);
    else if (frame_ms < ROOM * target_ms)
        factor *= fmaxf(sqrtf(frame_ms / (ROOM * target_ms)), LARGEST_DOWN);
    quality->factor = fminf(fmaxf(factor, 1.0f), HG_QUALITY_MOST);
}
