// session.c - the conversation's states: hello, authentication, open; or a worker that starts.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/lib/session.h"

static enum hg_status send_hello(struct helio *h)
{
    hg_write_bytes(&h->out, HGP_PREFACE, HGP_PREFACE_BYTES);
    struct hgp_hello hello = {
        .version_min = HGP_VERSION_MIN,
        .version_max = HGP_VERSION_MAX,
        .client = hgp_str_make(h->client),
    };
    struct hg_error err = {0};
    enum hg_status status =
        h->out.failed ? HG_E_NOMEM : hg_client_enqueue(h, HGP_T_hello, 0, &hello, &err);
    return status ? hg_client_fail(h, status, NULL, "cannot say hello: %s", err.reason) : HG_OK;
}

enum hg_status hg_client_greet(struct helio *h)
{
    h->state = HELIO_GREETING;
    h->heard_ns = hg_clock_now_ns();
    return h->embedded ? HG_OK : send_hello(h);
}

static enum hg_status fail_from_error(struct helio *h, const struct hgp_error *error)
{
    enum hg_status status = error->code ? (enum hg_status)error->code : HG_E_INTERNAL;
    char where[128];
    snprintf(where, sizeof where, "%.*s", (int)error->where.size,
        error->where.data ? error->where.data : "");
    status = hg_client_fail(h, status, where, "%.*s", (int)error->reason.size,
        error->reason.data ? error->reason.data : "");
    hg_client_add_limit(h, 0, &h->error);
    return status;
}

// It comes right before the error that it is of.
static void take_limit(struct helio *h, const struct hgp_limited *m)
{
    h->server.limited.is_set = true;
    h->server.limited.request = m->request;
    h->server.limited.retry_after_ms = m->retry_after_ms;
    snprintf(h->server.limited.limit, sizeof h->server.limited.limit, "%.*s", (int)m->limit.size,
        m->limit.size ? m->limit.data : "");
}

void hg_client_add_limit(const struct helio *h, uint32_t request, struct hg_error *err)
{
    if (h->server.limited.is_set && h->server.limited.request == request)
        hg_error_limit(err, h->server.limited.limit, h->server.limited.retry_after_ms);
}

// The session is open: it is kept from now on, or gives way to the one that was lost.
static enum hg_status on_open(struct helio *h)
{
    struct hg_client_resume *r = &h->resume;
    struct hg_error err = {0};
    enum hg_status status = HG_OK;
    if (!r->deadline_ns)
        h->state = HELIO_OPEN;
    if (r->deadline_ns)
        status = hg_client_enqueue(h, HGP_T_resume, HG_CLIENT_OWN_REQUEST,
            &(struct hgp_resume){.secret = {r->secret, r->secret_bytes}}, &err);
    else if (r->patience_ns)
        status =
            hg_client_enqueue(h, HGP_T_keep, HG_CLIENT_OWN_REQUEST, &(struct hgp_keep){0}, &err);
    return status ? hg_client_fail(h, status, NULL, "%s", err.reason) : HG_OK;
}

static void take_secret(struct helio *h, struct hgp_bytes secret)
{
    if (secret.size)
        memcpy(h->resume.secret, secret.data, secret.size);
    h->resume.secret_bytes = secret.size;
}

static enum hg_status on_resumed(struct helio *h, const struct hgp_resumed *m)
{
    take_secret(h, m->secret);
    h->server.session = m->session;
    h->resume.deadline_ns = 0;
    h->resume.done++;
    h->state = HELIO_OPEN;
    return HG_OK;
}

static enum hg_status on_welcome(struct helio *h, const struct hgp_welcome *welcome)
{
    if (welcome->version < HGP_VERSION_MIN || welcome->version > HGP_VERSION_MAX)
        return hg_client_fail(
            h, HG_E_VERSION, "version", "the server chose protocol version %u", welcome->version);
    h->server.version = welcome->version;
    h->server.session = welcome->session;
    h->server.role = welcome->role;
    h->server.send_limit = welcome->max_message_bytes;
    snprintf(h->server.name, sizeof h->server.name, "%.*s", (int)welcome->server.size,
        welcome->server.data ? welcome->server.data : "");
    if (!welcome->auth_required && !h->token)
        return on_open(h);
    if (!h->token)
        return hg_client_fail(h, HG_E_AUTH, "token", "the server asks for a token");
    if (!welcome->auth_required) // open already: the token is not needed
        return on_open(h);
    const struct hgp_auth auth = {.token = hgp_str_make(h->token)};
    const struct hgp_auth_resume again = {
        .token = auth.token, .secret = {h->resume.secret, h->resume.secret_bytes}};
    struct hg_error err = {0};
    enum hg_status status = h->resume.deadline_ns
                                ? hg_client_enqueue(h, HGP_T_auth_resume, 0, &again, &err)
                                : hg_client_enqueue(h, HGP_T_auth, 0, &auth, &err);
    h->auth_sent = true;
    return status ? hg_client_fail(h, HG_E_AUTH, "token", "%s", err.reason) : HG_OK;
}

enum hg_status hg_client_next_scene(struct helio *h, uint32_t request, struct hg_error *err)
{
    char name[32];
    snprintf(name, sizeof name, "private %u", h->server.channel + 1);
    const struct hgp_session_attach attach = {
        .session = 1,
        .role = HGP_role_ADMIN,
        .scene = hgp_str_make(name),
        .first_id = 1,
        .id_count = HG_CLIENT_PRIVATE_IDS,
        .max_pixels = UINT64_MAX,
    };
    enum hg_status status = HG_OK;
    if (h->server.channel)
        status =
            hg_client_enqueue(h, HGP_T_session_detach, 0, &(struct hgp_session_detach){0}, err);
    if (status)
        return status;
    h->server.channel++;
    h->server.has_scene = false;
    return hg_client_enqueue(h, HGP_T_session_attach, request, &attach, err);
}

static enum hg_status on_worker_ready(struct helio *h, const struct hgp_worker_ready *ready)
{
    char *device = hg_strndup(ready->device.data ? ready->device.data : "", ready->device.size);
    if (!device)
        return hg_client_fail(h, HG_E_NOMEM, NULL, "no memory for the device's description");
    hg_free(h->server.device);
    h->server.device = device;
    snprintf(h->server.name, sizeof h->server.name, "helio-worker");
    h->server.role = HGP_role_ADMIN;
    struct hg_error err = {0};
    enum hg_status status = hg_client_next_scene(h, 0, &err);
    if (status)
        return hg_client_fail(h, status, NULL, "cannot attach: %s", err.reason);
    h->state = HELIO_OPEN;
    return HG_OK;
}

static enum hg_status greeting(struct helio *h, const struct hg_client_message *message)
{
    if (!h->embedded && message->pub.type == HGP_T_welcome && !h->auth_sent && !h->server.name[0])
        return on_welcome(h, &message->body.welcome);
    if (!h->embedded && message->pub.type == HGP_T_join_scene && h->auth_sent) {
        const struct hgp_str *scene = &message->body.join_scene.scene;
        snprintf(h->server.scene, sizeof h->server.scene, "%.*s", (int)scene->size,
            scene->size ? scene->data : "");
        return HG_OK;
    }
    if (!h->embedded && message->pub.type == HGP_T_auth_ok && h->auth_sent) {
        h->server.role = message->body.auth_ok.role;
        return on_open(h);
    }
    if (h->resume.deadline_ns && message->pub.type == HGP_T_resumed)
        return on_resumed(h, &message->body.resumed);
    if (h->embedded && message->pub.type == HGP_T_worker_ready)
        return on_worker_ready(h, &message->body.worker_ready);
    return hg_client_fail(h, HG_E_STATE, NULL, "'%s' is not expected before the session is open",
        hgp_find((uint16_t)message->pub.type)->name);
}

// What a program that does not take messages need not know must not fill the queue.
static bool is_crowded(const struct helio *h)
{
    return h->queue.count >= HG_CLIENT_QUEUE_MESSAGES / 4;
}

static bool may_come_from_server(const struct helio *h, enum hgp_type type)
{
    enum hgp_direction direction = hgp_find((uint16_t)type)->direction;
    return direction == HGP_S2C || direction == HGP_ANY || (h->embedded && direction == HGP_W2B);
}

// A private worker's error without a request is that of a message that wanted no answer. A daemon
// tells it as a notice.
static void error_to_notice(const struct helio *h, struct hg_client_message *message)
{
    if (!h->embedded || message->header.channel != h->server.channel ||
        message->pub.type != HGP_T_error || message->pub.request)
        return;
    const struct hgp_error error = message->body.error;
    message->pub.type = HGP_T_notice;
    message->body.notice = (struct hgp_notice){
        .code = error.code, .what = error.what, .where = error.where, .reason = error.reason};
}

// Messages that the library answers or keeps for itself. True when the message is used up.
static bool handle_own(
    struct helio *h, const struct hg_client_message *message, enum hg_status *status)
{
    struct hg_error err = {0};
    *status = HG_OK;
    switch (message->pub.type) {
    case HGP_T_pulse:
        if (h->embedded && message->body.pulse.busy_ns > HG_CLIENT_WORKER_STEP)
            *status = hg_client_fail(h, HG_E_WORKER, NULL,
                "the private worker hangs: it has been in one step of rendering for %u s",
                (unsigned)(message->body.pulse.busy_ns / HG_CLIENT_SECOND_NS));
        return true;
    case HGP_T_busy: // for brokers; comes before pulses
        return true;
    case HGP_T_ping:
        *status = hg_client_enqueue(h, HGP_T_pong, message->pub.request,
            &(struct hgp_pong){.nonce = message->body.ping.nonce}, &err);
        if (*status)
            *status = hg_client_fail(h, *status, NULL, "cannot answer a ping: %s", err.reason);
        return true;
    case HGP_T_limited:
        take_limit(h, &message->body.limited);
        return true;
    case HGP_T_drain_cancelled:
        h->draining = false;
        return true;
    case HGP_T_message:
        if (h->handlers.message)
            h->handlers.message(h->handlers.user, &message->body.message);
        return h->handlers.message || is_crowded(h);
    case HGP_T_idle_warning:
        if (h->handlers.idle)
            h->handlers.idle(h->handlers.user, &message->body.idle_warning);
        return h->handlers.idle || is_crowded(h);
    case HGP_T_ticket:
        if (message->pub.request == HG_CLIENT_OWN_REQUEST)
            take_secret(h, message->body.ticket.secret);
        return message->pub.request == HG_CLIENT_OWN_REQUEST;
    case HGP_T_error: // keep may be refused: then the session is not kept
        if (message->pub.request == 0 ||
            (message->pub.request == HG_CLIENT_OWN_REQUEST && h->resume.deadline_ns))
            *status = fail_from_error(h, &message->body.error);
        return *status != HG_OK || message->pub.request == HG_CLIENT_OWN_REQUEST;
    case HGP_T_bye:
        if (h->draining && h->resume.secret_bytes) { // its successor goes on
            *status = hg_client_fail_lost(h, "the server said goodbye");
            return true;
        }
        *status = hg_client_fail(h, HG_E_CLOSED, NULL, "the server said goodbye: %.*s",
            (int)message->body.bye.reason.size,
            message->body.bye.reason.data ? message->body.bye.reason.data : "");
        return true;
    default:
        return false;
    }
}

enum hg_status hg_client_dispatch(struct helio *h, struct hg_client_message *message)
{
    enum hg_status status = HG_OK;
    h->heard_ns = hg_clock_now_ns();
    bool used = true;
    error_to_notice(h, message);
    if (!may_come_from_server(h, message->pub.type)) {
        status = hg_client_fail(h, HG_E_STATE, NULL, "'%s' is not a message that servers send",
            hgp_find((uint16_t)message->pub.type)->name);
    } else if (!handle_own(h, message, &status)) {
        if (h->state == HELIO_GREETING) {
            status = greeting(h, message);
        } else if (!hg_client_queue_drops(&h->queue, message)) {
            h->draining |= message->pub.type == HGP_T_drain;
            if (h->tap.received)
                h->tap.received(h->tap.user, &message->pub);
            hg_client_queue_push(&h->queue, message);
            used = false;
        }
    }
    if (used)
        hg_client_message_destroy(message);
    return status;
}
