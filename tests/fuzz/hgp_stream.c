#include "tests/fuzz/hgp_stream.h"

#include <string.h>

#include "protocol/framing.h"
#include "protocol/layout.h"
#include "tests/fuzz/fuzz.h"

enum { OPEN_LIMIT = 1 << 20 };

struct stream {
    bool to_server, link;
    enum hgp_state state;
    union hgp_any message;
};

static bool is_zeroed(const void *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        if (((const uint8_t *)data)[i])
            return false;
    return true;
}

static bool is_allowed(const struct stream *s, const struct hgp_message_info *info)
{
    enum hgp_direction client = s->to_server ? HGP_C2S : HGP_S2C;
    enum hgp_direction worker = s->to_server ? HGP_B2W : HGP_W2B;
    if (info->direction == worker)
        return s->link;
    return (info->direction == client || info->direction == HGP_ANY) && info->state <= s->state;
}

// What was decoded encodes to the same bytes, also after it was merged with itself.
static void check_round_trip(struct stream *s, const struct hgp_header *h, const uint8_t *payload)
{
    struct hg_writer w = {0};
    struct hgp_header back;
    union hgp_any copy = s->message;
    hgp_merge((enum hgp_type)h->type, &copy, &s->message);
    FUZZ_CHECK(
        hgp_encode(&w, 1, (struct hgp_envelope){(enum hgp_type)h->type, h->request, h->channel},
            &copy, NULL) == HG_OK);
    FUZZ_CHECK(hgp_header_decode(w.data, w.size, h->length, &back) == HG_OK);
    FUZZ_CHECK(back.length == h->length && back.type == h->type);
    FUZZ_CHECK(back.request == h->request && back.channel == h->channel);
    FUZZ_CHECK(w.size == HGP_HEADER_BYTES + (size_t)h->length);
    FUZZ_CHECK(h->length == 0 || memcmp(w.data + HGP_HEADER_BYTES, payload, h->length) == 0);
    hg_writer_finish(&w);
}

static void change_state(struct stream *s, uint16_t type)
{
    if (type == HGP_T_hello)
        s->state = HGP_AUTH;
    if (type == HGP_T_welcome)
        s->state = s->message.welcome.auth_required ? HGP_AUTH : HGP_OPEN;
    if (type == HGP_T_auth || type == HGP_T_auth_ok)
        s->state = HGP_OPEN;
}

static bool read_payload(struct stream *s, const struct hgp_header *h, const uint8_t *payload)
{
    const struct hgp_message_info *info = hgp_find(h->type);
    struct hg_arena arena = {0};
    struct hgp_fault fault = {0};
    memset(&s->message, 0xaa, sizeof s->message);
    enum hg_status status =
        hgp_decode(1, h->type, hg_reader_make(payload, h->length), &arena, &s->message, &fault);
    // Memory stays in proportion to the bytes received.
    FUZZ_CHECK(arena.used_bytes <= 8 * (size_t)h->length + 64);
    if (status) {
        FUZZ_CHECK(fault.reason[0] && fault.offset <= h->length);
        FUZZ_CHECK(strlen(fault.field) < sizeof fault.field);
        FUZZ_CHECK(is_zeroed(&s->message, info->struct_size));
    } else {
        check_round_trip(s, h, payload);
        change_state(s, h->type);
    }
    hg_arena_finish(&arena);
    return status == HG_OK || s->state == HGP_OPEN;
}

// Reads one message; returns its size, or 0 when the connection ends.
static size_t read_message(struct stream *s, const uint8_t *data, size_t size)
{
    struct hgp_header h;
    uint32_t limit = s->state == HGP_OPEN ? OPEN_LIMIT : HGP_LIMIT_BEFORE_AUTH;
    if (hgp_header_decode(data, size, limit, &h) || h.length > size - HGP_HEADER_BYTES)
        return 0;
    size_t total = HGP_HEADER_BYTES + (size_t)h.length;
    const struct hgp_message_info *info = hgp_find(h.type);
    if (!info)
        return h.flags & HGP_FLAG_OPTIONAL || s->state == HGP_OPEN ? total : 0;
    if (!is_allowed(s, info))
        return 0;
    // A block of its own, so that a read behind the payload is seen.
    uint8_t *payload = malloc(h.length ? h.length : 1);
    FUZZ_CHECK(payload);
    memcpy(payload, data + HGP_HEADER_BYTES, h.length);
    bool goes_on = read_payload(s, &h, payload);
    free(payload);
    return goes_on ? total : 0;
}

// ---- framing ------------------------------------------------------------------------------------

struct piece {
    struct hgp_header header;
    uint8_t payload[];
};

static void *piece_create(const struct hgp_header *header)
{
    struct piece *p = malloc(sizeof *p + header->length);
    FUZZ_CHECK(p);
    p->header = *header;
    return p;
}

static uint8_t *piece_payload(void *piece)
{
    return ((struct piece *)piece)->payload;
}

static const struct hgp_frame_class pieces = {piece_create, piece_payload, free};

// Takes what is whole; the messages must be those that lie at *at of the bytes.
static enum hg_status take_pieces(struct hgp_framer *f, const uint8_t *data, size_t *at)
{
    void *message;
    enum hg_status status;
    while ((status = hgp_framer_next(f, OPEN_LIMIT, &message)) == HG_OK) {
        struct piece *p = message;
        uint8_t head[HGP_HEADER_BYTES];
        hgp_header_encode(&p->header, head);
        FUZZ_CHECK(memcmp(head, data + *at, sizeof head) == 0);
        *at += HGP_HEADER_BYTES;
        FUZZ_CHECK(!p->header.length || memcmp(p->payload, data + *at, p->header.length) == 0);
        *at += p->header.length;
        free(p);
    }
    return status;
}

// However a stream is cut, the framer finds the messages that its bytes have.
static void check_framing(const uint8_t *data, size_t size, size_t step)
{
    struct hgp_framer f = {.frames = &pieces};
    enum hg_status status = HG_E_AGAIN;
    size_t at = 0;
    for (size_t fed = 0; fed < size && status == HG_E_AGAIN;) {
        size_t room;
        uint8_t *dst = hgp_framer_space(&f, &room);
        FUZZ_CHECK(dst && room);
        size_t n = size - fed < step ? size - fed : step;
        n = n < room ? n : room;
        memcpy(dst, data + fed, n);
        hgp_framer_fill(&f, n);
        fed += n;
        status = take_pieces(&f, data, &at);
    }
    struct hgp_header h;
    enum hg_status want = hgp_header_decode(data + at, size - at, OPEN_LIMIT, &h);
    FUZZ_CHECK(status == (want == HG_OK || want == HG_E_TRUNCATED ? HG_E_AGAIN : want));
    FUZZ_CHECK(want != HG_OK || h.length > size - at - HGP_HEADER_BYTES);
    hgp_framer_finish(&f);
}

void hgp_stream_read(const uint8_t *data, size_t size, bool to_server)
{
    struct stream s = {.to_server = to_server};
    struct hgp_header first;
    if (to_server) {
        s.link = size < HGP_PREFACE_BYTES || memcmp(data, HGP_PREFACE, HGP_PREFACE_BYTES) != 0;
        if (!s.link) {
            data += HGP_PREFACE_BYTES;
            size -= HGP_PREFACE_BYTES;
        }
    } else {
        s.link = hgp_header_decode(data, size, UINT32_MAX, &first) == HG_OK &&
                 first.type == HGP_T_worker_ready;
    }
    if (s.link)
        s.state = HGP_OPEN;
    check_framing(data, size, SIZE_MAX);
    check_framing(data, size, 1 + (size ? data[size - 1] % 23u : 0));
    for (size_t step; (step = read_message(&s, data, size)); size -= step)
        data += step;
}
