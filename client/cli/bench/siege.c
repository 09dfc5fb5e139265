// siege.c - the daemon of a siege, its phases and its report. See siege.h.
#include "client/cli/bench/siege.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/bench/bench_common.h"

enum { WAIT_NS = 10000000, HONEST_SIDE = 64, FIRST_ROUNDS = 3, TURNS_MAX = 100 };
#define START_NS 60000000000u
// Of the honest client: its frames begin in equal intervals, so that it wants as many beside
// attackers, which are granted less than those that behave; and what is between its pings.
#define FRAMES_NS 40000000u
#define PINGS_NS  500000u
static const char tokens[] = "honest-token-1 edit honest\nother-token-1 edit other\n";

// Of the honest client beside others that behave, those of even and of odd turns, or attack; of a
// class with equal rates also as often as they can.
enum beside { BEHAVED, BEHAVED_TOO, ATTACKED, UNPACED, BESIDE };

struct siege {
    struct hg_cli *cli;
    double seconds;
    uint32_t clients, viewers, side, rate, turns;
    const char *isolation, *only;
    struct hg_bench_daemon daemon;
    struct hg_siege_client client[HG_SIEGE_CLIENTS + 2];
    struct hg_siege_times frames[BESIDE], pings[BESIDE];
    uint64_t rounds[BESIDE];   // of the others
    uint64_t watched_ns;       // the newest phase
    double seconds_of[BESIDE]; // in which those rounds were made
    json_t *report;
};

// ---- phases -------------------------------------------------------------------------------------

static enum hg_status start_daemon(struct siege *s, struct hg_error *err)
{
    const char *more[] = {"--isolation", s->isolation, "--max-sessions-per-token", "128", NULL};
    return hg_bench_daemon_start(
        &s->daemon, tokens, "honest-token-1", s->cli->options->cache_dir, more, err);
}

// A daemon makes logins wait that come from where tokens were guessed: who behaves after an attack
// with wrong tokens would be measured with that.
static enum hg_status restart_daemon(struct siege *s, struct hg_error *err)
{
    hg_bench_daemon_stop(&s->daemon);
    return start_daemon(s, err);
}

static struct hg_siege_client *add_client(struct siege *s, uint32_t *count, const char *token)
{
    struct hg_siege_client *c = &s->client[(*count)++];
    *c = (struct hg_siege_client){.url = s->daemon.url, .views = 1, .side = HONEST_SIDE};
    snprintf(c->token, sizeof c->token, "%s", token);
    return c;
}

static enum hg_status start_clients(struct siege *s, uint32_t count, uint32_t *started)
{
    for (*started = 0; *started < count; ++*started) {
        enum hg_status status = hg_siege_client_start(&s->client[*started]);
        if (status)
            return status;
    }
    return HG_OK;
}

// Until each has had its first rounds, or they have had their time.
static void await_rounds(const struct siege *s, uint32_t count)
{
    const uint64_t until_ns = hg_clock_now_ns() + START_NS;
    for (uint32_t i = 0; i < count && hg_clock_now_ns() < until_ns && !hg_cli_is_stopped();)
        if (atomic_load(&s->client[i].rounds) >= FIRST_ROUNDS)
            i++;
        else
            hg_clock_sleep_ns(WAIT_NS);
}

static void watch(struct siege *s)
{
    const uint64_t begin_ns = hg_clock_now_ns(), end_ns = begin_ns + (uint64_t)(s->seconds * 1e9);
    while (hg_clock_now_ns() < end_ns && !hg_cli_is_stopped())
        hg_clock_sleep_ns(WAIT_NS);
    s->watched_ns = hg_clock_now_ns() - begin_ns;
}

static enum hg_status run_phase(struct siege *s, uint32_t count, struct hg_error *err)
{
    uint32_t started;
    enum hg_status status = start_clients(s, count, &started);
    if (!status) {
        await_rounds(s, count);
        for (uint32_t i = 0; i < count; i++) {
            atomic_store(&s->client[i].rounds, 0);
            atomic_store(&s->client[i].measured, true);
        }
        watch(s);
    }
    for (uint32_t i = 0; i < started; i++)
        atomic_store(&s->client[i].stop, true);
    for (uint32_t i = 0; i < started; i++)
        hg_siege_client_stop(&s->client[i]);
    if (status)
        return hg_error_set(err, status, "siege", NULL, "no thread for a client");
    if (hg_cli_is_stopped())
        return hg_error_set(err, HG_E_CANCELLED, "siege", NULL, "interrupted");
    return HG_OK;
}

static double rounds_per_s(const struct siege *s, enum beside beside)
{
    return s->seconds_of[beside] > 0 ? (double)s->rounds[beside] / s->seconds_of[beside] : 0;
}

// As often as those that behave have come so far, all clients together.
static uint64_t equal_interval_ns(const struct siege *s)
{
    const double seconds = s->seconds_of[BEHAVED] + s->seconds_of[BEHAVED_TOO];
    const double rounds = (double)(s->rounds[BEHAVED] + s->rounds[BEHAVED_TOO]);
    return rounds > 0 ? (uint64_t)(seconds * s->clients / rounds * 1e9) : 0;
}

static void add_others(
    struct siege *s, uint32_t *count, enum beside beside, const struct hg_siege_class *class)
{
    for (uint32_t i = 0; i < s->clients; i++) {
        struct hg_siege_client *c = add_client(s, count, "other-token-1");
        c->round = beside == ATTACKED || beside == UNPACED ? class->attack : class->behave;
        c->views = 8;
        c->side = s->side;
        c->rate = s->rate;
        c->interval_ns = beside == ATTACKED && class->equal_rate ? equal_interval_ns(s) : 0;
    }
}

// The honest client beside clients of one class.
static enum hg_status measure(
    struct siege *s, enum beside beside, const struct hg_siege_class *class, struct hg_error *err)
{
    uint32_t count = 0;
    enum hg_status status = class->own_daemons ? restart_daemon(s, err) : HG_OK;
    if (status)
        return status;
    struct hg_siege_client *frames = add_client(s, &count, "honest-token-1");
    frames->round = hg_siege_frame;
    frames->interval_ns = FRAMES_NS;
    frames->times = &s->frames[beside];
    struct hg_siege_client *pings = add_client(s, &count, "honest-token-1");
    pings->round = hg_siege_ping;
    pings->pause_ns = PINGS_NS;
    pings->times = &s->pings[beside];
    add_others(s, &count, beside, class);
    status = run_phase(s, count, err);
    if (status)
        return status;
    if (frames->failures || pings->failures)
        return hg_error_set(err, HG_E_WORKER, "siege", "the honest client", "%s: %s",
            frames->failures ? frames->err.what : pings->err.what,
            frames->failures ? frames->err.reason : pings->err.reason);
    for (uint32_t i = 2; i < count; i++)
        s->rounds[beside] += atomic_load(&s->client[i].rounds);
    s->seconds_of[beside] += (double)s->watched_ns * 1e-9;
    return HG_OK;
}

// Turn about, so that what the machine does meanwhile is in all of them. The first turn begins with
// those that behave, whose rate is known from then on.
static enum hg_status measure_turns(
    struct siege *s, const struct hg_siege_class *class, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (int i = 0; i < BESIDE; i++) {
        s->rounds[i] = s->frames[i].count = s->pings[i].count = 0;
        s->seconds_of[i] = 0;
    }
    for (uint32_t i = 0; i < s->turns && !status; i++) {
        const enum beside order[] = {i % 2 ? BEHAVED_TOO : BEHAVED, ATTACKED, UNPACED};
        const uint32_t count = class->equal_rate ? 3 : 2;
        for (uint32_t k = 0; k < count && !status; k++)
            status = measure(s, order[i % 2 ? count - 1 - k : k], class, err);
    }
    return status;
}

// ---- numbers ------------------------------------------------------------------------------------

static int compare_ns(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static double percentile_ms(const struct hg_siege_times *t, uint32_t percent)
{
    return t->count ? (double)t->ns[(uint64_t)(t->count - 1) * percent / 100] * 1e-6 : 0.0;
}

static double ratio_of(
    const struct hg_siege_times *over, const struct hg_siege_times *under, uint32_t percent)
{
    const double b = percentile_ms(under, percent);
    return b > 0 ? percentile_ms(over, percent) / b : 0;
}

// How far two halves of the same are from each other: smaller differences mean nothing.
static double noise_of(const struct hg_siege_times times[BESIDE])
{
    const double ratio = ratio_of(&times[BEHAVED_TOO], &times[BEHAVED], 99);
    return ratio > 0 && ratio < 1 ? 1 / ratio : ratio;
}

static void sort(struct hg_siege_times *t)
{
    qsort(t->ns, t->count, sizeof *t->ns, compare_ns);
}

// All that were beside clients that behave, in BEHAVED.
static void join_turns(struct hg_siege_times times[BESIDE])
{
    struct hg_siege_times *all = &times[BEHAVED], *more = &times[BEHAVED_TOO];
    const uint32_t room = HG_SIEGE_SAMPLES - all->count,
                   count = more->count < room ? more->count : room;
    memcpy(all->ns + all->count, more->ns, count * sizeof *all->ns);
    all->count += count;
    sort(all);
}

static json_t *times_json(const struct hg_siege_times *t)
{
    return json_pack("{s:f, s:f, s:f, s:i}", "p50", percentile_ms(t, 50), "p99",
        percentile_ms(t, 99), "max", percentile_ms(t, 100), "count", (int)t->count);
}

static json_t *beside_json(const struct siege *s, enum beside beside)
{
    return json_pack("{s:o, s:o, s:I, s:f}", "frame_ms", times_json(&s->frames[beside]), "ping_ms",
        times_json(&s->pings[beside]), "rounds", (json_int_t)s->rounds[beside], "rounds_per_s",
        rounds_per_s(s, beside));
}

static json_t *ratio_json(const struct siege *s, enum beside beside)
{
    const struct hg_siege_times *f = s->frames, *p = s->pings;
    return json_pack("{s:f, s:f, s:f, s:f}", "frame_p50", ratio_of(&f[beside], &f[BEHAVED], 50),
        "frame_p99", ratio_of(&f[beside], &f[BEHAVED], 99), "ping_p50",
        ratio_of(&p[beside], &p[BEHAVED], 50), "ping_p99", ratio_of(&p[beside], &p[BEHAVED], 99));
}

static enum hg_status measure_class(
    struct siege *s, const struct hg_siege_class *class, struct hg_error *err)
{
    enum hg_status status = measure_turns(s, class, err);
    if (status)
        return status;
    for (int i = 0; i < BESIDE; i++) {
        sort(&s->frames[i]);
        sort(&s->pings[i]);
    }
    json_t *noise =
        json_pack("{s:f, s:f}", "frame_p99", noise_of(s->frames), "ping_p99", noise_of(s->pings));
    join_turns(s->frames);
    join_turns(s->pings);
    s->rounds[BEHAVED] += s->rounds[BEHAVED_TOO];
    s->seconds_of[BEHAVED] += s->seconds_of[BEHAVED_TOO];
    json_t *report = json_pack("{s:s, s:o, s:o, s:o, s:o}", "name", class->name, "behaved",
        beside_json(s, BEHAVED), "attacked", beside_json(s, ATTACKED), "ratio",
        ratio_json(s, ATTACKED), "noise", noise);
    if (class->equal_rate) {
        json_object_set_new(report, "unpaced", beside_json(s, UNPACED));
        json_object_set_new(report, "unpaced_ratio", ratio_json(s, UNPACED));
    }
    json_array_append_new(json_object_get(s->report, "classes"), report);
    return HG_OK;
}

// Sessions of one tenant that watch equal views: equal shares.
static enum hg_status measure_viewers(struct siege *s, struct hg_error *err)
{
    uint32_t count = 0;
    uint64_t least = UINT64_MAX, most = 0;
    json_t *frames = json_array();
    while (count < s->viewers)
        add_client(s, &count, "honest-token-1")->round = hg_siege_frame;
    enum hg_status status = run_phase(s, count, err);
    for (uint32_t i = 0; i < count && !status; i++) {
        const uint64_t rounds = atomic_load(&s->client[i].rounds);
        json_array_append_new(frames, json_integer((json_int_t)rounds));
        least = rounds < least ? rounds : least;
        most = rounds > most ? rounds : most;
    }
    json_object_set_new(s->report, "viewers",
        json_pack("{s:o, s:f}", "frames", frames, "least_to_most",
            most ? (double)least / (double)most : 0.0));
    return status;
}

// ---- the benchmark ------------------------------------------------------------------------------

static enum hg_status read_options(struct siege *s, const json_t *options, struct hg_error *err)
{
    int clients = 4, viewers = 8, side = 512, rate = 5000, turns = 2;
    json_error_t wrong;
    s->seconds = 3;
    s->isolation = "tenant";
    if (json_unpack_ex((json_t *)options, &wrong, JSON_STRICT,
            "{s?F, s?i, s?i, s?i, s?i, s?i, s?s, s?s}", "seconds", &s->seconds, "clients", &clients,
            "viewers", &viewers, "side", &side, "rate", &rate, "turns", &turns, "isolation",
            &s->isolation, "only", &s->only))
        return hg_error_set(err, HG_E_INVAL, "bench siege", "options", "%s", wrong.text);
    if (clients < 1 || clients > HG_SIEGE_CLIENTS || viewers < 1 || viewers > HG_SIEGE_CLIENTS ||
        side < 1 || side > 4096 || rate < 1 || turns < 1 || turns > TURNS_MAX ||
        !(s->seconds > 0 && s->seconds <= 3600))
        return hg_error_set(err, HG_E_INVAL, "bench siege", "options",
            "clients and viewers are 1 to %d, side 1 to 4096, turns 1 to %d, seconds at most 3600",
            HG_SIEGE_CLIENTS, TURNS_MAX);
    s->clients = (uint32_t)clients;
    s->viewers = (uint32_t)viewers;
    s->side = (uint32_t)side;
    s->rate = (uint32_t)rate;
    s->turns = (uint32_t)turns;
    return HG_OK;
}

static enum hg_status begin(struct siege *s, struct hg_error *err)
{
    s->report = json_pack("{s:f, s:i, s:i, s:i, s:i, s:s, s:[]}", "seconds", s->seconds, "turns",
        (int)s->turns, "clients", (int)s->clients, "side", (int)s->side, "rate", (int)s->rate,
        "isolation", s->isolation, "classes");
    return s->report ? start_daemon(s, err)
                     : hg_error_set(err, HG_E_NOMEM, "bench siege", NULL, "no memory");
}

static enum hg_status run(struct siege *s, struct hg_error *err)
{
    enum hg_status status = begin(s, err);
    for (uint32_t i = 0; i < hg_siege_class_count && !status; i++) {
        hg_cli_progress_update(&s->cli->progress, "classes", i, hg_siege_class_count);
        if (!s->only || strcmp(s->only, hg_siege_classes[i].name) == 0)
            status = measure_class(s, &hg_siege_classes[i], err);
    }
    if (!status && (!s->only || strcmp(s->only, "viewers") == 0))
        status = measure_viewers(s, err);
    return status;
}

enum hg_status hg_cli_siege(
    struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err)
{
    struct siege *s = hg_calloc(1, sizeof *s);
    *report = NULL;
    if (!s)
        return hg_error_set(err, HG_E_NOMEM, "bench siege", NULL, "no memory");
    s->cli = cli;
    enum hg_status status = read_options(s, options, err);
    if (!status)
        status = run(s, err);
    hg_bench_daemon_stop(&s->daemon);
    char *text = status ? NULL : json_dumps(s->report, JSON_REAL_PRECISION(6));
    if (text)
        *report = hg_strdup(text);
    if (!status && !*report)
        status = hg_error_set(err, HG_E_NOMEM, "bench siege", NULL, "no memory");
    free(text);
    json_decref(s->report);
    hg_free(s);
    return status;
}
