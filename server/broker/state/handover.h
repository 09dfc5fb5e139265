// handover.h - all of the daemon's state in a file of memory, for the program that takes its place
// in the same process (exec): descriptors stay open, workers stay its children.
// Floor 6 (broker). Thread: the loop.
//
// The file has the format of a state log. Records of state_record.h make scenes, sessions, views
// and the quarantine; those of this page, which follow, tie them to descriptors and to what workers
// know.
#ifndef HG_BROKER_HANDOVER_H
#define HG_BROKER_HANDOVER_H

#include "server/broker/session/session_state.h"

struct hg_handover {
    struct hg_session_table *sessions;
    struct hg_conn_table *conns;
    struct hg_listener **listeners;
};

// Nothing is under way that could not be handed over: no request, upload, replay or trial, no
// worker that starts, no client in the handshake.
bool hg_handover_is_quiet(const struct hg_handover *h);
// Ends what may be ended for that: requests other than edits are answered with CANCELLED, uploads
// fail, handshakes are closed.
// Closes connections that cannot be handed over: those of HTTP between two requests, and with `all`
// those of TLS, whose clients go on with their sessions by ticket. Returns how many there were.
uint32_t hg_handover_shed(const struct hg_handover *h, bool all);
void hg_handover_hurry(const struct hg_handover *h);
// *fd stays open over an exec. HG_E_NOMEM, HG_E_NOSPACE, HG_E_IO.
enum hg_status hg_handover_save(
    const struct hg_handover *h, int *fd, struct hg_error *err) HG_MUST_CHECK;
void hg_handover_keep_open(const struct hg_handover *h); // what it speaks of, over an exec
// In the new program, with empty tables. Closes `fd`. HG_E_VERSION, HG_E_FORMAT, HG_E_NOMEM.
enum hg_status hg_handover_load(
    const struct hg_handover *h, int fd, struct hg_error *err) HG_MUST_CHECK;

#endif
