// WebSocket frames: a stream means the same in one piece and in pieces of any size.
#include <stdlib.h>
#include <string.h>

#include "protocol/websocket.h"
#include "tests/fuzz/fuzz.h"

struct outcome {
    uint64_t hash;
    size_t bytes, pings;
    unsigned event, code;
};

static void add(struct outcome *o, const uint8_t *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        o->hash = (o->hash ^ data[i]) * UINT64_C(1099511628211);
    o->bytes += size;
}

static struct outcome run(const uint8_t *data, size_t size, size_t step, bool masked)
{
    struct outcome o = {0};
    struct hg_ws_reader r = {.masked = masked, .limit = 1 << 12};
    for (size_t at = 0; at < size && o.event < HG_WS_CLOSED; at += step) {
        size_t n = size - at < step ? size - at : step;
        uint8_t *piece = malloc(n);
        memcpy(piece, data + at, n);
        for (size_t src = 0, dst = 0, used, got; src < n && o.event < HG_WS_CLOSED; src += used) {
            o.event = hg_ws_read(&r, piece + src, n - src, piece + dst, &used, &got);
            if (got > used || used > n - src || (!used && o.event == HG_WS_MORE))
                abort();
            add(&o, piece + dst, got);
            dst += got;
            if (o.event == HG_WS_PINGED) {
                add(&o, r.control, r.control_size);
                o.pings++;
            }
        }
        free(piece);
    }
    o.code = r.code;
    if (o.event != HG_WS_CLOSED && o.event != HG_WS_REJECTED)
        o.event = 0; // the newest control frame is no end
    return o;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (!size)
        return 0;
    const bool masked = data[0] & 1;
    data++;
    size--;
    struct outcome whole = run(data, size, size ? size : 1, masked);
    const size_t steps[] = {1, 3, 1 + size / 3};
    for (int i = 0; i < 3; i++) {
        struct outcome pieces = run(data, size, steps[i], masked);
        if (pieces.hash != whole.hash || pieces.bytes != whole.bytes ||
            pieces.pings != whole.pings || pieces.event != whole.event || pieces.code != whole.code)
            abort();
    }
    return 0;
}
