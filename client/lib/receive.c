#include <string.h>

#include "base/clock.h"
#include "client/lib/receive.h"

static uint32_t payload_limit(const struct helio *h)
{
    if (h->state == HELIO_OPEN || h->embedded)
        return h->receive_limit;
    return HGP_LIMIT_BEFORE_AUTH;
}

// Decodes a message and hands it on.
static enum hg_status deliver(struct helio *h, struct hg_client_message *message)
{
    const struct hgp_header header = message->header;
    // List items may take more room than their bytes; bounded by what the wire limit allows.
    message->arena.limit_bytes = 4 * (size_t)h->receive_limit;
    message->pub = (struct helio_message){.type = header.type,
        .request = header.request,
        .size_bytes = header.length,
        .body = &message->body,
        .begun_ns = message->begun_ns,
        .received_ns = hg_clock_now_ns()};
    uint32_t expected = h->embedded ? h->server.channel : 0;
    struct hgp_fault fault = {0};
    enum hg_status status = HG_OK;
    const bool is_past = header.channel && header.channel < expected; // of a scene that was closed
    if (is_past || (!hgp_find(header.type) && (header.flags & HGP_FLAG_OPTIONAL))) {
        hg_client_message_destroy(message);
        return HG_OK;
    }
    if (header.channel != expected && !(h->embedded && header.channel == 0))
        status = hg_client_fail(
            h, HG_E_FORMAT, "channel", "a message came on channel %u", header.channel);
    else if (hgp_decode(h->server.version, header.type,
                 hg_reader_make(message->payload, header.length), &message->arena, &message->body,
                 &fault))
        status = hg_client_fail(h, HG_E_FORMAT, fault.field, "message 0x%04x is malformed: %s",
            header.type, fault.reason[0] ? fault.reason : "unknown type");
    if (status) {
        hg_client_message_destroy(message);
        return status;
    }
    return hg_client_dispatch(h, message);
}

static enum hg_status fail_framing(struct helio *h, enum hg_status status)
{
    if (status == HG_E_NOMEM)
        return hg_client_fail(h, HG_E_NOMEM, NULL, "no memory for a message");
    return hg_client_fail(h, HG_E_FORMAT, "header", "the server sent %s",
        status == HG_E_LIMIT ? "a message above the size limit" : "a malformed header");
}

// One read. HG_OK, HG_E_AGAIN, or the connection has failed.
static enum hg_status read_some(struct helio *h)
{
    struct hg_client_transport *t = &h->transport;
    size_t size, got;
    uint8_t *dst = hgp_framer_space(&h->in, &size);
    if (!dst)
        return fail_framing(h, HG_E_NOMEM);
    enum hg_status status = t->class->read(t, dst, size, &got);
    hgp_framer_fill(&h->in, got);
    if (status == HG_E_AUTH)
        return hg_client_fail(h, status, NULL, "the server %s", t->refusal);
    if (status == HG_E_IO)
        return hg_client_fail_lost(h, "the connection broke: %s", strerror(t->error_number));
    if (status == HG_E_CLOSED)
        return hg_client_fail_lost(h, "the %s closed %s connection%s",
            h->embedded ? "private worker" : "server", h->embedded ? "its" : "the",
            hgp_framer_is_empty(&h->in) ? "" : " in the middle of a message");
    return status;
}

enum hg_status hg_client_receive(struct helio *h)
{
    while (h->queue.count < HG_CLIENT_QUEUE_MESSAGES && h->queue.bytes < h->receive_limit) {
        void *message;
        enum hg_status status = hgp_framer_next(&h->in, payload_limit(h), &message);
        if (!status)
            status = deliver(h, message);
        else if (status == HG_E_AGAIN)
            status = read_some(h);
        else
            status = fail_framing(h, status);
        if (status == HG_E_AGAIN)
            return HG_OK;
        if (status)
            return h->error.status ? h->error.status : status;
    }
    return HG_OK;
}
