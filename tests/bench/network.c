// network.c - what a viewer sees behind a slow network: frame rates, latencies and how soon they
// are back after the rate fell from 20 to 1 Mbit/s and rose again, at a round trip of 300 ms, and
// after stalls. Prints JSON; --json FILE writes it. --seconds N: of each phase (5); --scene ASSET;
// --size WxH. --soak N: for N seconds in place of all that, rates and stalls in turn, and the
// memory of the daemon and its workers after each turn.
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "client/cli/bench/bench_common.h"
#include "client/cli/bench/bench_cpu.h"
#include "client/cli/viewer.h"
#include "tests/support/shaper.h"

enum { SAMPLES = 1 << 16 };
#define MS        UINT64_C(1000000)
#define SECOND_NS UINT64_C(1000000000)
#define WAIT_NS   (600 * SECOND_NS)
#define MBIT      125000.0 // bytes a second

struct network {
    struct hg_bench_daemon daemon;
    struct shaper shaper;
    struct hg_viewer viewer;
    double seconds;
    struct hg_viewer_sample samples[SAMPLES];
    uint32_t count;
    char url[64];
};

static void fail(const struct hg_error *err)
{
    fprintf(stderr, "bench_network: %s %s: %s\n", err->what, err->where, err->reason);
    exit(1);
}

static void note_sample(void *user, const struct hg_viewer_sample *sample)
{
    struct network *n = user;
    if (n->count < SAMPLES)
        n->samples[n->count++] = *sample;
}

static void begin(struct network *n, const struct shaper_options *options)
{
    struct hg_error err = {0};
    if (!shaper_start(&n->shaper, strchr(n->daemon.url, ':') + 1, options)) {
        fprintf(stderr, "bench_network: no proxy\n");
        exit(1);
    }
    const struct hg_viewer_options o = n->viewer.options;
    snprintf(n->url, sizeof n->url, "tcp:127.0.0.1:%d", n->shaper.port);
    n->viewer = (struct hg_viewer){.options = o, .on_sample = note_sample, .user = n};
    n->viewer.options.url = n->url;
    if (hg_viewer_open(&n->viewer, &err) || hg_viewer_await(&n->viewer, true, WAIT_NS, &err))
        fail(&err);
    n->count = 0;
}

static void end(struct network *n)
{
    hg_viewer_close(&n->viewer);
    shaper_stop(&n->shaper);
}

static void move(struct network *n, double seconds)
{
    struct hg_error err = {0};
    const uint64_t until_ns = hg_clock_now_ns() + (uint64_t)(seconds * 1e9);
    if (hg_viewer_run(&n->viewer, until_ns, true, &err))
        fail(&err);
}

// ---- what was seen ------------------------------------------------------------------------------

struct seen {
    double fps, bytes;
    int64_t latency_ns; // median
    uint64_t gap_ns;    // longest between two frames
};

static int compare_ns(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return x < y ? -1 : x > y;
}

static struct seen see(const struct network *n, uint64_t from_ns, uint64_t to_ns)
{
    static int64_t latencies[SAMPLES];
    struct seen s = {0};
    uint32_t count = 0;
    uint64_t before_ns = from_ns;
    for (uint32_t i = 0; i < n->count; i++) {
        const struct hg_viewer_sample *it = &n->samples[i];
        if (it->shown_ns < from_ns || it->shown_ns >= to_ns)
            continue;
        latencies[count++] = (int64_t)it->latency_ns;
        s.bytes += it->bytes;
        s.gap_ns = it->shown_ns - before_ns > s.gap_ns ? it->shown_ns - before_ns : s.gap_ns;
        before_ns = it->shown_ns;
    }
    s.gap_ns = to_ns - before_ns > s.gap_ns ? to_ns - before_ns : s.gap_ns;
    qsort(latencies, count, sizeof *latencies, compare_ns);
    s.fps = (double)count / ((double)(to_ns - from_ns) * 1e-9);
    s.bytes = count ? s.bytes / count : 0;
    s.latency_ns = count ? latencies[count / 2] : 0;
    return s;
}

static json_t *seen_json(const struct seen *s)
{
    return json_pack("{s:f, s:f, s:f, s:f}", "fps", s->fps, "latency_ms",
        (double)s->latency_ns * 1e-6, "bytes_per_frame", s->bytes, "longest_gap_ms",
        (double)s->gap_ns * 1e-6);
}

// From when on a second looks as it did before; below 0: it never did.
static double recovery_s(
    const struct network *n, const struct seen *usual, uint64_t from_ns, uint64_t to_ns)
{
    for (uint64_t t = from_ns; t + SECOND_NS <= to_ns; t += 50 * MS) {
        const struct seen now = see(n, t, t + SECOND_NS);
        if (now.fps >= 0.9 * usual->fps && now.bytes >= 0.8 * usual->bytes &&
            now.latency_ns <= usual->latency_ns * 5 / 4 + 10 * (int64_t)MS)
            return (double)(t - from_ns) * 1e-9;
    }
    return -1;
}

// ---- traces -------------------------------------------------------------------------------------

static json_t *run_trace(struct network *n)
{
    begin(n, &(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 10 * MS, .jitter_ns = 2 * MS});
    move(n, 1); // until it is steady
    const uint64_t t0 = hg_clock_now_ns();
    move(n, n->seconds);
    const uint64_t t1 = hg_clock_now_ns();
    shaper_set_rate(&n->shaper, MBIT);
    move(n, n->seconds);
    const uint64_t t2 = hg_clock_now_ns();
    shaper_set_rate(&n->shaper, 20 * MBIT);
    move(n, n->seconds);
    const uint64_t t3 = hg_clock_now_ns();
    const struct seen usual = see(n, t0, t1), settled = see(n, t1 + (t2 - t1) / 2, t2),
                      low = see(n, t1, t2), after = see(n, t2, t3);
    const double fall_s = recovery_s(n,
                     &(struct seen){.fps = settled.fps, .latency_ns = settled.latency_ns}, t1, t2),
                 rise_s = recovery_s(n, &usual, t2, t3);
    end(n);
    return json_pack("{s:o, s:o, s:o, s:o, s:f, s:f, s:I}", "at_20_mbit_s", seen_json(&usual),
        "at_1_mbit_s", seen_json(&low), "at_1_mbit_s_second_half", seen_json(&settled),
        "at_20_mbit_s_again", seen_json(&after), "settles_at_1_mbit_s_after_s", fall_s,
        "recovers_after_s", rise_s, "stale_frames", (json_int_t)n->viewer.stale);
}

static json_t *run_long(struct network *n)
{
    begin(n, &(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 150 * MS});
    move(n, 1);
    const uint64_t t0 = hg_clock_now_ns();
    move(n, n->seconds);
    const struct seen seen = see(n, t0, hg_clock_now_ns());
    json_t *out = seen_json(&seen);
    json_object_set_new(out, "rtt_ms", json_real((double)n->viewer.rtt_ns * 1e-6));
    end(n);
    return out;
}

static json_t *run_stalls(struct network *n)
{
    json_t *list = json_array();
    struct hg_error err = {0};
    begin(n, &(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 10 * MS});
    for (int i = 0; i < 3; i++) {
        move(n, 1);
        shaper_set_rate(&n->shaper, 0);
        move(n, 1);
        const uint64_t now_ns = hg_clock_now_ns();
        const uint64_t frames = n->viewer.frames;
        shaper_set_rate(&n->shaper, -1);
        if (hg_viewer_await(&n->viewer, false, WAIT_NS, &err)) // the newest pose
            fail(&err);
        json_array_append_new(list,
            json_pack("{s:f, s:I}", "newest_after_ms", (double)(hg_clock_now_ns() - now_ns) * 1e-6,
                "frames_before", (json_int_t)(n->viewer.frames - frames - 1)));
    }
    end(n);
    return list;
}

// Falls, rises and stalls in turns of four times `seconds` and two more; what is resident after
// each.
static json_t *run_soak(struct network *n, double soak_s)
{
    json_t *daemon = json_array(), *workers = json_array();
    begin(n, &(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 40 * MS, .jitter_ns = 5 * MS});
    const uint64_t until_ns = hg_clock_now_ns() + (uint64_t)(soak_s * 1e9);
    while (hg_clock_now_ns() < until_ns) {
        static const double rates[] = {20 * MBIT, MBIT, 5 * MBIT, 0, 20 * MBIT, 0};
        for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
            shaper_set_rate(&n->shaper, rates[i]);
            move(n, rates[i] > 0 ? n->seconds : 1);
        }
        const struct hg_bench_cpu now = hg_bench_cpu_now(n->daemon.pid);
        json_array_append_new(daemon, json_integer((json_int_t)now.daemon_bytes));
        json_array_append_new(workers, json_integer((json_int_t)now.workers_bytes));
        n->count = 0; // samples are not needed
    }
    end(n);
    return json_pack("{s:f, s:I, s:I, s:o, s:o}", "soak_s", soak_s, "frames",
        (json_int_t)n->viewer.frames, "stale_frames", (json_int_t)n->viewer.stale,
        "daemon_rss_bytes", daemon, "workers_rss_bytes", workers);
}

static json_t *run_phases(struct network *n)
{
    return json_pack("{s:o, s:o, s:o}", "trace", run_trace(n), "rtt_300_ms", run_long(n), "stalls",
        run_stalls(n));
}

int main(int argc, char **argv)
{
    static struct network n = {.seconds = 5};
    double soak_s = 0;
    const char *file = NULL, *scene = "demo:";
    unsigned width = 1280, height = 720;
    struct hg_error err = {0};
    for (int i = 1; i + 1 < argc; i += 2) {
        file = strcmp(argv[i], "--json") == 0 ? argv[i + 1] : file;
        scene = strcmp(argv[i], "--scene") == 0 ? argv[i + 1] : scene;
        n.seconds = strcmp(argv[i], "--seconds") == 0 ? atof(argv[i + 1]) : n.seconds;
        soak_s = strcmp(argv[i], "--soak") == 0 ? atof(argv[i + 1]) : soak_s;
        if (strcmp(argv[i], "--size") == 0 && sscanf(argv[i + 1], "%ux%u", &width, &height) != 2)
            return 2;
    }
    n.viewer.options = (struct hg_viewer_options){.asset = scene,
        .width = width,
        .height = height,
        .poses = 300,
        .poses_per_s = 60,
        .target_fps = 30,
        .encoding = HGP_encoding_JPEG,
        .timeout_ns = WAIT_NS};
    if (hg_bench_daemon_start(&n.daemon, NULL, NULL, NULL, NULL, &err))
        fail(&err);
    json_t *root = soak_s > 0 ? run_soak(&n, soak_s) : run_phases(&n);
    hg_bench_daemon_stop(&n.daemon);
    const int failed = file ? json_dump_file(root, file, JSON_INDENT(2))
                            : json_dumpf(root, stdout, JSON_INDENT(2));
    json_decref(root);
    return failed ? 1 : 0;
}
