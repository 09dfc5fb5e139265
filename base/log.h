// log.h - log records. Libraries never print: they hand records to the process's sink.
// Floor 0. Thread-safe. Peer bytes given through %s are escaped by the sinks.
#ifndef HG_BASE_LOG_H
#define HG_BASE_LOG_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

enum hg_log_level { HG_LOG_DEBUG, HG_LOG_INFO, HG_LOG_WARN, HG_LOG_ERROR, HG_LOG_OFF };

// Scopes can be switched one by one at run time: HG_LOG_SCOPE(symbol, "name")
#define HG_LOG_SCOPES(X)                                                                           \
    X(MAIN, "main")                                                                                \
    X(NET, "net")                                                                                  \
    X(AUTH, "auth")                                                                                \
    X(SESSION, "session")                                                                          \
    X(WORKER, "worker")                                                                            \
    X(JOURNAL, "journal")                                                                          \
    X(SCENE, "scene")                                                                              \
    X(IMAGE, "image")                                                                              \
    X(GPU, "gpu")                                                                                  \
    X(FRAME, "frame")                                                                              \
    X(TEXTURE, "texture")                                                                          \
    X(GEOMETRY, "geometry")                                                                        \
    X(LIGHT, "light")                                                                              \
    X(TRACE, "trace")                                                                              \
    X(ENCODE, "encode")                                                                            \
    X(CLIENT, "client")

enum hg_log_scope {
#define X(sym, name) HG_LOG_##sym,
    HG_LOG_SCOPES(X)
#undef X
        HG_LOG_SCOPE_COUNT
};

struct hg_log_record {
    uint64_t wall_ns;
    enum hg_log_level level;
    enum hg_log_scope scope;
    enum hg_status status; // HG_OK when none applies
    uint64_t session;      // 0 = none
    const char *text;      // one line, valid during the call only
};

typedef void hg_log_sink_fn(void *user, const struct hg_log_record *record);

// Sets the sink of the process (NULL = drop). Call before threads start. Default: drop.
void hg_log_set_sink(hg_log_sink_fn *sink, void *user);
// Ready-made sink: logfmt lines on a file descriptor; `user` is (void *)(intptr_t)fd.
void hg_log_sink_logfmt(void *user, const struct hg_log_record *record);
// Lowest level that passes, for all scopes or for one. Default: INFO.
void hg_log_set_level(enum hg_log_level level);
void hg_log_set_scope_level(enum hg_log_scope scope, enum hg_log_level level);
// Applies a spec such as "info", "off" or "warn,net=debug,gpu=info". HG_E_INVAL names nothing
// changed.
enum hg_status hg_log_configure(const char *spec, struct hg_error *err) HG_MUST_CHECK;
bool hg_log_is_enabled(enum hg_log_level level, enum hg_log_scope scope);
// Formats a record, cut to 1023 bytes, and hands it to the sink if it passes. session: 0 = none.
void hg_log_write(enum hg_log_level level, enum hg_log_scope scope, enum hg_status status,
    uint64_t session, const char *fmt, ...) HG_PRINTF(5, 6);

#define hg_debug(scope, ...) hg_log_write(HG_LOG_DEBUG, HG_LOG_##scope, HG_OK, 0, __VA_ARGS__)
#define hg_info(scope, ...)  hg_log_write(HG_LOG_INFO, HG_LOG_##scope, HG_OK, 0, __VA_ARGS__)
#define hg_warn(scope, ...)  hg_log_write(HG_LOG_WARN, HG_LOG_##scope, HG_OK, 0, __VA_ARGS__)
#define hg_fault(scope, status, ...)                                                               \
    hg_log_write(HG_LOG_ERROR, HG_LOG_##scope, status, 0, __VA_ARGS__)

#endif
