// view_matrices.c - where a view's camera stands, for files that say so.
#include <math.h>
#include <string.h>

#include "renderer/camera/camera.h"
#include "renderer/frame/paths/path_view.h"
#include "renderer/internal.h"

void hg_view_matrices(const struct hg_view *view, struct hg_view_matrices *out)
{
    const struct hg_view_camera_state *c = &view->state.camera;
    const struct hg_gpu_camera *shown = &view->state.frame.camera;
    struct hg_camera_setup setup = {
        .orthographic = c->orthographic,
        .vfov_rad = c->vfov_rad,
        .half_height = c->half_height,
        .near = shown->near > 0 || c->orthographic ? shown->near : 0.01f,
        .far = shown->far,
        .width = view->state.settings.width,
        .height = view->state.settings.height,
    };
    if (setup.orthographic && setup.far <= setup.near)
        setup.far = setup.near + 1;
    memcpy(setup.eye, c->eye, sizeof setup.eye);
    memcpy(setup.target, c->target, sizeof setup.target);
    memcpy(setup.up, c->up, sizeof setup.up);
    struct hg_gpu_camera camera;
    hg_camera_fill(&setup, &camera);
    memcpy(out->world_to_camera, camera.view.m, sizeof out->world_to_camera);
    memcpy(out->world_to_ndc, camera.view_proj.m, sizeof out->world_to_ndc);
    for (int i = 0; i < 4; i++) // y points up in files
        out->world_to_ndc[4 * i + 1] = -out->world_to_ndc[4 * i + 1];
}

// A focus of 0 is that of the target.
void hg_view_lens(const struct hg_view *view, struct hg_view_lens *out)
{
    const struct hg_view_camera_state c = hg_path_view_camera(&view->state);
    double squares = 0.0;
    for (int i = 0; i < 3; i++)
        squares += (c.target[i] - c.eye[i]) * (c.target[i] - c.eye[i]);
    out->radius_m = c.lens_radius;
    out->focus_m = c.focus_distance > 0.0f ? c.focus_distance : (float)sqrt(squares);
}
