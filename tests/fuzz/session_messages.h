// session_messages.h - messages that fit together: what they name is there. Test code.
#ifndef HG_TESTS_FUZZ_SESSION_MESSAGES_H
#define HG_TESTS_FUZZ_SESSION_MESSAGES_H

#include "protocol/hgp.h"

typedef void session_message_fn(enum hgp_type type, const void *message);

// Calls `add` with every message; all belong to view 1 and to ids 1 .. 4 of a private scene.
void session_messages(session_message_fn *add);

#endif
