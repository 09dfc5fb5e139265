#include "server/broker/transport/proxy_header.h"

#include <netinet/in.h>
#include <string.h>

static const uint8_t signature[12] = "\r\n\r\n\0\r\nQUIT\n";

enum {
    V4_BYTES = 12,
    V6_BYTES = 36,
    LOCAL = 0x20,
    PROXY = 0x21,
    STREAM_V4 = 0x11,
    STREAM_V6 = 0x21
};

static enum hg_status refuse(struct hg_proxy_header *out, enum hg_status status, const char *reason)
{
    *out = (struct hg_proxy_header){.reason = reason};
    return status;
}

// The address block begins with the source's address, the destination's, the source's port.
static enum hg_status take_address(
    unsigned family, const uint8_t *block, size_t size, struct hg_proxy_header *out)
{
    if (family == STREAM_V4 && size >= V4_BYTES) {
        struct sockaddr_in *v4 = (struct sockaddr_in *)&out->source;
        v4->sin_family = AF_INET;
        memcpy(&v4->sin_addr, block, 4);
        memcpy(&v4->sin_port, block + 8, 2);
        return HG_OK;
    }
    if (family == STREAM_V6 && size >= V6_BYTES) {
        struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)&out->source;
        v6->sin6_family = AF_INET6;
        memcpy(&v6->sin6_addr, block, 16);
        memcpy(&v6->sin6_port, block + 32, 2);
        return HG_OK;
    }
    if (family == STREAM_V4 || family == STREAM_V6)
        return refuse(out, HG_E_FORMAT, "a PROXY header is too short for its addresses");
    return HG_OK; // UNSPEC, datagrams, unix: no address that could be counted
}

enum hg_status hg_proxy_header_parse(const void *data, size_t size, struct hg_proxy_header *out)
{
    const uint8_t *bytes = data;
    const size_t known = size < sizeof signature ? size : sizeof signature;
    *out = (struct hg_proxy_header){.bytes = HG_PROXY_FIXED_BYTES};
    if (size >= 5 && memcmp(bytes, "PROXY", 5) == 0)
        return refuse(out, HG_E_VERSION,
            "version 1 of the PROXY protocol is not taken; let the proxy send version 2");
    if (memcmp(bytes, signature, known) != 0 && (size >= 5 || memcmp(bytes, "PROXY", size) != 0))
        return refuse(out, HG_E_FORMAT, "a proxy (proxy-from) sends no PROXY header");
    if (size < HG_PROXY_FIXED_BYTES)
        return HG_E_AGAIN;
    const size_t length = (size_t)bytes[14] << 8 | bytes[15];
    if (bytes[12] != LOCAL && bytes[12] != PROXY)
        return refuse(out, HG_E_FORMAT, "the version or command of a PROXY header is not known");
    if (HG_PROXY_FIXED_BYTES + length > HG_PROXY_MOST_BYTES)
        return refuse(out, HG_E_LIMIT, "a PROXY header is too large");
    out->bytes = HG_PROXY_FIXED_BYTES + length;
    if (size < out->bytes)
        return HG_E_AGAIN;
    return bytes[12] == LOCAL ? HG_OK
                              : take_address(bytes[13], bytes + HG_PROXY_FIXED_BYTES, length, out);
}
