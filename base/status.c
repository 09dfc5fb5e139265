#include "base/status.h"

#include <stdio.h>
#include <string.h>

#include "base/utf8.h"

static const struct {
    enum hg_status status;
    const char *name, *text;
} table[] = {
#define HG_STATUS(sym, value, name, text) {HG_##sym, name, text},
#include "base/status.def"
#undef HG_STATUS
};

const char *hg_status_name(enum hg_status status)
{
    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        if (table[i].status == status)
            return table[i].name;
    return "unknown";
}

const char *hg_status_text(enum hg_status status)
{
    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        if (table[i].status == status)
            return table[i].text;
    return "unknown status";
}

static void copy_text(char *dst, size_t size, const char *src)
{
    snprintf(dst, size, "%s", src ? src : "");
}

enum hg_status hg_error_set(struct hg_error *err, enum hg_status status, const char *what,
    const char *where, const char *fmt, ...)
{
    if (!err)
        return status;
    struct hg_error out = {.status = status};
    copy_text(out.what, sizeof out.what, what);
    copy_text(out.where, sizeof out.where, where);
    va_list args;
    va_start(args, fmt);
    vsnprintf(out.reason, sizeof out.reason, fmt, args);
    va_end(args);
    hg_utf8_clean(out.what);
    hg_utf8_clean(out.where);
    hg_utf8_clean(out.reason);
    *err = out;
    return status;
}

enum hg_status hg_error_limit(struct hg_error *err, const char *limit, uint32_t retry_after_ms)
{
    if (!err)
        return HG_E_LIMIT;
    copy_text(err->limit, sizeof err->limit, limit);
    err->retry_after_ms = retry_after_ms;
    return err->status;
}

void hg_error_format(const struct hg_error *err, char *dst, size_t dst_size)
{
    const char *reason = err->reason[0] ? err->reason : hg_status_text(err->status);
    snprintf(dst, dst_size, "%s%s%s%s%s (%s)", err->what, err->what[0] ? ": " : "", err->where,
        err->where[0] ? ": " : "", reason, hg_status_name(err->status));
}
