// loop.h - the epoll loop. Floor 6 (broker). Thread: the one that runs it.
#ifndef HG_BROKER_LOOP_H
#define HG_BROKER_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

// Something with a descriptor. Embedded in its owner, which must outlive the round of the loop in
// which it was removed (see hg_loop_run's `round`).
struct hg_source {
    int fd;          // -1 = not watched
    uint32_t events; // EPOLLIN | EPOLLOUT wanted
    void (*ready)(struct hg_source *source, uint32_t events);
    void *owner;
};

struct hg_loop {
    int epoll_fd;
    bool stop;
    uint64_t now_ns;  // of this round
    uint64_t late_ns; // in all, of time in which it was to run and did not
};

// A clock of the time in which others could be heard. It stands still while the machine gives the
// loop no time (it was stopped, or its virtual machine was), in which it may give others none
// either: what has to come within some time has that much of this clock.
static inline uint64_t hg_loop_awake_ns(const struct hg_loop *loop)
{
    return loop->now_ns - loop->late_ns;
}

enum hg_status hg_loop_init(struct hg_loop *loop, struct hg_error *err) HG_MUST_CHECK;
void hg_loop_finish(struct hg_loop *loop);

// Watches the descriptor of a source for its events; the source is borrowed until it is removed.
enum hg_status hg_loop_add(struct hg_loop *loop, struct hg_source *source) HG_MUST_CHECK;
void hg_loop_set_events(struct hg_loop *loop, struct hg_source *source, uint32_t events);
// Stops watching; the descriptor stays its owner's.
void hg_loop_remove(struct hg_loop *loop, struct hg_source *source);
// Stops watching and closes the descriptor.
void hg_loop_close(struct hg_loop *loop, struct hg_source *source);

// Until loop->stop: waits for events at most until the deadline that `round` returned, hands them
// to their sources, then calls round(user), which does periodic work and frees what was removed.
void hg_loop_run(struct hg_loop *loop, uint64_t (*round)(void *user), void *user);

#endif
