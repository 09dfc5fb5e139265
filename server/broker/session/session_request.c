#include "server/broker/session/session_request.h"

#include <string.h>

#include "base/alloc.h"
#include "server/broker/session/session_look.h"
#include "server/broker/session/session_view.h"
#include "server/broker/workers/trial.h"

// Of one session before the next; what each may have waiting however much waits in all.
enum { TURN_BYTES = 32 << 10, LEAST_SHARE = 4 << 10 };

static size_t packet_bytes(const struct hg_packet *packet)
{
    return HGP_HEADER_BYTES + packet->header.length;
}

// Cameras only where the client asks for it.
static bool is_answered(const struct hg_request *request)
{
    return request->packet->header.type != HGP_T_view_camera || request->client_id != 0;
}

// Requests that render.
static bool is_frame_request(const struct hg_packet *packet)
{
    return packet->header.type == HGP_T_frame_request ||
           packet->header.type == HGP_T_exposure_query;
}

// Of a request that is not sent; `bytes` more, or less.
static void note_unsent(struct hg_session *s, int64_t bytes)
{
    s->load.unsent_bytes += (uint64_t)bytes;
    if (s->scene)
        s->scene->link->feed.unsent_bytes += (uint64_t)bytes;
}

static struct hg_request *add_request(
    struct hg_session *s, struct hg_packet *packet, uint32_t client_id)
{
    struct hg_request *request = hg_calloc(1, sizeof *request);
    if (request && hg_journal_hold_uploads(s->table->store, packet, true)) { // as the scene will
        hg_free(request);
        request = NULL;
    }
    if (!request)
        return NULL;
    request->packet = hg_packet_ref(packet);
    request->client_id = client_id;
    request->prev = s->last;
    *(s->last ? &s->last->next : &s->first) = request;
    s->last = request;
    s->load.count++;
    s->load.frames += is_frame_request(packet);
    s->load.bytes += packet_bytes(packet);
    note_unsent(s, (int64_t)packet_bytes(packet));
    if (!s->load.unsent)
        s->load.unsent = request;
    return request;
}

// ---- room for answers ---------------------------------------------------------------------------

enum { EDIT_ANSWER_BYTES = 1024, QUERY_ANSWER_BYTES = 1 << 20 };

static uint64_t frame_bytes(struct hg_session *s, const struct hg_packet *packet)
{
    struct hgp_frame_request m;
    const struct hg_session_view *view = NULL;
    if (hgp_decode(HGP_VERSION_MAX, HGP_T_frame_request,
            hg_reader_make(packet->payload, packet->header.length), NULL, &m, NULL) == HG_OK)
        view = hg_session_view_find(s, m.view);
    return view ? view->frame_bytes : EDIT_ANSWER_BYTES;
}

// How large the answer may be: of edits known, of frames by their view, of queries the largest of
// the session so far and before the first answer a mebibyte.
static uint64_t answer_bytes(struct hg_session *s, const struct hg_packet *packet)
{
    uint16_t type = packet->header.type;
    if (hg_journal_wants(type) || type == HGP_T_view_set || type == HGP_T_subscribe)
        return EDIT_ANSWER_BYTES;
    if (type == HGP_T_frame_request)
        return frame_bytes(s, packet);
    return s->answers.query_bytes ? s->answers.query_bytes : QUERY_ANSWER_BYTES;
}

static void charge(struct hg_session *s, struct hg_request *request)
{
    request->charge = request->client_id ? answer_bytes(s, request->packet) : 0;
    s->answers.granted_bytes += request->charge;
}

static void give_back(struct hg_session *s, struct hg_request *request)
{
    s->answers.granted_bytes -= request->charge;
    request->charge = 0;
}

void hg_session_request_lost(struct hg_session *s, struct hg_request *request)
{
    if (request->sent)
        note_unsent(s, (int64_t)packet_bytes(request->packet));
    request->sent = false;
    s->load.unsent = s->first;
    request->link_id = 0;
    request->limit.name[0] = 0;
    give_back(s, request);
}

void hg_session_request_drop(struct hg_session *s, struct hg_request *request)
{
    *(request->prev ? &request->prev->next : &s->first) = request->next;
    *(request->next ? &request->next->prev : &s->last) = request->prev;
    s->load.count--;
    s->load.frames -= is_frame_request(request->packet);
    s->load.bytes -= packet_bytes(request->packet);
    if (!request->sent)
        note_unsent(s, -(int64_t)packet_bytes(request->packet));
    if (s->load.unsent == request)
        s->load.unsent = request->next;
    give_back(s, request);
    hg_trial_clear(s, request);
    hg_trial_leave(s, request);
    if (hg_journal_hold_uploads(s->table->store, request->packet, false)) {
        // No memory to decode it: what it named stays until the daemon ends.
    }
    hg_packet_unref(request->packet);
    hg_free(request);
}

void hg_session_request_fail_all(struct hg_session *s, const struct hg_error *err)
{
    while (s->first) {
        if (s->conn && is_answered(s->first))
            hg_conn_fail(s->conn, s->first->client_id, err);
        hg_session_request_drop(s, s->first);
    }
    if (s->conn)
        return;
    s->resume.parked_ns = 0; // nothing is left to wait for
    s->table->ended = true;
}

// Cameras that have come to the front took effect after all answered requests before them.
static void settle_cameras(struct hg_session *s)
{
    while (s->first && !is_answered(s->first) && s->first->sent) {
        hg_session_view_note_camera(s, s->first->packet);
        hg_session_request_drop(s, s->first);
    }
}

struct hg_request *hg_session_request_find(struct hg_session *s, uint32_t link_id)
{
    for (struct hg_request *it = s->first; it && link_id; it = it->next)
        if (it->link_id == link_id)
            return it;
    return NULL;
}

bool hg_session_request_is_full(const struct hg_session *s)
{
    const struct hg_options *o = s->table->options;
    return s->load.count >= o->max_requests || s->load.bytes > o->input_limit_bytes;
}

bool hg_session_request_is_crowded(const struct hg_session *s)
{
    const struct hg_link *link = s->scene ? s->scene->link : NULL;
    const uint64_t limit = s->table->options->input_limit_bytes;
    if (!link || link->out.bytes + link->feed.unsent_bytes <= limit)
        return false;
    const uint64_t share = limit / 2 / s->table->count;
    return s->load.unsent_bytes > (share > LEAST_SHARE ? share : LEAST_SHARE);
}

// ---- to the worker ------------------------------------------------------------------------------

// The worker gets no more credit than the window allows.
static struct hg_packet *windowed_subscribe(struct hg_session *s, struct hg_packet *packet)
{
    struct hgp_subscribe m;
    if (hgp_decode(HGP_VERSION_MAX, HGP_T_subscribe,
            hg_reader_make(packet->payload, packet->header.length), NULL, &m, NULL))
        return NULL;
    struct hg_session_view *view = hg_session_view_find(s, m.view);
    if (view)
        m.credit_frames = hg_session_view_take_window(s, view);
    return hg_packet_encode(HGP_T_subscribe, &m);
}

static void send_request(struct hg_session *s, struct hg_request *request)
{
    struct hg_link *link = s->scene->link;
    uint16_t type = request->packet->header.type;
    request->link_id = is_answered(request) ? hg_link_next_id(link) : 0;
    request->sent = true;
    s->load.unsent = request->next;
    note_unsent(s, -(int64_t)packet_bytes(request->packet));
    charge(s, request);
    struct hg_packet *packet = type == HGP_T_subscribe ? windowed_subscribe(s, request->packet)
                                                       : hg_packet_ref(request->packet);
    request->sent_ns = link->loop->now_ns;
    if (request->suspect)
        hg_trial_begin(s, request);
    hg_link_send_packet(link, s->number, request->link_id, packet);
}

// Suspects have it in any case: the other sessions wait for them.
static bool has_room(struct hg_session *s, const struct hg_request *request)
{
    return !request->client_id || request->suspect ||
           hg_session_view_may_grant(s, answer_bytes(s, request->packet));
}

static void fail_cancelled(struct hg_session *s, struct hg_request *request)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_CANCELLED, hgp_find(request->packet->header.type)->name, NULL,
        "cancelled by the client");
    if (s->conn)
        hg_conn_fail(s->conn, request->client_id, &err);
    hg_session_request_drop(s, request);
}

// Sends at most about `most` bytes. True: there is more, for the next turn.
static bool send_some(struct hg_session *s, uint64_t most)
{
    struct hg_link *link = s->scene->link;
    struct hg_request *next;
    uint64_t bytes = 0;
    for (struct hg_request *it = s->load.unsent; it && s->attached; it = next) {
        next = it->next;
        if (it->cancelled) {
            fail_cancelled(s, it);
            continue;
        }
        if (hg_trial_must_wait(s, it)) {
            hg_trial_subscribe(s); // a suspect view is not behind what waits for its trial
            return false;
        }
        if (!has_room(s, it))
            return false;
        if (!hg_link_has_room(link) || bytes >= most) {
            link->feed.starved = true;
            return true;
        }
        bytes += packet_bytes(it->packet);
        send_request(s, it);
    }
    if (!s->attached)
        return false;
    settle_cameras(s);
    hg_trial_subscribe(s);
    return false;
}

void hg_session_request_pump(struct hg_session *s)
{
    struct hg_link *link = s->scene ? s->scene->link : NULL;
    if (link && link->feed.starved) // others were before it
        link->feed.pump |= hg_link_has_room(link);
    else if (link)
        send_some(s, UINT64_MAX);
}

static struct hg_session *after(const struct hg_session_table *table, struct hg_session *s)
{
    return s && s->next ? s->next : table->first;
}

void hg_session_request_pump_all(struct hg_session_table *table, struct hg_link *link)
{
    if (hg_trial_holds_all(link))
        return;
    struct hg_session *first = hg_session_find(table, link->feed.turn);
    first = after(table, first);
    bool more = first != NULL;
    while (more && hg_link_has_room(link)) {
        struct hg_session *it = first;
        more = false;
        do {
            if (hg_trial_holds_all(link)) // by what was sent just now
                return;
            if (it->scene && it->scene->link == link && hg_link_has_room(link)) {
                more |= send_some(it, TURN_BYTES);
                link->feed.turn = it->number;
            }
            it = after(table, it);
        } while (it != first);
    }
    link->feed.starved = more || !hg_link_has_room(link);
}

// Two cameras of one view in a row are one.
static bool merge_camera(struct hg_session *s, struct hg_packet *packet)
{
    struct hg_request *last = s->last;
    if (last && last->sent && s->scene && !hg_link_has_room(s->scene->link))
        return false; // the next one merges with those that come behind it
    if (!last || is_answered(last) || last->packet->header.type != packet->header.type ||
        packet->header.request || packet->header.length < 8 ||
        memcmp(last->packet->payload + 4, packet->payload + 4, 4) != 0)
        return false;
    size_t before = packet_bytes(last->packet);
    if (hg_session_view_merge(&last->packet, packet))
        return false;
    s->load.bytes += packet_bytes(last->packet) - before;
    if (!last->sent)
        note_unsent(s, (int64_t)packet_bytes(last->packet) - (int64_t)before);
    if (last->sent && s->attached)
        hg_link_send_packet(s->scene->link, s->number, 0, hg_packet_ref(packet));
    return true;
}

void hg_session_request_relay(struct hg_session *s, struct hg_packet *packet)
{
    uint16_t type = packet->header.type;
    if (type == HGP_T_view_camera && merge_camera(s, packet))
        return;
    struct hg_request *request = add_request(s, packet, packet->header.request);
    if (!request) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_NOMEM, "request", NULL, "no memory for the request");
        hg_conn_fail(s->conn, packet->header.request, &err);
        return;
    }
    hg_trial_meet(s, request);
    hg_session_request_pump(s);
}

// It does not queue behind other requests: what waits for room may wait for the very frame.
void hg_session_request_cancel(struct hg_session *s, const struct hgp_frame_cancel *m)
{
    for (struct hg_request *it = s->first; it; it = it->next) {
        if (!m->request || it->client_id != m->request || !is_frame_request(it->packet) ||
            it->cancelled)
            continue;
        it->cancelled = true;
        if (it->sent && s->attached)
            hg_link_send(s->scene->link, s->number, 0, HGP_T_frame_cancel,
                &(struct hgp_frame_cancel){.view = m->view, .request = it->link_id});
        else
            fail_cancelled(s, it);
        return;
    }
}

// ---- into a worker ------------------------------------------------------------------------------

static void restore_view(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_link *link = s->scene->link;
    if (!view->accepted)
        return; // its view_set is still under way
    hg_link_send_packet(link, s->number, hg_link_next_id(link), hg_packet_ref(view->params));
    if (view->camera)
        hg_link_send_packet(link, s->number, hg_link_next_id(link), hg_packet_ref(view->camera));
    hg_session_look_restore(s, view);
    if (view->subscribed && !view->held)
        hg_session_view_subscribe(s, view);
}

void hg_session_request_restore(struct hg_session *s)
{
    for (struct hg_session_view *it = s->views; it; it = it->next)
        restore_view(s, it);
}

void hg_session_request_tell_tenant(struct hg_session *s)
{
    hg_link_send(s->scene->link, s->number, 0, HGP_T_session_tenant,
        &(struct hgp_session_tenant){.tenant = hgp_str_make(s->tenant),
            .weight = s->scope.weight ? s->scope.weight : HG_TOKEN_WEIGHT,
            .has_roots = s->scope.roots[0] != 0,
            .roots = hgp_str_make(s->scope.roots)});
}

void hg_session_request_attach(struct hg_session *s)
{
    struct hg_link *link = s->scene->link;
    bool restore = s->scene->revision > 0 || s->views;
    hg_link_send(link, s->number, 0, HGP_T_session_attach,
        &(struct hgp_session_attach){.session = s->number,
            .role = s->role,
            .scene = hgp_str_make(s->scene->key),
            .first_id = s->first_id,
            .id_count = HG_SCENE_ID_RANGE,
            .max_pixels = s->table->options->max_pixels,
            .replay = restore});
    hg_session_request_tell_tenant(s);
    if (s->batch_open) // before there is a view that could show half of it
        hg_link_send(link, s->number, hg_link_next_id(link), HGP_T_batch_begin,
            &(struct hgp_batch_begin){0});
    if (!s->resume.parked_ns)
        hg_session_request_restore(s);
    if (restore)
        hg_link_send(link, s->number, 0, HGP_T_replay_end,
            &(struct hgp_replay_end){.revision = s->scene->revision});
    s->attached = true;
    hg_session_request_pump(s);
}
