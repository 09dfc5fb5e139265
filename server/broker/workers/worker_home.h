// worker_home.h - the folders of a worker: what it alone may write, what of its tenant's it may
// read. Floor 6 (broker). Thread: the loop.
//
//   CACHE/workers/N/          home of the worker in place N; it may read it
//         cache/              and write this: `store` (baked data), `shaders` (compiled ones)
//         given/uploads/      contents of its tenant: links to files of the upload store
//         owner               whose it is, for a later run of the daemon
//   CACHE/tenants/KEY/store   baked data of a tenant that has no worker
//   CACHE/uploads/KEY/        contents of a tenant that has no worker (upload_store.h)
//   CACHE/discarded/          what is removed (disk_watch.h)
//   CACHE/seed/shaders        compiled before any tenant's file was read; workers copy it
//
// KEY is the hash of the tenant's name. A spare has a home before it has a tenant: giving it to one
// moves the tenant's folders in, by name, so that all rules that hold for the home hold for them.
// Compiled shaders are code: they stay in a home and go with it.
#ifndef HG_BROKER_WORKER_HOME_H
#define HG_BROKER_WORKER_HOME_H

#include <stdbool.h>

#include "server/broker/storage/disk_watch.h"
#include "server/broker/storage/upload_store.h"

enum { HG_HOME_KEY = 33, HG_HOME_PATH = 4096 };

struct hg_homes {
    const char *cache_dir; // of the daemon
    struct hg_upload_store *store;
    struct hg_disk_watch *watch; // NULL: what is discarded is there until the next run
};

struct hg_home {
    const struct hg_homes *homes; // NULL: workers share the cache folder
    uint32_t number;
    char key[HG_HOME_KEY]; // of its tenant; "" = none yet
};

// What an earlier run left in homes goes back to its tenants; homes are removed. Before the store
// is made, which looks at uploads. Not where workers are taken over: they are in their homes.
enum hg_status hg_homes_recover(const char *cache_dir, struct hg_error *err) HG_MUST_CHECK;

// Makes the folders, before a worker starts. A home without a tenant is emptied first: nothing of
// the process before it is left. HG_E_PERM, HG_E_NOSPACE, HG_E_IO, HG_E_LIMIT (a name is too long).
enum hg_status hg_home_make(struct hg_home *home, struct hg_error *err) HG_MUST_CHECK;
// From now on it is the tenant's, with what that has. HG_E_NOMEM; HG_E_PERM, HG_E_NOSPACE, HG_E_IO:
// the worker has to do without (it bakes again).
enum hg_status hg_home_give(
    struct hg_home *home, const char *tenant, struct hg_error *err) HG_MUST_CHECK;
// The worker of that tenant is taken over, and goes on with what it has. HG_E_NOMEM, HG_E_IO: what
// the tenant has sent is not known any more.
enum hg_status hg_home_resume(
    struct hg_home *home, const char *tenant, struct hg_error *err) HG_MUST_CHECK;
// Removes all that the worker, which is gone, has written; the tenant's next worker gets an empty
// folder.
void hg_home_empty(struct hg_home *home);
// The worker is gone: what is the tenant's goes back, the rest is removed.
void hg_home_leave(struct hg_home *home);

// Paths below the home, for the worker's arguments. False: too long.
bool hg_home_path(
    const struct hg_home *home, const char *name, char *out, size_t size) HG_MUST_CHECK;

#endif
