#include "server/broker/workers/worker_link.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/log.h"
#include "server/broker/metrics/counters.h"

enum {
    PAYLOAD_LIMIT = 640 << 20, // above every message of the table
    CRASH_WINDOW_S = 60,
};
static const uint64_t longest_restart_ns = 10000000000u;

// ---- starting -----------------------------------------------------------------------------------

static void ready(struct hg_source *source, uint32_t events);

static uint64_t restart_delay_ns(const struct hg_link *link);

static void count_death(struct hg_link *link)
{
    hg_count(HG_COUNT_WORKER_DEATHS);
    link->death_ns[link->deaths++ % HG_LINK_DEATHS_KEPT] = link->loop->now_ns;
    link->restart_ns = link->loop->now_ns + restart_delay_ns(link);
}

static void postpone(struct hg_link *link, const char *action, int error_number)
{
    count_death(link);
    hg_fault(WORKER, HG_E_WORKER, "cannot %s: %s", action, strerror(error_number));
}

static enum hg_status open_link(struct hg_link *link, int fd)
{
    hg_transport_open(&link->transport, &hg_transport_unix, fd);
    link->in.frames = &hg_packet_frames;
    link->source = (struct hg_source){.fd = fd, .events = EPOLLIN, .ready = ready, .owner = link};
    link->started_ns = link->loop->now_ns;
    link->pulse_ns = hg_loop_awake_ns(link->loop);
    link->hang = (struct hg_link_hang){0};
    link->farewell.words[0] = 0;
    return hg_loop_add(link->loop, &link->source);
}

void hg_link_start(struct hg_link *link)
{
    int pair[2];
    struct hg_error err = {0};
    if (link->whose.home.homes && hg_home_make(&link->whose.home, &err)) {
        count_death(link);
        hg_fault(WORKER, err.status, "no home for a worker: %s: %s", err.what, err.reason);
        return;
    }
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) {
        postpone(link, "make a socketpair", errno);
        return;
    }
    const struct hg_worker_start start = {.options = link->options,
        .home = &link->whose.home,
        .fd = pair[1],
        .no_spill = link->no_spill,
        .memory_bytes =
            link->whose.machine ? hg_machine_most_bytes(link->whose.machine, link->options) : 0,
        .warm_up = link->options->warm_up && !link->deaths};
    int rc = hg_launcher_run(link->whose.launcher, &start, &link->pid);
    close(pair[1]);
    if (rc) {
        close(pair[0]);
        postpone(link, "start the worker", rc);
        return;
    }
    link->whose.share = (struct hg_worker_share){0};
    if (open_link(link, pair[0])) {
        hg_link_fail(link, "cannot watch the link");
        return;
    }
    link->state = HG_LINK_STARTING;
    hg_info(WORKER, "worker %d started", (int)link->pid);
}

enum hg_status hg_link_adopt(struct hg_link *link, int fd, pid_t pid, struct hg_reader *input)
{
    link->pid = pid;
    enum hg_status status = open_link(link, fd);
    link->state = HG_LINK_UP;
    if (!status)
        status = hg_packet_load_input(&link->in, input);
    if (status)
        hg_link_end(link);
    return status;
}

// ---- dying --------------------------------------------------------------------------------------

uint32_t hg_link_recent_deaths(const struct hg_link *link)
{
    uint32_t kept = link->deaths, count = 0;
    if (kept > HG_LINK_DEATHS_KEPT)
        kept = HG_LINK_DEATHS_KEPT;
    for (uint32_t i = 0; i < kept; i++)
        count += link->loop->now_ns - link->death_ns[i] < CRASH_WINDOW_S * 1000000000ull;
    return count;
}

static uint64_t restart_delay_ns(const struct hg_link *link)
{
    uint32_t deaths = hg_link_recent_deaths(link);
    uint64_t delay_ns = link->options->restart_delay_ns;
    for (uint32_t i = 1; i < deaths && delay_ns < longest_restart_ns; i++)
        delay_ns *= 2;
    return delay_ns < longest_restart_ns ? delay_ns : longest_restart_ns;
}

void hg_link_end(struct hg_link *link)
{
    if (link->state == HG_LINK_DOWN)
        return;
    if (link->pid)
        kill(link->pid, SIGKILL);
    link->pid = 0;
    hg_loop_remove(link->loop, &link->source);
    hg_transport_close(&link->transport);
    hgp_framer_finish(&link->in);
    hg_outq_finish(&link->out);
    link->state = HG_LINK_DOWN;
}

void hg_link_fail(struct hg_link *link, const char *reason)
{
    if (link->state == HG_LINK_DOWN)
        return;
    hg_fault(WORKER, HG_E_WORKER, "worker %d: %s; it is replaced",
        (int)(link->pid ? link->pid : link->farewell.pid), reason);
    if (!link->pid)
        link->farewell.pid = 0;
    hg_link_end(link);
    count_death(link);
    link->events->died(link);
}

void hg_link_exited(struct hg_link *link, pid_t pid, int status)
{
    link->farewell.pid = pid == link->pid ? pid : 0;
    if (pid == link->pid)
        link->pid = 0; // the end of the stream follows and does the rest
    if (WIFSIGNALED(status))
        hg_warn(WORKER, "worker %d was killed by signal %d (%s)", (int)pid, WTERMSIG(status),
            strsignal(WTERMSIG(status)));
    else
        hg_warn(WORKER, "worker %d exited with %d", (int)pid, WEXITSTATUS(status));
}

void hg_link_stop(struct hg_link *link)
{
    pid_t pid = link->pid;
    hg_link_end(link);
    if (pid)
        waitpid(pid, NULL, 0);
}

// ---- time ---------------------------------------------------------------------------------------

// Stamps are of before a round's lateness is known: they may lie ahead.
static bool is_silent(const struct hg_link *link)
{
    const uint64_t awake_ns = hg_loop_awake_ns(link->loop);
    return awake_ns > link->pulse_ns &&
           awake_ns - link->pulse_ns > link->options->worker_timeout_ns;
}

void hg_link_check_time(struct hg_link *link)
{
    const struct hg_options *o = link->options;
    uint64_t now_ns = link->loop->now_ns;
    if (link->state == HG_LINK_DOWN) {
        if (now_ns >= link->restart_ns && !link->loop->stop)
            hg_link_start(link);
    } else if (link->state == HG_LINK_STARTING) {
        if (now_ns - link->started_ns > o->start_timeout_ns)
            hg_link_fail(link, "was not ready in time (start-timeout)");
    } else if (is_silent(link)) {
        hg_link_fail(link, "gives no sign of life (worker-timeout)");
    } else if (link->hang.busy_ns > o->hang_timeout_ns) {
        link->hang.fatal = link->hang.named;
        hg_link_fail(link, "hangs in one piece of work (hang-timeout)");
    }
}

// ---- talking ------------------------------------------------------------------------------------

uint32_t hg_link_next_id(struct hg_link *link)
{
    link->last_id += link->last_id == UINT32_MAX ? 2 : 1; // never 0
    return link->last_id;
}

static void update(struct hg_link *link)
{
    const struct hg_transport *t = &link->transport;
    hg_loop_set_events(link->loop, &link->source, t->class->wants(t, true, link->out.head));
}

bool hg_link_has_room(const struct hg_link *link)
{
    return link->out.bytes < HG_LINK_AHEAD;
}

void hg_link_send_packet(
    struct hg_link *link, uint32_t channel, uint32_t id, struct hg_packet *packet)
{
    if (link->state != HG_LINK_UP) {
        hg_packet_unref(packet);
        return;
    }
    if (hg_outq_push(&link->out, packet, id, channel))
        link->broken = true; // noticed at the end of the round, not in the middle of a walk
    update(link);
}

void hg_link_send(
    struct hg_link *link, uint32_t channel, uint32_t id, enum hgp_type type, const void *message)
{
    hg_link_send_packet(link, channel, id, hg_packet_encode(type, message));
}

// ---- listening ----------------------------------------------------------------------------------

static void take_ready(struct hg_link *link)
{
    if (link->state != HG_LINK_STARTING)
        return;
    link->state = HG_LINK_UP;
    link->pulse_ns = hg_loop_awake_ns(link->loop);
    hg_info(WORKER, "worker %d ready after %.0f ms", (int)link->pid,
        (double)(link->loop->now_ns - link->started_ns) * 1e-6);
    link->events->ready(link);
}

// It ends by itself, after this.
static void take_last_words(struct hg_link *link, const struct hgp_error *m)
{
    snprintf(link->farewell.words, sizeof link->farewell.words, "%.*s%s%.*s", (int)m->where.size,
        m->where.size ? m->where.data : "", m->where.size ? ": " : "", (int)m->reason.size,
        m->reason.size ? m->reason.data : "");
    link->no_spill |= m->what.size == 5 && memcmp(m->what.data, "spill", 5) == 0;
    hg_warn(WORKER, "worker: %s%s", link->farewell.words,
        link->no_spill ? "; large arrays stay in memory from now on" : "");
}

static void take_own(struct hg_link *link, uint16_t type, const union hgp_any *m)
{
    switch (type) {
    case HGP_T_worker_ready:
        take_ready(link);
        return;
    case HGP_T_pulse:
        link->pulse_ns = hg_loop_awake_ns(link->loop);
        link->hang.busy_ns = m->pulse.busy_ns;
        link->rss_bytes = m->pulse.rss_bytes;
        link->hang.named &= m->pulse.busy_ns > 0;
        return;
    case HGP_T_busy:
        link->hang = (struct hg_link_hang){.channel = m->busy.channel,
            .request = m->busy.request,
            .view = m->busy.view,
            .named = true};
        return;
    case HGP_T_error:
        take_last_words(link, &m->error);
        return;
    default:
        return;
    }
}

// The worker handles untrusted files: its messages are validated like those of a client.
static bool handle(struct hg_link *link, struct hg_packet *packet)
{
    const struct hgp_message_info *info = hgp_find(packet->header.type);
    struct hg_arena arena = {0};
    union hgp_any any;
    if (!info || info->direction == HGP_C2S || info->direction == HGP_B2W)
        return false;
    if (hgp_decode(HGP_VERSION_MAX, packet->header.type,
            hg_reader_make(packet->payload, packet->header.length), &arena, &any, NULL)) {
        hg_arena_finish(&arena);
        return false;
    }
    if (packet->header.channel == 0)
        take_own(link, packet->header.type, &any);
    else
        link->events->message(link, packet, &any);
    hg_arena_finish(&arena);
    return true;
}

// It ends: why is known when it is reaped. A SIGKILL does not change that any more.
static void close_by_peer(struct hg_link *link)
{
    if (link->pid)
        link->farewell.pid = link->pid;
    hg_link_fail(link, "closed its link");
}

static void receive(struct hg_link *link)
{
    enum hg_status status = hg_packet_receive(&link->in, &link->transport);
    struct hg_packet *packet = NULL;
    enum hg_status framing = HG_OK;
    while (link->state != HG_LINK_DOWN &&
           (framing = hg_packet_next(&link->in, PAYLOAD_LIMIT, &packet)) == HG_OK && packet) {
        bool good = handle(link, packet);
        hg_packet_unref(packet);
        if (!good)
            hg_link_fail(link, "sent a message that makes no sense");
    }
    if (framing)
        hg_link_fail(link, "sent bytes that make no sense");
    else if (status == HG_E_CLOSED || status == HG_E_IO)
        close_by_peer(link);
    else if (status == HG_E_NOMEM)
        hg_link_fail(link, "no memory to read from it");
}

static void ready(struct hg_source *source, uint32_t events)
{
    struct hg_link *link = source->owner;
    if (events & EPOLLOUT) {
        if (hg_outq_flush(&link->out, &link->transport) == HG_OK)
            update(link);
        link->feed.pump |= link->feed.starved && hg_link_has_room(link);
        // A broken stream shows in reading, after the last answers.
    }
    if (events & (EPOLLIN | EPOLLHUP | EPOLLERR))
        receive(link);
}
