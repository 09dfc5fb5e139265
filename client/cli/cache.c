// cache.c - helio cache: what the cache folder holds, checked or cleared. Needs no worker: entries
// are files that programs share.
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/alloc.h"
#include "client/cli/cli.h"
#include "base/store/store.h"

struct cache {
    char dir[PATH_MAX];
    struct hg_store_info *entries;
    size_t count;
    uint64_t bytes;
    uint32_t damaged, removed;
    uint64_t removed_bytes;
};

// What --cache-dir names is there: an empty answer about a mistyped name would be taken for the
// truth.
static enum hg_status check_given(const char *folder, struct hg_error *err)
{
    struct stat st;
    if (stat(folder, &st) != 0)
        return hg_error_set(err, HG_E_INVAL, "--cache-dir", NULL, "%s: %s", folder,
            errno == ENOENT ? "there is no such folder" : strerror(errno));
    if (!S_ISDIR(st.st_mode))
        return hg_error_set(err, HG_E_INVAL, "--cache-dir", NULL, "%s is no folder", folder);
    return HG_OK;
}

static enum hg_status find_dir(
    const struct hg_cli_options *o, struct cache *cache, struct hg_error *err)
{
    char path[PATH_MAX - 8];
    if (o->verify && o->clear)
        return hg_error_set(err, HG_E_INVAL, "--verify", NULL, "cannot be combined with --clear");
    if (!hg_cli_cache_dir(o->cache_folder, path, sizeof path))
        return hg_error_set(err, HG_E_INVAL, "--cache-dir", NULL,
            "is needed: the environment names no folder for caches");
    snprintf(cache->dir, sizeof cache->dir, "%s/store", path);
    return o->cache_folder ? check_given(o->cache_folder, err) : HG_OK;
}

// A cache that nothing was written to yet is an empty one.
static enum hg_status list(struct cache *cache, struct hg_error *err)
{
    const enum hg_status status = hg_store_list(cache->dir, &cache->entries, &cache->count, err);
    for (size_t i = 0; i < cache->count; i++)
        cache->bytes += cache->entries[i].bytes;
    return status == HG_E_NOTFOUND ? HG_OK : status;
}

static enum hg_status verify(struct hg_cli *cli, struct cache *cache, struct hg_error *err)
{
    for (size_t i = 0; i < cache->count; i++) {
        struct hg_store_info *entry = &cache->entries[i];
        const enum hg_status status = hg_store_verify(cache->dir, &entry->key, err);
        if (hg_cli_is_stopped())
            return hg_error_set(err, HG_E_CANCELLED, "cache", NULL, "stopped");
        if (status == HG_E_HASH) {
            entry->is_damaged = true;
            cache->damaged++;
            cache->removed++;
            cache->removed_bytes += entry->bytes;
        } else if (status && status != HG_E_NOTFOUND) { // evicted meanwhile
            return status;
        }
        hg_cli_progress_update(&cli->progress, "verifying", i + 1, cache->count);
    }
    hg_cli_progress_clear(&cli->progress);
    return HG_OK;
}

// ---- output ------------------------------------------------------------------------------------

static void time_text(int64_t seconds, const char *format, char *out, size_t size)
{
    const time_t t = (time_t)seconds;
    struct tm tm;
    if (!gmtime_r(&t, &tm) || !strftime(out, size, format, &tm))
        snprintf(out, size, "-");
}

static json_t *entry_json(const struct hg_store_info *entry)
{
    char used[64], name[HG_SHA256_HEX];
    time_text(entry->used_s, "%Y-%m-%dT%H:%M:%SZ", used, sizeof used);
    hg_sha256_hex(entry->key.hash, name);
    // Labels are bytes of files: what is not UTF-8 is left out.
    json_t *label = json_string(entry->label);
    return json_pack("{s:s, s:I, s:s, s:i, s:o, s:b, s:b}", "name", name, "bytes",
        (json_int_t)entry->bytes, "last_use", used, "blocks", (int)entry->blocks, "made_from",
        label ? label : json_string(""), "damaged", (int)entry->is_damaged, "in_use",
        (int)entry->is_open);
}

static enum hg_status print_json(const struct cache *cache, struct hg_error *err)
{
    json_t *entries = json_array();
    for (size_t i = 0; entries && i < cache->count; i++)
        json_array_append_new(entries, entry_json(&cache->entries[i]));
    json_t *root = json_pack("{s:s, s:I, s:i, s:i, s:I, s:o}", "folder", cache->dir, "bytes",
        (json_int_t)cache->bytes, "damaged", (int)cache->damaged, "removed", (int)cache->removed,
        "removed_bytes", (json_int_t)cache->removed_bytes, "entries", entries);
    if (!root)
        return hg_error_set(err, HG_E_NOMEM, "cache", NULL, "no memory");
    json_dumpf(root, stdout, JSON_INDENT(2));
    putchar('\n');
    json_decref(root);
    return HG_OK;
}

static void print_entry(const struct hg_store_info *entry)
{
    char used[32], label[HG_STORE_LABEL_BYTES];
    time_text(entry->used_s, "%Y-%m-%d %H:%M", used, sizeof used);
    hg_cli_clean(label, sizeof label, entry->label, strlen(entry->label));
    printf("%10.3f  %s  %s%s%s\n", (double)entry->bytes * 1e-6, used, label,
        entry->is_open ? " (in use)" : "", entry->is_damaged ? " (damaged)" : "");
}

static void print_table(const struct hg_cli_options *o, const struct cache *cache)
{
    if (o->clear) {
        printf("%u entries, %.3f MB deleted; %zu entries are in use and stay\n", cache->removed,
            (double)cache->removed_bytes * 1e-6, cache->count - cache->removed);
        return;
    }
    if (cache->count)
        printf("%10s  %-16s  made from\n", "MB", "last use (UTC)");
    for (size_t i = 0; i < cache->count; i++)
        print_entry(&cache->entries[i]);
    printf("%zu entries, %.3f MB in %s\n", cache->count, (double)cache->bytes * 1e-6, cache->dir);
    if (o->verify)
        printf("%u of them were damaged and are deleted\n", cache->damaged);
}

static enum hg_status run(struct hg_cli *cli, struct cache *cache, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    enum hg_status status = list(cache, err);
    if (!status && !cache->count && access(cache->dir, F_OK) != 0)
        hg_cli_progress_say(
            &cli->progress, "%s is missing: nothing was cached here yet", cache->dir);
    if (!status && o->clear && cache->count) {
        status = hg_store_clear(cache->dir, &cache->removed, &cache->removed_bytes, err);
        cache->count = cache->removed > cache->count ? cache->removed : cache->count;
    }
    if (!status && o->verify)
        status = verify(cli, cache, err);
    if (!status && o->json && o->clear) {
        hg_free(cache->entries); // what stays
        cache->bytes = 0;
        status = list(cache, err);
    }
    if (!status && o->json)
        status = print_json(cache, err);
    else if (!status)
        print_table(o, cache);
    if (!status && fflush(stdout))
        status = hg_error_set(err, HG_E_IO, "standard output", NULL, "cannot write");
    return status;
}

enum hg_cli_exit hg_cli_cache(const struct hg_cli_options *options)
{
    struct hg_cli cli;
    struct cache cache = {0};
    struct hg_error err = {0};
    enum hg_cli_doing doing = HG_CLI_DOING_ARGUMENTS;
    hg_cli_init(&cli, options);
    enum hg_status status = find_dir(options, &cache, &err);
    if (!status) {
        doing = HG_CLI_DOING_OUTPUT;
        status = run(&cli, &cache, &err);
    }
    hg_free(cache.entries);
    const enum hg_cli_exit code = status          ? hg_cli_report(&cli, doing, &err)
                                  : cache.damaged ? HG_CLI_EXIT_FAILED
                                                  : HG_CLI_EXIT_OK;
    hg_cli_finish(&cli, code);
    return code;
}
