// session.h - sessions: what a client may do, its batch, and messages that wait behind its task.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_SESSION_H
#define HG_SERVER_WORKER_SESSION_H

#include "base/bytes.h"
#include "server/worker/scene_slot.h"

struct view_slot;

// Sessions of one tenant share its turns, however many they are.
struct tenant {
    struct tenant *next;
    char name[129];
    uint32_t sessions;
    uint32_t weight; // its part of the turns
    struct turn turn;
    struct turn_clock clock; // of its sessions
    uint64_t usual_ns;       // that a step of its views takes
};

struct session {
    struct session *next;
    uint32_t channel;
    uint64_t number;
    enum hgp_role role;
    struct scene_slot *scene;
    uint32_t first_id, id_count;
    uint32_t batch_depth;
    bool restoring; // until replay_end
    struct tenant *tenant;
    struct hg_refbuf *roots; // text of session_tenant; NULL = all asset roots
    struct turn turn;
    struct turn_clock clock; // of its views
    struct view_slot *views;
    struct task *task;    // running; later messages wait in `waiting`
    uint64_t messages_ns; // that they took since one of its views had a turn
    struct command *waiting, **waiting_end;
    uint32_t waiting_count;
    uint64_t waiting_bytes; // of their payloads
    struct hg_writer file;  // of image_query, as far as its parts have come
    uint64_t file_bytes;    // of all of it, as its first part said; 0 = none has begun
};

struct session *hg_worker_session_find(struct render_state *s, uint32_t channel); // may be NULL
// HG_E_EXISTS: the channel has one; HG_E_NOMEM.
enum hg_status hg_worker_session_create(struct render_state *s, uint32_t channel,
    const struct hgp_session_attach *m, struct session **out, struct hg_error *err) HG_MUST_CHECK;
// After its views. A task that runs comes back later and finds no session.
void hg_worker_session_destroy(struct render_state *s, struct session *session);

// Makes a revision of an edit, unless a batch is open.
void hg_worker_session_edited(struct session *session);
// Commits the changes of the session's open batch as a revision, if there is one.
void hg_worker_session_close_batch(struct session *session);

// Its turns are those of this tenant from here on, the tenant has that weight, and its files lie
// under these roots. HG_E_NOMEM: all stays as it was.
enum hg_status hg_worker_session_set_tenant(struct render_state *s, struct session *session,
    const struct hgp_session_tenant *m) HG_MUST_CHECK;

// Keeps a message until its turn comes, and the running task has ended. HG_E_BUSY: too many wait;
// it stays the caller's.
enum hg_status hg_worker_session_hold(
    struct session *session, struct command *c, struct hg_error *err) HG_MUST_CHECK;
// Is one of them due? Not while a task runs.
bool hg_worker_session_is_waiting(const struct session *session);
// The oldest of them; NULL while a task runs, and when none waits.
struct command *hg_worker_session_resume(struct session *session);

#endif
