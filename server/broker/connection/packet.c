#include "server/broker/connection/packet.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"

enum { FLUSH_ITEMS = 32, FLUSH_BYTES = 1 << 20 };

struct hg_packet *hg_packet_create(const struct hgp_header *header)
{
    struct hg_packet *packet = hg_realloc(NULL, sizeof *packet + header->length, 1);
    if (packet) {
        packet->refs = 1;
        packet->header = *header;
    }
    return packet;
}

struct hg_packet *hg_packet_encode(enum hgp_type type, const void *message)
{
    struct hg_writer w = {0};
    struct hgp_header header;
    struct hg_packet *packet = NULL;
    if (hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){type, 0, 0}, message, NULL) ==
            HG_OK &&
        hgp_header_decode(w.data, w.size, UINT32_MAX, &header) == HG_OK)
        packet = hg_packet_create(&header);
    if (packet)
        memcpy(packet->payload, w.data + HGP_HEADER_BYTES, header.length);
    hg_writer_finish(&w);
    return packet;
}

struct hg_packet *hg_packet_ref(struct hg_packet *packet)
{
    packet->refs++;
    return packet;
}

void hg_packet_unref(struct hg_packet *packet)
{
    if (packet && --packet->refs == 0)
        hg_free(packet);
}

// ---- output -------------------------------------------------------------------------------------

struct hg_outq_item {
    struct hg_outq_item *next;
    struct hg_packet *packet;
    size_t sent; // of header and payload
    uint64_t hold, hold_kept;
    uint8_t header[HGP_HEADER_BYTES];
};

static struct hg_outq_item *create_item(
    struct hg_packet *packet, uint32_t request, uint32_t channel)
{
    struct hg_outq_item *item = packet ? hg_calloc(1, sizeof *item) : NULL;
    if (!item) {
        hg_packet_unref(packet);
        return NULL;
    }
    struct hgp_header header = packet->header;
    header.request = request;
    header.channel = channel;
    hgp_header_encode(&header, item->header);
    item->packet = packet;
    return item;
}

static void insert(struct hg_outq *q, struct hg_outq_item **link, struct hg_outq_item *item)
{
    item->next = *link;
    *link = item;
    if (!item->next)
        q->tail = &item->next;
    q->bytes += HGP_HEADER_BYTES + item->packet->header.length;
}

static void begin_queue(struct hg_outq *q)
{
    if (q->head)
        return;
    q->tail = &q->head;
    q->progress_ns = q->window_ns = hg_clock_now_ns();
    q->window_bytes = 0;
}

enum hg_status hg_outq_push(
    struct hg_outq *q, struct hg_packet *packet, uint32_t request, uint32_t channel)
{
    struct hg_outq_item *item = create_item(packet, request, channel);
    if (!item)
        return HG_E_NOMEM;
    begin_queue(q);
    item->hold = q->hold;
    item->hold_kept = q->hold_kept;
    insert(q, q->tail, item);
    return HG_OK;
}

enum hg_status hg_outq_push_urgent(struct hg_outq *q, struct hg_packet *packet, uint32_t request)
{
    struct hg_outq_item *item = create_item(packet, request, 0);
    if (!item)
        return HG_E_NOMEM;
    begin_queue(q);
    if (q->urgent)
        insert(q, &q->urgent->next, item);
    else
        insert(q, q->head && q->head->sent ? &q->head->next : &q->head, item);
    q->urgent = item;
    return HG_OK;
}

void hg_outq_hold(struct hg_outq *q, uint64_t position)
{
    if (position > q->hold)
        q->hold = position;
}

void hg_outq_hold_kept(struct hg_outq *q, uint64_t position)
{
    if (position > q->hold_kept)
        q->hold_kept = position;
}

static bool is_held(const struct hg_outq *q, const struct hg_outq_item *item)
{
    return q->reached && (item->hold > q->reached->durable || item->hold_kept > q->reached->kept);
}

bool hg_outq_may_send(const struct hg_outq *q)
{
    return q->head && !is_held(q, q->head);
}

bool hg_outq_is_stopped(const struct hg_outq *q)
{
    return q->head && is_held(q, q->head) && q->reached->status;
}

void hg_outq_excuse(struct hg_outq *q, uint64_t now_ns)
{
    if (!q->head || hg_outq_may_send(q))
        return;
    q->progress_ns = q->window_ns = now_ns;
    q->window_bytes = 0;
}

static int gather(const struct hg_outq *q, struct iovec *parts)
{
    int count = 0;
    size_t total = 0;
    for (struct hg_outq_item *item = q->head;
         item && !is_held(q, item) && count + 2 <= 2 * FLUSH_ITEMS; item = item->next) {
        size_t skip = item->sent;
        if (skip < HGP_HEADER_BYTES)
            parts[count++] = (struct iovec){item->header + skip, HGP_HEADER_BYTES - skip};
        skip = skip > HGP_HEADER_BYTES ? skip - HGP_HEADER_BYTES : 0;
        size_t rest = item->packet->header.length - skip;
        if (rest)
            parts[count++] = (struct iovec){item->packet->payload + skip, rest};
        total += rest;
        if (total >= FLUSH_BYTES)
            break;
    }
    return count;
}

static void drop_head(struct hg_outq *q)
{
    struct hg_outq_item *item = q->head;
    q->head = item->next;
    if (q->urgent == item)
        q->urgent = NULL;
    hg_packet_unref(item->packet);
    hg_free(item);
}

static void advance(struct hg_outq *q, size_t sent)
{
    q->bytes -= sent;
    q->window_bytes += sent;
    while (q->head) {
        size_t rest = HGP_HEADER_BYTES + q->head->packet->header.length - q->head->sent;
        if (sent < rest) {
            q->head->sent += sent;
            return;
        }
        sent -= rest;
        drop_head(q);
    }
}

enum hg_status hg_outq_flush(struct hg_outq *q, struct hg_transport *t)
{
    for (size_t done = 0; hg_outq_may_send(q) && done < FLUSH_BYTES;) {
        struct iovec parts[2 * FLUSH_ITEMS];
        size_t sent;
        enum hg_status status = t->class->write(t, parts, gather(q, parts), &sent);
        if (status)
            return status == HG_E_AGAIN ? HG_OK : status;
        done += sent;
        advance(q, sent);
        q->progress_ns = hg_clock_now_ns();
    }
    return HG_OK;
}

bool hg_outq_is_drained(struct hg_outq *q, uint64_t now_ns, uint64_t window_ns, double rate)
{
    if (!q->head || now_ns - q->window_ns < window_ns)
        return true;
    bool drained = (double)q->window_bytes >= rate * (double)(now_ns - q->window_ns) * 1e-9;
    q->window_ns = now_ns;
    q->window_bytes = 0;
    return drained;
}

void hg_outq_finish(struct hg_outq *q)
{
    while (q->head)
        drop_head(q);
    *q = (struct hg_outq){0};
}

// ---- input --------------------------------------------------------------------------------------

static void *frame_create(const struct hgp_header *header)
{
    return hg_packet_create(header);
}

static uint8_t *frame_payload(void *packet)
{
    return ((struct hg_packet *)packet)->payload;
}

static void frame_destroy(void *packet)
{
    hg_packet_unref(packet);
}

const struct hgp_frame_class hg_packet_frames = {frame_create, frame_payload, frame_destroy};

enum hg_status hg_packet_receive(struct hgp_framer *f, struct hg_transport *t)
{
    size_t size, got;
    uint8_t *dst = hgp_framer_space(f, &size);
    if (!dst)
        return HG_E_NOMEM;
    if (!size)
        return HG_OK; // full: the caller takes messages first
    enum hg_status status = t->class->read(t, dst, size, &got);
    hgp_framer_fill(f, got);
    return status;
}

enum hg_status hg_packet_next(struct hgp_framer *f, uint32_t limit, struct hg_packet **out)
{
    void *message;
    enum hg_status status = hgp_framer_next(f, limit, &message);
    *out = message;
    return status == HG_E_AGAIN ? HG_OK : status;
}

// ---- over an exec -------------------------------------------------------------------------------

// Either a message whose payload is still arriving, or what was read ahead.
void hg_packet_save_input(const struct hgp_framer *f, struct hg_writer *w)
{
    const struct hg_packet *partial = f->partial;
    uint8_t header[HGP_HEADER_BYTES];
    hg_write_u8(w, partial != NULL);
    if (partial) {
        hgp_header_encode(&partial->header, header);
        hg_write_bytes(w, header, sizeof header);
        hg_write_u32(w, (uint32_t)f->filled);
        hg_write_bytes(w, partial->payload, f->filled);
    }
    hg_write_u32(w, (uint32_t)(f->end - f->start));
    if (f->end > f->start)
        hg_write_bytes(w, f->chunk + f->start, f->end - f->start);
}

static enum hg_status feed(struct hgp_framer *f, const uint8_t *data, size_t size)
{
    while (size) {
        size_t room;
        uint8_t *dst = hgp_framer_space(f, &room);
        if (!dst || !room)
            return dst ? HG_E_FORMAT : HG_E_NOMEM;
        size_t step = size < room ? size : room;
        memcpy(dst, data, step);
        hgp_framer_fill(f, step);
        data += step;
        size -= step;
    }
    return HG_OK;
}

// The framer begins the message when its header is there, and then reads into its payload.
static enum hg_status load_partial(struct hgp_framer *f, struct hg_reader *r)
{
    void *message;
    const uint8_t *header = hg_read_bytes(r, HGP_HEADER_BYTES);
    uint32_t filled = hg_read_u32(r);
    const uint8_t *payload = hg_read_bytes(r, filled);
    if (r->failed)
        return HG_E_FORMAT;
    enum hg_status status = feed(f, header, HGP_HEADER_BYTES);
    for (uint32_t done = 0; !status;) {
        status = hgp_framer_next(f, UINT32_MAX, &message);
        if (status == HG_OK) { // it was whole
            f->frames->destroy(message);
            return HG_E_FORMAT;
        }
        if (status != HG_E_AGAIN || done == filled)
            break;
        uint32_t step =
            filled - done < HGP_FRAMER_DIRECT_BYTES ? filled - done : HGP_FRAMER_DIRECT_BYTES;
        status = feed(f, payload + done, step);
        done += step;
    }
    return status == HG_E_AGAIN ? HG_OK : status;
}

enum hg_status hg_packet_load_input(struct hgp_framer *f, struct hg_reader *r)
{
    enum hg_status status = hg_read_u8(r) ? load_partial(f, r) : HG_OK;
    uint32_t size = hg_read_u32(r);
    const uint8_t *ahead = hg_read_bytes(r, size);
    if (r->failed)
        return HG_E_FORMAT;
    return status || !size ? status : feed(f, ahead, size);
}

void hg_outq_save(const struct hg_outq *q, struct hg_writer *w)
{
    hg_write_u32(w, (uint32_t)q->bytes);
    for (const struct hg_outq_item *it = q->head; it; it = it->next) {
        size_t of_header = it->sent < HGP_HEADER_BYTES ? it->sent : HGP_HEADER_BYTES;
        size_t of_payload = it->sent - of_header;
        hg_write_bytes(w, it->header + of_header, HGP_HEADER_BYTES - of_header);
        if (it->packet->header.length > of_payload)
            hg_write_bytes(
                w, it->packet->payload + of_payload, it->packet->header.length - of_payload);
    }
}

// One item, of which only the payload is sent.
enum hg_status hg_outq_load(struct hg_outq *q, struct hg_reader *r)
{
    uint32_t size = hg_read_u32(r);
    const uint8_t *data = hg_read_bytes(r, size);
    if (r->failed)
        return HG_E_FORMAT;
    if (!size)
        return HG_OK;
    struct hg_packet *packet = hg_packet_create(&(struct hgp_header){.length = size});
    if (packet)
        memcpy(packet->payload, data, size);
    enum hg_status status = hg_outq_push(q, packet, 0, 0);
    if (!status) {
        q->head->sent = HGP_HEADER_BYTES;
        q->bytes -= HGP_HEADER_BYTES;
    }
    return status;
}
