#include "client/cli/render/claim.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/cond.h"
#include "base/file.h"

enum { TRIES = 16, SETTLE_S = 1 };

#define SECOND_NS UINT64_C(1000000000)

static const char boot_id[] = "/proc/sys/kernel/random/boot_id";

// ---- owners ------------------------------------------------------------------------------------

struct owner {
    char host[64], nonce[20], boot[40];
    int pid;
};

// Without an id of its boot a machine is as any other one.
static void name_self(char self[HG_CLI_CLAIM_OWNER_BYTES])
{
    struct owner me = {.boot = "-", .pid = (int)getpid()};
    uint64_t nonce = hg_clock_now_ns();
    FILE *in = fopen(boot_id, "re");
    if (gethostname(me.host, sizeof me.host - 1) != 0 || !me.host[0])
        snprintf(me.host, sizeof me.host, "localhost");
    if (getrandom(&nonce, sizeof nonce, 0) < 0)
        nonce ^= (uint64_t)me.pid << 32;
    if (in && fscanf(in, "%39s", me.boot) != 1)
        snprintf(me.boot, sizeof me.boot, "-");
    if (in)
        fclose(in);
    snprintf(self, HG_CLI_CLAIM_OWNER_BYTES, "%s %d %016llx %s\n", me.host, me.pid,
        (unsigned long long)nonce, me.boot);
}

// False: it is not written yet, or no claim at all.
static bool read_owner(int fd, char text[HG_CLI_CLAIM_OWNER_BYTES], struct owner *out)
{
    const ssize_t n = pread(fd, text, HG_CLI_CLAIM_OWNER_BYTES - 1, 0);
    text[n > 0 ? n : 0] = 0;
    return sscanf(text, "%63s %d %19s %39s", out->host, &out->pid, out->nonce, out->boot) == 4;
}

static bool is_same_machine(const struct hg_cli_claims *c, const struct owner *other)
{
    const char *boot = strrchr(c->self, ' ') + 1;
    return strlen(other->boot) > 1 && strncmp(boot, other->boot, strlen(other->boot)) == 0;
}

static bool write_self(const struct hg_cli_claims *c, int fd)
{
    const size_t length = strlen(c->self);
    return ftruncate(fd, 0) == 0 && pwrite(fd, c->self, length, 0) == (ssize_t)length &&
           fsync(fd) == 0;
}

// ---- renewing ----------------------------------------------------------------------------------

static void *renew(void *user)
{
    struct hg_cli_claims *c = user;
    pthread_mutex_lock(&c->lock);
    while (!c->is_ending) {
        hg_cond_wait(&c->wake, &c->lock, hg_clock_now_ns() + HG_CLI_CLAIM_RENEW_S * SECOND_NS);
        if (c->fd >= 0)
            futimens(c->fd, NULL);
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

enum hg_status hg_cli_claims_init(struct hg_cli_claims *c, struct hg_error *err)
{
    sigset_t all, before;
    *c = (struct hg_cli_claims){.fd = -1};
    name_self(c->self);
    pthread_mutex_init(&c->lock, NULL);
    hg_cond_init(&c->wake);
    sigfillset(&all); // signals are for the thread that renders
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const int failed = pthread_create(&c->renewer, NULL, renew, c);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!failed)
        return HG_OK;
    c->is_ending = true;
    hg_cli_claims_finish(c);
    return hg_error_set(err, HG_E_NOMEM, "--claim", NULL, "no thread to renew claims with");
}

void hg_cli_claims_finish(struct hg_cli_claims *c)
{
    if (!c->self[0])
        return;
    hg_cli_claim_release(c);
    pthread_mutex_lock(&c->lock);
    const bool runs = !c->is_ending;
    c->is_ending = true;
    pthread_cond_signal(&c->wake);
    pthread_mutex_unlock(&c->lock);
    if (runs)
        pthread_join(c->renewer, NULL);
    pthread_cond_destroy(&c->wake);
    pthread_mutex_destroy(&c->lock);
    c->self[0] = 0;
}

// ---- taking ------------------------------------------------------------------------------------

static void hold(struct hg_cli_claims *c, int fd)
{
    pthread_mutex_lock(&c->lock);
    c->fd = fd;
    pthread_mutex_unlock(&c->lock);
}

static bool is_at(const char *path, int fd)
{
    struct stat named, open_file;
    return stat(path, &named) == 0 && fstat(fd, &open_file) == 0 &&
           named.st_dev == open_file.st_dev && named.st_ino == open_file.st_ino;
}

// Reopens the file, so that a network file system shows what other machines wrote.
static bool is_ours(const struct hg_cli_claims *c)
{
    char text[HG_CLI_CLAIM_OWNER_BYTES];
    struct owner owner;
    const int fd = open(c->path, O_RDONLY | O_CLOEXEC);
    const bool ours = fd >= 0 && read_owner(fd, text, &owner) && strcmp(text, c->self) == 0;
    if (fd >= 0)
        close(fd);
    return ours;
}

// The lease of a claim that is not renewed ends, soon where no name was ever written; by this
// machine's clock, as those of others differ.
static bool has_expired(int fd, struct hg_cli_claim_seen *seen)
{
    struct stat st;
    if (fstat(fd, &st) != 0)
        return false;
    const int64_t renewed_ns = (int64_t)st.st_mtim.tv_sec * (int64_t)SECOND_NS + st.st_mtim.tv_nsec;
    const uint64_t now_ns = hg_clock_now_ns();
    if (!seen->since_ns || seen->renewed_ns != renewed_ns)
        *seen = (struct hg_cli_claim_seen){renewed_ns, now_ns};
    const uint64_t lease_s = st.st_size ? HG_CLI_CLAIM_LEASE_S : HG_CLI_CLAIM_EMPTY_S;
    return now_ns - seen->since_ns >= lease_s * SECOND_NS;
}

// Two machines that see no locks of each other may take a dead one's claim at once: the one that
// wrote its name last has it.
static bool is_settled(const struct hg_cli_claims *c)
{
    nanosleep(&(struct timespec){.tv_sec = SETTLE_S}, NULL);
    return is_ours(c);
}

// The claim of a process that may be dead, which keeps its file: `fd` is closed unless it is held.
static enum hg_status take_over(struct hg_cli_claims *c, int fd, struct hg_cli_claim_seen *seen,
    bool *held, char *who, struct hg_error *err)
{
    char text[HG_CLI_CLAIM_OWNER_BYTES];
    struct owner owner = {.host = "another process"};
    const bool is_named = read_owner(fd, text, &owner);
    const bool is_expired = has_expired(fd, seen); // also notes when it was seen
    const bool is_locked = flock(fd, LOCK_EX | LOCK_NB) == 0;
    const bool is_free = is_locked || (errno != EWOULDBLOCK && errno != EINTR); // no locks here
    const bool is_local = is_named && is_locked && is_same_machine(c, &owner);
    enum hg_status status = HG_OK;
    if (is_free && (is_local || is_expired) && is_at(c->path, fd)) {
        *held = write_self(c, fd);
        if (!*held)
            status = hg_error_set(err, hg_status_from_errno(errno), c->path, NULL,
                "cannot write: %s", strerror(errno));
        else if (!is_local)
            *held = is_settled(c);
    }
    if (is_named)
        snprintf(who, HG_CLI_CLAIM_OWNER_BYTES, "%s, process %d", owner.host, owner.pid);
    else
        snprintf(who, HG_CLI_CLAIM_OWNER_BYTES, "%s", owner.host);
    if (*held)
        hold(c, fd);
    else
        close(fd);
    return status;
}

static bool is_empty(int fd)
{
    struct stat st;
    return fstat(fd, &st) == 0 && st.st_size == 0;
}

// A file that was not there. Its lock is there before its text is, so an unlocked one with a text
// is a dead process's. Not held: this process was so slow that another one has taken it over.
static enum hg_status begin_claim(struct hg_cli_claims *c, int fd, bool *held, struct hg_error *err)
{
    while (flock(fd, LOCK_EX) != 0 && errno == EINTR)
        ; // where there are no locks, the lease alone counts
    *held = is_empty(fd) && is_at(c->path, fd);
    if (*held && !write_self(c, fd)) {
        *held = false;
        enum hg_status status = hg_status_from_errno(errno);
        hg_error_set(err, status, c->path, NULL, "cannot write: %s", strerror(errno));
        unlink(c->path);
        return status;
    }
    return HG_OK;
}

enum hg_status hg_cli_claim_take(struct hg_cli_claims *c, const char *output,
    struct hg_cli_claim_seen *seen, bool *held, char *owner, struct hg_error *err)
{
    *held = false;
    owner[0] = 0;
    snprintf(c->path, sizeof c->path, "%s.claim", output);
    for (int i = 0; i < TRIES; i++) { // its owner may remove it at any time
        int fd = open(c->path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0) {
            enum hg_status status = begin_claim(c, fd, held, err);
            if (*held)
                hold(c, fd);
            else
                close(fd);
            if (status || *held)
                return status;
            continue;
        }
        if (errno == EEXIST)
            fd = open(c->path, O_RDWR | O_CLOEXEC | O_NONBLOCK);
        if (fd < 0 && errno == EISDIR)
            return hg_error_set(err, HG_E_INVAL, c->path, NULL, "is a folder");
        if (fd < 0 && errno != ENOENT)
            return hg_error_set(err, hg_status_from_errno(errno), c->path, NULL,
                "cannot claim the frame: %s", strerror(errno));
        if (fd < 0)
            continue;
        enum hg_status status = take_over(c, fd, seen, held, owner, err);
        if (status || *held || access(c->path, F_OK) == 0)
            return status;
    }
    return HG_OK;
}

// A claim that was taken over meanwhile (this process was stopped for longer than the lease) is
// another one's.
void hg_cli_claim_release(struct hg_cli_claims *c)
{
    pthread_mutex_lock(&c->lock);
    const int fd = c->fd;
    c->fd = -1;
    pthread_mutex_unlock(&c->lock);
    if (fd < 0)
        return;
    if (is_ours(c))
        unlink(c->path);
    close(fd);
}
