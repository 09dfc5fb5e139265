#include "server/broker/transport/ws_transport.h"

#include <string.h>

#include "base/alloc.h"
#include "protocol/hgp.h"
#include "protocol/websocket.h"
#include "server/broker/metrics/counters.h"

enum { PARTS = 66, CONTROL_FRAME_BYTES = 4 + HG_WS_CONTROL_BYTES };

// Towards the client. Control frames go between the messages of data.
struct output {
    uint8_t header[HG_WS_HEADER_BYTES]; // of the message under way
    uint8_t header_size, header_sent;
    uint64_t left; // bytes of data that it still has to get
    uint8_t control[CONTROL_FRAME_BYTES];
    uint8_t control_size, control_sent; // of the control frame under way; size 0 = none
    uint8_t pong[HG_WS_CONTROL_BYTES], pong_size;
    bool has_pong;   // answers the newest ping
    uint16_t close;  // code of the close frame to send; 0 = none
    bool close_sent; // or in `control`: nothing is sent behind it
};

struct websocket {
    struct hg_transport below;
    struct hg_ws_reader in;
    struct output out;
    enum hg_status verdict; // of the next read
    const char *fault;
    uint8_t *early; // read together with the request
    size_t early_size, early_used;
};

// ---- control frames -----------------------------------------------------------------------------

static void make_control(
    struct output *out, enum hg_ws_opcode opcode, const uint8_t *payload, size_t size)
{
    uint8_t header[HG_WS_HEADER_BYTES];
    size_t n = hg_ws_header(header, opcode, size, NULL);
    memcpy(out->control, header, n);
    if (size)
        memcpy(out->control + n, payload, size);
    out->control_size = (uint8_t)(n + size);
    out->control_sent = 0;
}

// Makes the next control frame; false: there is none.
static bool next_control(struct output *out)
{
    if (out->close_sent)
        return false;
    if (out->close) {
        const uint8_t code[2] = {(uint8_t)(out->close >> 8), (uint8_t)out->close};
        make_control(out, HG_WS_CLOSE, code, out->close == HG_WS_NO_CODE ? 0 : sizeof code);
        out->close_sent = true;
        return true;
    }
    if (out->has_pong) {
        make_control(out, HG_WS_PONG, out->pong, out->pong_size);
        out->has_pong = false;
        return true;
    }
    return false;
}

static bool is_within_message(const struct output *out)
{
    return out->left || out->header_sent < out->header_size;
}

static bool has_control(const struct output *out)
{
    return out->control_size || (!out->close_sent && (out->close || out->has_pong));
}

static enum hg_status send_controls(struct websocket *ws)
{
    struct output *out = &ws->out;
    while (!is_within_message(out) && (out->control_size || next_control(out))) {
        size_t sent;
        const struct iovec part = {
            out->control + out->control_sent, (size_t)(out->control_size - out->control_sent)};
        enum hg_status status = ws->below.class->write(&ws->below, &part, 1, &sent);
        if (status)
            return status;
        out->control_sent = (uint8_t)(out->control_sent + sent);
        if (out->control_sent == out->control_size)
            out->control_size = 0;
    }
    return HG_OK;
}

static enum hg_status ws_flush(struct hg_transport *t)
{
    struct websocket *ws = t->state;
    enum hg_status status = send_controls(ws);
    return status ? status : hg_transport_flush(&ws->below);
}

static void say_close(struct websocket *ws, unsigned code)
{
    if (!ws->out.close)
        ws->out.close = (uint16_t)code;
}

// ---- reading ------------------------------------------------------------------------------------

static void handle(struct websocket *ws, enum hg_ws_event event)
{
    switch (event) {
    case HG_WS_PINGED:
        memcpy(ws->out.pong, ws->in.control, ws->in.control_size);
        ws->out.pong_size = ws->in.control_size;
        ws->out.has_pong = true;
        return;
    case HG_WS_CLOSED:
        say_close(ws, ws->in.code);
        ws->verdict = HG_E_CLOSED;
        return;
    case HG_WS_REJECTED:
        hg_count(HG_COUNT_REFUSED_WEBSOCKET);
        say_close(ws, ws->in.code);
        ws->verdict = HG_E_FORMAT;
        ws->fault = ws->in.reason;
        return;
    default:
        return;
    }
}

// Some bytes of the stream, as they came.
static enum hg_status read_raw(struct websocket *ws, uint8_t *dst, size_t size, size_t *got)
{
    size_t left = ws->early_size - ws->early_used;
    if (!left)
        return ws->below.class->read(&ws->below, dst, size, got);
    *got = left < size ? left : size;
    memcpy(dst, ws->early + ws->early_used, *got);
    ws->early_used += *got;
    if (ws->early_used == ws->early_size) {
        hg_free(ws->early);
        ws->early = NULL;
        ws->early_size = ws->early_used = 0;
    }
    return HG_OK;
}

static enum hg_status ws_read(struct hg_transport *t, void *dst, size_t size, size_t *got)
{
    struct websocket *ws = t->state;
    uint8_t *bytes = dst;
    size_t raw = 0;
    *got = 0;
    if (ws->verdict) {
        t->fault = ws->fault;
        return hg_transport_discard(&ws->below, ws->verdict);
    }
    enum hg_status status = read_raw(ws, bytes, size, &raw);
    for (size_t at = 0, used, moved; at < raw && !ws->verdict; at += used) {
        handle(ws, hg_ws_read(&ws->in, bytes + at, raw - at, bytes + *got, &used, &moved));
        *got += moved;
    }
    if (has_control(&ws->out) && ws_flush(t) == HG_E_IO && !status)
        status = HG_E_IO;
    if (status || *got)
        return *got ? HG_OK : status;
    t->fault = ws->fault;
    return ws->verdict ? ws->verdict : HG_E_AGAIN;
}

static bool ws_has_input(const struct hg_transport *t)
{
    const struct websocket *ws = t->state;
    return ws->verdict || ws->early_size || hg_transport_has_input(&ws->below);
}

// ---- writing ------------------------------------------------------------------------------------

static void begin_message(struct output *out, const struct iovec *parts, int count)
{
    uint64_t total = 0;
    for (int i = 0; i < count; i++)
        total += parts[i].iov_len;
    out->left = total < HG_WS_MESSAGE_BYTES ? total : HG_WS_MESSAGE_BYTES;
    out->header_size = (uint8_t)hg_ws_header(out->header, HG_WS_BINARY, out->left, NULL);
    out->header_sent = 0;
}

// The rest of the header, and of the data what belongs to the message.
static int gather(struct output *out, const struct iovec *parts, int count, struct iovec *all)
{
    uint64_t left = out->left;
    int n = 0;
    if (out->header_sent < out->header_size)
        all[n++] = (struct iovec){
            out->header + out->header_sent, (size_t)(out->header_size - out->header_sent)};
    for (int i = 0; i < count && left && n < PARTS; i++) {
        size_t size = parts[i].iov_len < left ? parts[i].iov_len : (size_t)left;
        all[n++] = (struct iovec){parts[i].iov_base, size};
        left -= size;
    }
    return n;
}

// What is announced as a message must follow: what waits to be sent is never taken back, and what
// overtakes other messages is as many bytes more.
static enum hg_status ws_write(
    struct hg_transport *t, const struct iovec *parts, int count, size_t *sent)
{
    struct websocket *ws = t->state;
    struct output *out = &ws->out;
    struct iovec all[PARTS];
    size_t taken;
    *sent = 0;
    enum hg_status status = send_controls(ws);
    if (status)
        return status;
    if (!is_within_message(out)) {
        if (out->close_sent)
            return HG_E_CLOSED;
        begin_message(out, parts, count);
    }
    status = ws->below.class->write(&ws->below, all, gather(out, parts, count, all), &taken);
    if (status)
        return status;
    size_t of_header = (size_t)(out->header_size - out->header_sent);
    of_header = taken < of_header ? taken : of_header;
    out->header_sent = (uint8_t)(out->header_sent + of_header);
    *sent = taken - of_header;
    out->left -= *sent;
    return *sent ? HG_OK : HG_E_AGAIN;
}

static uint32_t ws_wants(const struct hg_transport *t, bool read, bool write)
{
    const struct websocket *ws = t->state;
    bool control = has_control(&ws->out) && !is_within_message(&ws->out);
    return ws->below.class->wants(&ws->below, read, write || control);
}

// The client answers with a close frame of its own, and the stream ends behind that.
static void ws_end_writing(struct hg_transport *t)
{
    struct websocket *ws = t->state;
    say_close(ws, HG_WS_NORMAL);
    if (ws_flush(t) == HG_OK && ws->verdict)
        ws->below.class->end_writing(&ws->below);
}

static void ws_greet(struct hg_transport *t, uint64_t peer_timeout_ns, struct hg_peer *peer)
{
    struct websocket *ws = t->state;
    ws->below.class->greet(&ws->below, peer_timeout_ns, peer);
}

static void ws_close(struct hg_transport *t)
{
    struct websocket *ws = t->state;
    hg_transport_close(&ws->below);
    hg_free(ws->early);
    hg_free(ws);
}

const struct hg_transport_class hg_transport_websocket = {
    .read = ws_read,
    .write = ws_write,
    .wants = ws_wants,
    .end_writing = ws_end_writing,
    .greet = ws_greet,
    .close = ws_close,
    .flush = ws_flush,
    .has_input = ws_has_input,
};

// ---- life ---------------------------------------------------------------------------------------

static struct websocket *create(const struct hg_transport *below, const struct hg_options *options)
{
    struct websocket *ws = hg_calloc(1, sizeof *ws);
    if (!ws)
        return NULL;
    ws->below = *below;
    ws->in = (struct hg_ws_reader){
        .masked = true, .limit = options->max_message_bytes + HGP_HEADER_BYTES};
    return ws;
}

static bool keep_early(struct websocket *ws, const uint8_t *early, size_t size)
{
    if (!size)
        return true;
    ws->early = hg_calloc(size, 1);
    if (!ws->early)
        return false;
    memcpy(ws->early, early, size);
    ws->early_size = size;
    return true;
}

enum hg_status hg_ws_transport_begin(struct hg_transport *t, const struct hg_transport *below,
    const struct hg_options *options, const uint8_t *early, size_t size)
{
    struct websocket *ws = create(below, options);
    if (!ws || !keep_early(ws, early, size)) {
        hg_free(ws);
        return HG_E_NOMEM;
    }
    hg_transport_become(t, &hg_transport_websocket, ws);
    return HG_OK;
}

const struct hg_transport *hg_ws_transport_below(const struct hg_transport *t)
{
    return &((const struct websocket *)t->state)->below;
}

bool hg_ws_transport_has_ended(const struct hg_transport *t)
{
    const struct websocket *ws = t->state;
    return ws->verdict || ws->out.close;
}

// The layout is that of the structs: program and successor are of one machine, and sizes are
// compared.
void hg_ws_transport_save(const struct hg_transport *t, struct hg_writer *w)
{
    const struct websocket *ws = t->state;
    struct hg_ws_reader in = ws->in;
    in.reason = NULL;
    hg_write_u32(w, sizeof in);
    hg_write_bytes(w, &in, sizeof in);
    hg_write_u32(w, sizeof ws->out);
    hg_write_bytes(w, &ws->out, sizeof ws->out);
    hg_write_u32(w, (uint32_t)(ws->early_size - ws->early_used));
    hg_write_bytes(
        w, ws->early ? ws->early + ws->early_used : NULL, ws->early_size - ws->early_used);
}

static bool take_block(struct hg_reader *r, void *out, size_t size)
{
    const uint8_t *bytes = hg_read_u32(r) == size ? hg_read_bytes(r, size) : NULL;
    if (bytes)
        memcpy(out, bytes, size);
    return bytes && !r->failed;
}

static bool is_output_sound(const struct output *out)
{
    return !out->close && out->header_size <= sizeof out->header &&
           out->header_sent <= out->header_size && out->control_size <= sizeof out->control &&
           out->control_sent <= out->control_size && out->pong_size <= sizeof out->pong;
}

enum hg_status hg_ws_transport_load(struct hg_transport *t, const struct hg_transport *below,
    const struct hg_options *options, struct hg_reader *r)
{
    struct websocket *ws = create(below, options);
    if (!ws)
        return HG_E_NOMEM;
    bool good = take_block(r, &ws->in, sizeof ws->in) && take_block(r, &ws->out, sizeof ws->out);
    uint32_t size = hg_read_u32(r);
    const uint8_t *early = hg_read_bytes(r, size);
    good = good && !r->failed && ws->in.masked && !ws->in.ended && hg_ws_reader_is_sound(&ws->in) &&
           is_output_sound(&ws->out);
    ws->in.limit = options->max_message_bytes + HGP_HEADER_BYTES;
    ws->in.reason = NULL;
    if (!good || !keep_early(ws, early, size)) {
        hg_free(ws);
        return good ? HG_E_NOMEM : HG_E_FORMAT;
    }
    hg_transport_become(t, &hg_transport_websocket, ws);
    return HG_OK;
}
