// conn_share.h - output-total, shared by the clients for which much waits; input-total, by those of
// whose messages a part has come.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_CONN_SHARE_H
#define HG_BROKER_CONN_SHARE_H

#include "server/broker/connection/conn.h"

// Once in a while: gives every connection its share while memory for output is short; closes the
// one for which most waits when there is more than output-total.
void hg_conn_share_output(struct hg_conn_table *table);
// Once in a while: closes those of the token of whose messages most has come while more than
// input-total has, the largest first.
void hg_conn_share_input(struct hg_conn_table *table);
// Once in a while: closes those that send too little of a message that they have begun.
void hg_conn_check_input(struct hg_conn_table *table);

#endif
