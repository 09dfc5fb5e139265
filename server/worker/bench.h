// bench.h - what the benchmarks of a private worker share.
// Floor 6, private to server/worker. Render thread.
#ifndef HG_SERVER_WORKER_BENCH_H
#define HG_SERVER_WORKER_BENCH_H

#include <jansson.h>

#include "server/worker/request.h"

struct bench {
    const struct request *r;
    const char *scene_name, *environment; // realtime; borrowed from the options
    struct hg_bench_realtime run;
    struct hg_bench_pose *poses;
    struct hg_scene *scene;
    double load_ms;
    uint64_t progress_sent_ns;
};

void hg_handle_bench(const struct request *r);

// A number of the options in low .. high; absent leaves *value. HG_E_INVAL names the option.
enum hg_status bench_number(const json_t *options, const char *name, double low, double high,
    double *value, struct hg_error *err) HG_MUST_CHECK;
// Tells the client; false when the worker is to end. user: struct bench.
bool bench_progress(void *user, uint32_t done, uint32_t total);

// bench_stream.c. *text: one JSON object, freed with hg_free.
enum hg_status bench_vt(
    struct bench *b, const json_t *options, char **text, struct hg_error *err) HG_MUST_CHECK;
enum hg_status bench_lod(
    struct bench *b, const json_t *options, char **text, struct hg_error *err) HG_MUST_CHECK;

#endif
