// trial.h - finds the request that a worker died of: suspects are tried again, one at a time.
// Floor 6 (broker). Thread: the loop.
//
// Requests and subscriptions that were under way when a worker died are suspects. Once all scenes
// are in the new worker, each is sent alone, with nothing else running in that worker, until it is
// done or has run for twice as long as before (0.25 to 3 s). So a second death is the fault of the
// one that ran. Its files are remembered beyond its session (suspect.h, quarantine.h).
#ifndef HG_BROKER_TRIAL_H
#define HG_BROKER_TRIAL_H

#include "server/broker/session/session_state.h"

// A new request. It becomes a suspect if it is for a file that is suspected.
void hg_trial_meet(struct hg_session *session, struct hg_request *request);
// Whether the request has to wait: suspects wait for their trial, others for all suspects.
bool hg_trial_must_wait(const struct hg_session *session, const struct hg_request *request);
// Whether nothing may be sent to that worker by any session: a suspect is on trial, or would be the
// next but scenes are still replayed. `pump` is set when that ends.
bool hg_trial_holds_all(const struct hg_link *link);
// The suspect is sent: its trial begins.
void hg_trial_begin(struct hg_session *session, const struct hg_request *request);
// The request is answered or removed: it is no suspect any more.
void hg_trial_clear(struct hg_session *session, struct hg_request *request);
// The request is removed unanswered, as its session ends. The worker may still die of it, so its
// files are noted.
void hg_trial_leave(struct hg_session *session, const struct hg_request *request);
// Sends the session's next subscription that waits for its trial, if nothing else is on trial.
void hg_trial_subscribe(struct hg_session *session);
// To be called periodically: a suspect that has run long enough is cleared.
void hg_trial_check_time(struct hg_link *link);
// After a death, first: if the worker hung and named the request or view, that alone is blamed.
void hg_trial_accuse(struct hg_link *link);
// Then, for each request and view of its sessions: makes it a suspect if it was under way. True: it
// is to blame, and to be given up.
bool hg_trial_blames(struct hg_session *session, struct hg_request *request);
bool hg_trial_blames_view(struct hg_session *session, struct hg_session_view *view);
// After all of them: notes the files of requests whose sessions had ended, and resets the trial.
void hg_trial_end(struct hg_session_table *table, struct hg_link *link);
// HG_E_WORKER: the packet is for a file that is in quarantine.
enum hg_status hg_trial_check(const struct hg_session *session, const struct hg_packet *packet,
    struct hg_error *err) HG_MUST_CHECK;
// The packet was executed or refused and the worker lives: its files are not suspected any more.
void hg_trial_passed(struct hg_session *session, const struct hg_packet *packet);

#endif
