// scene.h - scenes by name, shared by sessions, for as long as one holds them.
// Floor 6 (broker). Thread: the loop. A scene owns the journal from which a new worker gets it
// back.
#ifndef HG_BROKER_SCENE_H
#define HG_BROKER_SCENE_H

#include "server/broker/session/annotation.h"
#include "server/broker/scene/scene_journal.h"
#include "server/broker/state/state_record.h"
#include "server/broker/workers/worker_pool.h"

#define HG_SCENE_REPLAY_CHANNEL (UINT32_C(1) << 31) // | number of the scene

enum {
    HG_SCENE_ID_RANGE = 1 << 20, // object and asset ids of one session
    HG_SCENE_RANGES = 4032,      // in a scene at a time
};

// The camera that the views of several sessions have.
struct hg_scene_camera {
    uint32_t holder;               // number of the session that moves it; 0 = none
    bool locked;                   // only administrators change that
    bool due;                      // state: to tell those that watch
    bool pose_due;                 // pose: likewise
    enum hgp_camera_change change; // why the holder is the holder
    uint64_t since_ns;             // the holder has it
    uint64_t moved_ns;             // the holder moved it last
    uint64_t sent_ns;              // the pose was sent to watchers last
    uint32_t mover;                // number of the session that made the pose
    struct hg_packet *pose;        // view_camera with all fields that count; NULL: never moved
};

// What the sessions of a scene know of each other.
struct hg_scene_people {
    struct hg_session *first; // its sessions, those that came last first (session_share.h)
    struct hg_scene_camera camera;
    uint64_t edits;        // accepted, since the start of the daemon
    bool participants_due; // to tell those that watch
    struct hg_annotations annotations;
};

struct hg_shared_scene {
    struct hg_shared_scene *prev, *next;
    uint32_t number;
    char key[160];  // for the worker
    char name[129]; // empty: private
    char tenant[129];
    struct hg_journal *journal;
    struct hg_link *link; // to its worker
    uint64_t revision;
    uint32_t sessions;
    uint64_t ranges[HG_SCENE_RANGES / 64]; // bit: the range of ids belongs to a session, or objects
                                           // have ids of it
    bool in_worker;                        // replayed; sessions are attached
    bool on_channel;        // its replay channel is attached: the worker keeps it without sessions
    uint32_t deaths;        // of the worker while this scene was replayed
    uint64_t logged;        // position in the state log of its making
    uint64_t kept_until_ns; // the daemon holds it, as a session does, until then; 0 = it does not
    struct hg_scene_people people;
};

struct hg_scene_table {
    struct hg_worker_pool *pool;
    struct hg_upload_store *store;
    struct hg_state_log *log; // NULL: scenes end with the daemon
    struct hg_shared_scene *first;
    uint32_t last_number;
    bool ending; // the daemon ends: scenes stay in the log
};

// Which scene a session asks for.
struct hg_scene_wish {
    const char *tenant;
    struct hgp_str name; // empty: one of its own
    uint64_t session;
    uint32_t weight; // of the tenant; 0 = the usual one
};

// Finds or makes a scene of the tenant (of all tenants, where they share workers); *existed.
// HG_E_LIMIT: no worker is left for the tenant. HG_E_NOMEM.
enum hg_status hg_shared_scene_join(struct hg_scene_table *table, const struct hg_scene_wish *wish,
    struct hg_shared_scene **out, bool *existed, struct hg_error *err) HG_MUST_CHECK;
// NULL: none of this name is open.
struct hg_shared_scene *hg_shared_scene_find(
    struct hg_scene_table *table, const char *tenant, struct hgp_str name);
// A scene of the state log, without a worker, held by the daemon.
// NULL: no memory, or there is one of this number.
struct hg_shared_scene *hg_shared_scene_restore(
    struct hg_scene_table *table, const struct hg_state_scene *like) HG_MUST_CHECK;
// NULL: none.
struct hg_shared_scene *hg_shared_scene_by_number(struct hg_scene_table *table, uint32_t number);
// Gives a restored scene a worker; the daemon holds it until then (0: no longer). False: no worker
// is left for its tenant.
bool hg_shared_scene_place(
    struct hg_scene_table *table, struct hg_shared_scene *scene, uint64_t until_ns);
// A restored scene that is in a worker already goes on there as it was.
struct hg_scene_place {
    struct hg_link *link;
    bool in_worker, on_channel;
    uint64_t revision, kept_until_ns;
};
void hg_shared_scene_settle(struct hg_shared_scene *scene, const struct hg_scene_place *place);
// Attached sessions keep it in the worker from here on.
void hg_shared_scene_leave_channel(struct hg_shared_scene *scene);
void hg_shared_scene_check_times(struct hg_scene_table *table, uint64_t now_ns);
void hg_shared_scene_drop(struct hg_scene_table *table, struct hg_shared_scene *scene);
void hg_shared_scene_leave(struct hg_scene_table *table, struct hg_shared_scene *scene);
// A range of ids for a session: the first of HG_SCENE_ID_RANGE. 0: none is left.
uint32_t hg_shared_scene_claim_ids(struct hg_shared_scene *scene);
// The session has ended: its range is free again, unless objects have ids of it.
void hg_shared_scene_release_ids(struct hg_shared_scene *scene, uint32_t first_id);
// On which it is replayed.
uint32_t hg_shared_scene_channel(const struct hg_shared_scene *scene);

#endif
