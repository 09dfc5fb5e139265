// state_record.h - what the records of the state log say.
// Floor 6 (broker). Thread: the loop; decoding is pure.
//
// A scene's edits stand in the log as they were accepted; accepting them again in their order gives
// its journal. Times are those of the wall clock, in seconds since 1970.
#ifndef HG_BROKER_STATE_RECORD_H
#define HG_BROKER_STATE_RECORD_H

#include "protocol/hgp.h"
#include "server/broker/state/state_log.h"

// Values never change meaning.
enum hg_state_kind {
    HG_STATE_SCENE = 1,          // was made
    HG_STATE_EDIT = 2,           // was accepted
    HG_STATE_SCENE_END = 3,      // no session has it open
    HG_STATE_QUARANTINE = 4,     // a file ended a worker; replaces an older record of it
    HG_STATE_QUARANTINE_END = 5, // it was loaded well, or forgiven
    HG_STATE_SESSION = 6,        // a session with a ticket; replaces an older record of it
    HG_STATE_SESSION_END = 7,
    HG_STATE_VIEW = 8, // of such a session; replaces an older record of it
    HG_STATE_VIEW_END = 9,
    HG_STATE_ANNOTATION = 32,     // of a scene; replaces an older record of it
    HG_STATE_ANNOTATION_END = 33, // its number is not given again
    HG_STATE_TICKET = 34,         // a join ticket; replaces an older record of it
    HG_STATE_TICKET_END = 35,
    HG_STATE_BLOCK = 36, // a token that is refused for a while
    HG_STATE_LOOK = 37,  // of a view, after its record: planes, overrides or a variant, as accepted
};

struct hg_state_scene {
    uint32_t number;
    struct hgp_str tenant, name;
};

struct hg_state_edit {
    uint32_t scene;
    uint64_t revision; // of the scene, with it
    uint16_t type;     // of the message
    struct hgp_bytes payload;
};

struct hg_state_suspect {
    struct hgp_str tenant, what;
    uint8_t key[32];
    uint32_t deaths;
    uint64_t seen_s, until_s;
};

struct hg_state_session {
    uint32_t number, scene; // scene 0: none is open
    uint32_t first_id;
    uint8_t role;
    bool has_token, batch_open;
    uint8_t token[32], ticket[32]; // hashes
    struct hgp_str name, tenant;
    // Not there in records of earlier versions.
    uint8_t watch; // bits: participants, cursors, camera, annotations, edits
    bool has_color;
    uint32_t color;
    struct hgp_str label;
};

struct hg_state_view {
    uint32_t session, number;
    uint32_t credit;                 // of its subscription; 0: it has none
    bool follows;                    // the shared camera
    struct hgp_bytes params, camera; // payloads of view_set and view_camera; camera may be empty
};

struct hg_state_look {
    uint32_t session, view;
    uint16_t type; // of the message
    struct hgp_bytes payload;
};

struct hg_state_annotation {
    uint32_t scene, number;
    uint8_t kind;
    float position[3], normal[3];
    uint64_t node;
    uint32_t color;
    struct hgp_str text, author, label;
    uint8_t author_key[32];
    uint32_t author_session;
    uint64_t time_ms, changed_ms;
};

struct hg_state_ticket {
    uint32_t number;
    uint8_t hash[32], issuer_key[32];
    bool has_issuer_key;
    uint8_t role;
    uint32_t uses, used, weight, max_rate, max_pixels;
    uint64_t until_s;
    struct hgp_str tenant, issuer, scene, label;
    struct hgp_str roots; // empty in records of programs before
};

struct hg_state_block {
    uint8_t hash[32];
    uint64_t until_s;
};

struct hg_state_record {
    enum hg_state_kind kind;
    union {
        struct hg_state_scene scene; // SCENE_END: its number
        struct hg_state_edit edit;
        struct hg_state_suspect suspect;       // QUARANTINE_END: tenant and key
        struct hg_state_session session;       // SESSION_END: its number
        struct hg_state_view view;             // VIEW_END: session and number
        struct hg_state_annotation annotation; // ANNOTATION_END: scene and number
        struct hg_state_ticket ticket;         // TICKET_END: its number
        struct hg_state_block block;
        struct hg_state_look look;
    } of;
};

// Texts and payloads borrow the body. HG_E_FORMAT.
enum hg_status hg_state_record_decode(
    const uint8_t *body, size_t size, struct hg_state_record *out) HG_MUST_CHECK;

// Each appends a record and returns its position; a NULL log takes nothing and returns 0.
uint64_t hg_state_put_scene(struct hg_state_log *log, const struct hg_state_scene *scene);
uint64_t hg_state_put_scene_end(struct hg_state_log *log, uint32_t number);
uint64_t hg_state_put_edit(
    struct hg_state_log *log, uint32_t scene, uint64_t revision, struct hg_packet *packet);
uint64_t hg_state_put_suspect(struct hg_state_log *log, const struct hg_state_suspect *suspect);
uint64_t hg_state_put_suspect_end(
    struct hg_state_log *log, const char *tenant, const uint8_t key[32]);
uint64_t hg_state_put_session(struct hg_state_log *log, const struct hg_state_session *session);
uint64_t hg_state_put_session_end(struct hg_state_log *log, uint32_t number);
uint64_t hg_state_put_view(struct hg_state_log *log, const struct hg_state_view *view);
uint64_t hg_state_put_view_end(struct hg_state_log *log, uint32_t session, uint32_t number);
uint64_t hg_state_put_look(
    struct hg_state_log *log, uint32_t session, uint32_t view, struct hg_packet *packet);
uint64_t hg_state_put_annotation(struct hg_state_log *log, const struct hg_state_annotation *it);
uint64_t hg_state_put_annotation_end(struct hg_state_log *log, uint32_t scene, uint32_t number);
uint64_t hg_state_put_ticket(struct hg_state_log *log, const struct hg_state_ticket *ticket);
uint64_t hg_state_put_ticket_end(struct hg_state_log *log, uint32_t number);
uint64_t hg_state_put_block(struct hg_state_log *log, const struct hg_state_block *block);

#endif
