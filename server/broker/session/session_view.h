// session_view.h - the broker's state of a session's views: quotas, state for a new worker,
// credit. Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_VIEW_H
#define HG_BROKER_SESSION_VIEW_H

#include "server/broker/session/session_state.h"

struct hg_session_view *hg_session_view_find(struct hg_session *session, uint32_t number);
uint64_t hg_session_view_pixels(const struct hg_session *session); // of all views
// Quotas of view_set; makes the record. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_session_view_ask(
    struct hg_session *session, const struct hgp_view_set *m, struct hg_error *err) HG_MUST_CHECK;
// A view that a worker had accepted with these parameters, made or changed. NULL: *err says why.
struct hg_session_view *hg_session_view_take(struct hg_session *session, uint32_t number,
    struct hg_packet *params, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_session_view_merge(struct hg_packet **into, struct hg_packet *from) HG_MUST_CHECK;
// A view_camera that took effect: a new worker gets it.
void hg_session_view_note_camera(struct hg_session *session, struct hg_packet *packet);
// Its subscription is no suspect any more, or is gone.
void hg_session_view_clear(struct hg_session *session, struct hg_session_view *view);
// Sends the subscription that the client made to a worker that does not have it.
void hg_session_view_subscribe(struct hg_session *session, struct hg_session_view *view);
void hg_session_view_reset(struct hg_session_view *view); // as if the worker had never taken it
void hg_session_view_remove(struct hg_session *session, struct hg_session_view *view);
// The first credit of a subscription: at least one frame, if the client gave credit.
uint32_t hg_session_view_take_window(struct hg_session *session, struct hg_session_view *view);
// The worker may be asked for something whose answer has `bytes`: with what waits for the client
// and what it was asked for already the answer stays within output-limit, or it is the only one.
// False: hg_conn_events.drained comes when the client has taken something.
bool hg_session_view_may_grant(const struct hg_session *session, uint64_t bytes);
// Gives the worker credit for more frames while there is room for them, in turns over the views.
// A frame has come: its pixels are taken off what the token may have.
void hg_session_view_count(
    struct hg_session *session, const struct hg_packet *packet, const struct hgp_frame *frame);
// How long until the session may have something rendered; 0 = now. *limit: the option that says so.
uint64_t hg_session_view_wait_ns(struct hg_session *session, const char **limit);
void hg_session_view_tick(struct hg_session_table *table); // every 50 ms: those that waited
void hg_session_view_grant_all(struct hg_session *session);

#endif
