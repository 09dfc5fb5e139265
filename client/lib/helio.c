// helio.c - the public calls that do not wait: start, send, process, next, end.
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/lib/dial.h"
#include "client/lib/receive.h"

const char *helio_version(void)
{
    return HELIO_VERSION;
}

static bool keep_text(char **out, const char *text)
{
    *out = text ? hg_strdup(text) : NULL;
    return !text || *out;
}

// They are needed again when the connection is lost.
static enum hg_status keep_tls(struct helio *h, const struct helio_options *o)
{
    h->resume.tls.insecure = o->tls_insecure;
    return keep_text(&h->resume.tls.ca, o->tls_ca) && keep_text(&h->resume.tls.pin, o->tls_pin) &&
                   keep_text(&h->resume.tls.cert, o->tls_cert) &&
                   keep_text(&h->resume.tls.key, o->tls_key)
               ? HG_OK
               : HG_E_NOMEM;
}

static enum hg_status prepare(
    struct helio *h, const struct helio_options *options, struct hg_error *err)
{
    h->transport.fd = h->wake_fd = -1;
    h->in.frames = &hg_client_frames;
    h->next_request = 1;
    h->server.version = HGP_VERSION_MAX;
    h->timeout_ns = HELIO_NO_TIMEOUT;
    h->open_timeout_ns = options->timeout_ns ? options->timeout_ns : 30 * HG_CLIENT_SECOND_NS;
    h->receive_limit =
        options->max_receive_bytes ? options->max_receive_bytes : HGP_LIMIT_OPEN_DEFAULT;
    h->server.send_limit = HGP_LIMIT_OPEN_DEFAULT;
    h->heard_ns = hg_clock_now_ns();
    if (options->scene && strlen(options->scene) >= sizeof h->resume.scene)
        return hg_error_set(err, HG_E_INVAL, "scene", NULL, "a scene's name has at most %zu bytes",
            sizeof h->resume.scene - 1);
    snprintf(h->resume.scene, sizeof h->resume.scene, "%s", options->scene ? options->scene : "");
    snprintf(h->url, sizeof h->url, "%s", options->url ? options->url : "private worker");
    snprintf(h->client, sizeof h->client, "%s",
        options->client ? options->client : "libhelio/" HELIO_VERSION);
    h->server.device = hg_strdup("");
    if (options->token)
        h->token = hg_strdup(options->token);
    if (!h->server.device || (options->token && !h->token))
        return hg_error_set(err, HG_E_NOMEM, h->url, NULL, "no memory for a connection");
    enum hg_status trusted = keep_tls(h, options);
    if (trusted)
        return hg_error_set(err, trusted, h->url, NULL, "no memory for a connection");
    h->resume.patience_ns = options->url ? options->reconnect_ns : 0;
    h->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (h->wake_fd < 0)
        return hg_error_set(
            err, hg_status_from_errno(errno), h->url, NULL, "eventfd: %s", strerror(errno));
    return HG_OK;
}

static enum hg_status create(
    const struct helio_options *options, struct helio **out, struct hg_error *err)
{
    struct helio *h = hg_calloc(1, sizeof *h);
    *out = h;
    if (!h)
        return hg_error_set(err, HG_E_NOMEM, "connection", NULL, "no memory for a connection");
    return prepare(h, options, err);
}

static enum hg_status begin(
    struct helio *h, enum hg_status status, struct helio **out, struct hg_error *err)
{
    if (!status && h->state == HELIO_GREETING && hg_client_greet(h))
        status = hg_client_failed(h, err);
    if (status)
        helio_destroy(h);
    *out = status ? NULL : h;
    return status;
}

static enum hg_status dial(struct helio *h, const char *url, struct hg_error *err)
{
    enum hg_status status = hg_client_dial(&h->transport, url, err);
    h->state = h->transport.connecting ? HELIO_CONNECTING : HELIO_GREETING;
    return status;
}

static enum hg_status adopt(struct helio *h, int fd, struct hg_error *err)
{
    h->state = HELIO_GREETING;
    enum hg_status status = hg_client_transport_adopt(&h->transport, fd);
    return status ? hg_error_set(err, status, h->url, NULL, "not an open socket") : HG_OK;
}

static enum hg_status start_worker(
    struct helio *h, const struct helio_options *options, struct hg_error *err)
{
    int fd;
    h->embedded = true;
    enum hg_status status =
        hg_client_worker_start(options->worker, options->worker_args, &h->worker_pid, &fd, err);
    return status ? status : adopt(h, fd, err);
}

enum hg_status helio_start(
    const struct helio_options *options, struct helio **out, struct hg_error *err)
{
    struct helio *h;
    enum hg_status status = create(options, &h, err);
    if (!status)
        status = options->url ? dial(h, options->url, err) : start_worker(h, options, err);
    return begin(h, status, out, err);
}

enum hg_status helio_start_fd(
    const struct helio_options *options, int fd, struct helio **out, struct hg_error *err)
{
    struct helio *h;
    enum hg_status status = create(options, &h, err);
    if (status)
        close(fd);
    else
        status = adopt(h, fd, err);
    return begin(h, status, out, err);
}

void helio_destroy(struct helio *h)
{
    if (!h)
        return;
    hg_free(h->resume.tls.ca);
    hg_free(h->resume.tls.pin);
    hg_free(h->resume.tls.cert);
    hg_free(h->resume.tls.key);
    hg_client_transport_close(&h->transport);
    if (h->wake_fd >= 0)
        close(h->wake_fd);
    hg_client_worker_stop(&h->worker_pid, 2 * HG_CLIENT_SECOND_NS);
    while (h->queue.first) {
        struct hg_client_message *message = h->queue.first;
        h->queue.first = message->next;
        hg_client_message_destroy(message);
    }
    hg_writer_finish(&h->out);
    hgp_framer_finish(&h->in);
    hg_free(h->server.device);
    hg_free(h->token);
    hg_free(h);
}

void helio_get_info(const struct helio *h, struct helio_info *out)
{
    *out = (struct helio_info){
        .state = h->state,
        .role = h->server.role,
        .version = h->server.version,
        .session = h->server.session,
        .max_message_bytes = h->server.send_limit,
        .server = h->server.name,
        .device = h->server.device,
        .worker_pid = h->worker_pid,
        .draining = h->draining,
        .scene = h->server.scene,
        .reconnects = h->resume.done,
    };
}

int helio_fd(const struct helio *h)
{
    return h->transport.fd;
}

bool helio_want_write(const struct helio *h)
{
    const struct hg_client_transport *t = &h->transport;
    return (h->state == HELIO_CONNECTING && !t->handshaking) ||
           (t->class && t->class->wants(t, true, h->out_sent < h->out.size) & POLLOUT);
}

enum hg_status helio_send(struct helio *h, enum hgp_type type, const void *message,
    uint32_t *request, struct hg_error *err)
{
    if (request)
        *request = 0;
    if (h->error.status)
        return hg_client_failed(h, err);
    if (h->state != HELIO_OPEN && h->resume.deadline_ns)
        return hg_error_set(err, HG_E_AGAIN, h->url, NULL, "the connection is being made again");
    if (h->state != HELIO_OPEN)
        return hg_error_set(err, HG_E_STATE, h->url, NULL, "the session is not open yet");
    if (h->out.size - h->out_sent > HG_CLIENT_SEND_HIGH_BYTES)
        return hg_error_set(err, HG_E_AGAIN, h->url, NULL, "too much waits to be sent");
    const struct hgp_message_info *info = hgp_find((uint16_t)type);
    if (!info || info->state == HGP_AUTH || type == HGP_T_hello ||
        (info->direction != HGP_C2S && info->direction != HGP_ANY))
        return hg_error_set(err, HG_E_INVAL, info ? info->name : "message", NULL,
            "not a message that clients send");
    uint32_t id = request ? h->next_request : 0;
    const size_t before = h->out.size;
    const bool is_leaving = h->embedded && type == HGP_T_scene_close;
    enum hg_status status = is_leaving ? hg_client_next_scene(h, id, err)
                                       : hg_client_enqueue(h, type, id, message, err);
    if (!status && h->tap.sent && !is_leaving)
        h->tap.sent(h->tap.user, h->out.data + before, h->out.size - before);
    if (!status && request) {
        *request = id;
        h->next_request = id + 1 == HG_CLIENT_OWN_REQUEST ? 1 : id + 1;
    }
    return status;
}

static enum hg_status send_some(struct helio *h)
{
    struct hg_client_transport *t = &h->transport;
    while (h->out_sent < h->out.size) {
        size_t sent;
        enum hg_status status =
            t->class->write(t, h->out.data + h->out_sent, h->out.size - h->out_sent, &sent);
        if (status == HG_E_AGAIN)
            break;
        if (status == HG_E_CLOSED) {
            // The peer may have said why before it closed.
            h->out_sent = h->out.size;
            status = hg_client_receive(h);
            return status ? status : hg_client_fail_lost(h, "the connection broke");
        }
        if (status)
            return hg_client_fail_lost(h, "cannot send: %s", strerror(t->error_number));
        h->out_sent += sent;
    }
    if (h->out_sent == h->out.size) {
        h->out.size = h->out_sent = 0;
    } else if (h->out_sent > h->out.size / 2) {
        memmove(h->out.data, h->out.data + h->out_sent, h->out.size - h->out_sent);
        h->out.size -= h->out_sent;
        h->out_sent = 0;
    }
    return HG_OK;
}

// HG_OK: connected; HG_E_AGAIN: not yet.
static enum hg_status connect_on(struct helio *h)
{
    struct hg_error reason = {0};
    enum hg_status status = HG_OK;
    if (h->resume.deadline_ns && !h->transport.class)
        status = hg_client_redial(h);
    if (!status && h->transport.connecting)
        status = hg_client_dial_continue(
            &h->transport, h->url, &h->resume.tls, h->resume.scene, &reason);
    if (status == HG_E_AGAIN || h->error.status)
        return status;
    if (status && h->resume.deadline_ns) { // the daemon does not accept connections yet
        hg_client_transport_close(&h->transport);
        return HG_E_AGAIN;
    }
    return status ? hg_client_fail(h, status, NULL, "%s", reason.reason) : hg_client_greet(h);
}

enum hg_status helio_process(struct helio *h, struct hg_error *err)
{
    if (!h->error.status && h->state == HELIO_CONNECTING) {
        enum hg_status status = connect_on(h);
        if (status == HG_E_AGAIN)
            return HG_OK;
        if (status)
            return hg_client_failed(h, err);
    }
    if (!h->error.status && send_some(h) == HG_OK && hg_client_receive(h) == HG_OK &&
        send_some(h) == HG_OK && h->embedded &&
        hg_clock_now_ns() - h->heard_ns > HG_CLIENT_WORKER_LIFE)
        return hg_client_fail(h, HG_E_WORKER, NULL,
                   "the private worker gave no sign of life for %u s",
                   (unsigned)(HG_CLIENT_WORKER_LIFE / HG_CLIENT_SECOND_NS)),
               hg_client_failed(h, err);
    return hg_client_failed(h, err);
}

enum hg_status helio_next(struct helio *h, struct helio_message **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_client_message *message = h->queue.first;
    if (!message && h->error.status)
        return hg_client_failed(h, err);
    if (!message)
        return HG_E_AGAIN;
    hg_client_queue_take(&h->queue, NULL, message);
    *out = &message->pub;
    return HG_OK;
}

void helio_message_free(struct helio_message *message)
{
    hg_client_message_destroy((struct hg_client_message *)message);
}

void helio_set_handlers(struct helio *h, const struct helio_handlers *handlers)
{
    h->handlers = handlers ? *handlers : (struct helio_handlers){0};
}

void helio_set_tap(struct helio *h, const struct helio_tap *tap)
{
    h->tap = tap ? *tap : (struct helio_tap){0};
}

void helio_set_timeout(struct helio *h, uint64_t timeout_ns)
{
    h->timeout_ns = timeout_ns;
}

void helio_interrupt(struct helio *h)
{
    uint64_t one = 1;
    ssize_t n = write(h->wake_fd, &one, sizeof one);
    (void)n; // full counter: the interrupt is pending already
}

enum hg_status helio_taken(struct helio *h, const struct helio_message *frame, struct hg_error *err)
{
    if (frame->type != HGP_T_frame || frame->request)
        return hg_error_set(err, HG_E_INVAL, "taken", NULL, "is for frames of a subscription");
    const struct hgp_taken taken = {.view = frame->body->frame.view,
        .number = frame->body->frame.number,
        .has_begun_ns = true,
        .begun_ns = frame->begun_ns,
        .has_received_ns = true,
        .received_ns = frame->received_ns,
        .has_rtt_ns = h->rtt_ns > 0,
        .rtt_ns = h->rtt_ns};
    return helio_send(h, HGP_T_taken, &taken, NULL, err);
}
