// proxy_header.h - the PROXY protocol, version 2: for whom a proxy connects.
// Floor 6 (broker). Pure: bytes in, an address out.
// Source: HAProxy, "The PROXY protocol", versions 1 & 2, section 2.2.
#ifndef HG_BROKER_PROXY_HEADER_H
#define HG_BROKER_PROXY_HEADER_H

#include <sys/socket.h>

#include "base/status.h"

enum { HG_PROXY_FIXED_BYTES = 16, HG_PROXY_MOST_BYTES = 2048 };

struct hg_proxy_header {
    size_t bytes; // that it has; with HG_E_AGAIN: how many are needed to know more
    // Of the client. AF_UNSPEC: the proxy speaks for itself (LOCAL), or does not say for whom.
    struct sockaddr_storage source;
    const char *reason; // of a refusal
};

// HG_OK, HG_E_AGAIN, HG_E_VERSION (version 1), HG_E_LIMIT, HG_E_FORMAT.
enum hg_status hg_proxy_header_parse(
    const void *data, size_t size, struct hg_proxy_header *out) HG_MUST_CHECK;

#endif
