#include "server/worker/edit/edit_object.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/light_table.h"

static struct hg_scene *scene_of(const struct request *r)
{
    return r->session->scene->scene;
}

// Finds the object, or makes it when its id lies in the session's range. NULL after failing.
struct hg_object *hg_edit_find_or_make(
    const struct request *r, enum hg_object_kind kind, uint64_t id, const char *message)
{
    struct hg_object *object = hg_scene_find(scene_of(r), kind, id);
    if (object)
        return object;
    struct hg_error err = {0};
    enum hg_status status = HG_OK;
    uint64_t first = r->session->first_id;
    if (id < first || id - first >= r->session->id_count)
        status = hg_error_set(&err, HG_E_NOTFOUND, message, NULL,
            "no object %llu, and new ones take ids %llu to %llu", (unsigned long long)id,
            (unsigned long long)first, (unsigned long long)(first + r->session->id_count - 1));
    if (!status) {
        status = hg_scene_add(scene_of(r), kind, id, &object);
        if (status)
            hg_error_set(
                &err, status, message, NULL, "cannot make the object: %s", hg_status_text(status));
    }
    if (status)
        hg_reply_error(r->to, &err);
    return status ? NULL : object;
}

// Takes back what hg_edit_find_or_make made for an edit that is refused after all.
static void unmake(
    const struct request *r, enum hg_object_kind kind, struct hg_object *object, bool was_there)
{
    struct hg_error err = {0};
    if (!was_there && hg_scene_remove(scene_of(r), kind, object->id, &err))
        hg_fault(WORKER, err.status, "%s", err.reason);
}

static bool rename_object(const struct request *r, struct hg_object *object, struct hgp_str name)
{
    char *copy = hg_strndup(name.data ? name.data : "", name.size);
    struct hg_error err = {0};
    if (!copy) {
        hg_error_set(&err, HG_E_NOMEM, "name", NULL, "no memory");
        hg_reply_error(r->to, &err);
        return false;
    }
    hg_free(object->name);
    object->name = copy;
    return true;
}

// Looks up a referenced object; id 0 is none. False after failing.
static bool resolve(const struct request *r, enum hg_object_kind kind, uint64_t id,
    const char *field, struct hg_object **out)
{
    *out = id ? hg_scene_find(scene_of(r), kind, id) : NULL;
    if (!id || *out)
        return true;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_NOTFOUND, "edit", field, "no object %llu", (unsigned long long)id);
    hg_reply_error(r->to, &err);
    return false;
}

static void finish_edit(const struct request *r, struct hg_object *object)
{
    hg_scene_touch(scene_of(r), object);
    hg_request_edited(r);
}

// ---- textures -----------------------------------------------------------------------------------

static enum hg_status fill_pixels(
    const struct hgp_texture_set *m, struct hg_image_source *source, struct hg_error *err)
{
    if (m->format == HGP_pixel_format_FILE) {
        struct hg_image_info info;
        enum hg_status status = hg_image_probe_memory(
            &(struct hg_image_bytes){m->pixels.data, m->pixels.size, "texture_set"}, &info, err);
        source->encoded = status ? NULL : hg_refbuf_create_spilled(m->pixels.size);
        if (!status && !source->encoded)
            status = hg_error_set(err, HG_E_NOMEM, "texture_set", "pixels", "no memory");
        if (!status)
            memcpy(source->encoded->data, m->pixels.data, m->pixels.size);
        return status;
    }
    bool is_float = m->format == HGP_pixel_format_RGBA32F;
    enum hg_status status = hg_image_create(
        m->width, m->height, is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8, NULL, &source->pixels);
    if (status)
        return hg_error_set(
            err, status, "texture_set", "width", "%u x %u px cannot be held", m->width, m->height);
    if (source->pixels.size_bytes != m->pixels.size)
        return hg_error_set(err, HG_E_INVAL, "texture_set", "pixels", "%u bytes where %zu belong",
            m->pixels.size, source->pixels.size_bytes);
    memcpy(source->pixels.pixels, m->pixels.data, m->pixels.size);
    source->pixels.has_alpha = true;
    source->pixels_srgb = m->format == HGP_pixel_format_RGBA8_SRGB;
    return HG_OK;
}

// Lights have images of their own, made of textures.
static void remake_light_images(const struct request *r, struct hg_texture *texture)
{
    const struct hg_object_list *lights = &scene_of(r)->objects[HG_OBJECT_LIGHT];
    for (uint32_t i = 0; i < lights->count; i++) {
        struct hg_light *light = (struct hg_light *)lights->items[i];
        struct hg_error err = {0};
        if (light->texture != texture)
            continue;
        if (hg_light_set_texture(light, texture, &err))
            hg_warn(SCENE, "a light keeps its old image: %s", err.reason);
        hg_scene_touch(scene_of(r), &light->head);
    }
}

void hg_handle_texture_set(const struct request *r)
{
    const struct hgp_texture_set *m = &r->message->texture_set;
    struct hg_error err = {0};
    struct hg_image_source *source = hg_image_source_create("texture_set");
    enum hg_status status = source
                                ? fill_pixels(m, source, &err)
                                : hg_error_set(&err, HG_E_NOMEM, "texture_set", NULL, "no memory");
    struct hg_object *object = NULL;
    if (status)
        hg_reply_error(r->to, &err);
    else
        object = hg_edit_find_or_make(r, HG_OBJECT_TEXTURE, m->texture, "texture_set");
    if (!object) {
        hg_image_source_unref(source);
        return;
    }
    struct hg_texture *texture = (struct hg_texture *)object;
    hg_image_source_unref(texture->image);
    texture->image = source;
    texture->wrap_s = (enum hg_wrap)m->wrap_s;
    texture->wrap_t = (enum hg_wrap)m->wrap_t;
    texture->mag_nearest = texture->min_nearest = m->nearest;
    remake_light_images(r, texture);
    finish_edit(r, object);
}

// ---- materials ----------------------------------------------------------------------------------

static bool set_slot(const struct request *r, struct hg_material *material,
    enum hg_texture_slot slot, bool has, uint64_t id)
{
    struct hg_object *texture = NULL;
    if (!has)
        return true;
    if (!resolve(r, HG_OBJECT_TEXTURE, id, "texture", &texture))
        return false;
    material->slots[slot].texture = (struct hg_texture *)texture;
    return true;
}

static bool set_slots(const struct request *r, struct hg_material *material)
{
    const struct hgp_material_set *m = &r->message->material_set;
    return set_slot(
               r, material, HG_SLOT_BASE_COLOR, m->has_base_color_texture, m->base_color_texture) &&
           set_slot(r, material, HG_SLOT_METALLIC_ROUGHNESS, m->has_metallic_roughness_texture,
               m->metallic_roughness_texture) &&
           set_slot(r, material, HG_SLOT_NORMAL, m->has_normal_texture, m->normal_texture) &&
           set_slot(
               r, material, HG_SLOT_OCCLUSION, m->has_occlusion_texture, m->occlusion_texture) &&
           set_slot(r, material, HG_SLOT_EMISSIVE, m->has_emissive_texture, m->emissive_texture);
}

static void set_factors(struct hg_material *material, const struct hgp_material_set *m)
{
    if (m->has_base_color)
        memcpy(material->base_color, m->base_color, sizeof material->base_color);
    if (m->has_metallic)
        material->metallic = m->metallic;
    if (m->has_roughness)
        material->roughness = m->roughness;
    float strength = m->has_emissive_strength ? m->emissive_strength : 1;
    for (int i = 0; i < 3 && m->has_emissive; i++)
        material->emissive[i] = m->emissive[i] * strength;
    if (m->has_normal_scale)
        material->normal_scale = m->normal_scale;
    if (m->has_occlusion_strength)
        material->occlusion_strength = m->occlusion_strength;
    if (m->has_alpha_mode)
        material->alpha_mode = (enum hg_alpha_mode)m->alpha_mode;
    if (m->has_alpha_cutoff)
        material->alpha_cutoff = m->alpha_cutoff;
    if (m->has_double_sided)
        material->double_sided = m->double_sided;
    if (m->has_unlit)
        material->unlit = m->unlit;
}

void hg_handle_material_set(const struct request *r)
{
    const struct hgp_material_set *m = &r->message->material_set;
    if (m->has_emissive_strength && !m->has_emissive) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_INVAL, "material_set", "emissive_strength", "goes with emissive");
        hg_reply_error(r->to, &err);
        return;
    }
    bool was_there = hg_scene_find(scene_of(r), HG_OBJECT_MATERIAL, m->material) != NULL;
    struct hg_object *object =
        hg_edit_find_or_make(r, HG_OBJECT_MATERIAL, m->material, "material_set");
    if (!object)
        return;
    struct hg_material changed = *(struct hg_material *)object;
    if (!set_slots(r, &changed)) {
        unmake(r, HG_OBJECT_MATERIAL, object, was_there);
        return;
    }
    set_factors(&changed, m);
    *(struct hg_material *)object = changed;
    if (!m->has_name || rename_object(r, object, m->name))
        finish_edit(r, object);
}

// ---- nodes --------------------------------------------------------------------------------------

// All checks come before the first change.
struct node_refs {
    struct hg_object *parent, *mesh, *light, *camera;
};

static bool resolve_node(
    const struct request *r, const struct hgp_node_set *m, struct node_refs *refs)
{
    return resolve(r, HG_OBJECT_NODE, m->has_parent ? m->parent : 0, "parent", &refs->parent) &&
           resolve(r, HG_OBJECT_MESH, m->has_mesh ? m->mesh : 0, "mesh", &refs->mesh) &&
           resolve(r, HG_OBJECT_LIGHT, m->has_light ? m->light : 0, "light", &refs->light) &&
           resolve(r, HG_OBJECT_CAMERA, m->has_camera ? m->camera : 0, "camera", &refs->camera);
}

static void set_rotation(float out[4], const float in[4])
{
    const float length = sqrtf(in[0] * in[0] + in[1] * in[1] + in[2] * in[2] + in[3] * in[3]);
    for (int i = 0; i < 4; i++)
        out[i] = in[i] / length;
}

static void set_transform(struct hg_node *node, const struct hgp_node_set *m)
{
    if (m->has_translation)
        memcpy(node->translation, m->translation, sizeof node->translation);
    if (m->has_scale)
        memcpy(node->scale, m->scale, sizeof node->scale);
    if (m->has_rotation)
        set_rotation(node->rotation, m->rotation);
    if (m->has_translation || m->has_scale || m->has_rotation)
        node->has_matrix = node->moves = false;
}

static bool has_next(const struct hgp_node_set *m)
{
    return m->has_next_translation || m->has_next_rotation || m->has_next_scale;
}

// After set_transform. A transform without it ends it, so that a journal that keeps only the newest
// of each field comes to the same.
static void set_next(struct hg_node *node, const struct hgp_node_set *m)
{
    if (!has_next(m))
        return;
    if (!node->moves) {
        memcpy(node->next.translation, node->translation, sizeof node->next.translation);
        memcpy(node->next.rotation, node->rotation, sizeof node->next.rotation);
        memcpy(node->next.scale, node->scale, sizeof node->next.scale);
    }
    if (m->has_next_translation)
        memcpy(node->next.translation, m->next_translation, sizeof node->next.translation);
    if (m->has_next_rotation)
        set_rotation(node->next.rotation, m->next_rotation);
    if (m->has_next_scale)
        memcpy(node->next.scale, m->next_scale, sizeof node->next.scale);
    node->moves = true;
}

static void set_contents(
    struct hg_node *node, const struct hgp_node_set *m, const struct node_refs *refs)
{
    if (m->has_visible)
        node->visible = m->visible;
    if (m->has_layers)
        node->layers = m->layers;
    if (m->has_catches_shadows)
        node->catches_shadows = m->catches_shadows;
    if (m->has_mesh && node->mesh != (struct hg_mesh *)refs->mesh) {
        node->mesh = (struct hg_mesh *)refs->mesh;
        hg_free(node->weights); // they belonged to the old mesh
        node->weights = NULL;
    }
    if (m->has_light)
        node->light = (struct hg_light *)refs->light;
    if (m->has_camera)
        node->camera = (struct hg_camera *)refs->camera;
}

static bool rotation_is_valid(
    const struct request *r, bool has, const float rotation[4], const char *field)
{
    float sum = 0;
    for (int i = 0; i < 4; i++)
        sum += rotation[i] * rotation[i];
    if (!has || (sum > 1e-12f && isfinite(sum)))
        return true;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_INVAL, "node_set", field, "a quaternion must not be zero");
    hg_reply_error(r->to, &err);
    return false;
}

// A matrix cannot be interpolated as translation, rotation and scale.
static bool can_go_on(
    const struct request *r, const struct hg_node *node, const struct hgp_node_set *m)
{
    if (!node->has_matrix || m->has_translation || m->has_rotation || m->has_scale || !has_next(m))
        return true;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_STATE, "node_set", "next",
        "the node has a matrix in its file: set its "
        "translation, rotation and scale, too");
    hg_reply_error(r->to, &err);
    return false;
}

void hg_handle_node_set(const struct request *r)
{
    const struct hgp_node_set *m = &r->message->node_set;
    struct node_refs refs;
    if (!rotation_is_valid(r, m->has_rotation, m->rotation, "rotation") ||
        !rotation_is_valid(r, m->has_next_rotation, m->next_rotation, "next_rotation") ||
        !resolve_node(r, m, &refs))
        return;
    struct hg_object *object = hg_edit_find_or_make(r, HG_OBJECT_NODE, m->node, "node_set");
    if (!object)
        return;
    struct hg_node *node = (struct hg_node *)object;
    struct hg_error err = {0};
    if (!can_go_on(r, node, m))
        return;
    if (m->has_parent && hg_scene_set_parent(scene_of(r), node, (struct hg_node *)refs.parent)) {
        hg_error_set(&err, HG_E_INVAL, "node_set", "parent", "would make a cycle");
        hg_reply_error(r->to, &err);
        return;
    }
    set_transform(node, m);
    set_next(node, m);
    set_contents(node, m, &refs);
    if (!m->has_name || rename_object(r, object, m->name))
        finish_edit(r, object);
}

// ---- lights and cameras -------------------------------------------------------------------------

static void set_light_shape(struct hg_light *light, const struct hgp_light_set *m)
{
    static const int kinds[] = {
        [HGP_light_kind_DIRECTIONAL] = HG_LIGHT_DIRECTIONAL,
        [HGP_light_kind_POINT] = HG_LIGHT_POINT,
        [HGP_light_kind_SPOT] = HG_LIGHT_SPOT,
        [HGP_light_kind_RECTANGLE] = HG_LIGHT_RECTANGLE,
        [HGP_light_kind_DISC] = HG_LIGHT_DISC,
        [HGP_light_kind_TUBE] = HG_LIGHT_TUBE,
    };
    if (m->has_kind)
        light->kind = kinds[m->kind];
    if (m->has_radius)
        light->radius = m->radius;
    if (m->has_width)
        light->width = m->width;
    if (m->has_height)
        light->height = m->height;
    if (m->has_angular_diameter_rad)
        light->angular_diameter_rad = m->angular_diameter_rad;
}

// What lights have of their own memory: made first, so that nothing is changed when that fails.
struct light_parts {
    struct hg_light_table *profile;
    struct hg_object *texture;
};

static enum hg_status make_profile(
    const struct hgp_light_set *m, struct light_parts *parts, struct hg_error *err)
{
    return m->has_profile && m->profile.size ? hg_light_profile_read_ies("profile", m->profile.data,
                                                   m->profile.size, &parts->profile, err)
                                             : HG_OK;
}

static enum hg_status set_light_parts(struct hg_light *light, const struct hgp_light_set *m,
    struct light_parts *parts, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (m->has_texture)
        status = hg_light_set_texture(light, (struct hg_texture *)parts->texture, err);
    if (status)
        return status;
    if (m->has_profile) {
        hg_light_table_unref(light->profile);
        light->profile = parts->profile;
        parts->profile = NULL;
    }
    if (m->has_profile_absolute)
        light->absolute = m->profile_absolute;
    if (m->has_intensity)
        light->lumens = 0;
    if (m->has_lumens)
        light->lumens = m->lumens;
    return HG_OK;
}

static void change_light(
    const struct request *r, const struct hgp_light_set *m, struct light_parts *parts)
{
    bool was_there = hg_scene_find(scene_of(r), HG_OBJECT_LIGHT, m->light) != NULL;
    struct hg_object *object = hg_edit_find_or_make(r, HG_OBJECT_LIGHT, m->light, "light_set");
    if (!object)
        return;
    struct hg_light *light = (struct hg_light *)object;
    float inner = m->has_inner_cone_rad ? m->inner_cone_rad : light->inner_cone_rad;
    float outer = m->has_outer_cone_rad ? m->outer_cone_rad : light->outer_cone_rad;
    if ((m->has_inner_cone_rad || m->has_outer_cone_rad) && inner >= outer) {
        struct hg_error err = {0};
        hg_error_set(
            &err, HG_E_INVAL, "light_set", "inner_cone_rad", "must be less than outer_cone_rad");
        hg_reply_error(r->to, &err);
        unmake(r, HG_OBJECT_LIGHT, object, was_there);
        return;
    }
    struct hg_light shaped = *light;
    set_light_shape(&shaped, m);
    const char *missing;
    if (!hg_light_has_size(&shaped, &missing)) {
        struct hg_error err = {0};
        hg_error_set(
            &err, HG_E_INVAL, "light_set", missing, "must be above 0 for lights of this kind");
        hg_reply_error(r->to, &err);
        unmake(r, HG_OBJECT_LIGHT, object, was_there);
        return;
    }
    struct hg_error err = {0};
    if (set_light_parts(light, m, parts, &err)) {
        hg_reply_error(r->to, &err);
        unmake(r, HG_OBJECT_LIGHT, object, was_there);
        return;
    }
    set_light_shape(light, m);
    if (m->has_color)
        memcpy(light->color, m->color, sizeof light->color);
    if (m->has_intensity)
        light->intensity = m->intensity;
    if (m->has_range)
        light->range = m->range;
    if (m->has_casts_shadow)
        light->casts_shadow = m->casts_shadow;
    light->inner_cone_rad = inner;
    light->outer_cone_rad = outer;
    finish_edit(r, object);
}

void hg_handle_light_set(const struct request *r)
{
    const struct hgp_light_set *m = &r->message->light_set;
    struct light_parts parts = {0};
    struct hg_error err = {0};
    if (m->has_texture && m->texture &&
        !resolve(r, HG_OBJECT_TEXTURE, m->texture, "texture", &parts.texture))
        return;
    if (make_profile(m, &parts, &err))
        hg_reply_error(r->to, &err);
    else
        change_light(r, m, &parts);
    hg_light_table_unref(parts.profile);
}

void hg_handle_camera_set(const struct request *r)
{
    const struct hgp_camera_set *m = &r->message->camera_set;
    struct hg_object *object = hg_edit_find_or_make(r, HG_OBJECT_CAMERA, m->camera, "camera_set");
    if (!object)
        return;
    struct hg_camera *camera = (struct hg_camera *)object;
    if (m->has_kind)
        camera->kind = m->kind == HGP_camera_kind_ORTHOGRAPHIC ? HG_CAMERA_ORTHOGRAPHIC
                                                               : HG_CAMERA_PERSPECTIVE;
    if (m->has_vfov_rad)
        camera->vfov_rad = m->vfov_rad;
    if (m->has_half_height)
        camera->half_height = m->half_height;
    if (m->has_near)
        camera->near = m->near;
    if (m->has_far)
        camera->far = m->far;
    finish_edit(r, object);
}

void hg_handle_object_remove(const struct request *r)
{
    const struct hgp_object_remove *m = &r->message->object_remove;
    struct hg_error err = {0};
    if (hg_scene_remove(scene_of(r), (enum hg_object_kind)m->kind, m->object, &err))
        hg_reply_error(r->to, &err);
    else
        hg_request_edited(r);
}

// ---- batches ------------------------------------------------------------------------------------

void hg_handle_batch_begin(const struct request *r)
{
    struct hg_error err = {0};
    if (r->session->batch_depth) {
        hg_error_set(&err, HG_E_STATE, "batch_begin", NULL, "a batch is open already");
        hg_reply_error(r->to, &err);
        return;
    }
    r->session->batch_depth = 1;
    if (r->session->scene->open_batches++ == 0)
        r->session->scene->batch_started_ns = hg_clock_now_ns();
    // A batch that a dead worker left open: its edits came with the replay.
    r->session->scene->dirty |= r->session->restoring;
    hg_request_ok(r);
}

void hg_handle_batch_end(const struct request *r)
{
    struct hg_error err = {0};
    if (!r->session->batch_depth) {
        hg_error_set(&err, HG_E_STATE, "batch_end", NULL, "no batch is open");
        hg_reply_error(r->to, &err);
        return;
    }
    hg_worker_session_close_batch(r->session);
    hg_request_ok(r);
}
