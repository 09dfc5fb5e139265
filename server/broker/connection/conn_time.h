// conn_time.h - what has to happen within some time: handshakes, answers to pings, reading.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_CONN_TIME_H
#define HG_BROKER_CONN_TIME_H

#include "server/broker/connection/conn.h"

// Once in a while: handshakes, silent and stuck clients.
void hg_conn_check_times(struct hg_conn_table *table);

#endif
