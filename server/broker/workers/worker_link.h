// worker_link.h - a worker process and the link to it: start, watch, talk, replace.
// Floor 6 (broker). Thread: the loop. What the worker says about sessions is for the layer above
// (hg_link_events).
#ifndef HG_BROKER_WORKER_LINK_H
#define HG_BROKER_WORKER_LINK_H

#include <sys/types.h>

#include "server/broker/loop.h"
#include "server/broker/options.h"
#include "server/broker/connection/packet.h"
#include "server/broker/workers/quarantine.h"
#include "server/broker/workers/launcher.h"
#include "server/broker/workers/worker_share.h"

enum {
    HG_LINK_DEATHS_KEPT = 64,
    HG_LINK_AHEAD =
        256 << 10, // bytes that may wait in its queue before sessions wait for their turn
};

struct hg_link;
struct hg_session;
struct hg_shared_scene;

enum hg_link_state {
    HG_LINK_DOWN,     // until restart_ns
    HG_LINK_STARTING, // until worker_ready
    HG_LINK_UP,
};

// What the layer above does.
struct hg_link_events {
    void (*ready)(struct hg_link *link);
    // Everything that was under way is lost; another worker will come, unless too many have died.
    void (*died)(struct hg_link *link);
    // A message on a channel other than 0. Does not take ownership of the packet; `m` is its
    // content.
    void (*message)(struct hg_link *link, struct hg_packet *packet, union hgp_any *m);
};

// A scene that is being built again in the worker. Of the layer above.
struct hg_link_replay {
    struct hg_shared_scene *scene; // NULL: none
    uint32_t waiting, failed;      // answers still to come; refused edits
    uint64_t start_ns;
};

// What was under way when the session that asked for it ended.
enum { HG_LINK_LEFT = 64 };
struct hg_link_left {
    struct hg_quarantine_entry files[HG_LINK_LEFT]; // ring
    uint32_t count;
};

// What may have killed a worker is tried again, one thing at a time and with nothing beside it. Of
// the layer above.
struct hg_link_trial {
    struct hg_session *session; // whose; NULL: nothing is tried at this moment
    uint32_t id;                // of the request; 0: the subscription of a view
    uint32_t view;
    uint64_t sent_ns, patience_ns; // after which it is taken for harmless
    uint32_t waiting;              // suspects, that one included
    bool accused; // the worker said what it hung in: nothing else is suspect of its death
    struct hg_link_left left;
};

// What sessions send to the worker. Of the layer above.
struct hg_link_feed {
    bool pump;             // sessions may have something to send
    bool rebuild;          // scenes may have to be replayed
    bool rebuild_goes_on;  // in the next round, which is to come at once
    bool starved;          // and had more than there was room for
    uint32_t turn;         // number of the session that had the newest turn
    uint64_t unsent_bytes; // that sessions keep until there is room
};

// What the worker says that it has been at for longest.
struct hg_link_hang {
    uint64_t busy_ns; // how long, with the newest pulse
    uint32_t channel, request, view;
    bool named; // channel, request and view are known
    bool fatal; // it was ended for that
};

// Whom it works for. Of the pool.
struct hg_link_owner {
    char tenant[129]; // "" = none yet
    bool wanted;      // a process is kept running
    uint32_t scene_count;
    uint64_t idle_ns; // since when there is no scene in it
    struct hg_home home;
    struct hg_launcher *launcher;
    const struct hg_machine *machine; // of which it has a share; NULL: no limits
    uint32_t weight;                  // its tenant's
    struct hg_worker_share share;     // as it was put into effect
};

// How the worker ends.
struct hg_link_farewell {
    char words[400]; // why it says that it does; "" = it says nothing
    pid_t pid;       // it closed its link and is to be reaped, or the other way round; 0 = none
};

struct hg_link {
    struct hg_loop *loop;
    const struct hg_options *options;
    const struct hg_link_events *events;
    void *owner; // for `events`
    struct hg_source source;
    struct hg_transport transport;
    struct hgp_framer in;
    struct hg_outq out;
    enum hg_link_state state;
    pid_t pid; // 0 = none
    uint64_t restart_ns, started_ns, rss_bytes;
    uint64_t pulse_ns; // of hg_loop_awake_ns
    struct hg_link_hang hang;
    uint64_t death_ns[HG_LINK_DEATHS_KEPT]; // ring
    uint32_t deaths;
    uint32_t last_id;
    struct hg_link_owner whose;
    struct hg_link_farewell farewell;
    bool no_spill;        // the disk failed a worker: later ones keep large arrays in memory
    bool broken;          // could not queue a message: replaced at the end of the round
    struct hg_link_feed feed;
    struct hg_link_replay replay;
    struct hg_link_trial trial;
};

void hg_link_start(struct hg_link *link);
// A process that runs already, at the other end of `fd`; `input`: what has come of its stream.
// HG_E_FORMAT, HG_E_NOMEM: the descriptor is closed.
enum hg_status hg_link_adopt(
    struct hg_link *link, int fd, pid_t pid, struct hg_reader *input) HG_MUST_CHECK;
void hg_link_stop(struct hg_link *link);                     // at the end: kills and frees
void hg_link_end(struct hg_link *link);                      // kills it; reaped on SIGCHLD
void hg_link_fail(struct hg_link *link, const char *reason); // kill and replace
void hg_link_check_time(struct hg_link *link);
// Its process, or the one before that closed its link, has been reaped.
void hg_link_exited(struct hg_link *link, pid_t pid, int status);
uint32_t hg_link_recent_deaths(const struct hg_link *link); // within the last minute
uint32_t hg_link_next_id(struct hg_link *link);
bool hg_link_has_room(const struct hg_link *link); // for what sessions send
// Takes over the reference. Without memory the worker is replaced.
void hg_link_send_packet(
    struct hg_link *link, uint32_t channel, uint32_t id, struct hg_packet *packet);
void hg_link_send(
    struct hg_link *link, uint32_t channel, uint32_t id, enum hgp_type type, const void *message);

#endif
