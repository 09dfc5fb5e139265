// serve.c - helio serve: a private daemon on loopback with one scene, and the address of a page
// that shows it.
#include <arpa/inet.h>
#include <errno.h>
#include <ftw.h>
#include <netdb.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/program.h"
#include "base/sha256.h"
#include "client/cli/cli.h"

static const uint64_t START_NS = UINT64_C(20000000000);
static const uint64_t WAIT_NS = UINT64_C(20000000);
static const uint64_t LOOK_NS = UINT64_C(250000000); // how often the daemon is looked after
static const uint64_t STOP_NS = UINT64_C(5000000000);

enum { SECRET_BYTES = 24, SECRET_TEXT = 2 * SECRET_BYTES + 1, FIRST_SOCKET = 3 };

struct serve {
    struct hg_cli cli;
    const struct hg_cli_options *o;
    struct hg_cli_args args;
    char folder[64]; // of the tokens; "" until it is there
    char program[4096];
    int fd;    // listening; -1
    pid_t pid; // of the daemon; 0
    uint16_t port;
    char owner[SECRET_TEXT], guest[SECRET_TEXT]; // tokens
    char scene[128], host[256], page[1024];
};

// ---- the socket
// ----------------------------------------------------------------------------------

static const char *listen_host(const struct serve *s)
{
    return s->o->has_listen ? s->o->listen : "127.0.0.1";
}

static bool is_loopback(const struct sockaddr *name)
{
    if (name->sa_family == AF_INET)
        return ntohl(((const struct sockaddr_in *)name)->sin_addr.s_addr) >> 24 == 127;
    return IN6_IS_ADDR_LOOPBACK(&((const struct sockaddr_in6 *)name)->sin6_addr);
}

static bool is_any(const struct sockaddr *name)
{
    if (name->sa_family == AF_INET)
        return ((const struct sockaddr_in *)name)->sin_addr.s_addr == htonl(INADDR_ANY);
    return IN6_IS_ADDR_UNSPECIFIED(&((const struct sockaddr_in6 *)name)->sin6_addr);
}

// Port and host as others write them.
static void take_names(struct serve *s, const struct sockaddr *name)
{
    char text[INET6_ADDRSTRLEN] = "";
    const bool is_six = name->sa_family == AF_INET6;
    const void *address = is_six ? (const void *)&((const struct sockaddr_in6 *)name)->sin6_addr
                                 : (const void *)&((const struct sockaddr_in *)name)->sin_addr;
    s->port = ntohs(is_six ? ((const struct sockaddr_in6 *)name)->sin6_port
                           : ((const struct sockaddr_in *)name)->sin_port);
    inet_ntop(name->sa_family, address, text, sizeof text);
    if (is_any(name) && gethostname(s->host, sizeof s->host - 1) == 0)
        return;
    snprintf(s->host, sizeof s->host, is_six ? "[%s]" : "%s", text);
}

static enum hg_status try_listen(struct serve *s, const struct addrinfo *at, struct hg_error *err)
{
    const int yes = 1;
    struct sockaddr_storage name = {0};
    socklen_t size = sizeof name;
    s->fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (s->fd >= 0 && setsockopt(s->fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) == 0 &&
        bind(s->fd, at->ai_addr, at->ai_addrlen) == 0 && listen(s->fd, SOMAXCONN) == 0 &&
        getsockname(s->fd, (struct sockaddr *)&name, &size) == 0) {
        take_names(s, (const struct sockaddr *)&name);
        if (!is_loopback((const struct sockaddr *)&name))
            hg_cli_progress_say(&s->cli.progress,
                "%s is reached from other machines, without encryption", listen_host(s));
        return HG_OK;
    }
    const int why = errno;
    if (s->fd >= 0)
        close(s->fd);
    s->fd = -1;
    return hg_error_set(err, why == EACCES ? HG_E_PERM : HG_E_INVAL,
        s->o->has_port ? "--port" : "--listen", NULL, "cannot listen on %s, port %u: %s",
        listen_host(s), s->o->has_port ? s->o->port : 0, strerror(why));
}

static enum hg_status open_socket(struct serve *s, struct hg_error *err)
{
    char port[16];
    const struct addrinfo hints = {
        .ai_flags = AI_PASSIVE | AI_NUMERICSERV, .ai_socktype = SOCK_STREAM};
    struct addrinfo *list = NULL;
    snprintf(port, sizeof port, "%u", s->o->has_port ? s->o->port : 0);
    const int failed = getaddrinfo(listen_host(s), port, &hints, &list);
    if (failed)
        return hg_error_set(
            err, HG_E_INVAL, "--listen", NULL, "'%s': %s", listen_host(s), gai_strerror(failed));
    enum hg_status status = try_listen(s, list, err);
    freeaddrinfo(list);
    return status;
}

// ---- the daemon
// ----------------------------------------------------------------------------------

static enum hg_status make_secret(char text[SECRET_TEXT], struct hg_error *err)
{
    uint8_t bytes[SECRET_BYTES];
    if (getrandom(bytes, sizeof bytes, 0) != (ssize_t)sizeof bytes)
        return hg_error_set(err, HG_E_IO, "token", NULL, "no random numbers: %s", strerror(errno));
    for (size_t i = 0; i < sizeof bytes; i++)
        snprintf(text + 2 * i, 3, "%02x", bytes[i]);
    explicit_bzero(bytes, sizeof bytes);
    return HG_OK;
}

// The file of tokens holds hashes, which are of no use to log in.
static enum hg_status write_tokens(struct serve *s, struct hg_error *err)
{
    uint8_t digest[2][HG_SHA256_BYTES];
    char hex[2][HG_SHA256_HEX], text[512], file[128];
    enum hg_status status = make_secret(s->owner, err);
    if (!status)
        status = make_secret(s->guest, err);
    if (status)
        return status;
    if (hg_sha256(s->owner, strlen(s->owner), digest[0]) ||
        hg_sha256(s->guest, strlen(s->guest), digest[1]))
        return hg_error_set(err, HG_E_NOMEM, "token", NULL, "no memory");
    hg_sha256_hex(digest[0], hex[0]);
    hg_sha256_hex(digest[1], hex[1]);
    const int size = snprintf(text, sizeof text,
        "sha256:%s edit owner tenant=serve\nsha256:%s %s viewer tenant=serve\n", hex[0], hex[1],
        s->o->has_role ? s->o->role : "edit");
    snprintf(file, sizeof file, "%s/tokens", s->folder);
    const mode_t before = umask(077);
    status = hg_file_write_atomic(file, text, (size_t)size, err);
    umask(before);
    return status;
}

static enum hg_status make_folder(struct serve *s, struct hg_error *err)
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    const int length = snprintf(s->folder, sizeof s->folder, "%s/helio-serve-XXXXXX",
        runtime && *runtime == '/' && access(runtime, W_OK) == 0 ? runtime : "/tmp");
    if (length >= (int)sizeof s->folder)
        snprintf(s->folder, sizeof s->folder, "/tmp/helio-serve-XXXXXX");
    if (mkdtemp(s->folder))
        return HG_OK;
    enum hg_status status = hg_error_set(err, hg_status_from_errno(errno), s->folder, NULL,
        "cannot make the folder: %s", strerror(errno));
    s->folder[0] = 0;
    return status;
}

// In the new process: the daemon gets the socket as a service manager would hand it over.
static void become_daemon(const struct serve *s, const char *const *argv)
{
    char pid[16];
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
    signal(SIGHUP, SIG_DFL);
    signal(SIGXFSZ, SIG_DFL);
    setpgid(0, 0); // Ctrl-C is for this command, which ends the daemon
    snprintf(pid, sizeof pid, "%d", (int)getpid());
    if (s->fd == FIRST_SOCKET) // keeps its close-on-exec flag when it is copied onto itself
        dup2(dup(s->fd), FIRST_SOCKET);
    else
        dup2(s->fd, FIRST_SOCKET);
    if (setenv("LISTEN_PID", pid, 1) == 0 && setenv("LISTEN_FDS", "1", 1) == 0)
        execv(s->program, (char *const *)argv);
    fprintf(stderr, "helio: %s: cannot start: %s\n", s->program, strerror(errno));
    _exit(127);
}

static enum hg_status start_daemon(struct serve *s, struct hg_error *err)
{
    char file[128];
    hg_program_path("HELIOD", "../bin/heliod", s->program, sizeof s->program);
    if (access(s->program, X_OK))
        return hg_error_set(
            err, HG_E_WORKER, s->program, NULL, "cannot start: %s", strerror(errno));
    snprintf(file, sizeof file, "%s/tokens", s->folder);
    const char *const own[] = {s->program, "--tokens", file, "--idle-timeout", "0"};
    const size_t own_count = sizeof own / sizeof *own;
    const char **argv = hg_calloc(own_count + s->args.count + 1, sizeof *argv);
    if (!argv)
        return hg_error_set(err, HG_E_NOMEM, s->program, NULL, "no memory for its arguments");
    memcpy(argv, own, sizeof own);
    for (size_t i = 0; i < s->args.count; i++)
        argv[own_count + i] = s->args.items[i];
    fflush(NULL);
    s->pid = fork();
    if (s->pid == 0)
        become_daemon(s, argv);
    hg_free(argv);
    close(s->fd); // the daemon's from here on
    s->fd = -1;
    if (s->pid > 0)
        return HG_OK;
    s->pid = 0;
    return hg_error_set(err, HG_E_NOMEM, s->program, NULL, "cannot start: %s", strerror(errno));
}

static bool has_ended(struct serve *s)
{
    if (s->pid && waitpid(s->pid, NULL, WNOHANG) == 0)
        return false;
    s->pid = 0; // its number may be another process's now
    return true;
}

static enum hg_status connect_own(struct serve *s, struct hg_error *err)
{
    char url[300];
    snprintf(url, sizeof url, "tcp:%s:%u", s->o->has_listen ? s->host : "127.0.0.1", s->port);
    const struct helio_options options = {.url = url,
        .token = s->owner,
        .client = "helio-serve/" HELIO_VERSION,
        .timeout_ns = START_NS,
        .reconnect_ns = START_NS};
    const uint64_t until_ns = hg_clock_now_ns() + START_NS;
    enum hg_status status;
    while ((status = helio_connect(&options, &s->cli.h, err)) == HG_E_CLOSED &&
           hg_clock_now_ns() < until_ns && !has_ended(s) && !hg_cli_is_stopped())
        hg_clock_sleep_ns(WAIT_NS);
    if (status)
        return !s->pid ? hg_error_set(err, HG_E_WORKER, s->program, NULL,
                             "ended before it could be reached; its message is above")
                       : status;
    hg_cli_attach(&s->cli);
    return HG_OK;
}

static int remove_one(const char *path, const struct stat *st, int kind, struct FTW *at)
{
    (void)st;
    (void)kind;
    (void)at;
    return remove(path);
}

static void stop_daemon(struct serve *s)
{
    const uint64_t until_ns = hg_clock_now_ns() + STOP_NS;
    if (s->pid) {
        kill(s->pid, SIGTERM);
        hg_clock_sleep_ns(WAIT_NS);
    }
    if (s->pid && !has_ended(s))
        kill(s->pid, SIGTERM); // the second one does not wait for clients
    while (s->pid && !has_ended(s)) {
        if (hg_clock_now_ns() > until_ns)
            kill(s->pid, SIGKILL);
        hg_clock_sleep_ns(WAIT_NS);
    }
    if (s->folder[0])
        nftw(s->folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

// ---- the scene and its page
// ----------------------------------------------------------------------

// The file's name in letters that an address shows as they are.
static void name_scene(struct serve *s)
{
    const char *base = strrchr(s->o->args[0], '/');
    base = base ? base + 1 : s->o->args[0];
    size_t n = 0;
    for (const char *c = base; *c && n < 64; c++) {
        const bool plain = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') ||
                           (*c >= '0' && *c <= '9') || *c == '-' || *c == '.';
        if (*c == ':' && !c[1]) // demo:
            break;
        s->scene[n++] = plain ? *c : '_';
    }
    s->scene[n] = 0;
}

static enum hg_status load_scene(struct serve *s, struct hg_error *err)
{
    char *path = NULL;
    name_scene(s);
    s->cli.embedded = true; // paths are made absolute, as for a private worker
    enum hg_status status = hg_cli_server_path(&s->cli, s->o->args[0], &path, err);
    s->cli.embedded = false;
    if (!status)
        status = helio_scene_open(s->cli.h, s->scene, &s->cli.scene, err);
    struct hgp_asset_load load = {.asset = s->cli.scene.first_id};
    if (!status && s->o->has_up) {
        load.has_up = true;
        status = hg_cli_parse_up("--up", s->o->up, &load.up, err);
    }
    if (!status && s->o->has_point_size)
        status = hg_cli_parse_point_size("--point-size", s->o->point_size, &load, err);
    if (!status) {
        hg_cli_progress_stage(&s->cli.progress, "loading");
        load.path = hgp_str_make(path);
        status = helio_call_for(s->cli.h, HGP_T_asset_load, &load, HGP_T_asset_loaded, NULL, err);
    }
    hg_cli_progress_warnings(&s->cli.progress);
    hg_free(path);
    return status;
}

// Opens the page by way of a file that only this user may read: all users see arguments.
static void open_browser(struct serve *s)
{
    char file[128], text[1400];
    struct hg_error err = {0};
    snprintf(file, sizeof file, "%s/open.html", s->folder);
    const int size = snprintf(text, sizeof text,
        "<!DOCTYPE html><meta http-equiv=\"refresh\" content=\"0; url=%s\">\n", s->page);
    const mode_t before = umask(077);
    const enum hg_status status = hg_file_write_atomic(file, text, (size_t)size, &err);
    umask(before);
    const pid_t pid = status ? -1 : fork();
    if (pid == 0) {
        setpgid(0, 0);
        execlp("xdg-open", "xdg-open", file, (char *)NULL);
        _exit(127);
    }
    int result = 0;
    if (pid < 0 || waitpid(pid, &result, 0) < 0 || !WIFEXITED(result) || WEXITSTATUS(result))
        hg_cli_progress_say(&s->cli.progress, "no browser could be opened (xdg-open)");
}

static void show_page(struct serve *s)
{
    snprintf(s->page, sizeof s->page, "http://%s:%u/#scene=%s&ticket=%s", s->host, s->port,
        s->scene, s->guest);
    hg_cli_progress_clear(&s->cli.progress);
    printf("%s\n", s->page);
    fflush(stdout);
    hg_cli_progress_say(&s->cli.progress, "open this address in browsers; Ctrl-C ends it");
    if (s->o->has_open)
        open_browser(s);
}

// Holds the scene until Ctrl-C, or until the daemon ends.
static enum hg_status hold(struct serve *s, struct hg_error *err)
{
    while (!hg_cli_is_stopped()) {
        enum hg_status status = helio_wait(s->cli.h, LOOK_NS, err);
        if (hg_cli_is_stopped())
            break;
        if (has_ended(s))
            return hg_error_set(err, HG_E_WORKER, s->program, NULL, "the daemon has ended");
        if (status && status != HG_E_TIMEOUT)
            return status;
        struct helio_message *message;
        struct hg_error unused;
        while (helio_next(s->cli.h, &message, &unused) == HG_OK)
            helio_message_free(message);
    }
    return HG_OK;
}

enum hg_cli_exit hg_cli_serve(const struct hg_cli_options *options)
{
    struct serve s = {.o = options, .fd = -1};
    struct hg_error err = {0};
    enum hg_cli_doing doing = HG_CLI_DOING_ARGUMENTS;
    hg_cli_init(&s.cli, options);
    const struct hg_cli_texts files = {.items = {options->args[0]}, .count = 1};
    enum hg_status status = hg_cli_args_make(&s.args, options, &files, &err);
    if (!status)
        status = open_socket(&s, &err);
    if (!status)
        status = make_folder(&s, &err);
    if (!status)
        status = write_tokens(&s, &err);
    if (!status) {
        doing = HG_CLI_DOING_CONNECT;
        status = start_daemon(&s, &err);
    }
    if (!status)
        status = connect_own(&s, &err);
    if (!status) {
        doing = HG_CLI_DOING_INPUT;
        status = load_scene(&s, &err);
    }
    if (!status) {
        doing = HG_CLI_DOING_RENDER;
        show_page(&s);
        status = hold(&s, &err);
    }
    const enum hg_cli_exit code = status ? hg_cli_report(&s.cli, doing, &err) : HG_CLI_EXIT_OK;
    hg_cli_finish(&s.cli, code);
    stop_daemon(&s);
    if (s.fd >= 0)
        close(s.fd);
    hg_cli_args_finish(&s.args);
    explicit_bzero(&s, sizeof s);
    return code;
}
