#include "base/jobs.h"

#include <pthread.h>
#include <stdatomic.h>
#include <unistd.h>

#include "base/alloc.h"

// A batch lives on its caller's stack; helpers may touch it only while `helpers` counts them.
struct batch {
    struct batch *next;
    hg_jobs_fn *fn;
    void *user;
    size_t count;
    _Atomic size_t cursor;
    unsigned helpers; // threads inside run_batch, under the pool's lock
};

struct hg_jobs {
    pthread_mutex_t lock;
    pthread_cond_t work, done;
    struct batch *batches;
    bool stop;
    unsigned thread_count;
    pthread_t threads[];
};

static void run_batch(struct batch *b)
{
    for (size_t i; (i = atomic_fetch_add_explicit(&b->cursor, 1, memory_order_relaxed)) < b->count;)
        b->fn(b->user, i);
}

static struct batch *find_work(struct hg_jobs *jobs)
{
    for (struct batch *b = jobs->batches; b; b = b->next)
        if (atomic_load_explicit(&b->cursor, memory_order_relaxed) < b->count)
            return b;
    return NULL;
}

static void *thread_main(void *arg)
{
    struct hg_jobs *jobs = arg;
    pthread_mutex_lock(&jobs->lock);
    while (!jobs->stop) {
        struct batch *b = find_work(jobs);
        if (!b) {
            pthread_cond_wait(&jobs->work, &jobs->lock);
            continue;
        }
        b->helpers++;
        pthread_mutex_unlock(&jobs->lock);
        run_batch(b);
        pthread_mutex_lock(&jobs->lock);
        if (--b->helpers == 0)
            pthread_cond_broadcast(&jobs->done);
    }
    pthread_mutex_unlock(&jobs->lock);
    return NULL;
}

static _Atomic unsigned limit;

void hg_jobs_set_limit(unsigned threads)
{
    atomic_store(&limit, threads);
}

unsigned hg_jobs_limit(void)
{
    return atomic_load(&limit);
}

unsigned hg_jobs_cores(void)
{
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    const unsigned most = hg_jobs_limit();
    return most ? most : cores > 0 ? (unsigned)cores : 1;
}

struct hg_jobs *hg_jobs_create(unsigned threads)
{
    threads = threads ? threads : hg_jobs_cores();
    struct hg_jobs *jobs = hg_calloc(1, sizeof *jobs + (threads - 1) * sizeof(pthread_t));
    if (!jobs)
        return NULL;
    pthread_mutex_init(&jobs->lock, NULL);
    pthread_cond_init(&jobs->work, NULL);
    pthread_cond_init(&jobs->done, NULL);
    // The caller of hg_jobs_for is a worker too, so one thread fewer is started.
    for (unsigned i = 0; i + 1 < threads; i++) {
        if (pthread_create(&jobs->threads[i], NULL, thread_main, jobs) != 0)
            break;
        jobs->thread_count++;
    }
    return jobs;
}

void hg_jobs_destroy(struct hg_jobs *jobs)
{
    if (!jobs)
        return;
    pthread_mutex_lock(&jobs->lock);
    jobs->stop = true;
    pthread_cond_broadcast(&jobs->work);
    pthread_mutex_unlock(&jobs->lock);
    for (unsigned i = 0; i < jobs->thread_count; i++)
        pthread_join(jobs->threads[i], NULL);
    pthread_mutex_destroy(&jobs->lock);
    pthread_cond_destroy(&jobs->work);
    pthread_cond_destroy(&jobs->done);
    hg_free(jobs);
}

unsigned hg_jobs_threads(const struct hg_jobs *jobs)
{
    return jobs->thread_count + 1;
}

void hg_jobs_for(struct hg_jobs *jobs, size_t count, hg_jobs_fn *fn, void *user)
{
    struct batch b = {.fn = fn, .user = user, .count = count};
    if (count > 1 && jobs->thread_count) {
        pthread_mutex_lock(&jobs->lock);
        b.next = jobs->batches;
        jobs->batches = &b;
        pthread_cond_broadcast(&jobs->work);
        pthread_mutex_unlock(&jobs->lock);
        run_batch(&b);
        pthread_mutex_lock(&jobs->lock);
        struct batch **link = &jobs->batches;
        while (*link != &b)
            link = &(*link)->next;
        *link = b.next;
        while (b.helpers)
            pthread_cond_wait(&jobs->done, &jobs->lock);
        pthread_mutex_unlock(&jobs->lock);
    } else {
        run_batch(&b);
    }
}
