// privileges.h - what the daemon gives up once it listens.
// Floor 6 (broker). Thread: the only one.
#ifndef HG_BROKER_PRIVILEGES_H
#define HG_BROKER_PRIVILEGES_H

#include <stdbool.h>
#include <sys/types.h>

#include "base/status.h"

struct hg_user {
    bool change; // the daemon was started as root and becomes this user
    uid_t uid;
    gid_t gid;
    char name[64];
};

// Started as root: the user that was named, else `heliod` where there is such a user, else none
// (with a warning). Not started as root: no other user than its own. HG_E_NOTFOUND, HG_E_PERM.
enum hg_status hg_user_find(
    struct hg_user *user, const char *wanted, struct hg_error *err) HG_MUST_CHECK;
// Makes the file or folder that user's, so that it can be written afterwards. What is not there is
// left out.
void hg_user_own(const struct hg_user *user, const char *path);
// Becomes the user, with its groups and no way back. HG_E_PERM.
enum hg_status hg_user_become(const struct hg_user *user, struct hg_error *err) HG_MUST_CHECK;

#endif
