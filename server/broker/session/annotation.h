// annotation.h - texts and markers in a scene, which the broker keeps beside the scene's journal.
// Floor 6 (broker). Thread: the loop. Who may change them is for session_annotation.h.
#ifndef HG_BROKER_ANNOTATION_H
#define HG_BROKER_ANNOTATION_H

#include "server/broker/state/state_record.h"

enum { HG_ANNOTATION_TEXT = 2048, HG_ANNOTATIONS_GONE = 256 };

struct hg_annotation {
    uint32_t number;
    uint8_t kind; // enum hgp_annotation_kind
    float position[3], normal[3];
    uint64_t node;
    uint32_t color; // 0xRRGGBB
    char *text;     // owned; "" without text
    char author[129], label[65];
    uint8_t author_key[32];       // hash of its token or ticket; zeros: the daemon's own user
    uint32_t author_session;      // of a join ticket: its session; 0 = all sessions of the token
    uint64_t time_ms, changed_ms; // since 1970 (UTC)
    bool due;                     // to tell those that watch
};

// Zero-initialised = none.
struct hg_annotations {
    struct hg_annotation *items; // by number
    size_t capacity;
    uint32_t count, last_number;
    bool due;                           // changes are to be sent to clients
    bool all_due;                       // all of them: more are gone than are kept count of
    uint32_t gone[HG_ANNOTATIONS_GONE]; // removed, which clients have not got yet
    uint32_t gone_count;
};

// NULL: there is none.
struct hg_annotation *hg_annotation_find(const struct hg_annotations *all, uint64_t number);
// A copy of `like` with a copy of the text (not terminated) and, where `like` has none, the next
// number; it replaces one of its number. NULL: no memory.
struct hg_annotation *hg_annotation_put(struct hg_annotations *all,
    const struct hg_annotation *like, struct hgp_str text) HG_MUST_CHECK;
void hg_annotation_remove(struct hg_annotations *all, uint32_t number);
void hg_annotations_finish(struct hg_annotations *all);

// Of a scene, into the state log; each returns the position.
uint64_t hg_annotation_record(
    struct hg_state_log *log, uint32_t scene, const struct hg_annotation *annotation);
// A snapshot: all, and the last number.
void hg_annotations_record_all(
    struct hg_state_log *log, uint32_t scene, const struct hg_annotations *all);
// One that a record has. HG_E_NOMEM.
enum hg_status hg_annotation_restore(
    struct hg_annotations *all, const struct hg_state_annotation *record) HG_MUST_CHECK;

#endif
