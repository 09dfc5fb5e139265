// queue.h - bounded queue of pointers between threads, with an eventfd for poll loops.
// Floor 0. Thread-safe. The two ends are the only way threads of a process meet.
#ifndef HG_BASE_QUEUE_H
#define HG_BASE_QUEUE_H

#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

struct hg_queue {
    pthread_mutex_t lock;
    pthread_cond_t not_empty;
    void **items;
    size_t capacity, head, count;
    int event_fd; // readable while the queue holds items
    bool closed;
};
// Room for `capacity` items (pointers). HG_E_NOMEM; HG_E_LIMIT: no descriptor is left.
enum hg_status hg_queue_init(struct hg_queue *q, size_t capacity) HG_MUST_CHECK;
// HG_E_AGAIN when full, HG_E_CLOSED after hg_queue_close. Never blocks.
enum hg_status hg_queue_push(struct hg_queue *q, void *item) HG_MUST_CHECK;
// Oldest item, or NULL at once when empty.
void *hg_queue_try_pop(struct hg_queue *q);
// Waits up to timeout_ns (UINT64_MAX = for ever); NULL on timeout or when closed and empty.
void *hg_queue_pop(struct hg_queue *q, uint64_t timeout_ns);
// No more pushes; waiters wake.
void hg_queue_close(struct hg_queue *q);
// Items still inside are the caller's; pop them first. Accepts a zeroed queue.
void hg_queue_finish(struct hg_queue *q);

#endif
