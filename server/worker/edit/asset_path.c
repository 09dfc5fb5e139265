#include "server/worker/edit/asset_path.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/roots.h"
#include "base/sha256.h"

// Real paths of the folders of a text that are there. Their strings are the C library's.
static enum hg_status read_folders(
    const char *text, char ***items, uint32_t *count, struct hg_error *err)
{
    size_t most = 1;
    char *copy = hg_strdup(text), *rest = copy;
    for (const char *at = text; *at; at++)
        most += *at == ':';
    *count = 0;
    *items = hg_calloc(most, sizeof **items);
    if (!copy || !*items) {
        hg_free(copy);
        return hg_error_set(err, HG_E_NOMEM, "path", NULL, "no memory for the asset roots");
    }
    for (const char *folder; (folder = strsep(&rest, ":"));)
        if (((*items)[*count] = realpath(folder, NULL)))
            ++*count;
    hg_free(copy);
    return HG_OK;
}

static enum hg_status resolve_within(
    struct hg_roots *roots, const char *within, const char *name, char **out, struct hg_error *err)
{
    char **items = NULL;
    uint32_t count;
    enum hg_status status = read_folders(within, &items, &count, err);
    roots->within = &(struct hg_roots){.items = (const char *const *)items, .count = count};
    if (!status)
        status = hg_roots_resolve(roots, name, out, err);
    for (uint32_t i = 0; i < count; i++)
        free(items[i]);
    hg_free(items);
    return status;
}

enum hg_status hg_asset_path_resolve(const struct worker_options *options, const char *within,
    struct hgp_str path, char **out, struct hg_error *err)
{
    struct hg_roots roots = {
        .items = (const char *const *)options->asset_roots, .count = options->asset_root_count};
    char *name = hg_strndup(path.data ? path.data : "", path.size);
    *out = NULL;
    if (!name)
        return hg_error_set(err, HG_E_NOMEM, "path", NULL, "no memory for a name");
    const enum hg_status status = within ? resolve_within(&roots, within, name, out, err)
                                         : hg_roots_resolve(&roots, name, out, err);
    hg_free(name);
    return status;
}

static const char *below_roots(const struct worker_options *options, const char *path)
{
    for (uint32_t i = 0; i < options->asset_root_count; i++) {
        const char *root = options->asset_roots[i];
        size_t n = strlen(root);
        if (strncmp(path, root, n) != 0 || !(path[n] == '/' || !path[n] || path[n - 1] == '/'))
            continue;
        while (path[n] == '/')
            n++;
        return path[n] ? path + n : ".";
    }
    return NULL;
}

void hg_asset_path_hide(const struct worker_options *options, struct hgp_str asked,
    const char *real, struct hg_error *err)
{
    char name[sizeof err->what];
    if (err->what[0] != '/')
        return;
    // What is long was cut: it is compared as far as it goes.
    const bool is_asked = real && strncmp(err->what, real, sizeof err->what - 1) == 0;
    const char *below = below_roots(options, err->what), *slash = strrchr(err->what, '/');
    if (is_asked && asked.size)
        snprintf(name, sizeof name, "%.*s", (int)asked.size, asked.data);
    else
        snprintf(name, sizeof name, "%s", below ? below : slash[1] ? slash + 1 : "file");
    memcpy(err->what, name, sizeof name);
}

enum hg_status hg_asset_path_upload(
    const struct worker_options *options, const uint8_t hash[32], char **out, struct hg_error *err)
{
    char hex[HG_SHA256_HEX], path[PATH_MAX];
    *out = NULL;
    hg_sha256_hex(hash, hex);
    if (!options->cache_dir)
        return hg_error_set(err, HG_E_STATE, hex, NULL, "this worker has no cache folder");
    snprintf(path, sizeof path, "%s/uploads/%s",
        options->upload_dir ? options->upload_dir : options->cache_dir, hex);
    *out = hg_strdup(path);
    return *out ? HG_OK : hg_error_set(err, HG_E_NOMEM, hex, NULL, "no memory for a path");
}
