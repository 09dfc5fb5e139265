// fetch.h - which files an asset may name, and reading them.
// Floor 2, private to scene/. Any thread; a fetcher is read-only after init.
#ifndef HG_RENDERER_SCENE_FETCH_H
#define HG_RENDERER_SCENE_FETCH_H

#include "renderer/scene/load.h"

struct hg_fetch {
    char *folder; // of the main file, resolved
    char **roots; // [root_count] resolved folders
    uint32_t root_count;
};

// Resolves the main file's folder and the roots (links followed); no roots = the folder itself.
// HG_E_NOTFOUND, HG_E_PERM when the main file lies outside of the roots, HG_E_NOMEM.
enum hg_status hg_fetch_init(struct hg_fetch *fetch, const struct hg_load_params *params,
    struct hg_error *err) HG_MUST_CHECK;
void hg_fetch_finish(struct hg_fetch *fetch);

// The real path of a regular file named relative to the folder. A path that leaves the roots,
// through ".." or links, is refused with HG_E_PERM. *out is freed with hg_free.
enum hg_status hg_fetch_resolve(const struct hg_fetch *fetch, const char *relative, char **out,
    struct hg_error *err) HG_MUST_CHECK;
// hg_load_fetch_fn; user is a struct hg_fetch.
enum hg_status hg_fetch_file(void *user, const char *uri, uint64_t limit_bytes,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// Reads a file into a buffer. HG_E_NOTFOUND, HG_E_PERM, HG_E_LIMIT, HG_E_NOMEM, HG_E_IO.
enum hg_status hg_fetch_read(const char *path, uint64_t limit_bytes, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
