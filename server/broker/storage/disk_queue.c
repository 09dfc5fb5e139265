#include "server/broker/storage/disk_queue.h"

#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "base/slice.h"

struct list {
    struct hg_disk_job *first, **last;
};

struct hg_disk_queue {
    pthread_t thread;
    int event_fd;
    uint64_t left;        // of the loop: pushed, and not done
    pthread_mutex_t lock; // of what follows
    pthread_cond_t pushed, ran;
    struct list queue, done;
    bool stop;
};

static void add(struct list *list, struct hg_disk_job *job)
{
    job->next = NULL;
    if (!list->first)
        list->last = &list->first;
    *list->last = job;
    list->last = &job->next;
}

static void *run(void *arg)
{
    struct hg_disk_queue *q = arg;
    hg_slice_set(0); // the loop's are not for this
    pthread_mutex_lock(&q->lock);
    for (;;) {
        while (!q->queue.first && !q->stop)
            (void)hg_cond_wait(&q->pushed, &q->lock, HG_COND_FOREVER);
        struct hg_disk_job *job = q->queue.first;
        if (!job)
            break;
        q->queue.first = job->next;
        pthread_mutex_unlock(&q->lock);
        job->run(job);
        pthread_mutex_lock(&q->lock);
        add(&q->done, job);
        pthread_cond_signal(&q->ran);
        eventfd_write(q->event_fd, 1);
    }
    pthread_mutex_unlock(&q->lock);
    return NULL;
}

static void finish(struct hg_disk_queue *q)
{
    if (q->event_fd >= 0)
        close(q->event_fd);
    pthread_mutex_destroy(&q->lock);
    pthread_cond_destroy(&q->pushed);
    pthread_cond_destroy(&q->ran);
    hg_free(q);
}

enum hg_status hg_disk_queue_create(struct hg_disk_queue **out)
{
    sigset_t all, before;
    *out = NULL;
    struct hg_disk_queue *q = hg_calloc(1, sizeof *q);
    if (!q)
        return HG_E_NOMEM;
    pthread_mutex_init(&q->lock, NULL);
    hg_cond_init(&q->pushed);
    hg_cond_init(&q->ran);
    q->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (q->event_fd < 0) {
        finish(q);
        return HG_E_LIMIT;
    }
    sigfillset(&all); // signals are for the loop
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const int rc = pthread_create(&q->thread, NULL, run, q);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (rc) {
        finish(q);
        return HG_E_NOMEM;
    }
    *out = q;
    return HG_OK;
}

void hg_disk_queue_push(struct hg_disk_queue *q, struct hg_disk_job *job)
{
    q->left++;
    pthread_mutex_lock(&q->lock);
    add(&q->queue, job);
    pthread_cond_signal(&q->pushed);
    pthread_mutex_unlock(&q->lock);
}

int hg_disk_queue_fd(const struct hg_disk_queue *q)
{
    return q->event_fd;
}

void hg_disk_queue_poll(struct hg_disk_queue *q)
{
    eventfd_t count;
    (void)eventfd_read(q->event_fd, &count);
    pthread_mutex_lock(&q->lock);
    struct hg_disk_job *job = q->done.first, *next;
    q->done = (struct list){0};
    pthread_mutex_unlock(&q->lock);
    for (; job; job = next) {
        next = job->next;
        q->left--;
        job->done(job);
    }
}

void hg_disk_queue_wait(struct hg_disk_queue *q)
{
    while (q->left) {
        pthread_mutex_lock(&q->lock);
        while (!q->done.first)
            (void)hg_cond_wait(&q->ran, &q->lock, HG_COND_FOREVER);
        pthread_mutex_unlock(&q->lock);
        hg_disk_queue_poll(q);
    }
}

bool hg_disk_queue_is_idle(const struct hg_disk_queue *q)
{
    return !q->left;
}

void hg_disk_queue_destroy(struct hg_disk_queue *q)
{
    if (!q)
        return;
    hg_disk_queue_wait(q);
    pthread_mutex_lock(&q->lock);
    q->stop = true;
    pthread_cond_signal(&q->pushed);
    pthread_mutex_unlock(&q->lock);
    pthread_join(q->thread, NULL);
    finish(q);
}
