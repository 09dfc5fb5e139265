#include "client/lib/conn.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"

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

enum hg_status hg_client_fail_lost(struct helio *h, const char *fmt, ...)
{
    char text[160];
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

enum hg_status hg_client_enqueue(struct helio *h, enum hgp_type type, uint32_t request,
    const void *message, struct hg_error *err)
{
    struct hgp_fault fault = {0};
    uint32_t channel = h->embedded ? HG_CLIENT_PRIVATE_CHANNEL : 0;
    size_t before = h->out.size;
    const struct hgp_message_info *info = hgp_find((uint16_t)type);
    const char *name = info ? info->name : "message";
    enum hg_status status = hgp_encode(
        &h->out, h->server.version, (struct hgp_envelope){type, request, channel}, message, &fault);
    if (status)
        return hg_error_set(err, status, name, fault.field, "%s",
            fault.reason ? fault.reason : hg_status_text(status));
    if (h->out.size - before - HGP_HEADER_BYTES > h->server.send_limit) {
        size_t payload = h->out.size - before - HGP_HEADER_BYTES;
        h->out.size = before;
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "%zu bytes are more than the %u that %s takes", payload, h->server.send_limit, h->url);
    }
    return HG_OK;
}
