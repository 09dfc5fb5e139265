#include "server/broker/transport/proxied.h"

#include "base/alloc.h"
#include "server/broker/metrics/counters.h"
#include "server/broker/transport/proxy_header.h"

struct proxied {
    struct hg_transport below;
    struct hg_entry entry;
    size_t size, need;
    uint8_t bytes[HG_PROXY_MOST_BYTES];
};

enum hg_status hg_entry_begin(struct hg_transport *t, const struct hg_entry *entry)
{
    enum hg_status status = entry->tls ? hg_tls_begin(t, entry->tls) : HG_OK;
    return status || !entry->web ? status : hg_detect_begin(t, entry->web);
}

static enum hg_status go_on(struct hg_transport *t, const struct hg_proxy_header *header)
{
    struct proxied *p = t->state;
    const struct hg_transport below = p->below;
    const struct hg_entry entry = p->entry;
    if (header->source.ss_family != AF_UNSPEC) {
        hg_peer_name(t->peer, &header->source);
        t->renamed = true;
    }
    hg_free(p);
    hg_transport_become(t, below.class, below.state);
    return hg_entry_begin(t, &entry) ? HG_E_IO : HG_OK;
}

static enum hg_status proxied_read(struct hg_transport *t, void *dst, size_t size, size_t *got)
{
    struct proxied *p = t->state;
    struct hg_proxy_header header;
    *got = 0;
    (void)dst;
    (void)size;
    if (t->fault)
        return hg_transport_discard(&p->below, HG_E_FORMAT);
    for (;;) {
        size_t n;
        enum hg_status status =
            p->below.class->read(&p->below, p->bytes + p->size, p->need - p->size, &n);
        p->size += n;
        if (status)
            return status;
        status = hg_proxy_header_parse(p->bytes, p->size, &header);
        if (status == HG_OK) { // what is behind it is read when there is something
            status = go_on(t, &header);
            return status ? status : HG_E_AGAIN;
        }
        if (status != HG_E_AGAIN) {
            hg_count(HG_COUNT_REFUSED_PROXY);
            t->fault = header.reason;
            return HG_E_FORMAT;
        }
        p->need = header.bytes;
    }
}

static enum hg_status proxied_write(
    struct hg_transport *t, const struct iovec *parts, int count, size_t *sent)
{
    (void)t;
    (void)parts;
    (void)count;
    *sent = 0;
    return HG_E_CLOSED; // nothing is said before the client is known
}

static uint32_t proxied_wants(const struct hg_transport *t, bool read, bool write)
{
    const struct proxied *p = t->state;
    return p->below.class->wants(&p->below, read, write);
}

static void proxied_end_writing(struct hg_transport *t)
{
    struct proxied *p = t->state;
    p->below.class->end_writing(&p->below);
}

static void proxied_close(struct hg_transport *t)
{
    struct proxied *p = t->state;
    hg_transport_close(&p->below);
    hg_free(p);
}

static const struct hg_transport_class proxied_class = {
    .read = proxied_read,
    .write = proxied_write,
    .wants = proxied_wants,
    .end_writing = proxied_end_writing,
    .close = proxied_close,
};

enum hg_status hg_proxied_begin(struct hg_transport *t, const struct hg_entry *entry)
{
    struct proxied *p = hg_calloc(1, sizeof *p);
    if (!p)
        return HG_E_NOMEM;
    p->below = *t;
    p->entry = *entry;
    p->need = HG_PROXY_FIXED_BYTES;
    hg_transport_become(t, &proxied_class, p);
    return HG_OK;
}
