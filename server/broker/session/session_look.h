// session_look.h - the broker's state of how views show the scene: clipping planes, overrides and
// variants, which a new worker gets again; numbers of frames in queries. Floor 6 (broker). Thread:
// the loop.
#ifndef HG_BROKER_SESSION_LOOK_H
#define HG_BROKER_SESSION_LOOK_H

#include "server/broker/session/session_state.h"

// Bytes of overrides, planes and variants that are kept for one view.
#define HG_SESSION_LOOK_BYTES (4u << 20)

// Of view_clip, view_overrides and view_variant. HG_E_NOTFOUND: no such view. HG_E_LIMIT: more than
// HG_SESSION_LOOK_BYTES.
enum hg_status hg_session_look_check(struct hg_session *session, const struct hg_packet *packet,
    const union hgp_any *message, struct hg_error *err) HG_MUST_CHECK;
// The worker accepted one of these: it takes the place of those that it replaces, and is recorded.
void hg_session_look_note(struct hg_session *session, struct hg_packet *packet);
// One that was recorded, after its view. HG_E_FORMAT, HG_E_NOMEM.
enum hg_status hg_session_look_take(
    struct hg_session *session, const struct hg_state_look *record) HG_MUST_CHECK;
// Sends them to a worker that does not have them.
void hg_session_look_restore(struct hg_session *session, const struct hg_session_view *view);

// A query with the number of a frame, as the worker counts frames. The packet itself, with one more
// reference, where nothing differs; NULL: no memory.
struct hg_packet *hg_session_look_translate(struct hg_session *session, struct hg_packet *packet,
    const union hgp_any *message) HG_MUST_CHECK;
// The number in the answer to a query, as the client counts frames.
void hg_session_look_renumber(
    struct hg_session *session, const struct hg_packet *query, struct hg_packet *answer);

#endif
