// realtime.c - frames in motion, measured (helio bench realtime).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/bench.h"
#include "renderer/frame/quality/governor.h"
#include "renderer/internal.h"

#define DEFAULT_POSES  16
#define DEFAULT_ROUNDS 3
#define MAX_FRAMES     65536
#define MAX_PASSES     64
#define LAMP_ID        0x6c616d70u            // of the first
#define WARM_UP_NS     UINT64_C(120000000000) // most that is walked before frames are measured

struct pass_times {
    char name[32];
    float *ms; // [frames] of those in which it ran
    uint32_t count;
    uint32_t newest; // frame that the last one is of, from 1
};

struct run {
    struct hg_renderer *renderer;
    struct hg_view *view;
    const struct hg_bench_settings *bench;
    struct hg_bench_pose circle[DEFAULT_POSES];
    const struct hg_bench_pose *path;
    uint32_t path_count, rounds, frames;
    float *frame_ms;
    float *cpu_ms; // [path_count] least of the frames of a pose
    struct hg_quality_choice chosen; // summed over the measured frames
    uint32_t measured;
    uint32_t checkered; // of the measured frames, by choice
    bool busy; // in the newest walk something was missing, or baked in the background
    struct pass_times passes[MAX_PASSES];
    uint32_t pass_count;
    uint64_t triangles_drawn, triangles_total;
    struct hg_shadow_page_stats pages; // sums of the frames
};

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Sorts in place.
static double median(float *values, uint32_t count)
{
    if (count == 0)
        return 0;
    qsort(values, count, sizeof *values, compare_floats);
    return 0.5 * ((double)values[(count - 1) / 2] + (double)values[count / 2]);
}

// Of sorted values.
static double p95(const float *values, uint32_t count)
{
    return count > 0 ? (double)values[(uint32_t)ceil(0.95 * count) - 1] : 0;
}

static void make_circle(struct run *run, const struct hg_scene *scene)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1}, centre[3], radius = 0;
    if (!hg_scene_bounds(scene, NULL, min, max))
        radius = 0;
    for (int i = 0; i < 3; i++) {
        centre[i] = 0.5f * (min[i] + max[i]);
        radius += (max[i] - min[i]) * (max[i] - min[i]);
    }
    radius = 0.75f * sqrtf(radius) + 1e-3f;
    for (int i = 0; i < DEFAULT_POSES; i++) {
        const float turn = 2.0f * (float)M_PI * (float)i / DEFAULT_POSES;
        struct hg_bench_pose *pose = &run->circle[i];
        memcpy(pose->target, centre, sizeof centre);
        pose->eye[0] = centre[0] + radius * sinf(turn);
        pose->eye[1] = centre[1] + 0.4f * radius;
        pose->eye[2] = centre[2] + radius * cosf(turn);
    }
    run->path = run->circle;
    run->path_count = DEFAULT_POSES;
}

static struct pass_times *find_pass(struct run *run, const char *name)
{
    for (uint32_t i = 0; i < run->pass_count; i++) {
        if (strcmp(run->passes[i].name, name) == 0)
            return &run->passes[i];
    }
    if (run->pass_count == MAX_PASSES)
        return NULL;
    struct pass_times *pass = &run->passes[run->pass_count];
    pass->ms = hg_calloc(run->frames, sizeof *pass->ms);
    if (pass->ms == NULL)
        return NULL;
    memcpy(pass->name, name, strlen(name) + 1);
    run->pass_count++;
    return pass;
}

// now: what the frame was drawn with.
static bool note_frame(struct run *run, const struct hg_quality_choice *now,
    const struct hg_frame_info *info, uint64_t ns, uint64_t cpu_ns)
{
    float *cpu_ms = &run->cpu_ms[run->measured % run->path_count];
    const float ms = (float)((double)cpu_ns * 1e-6);
    *cpu_ms = *cpu_ms == 0.0f || ms < *cpu_ms ? ms : *cpu_ms;
    const struct hg_view_state *state = &run->view->state;
    const VkExtent2D drawn = state->motion.temporal.drawn;
    run->chosen.scale += drawn.width > 0 ? (float)drawn.width / (float)state->settings.width : 1.0f;
    run->chosen.rays += now->rays;
    run->chosen.factor += now->factor;
    run->checkered += now->checkerboard;
    run->frame_ms[run->measured++] = (float)((double)ns * 1e-6);
    run->triangles_drawn = info->triangles_drawn;
    run->triangles_total = info->triangles_total;
    struct hg_lighting_stats lights;
    hg_lighting_stats(run->view->state.lighting, &lights);
    run->pages.asked += lights.pages.asked;
    run->pages.hits += lights.pages.hits;
    run->pages.drawn += lights.pages.drawn;
    run->pages.held += lights.pages.held;
    for (uint32_t i = 0; i < info->stage_count; i++) {
        struct pass_times *pass = find_pass(run, info->stages[i].name);
        if (pass == NULL)
            return false;
        if (pass->newest != run->measured) // else a frame has several of that name
            pass->ms[pass->count++] = 0;
        pass->newest = run->measured;
        pass->ms[pass->count - 1] += (float)((double)info->stages[i].ns * 1e-6);
    }
    return true;
}

static enum hg_status draw_frame(
    struct run *run, const struct hg_bench_pose *pose, bool measured, struct hg_error *err)
{
    struct hg_view_camera camera = {.vfov_rad = run->bench->vfov_rad};
    struct hg_frame_info info;
    struct hg_refbuf *pixels = NULL;
    memcpy(camera.eye, pose->eye, sizeof camera.eye);
    memcpy(camera.target, pose->target, sizeof camera.target);
    const struct hg_quality_choice now = hg_governor_choice(&run->view->state);
    const uint64_t start = hg_clock_now_ns(), cpu = hg_clock_cpu_ns();
    enum hg_status status = hg_view_set_camera(run->view, &camera, err);
    if (status == HG_OK)
        status = hg_view_step(run->view, 1, &info, err);
    if (status == HG_OK)
        status = hg_view_read_pixels(run->view, HG_PIXEL_RGBA8, &pixels, err);
    const uint64_t end = hg_clock_now_ns(), cpu_end = hg_clock_cpu_ns();
    hg_refbuf_unref(pixels);
    struct hg_baking baking;
    hg_view_baking(run->view, &baking);
    run->busy |= info.missing_pages > 0 || info.missing_clusters > 0 || baking.mesh_parts > 0 ||
                 baking.texels_done < baking.texels_total;
    if (status == HG_OK && measured && !note_frame(run, &now, &info, end - start, cpu_end - cpu))
        status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    return status;
}

static enum hg_status walk(struct run *run, uint32_t round, struct hg_error *err)
{
    const uint32_t total = run->path_count * (run->rounds + 1);
    run->busy = false;
    for (uint32_t i = 0; i < run->path_count; i++) {
        enum hg_status status = draw_frame(run, &run->path[i], round > 0, err);
        if (status != HG_OK)
            return status;
        if (run->bench->progress != NULL && !run->bench->progress(run->bench->progress_user,
                                                round * run->path_count + i + 1, total))
            return hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
    }
    return HG_OK;
}

// Frames are measured once nothing is streamed or baked any more: what that takes is the matter of
// other benchmarks.
static enum hg_status walk_all(struct run *run, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status;
    do
        status = walk(run, 0, err);
    while (status == HG_OK && run->busy && hg_clock_now_ns() - start < WARM_UP_NS);
    for (uint32_t round = 1; round <= run->rounds && status == HG_OK; round++)
        status = walk(run, round, err);
    return status;
}

static enum hg_status write_report(struct run *run, char **text)
{
    struct hg_writer w = {0};
    struct hg_gpu_memory_stats memory;
    hg_gpu_memory_stats(run->renderer->gpu, &memory);
    const struct hg_view_settings *s = &run->view->state.settings;
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"frames_ms\":[", s->width, s->height);
    for (uint32_t i = 0; i < run->measured; i++)
        hg_json_put(&w, "%s%.3f", i > 0 ? "," : "", (double)run->frame_ms[i]);
    double cpu_ms = 0;
    for (uint32_t i = 0; i < run->path_count; i++)
        cpu_ms += (double)run->cpu_ms[i] / run->path_count;
    struct hg_lighting_stats lights;
    hg_lighting_stats(run->view->state.lighting, &lights);
    hg_json_put(&w, "],\"lights\":{\"count\":%u,\"listed\":%u,\"shadowed\":%u,\"unshadowed\":%u}",
        lights.lights, lights.lights_in_lists, lights.shadowed_lights, lights.unshadowed_lights);
    const double frame_ms = median(run->frame_ms, run->measured), frames = run->measured;
    hg_json_put(&w, ",\"pages\":{\"asked\":%.1f,\"hits\":%.1f,\"drawn\":%.1f,\"held\":%.1f}",
        run->pages.asked / frames, run->pages.hits / frames, run->pages.drawn / frames,
        run->pages.held / frames);
    hg_json_put(&w, ",\"frame_ms\":%.3f,\"p95_over_median\":%.3f,\"cpu_ms\":%.3f,\"at_rest\":%s",
        frame_ms, p95(run->frame_ms, run->measured) / frame_ms, cpu_ms,
        run->busy ? "false" : "true");
    hg_json_put(&w,
        ",\"motion\":{\"scale\":%.4f,\"rays\":%.4f,\"error\":%.4f,\"checkerboard\":%.4f},"
        "\"passes\":[",
        (double)run->chosen.scale / frames, (double)run->chosen.rays / frames,
        (double)run->chosen.factor / frames, run->checkered / frames);
    for (uint32_t i = 0; i < run->pass_count; i++) {
        struct pass_times *pass = &run->passes[i];
        hg_json_put(&w, "%s{\"name\":\"%s\",\"ms\":%.3f,\"frames\":%u}", i > 0 ? "," : "",
            pass->name, median(pass->ms, pass->count), pass->count);
    }
    hg_json_put(&w,
        "],\"triangles_total\":%llu,\"triangles_drawn\":%llu,\"memory\":{\"used_bytes\":%llu,"
        "\"reserved_bytes\":%llu,\"peak_bytes\":%llu},\"device\":",
        (unsigned long long)run->triangles_total, (unsigned long long)run->triangles_drawn,
        (unsigned long long)memory.used_bytes, (unsigned long long)memory.reserved_bytes,
        (unsigned long long)memory.peak_bytes);
    hg_json_string(&w, hg_gpu_get_caps(run->renderer->gpu)->device_name);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

// Lamps all over the scene, at the points of a low-discrepancy sequence; together as bright as one
// of 20 cd for each square metre of its largest side. Roberts 2018, "The Unreasonable Effectiveness
// of Quasirandom Sequences".
static enum hg_status add_lamps(struct hg_scene *scene, uint32_t count, struct hg_error *err)
{
    static const double steps[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1}, side = 0;
    hg_scene_bounds(scene, NULL, min, max);
    for (int a = 0; a < 3; a++)
        side = fmaxf(side, max[a] - min[a]);
    for (uint32_t i = 0; i < count; i++) {
        struct hg_object *light, *node;
        if (hg_scene_add(scene, HG_OBJECT_LIGHT, LAMP_ID + i, &light) != HG_OK ||
            hg_scene_add(scene, HG_OBJECT_NODE, LAMP_ID + i, &node) != HG_OK)
            return hg_error_set(err, HG_E_NOMEM, "bench", "lamps", "out of host memory");
        ((struct hg_light *)light)->kind = HG_LIGHT_POINT;
        ((struct hg_light *)light)->intensity = 20 * side * side / (float)count;
        ((struct hg_node *)node)->light = (struct hg_light *)light;
        for (int a = 0; a < 3; a++)
            ((struct hg_node *)node)->translation[a] =
                min[a] + (max[a] - min[a]) * (float)fmod(0.5 + steps[a] * (i + 1), 1);
    }
    hg_scene_publish(scene);
    hg_scene_update(scene);
    return HG_OK;
}

static enum hg_status prepare(struct run *run, struct hg_scene *scene, struct hg_error *err)
{
    const struct hg_bench_settings *b = run->bench;
    run->path = b->path;
    run->path_count = b->path_count;
    run->rounds = b->rounds > 0 ? b->rounds : DEFAULT_ROUNDS;
    hg_scene_update(scene);
    if (run->path_count == 0)
        make_circle(run, scene);
    if ((uint64_t)run->path_count * run->rounds > MAX_FRAMES)
        return hg_error_set(err, HG_E_INVAL, "bench", "rounds", "more than %d frames", MAX_FRAMES);
    run->frames = run->path_count * run->rounds;
    run->frame_ms = hg_calloc(run->frames, sizeof *run->frame_ms);
    run->cpu_ms = hg_calloc(run->path_count, sizeof *run->cpu_ms);
    if (run->frame_ms == NULL || run->cpu_ms == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    const struct hg_view_params params = {.width = b->width,
        .height = b->height,
        .samples = 2, // the picture in motion is not the settled one
        .gi = (enum hg_view_gi)b->gi,
        .reflections = (enum hg_view_reflections)b->reflections,
        .temporal = (enum hg_view_temporal)b->temporal,
        .shadow_maps = (enum hg_view_shadow_maps)b->shadow_maps,
        .target_ms = b->target_ms,
        .scale = b->scale};
    enum hg_status status = add_lamps(scene, b->lamps, err);
    if (status == HG_OK)
        status = hg_view_create(run->renderer, scene, &run->view, err);
    return status == HG_OK ? hg_view_set_params(run->view, &params, err) : status;
}

enum hg_status hg_bench_realtime_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run *run = hg_calloc(1, sizeof *run);
    if (run == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    run->renderer = renderer;
    run->bench = bench;
    enum hg_status status = prepare(run, scene, err);
    if (status == HG_OK)
        status = walk_all(run, err);
    if (status == HG_OK)
        status = write_report(run, text);
    hg_view_destroy(run->view);
    for (uint32_t i = 0; i < run->pass_count; i++)
        hg_free(run->passes[i].ms);
    hg_free(run->cpu_ms);
    hg_free(run->frame_ms);
    hg_free(run);
    return status;
}
