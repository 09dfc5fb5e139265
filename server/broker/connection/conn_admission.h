// conn_admission.h - whether a connection may stay (slots.h), and how one is told that it may not.
// Floor 6 (broker). Thread: the loop. Whether a client speaks HGP or HTTP shows in its first bytes,
// so one that is refused waits for them, apart from the slots of others; it is answered in its own
// language then. One that stays silent is closed.
#ifndef HG_BROKER_CONN_ADMISSION_H
#define HG_BROKER_CONN_ADMISSION_H

#include "server/broker/connection/conn.h"

// May it stay, as far as its peer is known? Else it is told so, or waits to be (slot.why).
void hg_conn_admit(struct hg_conn *conn);
// One that waits so has been read from, with this result.
void hg_conn_tell_refusal(struct hg_conn *conn, enum hg_status status);

#endif
