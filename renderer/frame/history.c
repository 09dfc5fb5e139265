// history.c - see history.h.
#include "renderer/frame/history.h"

#include <string.h>

#include "renderer/frame/batch/batch.h"

void hg_frame_history_finish(struct hg_frame_history *history)
{
    hg_pose_snapshot_free(history->pose);
    *history = (struct hg_frame_history){0};
}

void hg_frame_history_forget(struct hg_frame_history *history)
{
    const bool wanted = history->wanted;
    hg_frame_history_finish(history);
    history->wanted = wanted;
}

enum hg_status hg_frame_history_note(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_frame_history *h = draw->history;
    if (!h->wanted)
        return HG_OK;
    h->camera = hg_frame_setup(draw);
    h->camera.jitter_px[0] = draw->frame->jitter_px.x;
    h->camera.jitter_px[1] = draw->frame->jitter_px.y;
    hg_geometry_origin(draw->scene_gpu->geometry, h->origin);
    h->has_camera = true;
    const enum hg_status status = hg_pose_snapshot_take(draw->scene_gpu->geometry, &h->pose, err);
    if (status != HG_OK)
        hg_frame_history_forget(h);
    return status;
}

void hg_frame_history_fill(const struct hg_draw *draw, struct hg_gpu_history *out)
{
    const struct hg_frame_history *h = draw->history;
    struct hg_camera_setup setup = h->camera;
    double origin[3];
    memset(out, 0, sizeof *out);
    if (!h->has_camera)
        return;
    hg_geometry_origin(draw->scene_gpu->geometry, origin);
    for (int i = 0; i < 3; i++) {
        const double shift = h->origin[i] - origin[i];
        setup.eye[i] += shift;
        setup.target[i] += shift;
        (&out->shift_ws.x)[i] = (float)shift;
    }
    hg_camera_fill(&setup, &out->camera);
    out->jitter_px = (struct hg_vec2){setup.jitter_px[0], setup.jitter_px[1]};
    out->flags = HG_HISTORY_CAMERA | (h->pose != NULL ? HG_HISTORY_POSE : 0u);
    if (h->pose != NULL)
        hg_pose_snapshot_fill(h->pose, &out->pose);
}
