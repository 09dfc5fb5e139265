// audit.h - the audit log: who did what, when, from where, with what result; one JSON object a
// line. Floor 6 (broker). Thread: the loop.
//
// {"time":"2026-01-31T12:00:00.000Z","event":"login","session":7,"name":"anna","tenant":"anna",
//  "role":"VIEW","peer":"10.0.0.1","client":"helio/1","result":"ok","detail":"..."}
// Events: start, reload, stop, login, logout, revoke, scene_open, asset_load, environment_set,
// upload, sessions_query, refuse (a message that the session has no right to). `result` is ok or
// the name of an error. A line is one write to a file that is opened for appending; the file is
// renamed to FILE.1 (FILE.1 to FILE.2 ...) when it has reached its size. What cannot be written is
// counted, and said in the log.
#ifndef HG_BROKER_AUDIT_H
#define HG_BROKER_AUDIT_H

#include <stdbool.h>

#include "base/status.h"

struct hg_audit {
    const char *path; // NULL: nothing is written
    uint64_t limit_bytes, bytes, lost;
    uint32_t keep; // files besides the present one
    int fd;
    bool unsynced;
};

// Who did it; members may be NULL or 0.
struct hg_audit_actor {
    uint64_t session;
    const char *name, *tenant, *role, *peer, *client;
};

// HG_E_PERM, HG_E_IO: err->what is the path. Without a path nothing is opened.
enum hg_status hg_audit_open(
    struct hg_audit *audit, const char *path, struct hg_error *err) HG_MUST_CHECK;
void hg_audit_set_limits(struct hg_audit *audit, uint64_t limit_bytes, uint32_t keep);
void hg_audit_write(struct hg_audit *audit, const char *event, const struct hg_audit_actor *actor,
    enum hg_status result, const char *detail);
int hg_audit_dup(
    struct hg_audit *audit); // to be synced; -1: nothing was written since the last time
void hg_audit_close(struct hg_audit *audit); // accepts a closed one

#endif
