// PROXY headers: what is taken lies within what came, and what is needed never shrinks.
#include <stdlib.h>

#include "server/broker/transport/proxy_header.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hg_proxy_header h;
    enum hg_status status = hg_proxy_header_parse(data, size, &h);
    if (status == HG_OK ? h.bytes > size : status == HG_E_AGAIN ? h.bytes <= size : !h.reason)
        abort();
    return 0;
}
