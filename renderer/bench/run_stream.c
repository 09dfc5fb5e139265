// run_stream.c - `vt`, `lod` and `points`: their options (docs/client.md) and the files that they
// name.
#include <string.h>

#include "base/alloc.h"
#include "renderer/bench/run.h"

enum { MAX_IMAGES = 64, MAX_SHEETS = 8 };

// Files of the options, resolved under the asset roots.
struct paths {
    char *items[MAX_IMAGES + 2];
    uint32_t count;
};

static void paths_finish(struct paths *p)
{
    for (uint32_t i = 0; i < p->count; i++)
        hg_free(p->items[i]);
    p->count = 0;
}

// *out: owned by `paths`; NULL without a value.
static enum hg_status read_file(const struct hg_bench_host *host, const json_t *value,
    struct paths *paths, const char **out, struct hg_error *err)
{
    const char *text = json_string_value(value);
    *out = NULL;
    if (!value)
        return HG_OK;
    if (!text)
        return hg_error_set(err, HG_E_INVAL, "bench", "options", "a file's name is not a string");
    enum hg_status status = hg_roots_resolve(&host->roots, text, &paths->items[paths->count], err);
    if (status)
        return status;
    *out = paths->items[paths->count++];
    return HG_OK;
}

// A whole number of the options, and where it goes. Absent leaves *out.
struct count {
    const char *name;
    double high;
    uint32_t *out;
};

static enum hg_status read_counts(
    const json_t *options, const struct count *counts, size_t count, struct hg_error *err)
{
    for (size_t i = 0; i < count; i++) {
        double value = *counts[i].out;
        const struct hg_bench_number number = {counts[i].name, 0, counts[i].high, &value};
        enum hg_status status = hg_bench_read_numbers(options, &number, 1, err);
        if (status)
            return status;
        *counts[i].out = (uint32_t)value;
    }
    return HG_OK;
}

// What both have. `budget_bytes`: of the command line, when the options have none.
static enum hg_status read_stream(const struct hg_bench_host *host, const json_t *options,
    uint64_t budget_bytes, struct hg_bench_stream *out, struct hg_error *err)
{
    double budget_mib = 0;
    const struct hg_bench_number budget = {"budget_mib", 0, 1 << 24, &budget_mib};
    const struct count counts[] = {{"width", 16384, &out->width}, {"height", 16384, &out->height},
        {"frames", 10000, &out->frames}, {"stills", 100, &out->stills},
        {"samples", 4096, &out->samples}};
    enum hg_status status = read_counts(options, counts, sizeof counts / sizeof *counts, err);
    if (status)
        return status;
    status = hg_bench_read_numbers(options, &budget, 1, err);
    if (status)
        return status;
    out->budget_bytes = budget_mib > 0 ? (uint64_t)(budget_mib * 1048576) : budget_bytes;
    out->progress = host->progress;
    out->progress_user = host->progress_user;
    return HG_OK;
}

// The benchmarks make renderers of their own, with the budgets that they measure.
static struct hg_renderer_params without_budgets(const struct hg_bench_host *host)
{
    struct hg_renderer_params params = host->renderer;
    params.texture_budget_bytes = 0;
    params.geometry_budget_bytes = 0;
    return params;
}

// ---- vt -----------------------------------------------------------------------------------------

struct vt {
    struct hg_bench_vt bench;
    struct paths paths;
    const char *images[MAX_IMAGES];
    uint32_t sheets_px[MAX_SHEETS];
};

static enum hg_status read_images(
    const struct hg_bench_host *host, const json_t *list, struct vt *vt, struct hg_error *err)
{
    size_t count = json_array_size(list);
    if (list && (!json_is_array(list) || count > MAX_IMAGES))
        return hg_error_set(
            err, HG_E_INVAL, "bench vt", "images", "not a list of at most %d files", MAX_IMAGES);
    for (size_t i = 0; i < count; i++) {
        enum hg_status status =
            read_file(host, json_array_get(list, i), &vt->paths, &vt->images[i], err);
        if (status)
            return status;
    }
    vt->bench.images = vt->images;
    vt->bench.image_count = (uint32_t)count;
    return HG_OK;
}

static enum hg_status read_sheets(const json_t *list, struct vt *vt, struct hg_error *err)
{
    size_t count = json_array_size(list);
    if (!list)
        return HG_OK;
    if (!json_is_array(list) || count > MAX_SHEETS)
        return hg_error_set(
            err, HG_E_INVAL, "bench vt", "sheets", "not a list of at most %d sides", MAX_SHEETS);
    for (size_t i = 0; i < count; i++) {
        json_int_t side = json_integer_value(json_array_get(list, i));
        if (side < 256 || side > 131072)
            return hg_error_set(
                err, HG_E_INVAL, "bench vt", "sheets", "a side is not 256 to 131072");
        vt->sheets_px[i] = (uint32_t)side;
    }
    vt->bench.sheets_px = vt->sheets_px;
    vt->bench.sheet_count = (uint32_t)count;
    return HG_OK;
}

static enum hg_status read_vt(
    const struct hg_bench_host *host, const json_t *options, struct vt *vt, struct hg_error *err)
{
    struct hg_bench_vt *b = &vt->bench;
    const struct count counts[] = {{"made", 1000, &b->made}, {"side_px", 65536, &b->side_px},
        {"teleports", 10000, &b->teleports}, {"peer_mib", 65536, &b->baseline_mib}};
    enum hg_status status =
        read_stream(host, options, host->renderer.texture_budget_bytes, &b->stream, err);
    if (status)
        return status;
    status = read_counts(options, counts, sizeof counts / sizeof *counts, err);
    if (status)
        return status;
    status = read_images(host, json_object_get(options, "images"), vt, err);
    if (status)
        return status;
    return read_sheets(json_object_get(options, "sheets"), vt, err);
}

enum hg_status hg_bench_run_vt(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    const struct hg_renderer_params params = without_budgets(host);
    struct vt vt = {.bench.stream.renderer = &params};
    *text = NULL;
    enum hg_status status = read_vt(host, options, &vt, err);
    if (!status)
        status = hg_bench_vt_run(&vt.bench, text, err);
    paths_finish(&vt.paths);
    return status;
}

// ---- lod ----------------------------------------------------------------------------------------

static enum hg_status read_lod(const struct hg_bench_host *host, const json_t *options,
    struct hg_bench_lod *lod, struct paths *paths, struct hg_error *err)
{
    const struct count counts[] = {{"cells", 8192, &lod->cells}, {"tiles", 64, &lod->tiles},
        {"statues", 1000000, &lod->statues}};
    enum hg_status status =
        read_stream(host, options, host->renderer.geometry_budget_bytes, &lod->stream, err);
    if (status)
        return status;
    status = read_counts(options, counts, sizeof counts / sizeof *counts, err);
    if (status)
        return status;
    status = read_file(host, json_object_get(options, "heights"), paths, &lod->heights, err);
    if (status)
        return status;
    return read_file(host, json_object_get(options, "statue"), paths, &lod->statue, err);
}

enum hg_status hg_bench_run_lod(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    const struct hg_renderer_params params = without_budgets(host);
    struct hg_bench_lod lod = {.stream.renderer = &params};
    struct paths paths = {0};
    *text = NULL;
    enum hg_status status = read_lod(host, options, &lod, &paths, err);
    if (!status)
        status = hg_bench_lod_run(&lod, text, err);
    paths_finish(&paths);
    return status;
}

// ---- points -------------------------------------------------------------------------------------

enum hg_status hg_bench_run_points(
    const struct hg_bench_host *host, const json_t *options, char **text, struct hg_error *err)
{
    const struct hg_renderer_params params = without_budgets(host);
    struct hg_bench_points points = {.stream.renderer = &params};
    const struct count counts[] = {{"points", 1e9, &points.points}};
    *text = NULL;
    enum hg_status status =
        read_stream(host, options, host->renderer.geometry_budget_bytes, &points.stream, err);
    if (!status)
        status = read_counts(options, counts, 1, err);
    return status ? status : hg_bench_points_run(&points, text, err);
}
