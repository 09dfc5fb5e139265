// bench_latency.c - how long after an input its picture is there, by stages from the times that
// frames carry. The next pose is sent when the one before is shown, so nothing queues and each pose
// has a frame of its own; with poses_per_s poses come as those of a mouse do.
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/bench/bench_common.h"
#include "client/cli/bench/bench_cpu.h"
#include "client/cli/bench/bench_flow.h"
#include "client/cli/viewer.h"

enum { WARM_POSES = 30, SAMPLES = HG_VIEWER_POSES };
struct latency {
    struct hg_cli *cli;
    struct hg_bench_daemon daemon;
    struct hg_bench_scene scene; // of that daemon
    struct hg_viewer viewer;
    uint64_t wait_ns; // for one pose, or until all that is needed for them is there
    const char *url, *token, *encoding;
    uint32_t poses;
    uint32_t count; // of the samples that follow
    int64_t total_ns[SAMPLES], overhead_ns[SAMPLES], stage_ns[HG_VIEWER_STAGES][SAMPLES];
    uint64_t bytes, begun_ns, ended_ns;
    struct hg_bench_cpu begun_cpu, ended_cpu;
};

static void note_sample(void *user, const struct hg_viewer_sample *sample)
{
    struct latency *l = user;
    if (l->count == SAMPLES)
        return;
    const uint32_t i = l->count++;
    l->total_ns[i] = (int64_t)sample->latency_ns;
    l->overhead_ns[i] = l->total_ns[i] - sample->stage_ns[HG_VIEWER_RENDER];
    for (int k = 0; k < HG_VIEWER_STAGES; k++)
        l->stage_ns[k][i] = sample->stage_ns[k];
    l->bytes += sample->bytes;
}

static enum hg_status read_options(struct latency *l, const json_t *options, struct hg_error *err)
{
    static const struct {
        const char *name;
        enum hgp_encoding encoding;
    } encodings[] = {{"jpeg", HGP_encoding_JPEG}, {"raw8", HGP_encoding_RAW_RGBA8},
        {"zstd", HGP_encoding_ZSTD_RGBA8}, {"png8", HGP_encoding_PNG8}};
    struct hg_viewer_options *o = &l->viewer.options;
    int poses = 300, width = 1280, height = 720, plain = 0;
    double fps = 30;
    json_error_t wrong;
    l->encoding = "jpeg";
    o->asset = "demo:";
    if (json_unpack_ex((json_t *)options, &wrong, JSON_STRICT,
            "{s?i, s?i, s?i, s?F, s?F, s?s, s?s, s?s, s?s, s?b}", "poses", &poses, "width", &width,
            "height", &height, "poses_per_s", &o->poses_per_s, "target_fps", &fps, "scene",
            &o->asset, "url", &l->url, "token", &l->token, "encoding", &l->encoding, "plain",
            &plain))
        return hg_error_set(err, HG_E_INVAL, "bench latency", "options", "%s", wrong.text);
    bool known = false;
    for (size_t i = 0; i < sizeof encodings / sizeof *encodings; i++)
        if (strcmp(encodings[i].name, l->encoding) == 0) {
            o->encoding = encodings[i].encoding;
            known = true;
        }
    if (!known || poses < 1 || poses > SAMPLES - WARM_POSES || width < 1 || height < 1 ||
        !(fps >= 0 && fps <= 1000) || !(o->poses_per_s >= 0 && o->poses_per_s <= 1000))
        return hg_error_set(err, HG_E_INVAL, "bench latency", "options",
            "poses is 1 to %d, encoding jpeg, raw8, zstd or png8, a rate at most 1000",
            SAMPLES - WARM_POSES);
    l->poses = o->poses = (uint32_t)poses;
    o->width = (uint32_t)width;
    o->height = (uint32_t)height;
    o->target_fps = (float)fps;
    o->plain = plain;
    return HG_OK;
}

static enum hg_status not_shown(const struct latency *l, uint64_t left, struct hg_error *err)
{
    const struct hg_viewer *v = &l->viewer;
    return hg_error_set(err, HG_E_TIMEOUT, "bench latency", NULL,
        "no frame of pose %llu or a later one within %.0f s (%llu poses were still to come; "
        "%llu frames came, the newest of pose %llu)",
        (unsigned long long)v->shown_seq + 1, (double)l->wait_ns * 1e-9, (unsigned long long)left,
        (unsigned long long)v->frames, (unsigned long long)v->shown_seq);
}

// Until `count` poses are shown.
static enum hg_status turn(struct latency *l, uint32_t count, struct hg_error *err)
{
    struct hg_viewer *v = &l->viewer;
    const uint64_t end = v->sample_count + count;
    uint64_t known = v->sample_count, until_ns = hg_clock_now_ns() + l->wait_ns;
    v->enough = end;
    while (v->sample_count < end) {
        const uint64_t now_ns = hg_clock_now_ns();
        enum hg_status status = hg_viewer_run(v, now_ns + 20000000, true, err);
        if (status)
            return status;
        if (hg_cli_is_stopped())
            return hg_error_set(err, HG_E_CANCELLED, "bench latency", NULL, "interrupted");
        if (v->sample_count == known && now_ns > until_ns)
            return not_shown(l, end - known, err);
        until_ns = v->sample_count > known ? now_ns + l->wait_ns : until_ns;
        known = v->sample_count;
        hg_cli_progress_update(
            &l->cli->progress, "poses", (uint32_t)(count - (end > known ? end - known : 0)), count);
    }
    return HG_OK;
}

static enum hg_status measure(struct latency *l, struct hg_error *err)
{
    struct hg_viewer *v = &l->viewer;
    v->options.timeout_ns = l->wait_ns;
    enum hg_status status = hg_viewer_open(v, err);
    if (!status)
        status = hg_viewer_await(v, true, l->wait_ns, err); // pipelines, geometry, textures
    if (!status)
        status = turn(l, WARM_POSES, err);
    if (status)
        return status;
    v->on_sample = note_sample;
    v->user = l;
    v->frames = v->stale = 0;
    l->begun_cpu = hg_bench_cpu_now(l->daemon.pid);
    l->begun_ns = hg_clock_now_ns();
    status = turn(l, l->poses, err);
    l->ended_ns = hg_clock_now_ns();
    l->ended_cpu = hg_bench_cpu_now(l->daemon.pid);
    return status;
}

static json_t *report_of(struct latency *l)
{
    const struct hg_viewer *v = &l->viewer;
    const double seconds = (double)(l->ended_ns - l->begun_ns) * 1e-9;
    json_t *stages = json_object();
    json_t *cpu = hg_bench_cpu_report(&l->begun_cpu, &l->ended_cpu, v->frames, !l->url);
    for (int k = 0; k < HG_VIEWER_STAGES; k++)
        json_object_set_new(
            stages, hg_viewer_stage_names[k], hg_bench_percentiles(l->stage_ns[k], l->count));
    return json_pack(
        "{s:s, s:i, s:i, s:s, s:f, s:f, s:o, s:o, s:o, s:o, s:I, s:I, s:f, s:f, s:f, s:f}", "scene",
        v->options.asset, "width", (int)v->options.width, "height", (int)v->options.height,
        "encoding", l->encoding, "poses_per_s", v->options.poses_per_s, "target_fps",
        (double)v->options.target_fps, "overhead_ms",
        hg_bench_percentiles(l->overhead_ns, l->count), "total_ms",
        hg_bench_percentiles(l->total_ns, l->count), "stages", stages, "cpu_ms", cpu, "frames",
        (json_int_t)v->frames, "stale_frames", (json_int_t)v->stale, "frames_per_s",
        seconds > 0 ? (double)v->frames / seconds : 0.0, "bytes_per_frame",
        l->count ? (double)l->bytes / l->count : 0.0, "mbit_per_s",
        seconds > 0 ? (double)l->bytes * 8e-6 / seconds : 0.0, "rtt_ms", (double)v->rtt_ns * 1e-6);
}

// A daemon of our own, which may read the scene. Without tenants no second process compiles shaders
// beside what is measured.
static enum hg_status start_daemon(struct latency *l, struct hg_error *err)
{
    const char *more[] = {"--isolation", "shared", "--asset-root", l->scene.folder, NULL};
    enum hg_status status = hg_bench_scene_find(&l->scene, l->viewer.options.asset, err);
    if (status)
        return status;
    l->viewer.options.asset = l->scene.path;
    if (!*l->scene.folder)
        more[2] = NULL;
    return hg_bench_daemon_start(&l->daemon, NULL, NULL, l->cli->options->cache_dir, more, err);
}

enum hg_status hg_cli_bench_latency(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err)
{
    struct latency *l = hg_calloc(1, sizeof *l);
    *report = NULL;
    if (!l)
        return hg_error_set(err, HG_E_NOMEM, "bench latency", NULL, "no memory");
    l->cli = cli;
    l->wait_ns = hg_bench_wait_ns(cli);
    enum hg_status status = read_options(l, options, err);
    if (!status && !l->url)
        status = start_daemon(l, err);
    l->viewer.options.url = l->url ? l->url : l->daemon.url;
    l->viewer.options.token = l->token;
    if (!status)
        status = measure(l, err);
    hg_viewer_close(&l->viewer);
    hg_bench_daemon_stop(&l->daemon);
    json_t *root = status ? NULL : report_of(l);
    char *text = root ? json_dumps(root, JSON_REAL_PRECISION(6)) : NULL;
    *report = text ? hg_strdup(text) : NULL;
    if (!status && !*report)
        status = hg_error_set(err, HG_E_NOMEM, "bench latency", NULL, "no memory");
    free(text);
    json_decref(root);
    hg_free(l);
    return status;
}
