#include "server/broker/session/session_answer.h"

#include <stdio.h>

#include "base/clock.h"
#include "base/log.h"
#include "server/broker/metrics/counters.h"
#include "server/broker/metrics/latency.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_camera.h"
#include "server/broker/session/session_look.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_share.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"
#include "server/broker/workers/trial.h"

// A view_set of the same number that is already on its way creates the view again.
static void close_view(
    struct hg_session *s, struct hg_session_view *view, const struct hg_request *request)
{
    for (const struct hg_request *it = request->next; it; it = it->next) {
        struct hgp_view_set m;
        const struct hg_packet *packet = it->packet;
        if (packet->header.type == HGP_T_view_set &&
            hgp_decode(HGP_VERSION_MAX, HGP_T_view_set,
                hg_reader_make(packet->payload, packet->header.length), NULL, &m, NULL) == HG_OK &&
            m.view == view->number) {
            hg_session_view_clear(s, view);
            hg_session_view_reset(view);
            return;
        }
    }
    hg_session_view_remove(s, view);
}

// Its answer waits until it is durable.
static void log_edit(struct hg_session *s, const struct hg_request *request)
{
    uint64_t position = hg_state_put_edit(
        s->table->scenes.log, s->scene->number, s->scene->revision, request->packet);
    if (s->conn && request->client_id)
        hg_outq_hold(&s->conn->out, position);
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
        else
            log_edit(s, request);
        hg_session_share_edited(s, packet);
    } else if (type == HGP_T_batch_begin || type == HGP_T_batch_end) {
        s->batch_open = type == HGP_T_batch_begin;
        hg_session_record(s);
    } else if (type == HGP_T_view_set || type == HGP_T_view_close) {
        if (hgp_decode(HGP_VERSION_MAX, type,
                hg_reader_make(packet->payload, packet->header.length), NULL, &any, NULL))
            return;
        struct hg_session_view *view = hg_session_view_find(
            s, type == HGP_T_view_set ? any.view_set.view : any.view_close.view);
        if (view && type == HGP_T_view_close) {
            hg_session_record_view_end(s, view);
            close_view(s, view, request);
        } else if (view && hg_session_view_merge(&view->params, packet) == HG_OK) {
            view->accepted = true;
            hg_session_record_view(s, view);
            hg_session_camera_accepted(s, view);
        }
    } else if (type == HGP_T_view_camera) {
        hg_session_view_note_camera(s, packet);
    } else if (type == HGP_T_view_clip || type == HGP_T_view_overrides ||
               type == HGP_T_view_variant) {
        hg_session_look_note(s, packet);
    }
}

// A view that the worker never took does not count.
static void note_refused(struct hg_session *s, struct hg_request *request)
{
    struct hgp_view_set m;
    const struct hg_packet *packet = request->packet;
    if (packet->header.type != HGP_T_view_set ||
        hgp_decode(HGP_VERSION_MAX, HGP_T_view_set,
            hg_reader_make(packet->payload, packet->header.length), NULL, &m, NULL))
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
    if (known &&
        hgp_decode(HGP_VERSION_MAX, type, hg_reader_make(packet->payload, packet->header.length),
            &arena, &any, NULL) == HG_OK) {
        uint32_t count = type == HGP_T_asset_load ? any.asset_load.files.count : 0;
        for (uint32_t i = 0; i < count; i++)
            hg_upload_store_forget(s->table->store, any.asset_load.files.items[i].hash);
        if (type == HGP_T_environment_set && any.environment_set.has_hash)
            hg_upload_store_forget(s->table->store, any.environment_set.hash);
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

// When it is put behind what the client is to be sent already.
static void stamp_sent(
    struct hg_session_view *view, struct hg_packet *packet, const struct hgp_frame *m)
{
    size_t at;
    const uint64_t now_ns = hg_clock_now_ns();
    const struct hg_reader payload = hg_reader_make(packet->payload, packet->header.length);
    if (!packet->header.request && m->input_seq > view->shown_seq) {
        view->shown_seq = m->input_seq;
        hg_latency_note(m, now_ns);
    }
    if (!hgp_field_find(HGP_VERSION_MAX, HGP_T_frame, payload, "sent_ns", &at))
        return;
    for (size_t i = 0; i < 8; i++)
        packet->payload[at + i] = (uint8_t)(now_ns >> (8 * i));
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
    hg_session_view_grant_all(s);
}

static void relay_answer(struct hg_session *s, struct hg_packet *packet, uint32_t client_id)
{
    bool lossy = packet->header.type == HGP_T_progress;
    if (s->conn && client_id && !(lossy && hg_conn_is_slow(s->conn)))
        hg_conn_send_packet(s->conn, client_id, hg_packet_ref(packet));
}

// It comes right before its error; what an unanswered request fails with is told at once.
static void note_limit(struct hg_session *s, const struct hgp_limited *m)
{
    struct hg_request *request = hg_session_request_find(s, m->request);
    struct hg_request_limit limit = {.retry_after_ms = m->retry_after_ms};
    snprintf(limit.name, sizeof limit.name, "%.*s", (int)m->limit.size, m->limit.data);
    if (request)
        request->limit = limit;
    else if (!m->request && s->conn)
        hg_conn_tell_limit(s->conn, 0, limit.name, limit.retry_after_ms);
}

// Failures of requests that wanted no answer, and warnings about the scene.
static void relay_unasked(struct hg_session *s, struct hg_packet *packet, const union hgp_any *m)
{
    if (!s->conn)
        return;
    if (packet->header.type == HGP_T_notice || packet->header.type == HGP_T_view_codec)
        hg_conn_send_packet(s->conn, 0, hg_packet_ref(packet));
    else if (packet->header.type == HGP_T_error)
        hg_conn_send(s->conn, 0, HGP_T_notice,
            &(struct hgp_notice){.code = m->error.code,
                .what = m->error.what,
                .where = m->error.where,
                .reason = m->error.reason});
}

// How much answers to queries may be.
static void note_size(
    struct hg_session *s, const struct hg_request *request, const struct hg_packet *packet)
{
    uint16_t type = request->packet->header.type;
    if (!hg_journal_wants(type) && type != HGP_T_frame_request &&
        packet->header.type != HGP_T_error && packet->header.length > s->answers.query_bytes)
        s->answers.query_bytes = packet->header.length;
}

// Device, memory, disk and bugs are the operator's business; the rest is between client and worker.
static void note_failure(struct hg_session *s, uint16_t type, const struct hgp_error *m)
{
    static const uint32_t ours = 1u << HG_E_NOMEM | 1u << HG_E_NOSPACE | 1u << HG_E_DEVICE |
                                 1u << HG_E_DEVICE_LOST | 1u << HG_E_INTERNAL;
    hg_count_error(m->code);
    if (s->conn && m->code < 32 && ours >> m->code & 1)
        hg_peer_warn(&s->conn->table->log, s->table->loop->now_ns, SESSION,
            "session %llu (%s): %s failed: %.*s: %.*s (%s)", (unsigned long long)s->number, s->name,
            hgp_find(type)->name, (int)m->what.size, m->what.size ? m->what.data : "",
            (int)m->reason.size, m->reason.size ? m->reason.data : "",
            hg_status_name((enum hg_status)m->code));
}

static void finish_request(struct hg_session *s, struct hg_request *request,
    struct hg_packet *packet, const union hgp_any *m)
{
    bool failed = packet->header.type == HGP_T_error;
    if (request->packet->header.type == HGP_T_image_query && packet->header.type != HGP_T_ok)
        hg_session_upload_verified(s, request);
    if (failed && m->error.code == HG_E_HASH)
        forget_uploads(s, request->packet);
    hg_session_audit_answer(s, request->packet, failed ? (enum hg_status)m->error.code : HG_OK);
    if (failed)
        note_failure(s, request->packet->header.type, &m->error);
    if (failed)
        note_refused(s, request);
    else
        note_accepted(s, request);
    hg_trial_passed(s, request->packet); // loaded or refused: the worker lives
    request->answered = true;
    hg_session_look_renumber(s, request->packet, packet);
    note_size(s, request, packet);
    if (failed && s->conn)
        hg_conn_tell_limit(
            s->conn, request->client_id, request->limit.name, request->limit.retry_after_ms);
    if (request->client_id)
        relay_answer(s, packet, request->client_id);
    else if (failed)
        relay_unasked(s, packet, m);
    hg_session_request_drop(s, request);
}

void hg_session_answer(struct hg_session *s, struct hg_packet *packet, union hgp_any *m)
{
    uint16_t type = packet->header.type;
    struct hg_request *request = hg_session_request_find(s, packet->header.request);
    note_revision(s, type, m);
    if (type == HGP_T_limited)
        note_limit(s, &m->limited);
    if (type == HGP_T_frame) {
        struct hg_session_view *view = hg_session_view_find(s, m->frame.view);
        hg_count(HG_COUNT_FRAMES);
        if (view) {
            renumber(view, packet, &m->frame);
            stamp_sent(view, packet, &m->frame);
            view->frame_bytes = packet->header.length;
        }
        hg_session_view_count(s, packet, &m->frame);
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
    hg_session_request_pump(s);
    if (s->conn)
        hg_conn_update(s->conn);
    else
        hg_session_end_if_idle(s);
}
