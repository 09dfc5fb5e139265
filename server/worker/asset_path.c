#include "server/worker/asset_path.h"

#include <limits.h>
#include <stdio.h>

#include "base/alloc.h"
#include "base/roots.h"
#include "base/sha256.h"

enum hg_status hg_asset_path_resolve(
    const struct worker_options *options, struct hgp_str path, char **out, struct hg_error *err)
{
    const struct hg_roots roots = {
        (const char *const *)options->asset_roots, options->asset_root_count};
    char *name = hg_strndup(path.data ? path.data : "", path.size);
    *out = NULL;
    if (!name)
        return hg_error_set(err, HG_E_NOMEM, "path", NULL, "no memory for a name");
    enum hg_status status = hg_roots_resolve(&roots, name, out, err);
    hg_free(name);
    return status;
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
