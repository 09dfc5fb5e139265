// call.c - blocking use: wait, call, and the calls people make most.
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/lib/session.h"

static uint64_t deadline_of(uint64_t timeout_ns)
{
    uint64_t now = hg_clock_now_ns();
    return timeout_ns > UINT64_MAX - now ? UINT64_MAX : now + timeout_ns;
}

static int poll_ms(uint64_t deadline_ns)
{
    uint64_t now = hg_clock_now_ns();
    if (deadline_ns <= now)
        return 0;
    uint64_t ms = (deadline_ns - now + 999999) / 1000000;
    return ms > 1000 ? 1000 : (int)ms; // at least once a second: a silent worker is noticed
}

static bool take_interrupt(struct helio *h)
{
    uint64_t count;
    return read(h->wake_fd, &count, sizeof count) == sizeof count;
}

// A full queue is not added to.
static bool is_full(const struct helio *h)
{
    return h->queue.count >= HG_CLIENT_QUEUE_MESSAGES;
}

static short events_wanted(const struct helio *h)
{
    const struct hg_client_transport *t = &h->transport;
    return t->class ? t->class->wants(t, !is_full(h), helio_want_write(h)) : 0;
}

enum { REDIAL_MS = 20 };

static enum hg_status wait_until(struct helio *h, uint64_t deadline_ns, struct hg_error *err)
{
    const bool was_full = is_full(h);
    for (;;) {
        if (take_interrupt(h))
            return hg_error_set(err, HG_E_CANCELLED, h->url, NULL, "interrupted");
        if (h->error.status)
            return hg_client_failed(h, err);
        const bool is_lost = !h->transport.class; // and dialled again soon
        struct pollfd p[2] = {
            {.fd = helio_fd(h), .events = events_wanted(h)},
            {.fd = h->wake_fd, .events = POLLIN},
        };
        const struct hg_client_transport *t = &h->transport;
        const bool has_input =
            t->class && t->class->has_input && t->class->has_input(t) && !is_full(h);
        int ms = has_input ? 0 : poll_ms(deadline_ns);
        int n = poll(p, 2, is_lost && ms > REDIAL_MS ? REDIAL_MS : ms);
        if (n < 0 && errno != EINTR)
            return hg_client_fail(h, HG_E_IO, NULL, "poll: %s", strerror(errno)),
                   hg_client_failed(h, err);
        enum hg_status status = helio_process(h, err);
        if (status)
            return status;
        if (h->handlers.tick) // signs of life may come before each timeout of the poll
            h->handlers.tick(h->handlers.user);
        if ((n > 0 && p[0].revents) || (is_full(h) && !was_full)) // nothing more would come
            return HG_OK;
        if (hg_clock_now_ns() >= deadline_ns)
            return hg_error_set(err, HG_E_TIMEOUT, h->url, NULL, "no answer in time");
    }
}

enum hg_status helio_wait(struct helio *h, uint64_t timeout_ns, struct hg_error *err)
{
    return wait_until(h, deadline_of(timeout_ns), err);
}

enum hg_status helio_connect(
    const struct helio_options *options, struct helio **out, struct hg_error *err)
{
    enum hg_status status = helio_start(options, out, err);
    if (status)
        return status;
    struct helio *h = *out;
    uint64_t deadline = deadline_of(h->open_timeout_ns);
    while (!status && h->state != HELIO_OPEN)
        status = wait_until(h, deadline, err);
    if (status) {
        helio_destroy(h);
        *out = NULL;
    }
    return status;
}

enum hg_status helio_flush(struct helio *h, struct hg_error *err)
{
    uint64_t deadline = deadline_of(h->timeout_ns);
    while (!h->error.status && helio_want_write(h)) {
        enum hg_status status = wait_until(h, deadline, err);
        if (status)
            return status;
    }
    return hg_client_failed(h, err);
}

// Notices about the scene as a whole go to the handler as well, when there is one.
static bool belongs_to(const struct helio *h, const struct hg_client_message *m, uint32_t request)
{
    return m->pub.request == request ||
           (m->pub.request == 0 && m->pub.type == HGP_T_notice && h->handlers.notice);
}

// Removes and returns the oldest queued message of a request.
static struct hg_client_message *take_answer(struct helio *h, uint32_t request)
{
    struct hg_client_message *before = NULL;
    for (struct hg_client_message *m = h->queue.first; m; before = m, m = m->next) {
        if (!belongs_to(h, m, request))
            continue;
        hg_client_queue_take(&h->queue, before, m);
        return m;
    }
    return NULL;
}

static bool handle_companion(struct helio *h, const struct hg_client_message *m)
{
    if (m->pub.type == HGP_T_progress) {
        if (h->handlers.progress)
            h->handlers.progress(h->handlers.user, &m->body.progress);
        return true;
    }
    if (m->pub.type == HGP_T_notice) {
        if (h->handlers.notice)
            h->handlers.notice(h->handlers.user, &m->body.notice);
        return true;
    }
    return false;
}

enum hg_status helio_message_error(
    const struct helio *h, const struct helio_message *message, struct hg_error *err)
{
    if (message->type != HGP_T_error)
        return HG_OK;
    const struct hgp_error *e = &message->body->error;
    char what[sizeof err->what], where[sizeof err->where];
    snprintf(what, sizeof what, "%.*s", (int)e->what.size, e->what.data ? e->what.data : "");
    snprintf(where, sizeof where, "%.*s", (int)e->where.size, e->where.data ? e->where.data : "");
    enum hg_status status = e->code ? (enum hg_status)e->code : HG_E_INTERNAL;
    hg_error_set(err, status, what, where, "%.*s", (int)e->reason.size,
        e->reason.data ? e->reason.data : "");
    hg_client_add_limit(h, message->request, err);
    return status;
}

// Handles queued companions of a request; true when its answer is in *answer or *status failed.
static bool find_answer(struct helio *h, uint32_t request, struct hg_client_message **answer,
    enum hg_status *status, struct hg_error *err)
{
    struct hg_client_message *m;
    while ((m = take_answer(h, request))) {
        if (!handle_companion(h, m)) {
            *status = helio_message_error(h, &m->pub, err);
            if (*status)
                hg_client_message_destroy(m);
            else
                *answer = m;
            return true;
        }
        hg_client_message_destroy(m);
    }
    return false;
}

// A request that waits for its answer.
struct call {
    enum hgp_type type;
    const void *message;
    uint32_t request;
    uint64_t deadline;
};

// The server renders nothing more for a frame that was given up.
static void cancel_frame(struct helio *h, const struct call *call)
{
    struct hgp_frame_cancel cancel = {.request = call->request};
    struct hg_error ignored = {0};
    uint32_t id;
    if (call->type == HGP_T_frame_request)
        cancel.view = ((const struct hgp_frame_request *)call->message)->view;
    else if (call->type == HGP_T_exposure_query)
        cancel.view = ((const struct hgp_exposure_query *)call->message)->view;
    else
        return;
    // Without room to send it the frame is rendered after all.
    if (helio_send(h, HGP_T_frame_cancel, &cancel, &id, &ignored) == HG_OK)
        hg_client_queue_give_up(&h->queue, id);
}

// HG_E_AGAIN: the connection was lost, and with it the answer.
static enum hg_status wait_answer(struct helio *h, const struct call *call,
    struct hg_client_message **answer, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    const uint32_t losses = h->resume.losses;
    *answer = NULL;
    for (;;) {
        enum hg_status found;
        // An answer that came before the connection ended still counts.
        if (find_answer(h, call->request, answer, &found, err))
            return found;
        if (status)
            return status;
        if (h->resume.losses != losses)
            return HG_E_AGAIN;
        const bool is_stuck = is_full(h);
        status = is_stuck
                     ? hg_error_set(err, HG_E_STATE, h->url, NULL,
                           "%d received messages wait for helio_next", HG_CLIENT_QUEUE_MESSAGES)
                     : wait_until(h, call->deadline, err);
        if (is_stuck || (status && !h->error.status)) {
            hg_client_queue_give_up(&h->queue, call->request);
            cancel_frame(h, call);
            return status;
        }
    }
}

// Done twice they do what they do once.
static bool may_repeat(enum hgp_type type)
{
    switch (type) {
    case HGP_T_asset_load:
    case HGP_T_asset_unload:
    case HGP_T_object_remove:
    case HGP_T_batch_begin:
    case HGP_T_batch_end:
    case HGP_T_upload:
    case HGP_T_image_query: // a file in parts
    case HGP_T_scene_open:
    case HGP_T_scene_close:
    case HGP_T_view_close:
    case HGP_T_annotation_set:
    case HGP_T_annotation_remove:
    case HGP_T_join_make:
    case HGP_T_message_send:
    case HGP_T_kick:
        return false;
    default:
        return true;
    }
}

static enum hg_status send_when_possible(struct helio *h, struct call *call, struct hg_error *err)
{
    enum hg_status status = helio_send(h, call->type, call->message, &call->request, err);
    while (status == HG_E_AGAIN) {
        status = wait_until(h, call->deadline, err);
        if (!status)
            status = helio_send(h, call->type, call->message, &call->request, err);
    }
    return status;
}

enum hg_status helio_call(struct helio *h, enum hgp_type type, const void *message,
    struct helio_message **answer, struct hg_error *err)
{
    struct call call = {.type = type, .message = message, .deadline = deadline_of(h->timeout_ns)};
    struct hg_client_message *got = NULL;
    if (answer)
        *answer = NULL;
    enum hg_status status;
    do {
        status = send_when_possible(h, &call, err);
        if (!status)
            status = wait_answer(h, &call, &got, err);
    } while (status == HG_E_AGAIN && may_repeat(type));
    if (status == HG_E_AGAIN)
        status = hg_error_set(err, HG_E_CLOSED, hgp_find((uint16_t)type)->name, NULL,
            "the connection was lost while this was under way; it may have been done");
    if (status)
        return status;
    if (answer)
        *answer = &got->pub;
    else
        hg_client_message_destroy(got);
    return HG_OK;
}

enum hg_status helio_call_for(struct helio *h, enum hgp_type type, const void *message,
    enum hgp_type answer_type, struct helio_message **answer, struct hg_error *err)
{
    struct helio_message *got;
    if (answer)
        *answer = NULL;
    enum hg_status status = helio_call(h, type, message, &got, err);
    if (status)
        return status;
    if (got->type != answer_type) {
        status = hg_error_set(err, HG_E_FORMAT, hgp_find((uint16_t)type)->name, NULL,
            "the server answered with '%s'", hgp_find((uint16_t)got->type)->name);
        helio_message_free(got);
        return status;
    }
    if (answer)
        *answer = got;
    else
        helio_message_free(got);
    return HG_OK;
}

enum hg_status helio_ping(struct helio *h, uint64_t *rtt_ns, struct hg_error *err)
{
    struct helio_message *answer;
    uint64_t begin = hg_clock_now_ns();
    struct hgp_ping ping = {.nonce = begin};
    *rtt_ns = 0;
    enum hg_status status = helio_call_for(h, HGP_T_ping, &ping, HGP_T_pong, &answer, err);
    if (status)
        return status;
    if (answer->body->pong.nonce != begin)
        status = hg_error_set(err, HG_E_FORMAT, "pong", "nonce", "not the one that was sent");
    else
        h->rtt_ns = *rtt_ns = answer->received_ns - begin;
    helio_message_free(answer);
    return status;
}

enum hg_status helio_scene_open(
    struct helio *h, const char *name, struct hgp_scene_opened *out, struct hg_error *err)
{
    *out = (struct hgp_scene_opened){0};
    if (h->embedded && *name)
        return hg_error_set(err, HG_E_UNSUPPORTED, name, NULL,
            "a private worker has no named scenes; connect to a daemon");
    if (h->embedded && h->server.has_scene)
        return hg_error_set(err, HG_E_STATE, "scene_open", NULL, "close the open scene first");
    if (h->embedded) { // session_attach has opened it
        h->server.has_scene = !h->error.status;
        *out = (struct hgp_scene_opened){.first_id = 1, .id_count = HG_CLIENT_PRIVATE_IDS};
        return h->error.status ? hg_client_failed(h, err) : HG_OK;
    }
    struct helio_message *answer;
    struct hgp_scene_open open = {.name = hgp_str_make(name)};
    enum hg_status status =
        helio_call_for(h, HGP_T_scene_open, &open, HGP_T_scene_opened, &answer, err);
    if (status)
        return status;
    *out = answer->body->scene_opened;
    helio_message_free(answer);
    return HG_OK;
}

enum hg_status helio_load(struct helio *h, uint32_t asset, const char *path,
    struct hgp_asset_loaded *out, struct hg_error *err)
{
    struct helio_message *answer;
    struct hgp_asset_load load = {.asset = asset, .path = hgp_str_make(path)};
    *out = (struct hgp_asset_loaded){0};
    enum hg_status status =
        helio_call_for(h, HGP_T_asset_load, &load, HGP_T_asset_loaded, &answer, err);
    if (status)
        return status;
    *out = answer->body->asset_loaded;
    helio_message_free(answer);
    return HG_OK;
}

enum hg_status helio_frame(struct helio *h, const struct hgp_frame_request *request,
    struct helio_message **out, struct hg_error *err)
{
    return helio_call_for(h, HGP_T_frame_request, request, HGP_T_frame, out, err);
}

enum hg_status helio_camera_fit(struct helio *h, const struct hgp_view_fit *fit,
    struct hgp_view_camera *camera, struct hg_error *err)
{
    struct helio_message *answer;
    enum hg_status status = helio_call_for(h, HGP_T_view_fit, fit, HGP_T_view_fitted, &answer, err);
    if (status)
        return status;
    const struct hgp_view_fitted *found = &answer->body->view_fitted;
    camera->has_camera = found->camera != 0;
    camera->camera = found->camera;
    if (!found->camera) {
        memcpy(camera->eye, found->eye, sizeof camera->eye);
        memcpy(camera->target, found->target, sizeof camera->target);
        memcpy(camera->up, found->up, sizeof camera->up);
        camera->kind = found->kind;
        camera->vfov_rad = found->vfov_rad;
        camera->half_height = found->half_height;
        camera->has_eye = camera->has_target = camera->has_up = true;
        camera->has_kind = camera->has_vfov_rad = camera->has_half_height = true;
    }
    helio_message_free(answer);
    return HG_OK;
}

enum hg_status helio_query_json(
    struct helio *h, enum hgp_type type, uint32_t view, char **text, struct hg_error *err)
{
    struct helio_message *answer;
    union hgp_any query = {0};
    *text = NULL;
    if (type != HGP_T_stats_query && type != HGP_T_info_query && type != HGP_T_sessions_query &&
        type != HGP_T_quarantine_query && type != HGP_T_join_query)
        return hg_error_set(err, HG_E_INVAL, "query", NULL, "not a query answered with JSON");
    if (type == HGP_T_stats_query)
        query.stats_query.view = view;
    enum hg_status status = helio_call_for(h, type, &query, HGP_T_json, &answer, err);
    if (status)
        return status;
    const struct hgp_str *json = &answer->body->json.text;
    *text = hg_strndup(json->data ? json->data : "", json->size);
    helio_message_free(answer);
    if (!*text)
        return hg_error_set(err, HG_E_NOMEM, "answer", NULL, "no memory");
    return HG_OK;
}

void helio_text_free(char *text)
{
    hg_free(text);
}
