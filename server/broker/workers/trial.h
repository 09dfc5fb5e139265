// trial.h - whose fault a death of a worker was: what was under way is tried again, alone.
// Floor 6 (broker). Thread: the loop.
//
// Requests and subscriptions that were under way at a death are suspects. When all scenes are in
// the new worker again each is sent by itself, and nothing else of that worker meanwhile, until it
// is done or has run for twice as long as before (0.25 to 3 s); so a second death is the fault of
// the one that ran. What it brought is remembered beyond its session
// (suspect.h, quarantine.h).
#ifndef HG_BROKER_TRIAL_H
#define HG_BROKER_TRIAL_H

#include "server/broker/session/session_state.h"

// A new request: one for a file that is suspected becomes a suspect itself.
void hg_trial_meet(struct hg_session *session, struct hg_request *request);
// It may not be sent now: suspects wait for their turn, the others for all suspects.
bool hg_trial_must_wait(const struct hg_session *session, const struct hg_request *request);
// Nothing of any session of that worker may be sent now: a suspect is tried, or would be the next
// and scenes come first. `pump` is set when that ends.
bool hg_trial_holds_all(const struct hg_link *link);
void hg_trial_begin(struct hg_session *session, const struct hg_request *request); // it is sent
// It is done, or goes.
void hg_trial_clear(struct hg_session *session, struct hg_request *request);
// It goes. What it loads may still end the worker after its session has gone: that is remembered.
void hg_trial_leave(struct hg_session *session, const struct hg_request *request);
// Sends the next subscription that waits for its turn, if it is that.
void hg_trial_subscribe(struct hg_session *session);
// Once in a while: what has run long enough is taken for harmless.
void hg_trial_check_time(struct hg_link *link);
// The worker died; where it hung and said in what, that alone is to be blamed.
void hg_trial_accuse(struct hg_link *link);
// Then: what this session had under way becomes suspect, or is to be given up (true).
bool hg_trial_blames(struct hg_session *session, struct hg_request *request);
bool hg_trial_blames_view(struct hg_session *session, struct hg_session_view *view);
// After all of them: blames what sessions that have gone had under way, and the next worker begins
// without anything running.
void hg_trial_end(struct hg_session_table *table, struct hg_link *link);
// A file may not be loaded because of what it did. HG_E_WORKER.
enum hg_status hg_trial_check(const struct hg_session *session, const struct hg_packet *packet,
    struct hg_error *err) HG_MUST_CHECK;
// It was loaded, or refused: the worker lives.
void hg_trial_passed(struct hg_session *session, const struct hg_packet *packet);

#endif
