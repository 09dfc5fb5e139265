// conn_share.h - output-total, shared by the clients for which much waits.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_CONN_SHARE_H
#define HG_BROKER_CONN_SHARE_H

#include "server/broker/conn.h"

// Once in a while: gives every connection its share while memory for output is short; closes the
// one for which most waits when there is more than output-total.
void hg_conn_share_output(struct hg_conn_table *table);

#endif
