// bench_many.c - many viewers: of one scene, beside one that does not read, beside hidden ones and
// a path-traced film, and of several tenants. Each viewer is a thread that turns its camera. A
// measurement begins when each of them has drawn frames in motion, so that none compiles what
// another one has compiled already, and lasts until frame counts can tell shares apart: shares are
// of time, and of n frames whose times scatter by s a share is known to about s / sqrt(n).
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/bench_common.h"
#include "client/cli/bench_flow.h"
#include "client/cli/viewer.h"

enum { MOST = 64, MOST_COUNTS = 16, TOKEN_BYTES = 32, BESIDE = 4, WARM_FRAMES = 5 };
#define PULSE_NS 1200000000u // after which the worker's memory has been told
#define SLICE_NS 200000000u  // of waiting for one viewer, after which the others are read
#define WARM_S   1.0

enum kind { MOVES, STUCK, HIDDEN, FILM };

struct seat {
    struct hg_viewer viewer;
    enum kind kind;
    char token[TOKEN_BYTES];
    uint64_t until_ns, frames;
    pthread_t thread;
    enum hg_status status;
    struct hg_error err;
};

// What is measured, each by itself: bits of many.phases.
static const char *const phase_names[] = {"viewers", "stuck", "hidden", "film", "tenants"};
enum { VIEWERS = 1, STUCK_ONE = 2, HIDDEN_ONE = 4, FILM_ONE = 8, TENANTS = 16, ALL = 31 };

struct many {
    struct hg_cli *cli;
    struct hg_bench_daemon daemon;
    struct hg_bench_scene scene;
    struct hg_viewer_options viewer; // of each
    uint64_t wait_ns; // for the first picture of a viewer, one answer, or one measurement
    uint32_t phases;
    double seconds, frames; // a measurement has at least; frames: mean of those that move
    double measured_s;      // the newest one took
    uint32_t counts[MOST_COUNTS], count_count, tenants;
    struct seat *seats; // [MOST]
    uint32_t seat_count;
    json_t *report;
};

// ---- viewers ------------------------------------------------------------------------------------

static void *seat_main(void *arg)
{
    struct seat *s = arg;
    if (s->kind == STUCK) { // what comes stays where it is
        hg_clock_sleep_ns(s->until_ns - hg_clock_now_ns());
        return NULL;
    }
    const uint64_t before = s->viewer.frames;
    s->status = hg_viewer_run(&s->viewer, s->until_ns, s->kind != FILM, &s->err);
    s->frames += s->viewer.frames - before;
    return NULL;
}

// Frames of those that are there are taken while another one comes: the daemon ends clients that
// take none.
static enum hg_status read_others(struct many *m, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i + 1 < m->seat_count && !status; i++)
        if (m->seats[i].kind != STUCK)
            status = hg_viewer_run(&m->seats[i].viewer, hg_clock_now_ns() + 1, false, err);
    return status;
}

static enum hg_status await_first(struct many *m, struct seat *s, struct hg_error *err)
{
    const uint64_t until_ns = hg_clock_now_ns() + m->wait_ns;
    for (;;) {
        struct hg_error others;
        enum hg_status status = hg_viewer_await(&s->viewer, s->kind != FILM, SLICE_NS, err);
        if (status != HG_E_TIMEOUT)
            return status;
        if (hg_clock_now_ns() >= until_ns)
            return hg_error_set(err, HG_E_TIMEOUT, "bench many", NULL,
                "viewer %u of %u%s: no %s frame of its first pose within %.0f s (%llu frames came)",
                m->seat_count, m->seat_count, s->kind == FILM ? ", a film" : "",
                s->kind == FILM ? "first" : "settled", (double)m->wait_ns * 1e-9,
                (unsigned long long)s->viewer.frames);
        status = read_others(m, &others);
        if (status) {
            *err = others;
            return status;
        }
    }
}

static enum hg_status add_seat(
    struct many *m, enum kind kind, uint32_t tenant, const char *scene, struct hg_error *err)
{
    struct seat *s = &m->seats[m->seat_count++];
    *s = (struct seat){.kind = kind, .viewer.options = m->viewer};
    snprintf(s->token, sizeof s->token, "many-token-%u", tenant);
    s->viewer.options.token = s->token;
    s->viewer.options.scene_name = scene;
    s->viewer.options.path = kind == FILM;
    enum hg_status status = hg_viewer_open(&s->viewer, err);
    if (!status)
        status = await_first(m, s, err);
    if (!status && kind == HIDDEN)
        status = hg_viewer_hide(&s->viewer, true, err);
    return status;
}

static void leave(struct many *m)
{
    while (m->seat_count)
        hg_viewer_close(&m->seats[--m->seat_count].viewer);
}

static enum hg_status run_all(struct many *m, double seconds, struct hg_error *err)
{
    const uint64_t until_ns = hg_clock_now_ns() + (uint64_t)(seconds * 1e9);
    uint32_t started = 0;
    for (; started < m->seat_count; started++) {
        struct seat *s = &m->seats[started];
        s->until_ns = until_ns;
        if (pthread_create(&s->thread, NULL, seat_main, s))
            break;
    }
    for (uint32_t i = 0; i < started; i++)
        pthread_join(m->seats[i].thread, NULL);
    if (started < m->seat_count)
        return hg_error_set(err, HG_E_LIMIT, "bench many", NULL, "no thread for a viewer");
    for (uint32_t i = 0; i < started; i++)
        if (m->seats[i].status) {
            *err = m->seats[i].err;
            return m->seats[i].status;
        }
    if (hg_cli_is_stopped())
        return hg_error_set(err, HG_E_CANCELLED, "bench many", NULL, "interrupted");
    return HG_OK;
}

// Of the viewers that move. Returns the mean, and the least number of frames of one.
static double count_frames(const struct many *m, uint64_t *least)
{
    uint64_t sum = 0;
    uint32_t count = 0;
    *least = UINT64_MAX;
    for (uint32_t i = 0; i < m->seat_count; i++) {
        if (m->seats[i].kind != MOVES)
            continue;
        const uint64_t frames = m->seats[i].frames;
        *least = frames < *least ? frames : *least;
        sum += frames;
        count++;
    }
    return count ? (double)sum / count : 0;
}

static void forget_frames(struct many *m)
{
    for (uint32_t i = 0; i < m->seat_count; i++)
        m->seats[i].frames = 0;
}

// Until each has drawn some frames in motion: the first of a worker are there when their shaders
// are compiled, of a view when its targets are made.
static enum hg_status warm_up(struct many *m, struct hg_error *err)
{
    const uint64_t until_ns = hg_clock_now_ns() + m->wait_ns;
    uint64_t least = 0;
    enum hg_status status = HG_OK;
    forget_frames(m);
    while (!status && least < WARM_FRAMES) {
        if (hg_clock_now_ns() >= until_ns)
            return hg_error_set(err, HG_E_TIMEOUT, "bench many", NULL,
                "one of %u viewers drew %llu frames in motion within %.0f s", m->seat_count,
                (unsigned long long)least, (double)m->wait_ns * 1e-9);
        status = run_all(m, WARM_S, err);
        count_frames(m, &least);
    }
    return status;
}

// Frames that were begun when a part of it ends count in the next part.
static enum hg_status run_window(struct many *m, struct hg_error *err)
{
    const uint64_t begin_ns = hg_clock_now_ns();
    uint64_t least, now_ns;
    enum hg_status status = HG_OK;
    forget_frames(m);
    do {
        status = run_all(m, m->seconds, err);
        now_ns = hg_clock_now_ns();
    } while (!status && count_frames(m, &least) < m->frames && now_ns - begin_ns < m->wait_ns);
    m->measured_s = (double)(now_ns - begin_ns) * 1e-9;
    return status;
}

// ---- numbers ------------------------------------------------------------------------------------

// Frames per second of those that move, and how alike they are.
static json_t *rates(const struct many *m, double *mean)
{
    double least = 1e30, most = 0, sum = 0;
    uint32_t count = 0;
    json_t *fps = json_array();
    for (uint32_t i = 0; i < m->seat_count; i++) {
        if (m->seats[i].kind != MOVES)
            continue;
        const double rate = (double)m->seats[i].frames / m->measured_s;
        json_array_append_new(fps, json_real(rate));
        least = rate < least ? rate : least;
        most = rate > most ? rate : most;
        sum += rate;
        count++;
    }
    *mean = count ? sum / count : 0;
    return json_pack("{s:o, s:f, s:f, s:f}", "fps", fps, "total_fps", sum, "seconds", m->measured_s,
        "fairness", most > 0 ? least / most : 0.0);
}

static bool has_tenants(const struct many *m)
{
    return (m->phases & TENANTS) && m->tenants > 0;
}

// Resident memory of the workers in use, in all: of those that have a tenant, or of the only one.
static enum hg_status workers_bytes(const struct many *m, uint64_t *bytes, struct hg_error *err)
{
    struct helio *h;
    char *text = NULL;
    const struct helio_options options = {.url = m->daemon.url, .token = "many-admin-token"};
    *bytes = 0;
    hg_clock_sleep_ns(PULSE_NS);
    enum hg_status status = helio_connect(&options, &h, err);
    if (!status)
        status = helio_query_json(h, HGP_T_sessions_query, 0, &text, err);
    helio_destroy(h);
    json_t *root = text ? json_loads(text, 0, NULL) : NULL, *worker;
    size_t i;
    json_array_foreach(json_object_get(root, "workers"), i, worker)
    {
        const char *tenant = json_string_value(json_object_get(worker, "tenant"));
        if ((tenant && *tenant) || !has_tenants(m))
            *bytes += (uint64_t)json_integer_value(json_object_get(worker, "rss_bytes"));
    }
    json_decref(root);
    helio_text_free(text);
    return status;
}

// ---- phases -------------------------------------------------------------------------------------

static enum hg_status measure(struct many *m, json_t **out, double *mean, struct hg_error *err)
{
    uint64_t bytes;
    *out = NULL;
    enum hg_status status = warm_up(m, err);
    if (!status)
        status = run_window(m, err);
    if (!status)
        status = workers_bytes(m, &bytes, err);
    if (status)
        return status;
    *out = rates(m, mean);
    json_object_set_new(*out, "workers_rss_bytes", json_integer((json_int_t)bytes));
    return HG_OK;
}

static enum hg_status measure_counts(struct many *m, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    json_int_t bytes_before = 0;
    uint32_t count_before = 0;
    json_t *list = json_array();
    json_object_set_new(m->report, "viewers", list);
    for (uint32_t i = 0; i < m->count_count && !status; i++) {
        json_t *one;
        double mean;
        hg_cli_progress_update(&m->cli->progress, "numbers of viewers", i, m->count_count);
        while (m->seat_count < m->counts[i] && !status)
            status = add_seat(m, MOVES, 0, "shared", err);
        if (!status)
            status = measure(m, &one, &mean, err);
        if (status)
            break;
        const json_int_t bytes = json_integer_value(json_object_get(one, "workers_rss_bytes"));
        json_object_set_new(one, "count", json_integer(m->counts[i]));
        if (count_before)
            json_object_set_new(one, "bytes_per_viewer",
                json_integer((bytes - bytes_before) / (json_int_t)(m->counts[i] - count_before)));
        bytes_before = bytes;
        count_before = m->counts[i];
        json_array_append_new(list, one);
    }
    leave(m);
    return status;
}

// Viewers alone, and beside others of that kind: what these take.
static enum hg_status measure_beside(
    struct many *m, enum kind kind, const char *name, struct hg_error *err)
{
    json_t *alone = NULL, *beside = NULL;
    double before = 0, after = 0;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < BESIDE && !status; i++)
        status = add_seat(m, MOVES, 0, "shared", err);
    if (!status)
        status = measure(m, &alone, &before, err);
    if (!status)
        status = add_seat(m, kind, 0, "shared", err);
    if (!status)
        status = measure(m, &beside, &after, err);
    leave(m);
    if (status) {
        json_decref(alone);
        return status;
    }
    json_object_set_new(m->report, name,
        json_pack("{s:o, s:o, s:f}", "alone", alone, "beside", beside, "ratio",
            before > 0 ? after / before : 0.0));
    return HG_OK;
}

static enum hg_status measure_tenants(struct many *m, struct hg_error *err)
{
    json_t *one = NULL;
    double mean;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < m->tenants && !status; i++)
        status = add_seat(m, MOVES, i, "own", err);
    if (!status)
        status = measure(m, &one, &mean, err);
    leave(m);
    if (status)
        return status;
    json_object_set_new(one, "count", json_integer(m->tenants));
    json_object_set_new(m->report, "tenants", one);
    return HG_OK;
}

// ---- the benchmark ------------------------------------------------------------------------------

static enum hg_status read_counts(struct many *m, const json_t *list, struct hg_error *err)
{
    // From 7 to 8: what the eighth takes.
    static const uint32_t standard[] = {1, 2, 4, 7, 8, 32};
    size_t i;
    json_t *item;
    m->count_count = 0;
    if (!list) {
        memcpy(m->counts, standard, sizeof standard);
        m->count_count = sizeof standard / sizeof *standard;
        return HG_OK;
    }
    json_array_foreach((json_t *)list, i, item)
    {
        const json_int_t count = json_integer_value(item);
        const json_int_t before = m->count_count ? m->counts[m->count_count - 1] : 0;
        if (m->count_count == MOST_COUNTS || count <= before || count > MOST)
            return hg_error_set(err, HG_E_INVAL, "bench many", "viewers",
                "are at most %d rising numbers of at most %d", MOST_COUNTS, MOST);
        m->counts[m->count_count++] = (uint32_t)count;
    }
    return HG_OK;
}

static enum hg_status read_phases(struct many *m, const json_t *list, struct hg_error *err)
{
    size_t i;
    json_t *item;
    m->phases = list ? 0 : ALL;
    json_array_foreach((json_t *)list, i, item)
    {
        const char *name = json_string_value(item);
        uint32_t bit = 0;
        for (uint32_t k = 0; k < sizeof phase_names / sizeof *phase_names; k++)
            bit |= name && strcmp(name, phase_names[k]) == 0 ? 1u << k : 0;
        if (!bit)
            return hg_error_set(err, HG_E_INVAL, "bench many", "phases",
                "are of viewers, stuck, hidden, film and tenants");
        m->phases |= bit;
    }
    return HG_OK;
}

static enum hg_status read_options(struct many *m, const json_t *options, struct hg_error *err)
{
    int width = 320, height = 180, tenants = 8, plain = 0;
    double fps = 30;
    json_t *counts = NULL, *phases = NULL;
    json_error_t wrong;
    m->seconds = 5;
    m->frames = 60;
    m->viewer = (struct hg_viewer_options){.asset = "demo:",
        .poses = 300,
        .poses_per_s = 60,
        .encoding = HGP_encoding_JPEG,
        .timeout_ns = m->wait_ns};
    if (json_unpack_ex((json_t *)options, &wrong, JSON_STRICT,
            "{s?F, s?F, s?o, s?o, s?i, s?i, s?i, s?F, s?F, s?s, s?b}", "seconds", &m->seconds,
            "frames", &m->frames, "viewers", &counts, "phases", &phases, "tenants", &tenants,
            "width", &width, "height", &height, "poses_per_s", &m->viewer.poses_per_s, "target_fps",
            &fps, "scene", &m->viewer.asset, "plain", &plain))
        return hg_error_set(err, HG_E_INVAL, "bench many", "options", "%s", wrong.text);
    if (!(m->seconds > 0 && m->seconds <= 3600) || !(m->frames >= 0) || tenants < 0 ||
        tenants > 32 || width < 1 || height < 1 || !(fps >= 0 && fps <= 1000) ||
        !(m->viewer.poses_per_s > 0 && m->viewer.poses_per_s <= 1000))
        return hg_error_set(err, HG_E_INVAL, "bench many", "options",
            "seconds is at most 3600, tenants 0 to 32, a rate at most 1000");
    m->tenants = (uint32_t)tenants;
    m->viewer.width = (uint32_t)width;
    m->viewer.height = (uint32_t)height;
    m->viewer.target_fps = (float)fps;
    m->viewer.plain = plain;
    enum hg_status status = read_phases(m, phases, err);
    return status ? status : read_counts(m, counts, err);
}

static enum hg_status start_daemon(struct many *m, struct hg_error *err)
{
    char tokens[2048], tenants[16];
    enum hg_status status = hg_bench_scene_find(&m->scene, m->viewer.asset, err);
    if (status)
        return status;
    m->viewer.asset = m->scene.path;
    size_t size = (size_t)snprintf(tokens, sizeof tokens, "many-admin-token admin admin\n");
    for (uint32_t i = 0; i < (m->tenants ? m->tenants : 1); i++)
        size += (size_t)snprintf(
            tokens + size, sizeof tokens - size, "many-token-%u edit tenant%u\n", i, i);
    snprintf(tenants, sizeof tenants, "%u", m->tenants ? m->tenants : 1);
    const char *more[] = {"--max-sessions-per-token", "128", "--max-workers", tenants,
        "--isolation", has_tenants(m) ? "tenant" : "shared",
        *m->scene.folder ? "--asset-root" : NULL, m->scene.folder, NULL};
    status = hg_bench_daemon_start(
        &m->daemon, tokens, "many-admin-token", m->cli->options->cache_dir, more, err);
    m->viewer.url = m->daemon.url;
    return status;
}

static enum hg_status run(struct many *m, struct hg_error *err)
{
    enum hg_status status = start_daemon(m, err);
    if (!status && (m->phases & VIEWERS))
        status = measure_counts(m, err);
    if (!status && (m->phases & STUCK_ONE))
        status = measure_beside(m, STUCK, "stuck", err);
    if (!status && (m->phases & HIDDEN_ONE))
        status = measure_beside(m, HIDDEN, "hidden", err);
    if (!status && (m->phases & FILM_ONE))
        status = measure_beside(m, FILM, "film", err);
    if (!status && has_tenants(m))
        status = measure_tenants(m, err);
    return status;
}

enum hg_status hg_cli_bench_many(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err)
{
    struct many *m = hg_calloc(1, sizeof *m);
    *report = NULL;
    if (m)
        m->seats = hg_calloc(MOST, sizeof *m->seats);
    if (m)
        m->report = json_object();
    enum hg_status status = m && m->seats && m->report
                                ? HG_OK
                                : hg_error_set(err, HG_E_NOMEM, "bench many", NULL, "no memory");
    if (!status) {
        m->cli = cli;
        m->wait_ns = hg_bench_wait_ns(cli);
        status = read_options(m, options, err);
    }
    if (!status) {
        status = run(m, err);
        leave(m);
        hg_bench_daemon_stop(&m->daemon);
    }
    char *text = status ? NULL : json_dumps(m->report, JSON_REAL_PRECISION(6));
    *report = text ? hg_strdup(text) : NULL;
    if (!status && !*report)
        status = hg_error_set(err, HG_E_NOMEM, "bench many", NULL, "no memory");
    free(text);
    if (m) {
        json_decref(m->report);
        hg_free(m->seats);
    }
    hg_free(m);
    return status;
}
