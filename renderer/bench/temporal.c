// temporal.c - pictures in motion against settled ones (helio bench temporal).
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/bench.h"
#include "renderer/bench/body.h"
#include "renderer/bench/common.h"
#include "renderer/image/metrics.h"
#include "renderer/internal.h"
#include "renderer/temporal/temporal.h"

#define DEFAULT_POSES   60
#define DEFAULT_SAMPLES 64
#define EVERY           5
#define GHOST_STEPS     8    // of the body
#define GHOST_STEP      0.1f // each, of its distance from the eye
#define GHOST_HALF      0.08f
#define WARM_UP_NS      UINT64_C(120000000000)

// Ways of making pictures; the first finds the motion for all.
static const struct mode {
    const char *name;
    enum hg_view_temporal temporal;
    float scale; // percent; 0: not set
} modes[] = {{"auto", HG_TEMPORAL_AUTO, 0}, {"none", HG_TEMPORAL_NONE, 0},
    {"scale_77", HG_TEMPORAL_AUTO, 77}, {"scale_67", HG_TEMPORAL_AUTO, 67},
    {"scale_50", HG_TEMPORAL_AUTO, 50}};
#define MODES (sizeof modes / sizeof modes[0])

// What one of them came to.
struct result {
    double flip, luma_error, change, cpu_ms;
    double temporal_ms; // of it, on the clock
    struct hg_bench_times frames;
    double ghost;     // mean error of luma where a fast body was before
    double after_cut; // FLIP of the first picture after a jump
};

struct run {
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    const struct hg_bench_settings *bench;
    struct hg_bench_pose line[DEFAULT_POSES];
    const struct hg_bench_pose *path;
    uint32_t path_count, width, height, compared, done;
    struct hg_view *settled, *moving;
    struct hg_node *body;
    float distance;           // of it from the eye, metres
    struct hg_refbuf *behind; // settled picture with the body where it comes to rest
    struct hg_refbuf **truth; // [path_count] settled pictures of those that are compared
    float **motion;           // [path_count] to the picture before, and whether it is there
    struct result results[MODES];
    double truth_change;
};

static bool is_compared(uint32_t pose)
{
    return pose % EVERY == EVERY - 1;
}

// --- poses ---------------------------------------------------------------------------------------

static void make_line(struct run *run)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    hg_scene_bounds(run->scene, NULL, min, max);
    const int along = max[0] - min[0] >= max[2] - min[2] ? 0 : 2, side = 2 - along;
    const float length = max[along] - min[along], height = max[1] - min[1];
    for (int i = 0; i < DEFAULT_POSES; i++) {
        struct hg_bench_pose *p = &run->line[i];
        const float t = (float)i / (DEFAULT_POSES - 1), turn = sinf(6.2831853f * t);
        p->eye[along] = min[along] + length * (0.3f + 0.25f * t);
        p->eye[1] = min[1] + height * (0.15f + 0.05f * t);
        p->eye[side] = 0.5f * (min[side] + max[side]);
        p->target[along] = p->eye[along] + length;
        p->target[1] = p->eye[1] + 0.1f * length * t;
        p->target[side] = p->eye[side] + 0.4f * length * turn;
    }
    run->path = run->line;
    run->path_count = DEFAULT_POSES;
}

static enum hg_status look(
    const struct run *run, struct hg_view *view, uint32_t pose, struct hg_error *err)
{
    struct hg_view_camera camera = {.vfov_rad = run->bench->vfov_rad};
    memcpy(camera.eye, run->path[pose].eye, sizeof camera.eye);
    memcpy(camera.target, run->path[pose].target, sizeof camera.target);
    return hg_view_set_camera(view, &camera, err);
}

static enum hg_status tell(struct run *run, struct hg_error *err)
{
    const uint32_t total = (uint32_t)(MODES + 1) * run->path_count;
    run->done++;
    return run->bench->progress == NULL || run->bench->progress(run->bench->progress_user,
                                               run->done < total ? run->done : total, total)
               ? HG_OK
               : hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

// --- pictures ------------------------------------------------------------------------------------

static enum hg_status settle(
    struct run *run, uint32_t pose, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_frame_info info = {0};
    enum hg_status status = look(run, run->settled, pose, err);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(run->settled, 16, &info, err);
    return status == HG_OK ? hg_view_read_pixels(run->settled, HG_PIXEL_RGBA8, out, err) : status;
}

static float luma(const uint8_t *p)
{
    return (0.299f * (float)p[0] + 0.587f * (float)p[1] + 0.114f * (float)p[2]) / 255.0f;
}

static float luma_at(const struct run *run, const uint8_t *rgba, float x, float y)
{
    const float tx = fminf(fmaxf(x - 0.5f, 0.0f), (float)run->width - 1.001f);
    const float ty = fminf(fmaxf(y - 0.5f, 0.0f), (float)run->height - 1.001f);
    const uint32_t ix = (uint32_t)tx, iy = (uint32_t)ty;
    const float fx = tx - (float)ix, fy = ty - (float)iy;
    const uint8_t *at = rgba + 4 * ((size_t)iy * run->width + ix);
    const uint8_t *below = at + 4 * (size_t)run->width;
    return (luma(at) * (1 - fx) + luma(at + 4) * fx) * (1 - fy) +
           (luma(below) * (1 - fx) + luma(below + 4) * fx) * fy;
}

// Mean change of luma where a pixel was a picture before, over those that were seen.
static double change(
    const struct run *run, const float *motion, const uint8_t *before, const uint8_t *now)
{
    double sum = 0;
    uint64_t count = 0;
    for (uint32_t y = 0; y < run->height; y++)
        for (uint32_t x = 0; x < run->width; x++) {
            const size_t i = (size_t)y * run->width + x;
            const float *m = motion + 3 * i;
            if (!(m[2] > 0.0f))
                continue;
            const float px = (float)x + 0.5f + m[0], py = (float)y + 0.5f + m[1];
            sum += fabs((double)(luma(now + 4 * i) - luma_at(run, before, px, py)));
            count++;
        }
    return count > 0 ? sum / (double)count : 0;
}

static enum hg_status compare(const struct run *run, struct hg_refbuf *truth,
    struct hg_refbuf *picture, struct result *result, struct hg_error *err)
{
    struct hg_image a = {.width = run->width, .height = run->height, .format = HG_PIXEL_RGBA8};
    struct hg_image b = a;
    a.size_bytes = b.size_bytes = (size_t)run->width * run->height * 4;
    a.pixels = truth->data;
    b.pixels = picture->data;
    const struct hg_image_pair pair = {&a, &b, NULL};
    const size_t pixels = (size_t)run->width * run->height;
    double flip = 0, sum = 0;
    const enum hg_status status = hg_image_compare(&pair, HG_METRIC_FLIP, &flip, NULL, err);
    for (size_t i = 0; i < pixels; i++)
        sum += fabs((double)(luma(truth->data + 4 * i) - luma(picture->data + 4 * i)));
    result->flip += flip;
    result->luma_error += sum / (double)pixels;
    return status;
}

// --- motion --------------------------------------------------------------------------------------

// Where the pixels of a pose were at the pose before, from the depth of the newest picture: nothing
// moves but the camera. depth_before: of the picture before.
static enum hg_status find_motion(
    struct run *run, uint32_t pose, float **depth_before, struct hg_error *err)
{
    struct hg_view_state *state = &run->moving->state;
    const size_t pixels = (size_t)run->width * run->height;
    float *depth = hg_calloc(pixels, sizeof *depth);
    if (depth == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    memcpy(depth, state->buffers.motion.mapped, pixels * sizeof *depth);
    if (is_compared(pose) && *depth_before != NULL) {
        struct hg_view_camera_state before = state->camera;
        for (int i = 0; i < 3; i++) {
            before.eye[i] = (double)run->path[pose - 1].eye[i];
            before.target[i] = (double)run->path[pose - 1].target[i];
        }
        struct hg_camera_setup now =
            hg_scene_gpu_camera(state->scene_gpu, &state->camera, run->width, run->height);
        const struct hg_camera_setup then =
            hg_scene_gpu_camera(state->scene_gpu, &before, run->width, run->height);
        now.jitter_px[0] = state->frame.jitter_px.x;
        now.jitter_px[1] = state->frame.jitter_px.y;
        double matrix[1][16];
        hg_camera_reproject(&now, &then, NULL, matrix[0]);
        const struct hg_temporal_picture picture = {.width = run->width,
            .height = run->height,
            .jitter_px = {now.jitter_px[0], now.jitter_px[1]},
            .depth = depth,
            .to_previous = (const double(*)[16])matrix,
            .matrix_count = 1};
        run->motion[pose] = hg_calloc(3 * pixels, sizeof **run->motion);
        if (run->motion[pose] == NULL ||
            hg_temporal_motion(&picture, *depth_before, run->motion[pose]) != HG_OK) {
            hg_free(depth);
            return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        }
    }
    hg_free(*depth_before);
    *depth_before = depth;
    return HG_OK;
}

// --- walks ---------------------------------------------------------------------------------------

static enum hg_status draw(struct run *run, uint32_t pose, struct hg_refbuf **picture,
    struct hg_frame_info *info, struct hg_error *err)
{
    enum hg_status status = look(run, run->moving, pose, err);
    if (status == HG_OK)
        status = hg_view_step(run->moving, 1, info, err);
    return status == HG_OK ? hg_view_read_pixels(run->moving, HG_PIXEL_RGBA8, picture, err)
                           : status;
}

// Until nothing is streamed or baked any more.
static enum hg_status warm_up(struct run *run, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    bool busy = true;
    enum hg_status status = HG_OK;
    while (busy && status == HG_OK && hg_clock_now_ns() - start < WARM_UP_NS) {
        busy = false;
        for (uint32_t i = 0; i < run->path_count && status == HG_OK; i += EVERY) {
            struct hg_refbuf *picture = NULL;
            struct hg_frame_info info = {0};
            struct hg_baking baking;
            status = draw(run, i, &picture, &info, err);
            hg_refbuf_unref(picture);
            hg_view_baking(run->moving, &baking);
            busy |= info.missing_pages > 0 || info.missing_clusters > 0 || baking.mesh_parts > 0 ||
                    baking.texels_done < baking.texels_total;
        }
    }
    return status;
}

static enum hg_status make_view(
    struct run *run, const struct mode *mode, struct hg_view **out, struct hg_error *err)
{
    const struct hg_view_params params = {.width = run->width,
        .height = run->height,
        .samples = run->bench->samples > 0 ? run->bench->samples : DEFAULT_SAMPLES,
        .gi = (enum hg_view_gi)run->bench->gi,
        .temporal = mode->temporal,
        .scale = mode->scale};
    const enum hg_status status = hg_view_create(run->renderer, run->scene, out, err);
    return status == HG_OK ? hg_view_set_params(*out, &params, err) : status;
}

// Time of a stage of the newest step.
static double stage_ms(const struct hg_view *view, const char *name)
{
    const struct hg_view_stats *s = &view->state.stats;
    double ms = 0;
    for (uint32_t i = 0; i < s->stage_count; i++)
        ms += strcmp(s->stages[i].name, name) == 0 ? (double)s->stages[i].ns * 1e-6 : 0;
    return ms;
}

// From the end of the path to its first pose that is compared.
static enum hg_status cut(struct run *run, struct result *result, struct hg_error *err)
{
    struct hg_refbuf *picture = NULL;
    struct hg_frame_info info;
    struct result first = {0};
    if (run->path_count < EVERY)
        return HG_OK;
    enum hg_status status = draw(run, EVERY - 1, &picture, &info, err);
    if (status == HG_OK)
        status = compare(run, run->truth[EVERY - 1], picture, &first, err);
    hg_refbuf_unref(picture);
    result->after_cut = first.flip;
    return status;
}

// The body at a step of its way across the picture of the first pose.
static void place_body(struct run *run, uint32_t step)
{
    const struct hg_bench_pose *p = &run->path[0];
    float ahead[3], at[3], length = 0;
    for (int i = 0; i < 3; i++) {
        ahead[i] = p->target[i] - p->eye[i];
        length += ahead[i] * ahead[i];
    }
    const float across[3] = {-ahead[2], 0, ahead[0]}; // to the right, with y up
    const float flat = hypotf(ahead[0], ahead[2]), d = run->distance;
    const float right = d * GHOST_STEP * ((float)step - 0.5f * (GHOST_STEPS - 1));
    for (int i = 0; i < 3; i++)
        at[i] = p->eye[i] + d * ahead[i] / sqrtf(length) + right * across[i] / flat;
    hg_bench_body_place(run->scene, run->body, at);
}

// Mean error in the rows of the body, from where it began to where it is.
static double trail_error(const struct run *run, const struct hg_refbuf *picture)
{
    const float vfov = run->bench->vfov_rad > 0 ? run->bench->vfov_rad : 0.7853981634f;
    const float px = 0.5f * (float)run->height / tanf(0.5f * vfov); // of one distance
    const float reach = 0.5f * GHOST_STEP * (GHOST_STEPS - 1);
    const float first = 0.5f * (float)run->width - reach * px;
    const float end = 0.5f * (float)run->width + (reach - 1.2f * GHOST_HALF) * px;
    const uint32_t half = (uint32_t)(0.8f * GHOST_HALF * px), middle = run->height / 2;
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t y = middle - half; y < middle + half; y++)
        for (uint32_t x = (uint32_t)fmaxf(first, 0.0f); x < (uint32_t)fmaxf(end, 0.0f); x++) {
            const size_t at = 4 * ((size_t)y * run->width + x);
            sum += fabs((double)(luma(run->behind->data + at) - luma(picture->data + at)));
            count++;
        }
    return count > 0 ? sum / count : 0;
}

// A body that crosses the picture, at about a sixth of its height with each picture.
static enum hg_status haunt(struct run *run, struct result *result, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < GHOST_STEPS && status == HG_OK; i++) {
        struct hg_refbuf *picture = NULL;
        struct hg_frame_info info;
        place_body(run, i);
        status = draw(run, 0, &picture, &info, err);
        if (status == HG_OK && i == GHOST_STEPS - 1)
            result->ghost = trail_error(run, picture);
        hg_refbuf_unref(picture);
    }
    hg_bench_body_place(run->scene, run->body, NULL);
    return status;
}

static enum hg_status walk(struct run *run, uint32_t number, struct hg_error *err)
{
    const struct mode *mode = &modes[number];
    struct result *result = &run->results[number];
    struct hg_refbuf *before = NULL, *now = NULL;
    float *depth = NULL;
    enum hg_status status = make_view(run, mode, &run->moving, err);
    if (status == HG_OK)
        status = warm_up(run, err);
    for (uint32_t i = 0; i < run->path_count && status == HG_OK; i++) {
        struct hg_frame_info info;
        const uint64_t cpu = hg_clock_cpu_ns(), start = hg_clock_now_ns();
        status = draw(run, i, &now, &info, err);
        const uint64_t end = hg_clock_now_ns();
        result->cpu_ms += (double)(hg_clock_cpu_ns() - cpu) * 1e-6;
        if (status == HG_OK && hg_bench_times_add(&result->frames, end - start) != HG_OK)
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        result->temporal_ms += stage_ms(run->moving, "temporal");
        if (status == HG_OK && number == 0)
            status = find_motion(run, i, &depth, err);
        if (status == HG_OK && is_compared(i)) {
            status = compare(run, run->truth[i], now, result, err);
            if (run->motion[i] != NULL)
                result->change += change(run, run->motion[i], before->data, now->data);
        }
        hg_refbuf_unref(before);
        before = now;
        now = NULL;
        if (status == HG_OK)
            status = tell(run, err);
    }
    if (status == HG_OK)
        status = cut(run, result, err);
    if (status == HG_OK)
        status = haunt(run, result, err);
    hg_free(depth);
    hg_refbuf_unref(before);
    hg_view_destroy(run->moving);
    run->moving = NULL;
    return status;
}

static enum hg_status settle_all(struct run *run, struct hg_error *err)
{
    enum hg_status status = make_view(run, &modes[0], &run->settled, err);
    if (status == HG_OK)
        hg_view_set_final(run->settled, true);
    for (uint32_t i = 0; i < run->path_count && status == HG_OK; i++) {
        if (is_compared(i) || is_compared(i + 1))
            status = settle(run, i, &run->truth[i], err);
        if (status == HG_OK)
            status = tell(run, err);
    }
    place_body(run, GHOST_STEPS - 1);
    if (status == HG_OK)
        status = settle(run, 0, &run->behind, err);
    hg_bench_body_place(run->scene, run->body, NULL);
    return status;
}

static void change_of_truth(struct run *run)
{
    for (uint32_t i = 1; i < run->path_count; i++) {
        if (run->motion[i] == NULL)
            continue;
        run->compared++;
        run->truth_change +=
            change(run, run->motion[i], run->truth[i - 1]->data, run->truth[i]->data);
    }
}

// --- report --------------------------------------------------------------------------------------

static enum hg_status write_report(const struct run *run, char **text)
{
    const double count = run->compared > 0 ? run->compared : 1, poses = run->path_count;
    struct hg_writer w = {0};
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"poses\":%u,\"compared\":%u", run->width,
        run->height, run->path_count, run->compared);
    for (uint32_t m = 0; m < MODES; m++) {
        const struct result *r = &run->results[m];
        const double median = hg_bench_times_at(&r->frames, 0.5);
        hg_json_put(&w,
            ",\"%s\":{\"flip\":%.5f,\"luma_error\":%.6f,\"flicker\":%.4f,\"ghost\":%.6f,\"after_"
            "cut\":%.5f,"
            "\"cpu_ms\":%.3f,\"temporal_ms\":%.3f,\"frame_ms\":%.3f,\"p95_over_median\":%.3f}",
            modes[m].name, r->flip / count, r->luma_error / count,
            run->truth_change > 0 ? r->change / run->truth_change : 0, r->ghost, r->after_cut,
            r->cpu_ms / poses, r->temporal_ms / poses, median,
            median > 0 ? hg_bench_times_at(&r->frames, 0.95) / median : 0);
    }
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

static enum hg_status prepare(struct run *run, struct hg_error *err)
{
    const struct hg_bench_settings *b = run->bench;
    run->width = b->width > 0 ? b->width : 1280;
    run->height = b->height > 0 ? b->height : 720;
    run->path = b->path;
    run->path_count = b->path_count;
    hg_scene_update(run->scene);
    if (run->path_count == 0)
        make_line(run);
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    hg_scene_bounds(run->scene, NULL, min, max);
    run->distance = 0.2f * fmaxf(fmaxf(max[0] - min[0], max[1] - min[1]), max[2] - min[2]);
    const enum hg_status status =
        hg_bench_body_add(run->scene, GHOST_HALF * run->distance, &run->body);
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "no body to move");
    run->truth = hg_calloc(run->path_count, sizeof *run->truth);
    run->motion = hg_calloc(run->path_count, sizeof *run->motion);
    return run->truth != NULL && run->motion != NULL
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

enum hg_status hg_bench_temporal_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run *run = hg_calloc(1, sizeof *run);
    if (run == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    run->renderer = renderer;
    run->scene = scene;
    run->bench = bench;
    enum hg_status status = prepare(run, err);
    if (status == HG_OK)
        status = settle_all(run, err);
    for (uint32_t m = 0; m < MODES && status == HG_OK; m++)
        status = walk(run, m, err);
    if (status == HG_OK) {
        change_of_truth(run);
        status = write_report(run, text);
    }
    hg_view_destroy(run->moving);
    hg_view_destroy(run->settled);
    hg_refbuf_unref(run->behind);
    for (uint32_t i = 0; i < run->path_count && run->truth != NULL && run->motion != NULL; i++) {
        hg_refbuf_unref(run->truth[i]);
        hg_free(run->motion[i]);
    }
    for (uint32_t m = 0; m < MODES; m++)
        hg_bench_times_finish(&run->results[m].frames);
    hg_free(run->truth);
    hg_free(run->motion);
    hg_free(run);
    return status;
}
