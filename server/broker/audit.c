#include "server/broker/audit.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/file.h"
#include "base/json.h"
#include "base/log.h"

// A line that the end of an earlier daemon, or of the machine, has cut.
static void end_cut_line(struct hg_audit *audit)
{
    char last = '\n';
    if (audit->bytes && pread(audit->fd, &last, 1, (off_t)audit->bytes - 1) == 1 && last != '\n' &&
        write(audit->fd, "\n", 1) == 1)
        audit->bytes++;
}

enum hg_status hg_audit_open(struct hg_audit *audit, const char *path, struct hg_error *err)
{
    struct stat st;
    *audit = (struct hg_audit){.path = path, .fd = -1, .limit_bytes = UINT64_MAX};
    if (!path)
        return HG_OK;
    audit->fd = open(path, O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (audit->fd < 0 || fstat(audit->fd, &st) != 0) {
        audit->path = NULL; // nothing is written to it
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL,
            "cannot open the audit log: %s", strerror(errno));
    }
    audit->bytes = (uint64_t)st.st_size;
    end_cut_line(audit);
    return HG_OK;
}

void hg_audit_set_limits(struct hg_audit *audit, uint64_t limit_bytes, uint32_t keep)
{
    audit->limit_bytes = limit_bytes;
    audit->keep = keep;
}

int hg_audit_dup(struct hg_audit *audit)
{
    bool unsynced = audit->unsynced;
    audit->unsynced = false;
    return unsynced ? fcntl(audit->fd, F_DUPFD_CLOEXEC, 0) : -1;
}

void hg_audit_close(struct hg_audit *audit)
{
    if (audit->path && audit->fd >= 0)
        close(audit->fd);
    *audit = (struct hg_audit){.fd = -1};
}

static void name_file(const struct hg_audit *audit, uint32_t number, char *out, size_t size)
{
    if (number)
        snprintf(out, size, "%s.%u", audit->path, number);
    else
        snprintf(out, size, "%s", audit->path);
}

// The oldest is overwritten. Where no new file can be opened the present one goes on.
static void rotate(struct hg_audit *audit)
{
    char from[4096], to[4096];
    for (uint32_t i = audit->keep; i-- > 0;) {
        name_file(audit, i, from, sizeof from);
        name_file(audit, i + 1, to, sizeof to);
        if (rename(from, to) != 0 && errno != ENOENT)
            hg_warn(AUTH, "audit log: cannot rename %s: %s", from, strerror(errno));
    }
    const int flags = O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW;
    int fd = open(audit->path, audit->keep ? flags : flags | O_TRUNC, 0600);
    if (fd < 0) {
        hg_warn(AUTH, "audit log: cannot open %s: %s", audit->path, strerror(errno));
        return;
    }
    close(audit->fd);
    audit->fd = fd;
    audit->bytes = 0;
}

static void put_time(struct hg_writer *w)
{
    struct timespec now;
    struct tm tm;
    char date[32];
    clock_gettime(CLOCK_REALTIME, &now);
    gmtime_r(&now.tv_sec, &tm);
    strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &tm);
    hg_json_put(w, "{\"time\":\"%s.%03ldZ\"", date, now.tv_nsec / 1000000);
}

static void put_given(struct hg_writer *w, const char *key, const char *value)
{
    if (value && *value)
        hg_json_put_text(w, key, value);
}

static void put_line(struct hg_writer *w, const char *event, const struct hg_audit_actor *actor,
    enum hg_status result, const char *detail)
{
    put_time(w);
    hg_json_put_text(w, ",\"event\":", event);
    if (actor && actor->session)
        hg_json_put_number(w, ",\"session\":", actor->session);
    if (actor) {
        put_given(w, ",\"name\":", actor->name);
        put_given(w, ",\"tenant\":", actor->tenant);
        put_given(w, ",\"role\":", actor->role);
        put_given(w, ",\"peer\":", actor->peer);
        put_given(w, ",\"client\":", actor->client);
    }
    hg_json_put_text(w, ",\"result\":", result ? hg_status_name(result) : "ok");
    put_given(w, ",\"detail\":", detail);
    hg_json_put(w, "}\n");
}

// A line that is cut by a full disk ends with the next one, which begins on a line of its own.
static void write_line(struct hg_audit *audit, const struct hg_writer *w)
{
    ssize_t n = w->failed ? -1 : write(audit->fd, w->data, w->size);
    audit->unsynced = true;
    if (n > 0)
        audit->bytes += (uint64_t)n;
    if (n == (ssize_t)w->size)
        return;
    if (n > 0 && write(audit->fd, "\n", 1) == 1)
        audit->bytes++;
    if (audit->lost++ % 1000 == 0)
        hg_fault(AUTH, HG_E_IO, "the audit log %s lost %llu lines: %s", audit->path,
            (unsigned long long)audit->lost, strerror(errno));
}

void hg_audit_write(struct hg_audit *audit, const char *event, const struct hg_audit_actor *actor,
    enum hg_status result, const char *detail)
{
    if (!audit->path)
        return;
    struct hg_writer w = {.limit_bytes = 1 << 16};
    if (audit->bytes >= audit->limit_bytes)
        rotate(audit);
    put_line(&w, event, actor, result, detail);
    write_line(audit, &w);
    hg_writer_finish(&w);
}
