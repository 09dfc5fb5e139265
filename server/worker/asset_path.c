#include "server/worker/asset_path.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/sha256.h"

static bool lies_under(const char *path, const char *root)
{
    size_t n = strlen(root);
    return strncmp(path, root, n) == 0 &&
           (path[n] == '/' || path[n] == 0 || (n && root[n - 1] == '/'));
}

// Real path of `path` under `root`; when the file is missing, that of its folder (*missing).
static char *resolve_under(const char *root, struct hgp_str path, bool *missing)
{
    char joined[PATH_MAX];
    int n = path.data[0] == '/'
                ? snprintf(joined, sizeof joined, "%.*s", (int)path.size, path.data)
                : snprintf(joined, sizeof joined, "%s/%.*s", root, (int)path.size, path.data);
    if (n < 0 || n >= (int)sizeof joined)
        return NULL;
    char *real = realpath(joined, NULL);
    *missing = !real;
    char *slash = strrchr(joined, '/');
    if (real || !slash)
        return real;
    slash[slash == joined] = 0;
    return realpath(joined, NULL);
}

static bool in_roots(const struct worker_options *options, const char *real)
{
    for (uint32_t i = 0; i < options->asset_root_count; i++)
        if (lies_under(real, options->asset_roots[i]))
            return true;
    return false;
}

// Does not disclose whether a file outside the roots exists: there everything is "not allowed".
enum hg_status hg_asset_path_resolve(
    const struct worker_options *options, struct hgp_str path, char **out, struct hg_error *err)
{
    char name[256];
    snprintf(name, sizeof name, "%.*s", (int)path.size, path.data);
    *out = NULL;
    bool inside = false;
    for (uint32_t i = 0; i < options->asset_root_count && path.size; i++) {
        bool missing;
        char *real = resolve_under(options->asset_roots[i], path, &missing);
        bool allowed = real && in_roots(options, real);
        if (allowed && !missing) {
            *out = real;
            return HG_OK;
        }
        inside |= allowed;
        free(real);
    }
    if (inside)
        return hg_error_set(err, HG_E_NOTFOUND, name, NULL, "no such file");
    return hg_error_set(err, HG_E_PERM, name, NULL, "does not lie under an asset root");
}

enum hg_status hg_asset_path_upload(
    const struct worker_options *options, const uint8_t hash[32], char **out, struct hg_error *err)
{
    char hex[HG_SHA256_HEX], path[PATH_MAX];
    *out = NULL;
    hg_sha256_hex(hash, hex);
    if (!options->cache_dir)
        return hg_error_set(err, HG_E_STATE, hex, NULL, "this worker has no cache folder");
    snprintf(path, sizeof path, "%s/uploads/%s", options->cache_dir, hex);
    *out = hg_strdup(path);
    return *out ? HG_OK : hg_error_set(err, HG_E_NOMEM, hex, NULL, "no memory for a path");
}
