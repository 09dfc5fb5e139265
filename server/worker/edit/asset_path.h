// asset_path.h - which files a worker may read.
// Floor 6, private to server/worker. Thread: any.
#ifndef HG_SERVER_WORKER_EDIT_ASSET_PATH_H
#define HG_SERVER_WORKER_EDIT_ASSET_PATH_H

#include "server/worker/worker.h"

// Real path of a file that lies under the asset roots and under one of `within` (absolute folders,
// ':' between them; NULL: wherever): absolute, or relative to one of the asset roots.
// *out is freed with hg_free. HG_E_NOTFOUND, HG_E_PERM.
enum hg_status hg_asset_path_resolve(const struct worker_options *options, const char *within,
    struct hgp_str path, char **out, struct hg_error *err) HG_MUST_CHECK;
// An error that names a file by where it lies names it as clients know it from here on: what was
// asked for by their own name for it (`real`, NULL = nothing was), others by what is below the
// asset root, or the last name where they lie under none.
void hg_asset_path_hide(const struct worker_options *options, struct hgp_str asked,
    const char *real, struct hg_error *err);
// `<cache>/uploads/<hex>`; HG_E_STATE without a cache folder.
enum hg_status hg_asset_path_upload(const struct worker_options *options, const uint8_t hash[32],
    char **out, struct hg_error *err) HG_MUST_CHECK;

#endif
