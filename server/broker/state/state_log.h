// state_log.h - the state log: a write-ahead log in a folder, synced in groups by a thread.
// Floor 6 (broker). Thread: the loop; a thread of its own writes and syncs, so that the loop never
// waits for the disk.
//
// Every record has a position, from 1 on. A record is durable once hg_state_log_reached() is not
// below its position: answers that must not come before wait for that (hg_outq_hold,
// hg_outq_hold_kept). All records that wait while a sync runs are written and synced together.
//
// When the log has grown to twice what it was after the last rewrite (and HG_STATE_LOG_SLACK), a
// snapshot of the state is written beside it, what was appended meanwhile is copied behind that,
// and the new file takes the old one's name. After an error of the disk the old file is not trusted
// any more and the log is broken, until such a rewrite has succeeded, which is tried every second.
#ifndef HG_BROKER_STATE_LOG_H
#define HG_BROKER_STATE_LOG_H

#include "server/broker/connection/packet.h"
#include "server/broker/state/state_folder.h"

enum { HG_STATE_LOG_SLACK = 4 << 20, HG_STATE_LOG_BACKLOG = 64 << 20 };

struct hg_state_log;

struct hg_state_log_options {
    const char *folder;
    bool wait_for_sync;        // durable = synced to the disk; else: written to the file
    bool go_on;                // while the log is broken everything counts as durable
    bool is_known;             // the state is known, from elsewhere: a snapshot is wanted at once
    uint64_t sync_interval_ns; // between syncs where nothing waits for them
};

// Opens the folder as hg_state_folder_open does, and is ready to append.
enum hg_status hg_state_log_open(const struct hg_state_log_options *options, hg_state_take *take,
    void *user, struct hg_state_log **out, struct hg_error *err) HG_MUST_CHECK;
// Writes and syncs what waits, unless the log is broken. Accepts NULL.
void hg_state_log_close(struct hg_state_log *log);

// Appends a record whose body is `head` (is finished; may have failed) and the payload of `packet`
// (may be NULL; a reference is kept). Returns its position. Without memory the log is broken. A
// NULL log takes nothing and returns 0.
uint64_t hg_state_log_append(
    struct hg_state_log *log, struct hg_writer *head, struct hg_packet *packet);
// What became of files that are synced. hg_state_log_poll writes it.
struct hg_state_sync {
    uint32_t left;         // that are under way: the log has this address
    enum hg_status status; // the first error
};

// A file (or folder) is synced before what is appended from now on is durable. Takes over the
// descriptor, which may be -1. `sync` may be NULL: errors are logged only.
void hg_state_log_sync_file(struct hg_state_log *log, int fd, struct hg_state_sync *sync);
uint64_t hg_state_log_position(const struct hg_state_log *log); // of the newest; accepts NULL
// The address is valid as long as the log.
const struct hg_outq_reached *hg_state_log_reached(const struct hg_state_log *log);
// HG_OK, or why nothing may be accepted now: the log is broken, and is not to go on without.
// HG_E_NOSPACE, HG_E_IO, HG_E_NOMEM.
enum hg_status hg_state_log_refusal(const struct hg_state_log *log);
// Nothing that is accepted is durable, whether it is refused (above) or the daemon goes on. Accepts
// NULL.
bool hg_state_log_is_broken(const struct hg_state_log *log);
// So much waits to be written that nothing more should come.
bool hg_state_log_is_behind(const struct hg_state_log *log);

// ---- over an exec -------------------------------------------------------------------------------

// A log that only keeps its records, without a folder. NULL: no memory.
struct hg_state_log *hg_state_log_create_memory(void) HG_MUST_CHECK;
// Writes them, in the format of a log. HG_E_NOMEM (one is missing), HG_E_LIMIT (one is too
// large to be read again), HG_E_NOSPACE, HG_E_IO.
enum hg_status hg_state_log_write_memory(struct hg_state_log *log, int fd) HG_MUST_CHECK;

// ---- for the one who runs the loop --------------------------------------------------------------

int hg_state_log_fd(const struct hg_state_log *log); // readable: call hg_state_log_poll
// Takes note of what the thread has done. True: *hg_state_log_reached() has changed.
bool hg_state_log_poll(struct hg_state_log *log);
// The log is long, or broken: time for a snapshot.
bool hg_state_log_wants_snapshot(const struct hg_state_log *log, uint64_t now_ns);
// Between these two, records that are appended make up the snapshot: all of the present state.
void hg_state_log_begin_snapshot(struct hg_state_log *log, uint64_t now_ns);
void hg_state_log_end_snapshot(struct hg_state_log *log);

#endif
