#include "server/broker/transport/detect.h"

#include <string.h>

#include "base/alloc.h"
#include "protocol/hgp.h"
#include "server/broker/metrics/counters.h"

enum { ENOUGH = 2, TLS_HANDSHAKE = 22 }; // the type of the first record of TLS

struct detect {
    struct hg_transport below;
    const struct hg_web *web;
    uint8_t first[ENOUGH];
    size_t size;
    bool held; // see hg_detect_hold
};

static bool is_letter(uint8_t c)
{
    return c >= 'A' && c <= 'Z';
}

// HGP from here on: `t` becomes what is below.
static void become_plain(struct hg_transport *t)
{
    struct detect *d = t->state;
    const struct hg_transport below = d->below;
    hg_free(d);
    hg_transport_become(t, below.class, below.state);
}

static enum hg_status become_http(struct hg_transport *t)
{
    struct detect *d = t->state;
    enum hg_status status = hg_http_transport_begin(t, &d->below, d->web, d->first, d->size);
    if (!status)
        hg_free(d);
    return status ? HG_E_IO : HG_OK;
}

static enum hg_status detect_read(struct hg_transport *t, void *dst, size_t size, size_t *got)
{
    struct detect *d = t->state;
    uint8_t first[ENOUGH];
    size_t n;
    *got = 0;
    if (t->fault)
        return hg_transport_discard(&d->below, HG_E_FORMAT);
    enum hg_status status =
        d->below.class->read(&d->below, d->first + d->size, ENOUGH - d->size, &n);
    d->size += n;
    t->fault = d->below.fault;
    if (status)
        return status;
    if (!is_letter(d->first[0]) || size < ENOUGH) {
        hg_count(HG_COUNT_REFUSED_PREFACE);
        t->fault = d->first[0] == TLS_HANDSHAKE
                       ? "speaks TLS; this listener does not (tls:HOST:PORT)"
                       : "speaks neither HGP nor HTTP";
        return HG_E_FORMAT;
    }
    if (d->size < ENOUGH)
        return HG_E_AGAIN;
    memcpy(first, d->first, ENOUGH);
    if (memcmp(first, HGP_PREFACE, ENOUGH) == 0) {
        become_plain(t);
        memcpy(dst, first, ENOUGH);
        *got = ENOUGH;
        return HG_OK;
    }
    const bool held = d->held;
    status = become_http(t);
    if (held && !status)
        return HG_E_AGAIN;
    return status ? status : t->class->read(t, dst, size, got);
}

static enum hg_status detect_write(
    struct hg_transport *t, const struct iovec *parts, int count, size_t *sent)
{
    struct detect *d = t->state;
    return d->below.class->write(&d->below, parts, count, sent);
}

static uint32_t detect_wants(const struct hg_transport *t, bool read, bool write)
{
    const struct detect *d = t->state;
    return d->below.class->wants(&d->below, read, write);
}

static void detect_end_writing(struct hg_transport *t)
{
    struct detect *d = t->state;
    d->below.class->end_writing(&d->below);
}

static void detect_close(struct hg_transport *t)
{
    struct detect *d = t->state;
    hg_transport_close(&d->below);
    hg_free(d);
}

static enum hg_status detect_flush(struct hg_transport *t)
{
    struct detect *d = t->state;
    return hg_transport_flush(&d->below);
}

static bool detect_has_input(const struct hg_transport *t)
{
    const struct detect *d = t->state;
    return hg_transport_has_input(&d->below);
}

const struct hg_transport_class hg_transport_detect = {
    .read = detect_read,
    .write = detect_write,
    .wants = detect_wants,
    .end_writing = detect_end_writing,
    .close = detect_close,
    .flush = detect_flush,
    .has_input = detect_has_input,
};

enum hg_status hg_detect_begin(struct hg_transport *t, const struct hg_web *web)
{
    struct detect *d = hg_calloc(1, sizeof *d);
    if (!d)
        return HG_E_NOMEM;
    d->below = *t;
    d->web = web;
    hg_transport_become(t, &hg_transport_detect, d);
    return HG_OK;
}

bool hg_detect_hold(struct hg_transport *t)
{
    if (t->class != &hg_transport_detect)
        return false;
    ((struct detect *)t->state)->held = true;
    return true;
}
