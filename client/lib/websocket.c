#include "client/lib/websocket.h"

#include <openssl/evp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

#include "base/alloc.h"
#include "protocol/http.h"
#include "protocol/websocket.h"

enum { MESSAGE_BYTES = 1 << 16, OUT_BYTES = MESSAGE_BYTES + 2 * HG_WS_HEADER_BYTES + 256 };

struct websocket {
    struct hg_client_transport below;
    struct hg_ws_reader in;
    char key[HG_WS_KEY_CHARS + 1];
    bool ended; // the server has closed it, or broken a rule
    size_t early_size, early_used, out_size, out_sent;
    uint8_t early[HG_HTTP_HEAD_BYTES]; // the response, then what was read behind it
    uint8_t out[OUT_BYTES];            // masked: it is sent from here
};

static enum hg_status flush(struct hg_client_transport *t)
{
    struct websocket *ws = t->state;
    while (ws->out_sent < ws->out_size) {
        size_t sent;
        enum hg_status status = ws->below.class->write(
            &ws->below, ws->out + ws->out_sent, ws->out_size - ws->out_sent, &sent);
        t->error_number = ws->below.error_number;
        if (status)
            return status;
        ws->out_sent += sent;
    }
    ws->out_sent = ws->out_size = 0;
    return HG_OK;
}

// A whole frame. False: there is no room, or there are no random numbers.
static bool put_frame(struct websocket *ws, enum hg_ws_opcode opcode, const void *data, size_t size)
{
    uint8_t mask[4];
    if (sizeof ws->out - ws->out_size < size + HG_WS_HEADER_BYTES ||
        getrandom(mask, sizeof mask, 0) != sizeof mask)
        return false;
    ws->out_size += hg_ws_header(ws->out + ws->out_size, opcode, size, mask);
    hg_ws_mask(ws->out + ws->out_size, data, size, mask, 0);
    ws->out_size += size;
    return true;
}

static void handle(struct websocket *ws, enum hg_ws_event event)
{
    uint8_t code[2] = {(uint8_t)(ws->in.code >> 8), (uint8_t)ws->in.code};
    if (event == HG_WS_PINGED)
        put_frame(ws, HG_WS_PONG, ws->in.control, ws->in.control_size);
    if (event != HG_WS_CLOSED && event != HG_WS_REJECTED)
        return;
    ws->ended = true;
    put_frame(ws, HG_WS_CLOSE, code, ws->in.code == HG_WS_NO_CODE ? 0 : sizeof code);
}

static enum hg_status read_raw(struct websocket *ws, uint8_t *dst, size_t size, size_t *got)
{
    size_t left = ws->early_size - ws->early_used;
    if (!left)
        return ws->below.class->read(&ws->below, dst, size, got);
    *got = left < size ? left : size;
    memcpy(dst, ws->early + ws->early_used, *got);
    ws->early_used += *got;
    return HG_OK;
}

static enum hg_status ws_read(struct hg_client_transport *t, void *dst, size_t size, size_t *got)
{
    struct websocket *ws = t->state;
    uint8_t *bytes = dst;
    *got = 0;
    if (flush(t) == HG_E_IO)
        return HG_E_IO;
    while (!ws->ended && !*got) {
        size_t raw = 0;
        enum hg_status status = read_raw(ws, bytes, size, &raw);
        t->error_number = ws->below.error_number;
        t->refusal = ws->below.refusal;
        if (status)
            return status;
        for (size_t at = 0, used, moved; at < raw && !ws->ended; at += used) {
            handle(ws, hg_ws_read(&ws->in, bytes + at, raw - at, bytes + *got, &used, &moved));
            *got += moved;
        }
    }
    if (flush(t) == HG_E_IO)
        return HG_E_IO;
    return *got ? HG_OK : HG_E_CLOSED;
}

static enum hg_status ws_write(
    struct hg_client_transport *t, const void *data, size_t size, size_t *sent)
{
    struct websocket *ws = t->state;
    *sent = 0;
    enum hg_status status = ws->ended ? HG_E_CLOSED : flush(t);
    if (status)
        return status;
    const size_t step = size < MESSAGE_BYTES ? size : MESSAGE_BYTES;
    if (!put_frame(ws, HG_WS_BINARY, data, step))
        return HG_E_IO;
    *sent = step;
    status = flush(t);
    return status == HG_E_AGAIN ? HG_OK : status;
}

static short ws_wants(const struct hg_client_transport *t, bool read, bool write)
{
    const struct websocket *ws = t->state;
    return ws->below.class->wants(&ws->below, read, write || ws->out_sent < ws->out_size);
}

static bool ws_has_input(const struct hg_client_transport *t)
{
    const struct websocket *ws = t->state;
    return ws->ended || ws->early_used < ws->early_size ||
           (ws->below.class->has_input && ws->below.class->has_input(&ws->below));
}

static void ws_close(struct hg_client_transport *t)
{
    static const uint8_t normal[2] = {HG_WS_NORMAL >> 8, HG_WS_NORMAL & 0xff};
    struct websocket *ws = t->state;
    if (!t->handshaking && !ws->ended && put_frame(ws, HG_WS_CLOSE, normal, sizeof normal))
        (void)!flush(t);
    ws->below.class->close(&ws->below);
    hg_free(ws);
}

// ---- the opening handshake ----------------------------------------------------------------------

static const char *check_response(const struct websocket *ws, const struct hg_http_head *head)
{
    struct hg_http_text accept, protocol, extensions;
    char expected[HG_WS_ACCEPT_CHARS + 1];
    if (hg_ws_accept(ws->key, expected))
        return "there is no SHA-1";
    if (head->status != 101 || !hg_http_lists(head, "Upgrade", "websocket") ||
        !hg_http_lists(head, "Connection", "upgrade"))
        return "the server opens no WebSocket there";
    if (hg_http_find(head, "Sec-WebSocket-Accept", &accept) != 1 || !hg_http_is(accept, expected))
        return "the server's Sec-WebSocket-Accept is wrong";
    if (hg_http_find(head, "Sec-WebSocket-Protocol", &protocol) != 1 ||
        !hg_http_is(protocol, "hgp.1") ||
        hg_http_find(head, "Sec-WebSocket-Extensions", &extensions))
        return "the server chose what was not offered";
    return NULL;
}

static enum hg_status ws_handshake(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    struct websocket *ws = t->state;
    struct hg_http_head head;
    size_t got;
    enum hg_status status = flush(t);
    if (!status)
        status = ws->below.class->read(
            &ws->below, ws->early + ws->early_size, sizeof ws->early - ws->early_size, &got);
    if (status == HG_E_AGAIN)
        return status;
    if (status == HG_E_AUTH)
        return hg_error_set(err, status, url, NULL, "the server %s", ws->below.refusal);
    if (status)
        return hg_error_set(err, HG_E_CLOSED, url, NULL, "the server closed the connection");
    ws->early_size += got;
    status = hg_http_response_parse(ws->early, ws->early_size, &head);
    if (status == HG_E_AGAIN)
        return status;
    const char *wrong = status ? head.reason : check_response(ws, &head);
    if (wrong)
        return hg_error_set(
            err, status ? status : HG_E_PERM, url, NULL, "%s (HTTP status %u)", wrong, head.status);
    ws->early_used = head.bytes;
    return HG_OK;
}

static const struct hg_client_transport_class ws_class = {
    .read = ws_read,
    .write = ws_write,
    .wants = ws_wants,
    .close = ws_close,
    .handshake = ws_handshake,
    .has_input = ws_has_input,
};

enum hg_status hg_client_websocket_begin(struct hg_client_transport *t, const char *host,
    const char *path, const char *url, struct hg_error *err)
{
    uint8_t nonce[16];
    struct websocket *ws = hg_calloc(1, sizeof *ws);
    if (!ws || getrandom(nonce, sizeof nonce, 0) != sizeof nonce) {
        hg_free(ws);
        return hg_error_set(err, ws ? HG_E_IO : HG_E_NOMEM, url, NULL,
            ws ? "no random numbers" : "no memory for a WebSocket");
    }
    ws->below = *t;
    EVP_EncodeBlock((unsigned char *)ws->key, nonce, sizeof nonce);
    ws->out_size = (size_t)snprintf((char *)ws->out, sizeof ws->out,
        "GET %s HTTP/1.1\r\nHost: %s\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n"
        "Sec-WebSocket-Protocol: hgp.1\r\n\r\n",
        path, host, ws->key);
    t->class = &ws_class;
    t->state = ws;
    t->handshaking = true;
    return HG_OK;
}
