#include "renderer/frame/streaming/prefetch.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec3d.h"
#include "renderer/frame/batch/batch.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/visibility.h"

#define SMALLER     8           // by which the sides of the picture are
#define WIDER       1.3         // than the view: turns are foreseen only nearly
#define HORIZON_NS  300000000u  // how far ahead, or two changes of the camera
#define STEADY_NS   1500000000u // longest time between three places that belong to one movement
#define SHARE       16          // of the time is spent, one part in so many,
#define IDLE_SHARE  32          // and where the picture before found nothing that was missing
#define TURN_MOST   0.8         // radians ahead
#define FASTER_MOST 4.0         // from one change to the next, in a steady movement

static double normalize(double v[3])
{
    const double length = sqrt(hg_dot3d(v, v));
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

// Two changes belong to one movement: similar direction and size.
static bool agree(const double a[3], const double b[3])
{
    const double la = sqrt(hg_dot3d(a, a)), lb = sqrt(hg_dot3d(b, b));
    if (la == 0 && lb == 0)
        return true;
    return la <= FASTER_MOST * lb && lb <= FASTER_MOST * la && hg_dot3d(a, b) > 0.5 * la * lb;
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
    // In units of the time between the first and the last position.
    double time = (double)horizon_ns / (double)(p[0].ns - p[2].ns);
    time = time > 1 ? time : 1; // at least two changes later
    for (int k = 0; k < 3; k++) {
        move[0][k] += move[1][k];
        turn[0][k] += turn[1][k];
    }
    const double angle = sqrt(hg_dot3d(turn[0], turn[0])) * time;
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
static bool note_place(
    struct hg_prefetch *a, const struct hg_view_camera_state *camera, uint64_t revision)
{
    if (a->place_count > 0 && a->revision == revision)
        return false;
    memmove(a->places + 1, a->places, 2 * sizeof a->places[0]);
    a->places[0] = place_of(camera);
    a->place_count += a->place_count < 3;
    a->revision = revision;
    return true;
}

// --- the picture ---------------------------------------------------------------------------------

void hg_prefetch_finish(struct hg_gpu *gpu, struct hg_prefetch *a)
{
    hg_graph_destroy(a->targets.graph);
    hg_gpu_image_destroy(gpu, &a->targets.visibility);
    hg_gpu_image_destroy(gpu, &a->targets.depth);
    hg_gpu_image_destroy(gpu, &a->targets.accumulated);
    hg_culling_destroy(a->culling);
    *a = (struct hg_prefetch){0};
}

static enum hg_status make(const struct hg_draw *draw, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err)
{
    const struct hg_view_settings *settings = draw->request->settings;
    const struct hg_gpu_image_params params = {.format = format,
        .width = (uint32_t)(settings->width * WIDER) / SMALLER + 1,
        .height = (uint32_t)(settings->height * WIDER) / SMALLER + 1,
        .attachment = true,
        .name = name};
    if (image->width == params.width && image->height == params.height)
        return HG_OK;
    hg_gpu_image_destroy(draw->context->gpu, image);
    return hg_gpu_image_create(draw->context->gpu, &params, image, err);
}

static enum hg_status make_all(
    struct hg_prefetch *a, const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_view_targets *t = &a->targets;
    enum hg_status status =
        make(draw, HG_VISIBILITY_FORMAT, "prefetch visibility", &t->visibility, err);
    if (status == HG_OK)
        status = make(draw, HG_DEPTH_FORMAT, "prefetch depth", &t->depth, err);
    if (status == HG_OK)
        status = make(draw, HG_COLOR_FORMAT, "prefetch colour", &t->accumulated, err);
    if (status == HG_OK && a->culling == NULL)
        status = hg_culling_create(draw->context->gpu, &a->culling, err);
    return status;
}

// missing: pages and parts of geometry that are not resident.
static enum hg_status draw_picture(struct hg_draw *draw, uint32_t *missing, struct hg_error *err)
{
    struct hg_page_cache *pages = hg_textures_cache(draw->scene_gpu->textures);
    struct hg_gpu *gpu = draw->context->gpu;
    struct hg_page_demand demand = {0};
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    hg_page_cache_begin(pages, cmd);
    status = hg_frame_record_prefetch(draw, cmd, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    hg_page_cache_end(pages, cmd);
    status = hg_gpu_submit_and_wait(gpu, cmd, err);
    if (status == HG_OK)
        hg_page_cache_collect(pages, HG_PAGES_PREFETCH, &demand);
    *missing = demand.missing + hg_culling_set(draw->culling, 0)->missing;
    return status;
}

static void widen(struct hg_view_camera_state *camera)
{
    camera->half_height *= (float)WIDER;
    camera->vfov_rad = 2.0f * atanf((float)WIDER * tanf(0.5f * camera->vfov_rad));
}

// At low frame rates the horizon is longer, to cover the time between two frames.
static uint64_t horizon(const struct hg_prefetch *a, uint64_t now_ns)
{
    const uint64_t since = now_ns - a->begun_ns, needed = since + HORIZON_NS / 2;
    if (a->begun_ns == 0 || since > STEADY_NS || needed < HORIZON_NS)
        return HORIZON_NS;
    return needed;
}

enum hg_status hg_prefetch_draw(
    struct hg_prefetch *a, const struct hg_draw *draw, uint64_t revision, struct hg_error *err)
{
    struct hg_view_camera_state camera = *draw->request->camera;
    const uint64_t start = hg_clock_now_ns();
    if (draw->context->overrides.no_prefetch || !note_place(a, &camera, revision) ||
        a->place_count < 3)
        return HG_OK;
    if (!draw->accumulation->pages.on || start < a->next_ns ||
        !hg_prefetch_predict(a->places, horizon(a, start), &camera))
        return HG_OK;
    widen(&camera);
    enum hg_status status = make_all(a, draw, err);
    if (status != HG_OK)
        return status;
    struct hg_draw_request request = *draw->request;
    request.camera = &camera;
    request.smaller = SMALLER;
    request.wider = (float)WIDER;
    request.moment = 0;
    request.drawn = (VkExtent2D){0};
    struct hg_draw look_ahead = hg_draw_with(draw, &request);
    look_ahead.culling = a->culling;
    look_ahead.targets = &a->targets;
    look_ahead.frame = &a->frame;
    uint32_t missing = 0;
    status = draw_picture(&look_ahead, &missing, err);
    const uint64_t end = hg_clock_now_ns();
    a->begun_ns = start;
    a->next_ns = end + (missing > 0 ? SHARE : IDLE_SHARE) * (end - start);
    a->drawn++;
    hg_view_stats_add_stage(draw->stats, "prefetch", end - start);
    return status;
}
