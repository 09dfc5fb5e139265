// receive.c - bytes of the socket to whole messages. Payload memory is taken as bytes arrive, so a
// length that is announced but never sent costs nothing.
#include <errno.h>
#include <string.h>
#include <sys/socket.h>

#include "base/alloc.h"
#include "base/file.h"
#include "client/lib/conn.h"

static enum hg_status fail_end(struct helio *h, int error_number)
{
    char text[96];
    if (h->embedded && hg_client_reap(h, HG_CLIENT_SECOND_NS, text, sizeof text))
        return hg_client_fail(h, HG_E_WORKER, NULL, "the private worker %s", text);
    if (h->embedded)
        return hg_client_fail(h, HG_E_WORKER, NULL, "the private worker closed its connection");
    if (error_number)
        return hg_client_fail(
            h, HG_E_CLOSED, NULL, "the connection broke: %s", strerror(error_number));
    return hg_client_fail(h, HG_E_CLOSED, NULL, "the server closed the connection%s",
        h->in.header_have ? " in the middle of a message" : "");
}

// One read of at most `size` bytes: HG_OK with *got, HG_E_AGAIN, or failure.
static enum hg_status read_some(struct helio *h, uint8_t *dst, size_t size, size_t *got)
{
    *got = 0;
    for (;;) {
        ssize_t n = recv(h->fd, dst, size, MSG_DONTWAIT);
        if (n > 0) {
            *got = (size_t)n;
            return HG_OK;
        }
        if (n == 0)
            return fail_end(h, 0);
        if (errno == EAGAIN || errno == EWOULDBLOCK)
            return HG_E_AGAIN;
        if (errno != EINTR)
            return fail_end(h, errno);
    }
}

static enum hg_status need_chunk(struct helio *h)
{
    struct hg_client_input *in = &h->in;
    if (in->chunk_at < in->chunk_end)
        return HG_OK;
    in->chunk_at = in->chunk_end = 0;
    return read_some(h, in->chunk, sizeof in->chunk, &in->chunk_end);
}

static size_t take_chunk(struct hg_client_input *in, uint8_t *dst, size_t want)
{
    size_t have = in->chunk_end - in->chunk_at, n = want < have ? want : have;
    memcpy(dst, in->chunk + in->chunk_at, n);
    in->chunk_at += n;
    return n;
}

static uint32_t payload_limit(const struct helio *h)
{
    if (h->state == HELIO_OPEN || h->embedded)
        return h->receive_limit;
    return HGP_LIMIT_BEFORE_AUTH;
}

static enum hg_status read_header(struct helio *h)
{
    struct hg_client_input *in = &h->in;
    while (in->header_have < HGP_HEADER_BYTES) {
        enum hg_status status = need_chunk(h);
        if (status)
            return status;
        in->header_have +=
            take_chunk(in, in->header_bytes + in->header_have, HGP_HEADER_BYTES - in->header_have);
    }
    enum hg_status status =
        hgp_header_decode(in->header_bytes, HGP_HEADER_BYTES, payload_limit(h), &in->header);
    if (status)
        return hg_client_fail(h, HG_E_FORMAT, "header", "the server sent %s",
            status == HG_E_LIMIT ? "a message above the size limit" : "a malformed header");
    return HG_OK;
}

static enum hg_status read_payload(struct helio *h)
{
    struct hg_client_input *in = &h->in;
    size_t total = in->header.length;
    while (in->payload_have < total) {
        size_t missing = total - in->payload_have;
        size_t step = missing < HG_CLIENT_CHUNK_BYTES ? missing : HG_CLIENT_CHUNK_BYTES;
        size_t need = in->payload_have + step;
        if (hg_grow(&in->payload, &in->payload_capacity, need, 1))
            return hg_client_fail(
                h, HG_E_NOMEM, NULL, "no memory for a message of %zu bytes", total);
        size_t room = in->payload_capacity - in->payload_have, got;
        if (in->chunk_at == in->chunk_end && missing >= HG_CLIENT_CHUNK_BYTES) {
            enum hg_status status =
                read_some(h, in->payload + in->payload_have, room < missing ? room : missing, &got);
            if (status)
                return status;
        } else {
            enum hg_status status = need_chunk(h);
            if (status)
                return status;
            got = take_chunk(in, in->payload + in->payload_have, step);
        }
        in->payload_have += got;
    }
    return HG_OK;
}

// Decodes the assembled payload and hands it on.
static enum hg_status deliver(struct helio *h)
{
    struct hg_client_input *in = &h->in;
    struct hgp_header header = in->header;
    struct hg_client_message *message = hg_calloc(1, sizeof *message);
    if (!message)
        return hg_client_fail(h, HG_E_NOMEM, NULL, "no memory for a message");
    message->payload = in->payload;
    size_t size = in->payload_have;
    in->payload = NULL;
    in->payload_have = in->payload_capacity = in->header_have = 0;
    // List items may take more room than their bytes; bounded by what the wire limit allows.
    message->arena.limit_bytes = 4 * (size_t)h->receive_limit;
    message->pub = (struct helio_message){.type = header.type,
        .request = header.request,
        .size_bytes = header.length,
        .body = &message->body};
    uint32_t expected = h->embedded ? HG_CLIENT_PRIVATE_CHANNEL : 0;
    struct hgp_fault fault = {0};
    enum hg_status status = HG_OK;
    if (!hgp_find(header.type) && (header.flags & HGP_FLAG_OPTIONAL)) {
        hg_client_message_destroy(message);
        return HG_OK;
    }
    if (header.channel != expected && !(h->embedded && header.channel == 0))
        status = hg_client_fail(
            h, HG_E_FORMAT, "channel", "a message came on channel %u", header.channel);
    else if (hgp_decode(h->version, header.type, message->payload, size, &message->arena,
                 &message->body, &fault))
        status = hg_client_fail(h, HG_E_FORMAT, fault.field, "message 0x%04x is malformed: %s",
            header.type, fault.reason ? fault.reason : "unknown type");
    if (status) {
        hg_client_message_destroy(message);
        return status;
    }
    return hg_client_dispatch(h, message);
}

enum hg_status hg_client_receive(struct helio *h)
{
    while (h->queued < HG_CLIENT_QUEUE_MESSAGES && h->queued_bytes < h->receive_limit) {
        enum hg_status status = h->in.header_have < HGP_HEADER_BYTES ? read_header(h) : HG_OK;
        if (!status)
            status = read_payload(h);
        if (!status)
            status = deliver(h);
        if (status == HG_E_AGAIN)
            return HG_OK;
        if (status)
            return h->error.status ? h->error.status : status;
    }
    return HG_OK;
}
