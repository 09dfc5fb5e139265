// scene_journal.h - the journal of a scene: its accepted edits, compacted, for replay.
// Floor 6 (broker). Thread: the loop.
//
// The journal is a log in the order in which the worker accepted the edits. A field that a later
// edit of the same object overwrites is removed from the earlier entry, and an entry without
// fields goes, unless it made the object. So each field of each object stands in the log exactly
// once, at the place of its last write: the log does not grow with the number of edits, and playing
// it gives the same scene, because every reference was valid at its place and the parents seen on
// the way are a subset of the final (acyclic) ones. Messages without optional fields (mesh_set,
// texture_set) replace the old entry in its place where what they refer to was made before it.
//
// References to objects that were removed later are dropped while playing, as the scene did.
#ifndef HG_BROKER_SCENE_JOURNAL_H
#define HG_BROKER_SCENE_JOURNAL_H

#include "server/broker/connection/packet.h"
#include "server/broker/storage/upload_store.h"

struct hg_journal;

struct hg_journal_stats {
    uint64_t entries, bytes; // bytes of memory, about
};

// `store` (may be NULL) keeps the uploads that entries name; it outlives the journal.
struct hg_journal *hg_journal_create(
    struct hg_upload_store *store) HG_MUST_CHECK;    // NULL: no memory
void hg_journal_destroy(struct hg_journal *journal); // accepts NULL

// True for the messages that change a scene and belong into its journal.
bool hg_journal_wants(uint16_t type);

// Takes note of an edit that the worker accepted (keeps a reference to the packet). HG_E_NOMEM;
// HG_E_FORMAT when the packet does not decode.
enum hg_status hg_journal_accept(
    struct hg_journal *journal, struct hg_packet *packet) HG_MUST_CHECK;

// Keeps (or gives back) the contents that an edit names; `store` may be NULL. HG_E_NOMEM.
enum hg_status hg_journal_hold_uploads(
    struct hg_upload_store *store, const struct hg_packet *packet, bool hold) HG_MUST_CHECK;

// Calls emit for every entry in order with a reference that emit takes over. Stops at the first
// failure, of emit or of memory, and returns it.
enum hg_status hg_journal_play(struct hg_journal *journal,
    enum hg_status (*emit)(void *user, struct hg_packet *packet), void *user) HG_MUST_CHECK;

// Calls `take` for every entry in order, as it was accepted and stripped since.
void hg_journal_each(const struct hg_journal *journal,
    void (*take)(void *user, struct hg_packet *packet), void *user);
// Sets bit n of bits[0..count) where an object has an id of the n-th range of `range` ids, from 1.
void hg_journal_mark_ids(
    const struct hg_journal *journal, uint32_t range, uint64_t *bits, uint32_t count);
// Some object has an id from `first` to `first + count - 1`, or belongs to an asset that has.
bool hg_journal_uses_ids(const struct hg_journal *journal, uint32_t first, uint32_t count);

struct hg_journal_stats hg_journal_get_stats(const struct hg_journal *journal);

#endif
