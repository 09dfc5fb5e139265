#include "renderer/scene_gpu/scene_gpu.h"

#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "shaders/shared/features.h"

// --- features ------------------------------------------------------------------------------------

static bool is_plain(const struct hg_texture_ref *ref)
{
    static const float identity[6] = {1, 0, 0, 0, 1, 0};
    const struct hg_texture *t = ref->texture;
    return ref->uv_set == 0 && memcmp(ref->uv_transform, identity, sizeof identity) == 0 &&
           t->wrap_s == HG_WRAP_REPEAT && t->wrap_t == HG_WRAP_REPEAT && !t->mag_nearest &&
           !t->min_nearest && !t->mip_nearest && !t->mip_none;
}

static uint32_t material_features(const struct hg_material *m)
{
    static const uint32_t bits[] = {[HG_SLOT_BASE_COLOR] = HG_FEATURE_TEXTURES,
        [HG_SLOT_METALLIC_ROUGHNESS] = HG_FEATURE_TEXTURES,
        [HG_SLOT_NORMAL] = HG_FEATURE_TEXTURES,
        [HG_SLOT_OCCLUSION] = HG_FEATURE_OCCLUSION,
        [HG_SLOT_EMISSIVE] = HG_FEATURE_EMISSIVE};
    uint32_t features = hg_material_lobes(m);
    for (int i = HG_SLOT_BASE_COLOR; i < HG_SLOT_COUNT; i++) {
        if (!hg_material_uses_slot(m, (enum hg_texture_slot)i))
            continue;
        features |= i <= HG_SLOT_EMISSIVE ? bits[i] : 0;
        features |= is_plain(&m->slots[i]) ? 0 : HG_FEATURE_SAMPLERS;
    }
    if (m->emissive[0] != 0.0f || m->emissive[1] != 0.0f || m->emissive[2] != 0.0f)
        features |= HG_FEATURE_EMITS;
    if (m->unlit || m->slots[HG_SLOT_OCCLUSION].texture != NULL || m->normal_scale != 1.0f ||
        m->ior != 1.5f)
        features |= HG_FEATURE_UNCOMMON;
    // Occlusion packed with roughness costs no lookup of its own (geometry/materials.c).
    const struct hg_texture_ref *o = &m->slots[HG_SLOT_OCCLUSION];
    if (o->texture != NULL && memcmp(o, &m->slots[HG_SLOT_METALLIC_ROUGHNESS], sizeof *o) == 0)
        features &= ~HG_FEATURE_OCCLUSION;
    return features;
}

static uint32_t part_features(const struct hg_mesh_part *part)
{
    uint32_t features = 0;
    if (part->topology != HG_TOPOLOGY_TRIANGLES || part->colors != NULL || part->uv[1] != NULL)
        features |= HG_FEATURE_VERTICES;
    if (part->topology != HG_TOPOLOGY_LINES && part->tangents == NULL)
        features |= HG_FEATURE_NO_TANGENTS;
    return features;
}

static uint32_t scene_features(const struct hg_scene *scene, const struct hg_textures *textures)
{
    const uint32_t sampled =
        HG_FEATURE_TEXTURES | HG_FEATURE_OCCLUSION | HG_FEATURE_EMISSIVE | HG_FEATURE_LOBE_TEXTURES;
    uint32_t features = 0;
    struct hg_textures_stats stats;
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_MATERIAL].count; i++)
        features |= material_features(
            (const struct hg_material *)scene->objects[HG_OBJECT_MATERIAL].items[i]);
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_MESH].count; i++) {
        const struct hg_mesh *mesh =
            (const struct hg_mesh *)scene->objects[HG_OBJECT_MESH].items[i];
        for (uint32_t p = 0; p < mesh->part_count; p++)
            features |= part_features(&mesh->parts[p]);
    }
    hg_textures_stats(textures, &stats);
    if (stats.textures == (hg_textures_background(textures).bits != 0 ? 1u : 0u))
        features &= ~sampled; // nothing to look up
    if (hg_textures_has_float(textures))
        features |= HG_FEATURE_FLOAT;
    if (hg_textures_has_wide(textures))
        features |= HG_FEATURE_WIDE;
    return features;
}

static uint32_t scene_mixes(const struct hg_scene *scene)
{
    uint32_t mixes = 0;
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_MATERIAL].count; i++)
        mixes |= hg_material_mixes(
            (const struct hg_material *)scene->objects[HG_OBJECT_MATERIAL].items[i]);
    return mixes;
}

// Blended materials, and transmissive ones with an alpha mask.
static bool has_holes(const struct hg_scene *scene)
{
    bool holes = false;
    for (uint32_t i = 0; i < scene->objects[HG_OBJECT_MATERIAL].count; i++) {
        const struct hg_material *m =
            (const struct hg_material *)scene->objects[HG_OBJECT_MATERIAL].items[i];
        holes |= m->alpha_mode == HG_ALPHA_BLEND ||
                 (m->alpha_mode == HG_ALPHA_MASK && m->transmission > 0.0f);
    }
    return holes;
}

// --- rooms ---------------------------------------------------------------------------------------

static void destroy(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu)
{
    struct hg_scene_gpu **link = &context->scene_gpu;
    while (*link != NULL && *link != scene_gpu)
        link = &(*link)->next;
    if (*link == scene_gpu)
        *link = scene_gpu->next;
    hg_radiance_cache_destroy(scene_gpu->radiance);
    hg_irradiance_destroy(scene_gpu->irradiance);
    hg_gi_destroy(scene_gpu->gi);
    hg_light_shared_destroy(scene_gpu->light);
    hg_rays_destroy(scene_gpu->rays);
    hg_geometry_destroy(scene_gpu->geometry);
    hg_textures_destroy(scene_gpu->textures);
    hg_free(scene_gpu);
}

static enum hg_status make_pages(struct hg_frame_context *context, struct hg_error *err)
{
    const uint64_t budget = context->texture_budget_bytes, least = 64ull << 20;
    const uint64_t host = budget == 0 ? 0 : budget > least ? budget : least;
    const struct hg_page_cache_params params = {.budget_bytes = budget,
        .host_bytes = context->host_budget_bytes > 0 ? context->host_budget_bytes : host,
        .store = context->store,
        .threads = hg_jobs_threads(context->jobs)};
    return context->pages != NULL
               ? HG_OK
               : hg_page_cache_create(context->gpu, &params, &context->pages, err);
}

void hg_frame_context_finish(struct hg_frame_context *context)
{
    hg_page_cache_destroy(context->pages);
    context->pages = NULL;
    hg_sky_cache_finish(&context->sky);
    if (context->gpu != NULL)
        hg_gpu_lent_sweep(context->gpu, &context->lent, true);
}

static enum hg_status create(struct hg_frame_context *context, struct hg_scene *scene,
    struct hg_scene_gpu **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_scene_gpu *scene_gpu = hg_calloc(1, sizeof *scene_gpu);
    if (scene_gpu == NULL)
        return hg_error_set(err, HG_E_NOMEM, "scene", NULL, "out of host memory");
    scene_gpu->scene = scene;
    scene_gpu->scene_revision = UINT64_MAX;
    enum hg_status status = make_pages(context, err);
    const struct hg_textures_params textures = {.cache = context->pages};
    const struct hg_geometry_params geometry = {.budget_bytes = context->geometry_budget_bytes,
        .jobs = context->jobs,
        .store = context->store,
        .bake_from = context->bake_from};
    const struct hg_rays_params rays = {
        .jobs = context->jobs, .budget_bytes = context->geometry_budget_bytes};
    if (status == HG_OK)
        status = hg_textures_create(context->gpu, &textures, &scene_gpu->textures, err);
    if (status == HG_OK)
        status = hg_geometry_create(context->gpu, &geometry, &scene_gpu->geometry, err);
    if (status == HG_OK)
        status = hg_rays_create(context->gpu, scene_gpu->geometry, &rays, &scene_gpu->rays, err);
    if (status == HG_OK)
        status = hg_light_shared_create(context->gpu, &context->sky, &scene_gpu->light, err);
    if (status != HG_OK) {
        destroy(context, scene_gpu);
        return status;
    }
    scene_gpu->next = context->scene_gpu;
    context->scene_gpu = scene_gpu;
    *out = scene_gpu;
    return HG_OK;
}

enum hg_status hg_scene_gpu_ref(struct hg_frame_context *context, struct hg_scene *scene,
    struct hg_scene_gpu **out, struct hg_error *err)
{
    *out = context->scene_gpu;
    while (*out != NULL && (*out)->scene != scene)
        *out = (*out)->next;
    enum hg_status status = *out != NULL ? HG_OK : create(context, scene, out, err);
    if (status == HG_OK)
        (*out)->refs++;
    return status;
}

void hg_scene_gpu_unref(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu)
{
    if (scene_gpu != NULL && --scene_gpu->refs == 0)
        destroy(context, scene_gpu);
}

static uint64_t revision_of(const struct hg_scene_gpu *scene_gpu)
{
    double origin[3];
    hg_geometry_origin(scene_gpu->geometry, origin);
    uint64_t h = hg_hash_mix(5, scene_gpu->shown_revision);
    for (int i = 0; i < 3; i++)
        h = hg_hash_mix(h, (uint64_t)(int64_t)origin[i]);
    return h;
}

static enum hg_status sync(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu,
    const double eye_ws[3], uint64_t until_ns, struct hg_error *err)
{
    const bool came = hg_geometry_poll(scene_gpu->geometry, until_ns);
    const bool moved = hg_geometry_set_origin(scene_gpu->geometry, eye_ws);
    const bool same = scene_gpu->scene_revision == scene_gpu->scene->revision && !came &&
                      !hg_textures_is_stale(scene_gpu->textures);
    if (same && !moved && scene_gpu->posed == NULL)
        return HG_OK;
    const uint64_t before = hg_geometry_revision(scene_gpu->geometry);
    scene_gpu->posed = NULL;
    scene_gpu->scene_revision = UINT64_MAX; // a failure is tried again
    hg_scene_update(scene_gpu->scene);
    enum hg_status status =
        hg_textures_sync(scene_gpu->textures, scene_gpu->scene, context->jobs, err);
    if (status == HG_OK)
        status = hg_geometry_sync(scene_gpu->geometry, scene_gpu->scene, scene_gpu->textures, err);
    if (status == HG_OK) {
        scene_gpu->features = scene_features(scene_gpu->scene, scene_gpu->textures);
        scene_gpu->mixes = scene_mixes(scene_gpu->scene);
        scene_gpu->has_holes = has_holes(scene_gpu->scene);
        scene_gpu->scene_revision = scene_gpu->scene->revision;
        if (!same && hg_geometry_revision(scene_gpu->geometry) != before)
            scene_gpu->shown_revision = hg_geometry_revision(scene_gpu->geometry);
        scene_gpu->geometry_revision = revision_of(scene_gpu);
    }
    return status;
}

enum hg_status hg_scene_gpu_pose(
    struct hg_scene_gpu *scene_gpu, const void *who, struct hg_error *err)
{
    scene_gpu->posed = who;
    return hg_geometry_sync(scene_gpu->geometry, scene_gpu->scene, scene_gpu->textures, err);
}

bool hg_scene_gpu_is_posed(const struct hg_scene_gpu *scene_gpu, const void *who)
{
    return scene_gpu->posed == who && scene_gpu->scene_revision == scene_gpu->scene->revision &&
           hg_geometry_baking(scene_gpu->geometry) == 0 &&
           !hg_textures_is_stale(scene_gpu->textures);
}

enum hg_status hg_scene_gpu_sync(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu,
    const double eye_ws[3], uint64_t until_ns, struct hg_error *err)
{
    const enum hg_status status = sync(context, scene_gpu, eye_ws, until_ns, err);
    // Parts that were queued just now are waited for, too.
    return status == HG_OK && until_ns > 0 && hg_geometry_baking(scene_gpu->geometry) > 0
               ? sync(context, scene_gpu, eye_ws, until_ns, err)
               : status;
}

struct hg_camera_setup hg_scene_gpu_camera(const struct hg_scene_gpu *scene_gpu,
    const struct hg_view_camera_state *c, uint32_t width, uint32_t height)
{
    struct hg_camera_setup setup = {.orthographic = c->orthographic,
        .vfov_rad = c->vfov_rad,
        .half_height = c->half_height,
        .near = c->near,
        .far = c->far,
        .width = width,
        .height = height};
    double origin[3];
    float min[3] = {0}, max[3] = {0};
    hg_geometry_origin(scene_gpu->geometry, origin);
    for (int i = 0; i < 3; i++) {
        setup.eye[i] = c->eye[i] - origin[i];
        setup.target[i] = c->target[i] - origin[i];
        setup.up[i] = c->up[i];
    }
    const bool has_bounds = hg_geometry_bounds(scene_gpu->geometry, min, max);
    hg_camera_fit_depth(&setup, has_bounds, min, max);
    return setup;
}
