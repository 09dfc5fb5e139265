#include "renderer/frame/scene_gpu.h"

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
    if (part->topology == HG_TOPOLOGY_TRIANGLES && part->tangents == NULL)
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

// Alpha blends, or cuts holes into what lets light through.
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

static void destroy(struct hg_frame_context *context, struct hg_rooms *rooms)
{
    struct hg_rooms **link = &context->rooms;
    while (*link != NULL && *link != rooms)
        link = &(*link)->next;
    if (*link == rooms)
        *link = rooms->next;
    hg_geometry_destroy(rooms->geometry);
    hg_textures_destroy(rooms->textures);
    hg_free(rooms);
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
}

static enum hg_status create(struct hg_frame_context *context, struct hg_scene *scene,
    struct hg_rooms **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_rooms *rooms = hg_calloc(1, sizeof *rooms);
    if (rooms == NULL)
        return hg_error_set(err, HG_E_NOMEM, "scene", NULL, "out of host memory");
    rooms->scene = scene;
    rooms->scene_revision = UINT64_MAX;
    enum hg_status status = make_pages(context, err);
    const struct hg_textures_params textures = {.cache = context->pages};
    const struct hg_geometry_params geometry = {.budget_bytes = context->geometry_budget_bytes,
        .jobs = context->jobs,
        .store = context->store,
        .bake_from = context->bake_from};
    if (status == HG_OK)
        status = hg_textures_create(context->gpu, &textures, &rooms->textures, err);
    if (status == HG_OK)
        status = hg_geometry_create(context->gpu, &geometry, &rooms->geometry, err);
    if (status != HG_OK) {
        destroy(context, rooms);
        return status;
    }
    rooms->next = context->rooms;
    context->rooms = rooms;
    *out = rooms;
    return HG_OK;
}

enum hg_status hg_rooms_ref(struct hg_frame_context *context, struct hg_scene *scene,
    struct hg_rooms **out, struct hg_error *err)
{
    *out = context->rooms;
    while (*out != NULL && (*out)->scene != scene)
        *out = (*out)->next;
    enum hg_status status = *out != NULL ? HG_OK : create(context, scene, out, err);
    if (status == HG_OK)
        (*out)->refs++;
    return status;
}

void hg_rooms_unref(struct hg_frame_context *context, struct hg_rooms *rooms)
{
    if (rooms != NULL && --rooms->refs == 0)
        destroy(context, rooms);
}

static uint64_t revision_of(const struct hg_rooms *rooms)
{
    double origin[3];
    hg_geometry_origin(rooms->geometry, origin);
    uint64_t h = hg_mix(5, rooms->shown_revision);
    for (int i = 0; i < 3; i++)
        h = hg_mix(h, (uint64_t)(int64_t)origin[i]);
    return h;
}

static enum hg_status sync(struct hg_frame_context *context, struct hg_rooms *rooms,
    const double eye_ws[3], uint64_t until_ns, struct hg_error *err)
{
    const bool came = hg_geometry_poll(rooms->geometry, until_ns);
    const bool moved = hg_geometry_set_origin(rooms->geometry, eye_ws);
    const bool same = rooms->scene_revision == rooms->scene->revision && !came &&
                      !hg_textures_is_stale(rooms->textures);
    if (same && !moved && rooms->posed == NULL)
        return HG_OK;
    const uint64_t before = hg_geometry_revision(rooms->geometry);
    rooms->posed = NULL;
    rooms->scene_revision = UINT64_MAX; // a failure is tried again
    hg_scene_update(rooms->scene);
    enum hg_status status = hg_textures_sync(rooms->textures, rooms->scene, context->jobs, err);
    if (status == HG_OK)
        status = hg_geometry_sync(rooms->geometry, rooms->scene, rooms->textures, err);
    if (status == HG_OK) {
        rooms->features = scene_features(rooms->scene, rooms->textures);
        rooms->mixes = scene_mixes(rooms->scene);
        rooms->has_holes = has_holes(rooms->scene);
        rooms->scene_revision = rooms->scene->revision;
        if (!same && hg_geometry_revision(rooms->geometry) != before)
            rooms->shown_revision = hg_geometry_revision(rooms->geometry);
        rooms->geometry_revision = revision_of(rooms);
    }
    return status;
}

enum hg_status hg_rooms_pose(struct hg_rooms *rooms, const void *who, struct hg_error *err)
{
    rooms->posed = who;
    return hg_geometry_sync(rooms->geometry, rooms->scene, rooms->textures, err);
}

bool hg_rooms_are_posed(const struct hg_rooms *rooms, const void *who)
{
    return rooms->posed == who && rooms->scene_revision == rooms->scene->revision &&
           hg_geometry_baking(rooms->geometry) == 0 && !hg_textures_is_stale(rooms->textures);
}

enum hg_status hg_rooms_sync(struct hg_frame_context *context, struct hg_rooms *rooms,
    const double eye_ws[3], uint64_t until_ns, struct hg_error *err)
{
    const enum hg_status status = sync(context, rooms, eye_ws, until_ns, err);
    // Parts that were queued just now: the one who waits does so for them too.
    return status == HG_OK && until_ns > 0 && hg_geometry_baking(rooms->geometry) > 0
               ? sync(context, rooms, eye_ws, until_ns, err)
               : status;
}
