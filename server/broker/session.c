// session.c - sessions: rights and quotas, what is relayed to the worker, what comes back.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/broker.h"

static const uint64_t suspect_patience_ns = 3000000000u;

// ---- requests -----------------------------------------------------------------------------------

static size_t packet_bytes(const struct hg_packet *packet)
{
    return HGP_HEADER_BYTES + packet->header.length;
}

static bool is_answered(const struct hg_request *request)
{
    return request->packet->header.type != HGP_T_view_camera;
}

static struct hg_request *add_request(
    struct hg_session *s, struct hg_packet *packet, uint32_t client_id)
{
    struct hg_request *request = hg_calloc(1, sizeof *request);
    if (!request)
        return NULL;
    request->packet = hg_packet_ref(packet);
    request->client_id = client_id;
    request->prev = s->last;
    *(s->last ? &s->last->next : &s->first) = request;
    s->last = request;
    s->request_count++;
    s->frame_count += packet->header.type == HGP_T_frame_request;
    s->request_bytes += packet_bytes(packet);
    return request;
}

void hg_session_drop_request(struct hg_session *s, struct hg_request *request)
{
    *(request->prev ? &request->prev->next : &s->first) = request->next;
    *(request->next ? &request->next->prev : &s->last) = request->prev;
    s->request_count--;
    s->frame_count -= request->packet->header.type == HGP_T_frame_request;
    s->request_bytes -= packet_bytes(request->packet);
    hg_recovery_request_done(s->broker, request);
    hg_packet_unref(request->packet);
    hg_free(request);
}

// Cameras that have come to the front took effect after all answered requests before them.
static void settle_cameras(struct hg_session *s)
{
    while (s->first && !is_answered(s->first) && s->first->sent) {
        struct hg_reader r =
            hg_reader_make(s->first->packet->payload, s->first->packet->header.length);
        hg_read_u32(&r); // bitmap
        struct hg_session_view *view = hg_session_view_find(s, hg_read_u32(&r));
        if (view && hg_session_view_merge(&view->camera, s->first->packet))
            hg_warn(SESSION, "no memory to remember a camera");
        hg_session_drop_request(s, s->first);
    }
}

static struct hg_request *find_request(struct hg_session *s, uint32_t link_id)
{
    for (struct hg_request *it = s->first; it && link_id; it = it->next)
        if (it->link_id == link_id)
            return it;
    return NULL;
}

bool hg_session_is_full(const struct hg_session *s)
{
    const struct hg_options *o = &s->broker->options;
    return s->request_count >= o->max_requests || s->request_bytes > o->input_limit_bytes;
}

// ---- to the worker ------------------------------------------------------------------------------

// The worker gets no more credit than the window allows.
static struct hg_packet *windowed_subscribe(struct hg_session *s, struct hg_packet *packet)
{
    struct hgp_subscribe m;
    if (hgp_decode(HGP_VERSION_MAX, HGP_T_subscribe, packet->payload, packet->header.length, NULL,
            &m, NULL))
        return NULL;
    struct hg_session_view *view = hg_session_view_find(s, m.view);
    if (view)
        m.credit_frames = hg_session_view_take_window(s, view);
    return hg_packet_encode(HGP_T_subscribe, &m);
}

static void send_request(struct hg_session *s, struct hg_request *request)
{
    struct hg_broker *b = s->broker;
    uint16_t type = request->packet->header.type;
    bool wants_id = is_answered(request) || request->client_id;
    request->link_id = wants_id ? hg_link_next_id(b) : 0;
    request->sent = true;
    struct hg_packet *packet = type == HGP_T_subscribe ? windowed_subscribe(s, request->packet)
                                                       : hg_packet_ref(request->packet);
    if (request->deaths) {
        b->link.suspect_session = s;
        b->link.suspect_id = request->link_id;
        b->link.suspect_ns = b->loop.now_ns;
    }
    hg_link_send_packet(b, s->number, request->link_id, packet);
}

// A request that was under way when the worker died runs alone, so that the next death, if it is
// its fault, is blamed on nothing else. After a while it is taken for harmless.
static bool must_wait(const struct hg_session *s, const struct hg_request *request)
{
    const struct hg_broker *b = s->broker;
    return request->deaths && b->link.suspect_session &&
           b->loop.now_ns - b->link.suspect_ns < suspect_patience_ns;
}

void hg_session_pump(struct hg_session *s)
{
    struct hg_request *next;
    for (struct hg_request *it = s->first; it && s->attached; it = next) {
        next = it->next;
        if (it->sent)
            continue;
        if (must_wait(s, it))
            return;
        send_request(s, it);
    }
    if (s->attached)
        settle_cameras(s);
}

// Two cameras of one view in a row are one.
static bool merge_camera(struct hg_session *s, struct hg_packet *packet)
{
    struct hg_request *last = s->last;
    if (!last || is_answered(last) || last->packet->header.type != packet->header.type ||
        last->client_id || packet->header.request || packet->header.length < 8 ||
        memcmp(last->packet->payload + 4, packet->payload + 4, 4) != 0)
        return false;
    size_t before = packet_bytes(last->packet);
    if (hg_session_view_merge(&last->packet, packet))
        return false;
    s->request_bytes += packet_bytes(last->packet) - before;
    if (last->sent && s->attached)
        hg_link_send_packet(s->broker, s->number, 0, hg_packet_ref(packet));
    return true;
}

static void relay(struct hg_session *s, struct hg_packet *packet)
{
    uint16_t type = packet->header.type;
    if (type == HGP_T_view_camera && merge_camera(s, packet))
        return;
    if (!add_request(s, packet, packet->header.request)) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_NOMEM, "request", NULL, "no memory for the request");
        hg_conn_fail(s->conn, packet->header.request, &err);
        return;
    }
    hg_session_pump(s);
}

// ---- rules for relayed messages -----------------------------------------------------------------

static enum hg_status check_load(
    const struct hg_session *s, const struct hgp_asset_load *m, struct hg_error *err)
{
    if (m->asset < s->first_id || m->asset - s->first_id >= HG_SCENE_ID_RANGE)
        return hg_error_set(err, HG_E_INVAL, "asset_load", "asset",
            "%u is outside this session's range %u to %u", m->asset, s->first_id,
            s->first_id + HG_SCENE_ID_RANGE - 1);
    for (uint32_t i = 0; i < m->files.count; i++)
        if (!hg_upload_store_has(s->broker->store, m->files.items[i].hash)) {
            char place[128];
            snprintf(place, sizeof place, "files[%u].hash", i);
            return hg_error_set(err, HG_E_NOTFOUND, "asset_load", place,
                "this content has not been uploaded: %.*s", (int)m->files.items[i].uri.size,
                m->files.items[i].uri.data);
        }
    return HG_OK;
}

static enum hg_status check_journal(
    const struct hg_session *s, const struct hg_packet *packet, struct hg_error *err)
{
    struct hg_journal_stats stats = hg_journal_get_stats(s->scene->journal);
    uint64_t need = stats.bytes + s->request_bytes + packet->header.length;
    bool removes =
        packet->header.type == HGP_T_object_remove || packet->header.type == HGP_T_asset_unload;
    if (!hg_journal_wants(packet->header.type) || removes ||
        need <= s->broker->options.journal_limit_bytes)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, hgp_find(packet->header.type)->name, NULL,
        "the scene would keep %llu MiB of edits, more than journal-limit allows (%llu MiB); "
        "remove objects or upload assets instead",
        (unsigned long long)(need >> 20),
        (unsigned long long)(s->broker->options.journal_limit_bytes >> 20));
}

static enum hg_status check_view(
    struct hg_session *s, const struct hg_packet *packet, uint32_t number, struct hg_error *err)
{
    if (hg_session_view_find(s, number))
        return HG_OK;
    return hg_error_set(err, HG_E_NOTFOUND, hgp_find(packet->header.type)->name, "view",
        "this session has no view %u", number);
}

static enum hg_status check_frame_request(
    struct hg_session *s, const struct hg_packet *packet, uint32_t view, struct hg_error *err)
{
    if (s->frame_count >= s->broker->options.max_frame_requests)
        return hg_error_set(err, HG_E_BUSY, "frame_request", NULL,
            "%u frame requests of this session are under way already (max-frame-requests)",
            s->frame_count);
    return check_view(s, packet, view, err);
}

static enum hg_status check_relay(struct hg_session *s, const struct hg_packet *packet,
    const union hgp_any *m, struct hg_error *err)
{
    const char *name = hgp_find(packet->header.type)->name;
    if (!s->scene)
        return hg_error_set(err, HG_E_STATE, name, NULL, "open a scene first (scene_open)");
    switch (packet->header.type) {
    case HGP_T_bench:
    case HGP_T_bake:
        return hg_error_set(
            err, HG_E_UNSUPPORTED, name, NULL, "runs in a private worker only, not in a daemon");
    case HGP_T_asset_load:
        if (check_load(s, &m->asset_load, err))
            return err->status;
        return check_journal(s, packet, err);
    case HGP_T_environment_set:
        if (m->environment_set.has_hash &&
            !hg_upload_store_has(s->broker->store, m->environment_set.hash))
            return hg_error_set(
                err, HG_E_NOTFOUND, name, "hash", "this content has not been uploaded");
        return HG_OK;
    case HGP_T_image_query:
        return hg_session_verify(s, &m->image_query, err);
    case HGP_T_view_set:
        return hg_session_view_ask(s, &m->view_set, err);
    case HGP_T_frame_request:
        return check_frame_request(s, packet, m->frame_request.view, err);
    case HGP_T_view_camera:
        return check_view(s, packet, m->view_camera.view, err);
    case HGP_T_view_close:
        return check_view(s, packet, m->view_close.view, err);
    case HGP_T_subscribe:
        return check_view(s, packet, m->subscribe.view, err);
    case HGP_T_credit:
        return check_view(s, packet, m->credit.view, err);
    default:
        return check_journal(s, packet, err);
    }
}

static void subscribe(struct hg_session *s, const struct hgp_subscribe *m)
{
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    view->credit = m->credit_frames;
    view->subscribed = m->credit_frames > 0;
    view->resubscribe = false;
}

// ---- messages the broker answers ----------------------------------------------------------------

static void open_scene(struct hg_session *s, uint32_t request, const struct hgp_scene_open *m)
{
    struct hg_error err = {0};
    struct hg_broker *b = s->broker;
    bool existed = false;
    struct hg_shared_scene *scene = NULL;
    if (s->scene)
        hg_error_set(&err, HG_E_STATE, "scene_open", NULL, "close the open scene first");
    else if (b->draining)
        hg_error_set(&err, HG_E_STATE, "scene_open", NULL, "the daemon is shutting down");
    else if (!(scene = hg_shared_scene_join(b, m->name, s->number, &existed)))
        hg_error_set(&err, HG_E_NOMEM, "scene_open", NULL, "no memory for a scene");
    else if (scene->ranges_used >= HG_SCENE_RANGES) {
        hg_shared_scene_leave(b, scene);
        hg_error_set(&err, HG_E_LIMIT, "scene_open", NULL,
            "%u sessions have used this scene; no ids are left", (unsigned)HG_SCENE_RANGES);
    }
    if (err.status) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    s->scene = scene;
    s->first_id = 1 + scene->ranges_used++ * HG_SCENE_ID_RANGE;
    if (scene->in_worker)
        hg_recovery_attach(s);
    hg_conn_send(s->conn, request, HGP_T_scene_opened,
        &(struct hgp_scene_opened){.revision = scene->revision,
            .existed = existed,
            .first_id = s->first_id,
            .id_count = HG_SCENE_ID_RANGE});
}

static void leave_scene(struct hg_session *s)
{
    struct hg_shared_scene *scene = s->scene;
    while (s->first)
        hg_session_drop_request(s, s->first);
    while (s->views)
        hg_session_view_remove(s, s->views);
    if (s->attached)
        hg_link_send(
            s->broker, s->number, 0, HGP_T_session_detach, &(struct hgp_session_detach){0});
    s->attached = s->batch_open = false;
    s->verified_bytes = 0;
    s->scene = NULL;
    if (scene)
        hg_shared_scene_leave(s->broker, scene);
}

static void close_scene(struct hg_session *s, uint32_t request)
{
    struct hg_error err = {0};
    if (!s->scene) {
        hg_error_set(&err, HG_E_STATE, "scene_close", NULL, "no scene is open");
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    hg_error_set(&err, HG_E_CANCELLED, "scene_close", NULL, "the scene was closed");
    hg_session_fail_all(s, &err);
    leave_scene(s);
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

static void add_credit(struct hg_session *s, const struct hgp_credit *m)
{
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    if (!view->subscribed)
        return; // stopped
    view->credit += view->credit < UINT32_MAX - 1024 ? m->frames : 0;
    hg_session_view_grant(s, view);
}

static void relay_checked(struct hg_session *s, struct hg_packet *packet, const union hgp_any *m)
{
    struct hg_error err = {0};
    if (check_relay(s, packet, m, &err)) {
        hg_conn_fail(s->conn, packet->header.request, &err);
        return;
    }
    if (packet->header.type == HGP_T_credit) {
        add_credit(s, &m->credit);
        return;
    }
    if (packet->header.type == HGP_T_subscribe)
        subscribe(s, &m->subscribe);
    relay(s, packet);
}

void hg_session_message(struct hg_session *s, struct hg_packet *packet, const union hgp_any *m)
{
    uint32_t request = packet->header.request;
    switch (packet->header.type) {
    case HGP_T_scene_open:
        open_scene(s, request, &m->scene_open);
        return;
    case HGP_T_scene_close:
        close_scene(s, request);
        return;
    case HGP_T_upload_query:
        hg_session_upload_query(s, request, &m->upload_query);
        return;
    case HGP_T_upload:
        hg_session_upload(s, request, &m->upload);
        return;
    case HGP_T_sessions_query:
        hg_session_list(s, request);
        return;
    default:
        relay_checked(s, packet, m);
    }
}

// ---- from the worker ----------------------------------------------------------------------------

// A view_set of the same number that is already on its way makes the view anew.
static void close_view(
    struct hg_session *s, struct hg_session_view *view, const struct hg_request *request)
{
    for (const struct hg_request *it = request->next; it; it = it->next) {
        struct hgp_view_set m;
        const struct hg_packet *packet = it->packet;
        if (packet->header.type == HGP_T_view_set &&
            hgp_decode(HGP_VERSION_MAX, HGP_T_view_set, packet->payload, packet->header.length,
                NULL, &m, NULL) == HG_OK &&
            m.view == view->number) {
            hg_session_view_reset(view);
            return;
        }
    }
    hg_session_view_remove(s, view);
}

// What an accepted request changes in the broker's picture of the session.
static void note_accepted(struct hg_session *s, struct hg_request *request)
{
    struct hg_packet *packet = request->packet;
    uint16_t type = packet->header.type;
    union hgp_any any;
    if (hg_journal_wants(type)) {
        enum hg_status status = hg_journal_accept(s->scene->journal, packet);
        if (status)
            hg_log_write(HG_LOG_ERROR, HG_LOG_JOURNAL, status, s->number,
                "an edit is not in the journal of scene '%s'", s->scene->key);
    } else if (type == HGP_T_batch_begin || type == HGP_T_batch_end) {
        s->batch_open = type == HGP_T_batch_begin;
    } else if (type == HGP_T_view_set || type == HGP_T_view_close) {
        if (hgp_decode(
                HGP_VERSION_MAX, type, packet->payload, packet->header.length, NULL, &any, NULL))
            return;
        struct hg_session_view *view = hg_session_view_find(
            s, type == HGP_T_view_set ? any.view_set.view : any.view_close.view);
        if (view && type == HGP_T_view_close)
            close_view(s, view, request);
        else if (view && hg_session_view_merge(&view->params, packet) == HG_OK)
            view->accepted = true;
    }
}

// A view that the worker never took does not count.
static void note_refused(struct hg_session *s, struct hg_request *request)
{
    struct hgp_view_set m;
    const struct hg_packet *packet = request->packet;
    if (packet->header.type != HGP_T_view_set ||
        hgp_decode(HGP_VERSION_MAX, HGP_T_view_set, packet->payload, packet->header.length, NULL,
            &m, NULL))
        return;
    struct hg_session_view *view = hg_session_view_find(s, m.view);
    if (view && !view->accepted)
        hg_session_view_remove(s, view);
}

// Contents that turn out to be damaged are dropped, so that the client sends them again.
static void forget_uploads(struct hg_session *s, const struct hg_packet *packet)
{
    struct hg_arena arena = {0};
    union hgp_any any;
    uint16_t type = packet->header.type;
    bool known = type == HGP_T_asset_load || type == HGP_T_environment_set;
    if (known && hgp_decode(HGP_VERSION_MAX, type, packet->payload, packet->header.length, &arena,
                     &any, NULL) == HG_OK) {
        uint32_t count = type == HGP_T_asset_load ? any.asset_load.files.count : 0;
        for (uint32_t i = 0; i < count; i++)
            hg_upload_store_forget(s->broker->store, any.asset_load.files.items[i].hash);
        if (type == HGP_T_environment_set && any.environment_set.has_hash)
            hg_upload_store_forget(s->broker->store, any.environment_set.hash);
    }
    hg_arena_finish(&arena);
}

static void note_revision(struct hg_session *s, uint16_t type, const union hgp_any *m)
{
    uint64_t revision = type == HGP_T_ok             ? m->ok.revision
                        : type == HGP_T_asset_loaded ? m->asset_loaded.revision
                        : type == HGP_T_frame        ? m->frame.scene_revision
                                                     : 0;
    if (s->scene && revision > s->scene->revision)
        s->scene->revision = revision;
}

// Numbers go on where the last worker stopped. Layout of frame: bitmap, view, number.
static void renumber(struct hg_session_view *view, struct hg_packet *packet, struct hgp_frame *m)
{
    uint64_t number = m->number + view->number_base;
    for (int i = 0; view->number_base && i < 8; i++)
        packet->payload[8 + i] = (uint8_t)(number >> (8 * i));
    if (number > view->last_number)
        view->last_number = number;
}

static void relay_subscribed(struct hg_session *s, struct hg_packet *packet, uint32_t number)
{
    struct hg_session_view *view = hg_session_view_find(s, number);
    if (!view || !s->conn)
        return;
    view->granted -= view->granted > 0;
    if (!view->credit) {
        view->resubscribe = view->subscribed; // shown again when there is credit
        return;
    }
    view->credit--;
    hg_conn_send_packet(s->conn, 0, hg_packet_ref(packet));
    hg_session_view_grant(s, view);
}

static void relay_answer(struct hg_session *s, struct hg_packet *packet, uint32_t client_id)
{
    bool lossy = packet->header.type == HGP_T_progress;
    if (s->conn && client_id &&
        !(lossy && s->conn->out.bytes > s->broker->options.output_limit_bytes))
        hg_conn_send_packet(s->conn, client_id, hg_packet_ref(packet));
}

// Failures of requests that wanted no answer, and warnings about the scene.
static void relay_unasked(struct hg_session *s, struct hg_packet *packet, const union hgp_any *m)
{
    if (!s->conn)
        return;
    if (packet->header.type == HGP_T_notice)
        hg_conn_send_packet(s->conn, 0, hg_packet_ref(packet));
    else if (packet->header.type == HGP_T_error)
        hg_conn_send(s->conn, 0, HGP_T_notice,
            &(struct hgp_notice){.code = m->error.code,
                .what = m->error.what,
                .where = m->error.where,
                .reason = m->error.reason});
}

static void finish_request(struct hg_session *s, struct hg_request *request,
    struct hg_packet *packet, const union hgp_any *m)
{
    bool failed = packet->header.type == HGP_T_error;
    if (request->packet->header.type == HGP_T_image_query && packet->header.type != HGP_T_ok)
        hg_session_verified(s, request);
    if (failed && m->error.code == HG_E_HASH)
        forget_uploads(s, request->packet);
    if (failed)
        note_refused(s, request);
    else
        note_accepted(s, request);
    if (request->client_id)
        relay_answer(s, packet, request->client_id);
    else if (failed)
        relay_unasked(s, packet, m);
    hg_session_drop_request(s, request);
}

static void end_if_idle(struct hg_session *s);

void hg_session_answer(struct hg_session *s, struct hg_packet *packet, union hgp_any *m)
{
    uint16_t type = packet->header.type;
    struct hg_request *request = find_request(s, packet->header.request);
    note_revision(s, type, m);
    if (type == HGP_T_frame) {
        struct hg_session_view *view = hg_session_view_find(s, m->frame.view);
        if (view)
            renumber(view, packet, &m->frame);
    }
    if (!request) {
        if (type == HGP_T_frame && !packet->header.request)
            relay_subscribed(s, packet, m->frame.view);
        else if (!packet->header.request)
            relay_unasked(s, packet, m);
        return; // else an answer to what was played again, or given up
    }
    if (type == HGP_T_progress || type == HGP_T_notice || type == HGP_T_frame_part) {
        relay_answer(s, packet, request->client_id);
        return;
    }
    finish_request(s, request, packet, m);
    hg_session_pump(s);
    if (s->conn)
        hg_conn_update(s->conn);
    else
        end_if_idle(s);
}

// ---- life ---------------------------------------------------------------------------------------

struct hg_session *hg_session_create(struct hg_conn *conn, enum hgp_role role, const char *name)
{
    struct hg_broker *b = conn->broker;
    struct hg_session *s = hg_calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->broker = b;
    s->conn = conn;
    s->number = (uint32_t)conn->number & (HG_REPLAY_CHANNEL - 1);
    s->role = role;
    snprintf(s->name, sizeof s->name, "%s", name);
    HG_LIST_ADD(b->sessions, s);
    b->session_count++;
    return s;
}

struct hg_session *hg_session_find(struct hg_broker *b, uint32_t number)
{
    for (struct hg_session *it = b->sessions; it; it = it->next)
        if (it->number == number)
            return it;
    return NULL;
}

void hg_session_fail_all(struct hg_session *s, const struct hg_error *err)
{
    while (s->first) {
        if (s->conn && is_answered(s->first))
            hg_conn_fail(s->conn, s->first->client_id, err);
        hg_session_drop_request(s, s->first);
    }
    if (!s->conn) // nothing is left to wait for
        s->broker->closing = true;
}

void hg_session_destroy(struct hg_session *s)
{
    struct hg_broker *b = s->broker;
    leave_scene(s);
    HG_LIST_REMOVE(b->sessions, s);
    b->session_count--;
    hg_free(s);
}

// A session without a client ends when none of its edits is on the way to a shared scene.
static void end_if_idle(struct hg_session *s)
{
    struct hg_request *next;
    for (struct hg_request *it = s->first; it; it = next) {
        next = it->next;
        if (!hg_journal_wants(it->packet->header.type))
            hg_session_drop_request(s, it);
    }
    if (!s->first || !s->scene || s->scene->sessions == 1)
        hg_session_destroy(s);
}

void hg_session_end(struct hg_session *s)
{
    s->conn = NULL;
    hg_session_abort_uploads(s);
    end_if_idle(s);
}
