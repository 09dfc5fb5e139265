// residency.h - which of many items are in a fixed number of slots: requests by priority, eviction
// of what was used least recently.
// Floor 1 (residency). Pure CPU, no device. Thread: one at a time (the render thread). Memory is
// taken by create and resize only: about 64 bytes per slot and request.
//
// An item is whatever streams in pieces of one size (a texture page, a chunk of clusters), named by
// a 64-bit key. It is absent, requested, in flight (being read), or resident in a slot:
//
//            request            next              place
//    absent --------> requested ----> in flight --------> resident
//      ^                  | (not renewed)  | cancel          | evicted by place, remove
//      +------------------+----------------+-----------------+
//                         ^-- put_back ----+
//
// Time is counted in frames (hg_residency_tick). An item that was used within the last `hysteresis`
// frames is not evicted for a mere request: when everything is in use, place says so and the caller
// lowers its demands (bias) instead of letting pages chase each other. All results are functions of
// the calls; no clock, no random numbers.
#ifndef HG_RENDERER_RESIDENCY_RESIDENCY_H
#define HG_RENDERER_RESIDENCY_RESIDENCY_H

#include "base/status.h"

#define HG_RESIDENCY_NONE   UINT32_MAX // no slot
#define HG_RESIDENCY_NO_KEY UINT64_MAX // no item; not allowed as a key

struct hg_residency;

struct hg_residency_params {
    uint32_t slots;      // 0 is allowed
    uint32_t requests;   // most items requested or in flight at once; 0 = 4096
    uint32_t hysteresis; // frames; an item used less than this ago stays
    uint32_t patience;   // frames after which a request that is not renewed is dropped; 0 = 8
};

struct hg_residency_stats {
    uint32_t slots, resident, pinned, requested, in_flight; // now
    uint64_t requests, placed, evicted, refused;            // since creation; refused: queue full
};

// HG_E_NOMEM.
enum hg_status hg_residency_create(
    const struct hg_residency_params *params, struct hg_residency **out) HG_MUST_CHECK;
void hg_residency_destroy(struct hg_residency *r); // accepts NULL
// Changes the number of slots. Fewer: the slots above must be empty (hg_residency_item).
// HG_E_NOMEM.
enum hg_status hg_residency_resize(struct hg_residency *r, uint32_t slots) HG_MUST_CHECK;

void hg_residency_tick(struct hg_residency *r); // the next frame begins
uint32_t hg_residency_frame(const struct hg_residency *r);

// Slot of a resident item, else HG_RESIDENCY_NONE.
uint32_t hg_residency_find(const struct hg_residency *r, uint64_t key);
// Key in a slot, HG_RESIDENCY_NO_KEY when it is free.
uint64_t hg_residency_item(const struct hg_residency *r, uint32_t slot);
bool hg_residency_is_in_flight(const struct hg_residency *r, uint64_t key);

// The item in the slot is used in this frame.
void hg_residency_use(struct hg_residency *r, uint32_t slot);
// Pins are counted; a pinned item is never evicted. The last unpin counts as a use.
void hg_residency_pin(struct hg_residency *r, uint32_t slot);
void hg_residency_unpin(struct hg_residency *r, uint32_t slot);
// Frames since the slot's item was used; 0 = in this frame.
uint32_t hg_residency_age(const struct hg_residency *r, uint32_t slot);

// The item is wanted in this frame. Of several requests in one frame the largest priority counts; a
// request of an older frame is renewed with the new priority. True when it is in the queue now (not
// when it is resident or in flight, or the queue is full of more urgent ones).
bool hg_residency_request(struct hg_residency *r, uint64_t key, float priority);
// Most urgent request (equal priorities: the smaller key); it is in flight from now on. False:
// none.
bool hg_residency_next(struct hg_residency *r, uint64_t *key, float *priority);
// The item that was in flight does not come. It may be requested again.
void hg_residency_cancel(struct hg_residency *r, uint64_t key);
// The item that was in flight cannot come yet: it is requested as it was before. It leaves at the
// next tick if its request has become too old meanwhile.
void hg_residency_put_back(struct hg_residency *r, uint64_t key);
// Forgets all requests that are not in flight.
void hg_residency_drop_requests(struct hg_residency *r);

enum hg_residency_force {
    HG_RESIDENCY_GENTLE, // evict only what was not used for `hysteresis` frames
    HG_RESIDENCY_UNUSED, // evict anything that was not used in this frame
    HG_RESIDENCY_ANY,    // evict anything that is not pinned
};
// A slot for an item that is in flight or absent, which is resident (and used) from now on: a free
// one, else that of the least recently used item that may go; *evicted is its key, else
// HG_RESIDENCY_NO_KEY. HG_E_AGAIN: no slot may be taken; nothing changed.
enum hg_status hg_residency_place(struct hg_residency *r, uint64_t key,
    enum hg_residency_force force, uint32_t *slot, uint64_t *evicted) HG_MUST_CHECK;
// Slots that hg_residency_place could take now with that force.
uint32_t hg_residency_available(const struct hg_residency *r, enum hg_residency_force force);
// Empties a slot, pinned or not.
void hg_residency_remove(struct hg_residency *r, uint32_t slot);

void hg_residency_stats(const struct hg_residency *r, struct hg_residency_stats *out);

#endif
