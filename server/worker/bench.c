// bench.c - `helio bench`: measurements inside a private worker, on its render thread.
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/sha256.h"
#include "renderer/scene/demo.h"
#include "server/worker/asset_path.h"
#include "server/worker/bench.h"

// Options of `realtime` and `trace` (all optional): scene (file; default the built-in demo),
// environment (file; default the demo's), width, height, vfov_deg, rounds, path (list of {eye:
// [x,y,z], target: [x,y,z]} in metres). Those of the others: bench_stream.c.
enum { MAX_POSES = 4096, PROGRESS_NS = 100 * 1000 * 1000 };

static enum hg_status bad_option(struct hg_error *err, const char *name, const char *reason)
{
    return hg_error_set(err, HG_E_INVAL, "bench", name, "%s", reason);
}

// ---- options ------------------------------------------------------------------------------------

enum hg_status bench_number(const json_t *options, const char *name, double low, double high,
    double *value, struct hg_error *err)
{
    const json_t *item = json_object_get(options, name);
    if (!item)
        return HG_OK;
    *value = json_number_value(item);
    if (!json_is_number(item) || !(*value >= low && *value <= high))
        return bad_option(err, name, "not a number in range");
    return HG_OK;
}

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

static enum hg_status read_path(struct bench *b, const json_t *path, struct hg_error *err)
{
    size_t count = json_array_size(path);
    if (!json_is_array(path) || count < 1 || count > MAX_POSES)
        return bad_option(err, "path", "not a list of 1 to 4096 poses");
    b->poses = hg_calloc(count, sizeof *b->poses);
    if (!b->poses)
        return hg_error_set(err, HG_E_NOMEM, "bench", "path", "no memory");
    for (size_t i = 0; i < count; i++) {
        json_t *pose = json_array_get(path, i);
        if (!read_vec3(json_object_get(pose, "eye"), b->poses[i].eye) ||
            !read_vec3(json_object_get(pose, "target"), b->poses[i].target))
            return bad_option(err, "path", "a pose needs eye and target, three numbers each");
    }
    b->run.path = b->poses;
    b->run.path_count = (uint32_t)count;
    return HG_OK;
}

static enum hg_status read_options(struct bench *b, const json_t *options, struct hg_error *err)
{
    double width = 0, height = 0, vfov_deg = 0, rounds = 0; // 0: the renderer's defaults
    const json_t *path = json_object_get(options, "path");
    enum hg_status st = bench_number(options, "width", 1, 16384, &width, err);
    st = st ? st : bench_number(options, "height", 1, 16384, &height, err);
    st = st ? st : bench_number(options, "vfov_deg", 1, 170, &vfov_deg, err);
    st = st ? st : bench_number(options, "rounds", 1, 1000, &rounds, err);
    st = st || !path ? st : read_path(b, path, err);
    b->scene_name = json_string_value(json_object_get(options, "scene"));
    b->environment = json_string_value(json_object_get(options, "environment"));
    b->run.width = (uint32_t)width;
    b->run.height = (uint32_t)height;
    b->run.vfov_rad = (float)(vfov_deg * M_PI / 180);
    b->run.rounds = (uint32_t)rounds;
    return st;
}

// ---- scene --------------------------------------------------------------------------------------

static enum hg_status load_environment(
    struct bench *b, const struct worker_options *o, struct hg_error *err)
{
    struct hg_environment_file file = {0};
    char *path = NULL;
    enum hg_status st = hg_asset_path_resolve(o, hgp_str_make(b->environment), &path, err);
    st = st ? st : hg_environment_file_read(path, NULL, &file, err);
    if (!st)
        hg_environment_file_use(&file, &b->scene->environment);
    hg_free(path);
    return st;
}

static enum hg_status load_file(struct bench *b, const char *path, struct hg_error *err)
{
    const struct worker_options *o = &b->r->s->w->options;
    struct hg_load_params params = {
        .path = path,
        .roots = (const char *const *)o->asset_roots,
        .root_count = o->asset_root_count,
        .asset_number = 1,
        .scene_index = -1,
        .jobs = hg_renderer_jobs(b->r->s->renderer),
    };
    struct hg_asset *asset;
    enum hg_status st = hg_load_asset(&params, &asset, err);
    if (st)
        return st;
    st = hg_scene_add_asset(b->scene, asset, NULL);
    if (st)
        hg_asset_destroy(asset);
    return st;
}

static enum hg_status load_scene(struct bench *b, struct hg_error *err)
{
    const struct worker_options *o = &b->r->s->w->options;
    char *path = NULL;
    enum hg_status st = hg_scene_create(&b->scene);
    if (!st && b->scene_name)
        st = hg_asset_path_resolve(o, hgp_str_make(b->scene_name), &path, err);
    st = st ? st : load_file(b, path ? path : "demo:", err);
    if (!st && b->environment)
        st = load_environment(b, o, err);
    else if (!st)
        hg_demo_environment(&b->scene->environment);
    if (!st) {
        b->scene->environment.revision = b->scene->revision + 1;
        hg_scene_publish(b->scene);
    }
    hg_free(path);
    return st;
}

// ---- run ----------------------------------------------------------------------------------------

bool bench_progress(void *user, uint32_t done, uint32_t total)
{
    struct bench *b = user;
    uint64_t now = hg_clock_now_ns();
    if (now - b->progress_sent_ns >= PROGRESS_NS) {
        b->progress_sent_ns = now;
        hg_reply_progress(b->r->to, "frames", done, total);
    }
    return !atomic_load(&b->r->s->w->stop);
}

// The renderer's report with what was loaded.
static char *complete(const struct bench *b, const char *text)
{
    json_t *root = json_loads(text, 0, NULL);
    json_object_set_new(root, "scene", json_string(b->scene_name ? b->scene_name : "demo"));
    json_object_set_new(root, "load_ms", json_real(b->load_ms));
    char *full = root ? json_dumps(root, JSON_COMPACT) : NULL,
         *copy = full ? hg_strdup(full) : NULL;
    json_decref(root);
    free(full);
    return copy;
}

typedef enum hg_status run_scene_fn(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_realtime *bench, char **text, struct hg_error *err);

static enum hg_status run_scene(
    struct bench *b, const json_t *options, run_scene_fn *run, char **text, struct hg_error *err)
{
    enum hg_status st = read_options(b, options, err);
    st = st ? st : hg_render_state_need_renderer(b->r->s, err);
    uint64_t start = hg_clock_now_ns();
    st = st ? st : load_scene(b, err);
    b->load_ms = (double)(hg_clock_now_ns() - start) * 1e-6;
    b->run.progress = bench_progress;
    b->run.progress_user = b;
    return st ? st : run(b->r->s->renderer, b->scene, &b->run, text, err);
}

static enum hg_status bench_scene(
    struct bench *b, const json_t *options, run_scene_fn *run, char **text, struct hg_error *err)
{
    char *report = NULL;
    *text = NULL;
    enum hg_status st = run_scene(b, options, run, &report, err);
    if (!st && !(*text = complete(b, report)))
        st = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for the report");
    hg_free(report);
    hg_scene_destroy(b->scene);
    hg_free(b->poses);
    return st;
}

static enum hg_status bench_realtime(
    struct bench *b, const json_t *options, char **text, struct hg_error *err)
{
    return bench_scene(b, options, hg_renderer_bench_realtime, text, err);
}

static enum hg_status bench_trace(
    struct bench *b, const json_t *options, char **text, struct hg_error *err)
{
    return bench_scene(b, options, hg_renderer_bench_trace, text, err);
}

static enum hg_status bench_path(
    struct bench *b, const json_t *options, char **text, struct hg_error *err)
{
    return bench_scene(b, options, hg_renderer_bench_path, text, err);
}

static const struct {
    const char *name;
    enum hg_status (*run)(struct bench *, const json_t *, char **, struct hg_error *);
} benchmarks[] = {{"realtime", bench_realtime}, {"vt", bench_vt}, {"lod", bench_lod},
    {"trace", bench_trace}, {"path", bench_path}};

static enum hg_status run_named(
    struct bench *b, const json_t *options, char **text, struct hg_error *err)
{
    const struct hgp_str *name = &b->r->message->bench.name;
    *text = NULL;
    for (size_t i = 0; i < sizeof benchmarks / sizeof *benchmarks; i++)
        if (strlen(benchmarks[i].name) == name->size &&
            memcmp(benchmarks[i].name, name->data, name->size) == 0)
            return benchmarks[i].run(b, options, text, err);
    return hg_error_set(err, HG_E_UNSUPPORTED, "bench", "name", "no benchmark '%.*s'",
        (int)name->size, name->data ? name->data : "");
}

void hg_handle_bench(const struct request *r)
{
    const struct hgp_bench *m = &r->message->bench;
    struct bench b = {.r = r};
    struct hg_error err = {0};
    char *text = NULL;
    json_error_t fault;
    json_t *options =
        json_loadb(m->options.data ? m->options.data : "", m->options.size, 0, &fault);
    enum hg_status st = HG_OK;
    if (!json_is_object(options))
        st =
            hg_error_set(&err, HG_E_INVAL, "bench", "options", "not a JSON object: %s", fault.text);
    st = st ? st : run_named(&b, options, &text, &err);
    if (st)
        hg_reply_error(r->to, &err);
    else
        hg_reply_send(r->to, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(text)});
    hg_free(text);
    json_decref(options);
}
