// watch.h - what the threads of a worker are at, so that one that hangs is found, with the request
// that it hangs in.
// Floor 6, private to server/worker. Thread-safe.
#ifndef HG_SERVER_WORKER_WATCH_H
#define HG_SERVER_WORKER_WATCH_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

// For whom a thread works.
struct watch_work {
    uint32_t channel, request, view; // request 0: of no request; view 0: none
};

// Of one thread, whose own it is; in the list from hg_watch_add to hg_watch_remove.
struct watch {
    struct watch *prev, *next;
    _Atomic uint64_t since_ns; // when it began, or was known to go on; 0 = idle
    _Atomic uint32_t channel, request, view;
};

// All threads of a worker.
struct watch_list {
    pthread_mutex_t lock;
    struct watch *first;
};

void hg_watch_init(struct watch_list *list);
void hg_watch_finish(struct watch_list *list); // after all threads have ended
void hg_watch_add(struct watch_list *list, struct watch *watch);
void hg_watch_remove(struct watch_list *list, struct watch *watch);

// By the thread itself.
void hg_watch_begin(struct watch *watch, struct watch_work work);
void hg_watch_go_on(struct watch *watch); // it has come further with the same
void hg_watch_end(struct watch *watch);

// How long the thread that is at the same thing for longest has been, and at what. 0: all are idle.
uint64_t hg_watch_longest_ns(struct watch_list *list, struct watch_work *work);

#endif
