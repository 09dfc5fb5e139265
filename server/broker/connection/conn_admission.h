// conn_admission.h - admits connections (slots.h) and answers those that are refused.
// Floor 6 (broker). Thread: the loop. Whether a client speaks HGP or HTTP shows in its first bytes,
// so one that is refused waits for them, apart from the slots of others; it is answered in its own
// language then. One that stays silent is closed.
#ifndef HG_BROKER_CONN_ADMISSION_H
#define HG_BROKER_CONN_ADMISSION_H

#include "server/broker/connection/conn.h"

// Admits it by what is known of its peer, or refuses it: at once, or once its first bytes tell in
// which protocol (slot.why).
void hg_conn_admit(struct hg_conn *conn);
// One that waits so has been read from, with this result.
void hg_conn_answer_refusal(struct hg_conn *conn, enum hg_status status);

#endif
