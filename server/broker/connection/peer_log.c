#include "server/broker/connection/peer_log.h"

enum { LOGS_PER_SECOND = 20 };

bool hg_peer_log_may(struct hg_peer_log *log, uint64_t now_ns)
{
    log->allowance += (double)(now_ns - log->allowance_ns) * 1e-9 * LOGS_PER_SECOND;
    log->allowance_ns = now_ns;
    if (log->allowance > LOGS_PER_SECOND)
        log->allowance = LOGS_PER_SECOND;
    if (log->allowance < 1) {
        log->dropped++;
        return false;
    }
    log->allowance -= 1;
    if (log->dropped)
        hg_warn(NET, "%llu records about clients were left out", (unsigned long long)log->dropped);
    log->dropped = 0;
    return true;
}
