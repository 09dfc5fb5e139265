// run.h - benchmarks by name: options as JSON to parameters, scenes, renderers and reports.
// Private to renderer/bench. One thread.
#ifndef HG_RENDERER_BENCH_RUN_H
#define HG_RENDERER_BENCH_RUN_H

#include <jansson.h>

#include "base/roots.h"
#include "renderer/bench/bench.h"

// What the program was started with.
struct hg_bench_host {
    struct hg_renderer_params renderer;
    struct hg_roots roots; // files that options name lie under these
    bool (*progress)(void *user, uint32_t done, uint32_t total); // false cancels
    void *progress_user;
};

// options: one JSON object, docs/client.md. *text is freed with hg_free. HG_E_UNSUPPORTED: no
// benchmark of that name; HG_E_INVAL names the option; HG_E_NOTFOUND, HG_E_PERM, HG_E_FORMAT of
// files; HG_E_CANCELLED; errors of the renderer.
enum hg_status hg_bench_run(const struct hg_bench_host *host, const char *name,
    const json_t *options, char **text, struct hg_error *err) HG_MUST_CHECK;

// --- between the files of run_*.c ----------------------------------------------------------------

// A number of the options. Absent leaves *value.
struct hg_bench_number {
    const char *name;
    double low, high;
    double *value;
};
// HG_E_INVAL names the first that is no number in low .. high.
enum hg_status hg_bench_read_numbers(const json_t *options, const struct hg_bench_number *numbers,
    size_t count, struct hg_error *err) HG_MUST_CHECK;

typedef enum hg_status hg_bench_scene_fn(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err);

// realtime, trace, path: a renderer and a loaded scene, and the report with what was loaded.
enum hg_status hg_bench_run_scene(const struct hg_bench_host *host, const json_t *options,
    hg_bench_scene_fn *run, char **text, struct hg_error *err) HG_MUST_CHECK;
// run_stream.c
enum hg_status hg_bench_run_vt(const struct hg_bench_host *host, const json_t *options, char **text,
    struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_bench_run_lod(const struct hg_bench_host *host, const json_t *options,
    char **text, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_bench_run_points(const struct hg_bench_host *host, const json_t *options,
    char **text, struct hg_error *err) HG_MUST_CHECK;

#endif
