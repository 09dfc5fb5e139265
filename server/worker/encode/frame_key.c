#include "server/worker/encode/frame_key.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/sha256.h"
#include "renderer/view_look.h"
#include "server/worker/view/view_params.h"

static void write_floats(struct hg_writer *w, const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        hg_write_f32(w, values[i]);
}

// A camera of the scene counts by its pose and lens, not by its number.
static void write_camera(
    struct hg_writer *w, const struct hg_scene *scene, const struct view_slot *v)
{
    const struct hg_node *node =
        v->settings.camera_node
            ? (const struct hg_node *)hg_scene_find(scene, HG_OBJECT_NODE, v->settings.camera_node)
            : NULL;
    hg_write_u8(w, node && node->camera);
    if (node && node->camera) {
        const struct hg_camera *c = node->camera;
        const float lens[] = {c->vfov_rad, c->half_height, c->near, c->far,
            v->settings.camera.lens_radius, v->settings.camera.focus_distance};
        write_floats(w, node->world, 16);
        hg_write_u32(w, (uint32_t)c->kind);
        write_floats(w, lens, 6);
        return;
    }
    const struct hg_view_camera *c = &v->settings.camera;
    const float lens[] = {
        c->vfov_rad, c->half_height, c->near, c->far, c->lens_radius, c->focus_distance};
    write_floats(w, c->eye, 3);
    write_floats(w, c->target, 3);
    write_floats(w, c->up, 3);
    hg_write_u8(w, c->moves);
    write_floats(w, c->next_eye, c->moves ? 3 : 0);
    write_floats(w, c->next_target, c->moves ? 3 : 0);
    write_floats(w, c->next_up, c->moves ? 3 : 0);
    hg_write_u8(w, c->orthographic);
    write_floats(w, lens, 6);
}

// Of a node and its ancestors.
static void write_transforms(struct hg_writer *w, const struct hg_node *node, uint32_t index)
{
    for (; node; node = node->parent) {
        if (!node->moves)
            continue;
        hg_write_u32(w, index);
        write_floats(w, node->world, 16);
        write_floats(w, node->translation, 3);
        write_floats(w, node->rotation, 4);
        write_floats(w, node->scale, 3);
        write_floats(w, node->next.translation, 3);
        write_floats(w, node->next.rotation, 4);
        write_floats(w, node->next.scale, 3);
    }
}

// Where things move to, if the picture depends on it.
static void write_motion(
    struct hg_writer *w, const struct hg_scene *scene, const struct hg_view_params *p)
{
    if (p->shutter_close <= p->shutter_open && !(p->planes >> HG_PLANE_MOTION & 1) &&
        p->denoise != HG_DENOISE_ANIMATION)
        return;
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++)
        write_transforms(w, (const struct hg_node *)nodes->items[i], i);
    for (uint32_t i = 0; i < scene->asset_count; i++)
        for (uint32_t k = 0; k < scene->assets[i]->animation_count; k++) {
            const struct hg_animation *a = &scene->assets[i]->animations[k];
            for (uint32_t c = 0; a->posed && c < a->channel_count; c++) {
                const struct hg_anim_channel *channel = &a->channels[c];
                const size_t width =
                    (size_t)channel->width * (channel->interpolation == HG_ANIM_CUBIC ? 3 : 1);
                hg_write_f64(w, a->time_s);
                hg_write_u64(w, channel->node ? channel->node->head.id : 0);
                hg_write_u32(w, (uint32_t)channel->path);
                hg_write_u32(w, (uint32_t)channel->interpolation);
                write_floats(w, channel->times, channel->key_count);
                write_floats(w, channel->values, width * channel->key_count);
            }
        }
}

// Number of a material in the scene's list, as the plane of materials has it.
struct material_rank {
    const struct hg_material *material;
    uint32_t number;
};

static int compare_ranks(const void *a, const void *b)
{
    const uintptr_t x = (uintptr_t)((const struct material_rank *)a)->material,
                    y = (uintptr_t)((const struct material_rank *)b)->material;
    return x < y ? -1 : x > y;
}

static struct material_rank *rank_materials(const struct hg_object_list *materials)
{
    struct material_rank *ranks = hg_calloc((size_t)materials->count + 1, sizeof *ranks);
    for (uint32_t i = 0; ranks && i < materials->count; i++)
        ranks[i] = (struct material_rank){(const struct hg_material *)materials->items[i], i + 1};
    if (ranks)
        qsort(ranks, materials->count, sizeof *ranks, compare_ranks);
    return ranks;
}

static void write_materials(struct hg_writer *w, const struct hg_node *node,
    const struct material_rank *ranks, uint32_t count)
{
    for (uint32_t i = 0; i < node->mesh->part_count; i++) {
        const struct hg_mesh_part *part = &node->mesh->parts[i];
        const struct material_rank key = {
            .material = node->asset ? hg_asset_part_material(node->asset, part) : part->material};
        const struct material_rank *rank = bsearch(&key, ranks, count, sizeof key, compare_ranks);
        hg_write_u32(w, rank ? rank->number : 0);
        hg_write_u32(w, rank ? (uint32_t)key.material->head.id : 0);
    }
}

// Ids of objects and names of files, which the fingerprint leaves out, where a plane shows them:
// mattes name objects that have no name by their ids.
static enum hg_status write_ids(
    struct hg_writer *w, const struct hg_scene *scene, const struct view_slot *v)
{
    const uint32_t planes = v->settings.params.planes, mattes = v->settings.params.mattes;
    const bool files = mattes >> HG_MATTE_ASSET & 1;
    const bool objects = (planes >> HG_PLANE_OBJECT & 1) || (mattes >> HG_MATTE_OBJECT & 1);
    const bool materials = (planes >> HG_PLANE_MATERIAL & 1) || (mattes >> HG_MATTE_MATERIAL & 1);
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    struct material_rank *ranks =
        materials ? rank_materials(&scene->objects[HG_OBJECT_MATERIAL]) : NULL;
    if (materials && !ranks)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < nodes->count && (files || objects || materials); i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        if (!node->world_visible || !node->mesh)
            continue;
        const char *label = node->asset ? node->asset->label : "";
        hg_write_bytes(w, label, files ? strlen(label) + 1 : 0);
        hg_write_u32(w, objects ? (uint32_t)node->head.id : 0);
        if (materials)
            write_materials(w, node, ranks, scene->objects[HG_OBJECT_MATERIAL].count);
    }
    hg_free(ranks);
    return HG_OK;
}

static enum hg_status hash_scene(struct scene_slot *slot, uint8_t hash[32], struct hg_error *err)
{
    if (!slot->fingerprint)
        slot->fingerprint = hg_fingerprint_create();
    if (!slot->fingerprint)
        return hg_error_set(err, HG_E_NOMEM, "job", NULL, "no memory");
    hg_scene_update(slot->scene);
    hg_scene_slot_light(slot);
    enum hg_status status = hg_fingerprint_scene(slot->fingerprint, slot->scene, hash, err);
    if (status)
        return status;
    memcpy(slot->hash, hash, sizeof slot->hash);
    return HG_OK;
}

static bool has_quality(enum hgp_encoding encoding)
{
    const struct encoder_ops *ops = hg_encoder_find(encoding);
    return encoding == HGP_encoding_JPEG ||
           (encoding > HGP_encoding_EXR_FLOAT && ops && !ops->lossless);
}

// The bytes that are hashed.
static enum hg_status write_key(struct hg_writer *w, const struct scene_slot *slot,
    const char *device, const struct view_slot *view, struct frame_format format)
{
    const struct view_settings *set = &view->settings;
    hg_write_bytes(w, HELIO_VERSION, sizeof HELIO_VERSION);
    hg_write_bytes(w, device, strlen(device) + 1);
    hg_write_bytes(w, slot->hash, sizeof slot->hash);
    hg_view_params_write_key(w, &set->params, view->frame_key.after);
    hg_write_u32(w, set->params.mattes);
    write_camera(w, slot->scene, view);
    write_motion(w, slot->scene, &set->params);
    enum hg_status status = write_ids(w, slot->scene, view);
    if (!status)
        status = hg_view_write_look(view->view, slot->scene, w);
    hg_write_u32(w, (uint32_t)format.encoding);
    hg_write_u8(w, has_quality(format.encoding) ? format.quality : 0);
    return status || !w->failed ? status : HG_E_NOMEM;
}

enum hg_status hg_frame_key_make(struct render_state *s, struct session *session,
    const struct view_slot *view, struct frame_format format, uint8_t key[32], struct hg_error *err)
{
    struct scene_slot *slot = session->scene;
    const char *device = hg_render_state_device_name(s);
    uint8_t scene[32];
    struct hg_writer w = {0};
    memset(key, 0, 32);
    enum hg_status status = hash_scene(slot, scene, err);
    if (status)
        return status;
    status = write_key(&w, slot, device, view, format);
    if (!status)
        status = hg_sha256(w.data, w.size, key);
    hg_writer_finish(&w);
    return status ? hg_error_set(err, status, "job", NULL, "no memory") : HG_OK;
}

struct frame_format hg_frame_key_format(const struct view_slot *view)
{
    return view->frame_key.asked
               ? (struct frame_format){view->frame_key.encoding, view->frame_key.quality}
               : (struct frame_format){
                     view->subscription.still_encoding, view->subscription.quality};
}
