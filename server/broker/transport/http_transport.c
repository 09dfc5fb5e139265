#include "server/broker/transport/http_transport.h"

#include <string.h>

#include "base/alloc.h"
#include "server/broker/transport/ws_transport.h"

enum { REQUESTS_PER_READ = 16 };

struct http {
    struct hg_transport below;
    const struct hg_web *web;
    struct hg_http_answer answer;
    size_t sent; // of head and body
    bool answering;
    uint32_t requests;
    size_t in_size;
    uint8_t in[HG_HTTP_HEAD_BYTES];
};

static enum hg_status http_flush(struct hg_transport *t)
{
    struct http *h = t->state;
    while (h->answering) {
        const struct hg_http_answer *a = &h->answer;
        size_t of_head = h->sent < a->head_size ? a->head_size - h->sent : 0;
        size_t at = h->sent > a->head_size ? h->sent - a->head_size : 0, taken = 0;
        const struct iovec parts[] = {{(char *)a->head + a->head_size - of_head, of_head},
            {(uint8_t *)a->body + at, a->body_size - at}};
        enum hg_status status = of_head + a->body_size - at
                                    ? h->below.class->write(&h->below, parts, 2, &taken)
                                    : HG_OK;
        if (status)
            return status;
        h->sent += taken;
        if (h->sent == a->head_size + a->body_size) {
            hg_http_answer_finish(&h->answer);
            h->answering = false;
            t->stage++;
        }
    }
    return hg_transport_flush(&h->below);
}

static void begin_answer(struct hg_transport *t)
{
    struct http *h = t->state;
    h->answering = true;
    h->sent = 0;
    t->stage++;
    t->served = true;
}

static void take(struct http *h, size_t size)
{
    h->in_size -= size;
    memmove(h->in, h->in + size, h->in_size);
}

// The answer with which a WebSocket begins is sent: what was read behind the request is its own.
static enum hg_status become_websocket(struct hg_transport *t)
{
    struct http *h = t->state;
    enum hg_status status = hg_ws_transport_begin(t, &h->below, h->web->options, h->in, h->in_size);
    if (!status)
        hg_free(h);
    t->served = status; // from here on it is a handshake like any other
    return status ? HG_E_IO : HG_OK;
}

// Makes the answer to the request that is there. HG_E_AGAIN: none is whole.
static enum hg_status take_request(struct hg_transport *t)
{
    struct http *h = t->state;
    struct hg_http_head head;
    enum hg_status status = hg_http_request_parse(h->in, h->in_size, &head);
    if (status == HG_E_AGAIN)
        return status;
    h->requests++;
    hg_http_answer(h->web, t->peer, &head, status, h->requests >= HG_HTTP_REQUESTS, &h->answer);
    take(h, status ? h->in_size : head.bytes);
    begin_answer(t);
    return HG_OK;
}

// HG_OK: some bytes more.
static enum hg_status fill(struct http *h)
{
    size_t got;
    enum hg_status status =
        h->below.class->read(&h->below, h->in + h->in_size, sizeof h->in - h->in_size, &got);
    h->in_size += got;
    return status;
}

static enum hg_status http_read(struct hg_transport *t, void *dst, size_t size, size_t *got)
{
    struct http *h = t->state;
    *got = 0;
    for (int i = 0; i < REQUESTS_PER_READ; i++) {
        enum hg_status status = http_flush(t);
        if (status)
            return status;
        if (h->answer.upgrade) {
            status = become_websocket(t);
            return status ? status : t->class->read(t, dst, size, got);
        }
        if (h->answer.close)
            return hg_transport_discard(&h->below, HG_E_STATE);
        status = take_request(t);
        if (status == HG_E_AGAIN)
            status = fill(h);
        t->fault = h->below.fault;
        if (status)
            return status;
    }
    return HG_E_AGAIN;
}

// With nothing to write, and what has been read is handled when there is an answer no more.
static bool http_has_input(const struct hg_transport *t)
{
    const struct http *h = t->state;
    struct hg_http_head head;
    if (h->answering)
        return false;
    return h->answer.upgrade || h->answer.close || hg_transport_has_input(&h->below) ||
           (h->in_size && hg_http_request_parse(h->in, h->in_size, &head) != HG_E_AGAIN);
}

static enum hg_status http_write(
    struct hg_transport *t, const struct iovec *parts, int count, size_t *sent)
{
    (void)t;
    (void)parts;
    (void)count;
    *sent = 0;
    return HG_E_CLOSED; // no message is for a client that has not begun
}

static uint32_t http_wants(const struct hg_transport *t, bool read, bool write)
{
    const struct http *h = t->state;
    return h->below.class->wants(&h->below, read && !h->answering, write || h->answering);
}

static void http_end_writing(struct hg_transport *t)
{
    struct http *h = t->state;
    h->below.class->end_writing(&h->below);
}

static void http_close(struct hg_transport *t)
{
    struct http *h = t->state;
    hg_transport_close(&h->below);
    hg_http_answer_finish(&h->answer);
    hg_free(h);
}

static bool http_refuse(struct hg_transport *t, const char *reason)
{
    struct http *h = t->state;
    // A client that has asked nothing, or waits between two requests, is closed without a word.
    if (h->answering || h->answer.upgrade || (!reason && !h->in_size))
        return false;
    hg_http_answer_refusal(reason, &h->answer);
    begin_answer(t);
    return true;
}

const struct hg_transport_class hg_transport_http = {
    .read = http_read,
    .write = http_write,
    .wants = http_wants,
    .end_writing = http_end_writing,
    .close = http_close,
    .flush = http_flush,
    .has_input = http_has_input,
    .refuse = http_refuse,
};

enum hg_status hg_http_transport_begin(struct hg_transport *t, const struct hg_transport *below,
    const struct hg_web *web, const uint8_t *first, size_t size)
{
    struct http *h = hg_calloc(1, sizeof *h);
    if (!h)
        return HG_E_NOMEM;
    h->below = *below;
    h->web = web;
    memcpy(h->in, first, size);
    h->in_size = size;
    hg_transport_become(t, &hg_transport_http, h);
    return HG_OK;
}
