// bench_many.c - many viewers: of one scene, beside one that does not read, beside hidden ones and
// a path-traced film, and of several tenants. Each viewer is a thread that turns its camera. A
// measurement begins when each of them has drawn frames in motion, so that none compiles what
// another one has compiled already, and lasts until frame counts can tell shares apart: shares are
// of time, and of n frames whose times scatter by s a share is known to about s / sqrt(n).
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/bench/bench_common.h"
#include "client/cli/bench/bench_flow.h"
#include "client/cli/bench/bench_share.h"
#include "client/cli/viewer.h"

enum { MOST = 64, MOST_COUNTS = 16, TOKEN_BYTES = 32, BESIDE = 4 };
enum { WARM_FRAMES = 5, WARM_FILM_FRAMES = 3 }; // of a film: of 1, 2 and 4 samples
#define SLICE_NS 200000000u // of waiting for one viewer, after which the others are read
#define PART_S   1.0        // of a window, after which progress is said
#define WARM_S   1.0

enum kind { MOVES, STUCK, HIDDEN, FILM };

struct seat {
    struct hg_viewer viewer;
    enum kind kind;
    char token[TOKEN_BYTES];
    uint64_t until_ns;
    uint64_t *times_ns; // of frames, each of a newer pose
    size_t room;
    uint32_t frames;
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
    uint64_t wait_ns;                // for the first picture of a viewer, or one answer
    uint64_t end_ns;                 // when all ends
    uint32_t phases;
    double seconds, frames;     // a measurement has at least; frames: mean of those that move
    double window_s, limit_s;   // a measurement, and all, take at most
    bool settles;               // each viewer before the next one comes
    uint64_t begin_ns, stop_ns; // of the newest measurement
    uint32_t counts[MOST_COUNTS], count_count, tenants;
    struct seat *seats; // [MOST]
    uint32_t seat_count;
    uint32_t measured; // measurements so far
    const char *phase; // static
    char doing[72];    // shown
    json_t *report;
};

// ---- time ---------------------------------------------------------------------------------------

// What is being done, on the error stream and in what is said when time runs out.
__attribute__((format(printf, 4, 5))) static void say(
    struct many *m, uint64_t done, uint64_t total, const char *format, ...)
{
    char what[48];
    va_list args;
    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    snprintf(m->doing, sizeof m->doing, "%s, %s", m->phase, what);
    hg_cli_progress_update(&m->cli->progress, m->doing, done, total);
}

// That is left of `ns`, and of all.
static uint64_t bounded_ns(const struct many *m, uint64_t ns)
{
    const uint64_t now_ns = hg_clock_now_ns(),
                   left_ns = m->end_ns > now_ns ? m->end_ns - now_ns : 1;
    return ns < left_ns ? ns : left_ns;
}

static bool is_over(const struct many *m)
{
    return hg_clock_now_ns() >= m->end_ns;
}

static enum hg_status check_time(const struct many *m, struct hg_error *err)
{
    if (hg_cli_is_stopped())
        return hg_error_set(err, HG_E_CANCELLED, "bench many", NULL, "interrupted");
    return is_over(m) ? hg_error_set(err, HG_E_TIMEOUT, "bench many", "limit_s",
                            "%s: not through within %g s", m->doing, m->limit_s)
                      : HG_OK;
}

// ---- viewers ------------------------------------------------------------------------------------

static void note_frame(void *user, const struct hg_viewer_sample *sample)
{
    struct seat *s = user;
    if (!hg_grow(&s->times_ns, &s->room, (size_t)s->frames + 1, sizeof *s->times_ns))
        s->times_ns[s->frames++] = sample->shown_ns;
}

static void *seat_main(void *arg)
{
    struct seat *s = arg;
    const uint64_t now_ns = hg_clock_now_ns();
    if (s->kind == STUCK) { // what comes stays where it is
        hg_clock_sleep_ns(s->until_ns > now_ns ? s->until_ns - now_ns : 0);
        return NULL;
    }
    s->status = hg_viewer_run(&s->viewer, s->until_ns, s->kind != FILM, &s->err);
    return NULL;
}

// Frames of the first `count` are taken while something else is waited for: the daemon ends clients
// that take none.
static enum hg_status read_some(struct many *m, uint32_t count, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count && !status; i++)
        if (m->seats[i].kind != STUCK)
            status = hg_viewer_run(&m->seats[i].viewer, hg_clock_now_ns() + 1, false, err);
    return status;
}

static enum hg_status await_first(struct many *m, struct seat *s, struct hg_error *err)
{
    const uint64_t until_ns = hg_clock_now_ns() + m->wait_ns;
    // One that is stuck would go on to its settled picture, as any viewer at rest.
    const bool settles =
        s->kind == STUCK || (s->kind != FILM && (m->settles || m->seat_count == 1));
    const char *what = settles ? "settled" : "first";
    for (;;) {
        struct hg_error others;
        enum hg_status status = hg_viewer_await(&s->viewer, settles, bounded_ns(m, SLICE_NS), err);
        if (status != HG_E_TIMEOUT)
            return status;
        say(m, s->viewer.frames, 0, "viewer %u: %s picture, frames", m->seat_count, what);
        status = check_time(m, err);
        if (status)
            return status;
        if (hg_clock_now_ns() >= until_ns)
            return hg_error_set(err, HG_E_TIMEOUT, "bench many", NULL,
                "viewer %u of %u%s: no %s frame of its first pose within %.0f s (%llu frames came)",
                m->seat_count, m->seat_count, s->kind == FILM ? ", a film" : "", what,
                (double)m->wait_ns * 1e-9, (unsigned long long)s->viewer.frames);
        status = read_some(m, m->seat_count - 1, &others);
        if (status) {
            *err = others;
            return status;
        }
    }
}

static enum hg_status add_seat(
    struct many *m, enum kind kind, uint32_t tenant, const char *scene, struct hg_error *err)
{
    enum hg_status status = check_time(m, err);
    if (status)
        return status;
    struct seat *s = &m->seats[m->seat_count++];
    say(m, 0, 0, "viewer %u: opens the scene", m->seat_count);
    *s = (struct seat){.kind = kind, .viewer.options = m->viewer};
    snprintf(s->token, sizeof s->token, "many-token-%u", tenant);
    s->viewer.options.token = s->token;
    s->viewer.options.scene_name = scene;
    s->viewer.options.path = kind == FILM;
    s->viewer.options.timeout_ns = bounded_ns(m, m->wait_ns);
    s->viewer.on_sample = note_frame;
    s->viewer.user = s;
    status = hg_viewer_open(&s->viewer, err);
    if (!status)
        status = await_first(m, s, err);
    if (!status && kind == HIDDEN)
        status = hg_viewer_hide(&s->viewer, true, err);
    return status;
}

static void leave(struct many *m)
{
    while (m->seat_count) {
        struct seat *s = &m->seats[--m->seat_count];
        hg_viewer_close(&s->viewer);
        hg_free(s->times_ns);
    }
}

static enum hg_status run_all(struct many *m, double seconds, struct hg_error *err)
{
    const uint64_t until_ns = hg_clock_now_ns() + bounded_ns(m, (uint64_t)(seconds * 1e9));
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

// Whether each path-traced film has drawn some frames: the first ones compile its kernels.
static bool films_are_warm(const struct many *m)
{
    for (uint32_t i = 0; i < m->seat_count; i++)
        if (m->seats[i].kind == FILM && m->seats[i].viewer.frames < WARM_FILM_FRAMES)
            return false;
    return true;
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
    while (!status && (least < WARM_FRAMES || !films_are_warm(m))) {
        say(m, least, WARM_FRAMES, "%u viewers: frames to warm up", m->seat_count);
        status = check_time(m, err);
        if (!status && hg_clock_now_ns() >= until_ns)
            return hg_error_set(err, HG_E_TIMEOUT, "bench many", NULL,
                "one of %u viewers drew %llu frames in motion within %.0f s%s", m->seat_count,
                (unsigned long long)least, (double)m->wait_ns * 1e-9,
                films_are_warm(m) ? "" : ", a film less than 4 samples");
        if (!status)
            status = run_all(m, WARM_S, err);
        count_frames(m, &least);
    }
    return status;
}

// Until each has a frame, too. Frames that were begun when a part of it ends count in the next
// part.
static enum hg_status run_window(struct many *m, struct hg_error *err)
{
    const double part_s = m->seconds < PART_S ? m->seconds : PART_S;
    uint64_t least;
    double frames, s;
    enum hg_status status = HG_OK;
    forget_frames(m);
    m->begin_ns = hg_clock_now_ns();
    do {
        status = status ? status : run_all(m, part_s, err);
        m->stop_ns = hg_clock_now_ns();
        s = (double)(m->stop_ns - m->begin_ns) * 1e-9;
        frames = count_frames(m, &least);
        say(m, (uint64_t)frames, (uint64_t)m->frames, "%u viewers: frames of each", m->seat_count);
        if (!status && s < m->seconds)
            status = check_time(m, err);
    } while (!status && (s < m->seconds || frames < m->frames || least == 0) && s < m->window_s &&
             !is_over(m));
    return status;
}

// ---- numbers ------------------------------------------------------------------------------------

static double measured_s(const struct many *m)
{
    return (double)(m->stop_ns - m->begin_ns) * 1e-9;
}

// Frames per second of those that move, and how alike they are.
static json_t *rates(const struct many *m, double *mean)
{
    struct hg_bench_times times[MOST];
    struct hg_bench_shares shares;
    double sum = 0;
    uint32_t count = 0;
    json_t *fps = json_array();
    for (uint32_t i = 0; i < m->seat_count; i++) {
        const struct seat *s = &m->seats[i];
        if (s->kind != MOVES)
            continue;
        const double rate = (double)s->frames / measured_s(m);
        json_array_append_new(fps, json_real(rate));
        times[count++] = (struct hg_bench_times){s->times_ns, s->frames};
        sum += rate;
    }
    *mean = count ? sum / count : 0;
    hg_bench_shares(times, count, m->begin_ns, m->stop_ns, &shares);
    return json_pack("{s:o, s:f, s:f, s:f, s:f, s:f}", "fps", fps, "total_fps", sum, "seconds",
        measured_s(m), "fairness", shares.fairness, "fairness_error", shares.error,
        "fairness_of_equal", shares.equal);
}

static bool has_tenants(const struct many *m)
{
    return (m->phases & TENANTS) && m->tenants > 0;
}

// ---- memory -------------------------------------------------------------------------------------

static json_int_t member(const json_t *root, const char *object, const char *key)
{
    return json_integer_value(json_object_get(json_object_get(root, object), key));
}

static enum hg_status ask_stats(
    struct many *m, struct seat *s, json_t **stats, struct hg_error *err)
{
    char *text;
    *stats = NULL;
    helio_set_timeout(s->viewer.h, bounded_ns(m, m->wait_ns));
    enum hg_status status =
        helio_query_json(s->viewer.h, HGP_T_stats_query, HG_VIEWER_VIEW, &text, err);
    if (status)
        return status;
    *stats = json_loads(text, 0, NULL);
    helio_text_free(text);
    return *stats ? HG_OK
                  : hg_error_set(err, HG_E_FORMAT, "bench many", NULL, "no statistics came");
}

// What the governor left of a viewer's newest picture in motion: equal shares of time are equal
// frames per second only where these are equal.
static json_t *quality_of(const json_t *stats)
{
    static const char *const keys[] = {"width", "height", "probe_rays", "error_factor"};
    json_t *out = json_object();
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        json_object_set(out, keys[i], json_object_get(json_object_get(stats, "motion"), keys[i]));
    return out;
}

// Resident memory of the worker, and of it the render targets of the viewers that move. With
// `apart` each of them has a worker of its own; else it is what the first answer says, as views
// that are not moved for a tenth of a second begin to refine, which takes memory of the scene.
static enum hg_status add_state(struct many *m, bool apart, json_t *to, struct hg_error *err)
{
    json_int_t resident = 0, targets = 0, device = 0, atlas = 0;
    json_t *each_resident = json_array(), *each_target = json_array(), *quality = json_array();
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < m->seat_count && !status; i++) {
        json_t *stats = NULL;
        if (m->seats[i].kind != MOVES)
            continue;
        say(m, i, m->seat_count, "%u viewers: memory of each", m->seat_count);
        status = check_time(m, err);
        if (!status)
            status = ask_stats(m, &m->seats[i], &stats, err);
        if (!status)
            status = read_some(m, m->seat_count, err);
        const json_int_t rss = member(stats, "process", "rss_bytes"),
                         own = member(stats, "targets", "bytes");
        targets += own;
        if (apart || resident == 0) {
            resident += rss;
            device += member(stats, "device", "used_bytes");
            atlas += member(stats, "light", "atlas_bytes");
        }
        json_array_append_new(each_resident, json_integer(rss));
        json_array_append_new(each_target, json_integer(own));
        json_array_append_new(quality, quality_of(stats));
        json_decref(stats);
    }
    json_object_set_new(to, "workers_rss_bytes", json_integer(resident));
    json_object_set_new(to, "target_bytes", json_integer(targets));
    json_object_set_new(to, "device_bytes", json_integer(device));
    json_object_set_new(to, "shadow_atlas_bytes", json_integer(atlas));
    json_object_set_new(to, "quality", quality);
    if (apart) {
        json_object_set(to, "worker_rss_bytes_each", each_resident);
        json_object_set(to, "target_bytes_each", each_target);
    }
    json_decref(each_resident);
    json_decref(each_target);
    return status;
}

// ---- phases -------------------------------------------------------------------------------------

static enum hg_status measure(
    struct many *m, bool apart, json_t **out, double *mean, struct hg_error *err)
{
    *out = NULL;
    enum hg_status status = warm_up(m, err);
    if (!status)
        status = run_window(m, err);
    if (status)
        return status;
    json_t *numbers = rates(m, mean);
    status = add_state(m, apart, numbers, err);
    if (status) {
        json_decref(numbers);
        return status;
    }
    *out = numbers;
    m->measured++;
    return HG_OK;
}

// What each viewer added that came since the number before: its render targets, and all else.
static void add_growth(json_t *now, const json_t *before, uint32_t more)
{
    static const char key[] = "workers_rss_bytes", targets_key[] = "target_bytes";
    const json_int_t all = json_integer_value(json_object_get(now, key)) -
                           json_integer_value(json_object_get(before, key)),
                     targets = json_integer_value(json_object_get(now, targets_key)) -
                               json_integer_value(json_object_get(before, targets_key));
    const json_int_t each = all / (json_int_t)more, own = targets / (json_int_t)more;
    json_object_set_new(now, "bytes_per_viewer", json_integer(each));
    json_object_set_new(now, "target_bytes_per_viewer", json_integer(own));
    json_object_set_new(now, "other_bytes_per_viewer", json_integer(each - own));
}

static enum hg_status measure_counts(struct many *m, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    const json_t *before = NULL;
    json_t *list = json_array();
    json_object_set_new(m->report, "viewers", list);
    for (uint32_t i = 0; i < m->count_count && !status; i++) {
        const uint32_t count_before = m->seat_count;
        json_t *one;
        double mean;
        while (m->seat_count < m->counts[i] && !status)
            status = add_seat(m, MOVES, 0, "shared", err);
        if (!status)
            status = measure(m, false, &one, &mean, err);
        if (status)
            break;
        json_object_set_new(one, "count", json_integer(m->counts[i]));
        if (before)
            add_growth(one, before, m->counts[i] - count_before);
        before = one;
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
        status = measure(m, false, &alone, &before, err);
    if (!status)
        status = add_seat(m, kind, 0, "shared", err);
    if (!status)
        status = measure(m, false, &beside, &after, err);
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
        status = measure(m, true, &one, &mean, err);
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
    int width = 320, height = 180, tenants = 8, plain = 0, settles = 0;
    double fps = 30;
    json_t *counts = NULL, *phases = NULL;
    json_error_t wrong;
    m->seconds = 5;
    m->frames = 60;
    m->window_s = 60;
    m->limit_s = 1200;
    m->viewer = (struct hg_viewer_options){.asset = "demo:",
        .poses = 300,
        .poses_per_s = 60,
        .encoding = HGP_encoding_JPEG,
        .timeout_ns = m->wait_ns};
    if (json_unpack_ex((json_t *)options, &wrong, JSON_STRICT,
            "{s?F, s?F, s?F, s?F, s?o, s?o, s?i, s?i, s?i, s?F, s?F, s?s, s?b, s?b}", "seconds",
            &m->seconds, "frames", &m->frames, "window_s", &m->window_s, "limit_s", &m->limit_s,
            "viewers", &counts, "phases", &phases, "tenants", &tenants, "width", &width, "height",
            &height, "poses_per_s", &m->viewer.poses_per_s, "target_fps", &fps, "scene",
            &m->viewer.asset, "plain", &plain, "settle", &settles))
        return hg_error_set(err, HG_E_INVAL, "bench many", "options", "%s", wrong.text);
    if (!(m->seconds > 0 && m->seconds <= 3600) || !(m->limit_s > 0 && m->limit_s <= 1e6) ||
        !(m->window_s > 0 && m->window_s <= 1e6) || !(m->frames >= 0) || tenants < 0 ||
        tenants > 32 || width < 1 || height < 1 || !(fps >= 0 && fps <= 1000) ||
        !(m->viewer.poses_per_s > 0 && m->viewer.poses_per_s <= 1000))
        return hg_error_set(err, HG_E_INVAL, "bench many", "options",
            "seconds is at most 3600, window_s and limit_s 1000000, tenants 0 to 32, a rate 1000");
    m->tenants = (uint32_t)tenants;
    m->viewer.width = (uint32_t)width;
    m->viewer.height = (uint32_t)height;
    m->viewer.target_fps = (float)fps;
    m->viewer.plain = plain;
    m->settles = settles;
    m->window_s = m->window_s > m->seconds ? m->window_s : m->seconds;
    m->end_ns = hg_clock_now_ns() + (uint64_t)(m->limit_s * 1e9);
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

static enum hg_status measure_phase(struct many *m, uint32_t phase, struct hg_error *err)
{
    switch (phase) {
    case VIEWERS:
        return measure_counts(m, err);
    case STUCK_ONE:
        return measure_beside(m, STUCK, "stuck", err);
    case HIDDEN_ONE:
        return measure_beside(m, HIDDEN, "hidden", err);
    case FILM_ONE:
        return measure_beside(m, FILM, "film", err);
    default:
        return m->tenants ? measure_tenants(m, err) : HG_OK;
    }
}

// What was measured when time runs out is worth keeping: the report says where that was.
static enum hg_status run(struct many *m, struct hg_error *err)
{
    enum hg_status status = start_daemon(m, err);
    for (uint32_t i = 0; i < sizeof phase_names / sizeof *phase_names && !status; i++) {
        m->phase = phase_names[i];
        if (m->phases >> i & 1)
            status = measure_phase(m, 1u << i, err);
    }
    json_object_set_new(m->report, "unfinished", json_null());
    if (status != HG_E_TIMEOUT || !is_over(m) || m->measured == 0)
        return status;
    hg_cli_progress_say(&m->cli->progress, "%s: not through within %g s", m->doing, m->limit_s);
    json_object_set_new(m->report, "unfinished", json_string(m->doing));
    return HG_OK;
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
