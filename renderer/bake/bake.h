// bake.h - page packs and cluster files of a scene, made ahead of time. Needs no device.
// Floor 5. One thread; the scene must not change meanwhile.
#ifndef HG_RENDERER_BAKE_BAKE_H
#define HG_RENDERER_BAKE_BAKE_H

#include "base/jobs.h"
#include "base/status.h"

struct hg_scene;

struct hg_bake {
    const struct hg_scene *scene;
    const char *cache_dir;      // as of hg_renderer_params; never NULL
    uint64_t cache_limit_bytes; // 0 = unlimited
    uint64_t host_budget_bytes; // of decoded images; 0 = the default of page_source.h
    struct hg_jobs *jobs;       // not NULL
    bool no_textures, no_geometry;
    // Called a few times a second; false cancels (HG_E_CANCELLED). May be NULL.
    bool (*progress)(void *user, const char *stage, uint64_t done, uint64_t total);
    void *progress_user;
};

// Bakes what the cache does not have yet. Assets that cannot be baked are counted as failed and
// named in the report; the rest is baked all the same. *text: one JSON object (docs/client.md,
// helio bake), freed with hg_free. HG_E_CANCELLED, HG_E_NOMEM; HG_E_NOSPACE, HG_E_IO, HG_E_PERM
// when nothing can be written.
enum hg_status hg_bake_run(
    const struct hg_bake *bake, char **text, struct hg_error *err) HG_MUST_CHECK;

#endif
