#include "server/worker/worker.h"

#include "base/alloc.h"
#include "base/log.h"

enum { INBOX_ITEMS = 4096, OUTBOX_ITEMS = 1024 };

enum hg_status hg_worker_init(struct worker *w)
{
    hg_watch_init(&w->watch);
    enum hg_status status = hg_queue_init(&w->inbox, INBOX_ITEMS);
    return status ? status : hg_queue_init(&w->outbox, OUTBOX_ITEMS);
}

void hg_worker_finish(struct worker *w)
{
    struct hg_refbuf *buf;
    struct command *c;
    while (w->outbox.items && (buf = hg_queue_try_pop(&w->outbox)))
        hg_refbuf_unref(buf);
    while (w->inbox.items && (c = hg_queue_try_pop(&w->inbox)))
        hg_worker_free_command(w, c);
    hg_queue_finish(&w->inbox);
    hg_queue_finish(&w->outbox);
    hg_watch_finish(&w->watch);
}

void hg_worker_wake(struct worker *w)
{
    if (atomic_exchange(&w->wake_queued, true))
        return;
    // An inbox that is full or closed belongs to a thread that is awake or gone.
    if (hg_queue_push(&w->inbox, &w->wake))
        atomic_store(&w->wake_queued, false);
}

void hg_worker_free_command(struct worker *w, struct command *c)
{
    if (c == &w->wake) {
        atomic_store(&w->wake_queued, false);
        return;
    }
    hg_refbuf_unref(c->payload);
    hg_free(c);
}

void hg_worker_lose_device(struct worker *w, const struct hg_error *err)
{
    hg_fault(WORKER, HG_E_DEVICE_LOST, "%s: %s", err->what, err->reason);
    atomic_store(&w->device_lost, true);
}
