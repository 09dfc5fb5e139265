#include "base/queue.h"

#include <errno.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "base/alloc.h"

enum hg_status hg_queue_init(struct hg_queue *q, size_t capacity)
{
    *q = (struct hg_queue){.event_fd = -1, .capacity = capacity};
    q->items = hg_calloc(capacity, sizeof *q->items);
    if (!q->items)
        return HG_E_NOMEM;
    q->event_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC | EFD_SEMAPHORE);
    if (q->event_fd < 0) {
        hg_free(q->items);
        q->items = NULL;
        return HG_E_LIMIT;
    }
    pthread_condattr_t attr;
    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_mutex_init(&q->lock, NULL);
    pthread_cond_init(&q->not_empty, &attr);
    pthread_condattr_destroy(&attr);
    return HG_OK;
}

// Called with the lock held; the event counter mirrors `count`.
static void *take(struct hg_queue *q)
{
    if (q->count == 0)
        return NULL;
    void *item = q->items[q->head];
    q->head = (q->head + 1) % q->capacity;
    q->count--;
    eventfd_t one;
    eventfd_read(q->event_fd, &one);
    return item;
}

static void put(struct hg_queue *q, void *item)
{
    q->items[(q->head + q->count) % q->capacity] = item;
    q->count++;
    eventfd_write(q->event_fd, 1);
    pthread_cond_signal(&q->not_empty);
}

enum hg_status hg_queue_push(struct hg_queue *q, void *item)
{
    pthread_mutex_lock(&q->lock);
    enum hg_status status = q->closed ? HG_E_CLOSED : q->count == q->capacity ? HG_E_AGAIN : HG_OK;
    if (!status)
        put(q, item);
    pthread_mutex_unlock(&q->lock);
    return status;
}

enum hg_status hg_queue_push_newest(struct hg_queue *q, void *item, void **dropped)
{
    *dropped = NULL;
    pthread_mutex_lock(&q->lock);
    enum hg_status status = q->closed ? HG_E_CLOSED : HG_OK;
    if (!status) {
        if (q->count == q->capacity)
            *dropped = take(q);
        put(q, item);
    }
    pthread_mutex_unlock(&q->lock);
    return status;
}

void *hg_queue_try_pop(struct hg_queue *q)
{
    pthread_mutex_lock(&q->lock);
    void *item = take(q);
    pthread_mutex_unlock(&q->lock);
    return item;
}

void *hg_queue_pop(struct hg_queue *q, uint64_t timeout_ns)
{
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    if (timeout_ns != UINT64_MAX) {
        uint64_t ns = (uint64_t)until.tv_nsec + timeout_ns % 1000000000u;
        until.tv_sec += (time_t)(timeout_ns / 1000000000u + ns / 1000000000u);
        until.tv_nsec = (long)(ns % 1000000000u);
    }
    pthread_mutex_lock(&q->lock);
    int rc = 0;
    while (q->count == 0 && !q->closed && rc != ETIMEDOUT)
        rc = timeout_ns == UINT64_MAX ? pthread_cond_wait(&q->not_empty, &q->lock)
                                      : pthread_cond_timedwait(&q->not_empty, &q->lock, &until);
    void *item = take(q);
    pthread_mutex_unlock(&q->lock);
    return item;
}

void hg_queue_close(struct hg_queue *q)
{
    pthread_mutex_lock(&q->lock);
    q->closed = true;
    pthread_cond_broadcast(&q->not_empty);
    pthread_mutex_unlock(&q->lock);
}

void hg_queue_finish(struct hg_queue *q)
{
    if (!q->items)
        return;
    pthread_mutex_destroy(&q->lock);
    pthread_cond_destroy(&q->not_empty);
    close(q->event_fd);
    hg_free(q->items);
    *q = (struct hg_queue){.event_fd = -1};
}
