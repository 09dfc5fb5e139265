#include "renderer/bake/bake.h"

#include <limits.h>
#include <stdio.h>

#include "base/clock.h"
#include "base/json.h"
#include "renderer/bake/internal.h"

bool hg_bake_tell(const struct hg_bake *bake, const char *stage, uint64_t done, uint64_t total)
{
    return bake->progress == NULL || bake->progress(bake->progress_user, stage, done, total);
}

static void put_store(struct hg_writer *w, struct hg_store *store, uint64_t start_ns)
{
    struct hg_store_stats s;
    hg_store_stats(store, &s);
    hg_json_put(w,
        "\"cache\":{\"bytes\":%llu,\"limit_bytes\":%llu,\"written\":%llu,\"damaged\":%llu,"
        "\"evicted\":%llu,\"written_bytes\":%llu},\"ms\":%.3f}",
        (unsigned long long)s.bytes, (unsigned long long)s.limit_bytes,
        (unsigned long long)s.written, (unsigned long long)s.damaged, (unsigned long long)s.evicted,
        (unsigned long long)s.bytes_written, (double)(hg_clock_now_ns() - start_ns) * 1e-6);
}

enum hg_status hg_bake_run(const struct hg_bake *bake, char **text, struct hg_error *err)
{
    char dir[PATH_MAX];
    struct hg_store *store = NULL;
    struct hg_writer w = {0};
    const uint64_t start = hg_clock_now_ns();
    *text = NULL;
    if (snprintf(dir, sizeof dir, "%s/store", bake->cache_dir) >= (int)sizeof dir)
        return hg_error_set(err, HG_E_INVAL, "bake", "cache_dir", "the name is too long");
    const struct hg_store_params params = {.dir = dir, .limit_bytes = bake->cache_limit_bytes};
    enum hg_status status = hg_store_open(&params, &store, err);
    hg_json_put(&w, "{");
    if (status == HG_OK && !bake->no_textures) {
        status = hg_bake_textures(bake, store, &w, err);
        hg_json_put(&w, ",");
    }
    if (status == HG_OK && !bake->no_geometry) {
        status = hg_bake_geometry(bake, store, &w, err);
        hg_json_put(&w, ",");
    }
    if (status == HG_OK)
        put_store(&w, store, start);
    hg_store_close(store);
    if (status == HG_OK)
        return hg_json_take(&w, text);
    hg_writer_finish(&w);
    return status;
}
