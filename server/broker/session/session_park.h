// session_park.h - parked sessions, whose client disconnected, and how they are resumed.
// Floor 6 (broker). Thread: the loop.
//
// A parked session keeps its scene, its range of ids and its views; the worker keeps its scene, but
// not its views: nothing is rendered for it. Its edits that were under way are done.
#ifndef HG_BROKER_SESSION_PARK_H
#define HG_BROKER_SESSION_PARK_H

#include "server/broker/session/session_state.h"

// Whether it is parked, and does not end, when its connection does.
bool hg_session_is_kept(const struct hg_session *session);
// Its client is gone, and it is to be kept.
void hg_session_park(struct hg_session *session);
// `conn` is its client now; hg_session_request_restore shows again what it asked for.
void hg_session_unpark(struct hg_session *session, struct hg_conn *conn);
// A new ticket: its secret (32 bytes). HG_E_NOMEM, HG_E_INTERNAL (no random numbers).
enum hg_status hg_session_new_ticket(
    struct hg_session *session, uint8_t secret[32], struct hg_error *err) HG_MUST_CHECK;
uint32_t hg_session_valid_s(const struct hg_session_table *table); // how long one is kept
// Parked or not. NULL: none has this ticket.
struct hg_session *hg_session_find_ticket(
    const struct hg_session_table *table, const uint8_t hash[32]);
uint32_t hg_session_count_parked(const struct hg_session_table *table);
void hg_session_check_parked(struct hg_session_table *table); // once in a while: who ends

#endif
