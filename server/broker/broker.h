// broker.h - the parts of heliod's loop and how they meet: connections, sessions, scenes, worker.
// Floor 6, private to server/broker. Everything runs on one thread and nothing blocks.
//
// A connection (conn.c) is a socket and its handshake. Once open it carries one session
// (session.c): rights, quotas, a scene, views, and the requests that the worker has not answered.
// A scene (scene.c) is shared by sessions and owns the journal from which a new worker gets it
// back. The link (worker_link.c) owns the worker process. recovery.c brings scenes and sessions
// into a worker, for the first time or after a death.
#ifndef HG_BROKER_BROKER_H
#define HG_BROKER_BROKER_H

#include <signal.h>
#include <sys/types.h>

#include "base/log.h"
#include "server/broker/auth.h"
#include "server/broker/listener.h"
#include "server/broker/loop.h"
#include "server/broker/options.h"
#include "server/broker/packet.h"
#include "server/broker/scene_journal.h"
#include "server/broker/upload_store.h"

enum {
    HG_SCENE_ID_RANGE = 1 << 20,  // object and asset ids of one session
    HG_SCENE_RANGES = 4095,       // sessions that one scene can have had
    HG_REPLAY_CHANNEL = 1u << 31, // | number of the scene
    HG_UPLOADS_AT_ONCE = 16,      // contents of one session that may alternate
    HG_REQUEST_TRIES = 2,         // deaths of the worker after which a request is given up
    HG_POISON_LIMIT = 3,          // given-up requests after which a session is closed
};

struct hg_broker;
struct hg_session;

// ---- connections --------------------------------------------------------------------------------

enum hg_conn_state {
    HG_CONN_PREFACE, // waiting for the 8 bytes
    HG_CONN_HELLO,
    HG_CONN_AUTH,
    HG_CONN_OPEN,
    HG_CONN_CLOSING, // only what is queued is still sent
    HG_CONN_DEAD,    // socket closed; freed at the end of the round
};

struct hg_conn {
    struct hg_conn *prev, *next;
    struct hg_broker *broker;
    struct hg_source source;
    struct hg_transport transport;
    struct hgp_framer in;
    struct hg_outq out;
    enum hg_conn_state state;
    bool paused, peer_ended;
    struct hg_peer peer;
    char client[129]; // from hello
    uint16_t version;
    uint64_t number;                          // of the session
    uint64_t deadline_ns;                     // handshake, or the end of CLOSING
    uint64_t opened_ns, received_ns, ping_ns; // ping_ns: newest ping sent, 0 = none pending
    double allowance;                         // messages that may be taken now
    uint64_t allowance_ns;
    struct hg_session *session;
};

void hg_conn_accept(struct hg_broker *b, struct hg_listener *listener);
void hg_conn_send(struct hg_conn *conn, uint32_t request, enum hgp_type type, const void *message);
// Takes over the reference.
void hg_conn_send_packet(struct hg_conn *conn, uint32_t request, struct hg_packet *packet);
// Answers `error`, or `notice` when no answer was wanted.
void hg_conn_fail(struct hg_conn *conn, uint32_t request, const struct hg_error *err);
// Error with request 0 (NULL: none), then bye, and the end once all is sent.
void hg_conn_close(struct hg_conn *conn, const struct hg_error *err, const char *reason);
void hg_conn_kill(struct hg_conn *conn, const char *reason); // at once
void hg_conn_update(struct hg_conn *conn);                   // which events are wanted
void hg_conn_resume(struct hg_conn *conn); // reads again when nothing stands against it
void hg_conn_check_time(struct hg_conn *conn, uint64_t now_ns);
void hg_conn_end_session(struct hg_conn *conn); // of a closing or dead connection
void hg_conn_destroy(struct hg_conn *conn);

// ---- scenes -------------------------------------------------------------------------------------

struct hg_shared_scene {
    struct hg_shared_scene *prev, *next;
    uint32_t number;
    char key[160];  // for the worker
    char name[129]; // empty: private
    struct hg_journal *journal;
    uint64_t revision;
    uint32_t sessions, ranges_used;
    bool in_worker;  // replayed; sessions are attached
    uint32_t deaths; // of the worker while this scene was replayed
};

// Finds or makes the scene; *existed. NULL: no memory.
struct hg_shared_scene *hg_shared_scene_join(
    struct hg_broker *b, struct hgp_str name, uint64_t session, bool *existed);
void hg_shared_scene_leave(struct hg_broker *b, struct hg_shared_scene *scene);

// ---- sessions -----------------------------------------------------------------------------------

// A message on its way to the worker that matters for the order of things. Most are answered;
// view_camera is not and leaves the list when it reaches the front.
struct hg_request {
    struct hg_request *prev, *next;
    uint32_t link_id;   // on the link; 0 = not sent yet, or never answered
    uint32_t client_id; // 0 = the client wants no answer
    struct hg_packet *packet;
    bool sent;
    uint8_t deaths; // of the worker while this was under way
};

struct hg_session_view {
    struct hg_session_view *next;
    uint32_t number;
    bool accepted;            // by the worker, at least once
    uint32_t width, height;   // as asked for; for the quota
    struct hg_packet *params; // accepted view_sets, merged; NULL before
    struct hg_packet *camera; // view_cameras, merged; NULL = none
    bool subscribed, resubscribe;
    uint32_t credit;  // frames that the client can take
    uint32_t granted; // of these, given to the worker
    uint64_t last_number, number_base;
};

struct hg_session {
    struct hg_session *prev, *next;
    struct hg_broker *broker;
    struct hg_conn *conn; // NULL: gone; waits until its edits are answered
    uint32_t number;
    enum hgp_role role;
    char name[129];
    struct hg_shared_scene *scene; // NULL: none open
    uint32_t first_id;
    bool attached;   // the worker knows it
    bool batch_open; // batch_begin was accepted
    struct hg_request *first, *last;
    uint32_t request_count, frame_count;
    uint64_t request_bytes;
    struct hg_session_view *views;
    struct hg_upload *uploads[HG_UPLOADS_AT_ONCE];
    uint64_t uploaded_bytes;
    uint64_t verified_bytes;       // of the file that the worker has for image_query
    uint8_t failed_hash[32];       // newest upload that failed; its other pieces may still come
    struct hg_error failed_upload; // and fail the same way
    uint32_t poisons;
};

struct hg_session *hg_session_create(struct hg_conn *conn, enum hgp_role role, const char *name);
// The connection is gone: ends the session, at once or when its edits are answered.
void hg_session_end(struct hg_session *session);
void hg_session_destroy(struct hg_session *session);
// A decoded message in its right state, direction and role. Does not take the packet.
void hg_session_message(
    struct hg_session *session, struct hg_packet *packet, const union hgp_any *message);
// A message of the worker on the session's channel.
void hg_session_answer(
    struct hg_session *session, struct hg_packet *packet, union hgp_any *message);
// Sends what may be sent: all requests in order, suspects of a death one at a time.
void hg_session_pump(struct hg_session *session);
// Output drained: gives the worker credit for more frames.
void hg_session_grant(struct hg_session *session);
// The session must not be read while it has too much under way.
bool hg_session_is_full(const struct hg_session *session);
// Answers everything under way with `err` and forgets it.
void hg_session_fail_all(struct hg_session *session, const struct hg_error *err);
void hg_session_drop_request(struct hg_session *session, struct hg_request *request);
struct hg_session *hg_session_find(struct hg_broker *b, uint32_t number);
uint64_t hg_session_pixels(const struct hg_session *session);

// session_view.c: what the broker keeps of views.
struct hg_session_view *hg_session_view_find(struct hg_session *session, uint32_t number);
// Quotas of view_set; makes the record. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_session_view_ask(
    struct hg_session *session, const struct hgp_view_set *m, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_session_view_merge(struct hg_packet **into, struct hg_packet *from) HG_MUST_CHECK;
void hg_session_view_reset(struct hg_session_view *view); // as if the worker had never taken it
void hg_session_view_remove(struct hg_session *session, struct hg_session_view *view);
uint32_t hg_session_view_take_window(
    const struct hg_session *session, struct hg_session_view *view);
void hg_session_view_grant(struct hg_session *session, struct hg_session_view *view);

// session_upload.c
void hg_session_upload(struct hg_session *session, uint32_t request, const struct hgp_upload *m);
void hg_session_upload_query(
    struct hg_session *session, uint32_t request, const struct hgp_upload_query *m);
void hg_session_abort_uploads(struct hg_session *session);
// A file that comes in parts begins: it counts as an upload, and with those of all sessions as much
// as the store may hold, before any of it goes to the worker. HG_E_LIMIT; HG_E_INVAL: another size
// than it began with, or a part that reaches beyond it.
enum hg_status hg_session_verify(struct hg_session *session, const struct hgp_image_query *m,
    struct hg_error *err) HG_MUST_CHECK;
// The worker has told of it, or refused a part, or has died (of which NULL), and keeps nothing.
void hg_session_verified(struct hg_session *session, const struct hg_request *request);

// session_list.c: the answer to sessions_query.
void hg_session_list(struct hg_session *asker, uint32_t request);

// ---- worker -------------------------------------------------------------------------------------

enum hg_link_state {
    HG_LINK_DOWN,     // until restart_ns
    HG_LINK_STARTING, // until worker_ready
    HG_LINK_UP,
};

enum { HG_DEATHS_KEPT = 64 };

struct hg_link {
    struct hg_source source;
    struct hg_transport transport;
    struct hgp_framer in;
    struct hg_outq out;
    enum hg_link_state state;
    pid_t pid; // 0 = none
    uint64_t restart_ns, started_ns, pulse_ns, busy_ns, rss_bytes;
    uint64_t death_ns[HG_DEATHS_KEPT]; // ring
    uint32_t deaths;
    uint32_t last_id;
    char *device;         // JSON from worker_ready
    char last_words[400]; // why the worker says it ends; "" = it says nothing
    bool no_spill;        // the disk failed a worker: later ones keep large arrays in memory
    bool broken;          // could not queue a message: replaced at the end of the round
    bool pump;            // sessions may have something to send
    // Recovery:
    struct hg_shared_scene *replaying;
    uint32_t replay_waiting, replay_failed; // answers still to come; refused edits
    uint64_t replay_start_ns;
    struct hg_session *suspect_session; // whose suspect request runs alone; NULL = none
    uint32_t suspect_id;
    uint64_t suspect_ns;
};

void hg_link_start(struct hg_broker *b);
void hg_link_check_time(struct hg_broker *b, uint64_t now_ns);
void hg_link_reap(struct hg_broker *b); // SIGCHLD
void hg_link_stop(struct hg_broker *b); // at the end: kills and frees
void hg_link_update(struct hg_broker *b);
uint32_t hg_link_next_id(struct hg_broker *b);
// Takes over the reference. Without memory the worker is replaced.
void hg_link_send_packet(
    struct hg_broker *b, uint32_t channel, uint32_t id, struct hg_packet *packet);
void hg_link_send(
    struct hg_broker *b, uint32_t channel, uint32_t id, enum hgp_type type, const void *message);
void hg_link_fail(struct hg_broker *b, const char *reason); // kill and replace

// recovery.c
void hg_recovery_continue(struct hg_broker *b); // the next scene, waiting requests
void hg_recovery_worker_died(struct hg_broker *b);
void hg_recovery_attach(struct hg_session *session); // the scene is in the worker
void hg_recovery_answer(struct hg_broker *b, struct hg_packet *packet, const union hgp_any *m);
void hg_recovery_scene_gone(struct hg_broker *b, struct hg_shared_scene *scene);
void hg_recovery_request_done(struct hg_broker *b, const struct hg_request *request);

// ---- the daemon ---------------------------------------------------------------------------------

struct hg_broker {
    struct hg_loop loop;
    struct hg_options options;
    int argc;
    char *const *argv; // for reloads
    struct hg_tokens tokens;
    struct hg_guard guard;
    struct hg_upload_store *store;
    struct hg_listener *listeners;
    struct hg_source signals;
    struct hg_conn *conns, *dead;
    uint32_t conn_count, session_count, paused_count;
    struct hg_session *sessions;
    struct hg_shared_scene *scenes;
    uint32_t last_session, last_scene;
    struct hg_link link;
    uint64_t tick_ns, watchdog_ns, watchdog_sent_ns, accept_pause_ns, started_ns;
    double log_allowance; // for records that peers can cause
    uint64_t log_allowance_ns, log_dropped;
    bool closing; // a connection began to close: its session ends with the round
    bool draining;
    uint64_t drain_deadline_ns;
};

// Runs until drained; returns the exit code. Options are taken over.
int hg_broker_run(struct hg_options *options, int argc, char *const *argv);
// Checks what --check-config checks: addresses, tokens, their combination.
enum hg_status hg_broker_check(
    const struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;
// Path of the worker's program; false when there is none.
bool hg_broker_worker_path(const struct hg_options *options, char *path, size_t size);

// For records that peers can cause at will: false when there were too many.
bool hg_broker_may_log(struct hg_broker *b);
#define hg_peer_log(b, scope, ...)                                                                 \
    do {                                                                                           \
        if (hg_broker_may_log(b))                                                                  \
            hg_log_write(HG_LOG_WARN, HG_LOG_##scope, HG_OK, 0, __VA_ARGS__);                      \
    } while (0)

// Doubly linked lists whose head is `*head`.
#define HG_LIST_ADD(head, item)                                                                    \
    do {                                                                                           \
        (item)->prev = NULL;                                                                       \
        (item)->next = (head);                                                                     \
        if (head)                                                                                  \
            (head)->prev = (item);                                                                 \
        (head) = (item);                                                                           \
    } while (0)
#define HG_LIST_REMOVE(head, item)                                                                 \
    do {                                                                                           \
        if ((item)->prev)                                                                          \
            (item)->prev->next = (item)->next;                                                     \
        else                                                                                       \
            (head) = (item)->next;                                                                 \
        if ((item)->next)                                                                          \
            (item)->next->prev = (item)->prev;                                                     \
        (item)->prev = (item)->next = NULL;                                                        \
    } while (0)

#endif
