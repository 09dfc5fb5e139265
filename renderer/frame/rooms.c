#include "renderer/frame/rooms.h"

#include "base/alloc.h"

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

static enum hg_status create(struct hg_frame_context *context, struct hg_scene *scene,
    struct hg_rooms **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_rooms *rooms = hg_calloc(1, sizeof *rooms);
    if (rooms == NULL)
        return hg_error_set(err, HG_E_NOMEM, "scene", NULL, "out of host memory");
    rooms->scene = scene;
    rooms->scene_revision = UINT64_MAX;
    const struct hg_textures_params textures = {.budget_bytes = context->texture_budget_bytes};
    const struct hg_geometry_params geometry = {.budget_bytes = context->geometry_budget_bytes};
    enum hg_status status = hg_textures_create(context->gpu, &textures, &rooms->textures, err);
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

enum hg_status hg_rooms_sync(struct hg_frame_context *context, struct hg_rooms *rooms,
    const double eye_ws[3], struct hg_error *err)
{
    const bool moved = hg_geometry_set_origin(rooms->geometry, eye_ws);
    if (rooms->scene_revision == rooms->scene->revision && !moved)
        return HG_OK;
    rooms->scene_revision = UINT64_MAX; // a failure is tried again
    hg_scene_update(rooms->scene);
    enum hg_status status =
        hg_textures_sync(rooms->textures, rooms->scene, context->jobs, err);
    if (status == HG_OK)
        status = hg_geometry_sync(rooms->geometry, rooms->scene, rooms->textures, err);
    if (status == HG_OK)
        rooms->scene_revision = rooms->scene->revision;
    return status;
}
