// session_request.h - requests on their way to the worker: their order, when each may be sent, and
// what a worker must know of a session first.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_REQUEST_H
#define HG_BROKER_SESSION_REQUEST_H

#include "server/broker/session/session_state.h"

// Queues a message for the worker and sends it when it may be sent. Does not take the packet.
void hg_session_request_relay(struct hg_session *session, struct hg_packet *packet);
// A frame_request or exposure_query that the client no longer waits for is answered by `cancelled`.
void hg_session_request_cancel(struct hg_session *session, const struct hgp_frame_cancel *message);
// NULL: not known.
struct hg_request *hg_session_request_find(struct hg_session *session, uint32_t link_id);
void hg_session_request_drop(struct hg_session *session, struct hg_request *request);
// The worker that had it is gone: it is to be sent again.
void hg_session_request_lost(struct hg_session *session, struct hg_request *request);
// Answers everything under way with `err` and forgets it.
void hg_session_request_fail_all(struct hg_session *session, const struct hg_error *err);
// Sends what may be sent: all requests in order, suspects of a death one at a time. While the
// worker reads slowly sessions take turns.
void hg_session_request_pump(struct hg_session *session);
void hg_session_request_pump_all(struct hg_session_table *table, struct hg_link *link);
// The session must not be read while it has too much under way.
bool hg_session_request_is_full(const struct hg_session *session);
// Nor while too much waits for the worker, and more than its share of it is this session's.
bool hg_session_request_is_crowded(const struct hg_session *session);
// Makes the views again in the worker that has the session, with their subscriptions.
void hg_session_request_restore(struct hg_session *session);
// Whose turns are the session's in the worker, and their weight, which its token says.
void hg_session_request_tell_tenant(struct hg_session *session);
// The scene is in the worker: attaches the session, restores its views, sends its requests.
void hg_session_request_attach(struct hg_session *session);

#endif
