// temporal_view.c - see temporal_view.h.
#include "renderer/frame/temporal_view.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/frame/batch/recording.h"
#include "renderer/frame/quality/governor.h"
#include "renderer/passes/posed_motion.h"
#include "renderer/temporal/sharpen.h"
#include "shaders/shared/debug.h"

#define MOST_JITTER_PX 0.49f // of a sample, so that it stays in its pixel
#define MOST_TURN_COS  0.5   // of a camera between two pictures of one motion
#define MOST_LOST      0.75f // share of samples
#define DEPTH_BYTES    4u
#define ID_BYTES       8u
#define PLACE_BYTES    12u
#define MARGIN_PX      2 // about the bounds of posed surfaces

static void destroy_images(struct hg_gpu *gpu, struct hg_view_targets *t)
{
    hg_gpu_image_destroy(gpu, &t->visibility);
    hg_gpu_image_destroy(gpu, &t->depth);
    hg_gpu_image_destroy(gpu, &t->behind);
    hg_gpu_image_destroy(gpu, &t->pixels[0]);
}

void hg_temporal_view_finish(struct hg_gpu *gpu, struct hg_temporal_view *t)
{
    destroy_images(gpu, &t->targets);
    hg_graph_destroy(t->targets.graph);
    hg_temporal_destroy(t->history);
    hg_motion_table_finish(&t->places);
    hg_pose_snapshot_free(t->pose);
    hg_free(t->motion);
    hg_free(t->pixels);
    *t = (struct hg_temporal_view){0};
}

void hg_temporal_view_forget(struct hg_temporal_view *t)
{
    if (t->history != NULL)
        hg_temporal_forget(t->history);
}

// --- before --------------------------------------------------------------------------------------

// R2 sequence (Roberts 2018) over a pixel.
static void jitter(uint32_t index, uint32_t seed, float out_px[2])
{
    const double g = 1.32471795724474602596; // plastic number
    const double step[2] = {1.0 / g, 1.0 / (g * g)};
    const double n = (double)index + (double)(seed % 65536u) * 97.0;
    for (int i = 0; i < 2; i++) {
        const double u = 0.5 + n * step[i];
        const float px = (float)(u - floor(u) - 0.5);
        out_px[i] = fminf(fmaxf(px, -MOST_JITTER_PX), MOST_JITTER_PX);
    }
}

// A camera that turned or opened this much shows another picture.
static bool jumps(const struct hg_camera_setup *a, const struct hg_camera_setup *b)
{
    double dot = 0, length_a = 0, length_b = 0;
    for (int i = 0; i < 3; i++) {
        const double x = a->target[i] - a->eye[i], y = b->target[i] - b->eye[i];
        dot += x * y;
        length_a += x * x;
        length_b += y * y;
    }
    return a->orthographic != b->orthographic || !(dot > MOST_TURN_COS * sqrt(length_a * length_b));
}

// The camera of the picture before, relative to the origin of now.
static struct hg_camera_setup camera_before(
    const struct hg_temporal_view *t, const double origin[3])
{
    struct hg_camera_setup setup = t->camera;
    for (int i = 0; i < 3; i++) {
        setup.eye[i] += t->origin[i] - origin[i];
        setup.target[i] += t->origin[i] - origin[i];
    }
    return setup;
}

static bool continues(const struct hg_view_state *view)
{
    const struct hg_temporal_view *t = &view->motion.temporal;
    const struct hg_view_settings *s = &view->settings;
    double origin[3];
    hg_geometry_origin(view->scene_gpu->geometry, origin);
    const struct hg_camera_setup now =
        hg_scene_gpu_camera(view->scene_gpu, &view->camera, s->width, s->height);
    const struct hg_camera_setup before = camera_before(t, origin);
    return t->history != NULL && t->moment > 0 && t->settings == view->settings_revision &&
           !jumps(&now, &before);
}

// Pixels that a box may cover, out to whole ones; all of them where it reaches behind the eye.
static VkRect2D cover(
    const struct hg_gpu_camera *camera, VkExtent2D size, const float min[3], const float max[3])
{
    const float *m = camera->view_proj.m;
    const int64_t px[2] = {size.width, size.height};
    float low[2] = {1e9f, 1e9f}, high[2] = {-1e9f, -1e9f};
    for (int corner = 0; corner < 8; corner++) {
        const float p[3] = {corner & 1 ? max[0] : min[0], corner & 2 ? max[1] : min[1],
            corner & 4 ? max[2] : min[2]};
        const float w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
        if (!(w > camera->near))
            return (VkRect2D){{0, 0}, size};
        for (int r = 0; r < 2; r++) {
            const float at = (m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]) / w;
            const float here = (fminf(fmaxf(at, -1.0f), 1.0f) + 1.0f) * 0.5f * (float)px[r];
            low[r] = fminf(low[r], here);
            high[r] = fmaxf(high[r], here);
        }
    }
    int64_t first[2], end[2];
    for (int r = 0; r < 2; r++) {
        first[r] = (int64_t)low[r] - MARGIN_PX > 0 ? (int64_t)low[r] - MARGIN_PX : 0;
        end[r] =
            (int64_t)high[r] + 1 + MARGIN_PX < px[r] ? (int64_t)high[r] + 1 + MARGIN_PX : px[r];
    }
    return (VkRect2D){{(int32_t)first[0], (int32_t)first[1]},
        {(uint32_t)(end[0] - first[0]), (uint32_t)(end[1] - first[1])}};
}

// Where posed surfaces can be seen, if it is known where they were.
static VkRect2D find_posed(const struct hg_view_state *view, const struct hg_draw_request *request)
{
    const struct hg_temporal_view *t = &view->motion.temporal;
    const struct hg_geometry *geometry = view->scene_gpu->geometry;
    const VkExtent2D size = hg_draw_size(request);
    struct hg_gpu_camera camera;
    float min[3], max[3];
    if (t->pose == NULL || t->moment == 0 || !t->places.same_layout || !t->places.deformed ||
        !hg_motion_table_bounds(geometry, min, max))
        return (VkRect2D){0};
    const struct hg_camera_setup setup =
        hg_scene_gpu_camera(view->scene_gpu, request->camera, size.width, size.height);
    hg_camera_fill(&setup, &camera);
    return cover(&camera, size, min, max);
}

static struct hg_quality_choice choose(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    struct hg_quality_choice choice = hg_governor_choice(view);
    if (view->motion.still > 0)
        return choice;
    choice.checkerboard |= s->temporal == HG_VIEW_TEMPORAL_CHECKERBOARD;
    choice.scale = choice.checkerboard ? 1.0f : s->scale > 0.0f ? s->scale : choice.scale;
    return choice;
}

// At least half of a side, and none where that is all.
static VkExtent2D drawn_size(const struct hg_view_settings *s, float scale)
{
    const VkExtent2D size = {(uint32_t)ceilf((float)s->width * fmaxf(scale, 0.5f)),
        (uint32_t)ceilf((float)s->height * fmaxf(scale, 0.5f))};
    return size.width < s->width || size.height < s->height ? size : (VkExtent2D){0};
}

void hg_temporal_view_begin(struct hg_view_state *view, struct hg_draw_request *request)
{
    struct hg_temporal_view *t = &view->motion.temporal;
    const struct hg_geometry *geometry = view->scene_gpu->geometry;
    if (request->settings->temporal == HG_VIEW_TEMPORAL_NONE)
        return;
    if (hg_motion_table_compare(&t->places, geometry) != HG_OK)
        return; // a picture without history
    if (!continues(view))
        t->moment = 0; // the next picture is the first of its own motion
    const struct hg_quality_choice choice = choose(view);
    const bool checkered = choice.checkerboard && !hg_geometry_blends(geometry);
    request->drawn = drawn_size(request->settings, choice.scale);
    request->flags |= checkered ? HG_DRAW_CHECKERBOARD : 0;
    t->posed = find_posed(view, request);
    request->moment = t->moment % (1u << 20) + 1;
    // Both halves of a checkerboard have the same places, else thin features are seen in one of
    // them.
    const uint32_t place = request->moment - 1;
    const bool pairs = (request->flags & HG_DRAW_CHECKERBOARD) != 0;
    jitter(pairs ? place / 2 : place, request->settings->seed, request->jitter_px);
    request->flags |= HG_DRAW_MOTION;
    request->flags |= t->places.moved_count > 1 || t->places.deformed ? HG_DRAW_MOTION_IDS : 0;
    request->flags |= t->posed.extent.width > 0 ? HG_DRAW_MOTION_POSED : 0;
}

static enum hg_status make_checkered(const struct hg_draw *draw, struct hg_error *err)
{
    const VkExtent2D size = hg_draw_size(draw->request);
    const struct hg_gpu_image_params params = {.format = VK_FORMAT_R8G8B8A8_UNORM,
        .width = (size.width + 1) / 2,
        .height = size.height,
        .attachment = true,
        .name = "checkered"};
    struct hg_gpu_image *image = &draw->targets->checkered;
    return image->handle == VK_NULL_HANDLE
               ? hg_gpu_image_create(draw->context->gpu, &params, image, err)
               : HG_OK;
}

enum hg_status hg_temporal_view_targets(
    struct hg_view_state *view, struct hg_draw *draw, struct hg_error *err)
{
    struct hg_view_targets *t = &view->motion.temporal.targets;
    if (hg_draw_is(draw, HG_DRAW_CHECKERBOARD))
        return make_checkered(draw, err);
    if (draw->request->drawn.width == 0)
        return HG_OK;
    draw->targets = t;
    draw->gathered = draw->glass = NULL; // per pixel of the whole size
    draw->blocks = NULL;
    const VkExtent2D size = hg_draw_size(draw->request);
    if (t->depth.width != size.width || t->depth.height != size.height)
        destroy_images(view->context->gpu, t);
    const enum hg_status status =
        hg_draw_make_image(draw, HG_VISIBILITY_FORMAT, "visibility", &t->visibility, err);
    return status == HG_OK ? hg_draw_make_image(draw, HG_DEPTH_FORMAT, "depth", &t->depth, err)
                           : status;
}

// --- reading back --------------------------------------------------------------------------------

static uint64_t pixels_of(const struct hg_draw *draw)
{
    const struct hg_view_settings *s = draw->request->settings;
    return ((uint64_t)s->width * s->height + 3) & ~UINT64_C(3); // texels of 16 bytes start aligned
}

static enum hg_status record_motion(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct hg_batch *f = hg_batch_of(run);
    struct hg_draw *draw = f->draw;
    const struct hg_gpu_buffer *to = &draw->buffers->motion;
    const VkExtent2D size = hg_frame_size(draw);
    const struct hg_gpu_region all = {.width = size.width, .height = size.height};
    (void)user;
    (void)err;
    hg_gpu_image_read(run->cmd, hg_graph_run_image(run, f->depth), &all, to, 0);
    if (hg_draw_is(draw, HG_DRAW_MOTION_IDS))
        hg_gpu_image_read(run->cmd, hg_graph_run_image(run, f->visibility), &all, to,
            pixels_of(draw) * DEPTH_BYTES);
    return HG_OK;
}

enum hg_status hg_batch_reserve_motion(struct hg_draw *draw, struct hg_error *err)
{
    const bool posed = hg_draw_is(draw, HG_DRAW_MOTION_POSED);
    const uint64_t bytes = pixels_of(draw) * (DEPTH_BYTES + ID_BYTES + (posed ? PLACE_BYTES : 0u));
    return hg_draw_is(draw, HG_DRAW_MOTION)
               ? hg_gpu_buffer_reserve(draw->context->gpu, HG_GPU_BUFFER_READBACK, bytes, "motion",
                     &draw->buffers->motion, err)
               : HG_OK;
}

static struct hg_gpu_posed_motion posed_push(
    const struct hg_draw *draw, const struct hg_temporal_view *t)
{
    struct hg_gpu_camera camera;
    double origin[3];
    hg_geometry_origin(draw->scene_gpu->geometry, origin);
    const struct hg_camera_setup before = camera_before(t, origin);
    hg_camera_fill(&before, &camera);
    const float *last = camera.proj.m + 12;
    const VkRect2D r = t->posed;
    struct hg_gpu_posed_motion push = {
        .target = draw->buffers->motion.address + pixels_of(draw) * (DEPTH_BYTES + ID_BYTES),
        .rotated = camera.view_proj,
        .shift = {last[0], last[1], last[2], last[3]},
        .first = (uint32_t)r.offset.x | (uint32_t)r.offset.y << 16,
        .size = r.extent.width | r.extent.height << 16};
    for (int i = 0; i < 3; i++) // poses are relative to the origin of then
        (&push.to_eye.x)[i] = (float)(t->origin[i] - origin[i] - before.eye[i]);
    hg_pose_snapshot_fill(t->pose, &push.pose);
    return push;
}

static enum hg_status record_posed(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_gpu_posed_motion push = posed_push(f->draw, f->draw->temporal);
    (void)user;
    return hg_posed_motion_record(&f->pass, hg_graph_run_image(run, f->visibility), &push, err);
}

void hg_batch_declare_motion(struct hg_batch *f)
{
    if (!hg_draw_is(f->draw, HG_DRAW_MOTION))
        return;
    const uint32_t motion = hg_graph_buffer(f->graph, "motion");
    if (hg_draw_is(f->draw, HG_DRAW_MOTION_POSED))
        hg_batch_add(f, &(struct hg_graph_pass){.name = "posed motion",
                            .record = record_posed,
                            .accesses = {{f->deformed, HG_GRAPH_READ, 0},
                                {f->visibility, HG_GRAPH_SAMPLE, 0}, {motion, HG_GRAPH_WRITE, 0}},
                            .keep = true});
    struct hg_graph_pass pass = {.name = "motion",
        .record = record_motion,
        .accesses = {{motion, HG_GRAPH_WRITE, 0}, {f->depth, HG_GRAPH_COPY_FROM, 0}},
        .keep = true};
    if (hg_draw_is(f->draw, HG_DRAW_MOTION_IDS))
        pass.accesses[2] = (struct hg_graph_access){f->visibility, HG_GRAPH_COPY_FROM, 0};
    hg_batch_add(f, &pass);
}

// --- after ---------------------------------------------------------------------------------------

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "temporal", NULL, "out of host memory");
}

static enum hg_status make_history(
    struct hg_temporal_view *t, const struct hg_view_settings *s, struct hg_error *err)
{
    uint32_t width = 0, height = 0;
    if (t->history != NULL)
        hg_temporal_size(t->history, &width, &height);
    if (width == s->width && height == s->height)
        return HG_OK;
    hg_temporal_destroy(t->history);
    hg_free(t->pixels);
    t->history = NULL;
    t->pixels = hg_calloc((size_t)s->width * s->height, 4);
    return t->pixels != NULL && hg_temporal_create(s->width, s->height, &t->history) == HG_OK
               ? HG_OK
               : no_memory(err);
}

static void fill_picture(struct hg_view_state *view, const struct hg_draw *draw,
    double (*matrices)[16], struct hg_temporal_picture *out)
{
    const struct hg_temporal_view *t = &view->motion.temporal;
    const struct hg_motion_table *places = &t->places;
    struct hg_camera_setup now = hg_frame_setup(draw);
    double origin[3];
    hg_geometry_origin(view->scene_gpu->geometry, origin);
    const struct hg_camera_setup before = t->moment > 0 ? camera_before(t, origin) : now;
    memcpy(now.jitter_px, draw->request->jitter_px, sizeof now.jitter_px);
    for (uint32_t i = 0; i < places->moved_count; i++)
        hg_camera_reproject(&now, &before, places->moved[i], matrices[i]);
    const uint8_t *back = view->buffers.motion.mapped;
    *out = (struct hg_temporal_picture){.width = now.width,
        .height = now.height,
        .jitter_px = {now.jitter_px[0], now.jitter_px[1]},
        .rgba = view->buffers.readback.buffer.mapped,
        .checkerboard = hg_draw_is(draw, HG_DRAW_CHECKERBOARD),
        .first = draw->request->moment & 1,
        .depth = (const float *)(const void *)back,
        .matrix_of_draw = places->draws,
        .draw_count = places->draw_count,
        .to_previous = (const double(*)[16])matrices,
        .matrix_count = places->moved_count,
        .continues = draw->request->moment > 1,
        .cut = MOST_LOST};
    if (hg_draw_is(draw, HG_DRAW_MOTION_IDS))
        out->ids = (const uint32_t *)(const void *)(back + pixels_of(draw) * DEPTH_BYTES);
    back += pixels_of(draw) * (DEPTH_BYTES + ID_BYTES);
    if (hg_draw_is(draw, HG_DRAW_MOTION_POSED))
        out->posed = (struct hg_temporal_posed){(uint32_t)t->posed.offset.x,
            (uint32_t)t->posed.offset.y, t->posed.extent.width, t->posed.extent.height,
            (const float(*)[3])(const void *)back};
}

static enum hg_temporal_show shown(const struct hg_view_settings *s)
{
    return s->debug == HG_DEBUG_VIEW_MOTION    ? HG_TEMPORAL_MOTION
           : s->debug == HG_DEBUG_VIEW_HISTORY ? HG_TEMPORAL_HISTORY
           : s->debug == HG_DEBUG_VIEW_SCALE   ? HG_TEMPORAL_SCALE
                                               : HG_TEMPORAL_PICTURE;
}

static enum hg_status keep_motion(
    struct hg_temporal_view *t, const struct hg_temporal_picture *picture)
{
    hg_free(t->motion);
    t->motion = hg_calloc((size_t)picture->width * picture->height * 3, sizeof *t->motion);
    return t->motion != NULL ? hg_temporal_motion(picture, NULL, t->motion) : HG_E_NOMEM;
}

// The picture of the samples to pixels of the whole size.
static enum hg_status resolve(
    struct hg_view_state *view, struct hg_draw *draw, uint8_t *pixels, struct hg_error *err)
{
    struct hg_temporal_view *t = &view->motion.temporal;
    double(*matrices)[16] = hg_calloc(t->places.moved_count, sizeof *matrices);
    struct hg_temporal_picture picture;
    if (matrices == NULL)
        return no_memory(err);
    fill_picture(view, draw, matrices, &picture);
    float *depth = view->buffers.motion.mapped;
    hg_mirror_view_move(
        draw, depth, picture.ids ? (uint32_t *)(void *)(depth + pixels_of(draw)) : NULL);
    enum hg_status status =
        view->context->overrides.keeps_motion ? keep_motion(t, &picture) : HG_OK;
    if (status == HG_OK)
        status = hg_temporal_resolve(
            t->history, view->context->jobs, &picture, shown(&view->settings), pixels, &t->stats);
    hg_free(matrices);
    return status == HG_OK ? HG_OK : no_memory(err);
}

// The poses of this picture for the next one.
static enum hg_status keep_poses(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_temporal_view *t = &view->motion.temporal;
    struct hg_geometry *geometry = view->scene_gpu->geometry;
    enum hg_status status = HG_OK;
    if (hg_motion_table_deforms(geometry))
        status = hg_pose_snapshot_take(geometry, &t->pose, err);
    if (status == HG_OK && hg_motion_table_deforms(geometry))
        return HG_OK;
    hg_pose_snapshot_free(t->pose);
    t->pose = NULL;
    return status;
}

// The newest picture's depth.
static struct hg_shadow_depth depth_of(const struct hg_draw *draw)
{
    const VkExtent2D size = hg_frame_size(draw);
    return (struct hg_shadow_depth){draw->buffers->motion.mapped, size.width, size.height};
}

enum hg_status hg_temporal_view_resolve(
    struct hg_view_state *view, struct hg_draw *draw, struct hg_error *err)
{
    struct hg_temporal_view *t = &view->motion.temporal;
    if (!hg_draw_is(draw, HG_DRAW_MOTION))
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const uint32_t size[2] = {view->settings.width, view->settings.height};
    const float sharpen =
        shown(&view->settings) == HG_TEMPORAL_PICTURE ? view->settings.sharpen : 0.0f;
    enum hg_status status = make_history(t, &view->settings, err);
    if (status == HG_OK)
        status = resolve(view, draw, t->pixels, err);
    if (status == HG_OK && sharpen > 0.0f)
        hg_temporal_sharpen(
            view->context->jobs, t->pixels, size, sharpen, view->buffers.readback.buffer.mapped);
    else if (status == HG_OK)
        memcpy(view->buffers.readback.buffer.mapped, t->pixels, 4 * (size_t)size[0] * size[1]);
    if (status == HG_OK && hg_motion_table_note(&t->places, view->scene_gpu->geometry) != HG_OK)
        status = no_memory(err);
    if (status == HG_OK)
        status = keep_poses(view, err);
    t->camera = hg_frame_setup(draw);
    hg_geometry_origin(view->scene_gpu->geometry, t->origin);
    t->settings = view->settings_revision;
    t->scene = view->scene_gpu->scene->revision;
    t->moment = draw->request->moment;
    t->drawn = hg_draw_size(draw->request);
    hg_view_stats_add_stage(draw->stats, "temporal", hg_clock_now_ns() - start);
    const struct hg_shadow_depth depth = depth_of(draw);
    hg_lighting_see(view->lighting, &draw->frame->camera, &depth);
    return status;
}

void hg_temporal_view_show_pages(struct hg_view_state *view, const struct hg_draw *draw)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_shadow_depth depth = depth_of(draw);
    uint8_t *pixels = view->buffers.readback.buffer.mapped;
    if (!hg_draw_is(draw, HG_DRAW_MOTION) || !hg_lighting_has_pages(view->lighting))
        return;
    for (uint32_t y = 0; y < s->height; y++)
        for (uint32_t x = 0; x < s->width; x++, pixels += 4) {
            const uint32_t px[2] = {x * depth.width / s->width, y * depth.height / s->height};
            hg_lighting_page_color(view->lighting, &draw->frame->camera, &depth, px, pixels);
        }
}
