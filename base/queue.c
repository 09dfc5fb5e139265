#include "base/queue.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/cond.h"

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
    pthread_mutex_init(&q->lock, NULL);
    hg_cond_init(&q->not_empty);
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

void *hg_queue_try_pop(struct hg_queue *q)
{
    pthread_mutex_lock(&q->lock);
    void *item = take(q);
    pthread_mutex_unlock(&q->lock);
    return item;
}

void *hg_queue_pop(struct hg_queue *q, uint64_t timeout_ns)
{
    const uint64_t until_ns = hg_cond_after(timeout_ns);
    pthread_mutex_lock(&q->lock);
    while (q->count == 0 && !q->closed && hg_cond_wait(&q->not_empty, &q->lock, until_ns))
        ;
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
