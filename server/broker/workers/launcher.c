#include "server/broker/workers/launcher.h"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/slice.h"
#include "server/broker/workers/confine.h"

enum { PATHS_MAX = 256, STEP_BYTES = 120, LOG_BYTES = 512, PATIENCE_S = 10 };
enum { SOCKET_FD = 3, WORKER_FD = 3, SEED_NICE = 19 };

// Its number, where the process is a launcher, and the folder that the daemon keeps its cache in.
static const char process_name[] = "HELIOD_LAUNCHER";
// In place of a request, of whatever version: become the program that is on the disk now.
static const char renew_message = 'R';

// To the launcher, with the worker's end of the link.
struct request {
    uint64_t memory_bytes;
    uint32_t serial;
    uint32_t number;
    struct hg_cgroup group; // workers have theirs below it
    bool has_home, has_fd, no_spill, warm_up, seed;
    char log[LOG_BYTES];
};

// From the new process before its program starts, and to the daemon.
struct answer {
    uint32_t serial; // of the request
    pid_t pid;
    int failed;            // errno of the last try
    uint32_t level;        // what it was started with
    char step[STEP_BYTES]; // of a try with more; "" = none failed
    int step_failed;
};

// ---- the new process ----------------------------------------------------------------------------

struct plan {
    struct hg_confine_path paths[PATHS_MAX];
    size_t count;
    bool impossible; // a folder is the root of all
};

static void add_path(struct plan *plan, const char *path, enum hg_confine_access access)
{
    if (!path || path[0] != '/')
        return;
    plan->impossible |= !path[1] || plan->count == PATHS_MAX;
    if (!plan->impossible)
        plan->paths[plan->count++] = (struct hg_confine_path){path, access};
}

// Libraries that the environment names are where it says; `text` is cut up.
static void add_variable(struct plan *plan, const char *name)
{
    const char *value = getenv(name);
    char *text = value ? hg_strdup(value) : NULL; // as long as the process
    for (char *word = text ? strtok(text, ": ") : NULL; word; word = strtok(NULL, ": "))
        add_path(plan, word, HG_CONFINE_READ);
}

static void plan_paths(
    struct plan *plan, const struct hg_worker_start *start, const struct hg_worker_arguments *a)
{
    const struct hg_options *o = start->options;
    static char program[HG_HOME_PATH];
    snprintf(program, sizeof program, "%s", a->program);
    char *slash = strrchr(program, '/');
    if (slash)
        *slash = 0;
    add_path(plan, program, HG_CONFINE_READ);
    add_variable(plan, "LD_LIBRARY_PATH");
    add_variable(plan, "LD_PRELOAD");
    for (size_t i = 0; i < o->asset_root.count && !start->seed; i++)
        add_path(plan, o->asset_root.items[i], HG_CONFINE_READ);
    add_path(plan, o->shader_dir, HG_CONFINE_READ);
    add_path(plan, a->seed, HG_CONFINE_READ);
    add_path(plan, a->upload_dir, HG_CONFINE_READ);
    add_path(plan, a->cache_dir, HG_CONFINE_WRITE);
    const char *shaders = a->upload_dir[0] || start->seed ? NULL : getenv("MESA_SHADER_CACHE_DIR");
    if (shaders && (mkdir(shaders, 0700) == 0 || errno == EEXIST))
        add_path(plan, shaders, HG_CONFINE_WRITE);
}

static void say(int fd, int failed, const char *step)
{
    struct answer answer = {.failed = failed};
    snprintf(answer.step, sizeof answer.step, "%s", step);
    if (write(fd, &answer, sizeof answer) != (ssize_t)sizeof answer)
        _exit(126);
}

// Descriptors: nothing to read, our stderr, the link.
static void set_descriptors(int link, int report)
{
    const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (null >= 0)
        dup2(null, 0);
    // `report` goes above the link's number and is closed by exec.
    const int kept = fcntl(report, F_DUPFD_CLOEXEC, WORKER_FD + 1);
    if (link >= 0)
        dup2(link, WORKER_FD);
    dup2(kept, WORKER_FD + 1);
    fcntl(WORKER_FD + 1, F_SETFD, FD_CLOEXEC);
    if (link < 0)
        close(WORKER_FD);
    close_range(WORKER_FD + 2, ~0u, 0);
}

static void reset_signals(void)
{
    sigset_t none;
    for (int number = 1; number < NSIG; number++)
        signal(number, SIG_DFL);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
}

// Never returns. Failures are sent to `report`, which a program that starts closes.
static void become_worker(const struct hg_worker_start *start, enum hg_confine_level level,
    uid_t uid, gid_t gid, int report)
{
    static struct hg_worker_arguments arguments;
    static struct plan plan;
    const char *step = "start the worker's program";
    int failed = hg_worker_arguments_make(&arguments, start);
    char *program = realpath(arguments.program, NULL);
    if (program)
        snprintf(arguments.program, sizeof arguments.program, "%s", program);
    setpgid(0, 0); // a ^C is for the daemon, which drains
    reset_signals();
    set_descriptors(start->fd, report);
    report = WORKER_FD + 1;
    hg_worker_process_make_first_victim();
    const int nice = getpriority(PRIO_PROCESS, 0) + (int)start->options->worker_nice;
    setpriority(PRIO_PROCESS, 0, start->seed ? SEED_NICE : nice); // no client waits for a seed
    plan_paths(&plan, start, &arguments);
    if (!failed && plan.impossible && level != HG_CONFINE_NONE) {
        step = "leave out the root";
        failed = EINVAL;
    }
    if (!failed)
        failed = hg_confine_enter(level, plan.paths, plan.count, uid, gid, &step);
    if (!failed) {
        step = "start the worker's program";
        execve(arguments.program, arguments.items, arguments.variables);
        failed = errno;
    }
    say(report, failed, step);
    _exit(127);
}

// ---- the launcher -------------------------------------------------------------------------------

// 0, or what the new process said. `answer`->pid is it.
static int try_level(
    const struct hg_worker_start *start, enum hg_confine_level level, struct answer *answer)
{
    int report[2];
    struct answer said = {0};
    const uid_t uid = geteuid();
    const gid_t gid = getegid();
    if (pipe2(report, O_CLOEXEC) != 0)
        return errno;
    const pid_t pid =
        (pid_t)syscall(SYS_clone, hg_confine_clone_flags(level) | SIGCHLD, NULL, NULL, NULL, NULL);
    if (pid == 0)
        become_worker(start, level, uid, gid, report[1]);
    int failed = pid < 0 ? errno : 0;
    snprintf(answer->step, sizeof answer->step, "%s", failed ? "make namespaces" : "");
    close(report[1]);
    if (!failed && read(report[0], &said, sizeof said) == (ssize_t)sizeof said) {
        failed = said.failed ? said.failed : EIO;
        memcpy(answer->step, said.step, sizeof answer->step);
        waitpid(pid, NULL, 0);
    }
    close(report[0]);
    answer->pid = failed ? 0 : pid;
    return failed;
}

// A folder that does not exist keeps its name: the worker says what is wrong with it.
static void make_real(char **path)
{
    char *real = *path ? realpath(*path, NULL) : NULL;
    char *copy = real ? hg_strdup(real) : NULL;
    free(real);
    if (!copy)
        return;
    hg_free(*path);
    *path = copy;
}

// Names without links, as the new process sees folders by their names alone.
static void make_all_real(struct hg_options *o)
{
    for (size_t i = 0; i < o->asset_root.count; i++)
        make_real(&o->asset_root.items[i]);
    make_real(&o->shader_dir);
    make_real(&o->cache_dir);
    make_real(&o->worker);
}

// The process between: with as much as the kernel allows. The files in /proc/self of one that has
// changed its user could not be written otherwise (PR_SET_DUMPABLE).
static void start_worker(const struct request *request, struct hg_options *o, int link, int out)
{
    struct answer answer = {.serial = request->serial}, first = {0};
    int level = strcmp(o->sandbox, "off") == 0 ? HG_CONFINE_NONE : HG_CONFINE_ALL;
    make_all_real(o);
    const struct hg_homes homes = {.cache_dir = o->cache_dir};
    const struct hg_home home = {
        .homes = request->has_home ? &homes : NULL, .number = request->number};
    const struct hg_worker_start start = {.options = o,
        .home = &home,
        .fd = request->has_fd ? link : -1,
        .memory_bytes = request->memory_bytes,
        .no_spill = request->no_spill,
        .warm_up = request->warm_up,
        .seed = request->seed};
    prctl(PR_SET_DUMPABLE, 1, 0, 0, 0);
    if (request->has_fd) // with all that it starts itself
        hg_cgroup_enter(&request->group, request->number, getpid());
    for (;; level--) {
        answer.failed = try_level(&start, (enum hg_confine_level)level, &answer);
        if (!answer.failed || level == HG_CONFINE_NONE)
            break;
        if (!first.step[0]) {
            first = answer;
            first.step_failed = answer.failed;
        }
    }
    answer.level = (uint32_t)level;
    memcpy(answer.step, first.step, sizeof answer.step);
    answer.step_failed = first.step_failed;
    _exit(write(out, &answer, sizeof answer) == (ssize_t)sizeof answer ? 0 : 1);
}

static ssize_t receive(int fd, struct request *request, int *link)
{
    union {
        char bytes[CMSG_SPACE(sizeof(int))];
        struct cmsghdr align;
    } control;
    struct iovec part = {request, sizeof *request};
    struct msghdr message = {.msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control.bytes,
        .msg_controllen = sizeof control.bytes};
    ssize_t got;
    *link = -1;
    do
        got = recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
    while (got < 0 && errno == EINTR);
    struct cmsghdr *c = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    if (c && c->cmsg_type == SCM_RIGHTS)
        memcpy(link, CMSG_DATA(c), sizeof *link);
    return got;
}

static void become_new_program(const struct hg_options *o, char *const *argv)
{
    char text[HG_HOME_PATH + 16];
    snprintf(text, sizeof text, "%d:%s", (int)getpid(), o->cache_dir);
    setenv(process_name, text, 1);
    fcntl(SOCKET_FD, F_SETFD, 0);
    execvp(argv[0], argv);
    unsetenv(process_name); // it goes on as it is
    fcntl(SOCKET_FD, F_SETFD, FD_CLOEXEC);
}

// Makes a worker by way of a process that ends at once. One that ended early has answered nothing.
static bool spawn(const struct request *request, struct hg_options *o, int link)
{
    struct answer answer = {.serial = request->serial};
    int status = 0;
    const pid_t between = fork();
    if (between == 0)
        start_worker(request, o, link, SOCKET_FD);
    if (between < 0)
        answer.failed = errno;
    else if (waitpid(between, &status, 0) == between && status != 0)
        answer.failed = ECHILD;
    return !answer.failed || write(SOCKET_FD, &answer, sizeof answer) == (ssize_t)sizeof answer;
}

static void serve(const struct hg_options *options, char *const *argv)
{
    struct request request;
    struct hg_options o = *options;
    ssize_t got;
    for (int link; (got = receive(SOCKET_FD, &request, &link)) > 0;) {
        if (got == sizeof renew_message) {
            become_new_program(&o, argv);
            continue;
        }
        if (got != (ssize_t)sizeof request)
            break;
        request.log[LOG_BYTES - 1] = 0;
        o.log = request.log[0] ? request.log : NULL;
        if (!spawn(&request, &o, link))
            break;
        if (link >= 0)
            close(link);
    }
    _exit(0); // the daemon is gone
}

static void run_launcher(const struct hg_options *options, char *const *argv)
{
    fcntl(SOCKET_FD, F_SETFD, FD_CLOEXEC);
    close_range(SOCKET_FD + 1, ~0u, 0);
    setpgid(0, 0);
    hg_slice_set(0); // a daemon that took over has its predecessor's, which is not for workers
    signal(SIGINT, SIG_IGN); // it ends with the daemon's end of the socket
    signal(SIGTERM, SIG_IGN);
    prctl(PR_SET_NAME, "heliod-launch", 0, 0, 0);
    serve(options, argv);
}

void hg_launcher_continue(const struct hg_options *options, char *const *argv)
{
    const char *text = getenv(process_name);
    const char *folder = text ? strchr(text, ':') : NULL;
    struct hg_options o = *options; // as long as the process
    const bool is_launcher = text && atoi(text) == (int)getpid();
    if (is_launcher && folder)
        o.cache_dir = hg_strdup(folder + 1);
    unsetenv(process_name);
    if (is_launcher && o.cache_dir)
        run_launcher(&o, argv);
    if (is_launcher)
        _exit(1); // no memory
}

// ---- the daemon ---------------------------------------------------------------------------------

enum hg_status hg_launcher_start(struct hg_launcher *launcher, const struct hg_options *options,
    char *const *argv, const struct hg_cgroup *group, struct hg_error *err)
{
    int pair[2];
    *launcher = (struct hg_launcher){.fd = -1, .group = group};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair) != 0)
        return hg_error_set(
            err, HG_E_LIMIT, "launcher", NULL, "cannot make a socketpair: %s", strerror(errno));
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0);
    launcher->pid = fork();
    const int failed = errno;
    if (launcher->pid == 0) {
        dup2(pair[1], SOCKET_FD);
        run_launcher(options, argv);
    }
    close(pair[1]);
    launcher->fd = pair[0];
    const struct timeval patience = {.tv_sec = PATIENCE_S};
    setsockopt(launcher->fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return launcher->pid > 0 ? HG_OK
                             : hg_error_set(err, HG_E_LIMIT, "launcher", NULL, "cannot fork: %s",
                                   strerror(failed));
}

void hg_launcher_keep_open(const struct hg_launcher *launcher)
{
    fcntl(launcher->fd, F_SETFD, 0);
}

bool hg_launcher_adopt(struct hg_launcher *launcher, const struct hg_cgroup *group)
{
    launcher->group = group;
    if (launcher->fd < 0)
        return false;
    fcntl(launcher->fd, F_SETFD, FD_CLOEXEC);
    if (send(launcher->fd, &renew_message, sizeof renew_message, MSG_NOSIGNAL) ==
        sizeof renew_message)
        return true;
    close(launcher->fd);
    *launcher = (struct hg_launcher){.fd = -1};
    return false;
}

void hg_launcher_stop(struct hg_launcher *launcher)
{
    if (launcher->fd >= 0)
        close(launcher->fd);
    if (launcher->pid > 0)
        waitpid(launcher->pid, NULL, 0);
    *launcher = (struct hg_launcher){.fd = -1};
}

static bool send_request(int fd, const struct request *request, int link)
{
    union {
        char bytes[CMSG_SPACE(sizeof(int))];
        struct cmsghdr align;
    } control = {{0}};
    struct iovec part = {(void *)request, sizeof *request};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    if (link >= 0) {
        message.msg_control = control.bytes;
        message.msg_controllen = sizeof control.bytes;
        struct cmsghdr *c = CMSG_FIRSTHDR(&message);
        c->cmsg_level = SOL_SOCKET;
        c->cmsg_type = SCM_RIGHTS;
        c->cmsg_len = CMSG_LEN(sizeof link);
        memcpy(CMSG_DATA(c), &link, sizeof link);
    }
    return sendmsg(fd, &message, MSG_NOSIGNAL) == (ssize_t)sizeof *request;
}

static void log_confinement(const struct answer *answer)
{
    static const char *const levels[] = {[HG_CONFINE_NONE] = "no namespaces",
        [HG_CONFINE_FILES] = "namespaces, but none for processes",
        [HG_CONFINE_ALL] = "namespaces for users, files, network, IPC and processes"};
    static bool logged;
    if (logged || answer->level >= HG_CONFINE_LEVELS)
        return;
    logged = true;
    if (answer->step[0])
        hg_warn(WORKER, "workers have %s: the system does not allow more (%s: %s)",
            levels[answer->level], answer->step, strerror(answer->step_failed));
    else
        hg_info(WORKER, "workers have %s", levels[answer->level]);
}

int hg_launcher_run(struct hg_launcher *launcher, const struct hg_worker_start *start, pid_t *pid)
{
    struct request request = {.memory_bytes = start->memory_bytes,
        .serial = ++launcher->last_serial,
        .number = start->home ? start->home->number : 0,
        .group = *launcher->group,
        .has_home = start->home && start->home->homes,
        .has_fd = start->fd >= 0,
        .no_spill = start->no_spill,
        .warm_up = start->warm_up,
        .seed = start->seed};
    struct answer answer;
    *pid = 0;
    snprintf(request.log, sizeof request.log, "%s", start->options->log ? start->options->log : "");
    while (recv(launcher->fd, &answer, sizeof answer, MSG_DONTWAIT) > 0)
        ; // of a request whose answer came too late
    if (!send_request(launcher->fd, &request, start->fd))
        return errno;
    ssize_t got;
    do // a worker of which nothing was heard in time ends by itself: its link is closed
        got = recv(launcher->fd, &answer, sizeof answer, 0);
    while (got == (ssize_t)sizeof answer && answer.serial != request.serial);
    if (got != (ssize_t)sizeof answer)
        return got < 0 ? errno : ECONNRESET;
    answer.step[STEP_BYTES - 1] = 0;
    if (!answer.failed) {
        *pid = answer.pid;
        log_confinement(&answer);
    }
    return answer.failed;
}
