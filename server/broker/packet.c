#include "server/broker/packet.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/clock.h"

enum { FLUSH_ITEMS = 32, DIRECT_BYTES = 32 * 1024, READ_BYTES = 1 << 20 };

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
    if (hgp_encode(&w, HGP_VERSION_MAX, type, 0, 0, message, NULL) == HG_OK &&
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

// ---- output
// --------------------------------------------------------------------------------------

struct hg_outq_item {
    struct hg_outq_item *next;
    struct hg_packet *packet;
    size_t sent; // of header and payload
    uint8_t header[HGP_HEADER_BYTES];
};

enum hg_status hg_outq_push(
    struct hg_outq *q, struct hg_packet *packet, uint32_t request, uint32_t channel)
{
    struct hg_outq_item *item = packet ? hg_calloc(1, sizeof *item) : NULL;
    if (!item) {
        hg_packet_unref(packet);
        return HG_E_NOMEM;
    }
    struct hgp_header header = packet->header;
    header.request = request;
    header.channel = channel;
    hgp_header_encode(&header, item->header);
    item->packet = packet;
    if (!q->head) {
        q->tail = &q->head;
        q->progress_ns = hg_clock_now_ns();
    }
    *q->tail = item;
    q->tail = &item->next;
    q->bytes += HGP_HEADER_BYTES + packet->header.length;
    return HG_OK;
}

static int gather(const struct hg_outq *q, struct iovec *parts)
{
    int count = 0;
    size_t total = 0;
    for (struct hg_outq_item *item = q->head; item && count + 2 <= 2 * FLUSH_ITEMS;
         item = item->next) {
        size_t skip = item->sent;
        if (skip < HGP_HEADER_BYTES)
            parts[count++] = (struct iovec){item->header + skip, HGP_HEADER_BYTES - skip};
        skip = skip > HGP_HEADER_BYTES ? skip - HGP_HEADER_BYTES : 0;
        size_t rest = item->packet->header.length - skip;
        if (rest)
            parts[count++] = (struct iovec){item->packet->payload + skip, rest};
        total += rest;
        if (total >= READ_BYTES)
            break;
    }
    return count;
}

static void drop_head(struct hg_outq *q)
{
    struct hg_outq_item *item = q->head;
    q->head = item->next;
    hg_packet_unref(item->packet);
    hg_free(item);
}

static void advance(struct hg_outq *q, size_t sent)
{
    q->bytes -= sent;
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

enum hg_status hg_outq_flush(struct hg_outq *q, int fd)
{
    for (size_t done = 0; q->head && done < READ_BYTES;) {
        struct iovec parts[2 * FLUSH_ITEMS];
        struct msghdr message = {.msg_iov = parts, .msg_iovlen = (size_t)gather(q, parts)};
        ssize_t n = sendmsg(fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
            return HG_OK;
        if (n < 0)
            return errno == EPIPE || errno == ECONNRESET ? HG_E_CLOSED : HG_E_IO;
        done += (size_t)n;
        advance(q, (size_t)n);
        q->progress_ns = hg_clock_now_ns();
    }
    return HG_OK;
}

void hg_outq_finish(struct hg_outq *q)
{
    while (q->head)
        drop_head(q);
    *q = (struct hg_outq){0};
}

// ---- input
// ---------------------------------------------------------------------------------------

static enum hg_status receive(int fd, uint8_t *dst, size_t size, size_t *got)
{
    ssize_t n;
    *got = 0;
    do
        n = recv(fd, dst, size, MSG_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n > 0)
        *got = (size_t)n;
    if (n == 0 || (n < 0 && errno == ECONNRESET))
        return HG_E_CLOSED;
    if (n < 0)
        return errno == EAGAIN || errno == EWOULDBLOCK ? HG_E_AGAIN : HG_E_IO;
    return HG_OK;
}

enum hg_status hg_framer_read(struct hg_framer *f, int fd)
{
    size_t got;
    enum hg_status status;
    size_t rest = f->partial ? f->partial->header.length - f->filled : 0;
    if (rest >= DIRECT_BYTES && f->start == f->end) {
        size_t size = rest < READ_BYTES ? rest : READ_BYTES;
        status = receive(fd, f->partial->payload + f->filled, size, &got);
        f->filled += got;
    } else {
        if (!f->buffer && !(f->buffer = hg_calloc(HG_FRAMER_BUFFER_BYTES, 1)))
            return HG_E_NOMEM;
        if (f->start) {
            memmove(f->buffer, f->buffer + f->start, f->end - f->start);
            f->end -= f->start;
            f->start = 0;
        }
        if (f->end == HG_FRAMER_BUFFER_BYTES)
            return HG_OK; // full: the caller takes messages first
        status = receive(fd, f->buffer + f->end, HG_FRAMER_BUFFER_BYTES - f->end, &got);
        f->end += got;
    }
    f->total_bytes += got;
    return status;
}

const uint8_t *hg_framer_take(struct hg_framer *f, size_t size)
{
    if (f->end - f->start < size)
        return NULL;
    const uint8_t *data = f->buffer + f->start;
    f->start += size;
    return data;
}

static enum hg_status begin_packet(struct hg_framer *f, uint32_t limit)
{
    struct hgp_header header;
    enum hg_status status =
        hgp_header_decode(f->buffer + f->start, f->end - f->start, limit, &header);
    if (status)
        return status;
    f->partial = hg_packet_create(&header);
    if (!f->partial)
        return HG_E_NOMEM;
    f->start += HGP_HEADER_BYTES;
    f->filled = 0;
    return HG_OK;
}

enum hg_status hg_framer_next(struct hg_framer *f, uint32_t limit, struct hg_packet **out)
{
    *out = NULL;
    if (!f->partial) {
        if (f->end - f->start < HGP_HEADER_BYTES)
            return HG_OK;
        enum hg_status status = begin_packet(f, limit);
        if (status)
            return status;
    }
    size_t rest = f->partial->header.length - f->filled, here = f->end - f->start;
    size_t take = here < rest ? here : rest;
    if (take)
        memcpy(f->partial->payload + f->filled, f->buffer + f->start, take);
    f->start += take;
    f->filled += take;
    if (take == rest) {
        *out = f->partial;
        f->partial = NULL;
    }
    return HG_OK;
}

void hg_framer_finish(struct hg_framer *f)
{
    hg_free(f->buffer);
    hg_packet_unref(f->partial);
    *f = (struct hg_framer){0};
}
