// broker.c - the daemon: start, signals, reload, the janitor, drain.
#include "server/broker/broker.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "server/broker/call_filter.h"
#include "server/broker/config_check.h"
#include "server/broker/workers/confine.h"
#include "server/broker/storage/folder_lock.h"
#include "server/broker/connection/conn_share.h"
#include "server/broker/connection/conn_time.h"
#include "server/broker/metrics/counters.h"
#include "server/broker/notify.h"
#include "server/broker/privileges.h"
#include "server/broker/workers/recovery.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_admin.h"
#include "server/broker/session/session_end.h"
#include "server/broker/session/session_sync.h"
#include "server/broker/session/session_park.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_share.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"
#include "server/broker/state/state.h"
#include "server/broker/http/web.h"

enum { EXIT_CONFIG = 2, EXIT_START = 4, EXIT_LAUNCHER = 5 };
enum { TICK_NS = 50000000, SLOW_TICK_NS = 250000000, IDLE_TICK_NS = 500000000 };
enum { TICK_PART = 10, THROTTLE_NS = 5000000 };
static const uint64_t check_tokens_ns = 1000000000;

// ---- start --------------------------------------------------------------------------------------

static enum hg_status choose_audit(struct hg_options *o, struct hg_error *err)
{
    if (o->state_dir && !o->audit && !(o->audit = hg_folder_path(o->state_dir, "audit.log")))
        return hg_error_set(err, HG_E_NOMEM, "--audit", NULL, "no memory");
    return HG_OK;
}

static enum hg_status open_store(struct hg_broker *b, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    char *folder = hg_folder_path(b->options.cache_dir, "uploads");
    if (!folder)
        status = hg_error_set(err, HG_E_NOMEM, "--cache-dir", NULL, "no memory");
    if (!status && b->takeover.inherited_fd < 0)
        status = hg_homes_recover(b->options.cache_dir, err);
    if (!status)
        status = hg_upload_store_create(folder, b->options.upload_store_bytes, &b->store, err);
    hg_free(folder);
    return status;
}

static enum hg_status open_default(struct hg_broker *b, struct hg_error *err)
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    char address[256];
    snprintf(
        address, sizeof address, "unix:%s/heliod.sock", runtime && *runtime ? runtime : "/run");
    return hg_listener_open(address, &b->listeners, err);
}

// All parts, from below; recovery and client_dispatch act when a link or a connection has
// something.
static enum hg_status wire_up(struct hg_broker *b, struct hg_error *err)
{
    struct hg_link like = {.loop = &b->loop,
        .options = &b->options,
        .whose = {.launcher = &b->launcher},
        .events = &hg_recovery_events,
        .owner = &b->sessions};
    b->admission = (struct hg_admission){
        .options = &b->options, .tokens = &b->tokens, .sessions = &b->sessions, .audit = &b->audit};
    b->conns = (struct hg_conn_table){.loop = &b->loop,
        .options = &b->options,
        .web = &b->streams.web,
        .tls = &b->streams.tls,
        .slots = {.options = &b->options},
        .events = &hg_client_dispatch_events,
        .owner = &b->admission};
    b->sessions = (struct hg_session_table){.loop = &b->loop,
        .options = &b->options,
        .store = b->store,
        .conns = &b->conns,
        .pool = &b->pool,
        .audit = &b->audit,
        .quarantine = &b->guests.quarantine,
        .tickets = &b->guests.tickets,
        .blocks = &b->guests.blocks,
        .scenes = {.pool = &b->pool, .store = b->store}};
    if (hg_worker_pool_init(&b->pool, &like, b->store, &b->machine, b->takeover.inherited_links))
        return hg_error_set(err, HG_E_NOMEM, "worker", NULL, "no memory");
    return hg_session_upload_watch(&b->sessions, &b->loop, err);
}

static enum hg_status open_audit(struct hg_broker *b, struct hg_error *err)
{
    enum hg_status status = choose_audit(&b->options, err);
    if (!status)
        status = hg_audit_open(&b->audit, b->options.audit, err);
    hg_audit_set_limits(&b->audit, b->options.audit_size_bytes, b->options.audit_keep);
    return status;
}

// The log has written or synced.
static void state_ready(struct hg_source *source, uint32_t events)
{
    struct hg_broker *b = source->owner;
    (void)events;
    const bool reached = hg_state_log_poll(b->state);
    hg_session_sync_end(&b->sessions);
    if (reached)
        hg_conn_release(&b->conns);
}

static enum hg_status open_state(struct hg_broker *b, struct hg_error *err)
{
    enum hg_status status =
        hg_state_open(&b->sessions, b->takeover.inherited_fd >= 0, &b->state, err);
    if (status || !b->state)
        return status;
    b->conns.reached = hg_state_log_reached(b->state);
    for (struct hg_conn *it = b->conns.first; it; it = it->next) // inherited
        it->out.reached = b->conns.reached;
    b->state_news = (struct hg_source){
        .fd = hg_state_log_fd(b->state), .events = EPOLLIN, .ready = state_ready, .owner = b};
    if (hg_loop_add(&b->loop, &b->state_news))
        return hg_error_set(err, HG_E_LIMIT, "--state-dir", NULL, "cannot watch the log");
    return HG_OK;
}

static void watch_accepts(struct hg_broker *b, uint64_t now_ns)
{
    if (b->conns.accept_pause_ns && now_ns >= b->conns.accept_pause_ns)
        b->conns.accept_pause_ns = 0;
    for (struct hg_listener *it = b->listeners; it; it = it->next)
        hg_loop_set_events(
            &b->loop, &it->source, b->conns.accept_pause_ns || b->conns.quiet ? 0 : EPOLLIN);
}

static void accept_ready(struct hg_source *source, uint32_t events)
{
    struct hg_broker *b = source->owner;
    (void)events;
    for (struct hg_listener *it = b->listeners; it; it = it->next)
        if (&it->source == source)
            hg_conn_accept(&b->conns, it);
    if (b->conns.accept_pause_ns) // else the loop would come here again and again until the tick
        watch_accepts(b, b->loop.now_ns);
}

static enum hg_status watch_listeners(struct hg_broker *b, struct hg_error *err)
{
    for (struct hg_listener *it = b->listeners; it; it = it->next) {
        if (it->transport != &hg_transport_unix && !b->tokens.count)
            return hg_error_set(err, HG_E_INVAL, it->name, NULL,
                "tcp clients need tokens; name a file with --tokens");
        it->source.ready = accept_ready;
        it->source.owner = b;
        if (hg_loop_add(&b->loop, &it->source))
            return hg_error_set(err, HG_E_LIMIT, it->name, NULL, "cannot watch the socket");
        hg_info(NET, "listening on %s", it->name);
    }
    return HG_OK;
}

// The newest listener is first in the list and last in the file.
static void write_ports(struct hg_writer *w, const struct hg_listener *it)
{
    char line[16];
    if (!it)
        return;
    write_ports(w, it->next);
    int n = snprintf(line, sizeof line, "%u\n", it->port);
    if (it->port)
        hg_write_bytes(w, line, (size_t)n);
}

static enum hg_status write_port_file(struct hg_broker *b, struct hg_error *err)
{
    struct hg_writer w = {0};
    write_ports(&w, b->listeners);
    enum hg_status status = hg_file_write_atomic(b->options.port_file, w.data, w.size, err);
    hg_writer_finish(&w);
    return status;
}

static enum hg_status open_listeners(struct hg_broker *b, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    uint64_t tls;
    int passed = hg_notify_take_sockets(&tls);
    if (b->listeners) // inherited
        return watch_listeners(b, err);
    if (tls && !b->options.tls_cert)
        status = hg_error_set(err, HG_E_INVAL, "tls-cert", NULL,
            "is needed: the service manager passed a socket that is named tls");
    for (int i = 0; i < passed && !status; i++)
        status = hg_listener_adopt_passed(3 + i, tls >> i & 1, &b->listeners, err);
    for (size_t i = 0; i < b->options.listen.count && !status; i++)
        status = hg_listener_open(b->options.listen.items[i], &b->listeners, err);
    if (!status && !b->listeners)
        status = open_default(b, err);
    if (!status)
        status = watch_listeners(b, err);
    return status;
}

// ---- reload -------------------------------------------------------------------------------------

static void apply_log(const struct hg_options *o)
{
    struct hg_error err = {0};
    hg_log_set_level(HG_LOG_INFO);
    if (o->log && hg_log_configure(o->log, &err))
        hg_warn(MAIN, "%s", err.reason);
}

// For the log, the audit log, monitoring and the service manager; err NULL: it was taken.
static void report_reload(struct hg_broker *b, const struct hg_error *err)
{
    char text[700] = "";
    hg_reload.is_refused = err != NULL;
    if (!err)
        hg_reload.success_s = hg_clock_wall_ns() / 1000000000u;
    else
        hg_error_format(err, text, sizeof text);
    if (err)
        hg_log_write(HG_LOG_ERROR, HG_LOG_MAIN, err->status, 0,
            "reload refused, everything stays as it was: %s", text);
    hg_audit_write(&b->audit, "reload", NULL, err ? err->status : HG_OK, text);
    hg_notify_send("READY=1\nSTATUS=%s%s", err ? "reload refused: " : "accepting clients", text);
}

static void take_options(struct hg_broker *b, struct hg_options *options)
{
    char names[400];
    const size_t differ = hg_options_reload(&b->options, options, names, sizeof names);
    hg_client_dispatch_check_tokens(&b->conns);
    apply_log(&b->options);
    hg_upload_store_set_limit(b->store, b->options.upload_store_bytes);
    hg_audit_set_limits(&b->audit, b->options.audit_size_bytes, b->options.audit_keep);
    hg_info(MAIN, "reloaded: %zu tokens%s%s", b->tokens.count,
        differ ? "; a restart is needed for: " : "", differ ? names : "");
    hg_slots_measure_files(&b->conns.slots);
}

static void reload(struct hg_broker *b)
{
    struct hg_options options;
    struct hg_tokens tokens = {0};
    struct hg_tls tls = {0};
    struct hg_error err = {0};
    hg_notify_send(
        "RELOADING=1\nMONOTONIC_USEC=%llu", (unsigned long long)(hg_clock_now_ns() / 1000));
    enum hg_status status = hg_options_parse(b->argc, b->argv, &options, &err);
    if (!status)
        status = hg_cache_folder_choose(&options, &err);
    if (!status && !hg_cache_folder_compare(&b->cache, &b->options, &options))
        status = hg_error_set(&err, HG_E_NOMEM, "--cache-dir", NULL, "no memory");
    if (!status)
        status = choose_audit(&options, &err);
    if (!status)
        status = hg_config_check(&options, &err);
    if (!status)
        status = hg_config_read_tokens(&options, &tokens, &err);
    if (!status)
        status = hg_tls_open(&options, &tls, &err);
    if (status) {
        hg_tokens_finish(&tokens);
        hg_options_finish(&options);
        apply_log(&b->options);
    } else {
        hg_tokens_finish(&b->tokens);
        b->tokens = tokens;
        hg_tls_replace(&b->streams.tls, &tls);
        take_options(b, &options);
    }
    report_reload(b, status ? &err : NULL);
}

// ---- drain --------------------------------------------------------------------------------------

static void begin_drain(struct hg_broker *b)
{
    uint64_t timeout_ns = b->options.drain_timeout_ns;
    hg_info(MAIN, "draining: %u sessions, at most %.1f s", b->sessions.count,
        (double)timeout_ns * 1e-9);
    hg_notify_send("STOPPING=1\nSTATUS=draining");
    b->sessions.draining = b->sessions.scenes.ending = true;
    hg_takeover_stop(&b->takeover);
    b->drain_deadline_ns = b->loop.now_ns + timeout_ns;
    for (struct hg_conn *it = b->conns.first, *next; it; it = next) {
        next = it->next;
        if (it->state < HG_CONN_OPEN)
            hg_conn_kill(it, "the daemon is shutting down");
        else if (it->state == HG_CONN_OPEN)
            hg_conn_send(it, 0, HGP_T_drain,
                &(struct hgp_drain){.deadline_ms = (uint32_t)(timeout_ns / 1000000),
                    .reason = hgp_str_make("the daemon is shutting down")});
    }
}

static bool has_work(const struct hg_conn *conn)
{
    const struct hg_session *s = conn->session;
    return conn->out.head || (s && (s->load.count || hg_session_upload_is_due(s)));
}

static void drain_step(struct hg_broker *b)
{
    bool late = b->loop.now_ns >= b->drain_deadline_ns;
    hg_listeners_destroy(&b->loop, &b->listeners);
    for (struct hg_conn *it = b->conns.first, *next; it; it = next) {
        next = it->next;
        if (it->state != HG_CONN_OPEN || (has_work(it) && !late))
            continue;
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_CANCELLED, "request", NULL,
            "the daemon shut down before it was done (drain-timeout)");
        if (it->session)
            hg_session_request_fail_all(it->session, &err);
        hg_conn_close(it, NULL, "the daemon is shutting down");
    }
    if (!b->conns.first)
        b->loop.stop = true;
}

// ---- signals ------------------------------------------------------------------------------------

static void take_signal(struct hg_broker *b, uint32_t number)
{
    int status = 0;
    switch (number) {
    case SIGCHLD:
        if (hg_worker_pool_reap(&b->pool, b->takeover.check_pid, &status))
            hg_takeover_checked(&b->takeover, status);
        return;
    case SIGUSR2:
        hg_takeover_begin(&b->takeover);
        return;
    case SIGHUP:
        reload(b);
        return;
    default:
        if (b->sessions.draining) {
            hg_warn(MAIN, "second signal: exiting at once");
            b->loop.stop = true;
        } else {
            begin_drain(b);
        }
    }
}

static void signals_ready(struct hg_source *source, uint32_t events)
{
    struct signalfd_siginfo info;
    (void)events;
    while (read(source->fd, &info, sizeof info) == (ssize_t)sizeof info)
        take_signal(source->owner, info.ssi_signo);
}

static enum hg_status watch_signals(struct hg_broker *b, struct hg_error *err)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGHUP);
    sigaddset(&set, SIGUSR2);
    sigaddset(&set, SIGCHLD);
    sigprocmask(SIG_BLOCK, &set, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); // a full quota is an error of write
    b->signals = (struct hg_source){
        .fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC),
        .events = EPOLLIN,
        .ready = signals_ready,
        .owner = b,
    };
    if (b->signals.fd < 0 || hg_loop_add(&b->loop, &b->signals))
        return hg_error_set(err, HG_E_LIMIT, "signals", NULL, "cannot watch signals");
    return HG_OK;
}

// ---- the round ----------------------------------------------------------------------------------

static void bury(struct hg_broker *b)
{
    hg_conn_bury(&b->conns);
    hg_session_bury(&b->sessions);
}

static void tick(struct hg_broker *b)
{
    uint64_t now_ns = b->loop.now_ns;
    hg_conn_share_output(&b->conns);
    hg_conn_share_input(&b->conns);
    hg_conn_check_input(&b->conns);
    hg_conn_check_times(&b->conns);
    if (now_ns - b->ticks.tokens_checked_ns > check_tokens_ns) {
        b->ticks.tokens_checked_ns = now_ns;
        hg_client_dispatch_check_tokens(&b->conns);
        hg_session_record_cameras(&b->sessions);
        hg_session_check_parked(&b->sessions);
        for (struct hg_session *it = b->sessions.first; it; it = it->next)
            hg_session_upload_check_times(it, now_ns);
        if (b->state)
            hg_state_log_sync_file(b->state, hg_audit_dup(&b->audit), NULL);
    }
    hg_session_view_tick(&b->sessions);
    hg_session_share_tick(&b->sessions);
    hg_session_admin_tick(&b->sessions);
    hg_session_end_idle(&b->sessions);
    hg_worker_pool_check_times(&b->pool);
    hg_shared_scene_check_times(&b->sessions.scenes, now_ns);
    hg_state_tend(&b->sessions);
    watch_accepts(b, now_ns);
    if (b->watchdog.interval_ns && now_ns - b->watchdog.sent_ns >= b->watchdog.interval_ns / 2) {
        b->watchdog.sent_ns = now_ns;
        hg_notify_send("WATCHDOG=1");
    }
}

static uint64_t sooner(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

// A tick passes over all connections and sessions some times: with thousands of them it takes some
// milliseconds, and comes more rarely, so that it has a tenth of the time at most.
static uint64_t tick_wait_ns(uint64_t took_ns)
{
    return took_ns < TICK_NS / TICK_PART ? TICK_NS : sooner(TICK_PART * took_ns, SLOW_TICK_NS);
}

// Periodic and deferred work; returns the next deadline.
static uint64_t round_end(void *user)
{
    struct hg_broker *b = user;
    uint64_t now_ns = b->loop.now_ns;
    bool draining = b->sessions.draining;
    hg_worker_pool_end_round(&b->pool, now_ns);
    bool idle =
        !b->conns.first && hg_worker_pool_is_up(&b->pool) && !draining && !b->watchdog.interval_ns;
    if (!idle)
        b->ticks.due_ns = sooner(b->ticks.due_ns, now_ns + b->ticks.wait_ns);
    if (now_ns >= b->ticks.due_ns) {
        tick(b);
        b->ticks.wait_ns = tick_wait_ns(hg_clock_now_ns() - now_ns);
        b->ticks.due_ns = now_ns + (idle ? IDLE_TICK_NS : b->ticks.wait_ns);
    }
    hg_conn_resume_paused(&b->conns);
    bury(b);
    bool rebuilds = false;
    for (uint32_t i = 0; i < b->pool.count; i++) {
        hg_recovery_continue(&b->pool.links[i]);
        rebuilds |= b->pool.links[i].feed.rebuild_goes_on;
    }
    if (hg_session_admin_drained(&b->sessions))
        begin_drain(b);
    if (draining)
        drain_step(b);
    else if (b->takeover.deadline_ns)
        hg_takeover_step(&b->takeover);
    bury(b);
    uint64_t deadline_ns = sooner(b->ticks.due_ns, hg_worker_pool_deadline_ns(&b->pool));
    if (b->conns.turns.more || rebuilds)
        return now_ns;
    return b->conns.turns.waiting ? sooner(deadline_ns, now_ns + THROTTLE_NS) : deadline_ns;
}

// ---- life ---------------------------------------------------------------------------------------

// Sockets may need root; nothing else does, but that folders become the user's.
static enum hg_status listen_and_become(struct hg_broker *b, struct hg_error *err)
{
    struct hg_user user;
    enum hg_status status = hg_user_find(&user, b->options.user, err);
    if (!status)
        status = open_listeners(b, err);
    if (status || !user.change)
        return status;
    for (const struct hg_listener *it = b->listeners; it; it = it->next)
        hg_user_own(&user, it->unix_path);
    if (hg_folder_make(b->options.cache_dir, err))
        hg_warn(MAIN, "%s: %s", b->options.cache_dir, err->reason);
    *err = (struct hg_error){0};
    hg_user_own(&user, b->options.cache_dir);
    hg_user_own(&user, b->options.audit);
    hg_user_own(&user, b->options.state_dir);
    status = hg_user_become(&user, err);
    if (!status)
        hg_config_warn_unreadable(&b->options, user.name);
    return status;
}

// One that took over has the list of its predecessor: every further one would stay as well.
static enum hg_status filter_calls(const struct hg_broker *b, struct hg_error *err)
{
    if (hg_call_filter_enter())
        return HG_OK;
    if (strcmp(b->options.sandbox, "require") == 0)
        return hg_error_set(err, HG_E_UNSUPPORTED, "heliod", "sandbox",
            "this kernel has no seccomp filters, which sandbox=require asks for");
    hg_warn(MAIN, "this kernel has no seccomp filters: the daemon may make any system call");
    return HG_OK;
}

static enum hg_status start(struct hg_broker *b, struct hg_error *err)
{
    const bool is_inherited = b->takeover.inherited_fd >= 0;
    enum hg_status status = hg_config_check_start(&b->options, err);
    if (!status)
        status = hg_loop_init(&b->loop, err);
    if (!status) // the key may be root's
        status = hg_tls_open(&b->options, &b->streams.tls, err);
    if (!status && !is_inherited)
        status = listen_and_become(b, err);
    if (!status) // the launcher and all that follows use it
        status = hg_cache_folder_open(&b->cache, &b->options, err);
    if (!status) // the launcher has to leave the group that shares out controllers, too
        status = hg_machine_init(&b->machine, &b->options, err);
    if (!status && !hg_launcher_adopt(&b->launcher, &b->machine.group))
        status = hg_launcher_start(&b->launcher, &b->options, b->argv, &b->machine.group, err);
    // Before there are threads, each of which has a set of its own.
    if (!status && hg_confine_drop_capabilities())
        status = hg_error_set(err, HG_E_PERM, "heliod", NULL, "cannot give up its capabilities");
    if (!status && !is_inherited)
        status = filter_calls(b, err);
    if (!status)
        status = watch_signals(b, err);
    if (!status)
        status = open_store(b, err);
    if (!status)
        status = hg_web_open(&b->streams.web, &b->options, &b->sessions, err);
    if (!status)
        status = wire_up(b, err);
    if (!status)
        status = hg_takeover_inherit(&b->takeover, err); // before there is a log
    if (!status && is_inherited)
        hg_worker_pool_take_homes(&b->pool);
    if (!status && is_inherited)
        status = open_listeners(b, err); // those that are open already
    if (!status)
        status = open_state(b, err);
    if (!status)
        status = open_audit(b, err);
    if (!status && b->options.port_file && !is_inherited) // nothing can fail any more
        status = write_port_file(b, err);
    return status;
}

static void stop(struct hg_broker *b)
{
    b->sessions.scenes.ending = true;
    while (b->conns.first)
        hg_conn_kill(b->conns.first, "the daemon ends");
    bury(b);
    hgp_chunk_pool_finish(&b->conns.chunks);
    while (b->sessions.first) // those that waited for their last edits
        hg_session_destroy(b->sessions.first);
    while (b->sessions.scenes.first) // those that were kept
        hg_shared_scene_drop(&b->sessions.scenes, b->sessions.scenes.first);
    hg_session_upload_unwatch(&b->sessions, &b->loop);
    hg_loop_remove(&b->loop, &b->state_news);
    hg_state_log_close(b->state);
    hg_session_sync_finish(&b->sessions);
    hg_listeners_destroy(&b->loop, &b->listeners);
    hg_peer_table_finish(&b->conns.slots.peers);
    hg_worker_pool_finish(&b->pool);
    hg_launcher_stop(&b->launcher);
    hg_tls_finish(&b->streams.tls);
    hg_web_files_finish(&b->streams.web.files);
    hg_upload_store_destroy(b->store);
    hg_join_tickets_finish(&b->guests.tickets);
    hg_audit_write(&b->audit, "stop", NULL, HG_OK, NULL);
    hg_audit_close(&b->audit);
    hg_tokens_finish(&b->tokens);
    hg_loop_close(&b->loop, &b->signals);
    hg_loop_finish(&b->loop);
    hg_cache_folder_close(&b->cache);
    hg_options_finish(&b->options);
}

int hg_broker_run(struct hg_options *options, int argc, char *const *argv)
{
    static struct hg_broker broker; // large, one per process
    struct hg_broker *b = &broker;
    struct hg_error err = {0};
    *b = (struct hg_broker){.options = *options, .argc = argc, .argv = argv};
    *options = (struct hg_options){0};
    b->signals.fd = b->state_news.fd = b->loop.epoll_fd = b->launcher.fd = b->cache.lock_fd = -1;
    b->takeover = (struct hg_takeover){.all = {&b->sessions, &b->conns, &b->listeners},
        .loop = &b->loop,
        .audit = &b->audit,
        .launcher = &b->launcher,
        .cache = &b->cache,
        .state = &b->state,
        .state_news = &b->state_news,
        .argc = argc,
        .argv = argv};
    enum hg_status status = hg_cache_folder_choose(&b->options, &err);
    if (!status) {
        hg_launcher_continue(&b->options, argv);
        status = hg_takeover_find(&b->takeover, &b->options, &err);
    }
    if (!status)
        status = hg_config_read_tokens(&b->options, &b->tokens, &err);
    if (!status)
        status = hg_config_check_listen(&b->options, &b->tokens, &err);
    int exit_code = status ? EXIT_CONFIG : EXIT_START;
    hg_slots_raise_files();
    if (!status)
        status = start(b, &err);
    if (!status) {
        b->sessions.started_ns = b->loop.now_ns;
        hg_reload.success_s = hg_clock_wall_ns() / 1000000000u;
        b->watchdog.interval_ns = hg_notify_watchdog_ns();
        hg_config_warn(&b->options, &b->tokens, &b->streams.tls);
        hg_slots_measure_files(&b->conns.slots);
        hg_audit_write(&b->audit, "start", NULL, HG_OK, "heliod " HELIO_VERSION);
        hg_info(MAIN, "heliod %s is process %d; configuration: %s", HELIO_VERSION, (int)getpid(),
            b->options.config ? b->options.config : "flags alone");
        hg_worker_pool_start(&b->pool);
        if (b->takeover.inherited_fd < 0)
            hg_state_place(&b->sessions);
        hg_notify_send("READY=1\nSTATUS=accepting clients");
        hg_loop_run(&b->loop, round_end, b);
        exit_code = b->launcher.pid ? 0 : EXIT_LAUNCHER; // a failure for service managers
        hg_info(MAIN, "done");
    } else {
        char text[700];
        hg_error_format(&err, text, sizeof text);
        hg_log_write(HG_LOG_ERROR, HG_LOG_MAIN, status, 0, "cannot start: %s", text);
        exit_code = err.status == HG_E_INVAL ? EXIT_CONFIG : exit_code;
    }
    stop(b);
    return exit_code;
}
