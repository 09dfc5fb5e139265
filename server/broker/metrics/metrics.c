#include "server/broker/metrics/metrics.h"

#include <stdarg.h>
#include <string.h>
#include <unistd.h>

#include "server/broker/metrics/counters.h"
#include "server/broker/metrics/latency.h"
#include "server/broker/storage/upload_store.h"
#include "server/broker/workers/worker_pool.h"

// ---- sums ---------------------------------------------------------------------------------------

static uint32_t count_parked(const struct hg_session_table *t)
{
    uint32_t count = 0;
    for (const struct hg_session *it = t->first; it; it = it->next)
        count += it->resume.parked_ns != 0;
    return count;
}

static uint32_t count_views(const struct hg_session_table *t)
{
    uint32_t count = 0;
    for (const struct hg_session *it = t->first; it; it = it->next)
        for (const struct hg_session_view *view = it->views; view; view = view->next)
            count++;
    return count;
}

static uint64_t count_requests(const struct hg_session_table *t)
{
    uint64_t count = 0;
    for (const struct hg_session *it = t->first; it; it = it->next)
        count += it->load.count;
    return count;
}

static uint32_t count_scenes(const struct hg_session_table *t)
{
    uint32_t count = 0;
    for (const struct hg_shared_scene *it = t->scenes.first; it; it = it->next)
        count++;
    return count;
}

static uint64_t sum_output(const struct hg_session_table *t)
{
    uint64_t bytes = 0;
    for (const struct hg_conn *it = t->conns->first; it; it = it->next)
        bytes += it->out.bytes;
    return bytes;
}

static uint32_t count_workers(const struct hg_session_table *t, bool up)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < t->pool->count; i++)
        count += t->pool->links[i].whose.wanted && (!up || t->pool->links[i].state == HG_LINK_UP);
    return count;
}

static uint64_t sum_worker_memory(const struct hg_session_table *t)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < t->pool->count; i++)
        bytes += t->pool->links[i].whose.wanted ? t->pool->links[i].rss_bytes : 0;
    return bytes;
}

static double drain_left_s(const struct hg_session_table *t)
{
    const uint64_t now_ns = t->loop->now_ns, due_ns = t->drain.due_ns;
    return due_ns > now_ns ? (double)(due_ns - now_ns) * 1e-9 : 0;
}

static uint64_t own_memory_bytes(void)
{
    unsigned long long total, resident = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    if (!file)
        return 0;
    if (fscanf(file, "%llu %llu", &total, &resident) != 2)
        resident = 0;
    fclose(file);
    return resident * (uint64_t)sysconf(_SC_PAGESIZE);
}

// ---- the text -----------------------------------------------------------------------------------

static HG_PRINTF(2, 3) void put(struct hg_writer *w, const char *fmt, ...)
{
    char text[600];
    va_list args;
    va_start(args, fmt);
    int n = vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    if (n > 0)
        hg_write_bytes(w, text, (size_t)n < sizeof text ? (size_t)n : sizeof text - 1);
}

static void put_head(struct hg_writer *w, const char *name, const char *kind, const char *help)
{
    put(w, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, kind);
}

static const struct {
    const char *metric, *labels, *help;
} counters[] = {
#define HG_COUNTER(id, m, l, h) {.metric = m, .labels = l, .help = h},
#include "server/broker/metrics/counters.def"
};

static void put_counters(struct hg_writer *w)
{
    for (size_t i = 0; i < HG_COUNTERS; i++) {
        if (counters[i].help[0])
            put_head(w, counters[i].metric, "counter", counters[i].help);
        put(w, counters[i].labels[0] ? "%s{%s} %llu\n" : "%s%s %llu\n", counters[i].metric,
            counters[i].labels, (unsigned long long)hg_counters[i]);
    }
}

static const char errors_name[] = "heliod_request_errors_total";
static const char errors_help[] =
    "Requests of open sessions that were answered with an error, of the daemon or of a worker.";

static void put_errors(struct hg_writer *w)
{
    put_head(w, errors_name, "counter", errors_help);
#define HG_STATUS(sym, value, name, text)                                                          \
    if (value)                                                                                     \
        put(w, "%s{status=\"%s\"} %llu\n", errors_name, name, (unsigned long long)hg_errors[value]);
#include "base/status.def"
#undef HG_STATUS
}

static const char latency_name[] = "heliod_input_latency_seconds";
static const char latency_help[] =
    "From an input, the camera of a subscribed view, to the first frame that shows it.";

static void put_latencies(struct hg_writer *w)
{
    put_head(w, latency_name, "histogram", latency_help);
    for (int i = 0; i < HG_LATENCY_STAGES; i++) {
        const struct hg_latency *l = &hg_latencies[i];
        const char *stage = hg_latency_stage_names[i];
        uint64_t below = 0;
        for (int k = 0; k < HG_LATENCY_BUCKETS - 1; k++) {
            below += l->counts[k];
            put(w, "%s_bucket{stage=\"%s\",le=\"%g\"} %llu\n", latency_name, stage,
                hg_latency_bounds_s[k], (unsigned long long)below);
        }
        put(w, "%s_bucket{stage=\"%s\",le=\"+Inf\"} %llu\n", latency_name, stage,
            (unsigned long long)l->count);
        put(w, "%s_sum{stage=\"%s\"} %.9g\n%s_count{stage=\"%s\"} %llu\n", latency_name, stage,
            (double)l->sum_ns * 1e-9, latency_name, stage, (unsigned long long)l->count);
    }
}

void hg_metrics_write(const struct hg_session_table *t, struct hg_writer *w)
{
    put_head(w, "heliod_build_info", "gauge", "The version of the daemon.");
    put(w, "heliod_build_info{version=\"%s\"} 1\n", HELIO_VERSION);
#define HG_METRIC(name, kind, value, help)                                                         \
    put_head(w, name, kind, help);                                                                 \
    put(w, name " %.16g\n", (double)(value));
#include "server/broker/metrics/metrics.def"
    put_counters(w);
    put_errors(w);
    put_latencies(w);
}

const char *hg_metrics_unready(const struct hg_session_table *t)
{
    if (t->draining)
        return "the daemon is shutting down\n";
    if (t->conns->quiet)
        return "a new program is taking over\n";
    if (t->drain.over)
        return "the daemon is closed to all but administrators (drain_set)\n";
    if (t->drain.due_ns)
        return "the daemon is draining: it takes no new sessions (drain_set)\n";
    return count_workers(t, true) ? NULL : "no worker is ready\n";
}

// ---- documentation ------------------------------------------------------------------------------

void hg_metrics_print_docs(FILE *file)
{
    fputs(
        "# Metrics\n\nWhat `/metrics` of heliod says, in the text format of Prometheus. Made from "
        "`server/broker/metrics/metrics.def` and\n`server/broker/metrics/counters.def` by `heliod "
        "--print-docs metrics`.\n\n| metric | kind | meaning |\n|---|---|---|\n"
        "| `heliod_build_info` | gauge | The version of the daemon, as a label. |\n",
        file);
#define HG_METRIC(name, kind, value, help) fprintf(file, "| `%s` | %s | %s |\n", name, kind, help);
#include "server/broker/metrics/metrics.def"
    for (size_t i = 0; i < HG_COUNTERS; i++) {
        const char *quote = strchr(counters[i].labels, '"');
        if (counters[i].help[0])
            fprintf(file, "| `%s` | counter | %s", counters[i].metric, counters[i].help);
        if (quote)
            fprintf(file, "%s`%.*s`", counters[i].help[0] ? " Label " : ", ",
                (int)(counters[i].help[0] ? strlen(counters[i].labels) : strlen(quote)),
                counters[i].help[0] ? counters[i].labels : quote);
        if (i + 1 == HG_COUNTERS || counters[i + 1].help[0])
            fputs(" |\n", file);
    }
    fprintf(file,
        "| `%s` | counter | %s Label `status`: the names of the protocol's codes, such as `limit`, "
        "`not-found`, `device`. |\n",
        errors_name, errors_help);
    fprintf(file,
        "| `%s` | histogram | %s Label `stage`: `input` (broker to worker), `wait` (until it is "
        "the "
        "view's turn), `render`, `read` (pixels, and until an encoder has time), `encode`, "
        "`output` "
        "(worker to what the client is to be sent), `all` of these together. Buckets",
        latency_name, latency_help);
    for (int k = 0; k < HG_LATENCY_BUCKETS - 1; k++)
        fprintf(file, " %g", hg_latency_bounds_s[k]);
    fputs(" |\n", file);
}
