// test_broker_parts.c - options, tokens, peers, streams.
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "server/broker/audit.h"
#include "server/broker/connection/auth.h"
#include "server/broker/call_filter.h"
#include "server/broker/connection/listener.h"
#include "server/broker/options.h"
#include "server/broker/connection/packet.h"
#include "server/broker/connection/peer_table.h"
#include "server/broker/workers/worker_pool.h"
#include "tests/support/folder.h"

static char folder[TEST_FOLDER_MAX];

static int make_folder(void **state)
{
    (void)state;
    return !test_folder_make(folder, "broker");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static const char *path_of(const char *name)
{
    static char path[160];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

// ---- options ------------------------------------------------------------------------------------

static enum hg_status parse(
    struct hg_options *o, struct hg_error *err, int argc, const char *const *argv)
{
    *err = (struct hg_error){0};
    return hg_options_parse(argc, (char *const *)argv, o, err);
}

static void options_from_flags_and_file(void **state)
{
    (void)state;
    struct hg_options o;
    struct hg_error err;
    test_text_write(folder, "conf",
        "# comment\n\nmax-views=7\n  asset-root = /a b \nasset-root=/c\n"
        "peer-timeout = 1.5\nsandbox = off\nlog=warn,net=debug\n");
    char config[200];
    snprintf(config, sizeof config, "--config=%s", path_of("conf"));
    const char *argv[] = {"heliod", "--max-pixels", "12345", config, "--texture-budget=64",
        "--require-token", "--sandbox=off", "--host-budget=96"};
    assert_int_equal(parse(&o, &err, 8, argv), HG_OK);
    assert_int_equal(o.max_views, 7);
    assert_int_equal(o.max_pixels, 12345);
    assert_int_equal(o.asset_root.count, 2);
    assert_string_equal(o.asset_root.items[0], "/a b");
    assert_true(o.peer_timeout_ns == 1500000000u);
    assert_true(o.texture_budget_bytes == 64u << 20);
    assert_true(o.host_budget_bytes == 96u << 20);
    assert_true(o.cache_limit_bytes == (uint64_t)32768 << 20);
    assert_true(o.require_token && strcmp(o.sandbox, "off") == 0);
    assert_true(o.max_message_bytes == HGP_LIMIT_OPEN_DEFAULT);
    hg_options_finish(&o);
    // Flags win over the file; a list is replaced as a whole.
    const char *over[] = {
        "heliod", config, "--asset-root", "/x", "--max-views=9", "--sandbox=best-effort"};
    assert_int_equal(parse(&o, &err, 6, over), HG_OK);
    assert_int_equal(o.asset_root.count, 1);
    assert_string_equal(o.asset_root.items[0], "/x");
    assert_int_equal(o.max_views, 9);
    assert_string_equal(o.sandbox, "best-effort");
    hg_options_finish(&o);
}

static void bad_options_are_named(void **state)
{
    (void)state;
    static const char *const bad[] = {"--max-views=0", "--max-views=1.5", "--max-views=-1",
        "--max-views=4097", "--max-views=9x", "--max-views=", "--max-views", "--nonsense",
        "--no-max-views", "--peer-timeout=nan", "--peer-timeout=inf", "--sandbox=perhaps",
        "--sandbox=req", "--listen=", "stray", "--", "--print-docs=html",
        "--config=/nonexistent/file"};
    struct hg_options o;
    struct hg_error err;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        const char *argv[] = {"heliod", bad[i]};
        if (parse(&o, &err, 2, argv) == HG_OK)
            fail_msg("%s is taken", bad[i]);
        assert_true(err.what[0] && err.reason[0]);
        hg_options_finish(&o); // left empty
    }
    static const char *const files[] = {
        "max-views\n", "\n\nmax-views = x\n", "color = red\n", "= 5\n", "config = other\n"};
    char config[200];
    snprintf(config, sizeof config, "--config=%s", path_of("bad"));
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        test_text_write(folder, "bad", files[i]);
        const char *argv[] = {"heliod", config};
        assert_int_equal(parse(&o, &err, 2, argv), HG_E_INVAL);
        assert_string_equal(err.what, path_of("bad"));
        assert_string_equal(err.where, i == 1 ? "line 3" : "line 1");
    }
}

static void reload_keeps_start_options(void **state)
{
    (void)state;
    struct hg_options now, next;
    struct hg_error err;
    char names[100];
    const char *first[] = {"heliod", "--listen=unix:/a", "--max-views=3"};
    const char *second[] = {"heliod", "--listen=unix:/b", "--max-views=4", "--device=1"};
    assert_int_equal(parse(&now, &err, 3, first), HG_OK);
    assert_int_equal(parse(&next, &err, 4, second), HG_OK);
    assert_int_equal(hg_options_reload(&now, &next, names, sizeof names), 2);
    assert_string_equal(names, "listen device");
    assert_int_equal(now.max_views, 4);
    assert_string_equal(now.listen.items[0], "unix:/a");
    hg_options_finish(&now);
}

static void options_without_memory(void **state)
{
    (void)state;
    struct hg_options o;
    struct hg_error err;
    const char *argv[] = {"heliod", "--listen=unix:/a", "--tokens=/t", "--asset-root=/r"};
    for (uint64_t n = 1;; n++) {
        hg_alloc_fail_at(n);
        enum hg_status status = parse(&o, &err, 4, argv);
        bool reached = hg_alloc_count() >= n;
        hg_alloc_fail_at(0);
        hg_options_finish(&o);
        if (!reached)
            break;
        assert_int_equal(status, HG_E_NOMEM);
    }
}

// ---- tokens -------------------------------------------------------------------------------------

static const struct hg_token *find_token(
    const struct hg_tokens *tokens, const char *token, int64_t now_s)
{
    uint8_t hash[32];
    assert_int_equal(hg_token_hash(hgp_str_make(token), hash), HG_OK);
    return hg_tokens_find(tokens, hash, now_s);
}

static void tokens_are_read(void **state)
{
    (void)state;
    struct hg_tokens tokens;
    struct hg_error err;
    test_text_write(
        folder, "tokens", "# comment\n\n\tabcdefgh  VIEW anna\r\nijklmnop edit\nqrstuvwx admin z");
    assert_int_equal(chmod(path_of("tokens"), 0600), 0);
    assert_int_equal(hg_tokens_read(path_of("tokens"), &tokens, &err), HG_OK);
    assert_int_equal(tokens.count, 3);
    assert_false(tokens.exposed);
    const struct hg_token *t = find_token(&tokens, "abcdefgh", 1);
    assert_non_null(t);
    assert_int_equal(t->role, HGP_role_VIEW);
    assert_string_equal(t->name, "anna");
    assert_null(find_token(&tokens, "abcdefg", 1));
    assert_null(find_token(&tokens, "", 1));
    hg_tokens_finish(&tokens);
    assert_int_equal(chmod(path_of("tokens"), 0640), 0);
    assert_int_equal(hg_tokens_read(path_of("tokens"), &tokens, &err), HG_OK);
    assert_true(tokens.exposed);
    hg_tokens_finish(&tokens);
    static const char *const bad[] = {"short view\n", "longenough\n", "longenough king\n",
        "longenough none\n", "longenough view a b\n"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        test_text_write(folder, "tokens", bad[i]);
        assert_int_equal(hg_tokens_read(path_of("tokens"), &tokens, &err), HG_E_INVAL);
        assert_string_equal(err.where, "line 1");
        assert_int_equal(tokens.count, 0);
    }
    test_text_write(folder, "tokens", "abcdefgh edit\nijklmnop view\nabcdefgh view\n"); // twice
    assert_int_equal(hg_tokens_read(path_of("tokens"), &tokens, &err), HG_E_INVAL);
    assert_string_equal(err.where, "line 3");
    assert_non_null(strstr(err.reason, "the token of line 1 again"));
}

static void tokens_have_scopes(void **state)
{
    (void)state;
    struct hg_tokens tokens;
    struct hg_error err;
    char text[400], hex[HG_SHA256_HEX];
    uint8_t hash[32];
    assert_int_equal(hg_token_hash(hgp_str_make("hidden-token"), hash), HG_OK);
    hg_sha256_hex(hash, hex);
    snprintf(text, sizeof text,
        "sha256:%s edit carl expires=2030-01-02 scenes=hall-* sessions=3 rate=500 roots=/srv/a:/b\n"
        "plain-token view expires=1970-01-02T00:00:10Z\n",
        hex);
    test_text_write(folder, "tokens", text);
    assert_int_equal(hg_tokens_read(path_of("tokens"), &tokens, &err), HG_OK);
    assert_int_equal(tokens.plain, 1);
    const struct hg_token *t = find_token(&tokens, "hidden-token", 1000);
    assert_non_null(t);
    assert_string_equal(t->name, "carl");
    assert_int_equal(t->scope.expires_s, 1893542400);
    assert_string_equal(t->scope.scenes, "hall-*");
    assert_string_equal(t->scope.roots, "/srv/a:/b");
    assert_int_equal(t->scope.max_sessions, 3);
    assert_int_equal(t->scope.max_rate, 500);
    assert_null(find_token(&tokens, "hidden-token", 1893542400));
    t = find_token(&tokens, "plain-token", 86409);
    assert_non_null(t);
    assert_string_equal(t->name, "view");
    assert_null(find_token(&tokens, "plain-token", 86410));
    hg_tokens_finish(&tokens);
    static const char *const bad[] = {"sha256:abc view\n", "longenough view x expires=tomorrow\n",
        "longenough view x sessions=0\n", "longenough view x rate=1e3\n",
        "longenough view x scenes=\n", "longenough view x colour=red\n",
        "longenough view x roots=srv\n", "longenough view x roots=/srv:\n",
        "longenough view expires=2030-01-01 x\n"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        test_text_write(folder, "tokens", bad[i]);
        assert_int_equal(hg_tokens_read(path_of("tokens"), &tokens, &err), HG_E_INVAL);
    }
}

static void peers_are_counted(void **state)
{
    (void)state;
    static struct hg_peer_table table;
    const uint64_t s = 1000000000u;
    struct hg_peer_entry *a = hg_peer_table_join(&table, "10.0.0.1/32");
    assert_ptr_equal(hg_peer_table_join(&table, "10.0.0.1/32"), a);
    assert_int_equal(a->connections, 2);
    for (int i = 0; i < 3; i++)
        hg_peer_table_count_failure(&table, a, NULL, 100 * s);
    hg_peer_table_leave(&table, a, 110 * s);
    hg_peer_table_leave(&table, a, 110 * s);
    // It is remembered without a connection, for a minute.
    a = hg_peer_table_join(&table, "10.0.0.1/32");
    assert_int_equal(a->connections, 1);
    assert_int_equal(hg_peer_entry_failures(a, 159 * s), 3);
    assert_int_equal(hg_peer_entry_failures(a, 161 * s), 0);
    assert_int_equal(hg_peer_table_all_failures(&table, 159 * s), 3);
    assert_int_equal(hg_peer_table_all_failures(&table, 161 * s), 0);
    hg_peer_table_leave(&table, a, 161 * s);
    assert_int_equal(table.idle_count, 0);
    // A flood of addresses pushes out the oldest, not the newest, and takes bounded memory.
    char key[32];
    for (int i = 0; i < HG_PEER_TABLE_IDLE + 20; i++) {
        snprintf(key, sizeof key, "10.%d.%d.1/32", i >> 8, i & 255);
        a = hg_peer_table_join(&table, key);
        hg_peer_table_count_failure(&table, a, NULL, 200 * s);
        hg_peer_table_leave(&table, a, 200 * s);
    }
    assert_int_equal(table.idle_count, HG_PEER_TABLE_IDLE);
    assert_int_equal(hg_peer_entry_failures(hg_peer_table_join(&table, key), 201 * s), 1);
    assert_int_equal(hg_peer_entry_failures(hg_peer_table_join(&table, "10.0.1.1/32"), 201 * s), 0);
    hg_peer_table_finish(&table);
}

static void slow_queues_are_found(void **state)
{
    (void)state;
    const uint64_t s = 1000000000u;
    struct hg_outq q = {0};
    assert_true(hg_outq_is_drained(&q, 100 * s, s, 1000)); // empty
    struct hg_packet *packet = hg_packet_encode(HGP_T_ping, &(struct hgp_ping){.nonce = 1});
    assert_int_equal(hg_outq_push(&q, packet, 0, 0), HG_OK);
    q.window_ns = 100 * s;
    assert_true(hg_outq_is_drained(&q, 109 * s, 10 * s, 1000)); // too early to say
    q.window_bytes = 9999;
    assert_false(hg_outq_is_drained(&q, 110 * s, 10 * s, 1000));
    q.window_bytes = 10000; // it was begun anew
    assert_true(hg_outq_is_drained(&q, 120 * s, 10 * s, 1000));
    assert_int_equal(q.window_bytes, 0);
    hg_outq_finish(&q);
}

static void audit_logs_are_rotated(void **state)
{
    (void)state;
    struct hg_audit audit;
    struct hg_error err;
    char path[200], old[220];
    struct stat st;
    snprintf(path, sizeof path, "%s", path_of("audit"));
    assert_int_equal(hg_audit_open(&audit, path, &err), HG_OK);
    hg_audit_set_limits(&audit, 300, 2);
    for (int i = 0; i < 40; i++)
        hg_audit_write(&audit, "test", &(struct hg_audit_actor){.session = 7, .name = "a\"b"},
            i % 2 ? HG_E_AUTH : HG_OK, "text");
    hg_audit_close(&audit);
    for (int i = 0; i < 3; i++) {
        snprintf(old, sizeof old, i ? "%s.%d" : "%s", path, i);
        assert_int_equal(stat(old, &st), 0);
        assert_true(st.st_size > 0 && st.st_size < 300 + 200); // a line more at most
        assert_int_equal(st.st_mode & 0777, 0600);
    }
    snprintf(old, sizeof old, "%s.3", path);
    assert_int_equal(stat(old, &st), -1);
    // A later run goes on at the end.
    assert_int_equal(hg_audit_open(&audit, path, &err), HG_OK);
    uint64_t before = audit.bytes;
    assert_int_equal(stat(path, &st), 0);
    assert_int_equal(before, st.st_size);
    hg_audit_write(&audit, "more", NULL, HG_OK, NULL);
    assert_true(audit.bytes > before);
    hg_audit_close(&audit);
    assert_int_equal(hg_audit_open(&audit, "/nonexistent/audit", &err), HG_E_NOTFOUND);
    assert_int_equal(hg_audit_open(&audit, NULL, &err), HG_OK); // nothing is written
    hg_audit_write(&audit, "test", NULL, HG_OK, NULL);
    hg_audit_close(&audit);
}

static void addresses_are_checked(void **state)
{
    (void)state;
    static const char *const good[] = {
        "unix:/a", "tcp:localhost:80", "tcp:[::1]:0", "tcp:*:65535", "tcp:127.0.0.1:1"};
    static const char *const bad[] = {"", "unix:", "tcp:", "tcp:80", "tcp::1", "tcp:a:", "tcp:a:b",
        "tcp:a:65536", "tcp:::1:80", "udp:a:1", "/a"};
    bool is_tcp, is_tls;
    struct hg_error err;
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        assert_int_equal(hg_listener_check(good[i], &is_tcp, &is_tls, &err), HG_OK);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        if (hg_listener_check(bad[i], &is_tcp, &is_tls, &err) != HG_E_INVAL)
            fail_msg("'%s' is taken", bad[i]);
}

// ---- streams ------------------------------------------------------------------------------------

// Messages of many sizes, cut at every kind of place, arrive as they were sent.
static void streams_are_cut_into_messages(void **state)
{
    (void)state;
    int pair[2];
    struct hg_outq out = {0};
    struct hgp_framer in = {.frames = &hg_packet_frames};
    struct hg_transport from, to;
    uint32_t received = 0;
    enum { COUNT = 60 };
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    hg_transport_open(&from, &hg_transport_unix, pair[0]);
    hg_transport_open(&to, &hg_transport_unix, pair[1]);
    for (uint32_t i = 0; i < COUNT; i++) {
        struct hgp_header header = {.length = i * i * 97, .type = 1};
        struct hg_packet *packet = hg_packet_create(&header);
        assert_non_null(packet);
        memset(packet->payload, (int)i, header.length);
        assert_int_equal(hg_outq_push(&out, packet, i, i + 1), HG_OK);
    }
    while (received < COUNT) {
        assert_int_equal(hg_outq_flush(&out, &from), HG_OK);
        enum hg_status status = hg_packet_receive(&in, &to);
        assert_true(status == HG_OK || status == HG_E_AGAIN);
        for (;;) {
            struct hg_packet *packet;
            assert_int_equal(hg_packet_next(&in, 1 << 20, &packet), HG_OK);
            if (!packet)
                break;
            assert_int_equal(packet->header.length, received * received * 97);
            assert_int_equal(packet->header.request, received);
            assert_int_equal(packet->header.channel, received + 1);
            for (uint32_t i = 0; i < packet->header.length; i++)
                assert_int_equal(packet->payload[i], (uint8_t)received);
            received++;
            hg_packet_unref(packet);
        }
    }
    assert_int_equal(out.bytes, 0);
    // Too long, and flags that do not exist: refused with the header alone.
    uint8_t header[HGP_HEADER_BYTES];
    struct hg_packet *packet;
    hgp_header_encode(&(struct hgp_header){.length = (1 << 20) + 1}, header);
    assert_int_equal(send(pair[0], header, sizeof header, 0), sizeof header);
    assert_int_equal(hg_packet_receive(&in, &to), HG_OK);
    assert_int_equal(hg_packet_next(&in, 1 << 20, &packet), HG_E_LIMIT);
    assert_null(packet);
    hg_transport_close(&from);
    assert_int_equal(hg_packet_receive(&in, &to), HG_E_CLOSED);
    hg_transport_close(&to);
    hg_transport_close(&to); // closed already
    hgp_framer_finish(&in);
    hg_outq_finish(&out);
}

// ---- system calls -------------------------------------------------------------------------------

// 0: what is refused is refused, and what is needed works. In a process of its own.
static int try_filter(void)
{
    struct timespec zero = {0};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || !hg_call_filter_enter())
        return 1;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    const long refused[] = {SYS_ptrace, SYS_process_vm_readv, SYS_bpf, SYS_io_uring_setup,
        SYS_userfaultfd, SYS_perf_event_open, SYS_keyctl, SYS_unshare, SYS_setns, SYS_kexec_load,
        SYS_init_module, SYS_open_by_handle_at, SYS_chroot, SYS_personality, SYS_mknodat};
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        if (syscall(refused[i], 0, 0, 0, 0, 0) != -1 || errno != EPERM)
            return 2;
#endif
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), status = 1;
    pid_t pid = fork();
    if (pid == 0)
        _exit(0);
    bool works = fd >= 0 && pid > 0 && waitpid(pid, &status, 0) == pid && status == 0 &&
                 nanosleep(&zero, NULL) == 0 && open("/dev/null", O_RDONLY | O_CLOEXEC) >= 0;
    return works ? 0 : 3;
}

static void the_daemon_has_a_list_of_calls(void **state)
{
    (void)state;
    int status = 1;
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0)
        _exit(try_filter());
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

// ---- workers ------------------------------------------------------------------------------------

static void scenes_are_spread_over_workers(void **state)
{
    (void)state;
    struct hg_worker_pool pool;
    struct hg_options o = {.isolation = (char *)"shared", .shared_workers = 3};
    assert_int_equal(
        hg_worker_pool_init(&pool, &(struct hg_link){.options = &o}, NULL, NULL, 0), HG_OK);
    struct hg_link *links = pool.links;
    assert_false(hg_worker_pool_is_up(&pool));
    for (int i = 0; i < 7; i++) { // none runs yet
        struct hg_link *link = hg_worker_pool_route(&pool, "anna", 0);
        assert_ptr_equal(link, &links[i % 3]);
        link->whose.scene_count++;
    }
    links[0].state = links[2].state = HG_LINK_UP;
    assert_ptr_equal(hg_worker_pool_route(&pool, "anna", 0), &links[2]); // 3, 2 (down), 2
    links[2].whose.scene_count = 4;
    assert_ptr_equal(hg_worker_pool_route(&pool, "anna", 0), &links[0]);
    links[2].state = HG_LINK_STARTING;
    links[0].state = HG_LINK_DOWN;
    links[0].restart_ns = 7;
    links[1].restart_ns = 5;
    assert_ptr_equal(hg_worker_pool_route(&pool, "anna", 0), &links[1]);
    assert_true(hg_worker_pool_deadline_ns(&pool) == 5);
    links[0].state = links[1].state = links[2].state = HG_LINK_UP;
    assert_true(hg_worker_pool_is_up(&pool));
    assert_true(hg_worker_pool_deadline_ns(&pool) == UINT64_MAX);
    hg_free(pool.links);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(options_from_flags_and_file),
        cmocka_unit_test(bad_options_are_named),
        cmocka_unit_test(reload_keeps_start_options),
        cmocka_unit_test(options_without_memory),
        cmocka_unit_test(tokens_are_read),
        cmocka_unit_test(tokens_have_scopes),
        cmocka_unit_test(peers_are_counted),
        cmocka_unit_test(slow_queues_are_found),
        cmocka_unit_test(audit_logs_are_rotated),
        cmocka_unit_test(addresses_are_checked),
        cmocka_unit_test(streams_are_cut_into_messages),
        cmocka_unit_test(the_daemon_has_a_list_of_calls),
        cmocka_unit_test(scenes_are_spread_over_workers),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
