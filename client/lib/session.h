// session.h - the conversation: hello, authentication, the messages that the library answers
// itself. Floor 6 (client). One thread at a time.
#ifndef HG_CLIENT_LIB_SESSION_H
#define HG_CLIENT_LIB_SESSION_H

#include "client/lib/conn.h"

// The first bytes of a connection that has just been made.
enum hg_status hg_client_greet(struct helio *h) HG_MUST_CHECK;
// Acts on one complete message; owns it from here on.
enum hg_status hg_client_dispatch(struct helio *h, struct hg_client_message *message) HG_MUST_CHECK;

// Private worker: a new empty scene in place of the one before, if there was one. The worker
// answers `request` (0 = none) by ok.
enum hg_status hg_client_next_scene(
    struct helio *h, uint32_t request, struct hg_error *err) HG_MUST_CHECK;

// Adds to the error of a request (0: of the connection) which limit it is of, where the server has
// said so.
void hg_client_add_limit(const struct helio *h, uint32_t request, struct hg_error *err);

#endif
