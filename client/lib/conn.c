#include "client/lib/conn.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/lib/dial.h"

// ---- ending -------------------------------------------------------------------------------------

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
    hg_client_transport_close(&h->transport);
    return hg_error_set(&h->error, status, h->url, where, "%s", reason);
}

enum hg_status hg_client_failed(const struct helio *h, struct hg_error *err)
{
    if (err)
        *err = h->error;
    return h->error.status;
}

enum { RETRY_NS = 50000000 };

// What was on its way is lost; what came stays.
static bool begin_resume(struct helio *h)
{
    struct hg_client_resume *r = &h->resume;
    uint64_t now_ns = hg_clock_now_ns();
    if (!r->patience_ns || !r->secret_bytes || h->error.status)
        return false;
    if (!r->deadline_ns)
        r->deadline_ns = now_ns + r->patience_ns;
    r->retry_ns = r->losses ? now_ns + RETRY_NS : now_ns;
    r->losses++;
    hg_client_transport_close(&h->transport);
    hgp_framer_finish(&h->in);
    h->in.frames = &hg_client_frames;
    h->out.size = h->out_sent = 0;
    h->auth_sent = h->draining = false;
    h->server.name[0] = 0;
    h->state = HELIO_CONNECTING;
    return true;
}

enum hg_status hg_client_redial(struct helio *h)
{
    struct hg_client_resume *r = &h->resume;
    struct hg_error reason = {0};
    uint64_t now_ns = hg_clock_now_ns();
    if (now_ns >= r->deadline_ns)
        return hg_client_fail(h, HG_E_CLOSED, NULL,
            "the connection was lost and could not be made again within %.0f s",
            (double)r->patience_ns * 1e-9);
    if (now_ns < r->retry_ns)
        return HG_E_AGAIN;
    r->retry_ns = now_ns + RETRY_NS;
    return hg_client_dial(&h->transport, h->url, &reason) ? HG_E_AGAIN : HG_OK;
}

enum hg_status hg_client_fail_lost(struct helio *h, const char *fmt, ...)
{
    char text[160];
    if (begin_resume(h))
        return HG_E_AGAIN;
    if (h->embedded &&
        hg_client_worker_reap(&h->worker_pid, HG_CLIENT_SECOND_NS, text, sizeof text))
        return hg_client_fail(h, HG_E_WORKER, NULL, "the private worker %s", text);
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    return hg_client_fail(h, h->embedded ? HG_E_WORKER : HG_E_CLOSED, NULL, "%s", text);
}

// ---- messages -----------------------------------------------------------------------------------

static void *frame_create(const struct hgp_header *header)
{
    struct hg_client_message *message = hg_calloc(1, sizeof *message);
    uint8_t *payload = message ? hg_realloc(NULL, header->length + (size_t)1, 1) : NULL;
    if (!payload) {
        hg_free(message);
        return NULL;
    }
    message->header = *header;
    message->begun_ns = hg_clock_now_ns();
    message->payload = payload;
    return message;
}

static uint8_t *frame_payload(void *message)
{
    return ((struct hg_client_message *)message)->payload;
}

static void frame_destroy(void *message)
{
    hg_client_message_destroy(message);
}

const struct hgp_frame_class hg_client_frames = {frame_create, frame_payload, frame_destroy};

void hg_client_message_destroy(struct hg_client_message *message)
{
    if (!message)
        return;
    hg_arena_finish(&message->arena);
    hg_free(message->payload);
    hg_free(message);
}

void hg_client_queue_push(struct hg_client_queue *q, struct hg_client_message *message)
{
    *(q->last ? &q->last->next : &q->first) = message;
    q->last = message;
    q->count++;
    q->bytes += message->pub.size_bytes;
}

void hg_client_queue_take(
    struct hg_client_queue *q, struct hg_client_message *before, struct hg_client_message *message)
{
    *(before ? &before->next : &q->first) = message->next;
    if (q->last == message)
        q->last = before;
    message->next = NULL;
    q->count--;
    q->bytes -= message->pub.size_bytes;
}

void hg_client_queue_give_up(struct hg_client_queue *q, uint32_t request)
{
    struct hg_client_message *before = NULL, *next;
    for (struct hg_client_message *m = q->first; m; m = next) {
        next = m->next;
        if (m->pub.request == request) {
            hg_client_queue_take(q, before, m);
            hg_client_message_destroy(m);
        } else {
            before = m;
        }
    }
    q->given_up[q->given_up_next++ % HG_CLIENT_GIVEN_UP] = request;
}

bool hg_client_queue_drops(struct hg_client_queue *q, const struct hg_client_message *message)
{
    const enum hgp_type type = message->pub.type;
    const bool is_last = type != HGP_T_progress && type != HGP_T_notice && type != HGP_T_frame_part;
    for (uint32_t i = 0; message->pub.request && i < HG_CLIENT_GIVEN_UP; i++) {
        if (q->given_up[i] != message->pub.request)
            continue;
        if (is_last)
            q->given_up[i] = 0;
        return true;
    }
    return false;
}

enum hg_status hg_client_enqueue(struct helio *h, enum hgp_type type, uint32_t request,
    const void *message, struct hg_error *err)
{
    struct hgp_fault fault = {0};
    uint32_t channel = h->embedded ? h->server.channel : 0;
    size_t before = h->out.size;
    const struct hgp_message_info *info = hgp_find((uint16_t)type);
    const char *name = info ? info->name : "message";
    enum hg_status status = hgp_encode(
        &h->out, h->server.version, (struct hgp_envelope){type, request, channel}, message, &fault);
    if (status)
        return hg_error_set(err, status, name, fault.field, "%s",
            fault.reason[0] ? fault.reason : hg_status_text(status));
    if (h->out.size - before - HGP_HEADER_BYTES > h->server.send_limit) {
        size_t payload = h->out.size - before - HGP_HEADER_BYTES;
        h->out.size = before;
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "%zu bytes are more than the %u that %s takes", payload, h->server.send_limit, h->url);
    }
    return HG_OK;
}
