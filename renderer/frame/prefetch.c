#include "renderer/frame/prefetch.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "renderer/frame/frame.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/visibility.h"

#define SMALLER     8           // by which the sides of the picture are
#define WIDER       1.3         // than the view: turns are foreseen only nearly
#define HORIZON_NS  300000000u  // how far ahead, or two changes of the camera
#define STEADY_NS   1500000000u // longest time between three places that belong to one movement
#define SHARE       16          // of the time is spent, one part in so many
#define TURN_MOST   0.8         // radians ahead
#define FASTER_MOST 4.0         // from one change to the next, in a steady movement

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double normalize(double v[3])
{
    const double length = sqrt(dot(v, v));
    for (int i = 0; i < 3 && length > 0; i++)
        v[i] /= length;
    return length;
}

// --- where it will be ----------------------------------------------------------------------------

static struct hg_prefetch_place place_of(const struct hg_view_camera_state *camera)
{
    struct hg_prefetch_place p = {.ns = hg_clock_now_ns()};
    for (int i = 0; i < 3; i++) {
        p.eye[i] = camera->eye[i];
        p.direction[i] = camera->target[i] - camera->eye[i];
        p.up[i] = camera->up[i];
    }
    p.distance = normalize(p.direction);
    return p;
}

// Two changes that belong to one movement: much the same direction, and not of very different size.
static bool agree(const double a[3], const double b[3])
{
    const double la = sqrt(dot(a, a)), lb = sqrt(dot(b, b));
    if (la == 0 && lb == 0)
        return true;
    return la <= FASTER_MOST * lb && lb <= FASTER_MOST * la && dot(a, b) > 0.5 * la * lb;
}

bool hg_prefetch_predict(const struct hg_prefetch_place places[3], uint64_t horizon_ns,
    struct hg_view_camera_state *camera)
{
    const struct hg_prefetch_place *p = places;
    double move[2][3], turn[2][3], direction[3];
    const bool timed = p[0].ns > p[1].ns && p[1].ns > p[2].ns;
    if (!timed || p[0].ns - p[2].ns > STEADY_NS)
        return false;
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            move[i][k] = p[i].eye[k] - p[i + 1].eye[k];
            turn[i][k] = p[i].direction[k] - p[i + 1].direction[k];
        }
    if (!agree(move[0], move[1]) || !agree(turn[0], turn[1]))
        return false;
    // In units of the time between the first and the last place.
    double time = (double)horizon_ns / (double)(p[0].ns - p[2].ns);
    time = time > 1 ? time : 1; // two changes ahead at least
    for (int k = 0; k < 3; k++) {
        move[0][k] += move[1][k];
        turn[0][k] += turn[1][k];
    }
    const double angle = sqrt(dot(turn[0], turn[0])) * time;
    const double turning = angle > TURN_MOST ? time * TURN_MOST / angle : time;
    for (int k = 0; k < 3; k++)
        direction[k] = p[0].direction[k] + turn[0][k] * turning;
    if (!(normalize(direction) > 0))
        return false;
    for (int k = 0; k < 3; k++) {
        camera->eye[k] = p[0].eye[k] + move[0][k] * time;
        camera->target[k] = camera->eye[k] + direction[k] * p[0].distance;
    }
    return true;
}

// True when the camera has changed since the last time.
static bool note_place(struct hg_view_state *view)
{
    struct hg_prefetch *a = &view->ahead;
    if (a->place_count > 0 && a->revision == view->camera_revision)
        return false;
    memmove(a->places + 1, a->places, 2 * sizeof a->places[0]);
    a->places[0] = place_of(&view->camera);
    a->place_count += a->place_count < 3;
    a->revision = view->camera_revision;
    return true;
}

// --- the picture ---------------------------------------------------------------------------------

void hg_prefetch_finish(struct hg_gpu *gpu, struct hg_prefetch *a)
{
    hg_gpu_image_destroy(gpu, &a->visibility);
    hg_gpu_image_destroy(gpu, &a->depth);
    hg_gpu_image_destroy(gpu, &a->color);
    hg_culling_destroy(a->visible);
    *a = (struct hg_prefetch){0};
}

static enum hg_status make(struct hg_view_state *view, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {.format = format,
        .width = (uint32_t)(view->settings.width * WIDER) / SMALLER + 1,
        .height = (uint32_t)(view->settings.height * WIDER) / SMALLER + 1,
        .attachment = true,
        .name = name};
    if (image->width == params.width && image->height == params.height)
        return HG_OK;
    hg_gpu_image_destroy(view->context->gpu, image);
    return hg_gpu_image_create(view->context->gpu, &params, image, err);
}

static enum hg_status make_all(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_prefetch *a = &view->ahead;
    enum hg_status status =
        make(view, HG_VISIBILITY_FORMAT, "ahead visibility", &a->visibility, err);
    if (status == HG_OK)
        status = make(view, HG_DEPTH_FORMAT, "ahead depth", &a->depth, err);
    if (status == HG_OK)
        status = make(view, HG_COLOR_FORMAT, "ahead colour", &a->color, err);
    if (status == HG_OK && a->visible == NULL)
        status = hg_culling_create(view->context->gpu, &a->visible, err);
    return status;
}

// What a view draws with, put aside while it looks ahead.
struct aside {
    struct hg_view_camera_state camera;
    struct hg_gpu_frame frame;
    struct hg_culling *visible;
    struct hg_gpu_image visibility, depth, accumulated;
    uint32_t missing_clusters;
};

static void look_ahead(
    struct hg_view_state *view, const struct hg_view_camera_state *camera, struct aside *aside)
{
    *aside = (struct aside){view->camera, view->frame, view->visible, view->targets.visibility,
        view->targets.depth, view->targets.accumulated, view->missing_clusters};
    view->camera = *camera;
    view->visible = view->ahead.visible;
    view->targets.visibility = view->ahead.visibility;
    view->targets.depth = view->ahead.depth;
    view->targets.accumulated = view->ahead.color;
    view->stream.finding = SMALLER;
    view->stream.wider = (float)WIDER;
}

static void look_back(struct hg_view_state *view, const struct aside *aside)
{
    view->ahead.visibility = view->targets.visibility; // images know their layouts
    view->ahead.depth = view->targets.depth;
    view->ahead.color = view->targets.accumulated;
    view->camera = aside->camera;
    view->frame = aside->frame;
    view->visible = aside->visible;
    view->targets.visibility = aside->visibility;
    view->targets.depth = aside->depth;
    view->targets.accumulated = aside->accumulated;
    view->missing_clusters = aside->missing_clusters;
    view->stream.finding = 0;
    view->stream.wider = 0;
}

static enum hg_status draw(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_page_cache *pages = hg_textures_cache(view->scene_gpu->textures);
    struct hg_gpu *gpu = view->context->gpu;
    struct hg_page_demand demand;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    hg_page_cache_begin(pages, cmd);
    status = hg_frame_record_prefetch(view, cmd, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    hg_page_cache_end(pages, cmd);
    status = hg_gpu_submit_and_wait(gpu, cmd, err);
    if (status == HG_OK)
        hg_page_cache_collect(pages, HG_PAGES_PREFETCH, &demand);
    return status;
}

static void widen(struct hg_view_camera_state *camera)
{
    camera->half_height *= (float)WIDER;
    camera->vfov_rad = 2.0f * atanf((float)WIDER * tanf(0.5f * camera->vfov_rad));
}

// Pictures that come seldom look further, else what is seen between two of them is missed.
static uint64_t horizon(const struct hg_prefetch *a, uint64_t now_ns)
{
    const uint64_t since = now_ns - a->begun_ns, needed = since + HORIZON_NS / 2;
    if (a->begun_ns == 0 || since > STEADY_NS || needed < HORIZON_NS)
        return HORIZON_NS;
    return needed;
}

enum hg_status hg_prefetch_draw(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_prefetch *a = &view->ahead;
    struct hg_view_camera_state camera = view->camera;
    const uint64_t start = hg_clock_now_ns();
    if (view->context->overrides.no_prefetch || !note_place(view) || a->place_count < 3)
        return HG_OK;
    if (!view->stream.on || start < a->next_ns ||
        !hg_prefetch_predict(a->places, horizon(a, start), &camera))
        return HG_OK;
    widen(&camera);
    enum hg_status status = make_all(view, err);
    if (status != HG_OK)
        return status;
    struct aside aside;
    look_ahead(view, &camera, &aside);
    status = draw(view, err);
    look_back(view, &aside);
    const uint64_t end = hg_clock_now_ns();
    a->begun_ns = start;
    a->next_ns = end + SHARE * (end - start);
    a->drawn++;
    hg_view_add_stage(view, "ahead", end - start);
    return status;
}
