// run_scene.c - benchmarks of one scene: their options, the scene, the report with what was loaded.
//
// Options of `realtime`, `temporal`, `gi`, `reflections`, `flight`, `trace` and `path` (all
// optional): scene (file; default the built-in demo), environment (file; default the demo's),
// width, height, vfov_deg, rounds, gi, temporal, reflections, shadow_maps (numbers of the values),
// samples, lamps, truth (0 paths, 1 rays), references and pictures (folders), sun ([azimuth,
// elevation] in degrees), exposure (stops), only ("walk", "day", "rooms"), target_ms, scale
// (percent), time_s, path (list of {eye: [x,y,z], target: [x,y,z]} in metres).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/bench/run.h"
#include "renderer/light/env/env_file.h"
#include "renderer/scene/demo/demo.h"

enum { MAX_POSES = 4096 };

struct run {
    const struct hg_bench_host *host;
    const char *scene_name, *environment; // borrowed from the options
    struct hg_bench_settings settings;
    struct hg_bench_pose *poses; // of `settings`
    char *references, *pictures; // likewise
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    double load_ms;
};

// ---- options ------------------------------------------------------------------------------------

static bool read_vec3(const json_t *array, float out[3])
{
    if (!json_is_array(array) || json_array_size(array) != 3)
        return false;
    for (size_t i = 0; i < 3; i++) {
        json_t *item = json_array_get(array, i);
        out[i] = (float)json_number_value(item);
        if (!json_is_number(item) || !isfinite(out[i]))
            return false;
    }
    return true;
}

static enum hg_status read_path(struct run *r, const json_t *path, struct hg_error *err)
{
    size_t count = json_array_size(path);
    if (!json_is_array(path) || count < 1 || count > MAX_POSES)
        return hg_error_set(err, HG_E_INVAL, "bench", "path", "not a list of 1 to 4096 poses");
    r->poses = hg_calloc(count, sizeof *r->poses);
    if (!r->poses)
        return hg_error_set(err, HG_E_NOMEM, "bench", "path", "no memory");
    for (size_t i = 0; i < count; i++) {
        json_t *pose = json_array_get(path, i);
        if (!read_vec3(json_object_get(pose, "eye"), r->poses[i].eye) ||
            !read_vec3(json_object_get(pose, "target"), r->poses[i].target))
            return hg_error_set(err, HG_E_INVAL, "bench", "path",
                "a pose needs eye and target, three numbers each");
    }
    r->settings.path = r->poses;
    r->settings.path_count = (uint32_t)count;
    return HG_OK;
}

// NULL when the option is absent.
static enum hg_status read_folder(
    const struct run *r, const json_t *options, const char *name, char **out, struct hg_error *err)
{
    const char *folder = json_string_value(json_object_get(options, name));
    return folder ? hg_roots_resolve(&r->host->roots, folder, out, err) : HG_OK;
}

// 0: all of them.
static enum hg_status read_ways(const json_t *names, uint32_t *ways, struct hg_error *err)
{
    size_t i;
    json_t *item;
    json_array_foreach(names, i, item)
    {
        const char *name = json_string_value(item);
        uint32_t way = 0;
        while (way < HG_BENCH_WAYS && (!name || strcmp(hg_bench_way_names[way], name) != 0))
            way++;
        if (way == HG_BENCH_WAYS)
            return hg_error_set(
                err, HG_E_INVAL, "bench", "ways", "no way is called \"%s\"", name ? name : "");
        *ways |= 1u << way;
    }
    return !names || i > 0 ? HG_OK
                           : hg_error_set(err, HG_E_INVAL, "bench", "ways", "not a list of names");
}

static enum hg_status read_gi(struct run *r, const json_t *options, struct hg_error *err)
{
    const json_t *only = json_object_get(options, "only");
    const char *part = json_string_value(only);
    const bool walk = part && strcmp(part, "walk") == 0, day = part && strcmp(part, "day") == 0;
    const bool rooms = part && strcmp(part, "rooms") == 0;
    if (only && !walk && !day && !rooms)
        return hg_error_set(err, HG_E_INVAL, "bench", "only", "not \"walk\", \"day\" or \"rooms\"");
    r->settings.left_out = (rooms ? HG_BENCH_WALK : 0) | (day ? HG_BENCH_NIGHT : 0) |
                           (walk || day ? HG_BENCH_ROOMS : 0);
    const json_t *sun = json_object_get(options, "sun");
    for (size_t i = 0; i < 2; i++)
        r->settings.sun_rad[i] = (float)(json_number_value(json_array_get(sun, i)) * M_PI / 180);
    if (sun && (json_array_size(sun) != 2 || !(r->settings.sun_rad[1] > 0)))
        return hg_error_set(err, HG_E_INVAL, "bench", "sun", "not [azimuth, elevation above 0]");
    enum hg_status st = read_ways(json_object_get(options, "ways"), &r->settings.ways, err);
    st = st ? st : read_folder(r, options, "references", &r->references, err);
    r->settings.references = r->references;
    return st ? st : read_folder(r, options, "pictures", &r->pictures, err);
}

static enum hg_status read_options(struct run *r, const json_t *options, struct hg_error *err)
{
    double width = 0, height = 0, vfov_deg = 0, rounds = 0, gi = 0, temporal = 0, samples = 0,
           lamps = 0, truth = 0, reflections = HG_REFLECTIONS_AUTO, shadow_maps = 0, target_ms = 0,
           scale = 0, time_s = 0, exposure = 0; // 0: the benchmark's defaults
    const struct hg_bench_number numbers[] = {{"width", 1, 16384, &width},
        {"height", 1, 16384, &height}, {"vfov_deg", 1, 170, &vfov_deg},
        {"rounds", 1, 1000, &rounds}, {"gi", 0, 3, &gi}, {"temporal", 0, 2, &temporal},
        {"samples", 1, 65536, &samples}, {"lamps", 0, 1000000, &lamps}, {"truth", 0, 1, &truth},
        {"reflections", 0, 3, &reflections}, {"shadow_maps", 0, 2, &shadow_maps},
        {"target_ms", 0, 100000, &target_ms}, {"scale", 50, 100, &scale},
        {"time_s", 0, 1e6, &time_s}, {"exposure", -32, 32, &exposure}};
    enum hg_status st =
        hg_bench_read_numbers(options, numbers, sizeof numbers / sizeof *numbers, err);
    if (st)
        return st;
    r->scene_name = json_string_value(json_object_get(options, "scene"));
    r->environment = json_string_value(json_object_get(options, "environment"));
    r->settings = (struct hg_bench_settings){.width = (uint32_t)width,
        .height = (uint32_t)height,
        .vfov_rad = (float)(vfov_deg * M_PI / 180),
        .rounds = (uint32_t)rounds,
        .gi = (uint32_t)gi,
        .temporal = (uint32_t)temporal,
        .shadow_maps = (uint32_t)shadow_maps,
        .samples = (uint32_t)samples,
        .lamps = (uint32_t)lamps,
        .reflections = (uint32_t)reflections,
        .time_s = time_s,
        .exposure_ev = (float)exposure,
        .target_ms = (float)target_ms,
        .scale = (float)scale,
        .truth = truth > 0 ? HG_BENCH_TRUTH_RAYS : HG_BENCH_TRUTH_PATHS,
        .progress = r->host->progress,
        .progress_user = r->host->progress_user};
    const json_t *path = json_object_get(options, "path");
    st = path ? read_path(r, path, err) : HG_OK;
    st = st ? st : read_gi(r, options, err);
    r->settings.pictures = r->pictures;
    return st;
}

// ---- scene --------------------------------------------------------------------------------------

static enum hg_status load_environment(struct run *r, struct hg_error *err)
{
    struct hg_environment_file file = {0};
    char *path;
    enum hg_status st = hg_roots_resolve(&r->host->roots, r->environment, &path, err);
    if (st)
        return st;
    st = hg_environment_file_read(path, NULL, &file, err);
    hg_free(path);
    if (st)
        return st;
    hg_environment_file_use(&file, &r->scene->environment);
    return HG_OK;
}

static enum hg_status load_asset(struct run *r, const char *path, struct hg_error *err)
{
    struct hg_load_params params = {
        .path = path,
        .roots = r->host->roots.items,
        .root_count = r->host->roots.count,
        .asset_number = 1,
        .scene_index = -1,
        .jobs = hg_renderer_jobs(r->renderer),
    };
    struct hg_asset *asset;
    enum hg_status st = hg_load_asset(&params, &asset, err);
    if (st)
        return st;
    st = hg_scene_add_asset(r->scene, asset, NULL);
    if (st)
        hg_asset_destroy(asset);
    return st;
}

static enum hg_status load_named_asset(struct run *r, struct hg_error *err)
{
    char *path;
    if (!r->scene_name)
        return load_asset(r, "demo:", err);
    enum hg_status st = hg_roots_resolve(&r->host->roots, r->scene_name, &path, err);
    if (st)
        return st;
    st = load_asset(r, path, err);
    hg_free(path);
    return st;
}

static enum hg_status load_scene(struct run *r, struct hg_error *err)
{
    enum hg_status st = hg_scene_create(&r->scene);
    if (st)
        return hg_error_set(err, st, "bench", NULL, "no memory for the scene");
    st = load_named_asset(r, err);
    if (st)
        return st;
    if (r->environment) {
        st = load_environment(r, err);
        if (st)
            return st;
    } else {
        hg_demo_environment(&r->scene->environment);
    }
    r->scene->environment.revision = r->scene->revision + 1;
    hg_scene_publish(r->scene);
    return HG_OK;
}

// ---- run ----------------------------------------------------------------------------------------

// The benchmark's report with what was loaded.
static char *complete(const struct run *r, const char *report)
{
    json_t *root = json_loads(report, 0, NULL);
    json_object_set_new(root, "scene", json_string(r->scene_name ? r->scene_name : "demo"));
    json_object_set_new(root, "load_ms", json_real(r->load_ms));
    char *full = root ? json_dumps(root, JSON_COMPACT) : NULL,
         *copy = full ? hg_strdup(full) : NULL;
    json_decref(root);
    free(full);
    return copy;
}

static enum hg_status prepare(struct run *r, const json_t *options, struct hg_error *err)
{
    enum hg_status st = read_options(r, options, err);
    if (st)
        return st;
    st = hg_renderer_create(&r->host->renderer, &r->renderer, err);
    if (st)
        return st;
    uint64_t start = hg_clock_now_ns();
    st = load_scene(r, err);
    r->load_ms = (double)(hg_clock_now_ns() - start) * 1e-6;
    return st;
}

enum hg_status hg_bench_run_scene(const struct hg_bench_host *host, const json_t *options,
    hg_bench_scene_fn *run, char **text, struct hg_error *err)
{
    struct run r = {.host = host};
    char *report = NULL;
    *text = NULL;
    enum hg_status st = prepare(&r, options, err);
    if (!st)
        st = run(r.renderer, r.scene, &r.settings, &report, err);
    if (!st && !(*text = complete(&r, report)))
        st = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for the report");
    hg_free(report);
    hg_scene_destroy(r.scene);
    hg_renderer_destroy(r.renderer);
    hg_free(r.poses);
    hg_free(r.references);
    hg_free(r.pictures);
    return st;
}
