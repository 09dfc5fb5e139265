// run.c - the table of benchmarks, and numbers of their options.
#include "renderer/bench/run.h"

#include <stdio.h>
#include <string.h>

enum hg_status hg_bench_read_numbers(const json_t *options, const struct hg_bench_number *numbers,
    size_t count, struct hg_error *err)
{
    for (size_t i = 0; i < count; i++) {
        const struct hg_bench_number *number = &numbers[i];
        const json_t *item = json_object_get(options, number->name);
        if (!item)
            continue;
        *number->value = json_number_value(item);
        if (!json_is_number(item) || !(*number->value >= number->low) ||
            !(*number->value <= number->high))
            return hg_error_set(err, HG_E_INVAL, "bench", number->name, "not a number in range");
    }
    return HG_OK;
}

static enum hg_status run_realtime(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_realtime_run, text, err);
}

static enum hg_status run_temporal(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_temporal_run, text, err);
}

static enum hg_status run_gi(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_gi_run, text, err);
}

static enum hg_status run_reflections(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_reflections_run, text, err);
}

static enum hg_status run_flight(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_flight_run, text, err);
}

static enum hg_status run_trace(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_trace_run, text, err);
}

static enum hg_status run_path(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    return hg_bench_run_scene(host, options, hg_bench_path_run, text, err);
}

static const struct {
    const char *name;
    enum hg_status (*run)(const struct hg_bench_host *, const json_t *, char **, struct hg_error *);
} benchmarks[] = {{"realtime", run_realtime}, {"temporal", run_temporal}, {"gi", run_gi},
    {"reflections", run_reflections}, {"flight", run_flight}, {"vt", hg_bench_run_vt},
    {"lod", hg_bench_run_lod}, {"points", hg_bench_run_points}, {"trace", run_trace},
    {"path", run_path}};

enum hg_status hg_bench_run(const struct hg_bench_host *host, const char *name,
    const json_t *options, char **text, struct hg_error *err)
{
    *text = NULL;
    for (size_t i = 0; i < sizeof benchmarks / sizeof *benchmarks; i++)
        if (strcmp(benchmarks[i].name, name) == 0)
            return benchmarks[i].run(host, options, text, err);
    char known[256] = "";
    for (size_t i = 0, at = 0; i < sizeof benchmarks / sizeof *benchmarks; i++)
        at += (size_t)snprintf(
            known + at, sizeof known - at, "%s%s", i > 0 ? ", " : "", benchmarks[i].name);
    return hg_error_set(
        err, HG_E_UNSUPPORTED, "bench", "name", "no benchmark '%s'; there are %s", name, known);
}
