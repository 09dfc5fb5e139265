// peer_log.h - log records that peers can cause at will: only so many per second.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_PEER_LOG_H
#define HG_BROKER_PEER_LOG_H

#include <stdbool.h>
#include <stdint.h>

#include "base/log.h"

// Zero-initialised = none left out.
struct hg_peer_log {
    double allowance; // records that may be written now
    uint64_t allowance_ns, dropped;
};

// False when there were too many.
bool hg_peer_log_may(struct hg_peer_log *log, uint64_t now_ns);
#define hg_peer_warn(log, now_ns, scope, ...)                                                      \
    do {                                                                                           \
        if (hg_peer_log_may(log, now_ns))                                                          \
            hg_log_write(HG_LOG_WARN, HG_LOG_##scope, HG_OK, 0, __VA_ARGS__);                      \
    } while (0)

#endif
