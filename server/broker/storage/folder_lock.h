// folder_lock.h - a folder that one daemon has for itself, as long as it runs.
// Floor 6 (broker). Thread: any, one at a time.
#ifndef HG_BROKER_FOLDER_LOCK_H
#define HG_BROKER_FOLDER_LOCK_H

#include <stdbool.h>

#include "base/status.h"

// `folder`/`name`, freed with hg_free. NULL: no memory.
char *hg_folder_path(const char *folder, const char *name);
// Makes the folder and those above it that are not there. HG_E_PERM, HG_E_NOSPACE, HG_E_IO,
// HG_E_NOMEM.
enum hg_status hg_folder_make(const char *path, struct hg_error *err) HG_MUST_CHECK;
// Locks `path`/lock (flock), which names the process from now on; *fd, which the caller closes, is
// the lock. `option` is the one that names the folder, in errors. `patient`: waits a second for
// a process that has just ended. HG_E_BUSY: another process has it, the error says which;
// HG_E_PERM, HG_E_NOSPACE, HG_E_IO.
enum hg_status hg_folder_lock(const char *path, const char *option, bool patient, int *fd,
    struct hg_error *err) HG_MUST_CHECK;

#endif
