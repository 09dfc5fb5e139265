// view_rate.h - how fast frames go out: credit, frame rate, samples of a step, progress.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_RATE_H
#define HG_SERVER_WORKER_VIEW_VIEW_RATE_H

#include "server/worker/view/view_slot.h"

// A client begins to watch, and may be sent `credit` frames.
void hg_rate_subscribe(struct view_slot *view, uint32_t credit);
void hg_rate_add_credit(struct view_slot *view, uint32_t frames);
// Whether the newest frame is due for the subscriber: the first of a new state, then those at
// doubling sample counts or with another exposure, then the settled one; whether or not it is due
// yet.
bool hg_rate_wants(const struct view_slot *view);
// When max_fps and the network let it go; UINT64_MAX: not before a frame has been delivered.
// heard_ns: until when that was taken note of. What a client says while a step is drawn waits for
// the step's end, so until then no frame is late for want of it.
uint64_t hg_rate_due_ns(struct view_slot *view, uint64_t heard_ns);
// When the next picture in motion may begin, likewise.
uint64_t hg_rate_begin_ns(struct view_slot *view, uint64_t heard_ns);
// When the newest frame of a view in motion has to be out, so that the next one keeps the chosen
// frame rate; 0: no frame of it is waited for like that.
uint64_t hg_rate_encoded_ns(const struct view_slot *view);
// What the next subscribed frame is made with; `sharing` views move.
struct hg_control_choice hg_rate_choose(struct view_slot *view, uint32_t sharing);
// Takes note of frames that the encoders have finished.
void hg_rate_note_sent(struct view_slot *view);
// A client says which frame it has; at_ns: when.
void hg_rate_delivered(struct view_slot *view, const struct hg_control_delivery *delivery);
// The newest frame goes to the encoder; reading it took read_ns.
void hg_rate_sent(struct view_slot *view, uint64_t read_ns);

// How many samples the next step should draw to take about so long.
uint32_t hg_rate_samples(const struct view_slot *view, uint64_t step_ns);
// Sends progress to requests that wait for the settled frame, a few times a second.
void hg_rate_send_progress(struct view_slot *view, struct frame_wait *wait, struct reply_to to);

#endif
