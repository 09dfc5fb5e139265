// client_dispatch.h - admission of client messages: hello, authentication, state, direction,
// role. Floor 6 (broker). Thread: the loop. All else goes to the client's session.
#ifndef HG_BROKER_CLIENT_DISPATCH_H
#define HG_BROKER_CLIENT_DISPATCH_H

#include "server/broker/connection/auth.h"
#include "server/broker/session/session_state.h"

// Who is let in.
struct hg_admission {
    const struct hg_options *options;
    const struct hg_tokens *tokens;
    struct hg_session_table *sessions;
    struct hg_audit *audit;
};

// Ends the sessions whose token is no longer there, has expired, or has another role now.
void hg_client_dispatch_check_tokens(struct hg_conn_table *conns);

// For connections whose table's owner is a struct hg_admission.
extern const struct hg_conn_events hg_client_dispatch_events;

#endif
