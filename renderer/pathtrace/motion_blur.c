// motion_blur.c - times of a path-traced picture: the frames before and after, and the shutter
// intervals.
//
// The time that the shutter is open is cut into intervals in which motion is nearly linear. Each
// pass samples one interval, in bit-reversed order, so that any power of two of passes is spread
// evenly; moving geometry is refitted between intervals. Within an interval matrices and vertices
// are interpolated linearly (trace/ray_geometry.h), and each path has its own time.
#include "renderer/pathtrace/motion_blur.h"

#include <string.h>

#include "renderer/passes/skin.h"
#include "renderer/pathtrace/path_state.h"
#include "renderer/pathtrace/shutter.h"

#define MOST_PARTS 64 // two turns: what goes round is off its circle by 0.5 % of the radius at most

void hg_motion_blur_destroy(struct hg_motion_blur *b)
{
    for (int i = 0; i < HG_PATH_MOMENTS; i++) {
        hg_pose_snapshot_free(b->kept[i]);
        b->kept[i] = NULL;
    }
    hg_light_set_finish(&b->lights[0]);
    hg_light_set_finish(&b->lights[1]);
}

static bool is_open(const struct hg_path_request *r)
{
    return r->settings.shutter_close > r->settings.shutter_open;
}

static bool has_motion(const struct hg_path_request *r)
{
    return (r->settings.planes >> HG_PATH_PLANE_MOTION & 1u) != 0;
}

// The picture is part of a series that is denoised: motion vectors to the previous one are needed.
static bool is_of_series(const struct hg_path_request *r)
{
    return r->settings.denoise == HG_PATH_DENOISE_SERIES;
}

bool hg_path_needs_time(const struct hg_path_request *r, const struct hg_scene_gpu *scene_gpu)
{
    return (is_open(r) || has_motion(r) || is_of_series(r)) &&
           (r->camera.moves || hg_scene_moves(scene_gpu->scene));
}

bool hg_path_is_posed(const struct hg_path *p)
{
    return p != NULL && (p->options & HG_PATH_BLURS) != 0 && !hg_path_done(p) &&
           hg_scene_gpu_is_posed(p->scene_gpu, p);
}

static struct hg_shutter shutter_of(const struct hg_path *p)
{
    return (struct hg_shutter){.gpu = p->context->gpu,
        .scene_gpu = p->scene_gpu,
        .camera = &p->request.camera,
        .width = p->request.width,
        .height = p->request.height,
        .frame_s = p->request.settings.frame_s,
        .who = p};
}

static void note_camera(struct hg_motion_blur *b, uint32_t moment, const struct hg_gpu_camera *c)
{
    struct hg_gpu_path_moment *m = &b->moments[moment];
    m->eye_ws = c->eye_ws;
    m->forward_ws = c->forward_ws;
    m->ray_origin_ws = c->ray_origin_ws;
    m->ray_x_ws = c->ray_x_ws;
    m->ray_y_ws = c->ray_y_ws;
}

// Poses the geometry, and takes a snapshot unless the geometry stays in that pose.
static enum hg_status pose(
    struct hg_path *p, uint32_t moment, double frames, bool keep, struct hg_error *err)
{
    const struct hg_shutter shutter = shutter_of(p);
    struct hg_gpu_camera camera;
    enum hg_status status = hg_shutter_pose(&shutter, frames, &camera, err);
    if (status != HG_OK)
        return status;
    note_camera(&p->scene.blur, moment, &camera);
    if (!keep)
        return HG_OK;
    status = hg_pose_snapshot_take(p->scene_gpu->geometry, &p->scene.blur.kept[moment], err);
    if (status == HG_OK)
        hg_pose_snapshot_fill(p->scene.blur.kept[moment], &p->scene.blur.moments[moment].scene);
    return status;
}

static uint32_t part_of(const struct hg_motion_blur *b, uint32_t pass)
{
    uint32_t part = 0;
    for (uint32_t bit = 1; bit < b->parts; bit *= 2)
        part = part * 2 + ((pass & bit) != 0);
    return part;
}

// Without motion blur there is one interval, and it is the current pose.
bool hg_motion_blur_passes(const struct hg_motion_blur *b, uint32_t pass)
{
    return part_of(b, pass) != b->part;
}

enum hg_status hg_motion_blur_open(struct hg_path *p, struct hg_error *err)
{
    const struct hg_path_settings *s = &p->request.settings;
    const struct hg_shutter shutter = shutter_of(p);
    const double open = s->shutter_open, length = (double)s->shutter_close - open;
    p->scene.blur.part = part_of(&p->scene.blur, p->progress.pass);
    const double from = open + length * p->scene.blur.part / p->scene.blur.parts;
    const double to = open + length * (p->scene.blur.part + 1) / p->scene.blur.parts;
    enum hg_status status = hg_shutter_lights(&shutter, from, &p->scene.blur.lights[0], err);
    if (status == HG_OK)
        status = hg_shutter_lights(&shutter, to, &p->scene.blur.lights[1], err);
    if (status == HG_OK)
        status = pose(p, HG_PATH_OPENING, from, true, err);
    if (status == HG_OK)
        status = hg_rays_open_shutter(p->scene.rays, err);
    return status == HG_OK ? pose(p, HG_PATH_CLOSING, to, false, err) : status;
}

// Number of shutter intervals: at most the number of samples.
static enum hg_status choose_parts(struct hg_path *p, struct hg_error *err)
{
    const struct hg_path_settings *s = &p->request.settings;
    uint32_t most = 1;
    while (most < MOST_PARTS && most * 2 <= p->request.samples)
        most *= 2;
    const struct hg_shutter shutter = shutter_of(p);
    const struct hg_shutter_span span = {(double)s->shutter_open, (double)s->shutter_close, most};
    return hg_shutter_parts(&shutter, &span, &p->scene.blur.parts, err);
}

// Inputs of the motion planes.
static enum hg_status pose_frames(struct hg_path *p, struct hg_error *err)
{
    const struct hg_path_settings *s = &p->request.settings;
    const double shown = s->frame_s > 0.0f ? -(double)s->series_s / (double)s->frame_s : 0.0;
    const struct {
        uint32_t moment;
        double frames;
        bool wanted;
    } all[] = {{HG_PATH_PREVIOUS, -1.0, has_motion(&p->request)},
        {HG_PATH_SHOWN, shown, is_of_series(&p->request)}, {HG_PATH_NOW, 0.0, true},
        {HG_PATH_NEXT, 1.0, has_motion(&p->request)}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof all / sizeof *all && status == HG_OK; i++) {
        if (all[i].wanted)
            status = pose(p, all[i].moment, all[i].frames, true, err);
    }
    return status;
}

enum hg_status hg_motion_blur_begin(struct hg_path *p, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    memset(p->scene.blur.moments, 0, sizeof p->scene.blur.moments);
    p->options = 0;
    p->scene.blur.parts = 1;
    p->scene.blur.part = 0;
    if (!hg_path_needs_time(&p->request, p->scene_gpu))
        return HG_OK;
    if (has_motion(&p->request) || is_of_series(&p->request)) {
        p->options |= HG_PATH_MOTION;
        status = pose_frames(p, err);
    }
    if (status == HG_OK && is_open(&p->request)) {
        p->options |= HG_PATH_BLURS;
        return choose_parts(p, err);
    }
    if (status == HG_OK)
        status = hg_path_sync_scene(p, err);
    return status == HG_OK ? hg_skin_run(p->context->gpu, p->scene_gpu->geometry, err) : status;
}
