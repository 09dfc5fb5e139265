// slots.h - which connections get a slot: limits in all, by address, by network; slots kept for the
// daemon's own user; early drop of those that open.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SLOTS_H
#define HG_BROKER_SLOTS_H

#include "server/broker/conn.h"

// Counts a new connection, whose peer is known. HG_E_NOMEM.
enum hg_status hg_slots_take(struct hg_conn *conn) HG_MUST_CHECK;
// Why a counted connection may not stay; NULL: it may.
const char *hg_slots_refusal(struct hg_conn *conn);
void hg_slots_opened(struct hg_conn *conn); // its session is open
void hg_slots_leave(struct hg_conn *conn);
// Of `most` slots so many are kept for the privileged: at most a quarter.
uint32_t hg_slots_kept(uint32_t most, uint32_t reserved);

#endif
