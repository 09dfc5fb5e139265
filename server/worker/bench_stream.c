// bench_stream.c - options of `helio bench vt` and `helio bench lod`, and their runs.
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/worker/asset_path.h"
#include "server/worker/bench.h"

enum { MAX_IMAGES = 64, MAX_SHEETS = 8 };

// Paths of the options, resolved under the asset roots.
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

static enum hg_status take_path(const struct bench *b, const json_t *value, struct paths *paths,
    const char **out, struct hg_error *err)
{
    const char *text = json_string_value(value);
    *out = NULL;
    if (!value)
        return HG_OK;
    if (!text)
        return hg_error_set(err, HG_E_INVAL, "bench", "options", "a file's name is not a string");
    enum hg_status status = hg_asset_path_resolve(
        &b->r->s->w->options, hgp_str_make(text), &paths->items[paths->count], err);
    if (!status)
        *out = paths->items[paths->count++];
    return status;
}

// A whole number of the options; absent leaves *out.
static enum hg_status take_u32(
    const json_t *options, const char *name, double high, uint32_t *out, struct hg_error *err)
{
    double value = *out;
    enum hg_status status = bench_number(options, name, 0, high, &value, err);
    *out = (uint32_t)value;
    return status;
}

static enum hg_status take_stream(
    struct bench *b, const json_t *options, struct hg_bench_stream *out, struct hg_error *err)
{
    double budget_mib = 0;
    enum hg_status st = take_u32(options, "width", 16384, &out->width, err);
    st = st ? st : take_u32(options, "height", 16384, &out->height, err);
    st = st ? st : take_u32(options, "frames", 10000, &out->frames, err);
    st = st ? st : take_u32(options, "stills", 100, &out->stills, err);
    st = st ? st : take_u32(options, "samples", 4096, &out->samples, err);
    st = st ? st : bench_number(options, "budget_mib", 0, 1 << 24, &budget_mib, err);
    out->budget_bytes = (uint64_t)(budget_mib * 1048576);
    out->progress = bench_progress;
    out->progress_user = b;
    return st;
}

static struct hg_renderer_params renderer_params(const struct worker_options *o)
{
    return (struct hg_renderer_params){.device = o->device,
        .cache_dir = o->cache_dir,
        .shader_dir = o->shader_dir,
        .host_budget_bytes = o->host_budget_bytes,
        .cache_limit_bytes = o->cache_limit_bytes,
        .validation = o->validation};
}

// ---- vt -----------------------------------------------------------------------------------------

static enum hg_status take_images(const struct bench *b, const json_t *list, struct paths *paths,
    struct hg_bench_vt *vt, const char **images, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (list && (!json_is_array(list) || json_array_size(list) > MAX_IMAGES))
        return hg_error_set(
            err, HG_E_INVAL, "bench vt", "images", "not a list of at most %d files", MAX_IMAGES);
    for (size_t i = 0; i < json_array_size(list) && !status; i++)
        status = take_path(b, json_array_get(list, i), paths, &images[i], err);
    vt->images = images;
    vt->image_count = (uint32_t)json_array_size(list);
    return status;
}

static enum hg_status take_sheets(
    const json_t *list, struct hg_bench_vt *vt, uint32_t *sheets, struct hg_error *err)
{
    if (!list)
        return HG_OK;
    if (!json_is_array(list) || json_array_size(list) > MAX_SHEETS)
        return hg_error_set(
            err, HG_E_INVAL, "bench vt", "sheets", "not a list of at most %d sides", MAX_SHEETS);
    for (size_t i = 0; i < json_array_size(list); i++) {
        json_int_t side = json_integer_value(json_array_get(list, i));
        if (side < 256 || side > 131072)
            return hg_error_set(
                err, HG_E_INVAL, "bench vt", "sheets", "a side is not 256 to 131072");
        sheets[i] = (uint32_t)side;
    }
    vt->sheets_px = sheets;
    vt->sheet_count = (uint32_t)json_array_size(list);
    return HG_OK;
}

enum hg_status bench_vt(struct bench *b, const json_t *options, char **text, struct hg_error *err)
{
    struct hg_renderer_params params = renderer_params(&b->r->s->w->options);
    struct hg_bench_vt vt = {
        .stream = {.renderer = &params, .budget_bytes = b->r->s->w->options.texture_budget_bytes}};
    struct paths paths = {0};
    const char *images[MAX_IMAGES];
    uint32_t sheets[MAX_SHEETS];
    uint64_t budget = vt.stream.budget_bytes;
    enum hg_status st = take_stream(b, options, &vt.stream, err);
    if (!vt.stream.budget_bytes)
        vt.stream.budget_bytes = budget;
    st = st ? st : take_u32(options, "made", 1000, &vt.made, err);
    st = st ? st : take_u32(options, "side_px", 65536, &vt.side_px, err);
    st = st ? st : take_u32(options, "teleports", 10000, &vt.teleports, err);
    st = st ? st : take_u32(options, "peer_mib", 65536, &vt.baseline_mib, err);
    st = st ? st : take_images(b, json_object_get(options, "images"), &paths, &vt, images, err);
    st = st ? st : take_sheets(json_object_get(options, "sheets"), &vt, sheets, err);
    st = st ? st : hg_bench_vt_run(&vt, text, err);
    paths_finish(&paths);
    return st;
}

// ---- lod ----------------------------------------------------------------------------------------

enum hg_status bench_lod(struct bench *b, const json_t *options, char **text, struct hg_error *err)
{
    struct hg_renderer_params params = renderer_params(&b->r->s->w->options);
    struct hg_bench_lod lod = {.stream = {.renderer = &params}};
    struct paths paths = {0};
    enum hg_status st = take_stream(b, options, &lod.stream, err);
    if (!lod.stream.budget_bytes)
        lod.stream.budget_bytes = b->r->s->w->options.geometry_budget_bytes;
    st = st ? st : take_u32(options, "cells", 8192, &lod.cells, err);
    st = st ? st : take_u32(options, "tiles", 64, &lod.tiles, err);
    st = st ? st : take_u32(options, "statues", 1000000, &lod.statues, err);
    st = st ? st : take_path(b, json_object_get(options, "heights"), &paths, &lod.heights, err);
    st = st ? st : take_path(b, json_object_get(options, "statue"), &paths, &lod.statue, err);
    st = st ? st : hg_bench_lod_run(&lod, text, err);
    paths_finish(&paths);
    return st;
}
