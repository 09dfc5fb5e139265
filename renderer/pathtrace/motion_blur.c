// motion_blur.c - times of a path-traced picture: the frames before and after, and the parts of the
// time that the shutter is open.
//
// The shutter's time is cut into parts in which motion is nearly a straight line. Each pass has one
// of them, in bit-reversed order, so that any power of two of passes is spread evenly; what moves
// is refitted in between. Within a part matrices and vertices go in straight lines (cut.h), and
// each path has a time of its own.
#include <string.h>

#include "renderer/pathtrace/path_state.h"
#include "renderer/pathtrace/shutter.h"
#include "renderer/passes/skin.h"

#define MOST_PARTS 64 // two turns: what goes round is off its circle by 0.5 % of the radius at most

void hg_motion_blur_destroy(struct hg_path *p)
{
    for (int i = 0; i < HG_PATH_MOMENTS; i++) {
        hg_pose_snapshot_free(p->kept[i]);
        p->kept[i] = NULL;
    }
    hg_light_set_finish(&p->lights[0]);
    hg_light_set_finish(&p->lights[1]);
}

static bool is_open(const struct hg_view_state *view)
{
    const struct hg_path_settings *s = &view->settings.path;
    return s->shutter_close > s->shutter_open;
}

static bool has_motion(const struct hg_view_state *view)
{
    return (view->settings.path.planes >> HG_PATH_PLANE_MOTION & 1u) != 0;
}

// The picture is one of a series, and wants to know where things were in the one before.
static bool is_of_series(const struct hg_view_state *view)
{
    return view->settings.path.denoise == HG_PATH_DENOISE_SERIES;
}

bool hg_path_needs_time(const struct hg_view_state *view)
{
    return (is_open(view) || has_motion(view) || is_of_series(view)) && hg_shutter_moves(view);
}

bool hg_path_is_posed(const struct hg_view_state *view)
{
    const struct hg_path *p = view->path;
    return p != NULL && (p->options & HG_PATH_BLURS) != 0 && !hg_path_done(p) &&
           !view->path_begins && hg_scene_gpu_is_posed(view->scene_gpu, p);
}

static void note_camera(struct hg_path *p, uint32_t moment, const struct hg_gpu_camera *c)
{
    struct hg_gpu_path_moment *m = &p->moments[moment];
    m->eye_ws = c->eye_ws;
    m->forward_ws = c->forward_ws;
    m->ray_origin_ws = c->ray_origin_ws;
    m->ray_x_ws = c->ray_x_ws;
    m->ray_y_ws = c->ray_y_ws;
}

// Poses the geometry, and keeps what it shows unless it stays in that pose.
static enum hg_status pose(
    struct hg_view_state *view, uint32_t moment, double frames, bool keep, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_gpu_camera camera;
    enum hg_status status = hg_shutter_pose(view, p, frames, &camera, err);
    if (status != HG_OK)
        return status;
    note_camera(p, moment, &camera);
    if (!keep)
        return HG_OK;
    status = hg_pose_snapshot_take(view->scene_gpu->geometry, &p->kept[moment], err);
    if (status == HG_OK)
        hg_pose_snapshot_fill(p->kept[moment], &p->moments[moment].scene);
    return status;
}

static uint32_t part_of(const struct hg_path *p)
{
    uint32_t part = 0;
    for (uint32_t bit = 1; bit < p->time_parts; bit *= 2)
        part = part * 2 + ((p->pass & bit) != 0);
    return part;
}

bool hg_motion_blur_passes(const struct hg_path *p)
{
    return (p->options & HG_PATH_BLURS) != 0 && part_of(p) != p->time_part;
}

enum hg_status hg_motion_blur_open(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const struct hg_path_settings *s = &view->settings.path;
    const double open = s->shutter_open, length = (double)s->shutter_close - open;
    p->time_part = part_of(p);
    const double from = open + length * p->time_part / p->time_parts;
    const double to = open + length * (p->time_part + 1) / p->time_parts;
    enum hg_status status = hg_shutter_lights(view, from, &p->lights[0], err);
    if (status == HG_OK)
        status = hg_shutter_lights(view, to, &p->lights[1], err);
    if (status == HG_OK)
        status = pose(view, HG_PATH_OPENING, from, true, err);
    if (status == HG_OK)
        status = hg_ray_geometry_open_shutter(view->scene_gpu->geometry, &p->cut, err);
    return status == HG_OK ? pose(view, HG_PATH_CLOSING, to, false, err) : status;
}

// How many parts: no more than there are samples.
static enum hg_status choose_parts(struct hg_view_state *view, struct hg_error *err)
{
    const struct hg_path_settings *s = &view->settings.path;
    uint32_t most = 1;
    while (most < MOST_PARTS && most * 2 <= view->settings.samples)
        most *= 2;
    return hg_shutter_parts(view, (double)s->shutter_open, (double)s->shutter_close, most,
        &view->path->time_parts, err);
}

// What planes of motion are made of.
static enum hg_status pose_frames(struct hg_view_state *view, struct hg_error *err)
{
    const struct hg_path_settings *s = &view->settings.path;
    const double shown = s->frame_s > 0.0f ? -(double)s->series_s / (double)s->frame_s : 0.0;
    const struct {
        uint32_t moment;
        double frames;
        bool wanted;
    } all[] = {{HG_PATH_PREVIOUS, -1.0, has_motion(view)},
        {HG_PATH_SHOWN, shown, is_of_series(view)}, {HG_PATH_NOW, 0.0, true},
        {HG_PATH_NEXT, 1.0, has_motion(view)}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof all / sizeof *all && status == HG_OK; i++) {
        if (all[i].wanted)
            status = pose(view, all[i].moment, all[i].frames, true, err);
    }
    return status;
}

enum hg_status hg_motion_blur_begin(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    enum hg_status status = HG_OK;
    memset(p->moments, 0, sizeof p->moments);
    p->options = 0;
    p->time_parts = 1;
    p->time_part = UINT32_MAX;
    if (!hg_path_needs_time(view))
        return HG_OK;
    if (has_motion(view) || is_of_series(view)) {
        p->options |= HG_PATH_MOTION;
        status = pose_frames(view, err);
    }
    if (status == HG_OK && is_open(view)) {
        p->options |= HG_PATH_BLURS;
        return choose_parts(view, err);
    }
    if (status == HG_OK)
        status = hg_scene_gpu_sync(view->context, view->scene_gpu, view->camera.eye, view->wait, err);
    return status == HG_OK ? hg_skin_run(view->context->gpu, view->scene_gpu->geometry, err) : status;
}
