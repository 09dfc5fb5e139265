#include "server/worker/query/query.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/spill.h"
#include "renderer/camera/camera.h"
#include "server/worker/view/view_fit.h"
#include "server/worker/view/view_rate.h"
#include "server/worker/view/view_schedule.h"

// Of a file that comes in parts: in all, and where it cannot be spilled.
#define IMAGE_LIMIT_BYTES  (UINT64_C(4) << 30)
#define MEMORY_LIMIT_BYTES (UINT64_C(256) << 20)

enum { NAME_LIMIT = 256 /* of node_entry.name */ };

static void fail_nomem(const struct request *r)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_NOMEM, "query", NULL, "no memory for the answer");
    hg_reply_error(r->to, &err);
}

static void answer_json(const struct request *r, json_t *root)
{
    char *text = root ? json_dumps(root, JSON_COMPACT) : NULL;
    json_decref(root);
    if (text)
        hg_reply_send(r->to, HGP_T_json, &(struct hgp_json){.text = hgp_str_make(text)});
    else
        fail_nomem(r);
    free(text);
}

void hg_handle_pick(const struct request *r)
{
    const struct hgp_pick *m = &r->message->pick;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    struct hg_error err = {0};
    struct hg_pick hit;
    enum hg_status status = hg_schedule_refresh(r->session, view, &err);
    if (!status)
        status = hg_view_pick(view->view, m->x, m->y, &hit, &err);
    if (status) {
        hg_reply_error(r->to, &err);
        return;
    }
    struct hgp_picked answer = {
        .revision = hit.revision,
        .hit = hit.hit,
        .node = hit.node,
        .mesh = hit.mesh,
        .material = hit.material,
        .part = hit.part,
        .triangle = hit.triangle,
        .distance = hit.distance,
    };
    memcpy(answer.position, hit.position, sizeof answer.position);
    memcpy(answer.normal, hit.normal, sizeof answer.normal);
    memcpy(answer.uv, hit.uv, sizeof answer.uv);
    hg_reply_send(r->to, HGP_T_picked, &answer);
}

void hg_handle_bounds_query(const struct request *r)
{
    struct hg_scene *scene = r->session->scene->scene;
    uint64_t id = r->message->bounds_query.node;
    struct hg_object *node = id ? hg_scene_find(scene, HG_OBJECT_NODE, id) : NULL;
    if (id && !node) {
        struct hg_error err = {0};
        hg_error_set(
            &err, HG_E_NOTFOUND, "bounds_query", "node", "no node %llu", (unsigned long long)id);
        hg_reply_error(r->to, &err);
        return;
    }
    hg_scene_update(scene);
    struct hgp_bounds answer = {.revision = scene->revision};
    answer.empty = !hg_scene_bounds(scene, (struct hg_node *)node, answer.min, answer.max);
    hg_reply_send(r->to, HGP_T_bounds, &answer);
}

static uint64_t id_of(const struct hg_object *object)
{
    return object ? object->id : 0;
}

static struct hgp_node_entry describe_node(const struct hg_node *node)
{
    return (struct hgp_node_entry){
        .node = node->head.id,
        .parent = node->parent ? node->parent->head.id : 0,
        .mesh = id_of((const struct hg_object *)node->mesh),
        .light = id_of((const struct hg_object *)node->light),
        .camera = id_of((const struct hg_object *)node->camera),
        .visible = node->visible,
        .name = hgp_str_fit(node->head.name, NAME_LIMIT),
    };
}

void hg_handle_nodes_query(const struct request *r)
{
    const struct hgp_nodes_query *m = &r->message->nodes_query;
    const struct hg_scene *scene = r->session->scene->scene;
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_NODE];
    uint32_t first = m->first < list->count ? m->first : list->count;
    uint32_t count = list->count - first < m->count ? list->count - first : m->count;
    struct hgp_node_entry *entries = hg_calloc(count, sizeof *entries);
    if (!entries) {
        fail_nomem(r);
        return;
    }
    for (uint32_t i = 0; i < count; i++)
        entries[i] = describe_node((const struct hg_node *)list->items[first + i]);
    struct hgp_nodes answer = {.revision = scene->revision, .total = list->count};
    answer.nodes.items = entries;
    answer.nodes.count = count;
    hg_reply_send(r->to, HGP_T_nodes, &answer);
    hg_free(entries);
}

static json_t *child_object(json_t *root, const char *key)
{
    json_t *child = json_object_get(root, key);
    if (!child) {
        child = json_object();
        json_object_set_new(root, key, child);
    }
    return child;
}

static void set_vector(json_t *object, const char *key, const float v[3])
{
    json_object_set_new(
        object, key, json_pack("[f, f, f]", (double)v[0], (double)v[1], (double)v[2]));
}

static void set_node_name(json_t *camera, const struct hg_node *node)
{
    char name[NAME_LIMIT];
    const struct hgp_str known = hgp_str_fit(node->head.name, NAME_LIMIT);
    if (known.size)
        json_object_set_new(camera, "node", json_stringn(known.data, known.size));
    else {
        snprintf(name, sizeof name, "node %u", (unsigned)node->head.id);
        json_object_set_new(camera, "node", json_string(name));
    }
}

// Where the view looks from, and who chose it. A client that fits by view_fit and then places the
// camera knows more than that.
static void add_camera(json_t *root, const struct request *r, const struct view_slot *view)
{
    const struct view_settings *set = &view->settings;
    const struct hg_view_camera *camera = &set->camera;
    struct hgp_view_fitted shown;
    const struct hg_object *node =
        set->camera_node ? hg_scene_find(r->session->scene->scene, HG_OBJECT_NODE, set->camera_node)
                         : NULL;
    json_t *o = child_object(root, "camera");
    json_object_set_new(o, "source",
        json_string(node                ? "node"
                    : set->camera_given ? "given"
                                        : "fit"));
    if (node) {
        set_node_name(o, (const struct hg_node *)node);
        hg_view_fit_describe((const struct hg_node *)node, &shown);
    } else {
        memcpy(shown.eye, camera->eye, sizeof shown.eye);
        memcpy(shown.target, camera->target, sizeof shown.target);
        shown.kind =
            camera->orthographic ? HGP_camera_kind_ORTHOGRAPHIC : HGP_camera_kind_PERSPECTIVE;
        shown.vfov_rad = camera->vfov_rad > 0 ? camera->vfov_rad : HG_CAMERA_DEFAULT_VFOV_RAD;
        shown.half_height = camera->half_height;
    }
    const bool flat = shown.kind == HGP_camera_kind_ORTHOGRAPHIC;
    set_vector(o, "eye", shown.eye);
    set_vector(o, "target", shown.target);
    json_object_set_new(o, "kind", json_string(flat ? "orthographic" : "perspective"));
    json_object_set_new(o, flat ? "half_height" : "vfov_deg",
        json_real(flat ? (double)shown.half_height : (double)shown.vfov_rad * 57.29577951308232));
}

// What the controller of a subscription knows and has chosen.
static void add_flow(json_t *root, struct view_slot *view)
{
    hg_rate_note_sent(view);
    const struct hg_control *c = &view->control;
    json_t *o = child_object(root, "flow");
    const struct {
        const char *key;
        double value;
    } reals[] = {{"target_fps", (double)view->subscription.target_fps},
        {"target_ms", (double)c->now.target_ms}, {"rate_mbit_s", c->rate * 8e-6},
        {"rtt_ms", (double)c->rtt.ns * 1e-6}, {"delay_ms", c->delay_ns * 1e-6},
        {"work_ms", c->work_ns * 1e-6}, {"encode_ms", c->encode_ns * 1e-6},
        {"read_ms", c->read_ns * 1e-6}};
    const struct {
        const char *key;
        uint64_t value;
    } counts[] = {{"quality", c->now.quality}, {"bitrate", c->now.bitrate}, {"under_way", c->count},
        {"bytes_under_way", hg_control_bytes(c)}, {"sent", c->sent}, {"delivered", c->delivered},
        {"held", c->held}};
    for (size_t i = 0; i < sizeof reals / sizeof *reals; i++)
        json_object_set_new(o, reals[i].key, json_real(reals[i].value));
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        json_object_set_new(o, counts[i].key, json_integer((json_int_t)counts[i].value));
    json_object_set_new(o, "named", json_boolean(c->informed));
    json_object_set_new(o, "hidden", json_boolean(view->subscription.hidden));
}

void hg_handle_stats_query(const struct request *r)
{
    uint32_t number = r->message->stats_query.view;
    struct view_slot *view = number ? hg_request_view(r, number) : NULL;
    if (number && !view)
        return;
    char *text = NULL;
    enum hg_status status = HG_OK;
    if (r->s->renderer)
        status = hg_renderer_stats_json(r->s->renderer, view ? view->view : NULL, &text);
    json_t *root = text ? json_loads(text, 0, NULL) : json_object();
    hg_free(text);
    if (status || !root) {
        json_decref(root);
        fail_nomem(r);
        return;
    }
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    json_object_set_new(child_object(root, "process"), "peak_rss_bytes",
        json_integer((json_int_t)usage.ru_maxrss * 1024));
    if (view) {
        json_t *frame = child_object(root, "frame");
        double encode_ms = (double)atomic_load(&r->s->w->encode_ns) * 1e-6;
        double render_ms = json_number_value(json_object_get(frame, "render_ms"));
        json_object_set_new(frame, "encode_ms", json_real(encode_ms));
        json_object_set_new(frame, "total_ms", json_real(render_ms + encode_ms));
        add_camera(root, r, view);
        add_flow(root, view);
    }
    answer_json(r, root);
}

// As environment_set has chosen it; what is made of that for each view is in its statistics.
static void add_environment(json_t *root, const struct hg_environment *e)
{
    static const char *const kinds[] = {"none", "color", "file", "sky"};
    json_t *o = child_object(root, "environment");
    const double intensity = (double)(e->automatic ? e->wanted_intensity : e->intensity);
    json_object_set_new(o, "kind", json_string(e->automatic ? "auto" : kinds[e->kind]));
    json_object_set_new(o, "intensity", json_real(intensity));
    json_object_set_new(o, "rotation_rad", json_real((double)e->rotation_rad));
    json_object_set_new(o, "turbidity", json_real((double)e->turbidity));
    set_vector(o, "color", e->color);
    set_vector(o, "sun_direction", e->sun_direction);
}

void hg_handle_info_query(const struct request *r)
{
    struct hg_scene *scene = r->session->scene->scene;
    json_t *root = json_object(), *assets = json_array();
    json_object_set_new(root, "revision", json_integer((json_int_t)scene->revision));
    add_environment(root, &scene->environment);
    json_object_set_new(root, "assets", assets);
    for (uint32_t i = 0; i < scene->asset_count; i++) {
        char *text = NULL;
        json_t *asset = NULL;
        if (hg_asset_describe(scene->assets[i], &text) == HG_OK)
            asset = json_loads(text, 0, NULL);
        hg_free(text);
        if (!asset) {
            json_decref(root);
            fail_nomem(r);
            return;
        }
        json_array_append_new(assets, asset);
    }
    answer_json(r, root);
}

void hg_handle_compare(const struct request *r)
{
    hg_request_start_task(r, TASK_COMPARE, HGP_T_compare);
}

static void drop_file(struct session *session)
{
    hg_writer_finish(&session->file);
    session->file_bytes = 0;
}

// Room for all of a file, on disk: it takes no memory while it comes.
static enum hg_status begin_file(struct session *session, uint64_t bytes, struct hg_error *err)
{
    struct hg_writer *file = &session->file;
    drop_file(session);
    if (bytes > IMAGE_LIMIT_BYTES)
        return hg_error_set(err, HG_E_LIMIT, "image_query", "offset", "is of a file above 4 GiB");
    hg_writer_spill(file, (size_t)bytes);
    if (bytes > MEMORY_LIMIT_BYTES && hg_spill_size(file->data) == 0)
        return hg_error_set(err, HG_E_LIMIT, "image_query", "offset",
            "is of a file above 256 MiB, for which the cache folder has no room");
    session->file_bytes = bytes;
    return HG_OK;
}

// What was allowed when the file began is what may come of it.
static enum hg_status check_part(
    const struct session *session, const struct hgp_image_query *m, struct hg_error *err)
{
    const uint64_t bytes = session->file_bytes, size = m->has_size ? m->size : 0;
    if (size != bytes)
        return hg_error_set(err, HG_E_INVAL, "image_query", "size",
            "is %llu, and was %llu where the file began", (unsigned long long)size,
            (unsigned long long)bytes);
    if (m->offset != session->file.size || !m->data.size)
        return hg_error_set(
            err, HG_E_INVAL, "image_query", "offset", "is not where the part before has ended");
    if (m->data.size > bytes - m->offset)
        return hg_error_set(err, HG_E_INVAL, "image_query", "data",
            "%llu bytes at offset %llu exceed the file size of %llu",
            (unsigned long long)m->data.size, (unsigned long long)m->offset,
            (unsigned long long)bytes);
    return HG_OK;
}

// One more part of a file.
static enum hg_status take_part(
    struct session *session, const struct hgp_image_query *m, struct hg_error *err)
{
    struct hg_writer *file = &session->file;
    if (m->offset == 0 && begin_file(session, m->has_size ? m->size : 0, err))
        return err->status;
    if (check_part(session, m, err))
        return err->status;
    hg_spill_begin(NULL);
    hg_write_bytes(file, m->data.data, m->data.size);
    hg_spill_end();
    if (file->failed)
        return hg_error_set(err, HG_E_NOMEM, "image_query", "offset", "no memory for the file");
    return HG_OK;
}

void hg_handle_image_query(const struct request *r)
{
    const struct hgp_image_query *m = &r->message->image_query;
    struct hg_error err = {0};
    if (!m->has_offset)
        drop_file(r->session); // a file that came only in part is not this one
    if (m->has_offset && take_part(r->session, m, &err)) {
        drop_file(r->session);
        hg_reply_error(r->to, &err);
        return;
    }
    if (m->has_offset && r->session->file.size < r->session->file_bytes) {
        hg_request_ok(r);
        return;
    }
    hg_request_start_task(r, TASK_IMAGE, HGP_T_image_query);
    drop_file(r->session); // it has gone with the task, if there is one
}

void hg_query_compared(const struct request *r, struct task *task)
{
    if (task->status) {
        hg_reply_error(r->to, &task->err);
        return;
    }
    hg_reply_send(r->to, HGP_T_compared,
        &(struct hgp_compared){.value = task->value,
            .width = task->width,
            .height = task->height,
            .diff = {task->diff.data, (uint32_t)task->diff.size}});
}

void hg_query_image_examined(const struct request *r, struct task *task)
{
    const struct hg_image_summary *summary = &task->summary;
    if (task->status) {
        hg_reply_error(r->to, &task->err);
        return;
    }
    json_t *root = json_pack("{s:s, s:I, s:I, s:I}", "format", summary->file_format, "width",
        (json_int_t)summary->width, "height", (json_int_t)summary->height, "parts",
        (json_int_t)summary->parts);
    if (root && summary->value[0])
        json_object_set_new(root, "job", json_string(summary->value));
    answer_json(r, root);
}
