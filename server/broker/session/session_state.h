// session_state.h - the broker's state of sessions, their views and their requests.
// Floor 6 (broker). Thread: the loop. The session*.h headers have what is done with it.
#ifndef HG_BROKER_SESSION_STATE_H
#define HG_BROKER_SESSION_STATE_H

#include "server/broker/audit.h"
#include "server/broker/connection/auth.h"
#include "server/broker/session/block_list.h"
#include "server/broker/connection/conn.h"
#include "server/broker/session/join_ticket.h"
#include "server/broker/session/pixel_rate.h"
#include "server/broker/workers/quarantine.h"
#include "server/broker/scene/scene.h"

enum {
    HG_SESSION_UPLOADS = 16, // contents of one session that may alternate
    HG_SESSION_TRIES = 4,    // deaths beside others after which a request is given up
    HG_SESSION_POISONS = 3,  // given-up requests after which a session is closed
    HG_SESSION_BUCKETS = 4096,
};

// Which limit the error is of that its worker answers next; name[0] = 0: none.
struct hg_request_limit {
    char name[32];
    uint32_t retry_after_ms;
};

// A message on its way to the worker that matters for the order of things. Most are answered;
// view_camera is not and leaves the list when it reaches the front.
struct hg_request {
    struct hg_request *prev, *next;
    uint32_t link_id;   // on the link; 0 = not sent yet, or never answered
    uint32_t client_id; // 0 = no answer requested
    struct hg_packet *packet;
    bool sent;
    bool suspect; // it is tried alone
    bool answered;
    bool cancelled;   // a frame that the client no longer waits for: it is not sent (again)
    uint8_t deaths;   // of the worker while this was under way
    uint64_t sent_ns; // when it was sent
    uint64_t ran_ns;  // how long until the worker died
    uint64_t charge;  // bytes that its answer may have; counted in granted_bytes while it is sent
    struct hg_request_limit limit;
};

// Accepted view_clip, view_overrides and view_variant that still count, oldest first.
struct hg_session_looks {
    struct hg_packet **items;
    size_t capacity;
    uint32_t count;
};

// Of a view: whether it has the scene's shared camera.
struct hg_session_follow {
    bool on;
    bool due; // its worker does not have the newest one yet
};

struct hg_session_view {
    struct hg_session_view *next;
    uint32_t number;
    bool accepted;            // by the worker, at least once
    uint32_t width, height;   // as requested; for the quota
    struct hg_packet *params; // accepted view_sets, merged; NULL before
    struct hg_packet *camera; // view_cameras, merged; NULL = none
    struct hg_session_looks looks;
    bool subscribed, resubscribe;
    uint32_t credit;       // credit: frames that the client accepts
    uint32_t first_credit; // of the newest subscription
    bool unrecorded;       // its camera has changed since it was written to the state log
    uint32_t granted;      // of these, given to the worker
    uint64_t frame_bytes;  // as many as the newest frame had, before it as many as the size says
    uint64_t last_number, number_base;
    uint64_t shown_seq; // input of the newest subscribed frame
    uint64_t turn;      // of the newest credit; smaller = longer ago
    uint64_t credit_ns; // when that was given
    uint64_t ran_ns;    // how long until the worker died
    bool suspect;       // its subscription is tried alone
    bool held;          // and waits for that
    struct hg_session_follow follow;
};

// The newest upload that failed: its other pieces may still come, and fail the same way.
struct hg_session_failed {
    uint8_t hash[32];
    struct hg_error err;
};

// Requests under way.
struct hg_session_load {
    uint32_t count, frames;    // frames: those that render
    struct hg_request *unsent; // the first that the worker has not, and all behind it; NULL: none
    uint64_t bytes, unsent_bytes; // unsent: of those that the worker has no room for yet
    uint32_t poisons;             // that were given up
};

// What the client was promised.
struct hg_session_answers {
    uint64_t granted_bytes; // that the answers to what was sent may have, subscribed frames apart
    uint64_t query_bytes;   // the largest answer to a query so far
    uint64_t turns;         // of the views
};

// For going on with it on another connection.
struct hg_session_resume {
    uint8_t token[32]; // hash of the client's
    bool has_token;    // false: the daemon's own user
    bool has_ticket;
    uint8_t ticket[32]; // hash of what the client has
    uint64_t parked_ns; // since when it is kept without a client; 0 = it has one, or is to end
    bool waits;         // kept when its connection ends, however that comes
    bool only;          // its join ticket is used up: it may resume a session, and nothing else
};

// Events of its scene that the client has subscribed to (scene_watch).
struct hg_session_watch {
    bool participants, cursors, camera, annotations, edits;
};

// What the session shares with the others of its scene, and has of theirs.
struct hg_session_share {
    struct hg_session *prev, *next; // of the same scene
    struct hg_session_watch watch;
    bool behind;              // its client was slow and has missed annotations
    char label[65];           // what it calls itself
    bool has_color;           // else one by its number
    uint32_t color;           // 0xRRGGBB
    struct hgp_cursor cursor; // as the others have it, or are to
    bool cursor_due;          // is to be sent to the others
    uint64_t asked_ns;        // since when it waits for the shared camera; 0 = it does not
};

// Allowances that fill up with time.
struct hg_session_pace {
    struct hg_pixel_account *account;     // of its token; NULL: not known yet
    bool waits;                           // subscribed frames wait for pixels
    uint64_t wait_told_ns;                // when the client got that notice; 0 = never
    uint64_t frames, pixels, frame_bytes; // that came from the worker, for statistics
    double acts;            // changes that go to many, or into logs, which it may make now
    uint64_t acts_ns;       // when that was counted
    uint64_t active_ns;     // when its client last did something; 0: has not yet
    bool warned;            // that it will end, as it is idle
    uint64_t statistics_ns; // between the statistics sent to it; 0 = none
    uint64_t told_ns;       // when the newest ones were sent
};

struct hg_session_bytes {
    uint64_t uploaded; // that came, for statistics
    uint64_t verified; // of the file that the worker has for image_query
};

struct hg_session {
    struct hg_session *prev, *next;
    struct hg_session *same_bucket; // the next one
    struct hg_session_table *table;
    struct hg_conn *conn; // NULL: the client disconnected; parked, or waits for answers to edits
    uint32_t number;
    enum hgp_role role;
    char name[129];
    char tenant[129];
    struct hg_token_scope scope;
    struct hg_shared_scene *scene; // NULL: none open
    uint32_t first_id;
    bool attached;   // the worker knows it
    bool batch_open; // batch_begin was accepted
    struct hg_request *first, *last;
    struct hg_session_load load;
    struct hg_session_answers answers;
    struct hg_session_view *views;
    struct hg_upload *uploads[HG_SESSION_UPLOADS];
    struct hg_session_bytes bytes;
    struct hg_session_failed *failed; // NULL: none has
    struct hg_session_resume resume;
    struct hg_session_share share;
    struct hg_session_pace pace;
};

// A drain that an administrator has set.
struct hg_session_drain {
    uint64_t due_ns; // when the sessions end; 0 = none is set
    bool stay;       // the daemon does not end with them
    bool over;       // they have ended
};

// Uploads whose content is on its way to the disk (session_sync.h), oldest first.
struct hg_session_syncs {
    struct hg_session_sync *first, **last;
};

// Events from the thread of the upload store (session_upload.h).
struct hg_session_store_watch {
    struct hg_source source;
    uint64_t unwritten; // bytes of all uploads that wait for the disk
};

// All sessions and their scenes.
struct hg_session_table {
    const struct hg_loop *loop;
    const struct hg_options *options;
    struct hg_upload_store *store;
    const struct hg_conn_table *conns;
    struct hg_worker_pool *pool;
    struct hg_audit *audit;
    struct hg_quarantine *quarantine;
    struct hg_join_tickets *tickets;
    struct hg_block_list *blocks;
    struct hg_pixel_accounts pixels;
    uint32_t pixel_turn; // number of the session that was first to have some
    struct hg_session_drain drain;
    struct hg_scene_table scenes;
    struct hg_session *first;
    struct hg_session *buckets[HG_SESSION_BUCKETS]; // by number
    uint32_t count, last_number;
    uint64_t started_ns;
    bool ended;       // one without a client may have nothing left to wait for
    bool draining;    // nothing new is begun
    bool records_all; // the log is for an exec: sessions without a ticket belong into it, too
    struct hg_session_syncs syncs;
    struct hg_session_store_watch store_watch;
};

// The session of a number; NULL: there is none.
static inline struct hg_session *hg_session_find(
    const struct hg_session_table *table, uint32_t number)
{
    struct hg_session *it = table->buckets[number % HG_SESSION_BUCKETS];
    while (it && it->number != number)
        it = it->same_bucket;
    return it;
}

#endif
