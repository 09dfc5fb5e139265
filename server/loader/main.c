// main.c - helio-loader: reads files of foreign formats for helio-worker, each in a process of its
// own that is thrown away. The process itself is the spawner: it reads no file.
//
// Usage: helio-loader --cpu SECONDS --memory MIB --sandbox MODE [--log LEVELS], with a socket as
// descriptor 3; started by helio-worker, not by people.
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/log.h"
#include "renderer/image/image.h"
#include "server/loader/confine.h"
#include "server/loader/serve.h"
#include "server/loader/wire.h"

enum { LINK_FD = 3, EXIT_USAGE = 2, FIRST = 2 };

struct spawner {
    struct confinement confinement;
    int oom_fd;                                      // of this process; -1 = cannot be written
    char oom_adjusted[8];                            // what it has; "" = not known
    struct pollfd polled[FIRST + LOADERS_AT_A_TIME]; // link, signals, sockets of loaders
    pid_t pids[LOADERS_AT_A_TIME];
    int count;
};

// ---- memory of the machine, or of the control group ---------------------------------------------

static void open_oom(struct spawner *s)
{
    s->oom_fd = open("/proc/self/oom_score_adj", O_RDWR | O_CLOEXEC);
    if (s->oom_fd >= 0 && read(s->oom_fd, s->oom_adjusted, sizeof s->oom_adjusted - 1) <= 0)
        s->oom_adjusted[0] = 0;
}

static void set_oom(const struct spawner *s, const char *text)
{
    if (s->oom_adjusted[0] && pwrite(s->oom_fd, text, strlen(text), 0) < 0)
        hg_debug(SCENE, "oom_score_adj: %s", strerror(errno));
}

// Where memory is short a loader is ended before its worker. It can open no file of its own
// process, so it begins with what this one has for a moment.
static pid_t fork_victim(const struct spawner *s)
{
    set_oom(s, "1000");
    const pid_t pid = fork();
    if (pid != 0)
        set_oom(s, s->oom_adjusted);
    return pid;
}

// ---- loaders -----------------------------------------------------------------------------------

static void reply_spawned(int error, int fd)
{
    struct loader_spawned answer = {error};
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {0};
    struct iovec part = {&answer, sizeof answer};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    if (!error) {
        message.msg_control = control;
        message.msg_controllen = sizeof control;
        struct cmsghdr *head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(sizeof(int));
        memcpy(CMSG_DATA(head), &fd, sizeof fd);
    }
    (void)sendmsg(LINK_FD, &message, MSG_NOSIGNAL);
}

static _Noreturn void become_loader(const struct spawner *s, int fd)
{
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    dup2(fd, LINK_FD);
    close_range(LINK_FD + 1, ~0u, 0); // the link to the worker and the sockets of others
    if (!hg_confine_loader(&s->confinement))
        _exit(LOADER_EXIT_SANDBOX);
    hg_loader_serve(LINK_FD);
}

static void start_loader(struct spawner *s)
{
    int pair[2];
    if (s->count == LOADERS_AT_A_TIME) {
        reply_spawned(EAGAIN, -1);
        return;
    }
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair) != 0) {
        reply_spawned(errno, -1);
        return;
    }
    const pid_t pid = fork_victim(s);
    if (pid == 0)
        become_loader(s, pair[1]);
    if (pid < 0) {
        reply_spawned(ENOMEM, -1);
        close(pair[1]);
    } else {
        reply_spawned(0, pair[0]);
        s->pids[s->count] = pid;
        s->polled[FIRST + s->count++] = (struct pollfd){.fd = pair[1]}; // POLLHUP needs no asking
    }
    close(pair[0]);
}

static void forget(struct spawner *s, int i)
{
    close(s->polled[FIRST + i].fd);
    s->count--;
    s->pids[i] = s->pids[s->count];
    s->polled[FIRST + i] = s->polled[FIRST + s->count];
}

// Tells the worker how loaders ended, if it still listens.
static void reap(struct spawner *s)
{
    int how;
    for (pid_t pid; (pid = waitpid(-1, &how, WNOHANG)) > 0;)
        for (int i = 0; i < s->count; i++)
            if (s->pids[i] == pid) {
                const struct loader_reply reply = {.ended = true, .how = how};
                (void)send(
                    s->polled[FIRST + i].fd, &reply, sizeof reply, MSG_NOSIGNAL | MSG_DONTWAIT);
                forget(s, i);
                break;
            }
}

// ---- loop --------------------------------------------------------------------------------------

static void run(struct spawner *s)
{
    for (;;) {
        if (poll(s->polled, (nfds_t)(FIRST + s->count), -1) < 0 && errno != EINTR)
            return;
        for (int i = 0; i < s->count; i++)
            if (s->polled[FIRST + i].revents & (POLLHUP | POLLERR)) {
                kill(s->pids[i], SIGKILL); // the worker has no use for it any more
                s->polled[FIRST + i].events = 0;
            }
        if (s->polled[1].revents & POLLIN) {
            struct signalfd_siginfo info;
            (void)!read(s->polled[1].fd, &info, sizeof info);
        }
        reap(s);
        char byte;
        if (s->polled[0].revents & POLLIN && recv(LINK_FD, &byte, 1, 0) == 1)
            start_loader(s);
        else if (s->polled[0].revents & (POLLIN | POLLHUP | POLLERR))
            return;
    }
}

static bool parse_options(struct spawner *s, int argc, char **argv)
{
    static const struct option options[] = {{"cpu", required_argument, NULL, 'c'},
        {"memory", required_argument, NULL, 'm'}, {"sandbox", required_argument, NULL, 'n'},
        {"log", required_argument, NULL, 'l'}, {0}};
    struct hg_error err = {0};
    for (int option; (option = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (option == 'c')
            s->confinement.cpu_s = (uint32_t)strtoul(optarg, NULL, 10);
        else if (option == 'm')
            s->confinement.memory_bytes = strtoull(optarg, NULL, 10) << 20;
        else if (option == 'n')
            s->confinement.off = strcmp(optarg, "off") == 0,
            s->confinement.required = strcmp(optarg, "require") == 0;
        else if (option != 'l' || hg_log_configure(optarg, &err) != HG_OK)
            return false;
    }
    return optind == argc && s->confinement.cpu_s && s->confinement.memory_bytes;
}

int main(int argc, char **argv)
{
    struct spawner s = {0};
    struct stat st;
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    if (!parse_options(&s, argc, argv) || fstat(LINK_FD, &st) != 0 || !S_ISSOCK(st.st_mode)) {
        fprintf(stderr, "helio-loader: started by helio-worker, not by people\n");
        return EXIT_USAGE;
    }
    sigset_t child;
    sigemptyset(&child);
    sigaddset(&child, SIGCHLD);
    sigprocmask(SIG_BLOCK, &child, NULL);
    s.polled[0] = (struct pollfd){.fd = LINK_FD, .events = POLLIN};
    s.polled[1] =
        (struct pollfd){.fd = signalfd(-1, &child, SFD_CLOEXEC | SFD_NONBLOCK), .events = POLLIN};
    open_oom(&s);
    struct hg_error err = {0};
    if (hg_image_load_module(&err) != HG_OK) // readers of other formats work all the same
        hg_fault(SCENE, err.status, "%s", err.reason);
    if (!hg_confine_spawner(&s.confinement)) {
        hg_fault(
            SCENE, HG_E_UNSUPPORTED, "loaders cannot be confined: this kernel has no Landlock");
        return LOADER_EXIT_SANDBOX;
    }
    run(&s);
    return 0; // loaders that are left end with this process
}
