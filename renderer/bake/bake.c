#include "renderer/bake/bake.h"

#include <limits.h>
#include <stdio.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bake/internal.h"

bool hg_bake_tell(const struct hg_bake *bake, const char *stage, uint64_t done, uint64_t total)
{
    return bake->progress == NULL || bake->progress(bake->progress_user, stage, done, total);
}

enum hg_status hg_bake_note(
    struct hg_bake_entries *entries, const struct hg_store_key *key, struct hg_error *err)
{
    if (hg_grow(&entries->keys, &entries->capacity, entries->count + 1, sizeof *entries->keys))
        return hg_error_set(err, HG_E_NOMEM, "bake", NULL, "no memory for the list of entries");
    entries->keys[entries->count++] = *key;
    return HG_OK;
}

// Those that were evicted for others: the limit is too small, or the disk is full.
static size_t count_absent(struct hg_store *store, const struct hg_bake_entries *entries)
{
    size_t absent = 0;
    for (size_t i = 0; i < entries->count; i++)
        absent += !hg_store_has(store, &entries->keys[i]);
    return absent;
}

static void put_store(struct hg_writer *w, struct hg_store *store,
    const struct hg_bake_entries *entries, uint64_t start_ns)
{
    struct hg_store_stats s;
    hg_store_stats(store, &s);
    hg_json_put(w,
        "\"cache\":{\"bytes\":%llu,\"limit_bytes\":%llu,\"written\":%llu,\"damaged\":%llu,"
        "\"evicted\":%llu,\"written_bytes\":%llu,\"absent\":%zu},\"ms\":%.3f}",
        (unsigned long long)s.bytes, (unsigned long long)s.limit_bytes,
        (unsigned long long)s.written, (unsigned long long)s.damaged, (unsigned long long)s.evicted,
        (unsigned long long)s.bytes_written, count_absent(store, entries),
        (double)(hg_clock_now_ns() - start_ns) * 1e-6);
}

enum hg_status hg_bake_run(const struct hg_bake *bake, char **text, struct hg_error *err)
{
    char dir[PATH_MAX];
    struct hg_store *store = NULL;
    struct hg_bake_entries entries = {0};
    struct hg_writer w = {0};
    const uint64_t start = hg_clock_now_ns();
    *text = NULL;
    if (snprintf(dir, sizeof dir, "%s/store", bake->cache_dir) >= (int)sizeof dir)
        return hg_error_set(err, HG_E_INVAL, "bake", "cache_dir", "the name is too long");
    const struct hg_store_params params = {.dir = dir, .limit_bytes = bake->cache_limit_bytes};
    enum hg_status status = hg_store_open(&params, &store, err);
    hg_json_put(&w, "{");
    if (status == HG_OK && !bake->no_textures) {
        status = hg_bake_textures(bake, store, &entries, &w, err);
        hg_json_put(&w, ",");
    }
    if (status == HG_OK && !bake->no_geometry) {
        status = hg_bake_geometry(bake, store, &entries, &w, err);
        hg_json_put(&w, ",");
    }
    if (status == HG_OK)
        put_store(&w, store, &entries, start);
    hg_store_close(store);
    hg_free(entries.keys);
    if (status == HG_OK)
        return hg_json_take(&w, text);
    hg_writer_finish(&w);
    return status;
}
