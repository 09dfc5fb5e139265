#include "server/worker/io_thread.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "protocol/framing.h"
#include "server/worker/reply.h"

enum { PULSE_MS = 500, BUSY_TOLD_NS = 50000000, READ_BUDGET_BYTES = 4 << 20, LAST_WORDS_S = 3 };

struct link {
    struct worker *w;
    int fd, timer_fd;
    // Incoming.
    struct hgp_framer in;    // of commands
    struct command *blocked; // the inbox was full: nothing is read until it is taken
    // Outgoing.
    struct hg_refbuf *out;
    size_t out_pos;
};

// ---- sending ------------------------------------------------------------------------------------

static void send_pulse(struct link *l)
{
    uint64_t expirations;
    if (read(l->timer_fd, &expirations, sizeof expirations) < 0)
        return;
    struct watch_work work;
    const uint64_t busy_ns = hg_watch_longest_ns(&l->w->watch, &work);
    unsigned long pages = 0;
    FILE *statm = fopen("/proc/self/statm", "re");
    if (statm) {
        if (fscanf(statm, "%*u %lu", &pages) != 1)
            pages = 0;
        fclose(statm);
    }
    struct hgp_pulse pulse = {
        .busy_ns = busy_ns,
        .rss_bytes = (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE),
        .views = atomic_load(&l->w->view_count),
    };
    const struct hgp_busy busy = {
        .channel = work.channel, .request = work.request, .view = work.view};
    if (busy_ns >= BUSY_TOLD_NS)
        hg_reply_send_lossy((struct reply_to){.w = l->w}, HGP_T_busy, &busy);
    hg_reply_send_lossy((struct reply_to){.w = l->w}, HGP_T_pulse, &pulse);
}

// A peer that closes with unread bytes of ours resets the stream: an end like any other.
static enum hg_status socket_status(int error_number)
{
    return error_number == EAGAIN                                ? HG_E_AGAIN
           : error_number == EPIPE || error_number == ECONNRESET ? HG_E_CLOSED
                                                                 : HG_E_IO;
}

static enum hg_status write_some(struct link *l)
{
    for (;;) {
        if (!l->out)
            l->out = hg_queue_try_pop(&l->w->outbox);
        if (!l->out)
            return HG_OK;
        ssize_t n = send(l->fd, l->out->data + l->out_pos, l->out->size - l->out_pos, MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return socket_status(errno);
        l->out_pos += (size_t)n;
        if (l->out_pos == l->out->size) {
            hg_refbuf_unref(l->out);
            l->out = NULL;
            l->out_pos = 0;
        }
    }
}

// ---- receiving ----------------------------------------------------------------------------------

static void *create_command(const struct hgp_header *header)
{
    struct command *command = hg_calloc(1, sizeof *command);
    struct hg_refbuf *payload = command ? hg_refbuf_create(header->length) : NULL;
    if (!payload) {
        hg_free(command);
        return NULL;
    }
    command->header = *header;
    command->received_ns = hg_clock_now_ns();
    command->payload = payload;
    return command;
}

static uint8_t *command_payload(void *command)
{
    return ((struct command *)command)->payload->data;
}

static void destroy_command(void *command)
{
    hg_refbuf_unref(((struct command *)command)->payload);
    hg_free(command);
}

static const struct hgp_frame_class command_frames = {
    create_command, command_payload, destroy_command};

// Hands the messages that are whole to the render thread. HG_E_AGAIN: the inbox is full, and one is
// blocked.
static enum hg_status deliver_all(struct link *l)
{
    for (;;) {
        enum hg_status status = HG_OK;
        if (!l->blocked) {
            void *message;
            // Lengths are policed by the broker, whose limit can be configured.
            status = hgp_framer_next(&l->in, UINT32_MAX, &message);
            if (status)
                return status == HG_E_AGAIN ? HG_OK : status;
            l->blocked = message;
        }
        status = hg_queue_push(&l->w->inbox, l->blocked);
        if (status)
            return status;
        l->blocked = NULL;
    }
}

static enum hg_status receive(struct link *l, size_t *taken)
{
    size_t size;
    ssize_t n;
    uint8_t *dst = hgp_framer_space(&l->in, &size);
    if (!dst)
        return HG_E_NOMEM;
    do
        n = recv(l->fd, dst, size, 0);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return socket_status(errno);
    if (n == 0)
        return HG_E_CLOSED;
    hgp_framer_fill(&l->in, (size_t)n);
    *taken += (size_t)n;
    return HG_OK;
}

// Reads a bounded amount, so that a long upload does not hold up pulses and answers. Nothing whole
// is left behind unless one message is blocked: no event would come for it.
static enum hg_status read_some(struct link *l)
{
    enum hg_status status = deliver_all(l);
    for (size_t taken = 0; !status && taken < READ_BUDGET_BYTES;) {
        status = receive(l, &taken);
        if (!status)
            status = deliver_all(l);
    }
    return status;
}

// ---- a disk that fails --------------------------------------------------------------------------

// In the handler of a signal: the loop says what happened, if it can.
static void lose_disk(void *user, const struct hg_spill_loss *loss)
{
    static const char text[] = "helio-worker: a spilled array cannot be read back\n";
    struct worker *w = user;
    const uint64_t one = 1;
    w->loss = *loss;
    atomic_store(&w->disk_lost, true);
    const ssize_t woken = write(w->outbox.event_fd, &one, sizeof one);
    (void)woken; // else the next pulse wakes it
    for (struct timespec left = {.tv_sec = LAST_WORDS_S + 1}; nanosleep(&left, &left) != 0;)
        ;
    const ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
    (void)written;
    _exit(WORKER_EXIT_DISK);
}

void hg_io_thread_watch_disk(struct worker *w)
{
    hg_spill_watch(lose_disk, w);
}

// Sends what is waiting, as long as the peer takes it.
static void flush(struct link *l, uint64_t until_ns)
{
    struct pollfd fd = {.fd = l->fd, .events = POLLOUT};
    while (write_some(l) == HG_E_AGAIN && hg_clock_now_ns() < until_ns)
        poll(&fd, 1, 10);
}

static void tell_loss(struct link *l)
{
    const struct hg_spill_loss *loss = &l->w->loss;
    const uint64_t until_ns = hg_clock_now_ns() + LAST_WORDS_S * 1000000000ull;
    struct hg_error err = {0};
    const char *what = loss->what[0] ? loss->what : "working memory", *slash = strrchr(what, '/');
    hg_fault(WORKER, HG_E_IO, "%s: byte %llu of %llu spilled bytes cannot be read back (%s)",
        loss->folder, (unsigned long long)loss->offset, (unsigned long long)loss->bytes, what);
    // Clients hear this: neither the folder nor where the asset lies.
    hg_error_set(&err, HG_E_WORKER, "spill", NULL,
        "byte %llu of %llu spilled bytes cannot be read back (%s): the worker exits",
        (unsigned long long)loss->offset, (unsigned long long)loss->bytes,
        slash && slash[1] ? slash + 1 : what);
    flush(l, until_ns);
    hg_reply_error((struct reply_to){.w = l->w}, &err);
    flush(l, until_ns);
}

// ---- the loop -----------------------------------------------------------------------------------

static enum hg_status run_once(struct link *l)
{
    // With nothing to read or write the socket is left out: its end would be reported for ever.
    struct pollfd fds[] = {
        {.fd = l->blocked && !l->out ? -1 : l->fd,
            .events = (short)((l->blocked ? 0 : POLLIN) | (l->out ? POLLOUT : 0))},
        {.fd = l->out ? -1 : l->w->outbox.event_fd, .events = POLLIN},
        {.fd = l->timer_fd, .events = POLLIN},
    };
    // There is no event for a full inbox: poll.
    if (poll(fds, 3, l->blocked ? 2 : -1) < 0 && errno != EINTR)
        return HG_E_IO;
    enum hg_status status = HG_OK;
    if (l->blocked)
        status = deliver_all(l);
    if (fds[2].revents)
        send_pulse(l);
    if (!status || status == HG_E_AGAIN)
        status = write_some(l);
    if ((!status || status == HG_E_AGAIN) && (fds[0].revents & (POLLIN | POLLHUP | POLLERR)))
        status = read_some(l);
    return status == HG_E_AGAIN ? HG_OK : status;
}

enum hg_status hg_io_thread_run(struct worker *w)
{
    struct link l = {
        .w = w, .fd = w->options.fd, .timer_fd = -1, .in = {.frames = &command_frames}};
    l.timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    if (l.timer_fd < 0)
        return HG_E_LIMIT;
    struct timespec period = {.tv_nsec = PULSE_MS * 1000000L};
    timerfd_settime(l.timer_fd, 0, &(struct itimerspec){period, period}, NULL);
    enum hg_status status = HG_OK;
    while (!status && !atomic_load(&w->device_lost) && !atomic_load(&w->disk_lost))
        status = run_once(&l);
    if (atomic_load(&w->disk_lost)) {
        tell_loss(&l);
        status = HG_E_IO;
    } else if (!status) {
        status = HG_E_DEVICE_LOST;
    }
    close(l.timer_fd);
    hgp_framer_finish(&l.in);
    hg_refbuf_unref(l.out);
    if (l.blocked)
        destroy_command(l.blocked);
    return status;
}
