// detect.h - one port for all: the first bytes of a stream say whether it is HGP or HTTP.
// Floor 6 (broker). Thread: the loop. HGP begins with HGP_PREFACE, of which two bytes suffice: no
// method of HTTP begins with them. Then the transport becomes the socket below it, or an HTTP one.
#ifndef HG_BROKER_DETECT_H
#define HG_BROKER_DETECT_H

#include "server/broker/transport/http_transport.h"

extern const struct hg_transport_class hg_transport_detect;

// `t`, a transport of sockets, becomes one that looks at the first bytes. HG_E_NOMEM: nothing has
// changed.
enum hg_status hg_detect_begin(struct hg_transport *t, const struct hg_web *web) HG_MUST_CHECK;
// The owner has an answer whatever comes: of HTTP no request is taken, so that it can be refused.
// False: `t` is not (any more) one that looks at first bytes.
bool hg_detect_hold(struct hg_transport *t);

#endif
