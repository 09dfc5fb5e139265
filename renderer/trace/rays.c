// rays.c - see rays.h.
#include "renderer/trace/rays.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

#define DEFAULT_PX 2048.0f // of the scene's size, that its error is less than one of

struct hg_rays_scene {
    struct hg_rays *rays;
    struct hg_rays_scene *next;
    uint32_t refs;
    struct hg_rays_key key;
    struct hg_ray_geometry *geometry;
    struct hg_trace *trace;
    uint64_t revision; // of the geometry that `trace` has; UINT64_MAX = none
};

struct hg_rays {
    struct hg_gpu *gpu;
    struct hg_geometry *geometry;
    struct hg_rays_params params;
    struct hg_rays_scene *scenes;
};

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_rays_create(struct hg_gpu *gpu, struct hg_geometry *geometry,
    const struct hg_rays_params *params, struct hg_rays **out, struct hg_error *err)
{
    *out = hg_calloc(1, sizeof **out);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "rays", NULL, "no memory");
    **out = (struct hg_rays){.gpu = gpu, .geometry = geometry, .params = *params};
    return HG_OK;
}

static void destroy_scene(struct hg_rays_scene *s)
{
    hg_trace_destroy(s->trace);
    hg_ray_geometry_free(s->geometry);
    hg_free(s);
}

void hg_rays_destroy(struct hg_rays *rays)
{
    if (rays == NULL)
        return;
    while (rays->scenes != NULL) {
        struct hg_rays_scene *s = rays->scenes;
        rays->scenes = s->next;
        destroy_scene(s);
    }
    hg_free(rays);
}

// --- keys ----------------------------------------------------------------------------------------

static bool same_lens(const struct hg_ray_geometry_lens *a, const struct hg_ray_geometry_lens *b)
{
    return memcmp(a->eye, b->eye, sizeof a->eye) == 0 && a->px_scale == b->px_scale &&
           a->orthographic == b->orthographic && a->near == b->near && a->error_px == b->error_px &&
           a->motion == b->motion && a->addresses == b->addresses && a->resident == b->resident;
}

static bool same_structures(const struct hg_rays_key *a, const struct hg_rays_key *b)
{
    return a->backend == b->backend && a->exact == b->exact;
}

static bool same_key(const struct hg_rays_key *a, const struct hg_rays_key *b)
{
    return same_structures(a, b) && a->owner == b->owner && same_lens(&a->lens, &b->lens);
}

// The size is rounded up to a power of two, so that what moves about in a scene does not change the
// level of detail of all the rest.
struct hg_rays_key hg_rays_default_key(
    const struct hg_rays *rays, enum hg_trace_backend backend, bool wait)
{
    float min[3], max[3], size = 0.0f;
    if (hg_geometry_bounds(rays->geometry, min, max))
        for (int i = 0; i < 3; i++)
            size = fmaxf(size, max[i] - min[i]);
    const bool known = size > 0.0f && isfinite(size);
    const float metres = known ? exp2f(ceilf(log2f(size))) : 1.0f;
    return (struct hg_rays_key){.backend = backend,
        .lens = {.px_scale = DEFAULT_PX / metres,
            .orthographic = true,
            .near = 1e-6f,
            .error_px = 1.0f,
            .resident = !wait}};
}

// --- references ----------------------------------------------------------------------------------

static struct hg_rays_scene *find(const struct hg_rays *rays, const struct hg_rays_key *key)
{
    struct hg_rays_scene *s = rays->scenes;
    while (s != NULL && !same_key(&s->key, key))
        s = s->next;
    return s;
}

static enum hg_status create(struct hg_rays *rays, const struct hg_rays_key *key,
    struct hg_rays_scene **out, struct hg_error *err)
{
    const struct hg_trace_params params = {.backend = key->backend,
        .jobs = rays->params.jobs,
        .budget_bytes = rays->params.budget_bytes,
        .apart = !key->exact};
    struct hg_rays_scene *s = hg_calloc(1, sizeof *s);
    if (s == NULL)
        return hg_error_set(err, HG_E_NOMEM, "rays", NULL, "no memory");
    *s = (struct hg_rays_scene){.rays = rays, .key = *key, .revision = UINT64_MAX};
    const enum hg_status status = hg_trace_create(rays->gpu, &params, &s->trace, err);
    if (status != HG_OK) {
        destroy_scene(s);
        return status;
    }
    s->next = rays->scenes;
    rays->scenes = s;
    *out = s;
    return HG_OK;
}

enum hg_status hg_rays_ref(struct hg_rays *rays, const struct hg_rays_key *key,
    struct hg_rays_scene **scene, struct hg_error *err)
{
    struct hg_rays_scene *old = *scene, *found = find(rays, key);
    if (old != NULL && old == found)
        return HG_OK;
    if (found == NULL && old != NULL && old->refs == 1 && same_structures(&old->key, key)) {
        old->key = *key; // what both have in common stays
        return HG_OK;
    }
    *scene = NULL;
    hg_rays_unref(old);
    const enum hg_status status = found == NULL ? create(rays, key, &found, err) : HG_OK;
    if (status != HG_OK)
        return status;
    found->refs++;
    *scene = found;
    return HG_OK;
}

void hg_rays_unref(struct hg_rays_scene *s)
{
    if (s == NULL || --s->refs > 0)
        return;
    struct hg_rays_scene **link = &s->rays->scenes;
    while (*link != s)
        link = &(*link)->next;
    *link = s->next;
    destroy_scene(s);
}

void hg_rays_stats(const struct hg_rays *rays, struct hg_rays_stats *out)
{
    *out = (struct hg_rays_stats){0};
    for (const struct hg_rays_scene *s = rays->scenes; s != NULL; s = s->next) {
        out->scenes++;
        out->references += s->refs;
    }
}

// --- structures ----------------------------------------------------------------------------------

enum hg_status hg_rays_sync(struct hg_rays_scene *s, struct hg_error *err)
{
    const struct hg_rays *rays = s->rays;
    enum hg_status status =
        hg_ray_geometry_make(rays->geometry, &s->key.lens, rays->params.jobs, &s->geometry, err);
    if (status != HG_OK || hg_ray_geometry_revision(s->geometry) == s->revision)
        return status;
    s->revision = UINT64_MAX;
    status = hg_trace_sync(s->trace, s->geometry, err);
    if (status == HG_OK)
        s->revision = hg_ray_geometry_revision(s->geometry);
    return status;
}

enum hg_status hg_rays_open_shutter(struct hg_rays_scene *s, struct hg_error *err)
{
    return hg_ray_geometry_open_shutter(s->rays->geometry, &s->geometry, err);
}

const struct hg_ray_geometry *hg_rays_geometry(const struct hg_rays_scene *s)
{
    return s->geometry;
}

struct hg_trace *hg_rays_trace(struct hg_rays_scene *s)
{
    return s->trace;
}
