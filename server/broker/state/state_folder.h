// state_folder.h - the folder of the state log: its lock, reading and replacing the log in it.
// Floor 6 (broker). Thread: any, one at a time.
#ifndef HG_BROKER_STATE_FOLDER_H
#define HG_BROKER_STATE_FOLDER_H

#include "base/status.h"

struct hg_state_folder {
    const char *path;
    int folder_fd, lock_fd; // -1 = closed
    int log_fd;             // at the end of the log
    uint64_t bytes;         // of the log
};

// Takes a record that was read; what it returns ends the reading.
typedef enum hg_status hg_state_take(void *user, const uint8_t *body, size_t size);

// Locks the folder (made, but not its parents), reads the log there and cuts a torn tail off. Where
// a damaged record is no tail the log is copied to state.log.damaged before.
// HG_E_BUSY: another process has it; HG_E_VERSION, HG_E_FORMAT: the log is of another version, or
// is none; HG_E_PERM, HG_E_NOSPACE, HG_E_IO, HG_E_NOMEM; what `take` returned. Closed on failure.
enum hg_status hg_state_folder_open(const char *path, hg_state_take *take, void *user,
    struct hg_state_folder *out, struct hg_error *err) HG_MUST_CHECK;
void hg_state_folder_close(struct hg_state_folder *folder);
// Begins a log beside the present one; HG_STATE_HEADER_BYTES are in it.
enum hg_status hg_state_folder_begin(struct hg_state_folder *folder, int *fd) HG_MUST_CHECK;
// Takes over the descriptor: syncs it and puts it in the present log's place. On failure the
// present log stays, unless only the folder could not be synced: log_fd is the new one then, and it
// is open which of both a crash leaves.
enum hg_status hg_state_folder_replace(
    struct hg_state_folder *folder, int fd, uint64_t bytes) HG_MUST_CHECK;
void hg_state_folder_abort(struct hg_state_folder *folder, int fd); // or gives it up; accepts -1

#endif
