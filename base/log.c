#include "base/log.h"

#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/utf8.h"

static const char *const level_names[] = {"debug", "info", "warn", "error", "off"};
static const char *const scope_names[] = {
#define X(sym, name) name,
    HG_LOG_SCOPES(X)
#undef X
};

static hg_log_sink_fn *sink_fn;
static void *sink_user;
// One level per scope; 0 means "not set" so that zero initialisation is the INFO default.
static _Atomic int scope_levels[HG_LOG_SCOPE_COUNT];

void hg_log_set_sink(hg_log_sink_fn *sink, void *user)
{
    sink_fn = sink;
    sink_user = user;
}

void hg_log_set_scope_level(enum hg_log_scope scope, enum hg_log_level level)
{
    atomic_store(&scope_levels[scope], (int)level + 1);
}

void hg_log_set_level(enum hg_log_level level)
{
    for (int i = 0; i < HG_LOG_SCOPE_COUNT; i++)
        hg_log_set_scope_level((enum hg_log_scope)i, level);
}

bool hg_log_is_enabled(enum hg_log_level level, enum hg_log_scope scope)
{
    int set = atomic_load_explicit(&scope_levels[scope], memory_order_relaxed);
    int lowest = set ? set - 1 : HG_LOG_INFO;
    return sink_fn && (int)level >= lowest;
}

static int find_name(const char *const *names, int count, const char *name, size_t length)
{
    for (int i = 0; i < count; i++)
        if (strlen(names[i]) == length && memcmp(names[i], name, length) == 0)
            return i;
    return -1;
}

static enum hg_status apply_spec(const char *spec, bool dry_run, struct hg_error *err)
{
    for (const char *p = spec; *p;) {
        size_t length = strcspn(p, ",");
        const char *eq = memchr(p, '=', length);
        const char *level_text = eq ? eq + 1 : p;
        int scope = eq ? find_name(scope_names, HG_LOG_SCOPE_COUNT, p, (size_t)(eq - p)) : 0;
        int level =
            find_name(level_names, HG_LOG_OFF + 1, level_text, (size_t)(p + length - level_text));
        if (scope < 0 || level < 0)
            return hg_error_set(err, HG_E_INVAL, "log", spec, "unknown %s in '%.*s'",
                scope < 0 ? "scope" : "level", (int)length, p);
        if (!dry_run && eq)
            hg_log_set_scope_level((enum hg_log_scope)scope, (enum hg_log_level)level);
        else if (!dry_run)
            hg_log_set_level((enum hg_log_level)level);
        p += length + (p[length] == ',');
    }
    return HG_OK;
}

enum hg_status hg_log_configure(const char *spec, struct hg_error *err)
{
    enum hg_status status = apply_spec(spec, true, err);
    return status ? status : apply_spec(spec, false, err);
}

void hg_log_write(enum hg_log_level level, enum hg_log_scope scope, enum hg_status status,
    uint64_t session, const char *fmt, ...)
{
    if (!hg_log_is_enabled(level, scope))
        return;
    char text[1024];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    sink_fn(sink_user, &(struct hg_log_record){.wall_ns = hg_clock_wall_ns(), .level = level,
        .scope = scope, .status = status, .session = session, .text = text});
}

// Escapes so that one record stays one line and terminals are safe: quotes and backslashes,
// control characters (C1 in UTF-8, too), bytes that are not UTF-8.
static void escape(char *dst, size_t size, const char *src)
{
    size_t n = 0, step;
    for (size_t left = strlen(src); left && n + 9 < size; left -= step, src += step) {
        unsigned char c = (unsigned char)*src;
        step = hg_utf8_sequence(src, left);
        bool control = c < 0x20 || c == 0x7f || (c == 0xc2 && (unsigned char)src[1] < 0xa0);
        if (step == 0 || control) {
            step = 1;
            n += (size_t)snprintf(dst + n, size - n, "\\x%02x", c);
            continue;
        }
        if (c == '"' || c == '\\')
            dst[n++] = '\\';
        memcpy(dst + n, src, step);
        n += step;
    }
    dst[n] = 0;
}

void hg_log_sink_logfmt(void *user, const struct hg_log_record *r)
{
    char text[2048], line[2400], stamp[32], session[32] = "";
    time_t seconds = (time_t)(r->wall_ns / 1000000000u);
    struct tm tm;
    gmtime_r(&seconds, &tm);
    strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%S", &tm);
    escape(text, sizeof text, r->text);
    if (r->session)
        snprintf(session, sizeof session, " session=%llu", (unsigned long long)r->session);
    int n = snprintf(line, sizeof line, "ts=%s.%03uZ level=%s scope=%s%s%s%s msg=\"%s\"\n", stamp,
        (unsigned)(r->wall_ns / 1000000u % 1000u), level_names[r->level], scope_names[r->scope],
        r->status ? " status=" : "", r->status ? hg_status_name(r->status) : "", session, text);
    size_t length = n < (int)sizeof line ? (size_t)n : sizeof line - 1;
    ssize_t written = write((int)(intptr_t)user, line, length);
    (void)written; // a log that cannot be written is lost; there is nowhere to say so
}
