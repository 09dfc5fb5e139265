// proxied.h - a stream that a proxy sends on: its first bytes say for whom (PROXY protocol).
// Floor 6 (broker). Thread: the loop. Reads exactly the header, so that whatever comes behind it
// (TLS, HTTP, HGP) begins where it should.
#ifndef HG_BROKER_PROXIED_H
#define HG_BROKER_PROXIED_H

#include "server/broker/transport/detect.h"
#include "server/broker/transport/tls.h"

// What comes in at a listener, as far as transports make something of it.
struct hg_entry {
    const struct hg_web *web; // NULL: HGP only
    const struct hg_tls *tls; // NULL: in the clear
};

// `t`, a transport of sockets, becomes what `entry` says. HG_E_NOMEM: unusable.
enum hg_status hg_entry_begin(struct hg_transport *t, const struct hg_entry *entry) HG_MUST_CHECK;
// The same, once a header has said who the peer is: *t->peer is another then, and t->renamed.
enum hg_status hg_proxied_begin(struct hg_transport *t, const struct hg_entry *entry) HG_MUST_CHECK;

#endif
