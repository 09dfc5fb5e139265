// soak.c - hostile sessions of mixed kinds, as many at a time as there may be, for a while, with
// honest ones of another tenant among them: these see no error, memory stays flat, and counts
// within their budget.
//
//   HELIO_SOAK_SESSIONS   hostile ones at a time (300)
//   HELIO_SOAK_VIEWS      of them have views (all)
//   HELIO_SOAK_SECONDS    of processor time of the daemon, after as much again of warming up (2)
//   HELIO_SOAK_HELD       connections that are held open beside them (500)
//   HELIO_SOAK_LIMIT      seconds after which warming up and what follows end in any case (none)
//
// Says every ten seconds how far it is.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "tests/fuzz/session_stream.h"
#include "tests/system/daemon.h"

enum { HONEST = 10, SIDE = 256, FRAMES = 16, PINGS = 256, MIB = 1 << 20, GROWTH = 48 * MIB };
enum { STEPS = 32, STEPS_EACH = 16, MOST_MS = 20000 };
static const uint64_t second_ns = 1000000000;

enum kind { MUTATED, UNREAD_FRAMES, UNREAD_PINGS, SCENES, UPLOADS, DEADLY, SILENT, KINDS };
static const char *const kind_names[KINDS] = {
    "mutated", "unread frames", "unread pings", "scenes", "uploads", "deadly files", "silent"};

struct hostile {
    struct peer p; // fd -1: not connected
    enum kind kind;
};

struct soak {
    struct daemon d;
    struct peer honest[HONEST], *holding;
    struct hostile *hostile;
    uint64_t count, held, views;
    uint64_t steps, served, begun_ns, said_ns;
    uint32_t took[MOST_MS + 1]; // how many rounds of honest ones took so many milliseconds
};

static struct fuzz_random random_state;
static uint64_t lived[KINDS], upload_number;

static uint64_t number_of(const char *variable, uint64_t otherwise)
{
    const char *text = getenv(variable);
    return text ? strtoull(text, NULL, 10) : otherwise;
}

// ---- hostile sessions ---------------------------------------------------------------------------

static void put(struct hg_writer *w, enum hgp_type type, const void *message)
{
    const uint32_t request = 1 + (uint32_t)fuzz_below(&random_state, 100);
    assert_int_equal(
        hgp_encode(w, HGP_VERSION_MAX, (struct hgp_envelope){type, request, 0}, message, NULL),
        HG_OK);
}

// What the socket takes; the rest is cut off.
static void send_all(struct hostile *h, struct hg_writer *w)
{
    const ssize_t sent = send(h->p.fd, w->data, w->size, MSG_NOSIGNAL | MSG_DONTWAIT);
    (void)sent; // the daemon may have closed it
    hg_writer_finish(w);
}

static void begin(struct hostile *h, struct daemon *d, bool view)
{
    struct hg_writer w = {0};
    h->kind = (enum kind)fuzz_below(&random_state, KINDS);
    lived[h->kind]++;
    peer_connect(&h->p, d, true);
    if (h->kind == SILENT)
        return;
    hg_write_bytes(&w, HGP_PREFACE, HGP_PREFACE_BYTES);
    put(&w, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
    put(&w, HGP_T_auth, &(struct hgp_auth){.token = hgp_str_make("hostile-token-1")});
    put(&w, HGP_T_scene_open, &(struct hgp_scene_open){0});
    if (view)
        put(&w, HGP_T_view_set,
            &(struct hgp_view_set){
                .view = 1, .has_width = true, .width = SIDE, .has_height = true, .height = SIDE});
    send_all(h, &w);
}

static void put_upload(struct hg_writer *w)
{
    const uint64_t content = ++upload_number;
    struct hgp_upload upload = {
        .total = sizeof content, .data = {(const uint8_t *)&content, sizeof content}};
    memcpy(upload.hash, &content, sizeof content); // a wrong one, as often as not
    put(w, HGP_T_upload, &upload);
}

static void act(struct hostile *h)
{
    static uint8_t waste[65536];
    struct hg_writer w = {0};
    switch (h->kind) {
    case MUTATED:
        session_stream_put(&w, &random_state);
        if (recv(h->p.fd, waste, sizeof waste, MSG_DONTWAIT) == 0)
            peer_close(&h->p); // as it was asked to
        break;
    case UNREAD_FRAMES:
        for (int i = 0; i < FRAMES; i++)
            put(&w, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
        break;
    case UNREAD_PINGS:
        for (int i = 0; i < PINGS; i++)
            put(&w, HGP_T_ping, &(struct hgp_ping){0});
        break;
    case SCENES:
        put(&w, HGP_T_scene_close, &(struct hgp_scene_close){0});
        put(&w, HGP_T_scene_open, &(struct hgp_scene_open){0});
        break;
    case UPLOADS:
        put_upload(&w);
        break;
    case DEADLY:
        put(&w, HGP_T_asset_load,
            &(struct hgp_asset_load){.asset = 1, .path = hgp_str_make("poison")});
        break;
    default:
        break;
    }
    if (h->p.fd >= 0 && w.size)
        send_all(h, &w);
    else
        hg_writer_finish(&w);
}

static void step(struct soak *s)
{
    struct hostile *h = &s->hostile[fuzz_below(&random_state, s->count)];
    s->steps++;
    if (h->p.fd < 0) {
        begin(h, &s->d, (uint64_t)(h - s->hostile) < s->views);
    } else if (fuzz_below(&random_state, 16) == 0) {
        peer_close(&h->p);
        h->p.fd = -1;
    } else {
        act(h);
    }
}

// ---- honest ones --------------------------------------------------------------------------------

static void be_served(struct soak *s, struct peer *p)
{
    const uint64_t start_ns = hg_clock_now_ns();
    peer_call(p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = p->first_id}, HGP_T_ok);
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    const uint64_t ms = (hg_clock_now_ns() - start_ns) / 1000000;
    s->took[ms < MOST_MS ? ms : MOST_MS]++;
    s->served++;
}

// Milliseconds that `part` of the rounds took at most.
static unsigned took_ms(const struct soak *s, double part)
{
    uint64_t sum = 0;
    unsigned ms = 0;
    while (ms < MOST_MS && (double)(sum += s->took[ms]) < part * (double)s->served)
        ms++;
    return ms;
}

// ---- the soak -----------------------------------------------------------------------------------

static void begin_daemon(struct daemon *d, uint64_t connections)
{
    char count[32], twice[32];
    daemon_init_tokens(d);
    daemon_write(d, "tokens",
        "honest-token-1 edit honest\nhostile-token-1 edit hostile\nadmin-token-1 admin\n");
    snprintf(count, sizeof count, "%llu", (unsigned long long)connections);
    static const char *const limits[] = {"max-connections", "max-per-address", "max-per-network",
        "max-sessions", "max-sessions-per-token"};
    snprintf(twice, sizeof twice, "%llu", 2 * (unsigned long long)connections);
    daemon_option(d, "max-handshakes", twice); // from half of it on some are dropped
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++)
        daemon_option(d, limits[i], count);
    daemon_option(d, "isolation", "tenant");
    daemon_option(d, "handshake-timeout", "3600"); // those that are held say nothing
    daemon_option(d, "restart-delay", "0.05");
    daemon_option(d, "crash-limit", "1000");
    daemon_option(d, "output-limit", "1");
    daemon_option(d, "output-total", "16");
    daemon_option(d, "log", "error");
    daemon_start(d);
    daemon_write(d, "kill.asset_load", ""); // honest ones load nothing
}

static void say(struct soak *s, const char *what)
{
    s->said_ns = hg_clock_now_ns();
    print_message("%s: %.0f s, %.1f of processor time; %llu steps, honest ones served %llu times, "
                  "in %u ms (median), %u (99%%), %u at most; %.1f MiB\n",
        what, (double)(s->said_ns - s->begun_ns) * 1e-9, daemon_cpu_s(s->d.pid),
        (unsigned long long)s->steps, (unsigned long long)s->served, took_ms(s, 0.5),
        took_ms(s, 0.99), took_ms(s, 1), (double)daemon_rss_bytes(&s->d) / MIB);
    fflush(NULL);
}

static void soak(struct soak *s, const char *what)
{
    const double end_s = daemon_cpu_s(s->d.pid) + (double)number_of("HELIO_SOAK_SECONDS", 2);
    const uint64_t most_s = number_of("HELIO_SOAK_LIMIT", UINT64_MAX / second_ns),
                   start_ns = hg_clock_now_ns(), least = s->steps + STEPS_EACH * s->count;
    while (s->steps < least || daemon_cpu_s(s->d.pid) < end_s) {
        for (int i = 0; i < STEPS; i++)
            step(s);
        be_served(s, &s->honest[s->served % HONEST]);
        const uint64_t now_ns = hg_clock_now_ns();
        if (now_ns - s->said_ns > 10 * second_ns)
            say(s, what);
        if ((now_ns - start_ns) / second_ns >= most_s) {
            print_message("%s: ended by HELIO_SOAK_LIMIT\n", what);
            break;
        }
    }
    say(s, what);
}

static void sessions_are_within_budget(struct daemon *d, uint64_t most)
{
    struct peer admin;
    uint64_t sessions = 0;
    peer_enter(&admin, d, "admin-token-1");
    peer_call(&admin, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    const char *at = admin.m.json.text.data, *end = at + admin.m.json.text.size;
    while ((at = memmem(at, (size_t)(end - at), "\"requests\":", 11)) != NULL) {
        at++;
        sessions++;
    }
    print_message("%llu sessions\n", (unsigned long long)sessions);
    assert_in_range(sessions, HONEST, most);
    peer_close(&admin);
}

// With those of honest ones, workers and files.
static uint64_t connections(const struct soak *s)
{
    return s->count + s->held + 256;
}

static void soak_begin(struct soak *s)
{
    struct rlimit files;
    s->count = number_of("HELIO_SOAK_SESSIONS", 300);
    s->held = number_of("HELIO_SOAK_HELD", 500);
    s->views = number_of("HELIO_SOAK_VIEWS", UINT64_MAX);
    s->holding = hg_calloc(s->held, sizeof *s->holding);
    s->hostile = hg_calloc(s->count, sizeof *s->hostile);
    assert_true(s->holding && s->hostile);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &files), 0);
    files.rlim_cur = files.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &files), 0);
    if (files.rlim_max < connections(s))
        fail_msg("%llu descriptors are needed, and there may be %llu (ulimit -Hn)",
            (unsigned long long)connections(s), (unsigned long long)files.rlim_max);
    random_state = fuzz_random_start();
    session_stream_load();
    begin_daemon(&s->d, connections(s));
    s->begun_ns = hg_clock_now_ns();
    for (uint64_t i = 0; i < s->held; i++)
        peer_connect(&s->holding[i], &s->d, true);
    for (int i = 0; i < HONEST; i++) {
        peer_enter(&s->honest[i], &s->d, "honest-token-1");
        peer_scene(&s->honest[i], "");
        peer_view(&s->honest[i], 1, 8, 8);
    }
    for (uint64_t i = 0; i < s->count; i++)
        s->hostile[i].p.fd = -1;
    say(s, "begun");
}

// Those that are held are still there, and honest ones are served when the others are gone.
static void soak_end(struct soak *s)
{
    char byte;
    for (uint64_t i = 0; i < s->held; i++)
        assert_int_equal(recv(s->holding[i].fd, &byte, 1, MSG_DONTWAIT), -1);
    for (uint64_t i = 0; i < s->held; i++)
        peer_close(&s->holding[i]);
    for (uint64_t i = 0; i < s->count; i++)
        if (s->hostile[i].p.fd >= 0)
            peer_close(&s->hostile[i].p);
    for (int i = 0; i < HONEST; i++) {
        be_served(s, &s->honest[i]);
        peer_close(&s->honest[i]);
    }
    daemon_finish(&s->d);
    session_stream_free();
    hg_free(s->holding);
    hg_free(s->hostile);
}

static void honest_ones_notice_nothing(void **state)
{
    (void)state;
    static struct soak s;
    soak_begin(&s);
    soak(&s, "warming up");
    const uint64_t before = daemon_rss_bytes(&s.d);
    soak(&s, "soak");
    const uint64_t after = daemon_rss_bytes(&s.d);
    for (int i = 0; i < KINDS; i++)
        print_message("%llu %s, ", (unsigned long long)lived[i], kind_names[i]);
    print_message("%llu held; honest ones served %llu times; %.1f MiB before, %.1f after\n",
        (unsigned long long)s.held, (unsigned long long)s.served, (double)before / MIB,
        (double)after / MIB);
    assert_true(after < before + daemon_allowed(GROWTH));
    sessions_are_within_budget(&s.d, s.count + HONEST + 1);
    soak_end(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(honest_ones_notice_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
