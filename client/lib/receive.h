// receive.h - bytes of the transport to whole messages. Floor 6 (client). One thread at a time.
#ifndef HG_CLIENT_LIB_RECEIVE_H
#define HG_CLIENT_LIB_RECEIVE_H

#include "client/lib/session.h"

// Reads what is there. HG_OK, or the connection has failed.
enum hg_status hg_client_receive(struct helio *h) HG_MUST_CHECK;

#endif
