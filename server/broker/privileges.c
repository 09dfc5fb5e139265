#include "server/broker/privileges.h"

#include <errno.h>
#include <grp.h>
#include <pwd.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

static const char usual_name[] = "heliod"; // of deploy/systemd/heliod.sysusers

enum hg_status hg_user_find(struct hg_user *user, const char *wanted, struct hg_error *err)
{
    const bool named = wanted && *wanted;
    const struct passwd *entry =
        named || geteuid() == 0 ? getpwnam(named ? wanted : usual_name) : NULL;
    *user = (struct hg_user){0};
    if (named && !entry)
        return hg_error_set(err, HG_E_NOTFOUND, "--user", NULL, "there is no user '%s'", wanted);
    if (geteuid() != 0)
        return !named || entry->pw_uid == geteuid()
                   ? HG_OK
                   : hg_error_set(err, HG_E_PERM, "--user", NULL,
                         "only a daemon that is started as root can become '%s'", wanted);
    if (!entry) {
        hg_warn(MAIN, "runs as root, and so do its workers; name a user (--user)");
        return HG_OK;
    }
    user->change = entry->pw_uid != 0;
    user->uid = entry->pw_uid;
    user->gid = entry->pw_gid;
    snprintf(user->name, sizeof user->name, "%s", entry->pw_name);
    return HG_OK;
}

void hg_user_own(const struct hg_user *user, const char *path)
{
    if (user->change && path && lchown(path, user->uid, user->gid) != 0 && errno != ENOENT)
        hg_warn(MAIN, "%s cannot be given to %s: %s", path, user->name, strerror(errno));
}

enum hg_status hg_user_become(const struct hg_user *user, struct hg_error *err)
{
    if (!user->change)
        return HG_OK;
    if (initgroups(user->name, user->gid) != 0 || setresgid(user->gid, user->gid, user->gid) != 0 ||
        setresuid(user->uid, user->uid, user->uid) != 0)
        return hg_error_set(
            err, HG_E_PERM, "--user", NULL, "cannot become %s: %s", user->name, strerror(errno));
    if (setresuid(0, 0, 0) == 0 || setresgid(0, 0, 0) == 0)
        return hg_error_set(err, HG_E_PERM, "--user", NULL, "root can be had again");
    hg_info(MAIN, "runs as %s", user->name);
    return HG_OK;
}
