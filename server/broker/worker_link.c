#include "server/broker/worker_link.h"

#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/log.h"
#include "base/program.h"

enum {
    WORKER_FD = 3,
    PAYLOAD_LIMIT = 640 << 20, // above every message of the table
    MAX_ARGS = 1024,
    CRASH_WINDOW_S = 60,
};
static const uint64_t longest_restart_ns = 10000000000u;

extern char **environ;

bool hg_link_find_program(const struct hg_options *options, char *path, size_t size)
{
    if (options->worker && *options->worker)
        snprintf(path, size, "%s", options->worker);
    else
        hg_program_path("HELIO_WORKER", "helio-worker", path, size);
    return access(path, X_OK) == 0;
}

// ---- starting -----------------------------------------------------------------------------------

struct arguments {
    char *items[MAX_ARGS];
    char text[16][32]; // numbers in words
    int count, texts;
};

static void add(struct arguments *a, const char *text)
{
    if (a->count + 1 < MAX_ARGS)
        a->items[a->count++] = (char *)text;
}

static void add_mib(struct arguments *a, const char *flag, uint64_t bytes)
{
    if (!bytes)
        return;
    char *text = a->text[a->texts++];
    snprintf(text, sizeof a->text[0], "%llu", (unsigned long long)(bytes >> 20));
    add(a, flag);
    add(a, text);
}

static void add_number(struct arguments *a, const char *flag, double value)
{
    char *text = a->text[a->texts++];
    snprintf(text, sizeof a->text[0], "%g", value);
    add(a, flag);
    add(a, text);
}

static void add_text(struct arguments *a, const char *flag, const char *text)
{
    if (!text)
        return;
    add(a, flag);
    add(a, text);
}

static void make_arguments(struct arguments *a, const struct hg_link *link, const char *path)
{
    const struct hg_options *o = link->options;
    *a = (struct arguments){0};
    add(a, path);
    add_text(a, "--fd", "3");
    for (size_t i = 0; i < o->asset_root.count; i++)
        add_text(a, "--asset-root", o->asset_root.items[i]);
    add_text(a, "--cache-dir", o->cache_dir);
    add_mib(a, "--memory-limit", o->memory_limit_bytes);
    add_mib(a, "--texture-budget", o->texture_budget_bytes);
    add_mib(a, "--geometry-budget", o->geometry_budget_bytes);
    add_mib(a, "--host-budget", o->host_budget_bytes);
    add_mib(a, "--cache-limit", o->cache_limit_bytes);
    add_text(a, "--device", o->device);
    add_text(a, "--log", o->log);
    add_text(a, "--shader-dir", o->shader_dir);
    if (o->validation)
        add(a, "--validation");
    if (o->warm_up && !link->deaths)
        add(a, "--warm-up");
    add_text(a, "--sandbox", o->sandbox);
    add_number(a, "--loader-cpu", (double)o->loader_cpu);
    add_mib(a, "--loader-memory", o->loader_memory_bytes);
    add_number(a, "--loader-timeout", (double)o->loader_timeout_ns / 1e9);
    if (link->no_spill)
        add(a, "--no-spill");
}

// What a worker needs of the environment: where the driver and the C library find things, and what
// tests and sanitizers set. Secrets that the daemon was started with are none of its business.
static bool is_for_worker(const char *variable)
{
    static const char *const prefixes[] = {"HELIO_", "VK_", "MESA_", "LP_", "GALLIUM_", "LIBGL_",
        "EGL_", "__GL", "__VK", "__EGL", "NVIDIA_", "CUDA_", "AMD_", "RADV_", "ANV_", "INTEL_",
        "DRI_", "DISABLE_", "ENABLE_", "XDG_", "LC_", "ASAN_", "UBSAN_", "TSAN_", "LSAN_", "OIIO_",
        "OPENIMAGEIO_", "LD_LIBRARY_PATH=", "LD_PRELOAD=", "PATH=", "HOME=", "LANG=", "TZ=",
        "TMPDIR=", "LLVM_PROFILE_FILE="};
    for (size_t i = 0; i < sizeof prefixes / sizeof *prefixes; i++)
        if (strncmp(variable, prefixes[i], strlen(prefixes[i])) == 0)
            return true;
    return false;
}

static void choose_environment(char **out, size_t capacity)
{
    size_t count = 0;
    for (char **it = environ; *it && count + 1 < capacity; it++)
        if (is_for_worker(*it))
            out[count++] = *it;
    out[count] = NULL;
}

// The child gets the socket as 3, nothing to read, our stderr, no other descriptor, and no
// blocked signals.
static int spawn_worker(struct hg_link *link, const char *path, int fd)
{
    struct arguments arguments;
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none, standard;
    char *variables[MAX_ARGS];
    choose_environment(variables, MAX_ARGS);
    make_arguments(&arguments, link, path);
    sigemptyset(&none);
    sigfillset(&standard);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, fd, WORKER_FD);
    posix_spawn_file_actions_addclosefrom_np(&actions, WORKER_FD + 1);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &standard);
    posix_spawnattr_setpgroup(&attributes, 0); // a ^C is for the broker, which drains
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    int rc = posix_spawn(&link->pid, path, &actions, &attributes, arguments.items, variables);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (rc)
        link->pid = 0;
    return rc;
}

// Where memory is short the kernel ends a worker, whose scenes come back, not the daemon.
static void make_first_victim(pid_t pid)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/oom_score_adj", (int)pid);
    int fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0 || write(fd, "500", 3) != 3)
        hg_debug(WORKER, "%s: %s", path, strerror(errno));
    if (fd >= 0)
        close(fd);
}

static void ready(struct hg_source *source, uint32_t events);

static uint64_t restart_delay_ns(const struct hg_link *link);

static void count_death(struct hg_link *link)
{
    link->death_ns[link->deaths++ % HG_LINK_DEATHS_KEPT] = link->loop->now_ns;
    link->restart_ns = link->loop->now_ns + restart_delay_ns(link);
}

static void postpone(struct hg_link *link, const char *action, int error_number)
{
    count_death(link);
    hg_fault(WORKER, HG_E_WORKER, "cannot %s: %s", action, strerror(error_number));
}

void hg_link_start(struct hg_link *link)
{
    char path[4096];
    int pair[2];
    if (!hg_link_find_program(link->options, path, sizeof path)) {
        postpone(link, "find the worker's program", ENOENT);
        return;
    }
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) {
        postpone(link, "make a socketpair", errno);
        return;
    }
    int rc = spawn_worker(link, path, pair[1]);
    close(pair[1]);
    if (rc) {
        close(pair[0]);
        postpone(link, "start the worker", rc);
        return;
    }
    hg_transport_open(&link->transport, &hg_transport_unix, pair[0]);
    link->in.frames = &hg_packet_frames;
    link->source =
        (struct hg_source){.fd = pair[0], .events = EPOLLIN, .ready = ready, .owner = link};
    if (hg_loop_add(link->loop, &link->source)) {
        hg_link_fail(link, "cannot watch the link");
        return;
    }
    make_first_victim(link->pid);
    link->state = HG_LINK_STARTING;
    link->started_ns = link->pulse_ns = link->loop->now_ns;
    link->hang = (struct hg_link_hang){0};
    link->last_words[0] = 0;
    hg_info(WORKER, "worker %d started", (int)link->pid);
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
    hg_fault(WORKER, HG_E_WORKER, "worker %d: %s; it is replaced", (int)link->pid, reason);
    hg_link_end(link);
    count_death(link);
    link->events->died(link);
}

void hg_link_exited(struct hg_link *link, int status)
{
    int pid = (int)link->pid;
    link->pid = 0; // the end of the stream follows and does the rest
    if (WIFSIGNALED(status))
        hg_warn(WORKER, "worker %d was killed by signal %d (%s)", pid, WTERMSIG(status),
            strsignal(WTERMSIG(status)));
    else
        hg_warn(WORKER, "worker %d exited with %d", pid, WEXITSTATUS(status));
}

void hg_link_stop(struct hg_link *link)
{
    pid_t pid = link->pid;
    hg_link_end(link);
    if (pid)
        waitpid(pid, NULL, 0);
}

// ---- time ---------------------------------------------------------------------------------------

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
    } else if (now_ns - link->pulse_ns > o->worker_timeout_ns) {
        hg_link_fail(link, "gives no sign of life (worker-timeout)");
    } else if (link->hang.busy_ns > o->hang_timeout_ns) {
        link->hang.fatal = link->hang.told;
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
    link->pulse_ns = link->loop->now_ns;
    hg_info(WORKER, "worker %d ready after %.0f ms", (int)link->pid,
        (double)(link->loop->now_ns - link->started_ns) * 1e-6);
    link->events->ready(link);
}

// It ends by itself, after this.
static void take_last_words(struct hg_link *link, const struct hgp_error *m)
{
    snprintf(link->last_words, sizeof link->last_words, "%.*s: %.*s", (int)m->where.size,
        m->where.size ? m->where.data : "", (int)m->reason.size,
        m->reason.size ? m->reason.data : "");
    link->no_spill |= m->what.size == 5 && memcmp(m->what.data, "spill", 5) == 0;
    hg_warn(WORKER, "worker: %s%s", link->last_words,
        link->no_spill ? "; large arrays stay in memory from now on" : "");
}

static void take_own(struct hg_link *link, uint16_t type, const union hgp_any *m)
{
    switch (type) {
    case HGP_T_worker_ready:
        take_ready(link);
        return;
    case HGP_T_pulse:
        link->pulse_ns = link->loop->now_ns;
        link->hang.busy_ns = m->pulse.busy_ns;
        link->rss_bytes = m->pulse.rss_bytes;
        link->hang.told &= m->pulse.busy_ns > 0;
        return;
    case HGP_T_busy:
        link->hang = (struct hg_link_hang){.channel = m->busy.channel,
            .request = m->busy.request,
            .view = m->busy.view,
            .told = true};
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
        hg_link_fail(link, "closed its link");
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
