#include "server/broker/session/session_allow.h"

enum { AFTER_DRAIN_MS = 5000 };
static const double acts_per_second = 20, acts_most = 100;

enum hg_status hg_session_allow_act(struct hg_session *s, const char *what, struct hg_error *err)
{
    struct hg_session_pace *pace = &s->pace;
    const uint64_t now_ns = s->table->loop->now_ns;
    pace->acts +=
        pace->acts_ns ? (double)(now_ns - pace->acts_ns) * 1e-9 * acts_per_second : acts_most;
    pace->acts_ns = now_ns;
    if (pace->acts > acts_most)
        pace->acts = acts_most;
    if (pace->acts < 1) {
        hg_error_set(err, HG_E_BUSY, what, NULL,
            "this session makes more such changes than %.0f a second", acts_per_second);
        return hg_error_limit(err, "changes-per-session", (uint32_t)(1000 / acts_per_second));
    }
    pace->acts -= 1;
    return HG_OK;
}

enum hg_status hg_session_allow_begin(const struct hg_session_table *table, enum hgp_role role,
    const char *what, struct hg_error *err)
{
    const uint64_t now_ns = table->loop->now_ns;
    if (!table->drain.due_ns || role == HGP_role_ADMIN)
        return HG_OK;
    const uint64_t left_ns = table->drain.due_ns > now_ns ? table->drain.due_ns - now_ns : 0;
    hg_error_set(err, HG_E_STATE, what, NULL,
        table->drain.over ? "the daemon is closed to all but administrators (drain_set)"
                          : "the daemon is draining; nothing new is begun");
    return hg_error_limit(err, "drain", (uint32_t)(left_ns / 1000000) + AFTER_DRAIN_MS);
}
