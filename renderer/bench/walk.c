#include "renderer/bench/walk.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/image/metrics.h"
#include "renderer/internal.h"
#include "renderer/temporal/temporal.h"

#define WARM_UP_NS   UINT64_C(120000000000)
#define STEP_SAMPLES 16

// --- poses ---------------------------------------------------------------------------------------

static void make_line(struct hg_bench_walk *walk)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    hg_scene_bounds(walk->scene, NULL, min, max);
    const int along = max[0] - min[0] >= max[2] - min[2] ? 0 : 2, side = 2 - along;
    const float length = max[along] - min[along], height = max[1] - min[1];
    for (int i = 0; i < HG_BENCH_WALK_POSES; i++) {
        struct hg_bench_pose *p = &walk->line[i];
        const float t = (float)i / (HG_BENCH_WALK_POSES - 1), turn = sinf(6.2831853f * t);
        p->eye[along] = min[along] + length * (0.3f + 0.25f * t);
        p->eye[1] = min[1] + height * (0.15f + 0.05f * t);
        p->eye[side] = 0.5f * (min[side] + max[side]);
        p->target[along] = p->eye[along] + length;
        p->target[1] = p->eye[1] + 0.1f * length * t;
        p->target[side] = p->eye[side] + 0.4f * length * turn;
    }
    walk->path = walk->line;
    walk->path_count = HG_BENCH_WALK_POSES;
}

enum hg_status hg_bench_walk_init(struct hg_bench_walk *walk, struct hg_scene *scene,
    const struct hg_bench_settings *bench, struct hg_error *err)
{
    *walk = (struct hg_bench_walk){.scene = scene,
        .vfov_rad = bench->vfov_rad,
        .path = bench->path,
        .path_count = bench->path_count,
        .width = bench->width > 0 ? bench->width : 1280,
        .height = bench->height > 0 ? bench->height : 720};
    hg_scene_update(scene);
    if (walk->path_count == 0)
        make_line(walk);
    walk->motion = hg_calloc(walk->path_count, sizeof *walk->motion);
    return walk->motion != NULL
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

void hg_bench_walk_finish(struct hg_bench_walk *walk)
{
    for (uint32_t i = 0; i < walk->path_count && walk->motion != NULL; i++)
        hg_free(walk->motion[i]);
    hg_free(walk->motion);
    *walk = (struct hg_bench_walk){0};
}

bool hg_bench_walk_is_compared(uint32_t pose)
{
    return pose % HG_BENCH_WALK_EVERY == HG_BENCH_WALK_EVERY - 1;
}

enum hg_status hg_bench_walk_look(
    const struct hg_bench_walk *walk, struct hg_view *view, uint32_t pose, struct hg_error *err)
{
    struct hg_view_camera camera = {.vfov_rad = walk->vfov_rad};
    memcpy(camera.eye, walk->path[pose].eye, sizeof camera.eye);
    memcpy(camera.target, walk->path[pose].target, sizeof camera.target);
    return hg_view_set_camera(view, &camera, err);
}

// --- pictures ------------------------------------------------------------------------------------

static enum hg_status draw(const struct hg_bench_walk *walk, struct hg_view *view, uint32_t pose,
    struct hg_frame_info *info, struct hg_error *err)
{
    const enum hg_status status = hg_bench_walk_look(walk, view, pose, err);
    return status == HG_OK ? hg_view_step(view, 1, info, err) : status;
}

enum hg_status hg_bench_walk_draw(const struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, struct hg_refbuf **picture, struct hg_error *err)
{
    struct hg_frame_info info;
    const enum hg_status status = draw(walk, view, pose, &info, err);
    return status == HG_OK ? hg_view_read_pixels(view, HG_PIXEL_RGBA8, picture, err) : status;
}

enum hg_status hg_bench_walk_settle(const struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, struct hg_refbuf **picture, struct hg_error *err)
{
    struct hg_frame_info info = {0};
    enum hg_status status = hg_bench_walk_look(walk, view, pose, err);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(view, STEP_SAMPLES, &info, err);
    return status == HG_OK ? hg_view_read_pixels(view, HG_PIXEL_RGBA8, picture, err) : status;
}

enum hg_status hg_bench_walk_warm_up(
    const struct hg_bench_walk *walk, struct hg_view *view, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    // Never twice the same pose: a view that stays where it is rests.
    const uint32_t stride = walk->path_count > HG_BENCH_WALK_EVERY ? HG_BENCH_WALK_EVERY : 1;
    bool busy = true;
    enum hg_status status = HG_OK;
    while (busy && status == HG_OK && hg_clock_now_ns() - start < WARM_UP_NS) {
        busy = false;
        for (uint32_t i = 0; i < walk->path_count && status == HG_OK; i += stride) {
            struct hg_frame_info info = {0};
            struct hg_baking baking;
            status = draw(walk, view, i, &info, err);
            hg_view_baking(view, &baking);
            busy |= info.missing_pages > 0 || info.missing_clusters > 0 || baking.mesh_parts > 0 ||
                    baking.texels_done < baking.texels_total;
        }
    }
    return status;
}

// --- motion --------------------------------------------------------------------------------------

enum hg_status hg_bench_walk_find_motion(struct hg_bench_walk *walk, struct hg_view *view,
    uint32_t pose, float **depth_before, struct hg_error *err)
{
    struct hg_view_state *state = &view->state;
    const size_t pixels = (size_t)walk->width * walk->height;
    float *depth = hg_calloc(pixels, sizeof *depth);
    if (depth == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    memcpy(depth, state->buffers.motion.mapped, pixels * sizeof *depth);
    if (hg_bench_walk_is_compared(pose) && *depth_before != NULL) {
        struct hg_view_camera_state before = state->camera;
        for (int i = 0; i < 3; i++) {
            before.eye[i] = (double)walk->path[pose - 1].eye[i];
            before.target[i] = (double)walk->path[pose - 1].target[i];
        }
        struct hg_camera_setup now =
            hg_scene_gpu_camera(state->scene_gpu, &state->camera, walk->width, walk->height);
        const struct hg_camera_setup then =
            hg_scene_gpu_camera(state->scene_gpu, &before, walk->width, walk->height);
        now.jitter_px[0] = state->frame.jitter_px.x;
        now.jitter_px[1] = state->frame.jitter_px.y;
        double matrix[1][16];
        hg_camera_reproject(&now, &then, NULL, matrix[0]);
        const struct hg_temporal_picture picture = {.width = walk->width,
            .height = walk->height,
            .jitter_px = {now.jitter_px[0], now.jitter_px[1]},
            .depth = depth,
            .to_previous = (const double(*)[16])matrix,
            .matrix_count = 1};
        walk->motion[pose] = hg_calloc(3 * pixels, sizeof **walk->motion);
        if (walk->motion[pose] == NULL ||
            hg_temporal_motion(&picture, *depth_before, walk->motion[pose]) != HG_OK) {
            hg_free(depth);
            return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        }
    }
    hg_free(*depth_before);
    *depth_before = depth;
    return HG_OK;
}

// --- judging -------------------------------------------------------------------------------------

float hg_bench_luma(const uint8_t *p)
{
    return (0.299f * (float)p[0] + 0.587f * (float)p[1] + 0.114f * (float)p[2]) / 255.0f;
}

static float luma_at(const struct hg_bench_walk *walk, const uint8_t *rgba, float x, float y)
{
    const float tx = fminf(fmaxf(x - 0.5f, 0.0f), (float)walk->width - 1.001f);
    const float ty = fminf(fmaxf(y - 0.5f, 0.0f), (float)walk->height - 1.001f);
    const uint32_t ix = (uint32_t)tx, iy = (uint32_t)ty;
    const float fx = tx - (float)ix, fy = ty - (float)iy;
    const uint8_t *at = rgba + 4 * ((size_t)iy * walk->width + ix);
    const uint8_t *below = at + 4 * (size_t)walk->width;
    return (hg_bench_luma(at) * (1 - fx) + hg_bench_luma(at + 4) * fx) * (1 - fy) +
           (hg_bench_luma(below) * (1 - fx) + hg_bench_luma(below + 4) * fx) * fy;
}

double hg_bench_walk_change(
    const struct hg_bench_walk *walk, uint32_t pose, const uint8_t *before, const uint8_t *now)
{
    const float *motion = walk->motion[pose];
    double sum = 0;
    uint64_t count = 0;
    for (uint32_t y = 0; y < walk->height; y++)
        for (uint32_t x = 0; x < walk->width; x++) {
            const size_t i = (size_t)y * walk->width + x;
            const float *m = motion + 3 * i;
            if (!(m[2] > 0.0f))
                continue;
            const float px = (float)x + 0.5f + m[0], py = (float)y + 0.5f + m[1];
            sum += fabs((double)(hg_bench_luma(now + 4 * i) - luma_at(walk, before, px, py)));
            count++;
        }
    return count > 0 ? sum / (double)count : 0;
}

double hg_bench_walk_luma_error(
    const struct hg_bench_walk *walk, const uint8_t *truth, const uint8_t *picture)
{
    const size_t pixels = (size_t)walk->width * walk->height;
    double sum = 0;
    for (size_t i = 0; i < pixels; i++)
        sum += fabs((double)(hg_bench_luma(truth + 4 * i) - hg_bench_luma(picture + 4 * i)));
    return sum / (double)pixels;
}

enum hg_status hg_bench_walk_flip(const struct hg_bench_walk *walk, uint8_t *truth,
    uint8_t *picture, double *flip, struct hg_error *err)
{
    struct hg_image a = {.width = walk->width, .height = walk->height, .format = HG_PIXEL_RGBA8};
    struct hg_image b = a;
    a.size_bytes = b.size_bytes = (size_t)walk->width * walk->height * 4;
    a.pixels = truth;
    b.pixels = picture;
    const struct hg_image_pair pair = {&a, &b, NULL};
    return hg_image_compare(&pair, HG_METRIC_FLIP, flip, NULL, err);
}
