// status.h - status codes and error details shared by every part.
// Floor 0. No state. Pure functions are safe from any thread.
#ifndef HG_BASE_STATUS_H
#define HG_BASE_STATUS_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum hg_status {
#define HG_STATUS(sym, value, name, text) HG_##sym = value,
#include "base/status.def"
#undef HG_STATUS
};

#define HG_MUST_CHECK __attribute__((warn_unused_result))
#define HG_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))

// What went wrong, in words a user can act on. Zero-initialised = no error.
// `what` names the thing (file, message, option), `where` the place in it (JSON pointer,
// "byte 1234", field), `reason` the cause. Texts are UTF-8, NUL-terminated, cut to fit.
struct hg_error {
    enum hg_status status;
    char what[256];
    char where[128];
    char reason[256];
    char limit[32];          // HG_E_LIMIT, HG_E_BUSY: which one, by the name of its option; or ""
    uint32_t retry_after_ms; // of a limit: after which the same may succeed; 0 = not by waiting
};

// Short stable name of a status ("not-found"); "unknown" for values outside the table.
const char *hg_status_name(enum hg_status status);
// One sentence for people.
const char *hg_status_text(enum hg_status status);

// Fills *err (may be NULL) and returns `status`, so that callers can write
//     return hg_error_set(err, HG_E_FORMAT, path, "/meshes/0", "count %u is too large", n);
// `what` and `where` may be NULL (left empty). Malformed UTF-8 (foreign names) becomes '?'.
enum hg_status hg_error_set(struct hg_error *err, enum hg_status status, const char *what,
    const char *where, const char *fmt, ...) HG_PRINTF(5, 6);

// Says of an error that is set already which limit it is of. Returns its status. NULL: HG_E_LIMIT.
enum hg_status hg_error_limit(struct hg_error *err, const char *limit, uint32_t retry_after_ms);
// "what: where: reason (status)" into dst; empty parts are left out. Always terminates.
void hg_error_format(const struct hg_error *err, char *dst, size_t dst_size);

#endif
