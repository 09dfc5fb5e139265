#include "server/broker/loop.h"

#include <errno.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/slice.h"

enum { EVENTS_PER_ROUND = 512 };
#define LATE_NS 200000000u // that a round may take beyond its wait

enum hg_status hg_loop_init(struct hg_loop *loop, struct hg_error *err)
{
    *loop = (struct hg_loop){.epoll_fd = epoll_create1(EPOLL_CLOEXEC)};
    loop->now_ns = hg_clock_now_ns();
    if (loop->epoll_fd >= 0)
        return HG_OK;
    return hg_error_set(
        err, hg_status_from_errno(errno), "epoll", NULL, "cannot create: %s", strerror(errno));
}

void hg_loop_finish(struct hg_loop *loop)
{
    if (loop->epoll_fd >= 0)
        close(loop->epoll_fd);
    loop->epoll_fd = -1;
}

enum hg_status hg_loop_add(struct hg_loop *loop, struct hg_source *source)
{
    struct epoll_event event = {.events = source->events, .data.ptr = source};
    if (epoll_ctl(loop->epoll_fd, EPOLL_CTL_ADD, source->fd, &event) == 0)
        return HG_OK;
    return hg_status_from_errno(errno);
}

void hg_loop_set_events(struct hg_loop *loop, struct hg_source *source, uint32_t events)
{
    if (source->fd < 0 || source->events == events)
        return;
    source->events = events;
    struct epoll_event event = {.events = events, .data.ptr = source};
    epoll_ctl(loop->epoll_fd, EPOLL_CTL_MOD, source->fd, &event);
}

void hg_loop_remove(struct hg_loop *loop, struct hg_source *source)
{
    if (source->fd >= 0)
        epoll_ctl(loop->epoll_fd, EPOLL_CTL_DEL, source->fd, NULL);
    source->fd = -1;
}

void hg_loop_close(struct hg_loop *loop, struct hg_source *source)
{
    int fd = source->fd;
    hg_loop_remove(loop, source);
    if (fd >= 0)
        close(fd);
}

static int wait_ms(const struct hg_loop *loop, uint64_t deadline_ns)
{
    if (deadline_ns == UINT64_MAX)
        return -1;
    if (deadline_ns <= loop->now_ns)
        return 0;
    uint64_t ms = (deadline_ns - loop->now_ns + 999999) / 1000000;
    return ms > 60000 ? 60000 : (int)ms;
}

// Of a round that began then and was to wait for so long.
static void note_late(struct hg_loop *loop, uint64_t begin_ns, int ms)
{
    const uint64_t most_ns = (uint64_t)(ms < 0 ? 0 : ms) * 1000000u + LATE_NS,
                   took_ns = loop->now_ns - begin_ns;
    if (ms >= 0 && took_ns > most_ns)
        loop->late_ns += took_ns - most_ns;
}

void hg_loop_run(struct hg_loop *loop, uint64_t (*round)(void *user), void *user)
{
    int ms = -1;
    uint64_t begin_ns = 0;
    hg_slice_set(HG_SLICE_SHORT_NS);
    while (!loop->stop) {
        loop->now_ns = hg_clock_now_ns();
        note_late(loop, begin_ns, ms);
        begin_ns = loop->now_ns;
        uint64_t deadline_ns = round(user);
        if (loop->stop)
            break;
        struct epoll_event events[EVENTS_PER_ROUND];
        loop->now_ns = hg_clock_now_ns();
        ms = wait_ms(loop, deadline_ns);
        int n = epoll_wait(loop->epoll_fd, events, EVENTS_PER_ROUND, ms);
        loop->now_ns = hg_clock_now_ns();
        for (int i = 0; i < n; i++) {
            struct hg_source *source = events[i].data.ptr;
            if (source->fd >= 0) // not closed by an earlier event of this round
                source->ready(source, events[i].events);
        }
    }
}
