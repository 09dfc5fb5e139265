#include "client/lib/conn.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"

const char *helio_version(void)
{
    return HELIO_VERSION;
}

enum hg_status hg_client_fail(
    struct helio *h, enum hg_status status, const char *where, const char *fmt, ...)
{
    if (h->error.status)
        return h->error.status;
    char reason[sizeof h->error.reason];
    va_list args;
    va_start(args, fmt);
    vsnprintf(reason, sizeof reason, fmt, args);
    va_end(args);
    h->state = HELIO_CLOSED;
    if (h->fd >= 0)
        close(h->fd);
    h->fd = -1;
    return hg_error_set(&h->error, status, h->url, where, "%s", reason);
}

enum hg_status hg_client_failed(const struct helio *h, struct hg_error *err)
{
    if (err)
        *err = h->error;
    return h->error.status;
}

static enum hg_status prepare(
    struct helio *h, const struct helio_options *options, struct hg_error *err)
{
    h->fd = h->wake_fd = -1;
    h->next_request = 1;
    h->version = HGP_VERSION_MAX;
    h->timeout_ns = HELIO_NO_TIMEOUT;
    h->open_timeout_ns = options->timeout_ns ? options->timeout_ns : 30 * HG_CLIENT_SECOND_NS;
    h->receive_limit =
        options->max_receive_bytes ? options->max_receive_bytes : HGP_LIMIT_OPEN_DEFAULT;
    h->send_limit = HGP_LIMIT_OPEN_DEFAULT;
    h->heard_ns = hg_clock_now_ns();
    snprintf(h->url, sizeof h->url, "%s", options->url ? options->url : "private worker");
    snprintf(h->client, sizeof h->client, "%s",
        options->client ? options->client : "libhelio/" HELIO_VERSION);
    h->device = hg_strdup("");
    if (options->token)
        h->token = hg_strdup(options->token);
    if (!h->device || (options->token && !h->token))
        return hg_error_set(err, HG_E_NOMEM, h->url, NULL, "no memory for a connection");
    h->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (h->wake_fd < 0)
        return hg_error_set(
            err, hg_status_from_errno(errno), h->url, NULL, "eventfd: %s", strerror(errno));
    return HG_OK;
}

// Allocates the connection; `fd` -1 = the transport is still to be made.
static enum hg_status create(
    const struct helio_options *options, int fd, struct helio **out, struct hg_error *err)
{
    struct helio *h = hg_calloc(1, sizeof *h);
    *out = h;
    if (!h)
        return hg_error_set(err, HG_E_NOMEM, "connection", NULL, "no memory for a connection");
    enum hg_status status = prepare(h, options, err);
    h->fd = fd;
    return status;
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

enum hg_status helio_start(
    const struct helio_options *options, struct helio **out, struct hg_error *err)
{
    struct helio *h;
    enum hg_status status = create(options, -1, &h, err);
    if (!status) {
        h->embedded = !options->url;
        status =
            options->url ? hg_client_dial(h, options->url, err) : hg_client_spawn(h, options, err);
    }
    return begin(h, status, out, err);
}

enum hg_status helio_start_fd(
    const struct helio_options *options, int fd, struct helio **out, struct hg_error *err)
{
    struct helio *h;
    enum hg_status status = create(options, fd, &h, err);
    if (!h)
        close(fd);
    int flags = fcntl(fd, F_GETFL);
    if (!status && (flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK)))
        status = hg_error_set(err, HG_E_INVAL, h->url, NULL, "not an open socket");
    if (!status)
        h->state = HELIO_GREETING;
    return begin(h, status, out, err);
}

void hg_client_message_destroy(struct hg_client_message *message)
{
    if (!message)
        return;
    hg_arena_finish(&message->arena);
    hg_free(message->payload);
    hg_free(message);
}

void helio_destroy(struct helio *h)
{
    if (!h)
        return;
    if (h->fd >= 0)
        close(h->fd);
    if (h->wake_fd >= 0)
        close(h->wake_fd);
    if (h->worker_pid)
        hg_client_reap(h, 2 * HG_CLIENT_SECOND_NS, NULL, 0);
    while (h->first) {
        struct hg_client_message *message = h->first;
        h->first = message->next;
        hg_client_message_destroy(message);
    }
    if (h->addresses)
        freeaddrinfo(h->addresses);
    hg_writer_finish(&h->out);
    hg_free(h->in.payload);
    hg_free(h->device);
    hg_free(h->token);
    hg_free(h);
}

void helio_get_info(const struct helio *h, struct helio_info *out)
{
    *out = (struct helio_info){
        .state = h->state,
        .role = h->role,
        .version = h->version,
        .session = h->session,
        .max_message_bytes = h->send_limit,
        .server = h->server,
        .device = h->device,
        .worker_pid = h->worker_pid,
        .draining = h->draining,
    };
}

int helio_fd(const struct helio *h)
{
    return h->fd;
}

bool helio_want_write(const struct helio *h)
{
    return h->state == HELIO_CONNECTING || (h->fd >= 0 && h->out_sent < h->out.size);
}

enum hg_status hg_client_queue(struct helio *h, enum hgp_type type, uint32_t request,
    const void *message, struct hg_error *err)
{
    struct hgp_fault fault = {0};
    uint32_t channel = h->embedded ? HG_CLIENT_PRIVATE_CHANNEL : 0;
    size_t before = h->out.size;
    const struct hgp_message_info *info = hgp_find((uint16_t)type);
    const char *name = info ? info->name : "message";
    enum hg_status status =
        hgp_encode(&h->out, h->version, type, request, channel, message, &fault);
    if (status)
        return hg_error_set(err, status, name, fault.field, "%s",
            fault.reason ? fault.reason : hg_status_text(status));
    if (h->out.size - before - HGP_HEADER_BYTES > h->send_limit) {
        size_t payload = h->out.size - before - HGP_HEADER_BYTES;
        h->out.size = before;
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "%zu bytes are more than the %u that %s takes", payload, h->send_limit, h->url);
    }
    return HG_OK;
}

enum hg_status helio_send(struct helio *h, enum hgp_type type, const void *message,
    uint32_t *request, struct hg_error *err)
{
    if (request)
        *request = 0;
    if (h->error.status)
        return hg_client_failed(h, err);
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
    enum hg_status status = hg_client_queue(h, type, id, message, err);
    if (!status && request) {
        *request = id;
        h->next_request = id == UINT32_MAX ? 1 : id + 1;
    }
    return status;
}

// How a lost connection is called depends on who was at the other end.
static enum hg_status fail_lost(struct helio *h, const char *action, int error_number)
{
    char text[96];
    if (h->embedded && hg_client_reap(h, HG_CLIENT_SECOND_NS, text, sizeof text))
        return hg_client_fail(h, HG_E_WORKER, NULL, "the private worker %s", text);
    return hg_client_fail(
        h, h->embedded ? HG_E_WORKER : HG_E_CLOSED, NULL, "%s: %s", action, strerror(error_number));
}

static enum hg_status send_some(struct helio *h)
{
    while (h->out_sent < h->out.size) {
        ssize_t n = send(h->fd, h->out.data + h->out_sent, h->out.size - h->out_sent,
            MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
            break;
        if (n < 0 && (errno == EPIPE || errno == ECONNRESET)) {
            // The peer may have said why before it closed.
            h->out_sent = h->out.size;
            enum hg_status status = hg_client_receive(h);
            return status ? status : fail_lost(h, "the connection broke", EPIPE);
        }
        if (n < 0)
            return fail_lost(h, "cannot send", errno);
        h->out_sent += (size_t)n;
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

enum hg_status helio_process(struct helio *h, struct hg_error *err)
{
    if (!h->error.status && h->state == HELIO_CONNECTING) {
        enum hg_status status = hg_client_dial_continue(h);
        if (status == HG_E_AGAIN)
            return HG_OK;
        if (!status)
            status = hg_client_greet(h);
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
    struct hg_client_message *message = h->first;
    if (!message && h->error.status)
        return hg_client_failed(h, err);
    if (!message)
        return HG_E_AGAIN;
    h->first = message->next;
    if (!h->first)
        h->last = NULL;
    h->queued--;
    h->queued_bytes -= message->pub.size_bytes;
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
