#include "server/worker/edit/edit_load.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "server/worker/edit/variant.h"

enum { NOTICE_LIMIT = 64 };

// An asset number is chosen in the session's range; replayed assets keep the number they had.
void hg_handle_asset_load(const struct request *r)
{
    const struct hgp_asset_load *m = &r->message->asset_load;
    struct hg_error err = {0};
    if (hg_scene_find_asset(r->session->scene->scene, m->asset))
        hg_error_set(
            &err, HG_E_EXISTS, "asset_load", "asset", "asset %u is loaded already", m->asset);
    else if (m->has_parent && m->parent &&
             !hg_scene_find(r->session->scene->scene, HG_OBJECT_NODE, m->parent))
        hg_error_set(&err, HG_E_NOTFOUND, "asset_load", "parent", "no such node");
    if (err.status) {
        hg_reply_error(r->to, &err);
        return;
    }
    hg_request_start_task(r, TASK_ASSET, HGP_T_asset_load);
    hg_render_state_expect_renderer(r->s);
}

static void send_notices(const struct request *r, const struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->warning_count && i < NOTICE_LIMIT; i++) {
        const struct hg_warning *warning = &asset->warnings[i];
        hg_reply_send(r->to, HGP_T_notice,
            &(struct hgp_notice){.what = hgp_str_fit(warning->what, 256),
                .where = hgp_str_fit(warning->where, 128),
                .reason = hgp_str_fit(warning->reason, 512)});
    }
    if (asset->warning_count > NOTICE_LIMIT) {
        char text[64];
        snprintf(text, sizeof text, "%u more warnings", asset->warning_count - NOTICE_LIMIT);
        hg_reply_send(r->to, HGP_T_notice,
            &(struct hgp_notice){
                .what = hgp_str_fit(asset->label, 256), .reason = hgp_str_make(text)});
    }
}

static uint64_t count_triangles(const struct hg_asset *asset)
{
    uint64_t total = 0;
    for (uint32_t n = 0; n < asset->node_count; n++) {
        const struct hg_node *node = asset->nodes[n];
        uint64_t copies = node->instance_count ? node->instance_count : 1;
        for (uint32_t p = 0; node->mesh && p < node->mesh->part_count; p++)
            if (node->mesh->parts[p].topology == HG_TOPOLOGY_TRIANGLES)
                total += copies * (node->mesh->parts[p].index_count / 3);
    }
    return total;
}

static void answer_loaded(const struct request *r, const struct hg_asset *asset)
{
    struct hg_scene *scene = r->session->scene->scene;
    struct hgp_asset_loaded answer = {
        .asset = asset->number,
        .revision = scene->revision,
        .nodes = asset->node_count,
        .meshes = asset->mesh_count,
        .materials = asset->material_count,
        .textures = asset->texture_count,
        .lights = asset->light_count,
        .cameras = asset->camera_count,
        .animations = asset->animation_count,
        .triangles = count_triangles(asset),
    };
    if (asset->file.up_reason) {
        answer.has_up = answer.has_up_reason = true;
        answer.up = (enum hgp_up_axis)((int)asset->file.up - 1);
        answer.up_reason = hgp_str_fit(asset->file.up_reason, 128);
    }
    for (uint32_t i = 0; i < asset->animation_count; i++)
        if (asset->animations[i].duration_s > answer.duration_s)
            answer.duration_s = asset->animations[i].duration_s;
    hg_scene_update(scene);
    hg_scene_bounds(scene, NULL, answer.bounds_min, answer.bounds_max);
    hg_reply_send(r->to, HGP_T_asset_loaded, &answer);
}

// The built-in scene comes with its sky, unless the client has already chosen an environment.
static void light_demo(struct scene_slot *slot, const struct hg_asset *asset)
{
    struct hg_environment *env = &slot->scene->environment;
    if (strcmp(asset->label, "demo:") != 0 || !env->automatic)
        return;
    env->automatic = env->fills = false;
    env->sun = env->wanted_sun;
    hg_demo_environment(env);
    env->intensity *= env->wanted_intensity;
    env->revision = slot->scene->revision + 1;
}

// The asset becomes the scene's; on error it stays the task's.
static enum hg_status join_scene(const struct request *r, struct task *task, struct hg_error *err)
{
    const struct hgp_asset_load *m = &r->message->asset_load;
    struct hg_scene *scene = r->session->scene->scene;
    const bool has_parent = m->has_parent && m->parent;
    struct hg_object *parent = has_parent ? hg_scene_find(scene, HG_OBJECT_NODE, m->parent) : NULL;
    if (has_parent && !parent) // others may have removed it since
        return hg_error_set(err, HG_E_NOTFOUND, "asset_load", "parent", "no such node");
    enum hg_status status = m->has_variant ? hg_variant_find(task->asset, m->variant,
                                                 &task->asset->variants.chosen, err)
                                           : HG_OK;
    if (status)
        return status;
    if (m->has_transform)
        status = hg_asset_transform_roots(task->asset, m->transform);
    if (!status)
        status = hg_scene_add_asset(scene, task->asset, (struct hg_node *)parent);
    if (status)
        return hg_error_set(
            err, status, "asset_load", NULL, "cannot join the scene: %s", hg_status_text(status));
    task->asset = NULL;
    return HG_OK;
}

void hg_edit_asset_loaded(const struct request *r, struct task *task)
{
    struct hg_asset *asset = task->asset;
    struct hg_error err = task->err;
    if (task->status || join_scene(r, task, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    light_demo(r->session->scene, asset);
    hg_worker_session_edited(r->session);
    send_notices(r, asset);
    answer_loaded(r, asset);
}

void hg_handle_asset_unload(const struct request *r)
{
    struct hg_error err = {0};
    enum hg_status status =
        hg_scene_remove_asset(r->session->scene->scene, r->message->asset_unload.asset);
    if (status) {
        hg_error_set(
            &err, status, "asset_unload", "asset", "no asset %u", r->message->asset_unload.asset);
        hg_reply_error(r->to, &err);
        return;
    }
    hg_request_edited(r);
}

// ---- environment --------------------------------------------------------------------------------

static void apply_environment(const struct request *r, struct hg_environment_file *file)
{
    const struct hgp_environment_set *m = &r->message->environment_set;
    struct scene_slot *slot = r->session->scene;
    struct hg_environment *env = &slot->scene->environment;
    static const enum hg_environment_kind kinds[] = {
        [HGP_environment_kind_NONE] = HG_ENV_NONE,
        [HGP_environment_kind_COLOR] = HG_ENV_COLOR,
        [HGP_environment_kind_FILE] = HG_ENV_IMAGE,
        [HGP_environment_kind_SKY] = HG_ENV_SKY,
    };
    if (m->has_kind)
        env->automatic = m->kind == HGP_environment_kind_AUTO;
    if (m->has_kind && !env->automatic)
        env->kind = kinds[m->kind];
    if (m->has_color)
        memcpy(env->color, m->color, sizeof env->color);
    if (m->has_intensity)
        env->wanted_intensity = m->intensity;
    if (m->has_rotation_rad)
        env->rotation_rad = m->rotation_rad;
    if (m->has_sun_direction)
        memcpy(env->sun_direction, m->sun_direction, sizeof env->sun_direction);
    if (m->has_turbidity)
        env->turbidity = m->turbidity;
    if (m->has_sun)
        env->wanted_sun = m->sun ? HG_SKY_SUN_ON : HG_SKY_SUN_OFF;
    if (!env->automatic) {
        env->intensity = env->wanted_intensity;
        env->sun = env->wanted_sun;
        env->fills = false;
    }
    if (file)
        hg_environment_file_use(file, env);
    env->revision = slot->scene->revision + 1;
    hg_request_edited(r);
}

void hg_edit_environment_loaded(const struct request *r, struct task *task)
{
    if (task->status)
        hg_reply_error(r->to, &task->err);
    else
        apply_environment(r, &task->environment);
}

void hg_handle_environment_set(const struct request *r)
{
    const struct hgp_environment_set *m = &r->message->environment_set;
    const struct hg_environment *env = &r->session->scene->scene->environment;
    struct hg_error err = {0};
    bool file = m->has_hash || (m->has_path && m->path.size);
    if (m->has_kind && m->kind == HGP_environment_kind_FILE && !file && !env->image.pixels)
        hg_error_set(&err, HG_E_INVAL, "environment_set", "path",
            "a FILE environment needs a path or a hash");
    else if (m->has_sun_direction && m->sun_direction[0] == 0 && m->sun_direction[1] == 0 &&
             m->sun_direction[2] == 0)
        hg_error_set(&err, HG_E_INVAL, "environment_set", "sun_direction", "must not be zero");
    if (err.status)
        hg_reply_error(r->to, &err);
    else if (file)
        hg_request_start_task(r, TASK_ENVIRONMENT, HGP_T_environment_set);
    else
        apply_environment(r, NULL);
}

// ---- poses and variants -------------------------------------------------------------------------

static struct hg_asset *need_asset(const struct request *r, const char *message, uint32_t number)
{
    struct hg_asset *asset = hg_scene_find_asset(r->session->scene->scene, number);
    struct hg_error err = {0};
    if (!asset) {
        hg_error_set(&err, HG_E_NOTFOUND, message, "asset", "no asset %u", number);
        hg_reply_error(r->to, &err);
    }
    return asset;
}

void hg_handle_animation_set(const struct request *r)
{
    const struct hgp_animation_set *m = &r->message->animation_set;
    struct hg_asset *asset = need_asset(r, "animation_set", m->asset);
    if (!asset)
        return;
    struct hg_error err = {0};
    enum hg_status status = hg_asset_pose(asset, m->animation, m->time_s);
    if (status) {
        hg_error_set(&err, status, asset->label, "animation", "no animation %d", m->animation);
        hg_reply_error(r->to, &err);
        return;
    }
    r->session->scene->time_s = m->time_s;
    hg_request_edited(r);
}

void hg_handle_variant_set(const struct request *r)
{
    const struct hgp_variant_set *m = &r->message->variant_set;
    struct hg_asset *asset = need_asset(r, "variant_set", m->asset);
    if (!asset)
        return;
    struct hg_error err = {0};
    int32_t chosen;
    if (hg_variant_find(asset, m->variant, &chosen, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    asset->variants.chosen = chosen;
    for (uint32_t i = 0; i < asset->mesh_count; i++)
        hg_scene_touch(r->session->scene->scene, &asset->meshes[i]->head);
    hg_request_edited(r);
}
