// film.c - what a view's frames are made from, what goes with them, and films kept for later.
#include "server/worker/film.h"
#include "server/worker/view_params.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/sha256.h"
#include "renderer/image/zstd.h"
#include "renderer/scene/fingerprint.h"

#define FILM_LIMIT_BYTES (UINT64_C(16) << 30) // of a checkpoint when unpacked

enum {
    ANSWER_LIMIT_BYTES = 320 << 20,
    PART_BYTES = 256 << 10, // of what is sent in parts
};

// ---- planes ------------------------------------------------------------------------------------

enum hg_status film_planes(uint32_t bits, uint32_t *planes, uint32_t *mattes, struct hg_error *err)
{
    static const uint8_t known[] = {
        [HGP_plane_ALBEDO] = HG_PLANE_ALBEDO,
        [HGP_plane_NORMAL] = HG_PLANE_NORMAL,
        [HGP_plane_GEOMETRIC_NORMAL] = HG_PLANE_GEOMETRIC_NORMAL,
        [HGP_plane_DEPTH] = HG_PLANE_DEPTH,
        [HGP_plane_POSITION] = HG_PLANE_POSITION,
        [HGP_plane_EMISSION] = HG_PLANE_EMISSION,
        [HGP_plane_DIRECT_DIFFUSE] = HG_PLANE_DIRECT_DIFFUSE,
        [HGP_plane_DIRECT_SPECULAR] = HG_PLANE_DIRECT_SPECULAR,
        [HGP_plane_DIRECT_TRANSMISSION] = HG_PLANE_DIRECT_TRANSMISSION,
        [HGP_plane_INDIRECT_DIFFUSE] = HG_PLANE_INDIRECT_DIFFUSE,
        [HGP_plane_INDIRECT_SPECULAR] = HG_PLANE_INDIRECT_SPECULAR,
        [HGP_plane_INDIRECT_TRANSMISSION] = HG_PLANE_INDIRECT_TRANSMISSION,
        [HGP_plane_MOTION] = HG_PLANE_MOTION,
        [HGP_plane_OBJECT] = HG_PLANE_OBJECT,
        [HGP_plane_MATERIAL] = HG_PLANE_MATERIAL,
        [HGP_plane_SAMPLES] = HG_PLANE_SAMPLES,
        [HGP_plane_VARIANCE] = HG_PLANE_VARIANCE,
        [HGP_plane_LIGHT_GROUPS] = HG_PLANE_LIGHT_GROUPS,
        [HGP_plane_CRYPTO_OBJECT] = HG_PLANE_DRAWS,
        [HGP_plane_CRYPTO_MATERIAL] = HG_PLANE_DRAWS,
        [HGP_plane_CRYPTO_ASSET] = HG_PLANE_DRAWS,
        [HGP_plane_NOISY] = HG_PLANE_NOISY,
    };
    uint32_t found = 0;
    for (uint32_t i = 1; i < 32; i++) {
        if (!(bits >> i & 1))
            continue;
        if (i >= sizeof known || !known[i]) {
            const char *name = hgp_enum_name("plane", i);
            return hg_error_set(err, HG_E_UNSUPPORTED, "view_set", "planes",
                "%s is not kept by this renderer", name ? name : "?");
        }
        found |= 1u << known[i];
    }
    *planes = found;
    *mattes = (bits >> HGP_plane_CRYPTO_OBJECT & 1) << HG_MATTE_OBJECT |
              (bits >> HGP_plane_CRYPTO_MATERIAL & 1) << HG_MATTE_MATERIAL |
              (bits >> HGP_plane_CRYPTO_ASSET & 1) << HG_MATTE_ASSET;
    return HG_OK;
}

// ---- jobs --------------------------------------------------------------------------------------

static const char *device_name(struct render_state *s)
{
    char *text = NULL;
    if (s->device[0] || !s->renderer || hg_renderer_device_json(s->renderer, &text))
        return s->device;
    json_t *root = json_loads(text, 0, NULL);
    const char *name = json_string_value(json_object_get(root, "name"));
    if (!name)
        name = json_string_value(json_object_get(json_object_get(root, "device"), "name"));
    snprintf(s->device, sizeof s->device, "%s", name ? name : "unknown");
    json_decref(root);
    hg_free(text);
    return s->device;
}

static void put_floats(struct hg_writer *w, const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        hg_write_f32(w, values[i]);
}

// A camera of the scene counts by its pose and lens, not by its number.
static void put_camera(struct hg_writer *w, const struct hg_scene *scene, const struct view_slot *v)
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
        put_floats(w, node->world, 16);
        hg_write_u32(w, (uint32_t)c->kind);
        put_floats(w, lens, 6);
        return;
    }
    const struct hg_view_camera *c = &v->settings.camera;
    const float lens[] = {
        c->vfov_rad, c->half_height, c->near, c->far, c->lens_radius, c->focus_distance};
    put_floats(w, c->eye, 3);
    put_floats(w, c->target, 3);
    put_floats(w, c->up, 3);
    hg_write_u8(w, c->moves);
    put_floats(w, c->next_eye, c->moves ? 3 : 0);
    put_floats(w, c->next_target, c->moves ? 3 : 0);
    put_floats(w, c->next_up, c->moves ? 3 : 0);
    hg_write_u8(w, c->orthographic);
    put_floats(w, lens, 6);
}

// Of a node and all above it.
static void put_ways(struct hg_writer *w, const struct hg_node *node, uint32_t index)
{
    for (; node; node = node->parent) {
        if (!node->moves)
            continue;
        hg_write_u32(w, index);
        put_floats(w, node->world, 16);
        put_floats(w, node->translation, 3);
        put_floats(w, node->rotation, 4);
        put_floats(w, node->scale, 3);
        put_floats(w, node->next_translation, 3);
        put_floats(w, node->next_rotation, 4);
        put_floats(w, node->next_scale, 3);
    }
}

// What other times show, where the picture depends on them.
static void put_motion(
    struct hg_writer *w, const struct hg_scene *scene, const struct hg_view_params *p)
{
    if (p->shutter_close <= p->shutter_open && !(p->planes >> HG_PLANE_MOTION & 1) &&
        p->denoise != HG_DENOISE_ANIMATION)
        return;
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++)
        put_ways(w, (const struct hg_node *)nodes->items[i], i);
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
                put_floats(w, channel->times, channel->key_count);
                put_floats(w, channel->values, width * channel->key_count);
            }
        }
}

// Where a material stands among all, as its plane has it.
struct place {
    const struct hg_material *material;
    uint32_t number;
};

static int compare_places(const void *a, const void *b)
{
    const uintptr_t x = (uintptr_t)((const struct place *)a)->material,
                    y = (uintptr_t)((const struct place *)b)->material;
    return x < y ? -1 : x > y;
}

static struct place *list_places(const struct hg_object_list *materials)
{
    struct place *places = hg_calloc((size_t)materials->count + 1, sizeof *places);
    for (uint32_t i = 0; places && i < materials->count; i++)
        places[i] = (struct place){(const struct hg_material *)materials->items[i], i + 1};
    if (places)
        qsort(places, materials->count, sizeof *places, compare_places);
    return places;
}

static void put_materials(
    struct hg_writer *w, const struct hg_node *node, const struct place *places, uint32_t count)
{
    for (uint32_t i = 0; i < node->mesh->part_count; i++) {
        const struct hg_mesh_part *part = &node->mesh->parts[i];
        const struct place key = {
            .material = node->asset ? hg_asset_part_material(node->asset, part) : part->material};
        const struct place *place = bsearch(&key, places, count, sizeof key, compare_places);
        hg_write_u32(w, place ? place->number : 0);
        hg_write_u32(w, place ? (uint32_t)key.material->head.id : 0);
    }
}

// Numbers of objects and names of files, which the fingerprint leaves out, where a plane has them:
// the mattes' names of objects that have none are made of numbers.
static enum hg_status put_numbers(
    struct hg_writer *w, const struct hg_scene *scene, const struct view_slot *v)
{
    const uint32_t planes = v->settings.params.planes, mattes = v->settings.mattes;
    const bool files = mattes >> HG_MATTE_ASSET & 1;
    const bool objects = (planes >> HG_PLANE_OBJECT & 1) || (mattes >> HG_MATTE_OBJECT & 1);
    const bool materials = (planes >> HG_PLANE_MATERIAL & 1) || (mattes >> HG_MATTE_MATERIAL & 1);
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    struct place *places = materials ? list_places(&scene->objects[HG_OBJECT_MATERIAL]) : NULL;
    if (materials && !places)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < nodes->count && (files || objects || materials); i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        if (!node->world_visible || !node->mesh)
            continue;
        const char *label = node->asset ? node->asset->label : "";
        hg_write_bytes(w, label, files ? strlen(label) + 1 : 0);
        hg_write_u32(w, objects ? (uint32_t)node->head.id : 0);
        if (materials)
            put_materials(w, node, places, scene->objects[HG_OBJECT_MATERIAL].count);
    }
    hg_free(places);
    return HG_OK;
}

enum hg_status film_job(struct render_state *s, struct session *session, struct view_slot *view,
    enum hgp_encoding encoding, uint8_t quality, uint8_t hash[32], struct hg_error *err)
{
    struct scene_slot *slot = session->scene;
    const char *device = device_name(s);
    uint8_t scene[32];
    memset(hash, 0, 32);
    if (!slot->fingerprint)
        slot->fingerprint = hg_fingerprint_create();
    if (!slot->fingerprint)
        return hg_error_set(err, HG_E_NOMEM, "job", NULL, "no memory");
    hg_scene_update(slot->scene);
    enum hg_status status = hg_fingerprint_scene(slot->fingerprint, slot->scene, scene, err);
    if (status)
        return status;
    memcpy(slot->hash, scene, sizeof scene);
    struct hg_writer w = {0};
    hg_write_bytes(&w, HELIO_VERSION, sizeof HELIO_VERSION);
    hg_write_bytes(&w, device, strlen(device) + 1);
    hg_write_bytes(&w, scene, sizeof scene);
    hg_view_params_write_key(&w, &view->settings.params, view->frame_key.after);
    hg_write_u32(&w, view->settings.mattes);
    put_camera(&w, slot->scene, view);
    put_motion(&w, slot->scene, &view->settings.params);
    status = put_numbers(&w, slot->scene, view);
    hg_write_u32(&w, (uint32_t)encoding);
    hg_write_u8(&w, encoding == HGP_encoding_JPEG ? quality : 0);
    if (!status)
        status = w.failed ? HG_E_NOMEM : hg_sha256(w.data, w.size, hash);
    hg_writer_finish(&w);
    return status ? hg_error_set(err, status, "job", NULL, "no memory") : HG_OK;
}

void hg_handle_job_query(const struct request *r)
{
    const struct hgp_job_query *m = &r->message->job_query;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hgp_job answer = {.scene_revision = r->session->scene->scene->revision};
    struct hg_error err = {0};
    if (!view)
        return;
    view->frame_key.encoding = m->has_encoding ? m->encoding : view->subscription.still_encoding;
    view->frame_key.quality = m->has_quality ? m->quality : view->subscription.quality;
    memset(view->frame_key.after, 0, sizeof view->frame_key.after);
    if (m->has_after)
        memcpy(view->frame_key.after, m->after, sizeof view->frame_key.after);
    if (film_job(r->s, r->session, view, view->frame_key.encoding, view->frame_key.quality,
            answer.hash, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    view->frame_key.asked = true;
    hg_reply_send(r->to, HGP_T_job, &answer);
}

// ---- what goes with a frame --------------------------------------------------------------------

static enum hg_status read_groups(
    struct view_slot *view, struct encode_request *job, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    const uint32_t count = hg_view_light_groups(view->view);
    for (uint32_t i = 0; !status && i < count && job->plane_count < ENCODE_MAX_PLANES; i++) {
        struct encode_plane *p = &job->planes[job->plane_count];
        p->plane = HG_PLANE_LIGHT_GROUPS;
        snprintf(p->name, sizeof p->name, "light_%s", hg_view_light_group_name(view->view, i));
        status = hg_view_read_light_group(view->view, i, &p->values, err);
        job->plane_count += !status;
    }
    return status;
}

static enum hg_status read_planes(
    struct view_slot *view, struct encode_request *job, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; !status && i < HG_PLANE_COUNT; i++) {
        if (!(view->settings.params.planes >> i & 1) || i == HG_PLANE_COLOR || i == HG_PLANE_DRAWS)
            continue;
        if (i == HG_PLANE_LIGHT_GROUPS) {
            status = read_groups(view, job, err);
            continue;
        }
        struct encode_plane *p = &job->planes[job->plane_count];
        p->plane = (enum hg_plane)i;
        status = hg_view_read_plane(view->view, p->plane, &p->values, err);
        job->plane_count += !status;
    }
    for (uint32_t i = 0; !status && i < ENCODE_MATTES; i++)
        if (view->settings.mattes >> i & 1)
            status = hg_view_read_matte(view->view, (enum hg_matte_kind)i, &job->mattes[i], err);
    return status;
}

// A focus of 0 is that of the target.
static void note_lens(const struct hg_view_camera *c, struct encode_notes *notes)
{
    double way = 0;
    for (int i = 0; i < 3; i++)
        way = hypot(way, (double)c->target[i] - (double)c->eye[i]);
    notes->lens_radius = c->lens_radius;
    notes->focus_distance = c->focus_distance > 0 ? c->focus_distance : (float)way;
}

enum hg_status film_attach(struct render_state *s, struct session *session, struct view_slot *view,
    struct encode_request *job, struct hg_error *err)
{
    struct encode_notes *notes = &job->notes;
    struct hgp_frame *frame = &job->frame;
    enum hg_status status = HG_OK;
    if (frame->settled && view->frame_key.asked) {
        status = film_job(s, session, view, frame->encoding, job->quality, frame->job, err);
        frame->has_job = !status;
        if (!status)
            hg_sha256_hex(frame->job, notes->job);
        if (!status)
            hg_sha256_hex(session->scene->hash, notes->scene);
    }
    if (status ||
        (frame->encoding != HGP_encoding_EXR_HALF && frame->encoding != HGP_encoding_EXR_FLOAT))
        return status;
    struct hg_view_matrices matrices;
    hg_view_matrices(view->view, &matrices);
    memcpy(notes->world_to_camera, matrices.world_to_camera, sizeof notes->world_to_camera);
    memcpy(notes->world_to_ndc, matrices.world_to_ndc, sizeof notes->world_to_ndc);
    snprintf(notes->device, sizeof notes->device, "%s", device_name(s));
    notes->params = view->settings.params;
    notes->time_s = session->scene->time_s;
    note_lens(&view->settings.camera, notes);
    const bool traced = view->settings.params.mode == HG_MODE_PATH && frame->samples > 0;
    const bool there =
        view->settings.params.debug_view == HG_DEBUG_OFF && (traced || frame->settled);
    return view->settings.params.planes && there ? read_planes(view, job, err) : HG_OK;
}

// ---- films kept for later ----------------------------------------------------------------------

// A checkpoint: u64 size, then the film or the history packed by zstd.
static enum hg_status pack(
    const struct hg_refbuf *film, struct hg_writer *out, struct hg_error *err)
{
    hg_write_u64(out, film->size);
    return hg_zstd_encode(film->data, film->size, 1, out, err);
}

// What is to be sent, to view->checkpoint.sending.
static enum hg_status make_checkpoint(const struct request *r, struct view_slot *view,
    enum hgp_checkpoint_kind kind, struct hg_error *err)
{
    const bool history = kind == HGP_checkpoint_kind_HISTORY;
    enum hgp_encoding encoding =
        view->frame_key.asked ? view->frame_key.encoding : view->subscription.still_encoding;
    uint8_t quality = view->frame_key.asked ? view->frame_key.quality : view->subscription.quality;
    struct hg_refbuf *film = NULL;
    hg_writer_finish(&view->checkpoint.sending);
    view->checkpoint.sending_notes =
        (struct hgp_checkpoint){.samples = view->progress.info.samples};
    enum hg_status status = history ? hg_view_save_history(view->view, &film, err)
                                    : hg_view_save(view->view, &film, err);
    if (!status)
        status = film_job(
            r->s, r->session, view, encoding, quality, view->checkpoint.sending_notes.job, err);
    if (!status)
        status = pack(film, &view->checkpoint.sending, err);
    hg_refbuf_unref(film);
    return status;
}

// From `offset` on as much as goes into an answer.
static enum hg_status answer_part(struct view_slot *view, bool part, uint64_t offset,
    struct hgp_checkpoint *answer, struct hg_error *err)
{
    const struct hg_writer *w = &view->checkpoint.sending;
    *answer = view->checkpoint.sending_notes;
    if (offset >= w->size)
        return hg_error_set(
            err, HG_E_STATE, "checkpoint_query", "offset", "nothing is left to send");
    if (!part && w->size > ANSWER_LIMIT_BYTES)
        return hg_error_set(err, HG_E_LIMIT, "checkpoint", NULL,
            "%zu bytes are more than a message holds (%d)", w->size, ANSWER_LIMIT_BYTES);
    const uint64_t left = w->size - offset;
    const uint64_t bytes = part && left > PART_BYTES ? PART_BYTES : left;
    answer->data = (struct hgp_bytes){w->data + offset, (uint32_t)bytes};
    answer->has_size = part;
    answer->size = w->size;
    return HG_OK;
}

void hg_handle_checkpoint_query(const struct request *r)
{
    const struct hgp_checkpoint_query *m = &r->message->checkpoint_query;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hg_error err = {0};
    struct hgp_checkpoint answer;
    enum hg_status status = HG_OK;
    if (!view)
        return;
    const uint64_t offset = m->has_offset ? m->offset : 0;
    if (offset == 0)
        status = make_checkpoint(r, view, m->has_kind ? m->kind : HGP_checkpoint_kind_FILM, &err);
    if (!status)
        status = answer_part(view, m->has_offset, offset, &answer, &err);
    if (status)
        hg_reply_error(r->to, &err);
    else
        hg_reply_send(r->to, HGP_T_checkpoint, &answer);
    if (status || offset + answer.data.size == view->checkpoint.sending.size)
        hg_writer_finish(&view->checkpoint.sending);
}

static enum hg_status unpack(
    const uint8_t *data, size_t bytes, void **film, uint64_t *size, struct hg_error *err)
{
    struct hg_reader r = hg_reader_make(data, bytes);
    *film = NULL;
    *size = hg_read_u64(&r);
    if (r.failed || *size < 1)
        return hg_error_set(err, HG_E_FORMAT, "checkpoint_set", "data", "not a checkpoint");
    if (*size > FILM_LIMIT_BYTES)
        return hg_error_set(err, HG_E_LIMIT, "checkpoint_set", "data", "%llu bytes of film",
            (unsigned long long)*size);
    *film = hg_calloc(1, (size_t)*size);
    if (!*film)
        return hg_error_set(err, HG_E_NOMEM, "checkpoint_set", NULL, "no memory for the film");
    return hg_zstd_decode(r.data + r.pos, r.size - r.pos, *film, (size_t)*size, err);
}

static enum hg_status load_checkpoint(struct view_slot *view, enum hgp_checkpoint_kind kind,
    const uint8_t *data, size_t bytes, struct hg_error *err)
{
    void *film;
    uint64_t size;
    enum hg_status status = unpack(data, bytes, &film, &size, err);
    if (!status && kind == HGP_checkpoint_kind_HISTORY)
        status = hg_view_load_history(view->view, film, size, err);
    else if (!status)
        status = hg_view_load(view->view, film, size, err);
    view->settings.changed |= !status && kind == HGP_checkpoint_kind_FILM; // settled as it may be
    hg_free(film);
    return status;
}

static enum hg_status bad_part(struct view_slot *view, struct hg_error *err, const char *why)
{
    hg_writer_finish(&view->checkpoint.receiving);
    return hg_error_set(err, HG_E_INVAL, "checkpoint_set", "offset", "%s", why);
}

// One more part; *all: it was the last.
static enum hg_status take_part(struct view_slot *view, const struct hgp_checkpoint_set *m,
    enum hgp_checkpoint_kind kind, bool *all, struct hg_error *err)
{
    struct hg_writer *w = &view->checkpoint.receiving;
    *all = false;
    if (!m->has_size || m->size > FILM_LIMIT_BYTES)
        return bad_part(view, err, "needs the size of the whole, 16 GiB at most");
    if (m->offset == 0) {
        hg_writer_finish(w);
        view->checkpoint.receiving_kind = kind;
        view->checkpoint.receive_bytes = m->size;
    }
    if (m->offset != w->size || kind != view->checkpoint.receiving_kind ||
        m->size != view->checkpoint.receive_bytes || m->data.size > m->size - w->size)
        return bad_part(view, err, "is not where the part before has ended");
    hg_write_bytes(w, m->data.data, m->data.size);
    if (w->failed) {
        hg_writer_finish(w);
        return hg_error_set(err, HG_E_NOMEM, "checkpoint_set", NULL, "no memory for its parts");
    }
    *all = w->size == view->checkpoint.receive_bytes;
    return HG_OK;
}

void hg_handle_checkpoint_set(const struct request *r)
{
    const struct hgp_checkpoint_set *m = &r->message->checkpoint_set;
    const enum hgp_checkpoint_kind kind = m->has_kind ? m->kind : HGP_checkpoint_kind_FILM;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hg_error err = {0};
    bool all = true;
    enum hg_status status = HG_OK;
    if (!view)
        return;
    if (!m->has_offset)
        status = load_checkpoint(view, kind, m->data.data, m->data.size, &err);
    else
        status = take_part(view, m, kind, &all, &err);
    if (!status && m->has_offset && all) {
        status = load_checkpoint(
            view, kind, view->checkpoint.receiving.data, view->checkpoint.receiving.size, &err);
        hg_writer_finish(&view->checkpoint.receiving);
    }
    if (status) {
        hg_reply_error(r->to, &err);
        return;
    }
    view->progress.failed = view->progress.failed && !all;
    hg_request_ok(r);
}
