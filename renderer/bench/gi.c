// gi.c - global illumination in motion against the truth (helio bench gi).
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/gi_rooms.h"
#include "renderer/bench/references.h"
#include "renderer/bench/walk.h"
#include "renderer/scene/demo/demo.h"

#define DEFAULT_SAMPLES 128 // of a reference
#define COLUMNS         8
#define ROWS            6
#define SETTLED_SAMPLES 32
#define LIGHTS          2
#define DEFAULT_LAMPS   8
#define SUN_TURBIDITY   2.0f        // as views of the protocol have it
#define LAMP_ID         0x6c616d70u // of the first

// What one way of making pictures came to, summed over those that are compared.
struct result {
    double flip, region, worst_region, change, cpu_ms;
};

// A walk under one light.
struct light {
    const char *name;
    struct hg_refbuf **truth; // [path_count] of the poses that are compared, and those before
    struct result results[HG_BENCH_WAYS];
    struct hg_bench_references references;
    double truth_change;
    float exposure_ev; // of all its pictures
};

const char *const hg_bench_way_names[HG_BENCH_WAYS] = {
    "none", "probes", "rested", "shown", "shown_rested", "settled"};

struct run {
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    const struct hg_bench_settings *bench;
    struct hg_bench_walk walk;
    struct light lights[LIGHTS];
    struct hg_bench_gi_rooms rooms;
    uint32_t compared, done;
};

static bool is_walked(const struct run *run, int way)
{
    return run->bench->ways == 0 || (run->bench->ways >> way & 1) != 0;
}

static enum hg_status tell(struct run *run, struct hg_error *err)
{
    const uint32_t lights = (run->bench->left_out & HG_BENCH_NIGHT) ? 1 : LIGHTS;
    const uint32_t total = lights * (HG_BENCH_WAYS + 1) * run->walk.path_count;
    run->done++;
    return run->bench->progress == NULL || run->bench->progress(run->bench->progress_user,
                                               run->done < total ? run->done : total, total)
               ? HG_OK
               : hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

// --- judging -------------------------------------------------------------------------------------

static void mean_luminance(const struct run *run, const uint8_t *rgba, double cells[ROWS * COLUMNS])
{
    static const double weights[3] = {0.2126, 0.7152, 0.0722};
    const uint32_t width = run->walk.width, height = run->walk.height;
    uint32_t counts[ROWS * COLUMNS] = {0};
    memset(cells, 0, ROWS * COLUMNS * sizeof *cells);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++, rgba += 4) {
            const uint64_t cell =
                (uint64_t)y * ROWS / height * COLUMNS + (uint64_t)x * COLUMNS / width;
            counts[cell]++;
            for (int c = 0; c < 3; c++) {
                const double v = rgba[c] / 255.0;
                cells[cell] +=
                    weights[c] * (v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4));
            }
        }
    for (int i = 0; i < ROWS * COLUMNS; i++)
        cells[i] /= counts[i] > 0 ? counts[i] : 1;
}

// Relative, of what is displayed; below a hundredth of white against that.
static void compare_regions(
    const struct run *run, const uint8_t *truth, const uint8_t *picture, struct result *out)
{
    double a[ROWS * COLUMNS], b[ROWS * COLUMNS], sum = 0, worst = 0;
    mean_luminance(run, truth, a);
    mean_luminance(run, picture, b);
    for (int i = 0; i < ROWS * COLUMNS; i++) {
        const double error = fabs(a[i] - b[i]) / fmax(a[i], 0.01);
        sum += error;
        worst = fmax(worst, error);
    }
    out->region += sum / (ROWS * COLUMNS);
    out->worst_region += worst;
}

static enum hg_status write_picture(const struct run *run, const struct light *light,
    const char *name, uint32_t pose, struct hg_refbuf *picture, struct hg_error *err)
{
    char path[4096];
    if (run->bench->pictures == NULL)
        return HG_OK;
    const int length = snprintf(
        path, sizeof path, "%s/%s_%s_%02u.png", run->bench->pictures, light->name, name, pose);
    return length < (int)sizeof path
               ? hg_bench_picture_write(&run->walk, path, picture, err)
               : hg_error_set(err, HG_E_LIMIT, "bench", "pictures", "too long a path");
}

static enum hg_status compare(const struct run *run, const struct light *light, uint32_t pose,
    struct hg_refbuf *const pictures[2], struct result *out, struct hg_error *err)
{
    double flip = 0;
    const enum hg_status status =
        hg_bench_walk_flip(&run->walk, light->truth[pose]->data, pictures[1]->data, &flip, err);
    out->flip += flip;
    compare_regions(run, light->truth[pose]->data, pictures[1]->data, out);
    if (run->walk.motion[pose] != NULL && pictures[0] != NULL)
        out->change += hg_bench_walk_change(&run->walk, pose, pictures[0]->data, pictures[1]->data);
    return status;
}

// --- views ---------------------------------------------------------------------------------------

static struct hg_view_params params_of(const struct run *run, const struct light *light)
{
    return (struct hg_view_params){.width = run->walk.width,
        .height = run->walk.height,
        .samples = 1,
        .exposure_ev = light->exposure_ev};
}

static enum hg_status open_view(struct run *run, const struct hg_view_params *params,
    struct hg_view **out, struct hg_error *err)
{
    const enum hg_status status = hg_view_create(run->renderer, run->scene, out, err);
    return status == HG_OK ? hg_view_set_params(*out, params, err) : status;
}

// One exposure for all poses: that of the one in the middle.
static enum hg_status meter(struct run *run, struct light *light, struct hg_error *err)
{
    struct hg_view_params params = params_of(run, light);
    struct hg_view *view = NULL;
    struct hg_frame_info info = {0};
    params.exposure_mode = HG_EXPOSURE_AUTO;
    enum hg_status status = open_view(run, &params, &view, err);
    if (status == HG_OK)
        status = hg_bench_walk_look(&run->walk, view, run->walk.path_count / 2, err);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(view, 16, &info, err);
    light->exposure_ev = info.exposure_ev;
    hg_view_destroy(view);
    return status;
}

// From here on, until the scene changes, what moves has the settled field. It goes with the last
// view of the scene.
static enum hg_status rest(struct run *run, const struct light *light, struct hg_error *err)
{
    struct hg_view_params params = params_of(run, light);
    struct hg_view *view = NULL;
    struct hg_frame_info info = {0};
    params.gi = HG_GI_PROBES;
    enum hg_status status = open_view(run, &params, &view, err);
    if (status == HG_OK)
        status = hg_bench_walk_look(&run->walk, view, 0, err);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(view, 16, &info, err);
    hg_view_destroy(view);
    return status;
}

// --- walks ---------------------------------------------------------------------------------------

static enum hg_status find_motion(struct run *run, struct hg_error *err)
{
    struct hg_view_params params = params_of(run, &run->lights[0]);
    struct hg_view *view = NULL;
    float *depth = NULL;
    params.temporal = HG_TEMPORAL_AUTO;
    params.samples = 2; // the picture in motion is not the settled one
    enum hg_status status = open_view(run, &params, &view, err);
    if (status == HG_OK)
        status = hg_bench_walk_warm_up(&run->walk, view, err);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        struct hg_refbuf *picture = NULL;
        status = hg_bench_walk_draw(&run->walk, view, i, &picture, err);
        hg_refbuf_unref(picture);
        if (status == HG_OK)
            status = hg_bench_walk_find_motion(&run->walk, view, i, &depth, err);
    }
    hg_free(depth);
    hg_view_destroy(view);
    return status;
}

static struct hg_view_params params_of_way(
    const struct run *run, const struct light *light, int way)
{
    struct hg_view_params params = params_of(run, light);
    const bool shown = way >= HG_BENCH_SHOWN;
    params.samples = way == HG_BENCH_SETTLED ? SETTLED_SAMPLES : 2;
    params.gi = way == HG_BENCH_NONE ? HG_GI_NONE : shown ? HG_GI_AUTO : HG_GI_PROBES;
    params.reflections =
        shown ? HG_REFLECTIONS_AUTO : (enum hg_view_reflections)run->bench->reflections;
    params.temporal = shown ? HG_TEMPORAL_AUTO : (enum hg_view_temporal)run->bench->temporal;
    return params;
}

// pictures: of the pose before and of this one, which becomes the one before.
static enum hg_status end_pose(struct run *run, struct light *light, int way, uint32_t pose,
    struct hg_refbuf *pictures[2], struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (hg_bench_walk_is_compared(pose))
        status = compare(run, light, pose, pictures, &light->results[way], err);
    if (status == HG_OK && hg_bench_walk_is_compared(pose))
        status = write_picture(run, light, hg_bench_way_names[way], pose, pictures[1], err);
    hg_refbuf_unref(pictures[0]);
    pictures[0] = pictures[1];
    pictures[1] = NULL;
    return status == HG_OK ? tell(run, err) : status;
}

// Pictures at rest of the poses that are compared.
static enum hg_status settle(struct run *run, struct light *light, struct hg_error *err)
{
    const struct hg_view_params params = params_of_way(run, light, HG_BENCH_SETTLED);
    struct result *result = &light->results[HG_BENCH_SETTLED];
    struct hg_refbuf *pictures[2] = {NULL, NULL};
    struct hg_view *view = NULL;
    enum hg_status status = open_view(run, &params, &view, err);
    if (status == HG_OK)
        hg_view_set_final(view, true);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        const uint64_t cpu = hg_clock_cpu_ns();
        if (hg_bench_walk_is_compared(i) || hg_bench_walk_is_compared(i + 1))
            status = hg_bench_walk_settle(&run->walk, view, i, &pictures[1], err);
        result->cpu_ms += (double)(hg_clock_cpu_ns() - cpu) * 1e-6;
        if (status == HG_OK)
            status = end_pose(run, light, HG_BENCH_SETTLED, i, pictures, err);
    }
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
    hg_view_destroy(view);
    return status;
}

static enum hg_status walk(struct run *run, struct light *light, int way, struct hg_error *err)
{
    const struct hg_view_params params = params_of_way(run, light, way);
    struct hg_refbuf *pictures[2] = {NULL, NULL}; // the one before, and this one
    struct hg_view *view = NULL;
    struct result *result = &light->results[way];
    enum hg_status status = open_view(run, &params, &view, err);
    if (status == HG_OK)
        status = hg_bench_walk_warm_up(&run->walk, view, err);
    // Nothing is baked any more, which would change the field.
    if (status == HG_OK && (way == HG_BENCH_RESTED || way == HG_BENCH_SHOWN_RESTED))
        status = rest(run, light, err);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        const uint64_t cpu = hg_clock_cpu_ns();
        status = hg_bench_walk_draw(&run->walk, view, i, &pictures[1], err);
        result->cpu_ms += (double)(hg_clock_cpu_ns() - cpu) * 1e-6;
        if (status == HG_OK)
            status = end_pose(run, light, way, i, pictures, err);
    }
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
    hg_view_destroy(view);
    return status;
}

// --- the truth -----------------------------------------------------------------------------------

static enum hg_status find_truth(struct run *run, struct light *light, struct hg_error *err)
{
    struct hg_view_params params = params_of(run, light);
    struct hg_view *view = NULL;
    const bool paths = run->bench->truth == HG_BENCH_TRUTH_PATHS;
    params.mode = paths ? HG_MODE_PATH : HG_MODE_REALTIME;
    params.denoise = paths ? HG_DENOISE_STILL : HG_DENOISE_OFF;
    params.gi = paths ? HG_GI_NONE : HG_GI_RAYS;
    params.samples = run->bench->samples > 0 ? run->bench->samples : DEFAULT_SAMPLES;
    enum hg_status status = hg_bench_references_begin(
        &light->references, run->scene, run->bench->references, &params, err);
    if (status == HG_OK)
        status = open_view(run, &params, &view, err);
    if (status == HG_OK)
        hg_view_set_final(view, true);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        if (hg_bench_walk_is_compared(i) || hg_bench_walk_is_compared(i + 1))
            status = hg_bench_references_get(
                &light->references, &run->walk, view, i, &light->truth[i], err);
        if (status == HG_OK && hg_bench_walk_is_compared(i))
            status = write_picture(run, light, "truth", i, light->truth[i], err);
        if (status == HG_OK)
            status = tell(run, err);
    }
    hg_view_destroy(view);
    return status;
}

static void change_of_truth(struct run *run, struct light *light)
{
    run->compared = 0;
    for (uint32_t i = 1; i < run->walk.path_count; i++) {
        if (run->walk.motion[i] == NULL)
            continue;
        run->compared++;
        light->truth_change +=
            hg_bench_walk_change(&run->walk, i, light->truth[i - 1]->data, light->truth[i]->data);
    }
}

// --- lights --------------------------------------------------------------------------------------

// A sky with its sun where the settings say.
static void begin_day(struct run *run)
{
    struct hg_environment *e = &run->scene->environment;
    const float azimuth = run->bench->sun_rad[0], elevation = run->bench->sun_rad[1];
    hg_demo_environment(e);
    e->sun_direction[0] = cosf(elevation) * sinf(azimuth);
    e->sun_direction[1] = sinf(elevation);
    e->sun_direction[2] = cosf(elevation) * cosf(azimuth);
    e->turbidity = SUN_TURBIDITY;
    e->revision = run->scene->revision + 1;
    hg_scene_publish(run->scene);
    hg_scene_update(run->scene);
}

// Lamps along the walk, and nothing else.
static enum hg_status begin_night(struct run *run, struct hg_error *err)
{
    const uint32_t lamps = run->bench->lamps > 0 ? run->bench->lamps : DEFAULT_LAMPS;
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    struct hg_environment *e = &run->scene->environment;
    hg_scene_bounds(run->scene, NULL, min, max);
    for (uint32_t i = 0; i < lamps; i++) {
        struct hg_object *light, *node;
        const struct hg_bench_pose *at = &run->walk.path[(i * run->walk.path_count) / lamps];
        if (hg_scene_add(run->scene, HG_OBJECT_LIGHT, LAMP_ID + i, &light) != HG_OK ||
            hg_scene_add(run->scene, HG_OBJECT_NODE, LAMP_ID + i, &node) != HG_OK)
            return no_memory(err);
        ((struct hg_light *)light)->kind = HG_LIGHT_POINT;
        memcpy(((struct hg_node *)node)->translation, at->eye, sizeof at->eye);
        ((struct hg_node *)node)->translation[1] += 0.1f * (max[1] - min[1]);
        ((struct hg_node *)node)->light = (struct hg_light *)light;
    }
    e->kind = HG_ENV_NONE;
    e->revision = run->scene->revision + 1;
    hg_scene_publish(run->scene);
    hg_scene_update(run->scene);
    return HG_OK;
}

static enum hg_status walk_under(struct run *run, struct light *light, struct hg_error *err)
{
    light->truth = hg_calloc(run->walk.path_count, sizeof(struct hg_refbuf *));
    enum hg_status status = light->truth != NULL ? HG_OK : no_memory(err);
    if (light == run->lights && run->bench->exposure_ev != 0)
        light->exposure_ev = run->bench->exposure_ev;
    else if (status == HG_OK)
        status = meter(run, light, err);
    if (status == HG_OK)
        status = find_truth(run, light, err);
    if (status == HG_OK && light == run->lights)
        status = find_motion(run, err);
    for (int way = 0; way < HG_BENCH_SETTLED && status == HG_OK; way++)
        if (is_walked(run, way))
            status = walk(run, light, way, err);
    if (status == HG_OK && is_walked(run, HG_BENCH_SETTLED))
        status = settle(run, light, err);
    if (status == HG_OK)
        change_of_truth(run, light);
    return status;
}

// --- report --------------------------------------------------------------------------------------

static void put_light(struct hg_writer *w, const struct run *run, const struct light *light)
{
    const double count = run->compared > 0 ? run->compared : 1;
    hg_json_put(w, ",\"%s\":{\"exposure_ev\":%.3f,\"references_found\":%u,\"references_made\":%u",
        light->name, (double)light->exposure_ev, light->references.found, light->references.made);
    for (int m = 0; m < HG_BENCH_WAYS; m++) {
        if (!is_walked(run, m))
            continue;
        const struct result *r = &light->results[m];
        hg_json_put(w,
            ",\"%s\":{\"flip\":%.5f,\"region_error\":%.5f,\"worst_region_error\":%.5f,"
            "\"flicker\":%.4f,\"cpu_ms\":%.3f}",
            hg_bench_way_names[m], r->flip / count, r->region / count, r->worst_region / count,
            light->truth_change > 0 ? r->change / light->truth_change : 0,
            r->cpu_ms / (double)run->walk.path_count);
    }
    hg_json_put(w, "}");
}

static void put_rooms(struct hg_writer *w, const struct hg_bench_gi_rooms *rooms)
{
    hg_json_put(w, ",\"leaks\":[");
    for (int i = 0; i < HG_BENCH_LEAKS; i++) {
        const struct hg_bench_leak *l = &rooms->leaks[i];
        hg_json_put(w,
            "%s{\"wall_m\":%.2f,\"probes\":%.6f,\"rays\":%.6f,\"motion\":%.6f,"
            "\"motion_last\":%.6f}",
            i > 0 ? "," : "", (double)l->wall_m, l->probes, l->rays, l->motion, l->newest);
    }
    hg_json_put(w, "],\"responses\":[");
    for (int i = 0; i < HG_BENCH_RESPONSES; i++) {
        const struct hg_bench_response *r = &rooms->responses[i];
        hg_json_put(w,
            "%s{\"change\":\"%s\",\"pictures_to_90\":%u,\"pictures_to_99\":%u,\"after_15\":%.4f,"
            "\"after_60\":%.4f,\"regions_left_60\":%.4f,\"settled_over_motion\":%.4f}",
            i > 0 ? "," : "", r->name, r->to_90, r->to_99, r->after_15, r->after_60, r->regions_60,
            r->settled);
    }
    hg_json_put(w, "]");
}

static enum hg_status write_report(const struct run *run, char **text)
{
    struct hg_writer w = {0};
    hg_json_put(&w,
        "{\"width\":%u,\"height\":%u,\"poses\":%u,\"compared\":%u,\"temporal\":%u,\"truth\":\"%s\"",
        run->walk.width, run->walk.height, run->walk.path_count, run->compared,
        run->bench->temporal, run->bench->truth == HG_BENCH_TRUTH_PATHS ? "path" : "rays");
    if (!(run->bench->left_out & HG_BENCH_WALK)) {
        put_light(&w, run, &run->lights[0]);
        if (!(run->bench->left_out & HG_BENCH_NIGHT))
            put_light(&w, run, &run->lights[1]);
    }
    if (!(run->bench->left_out & HG_BENCH_ROOMS))
        put_rooms(&w, &run->rooms);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

static enum hg_status walk_all(struct run *run, struct hg_error *err)
{
    if (run->bench->sun_rad[1] != 0)
        begin_day(run);
    enum hg_status status = walk_under(run, &run->lights[0], err);
    if (run->bench->left_out & HG_BENCH_NIGHT)
        return status;
    if (status == HG_OK)
        status = begin_night(run, err);
    return status == HG_OK ? walk_under(run, &run->lights[1], err) : status;
}

static enum hg_status measure(struct run *run, struct hg_error *err)
{
    enum hg_status status = hg_bench_walk_init(&run->walk, run->scene, run->bench, err);
    if (status == HG_OK && !(run->bench->left_out & HG_BENCH_WALK))
        status = walk_all(run, err);
    if (status == HG_OK && !(run->bench->left_out & HG_BENCH_ROOMS))
        status = hg_bench_gi_rooms_run(run->renderer, run->bench, &run->rooms, err);
    return status;
}

enum hg_status hg_bench_gi_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run *run = hg_calloc(1, sizeof *run);
    if (run == NULL)
        return no_memory(err);
    run->renderer = renderer;
    run->scene = scene;
    run->bench = bench;
    run->lights[0].name = "day";
    run->lights[1].name = "night";
    enum hg_status status = measure(run, err);
    if (status == HG_OK)
        status = write_report(run, text);
    for (int k = 0; k < LIGHTS; k++) {
        for (uint32_t i = 0; i < run->walk.path_count && run->lights[k].truth != NULL; i++)
            hg_refbuf_unref(run->lights[k].truth[i]);
        hg_free(run->lights[k].truth);
    }
    hg_bench_walk_finish(&run->walk);
    hg_free(run);
    return status;
}
