// caches.c - what a worker may write is read by workers of its tenant only; compiled shaders, which
// are code, by no other worker at all.
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/sha256.h"
#include "tests/attack/tenant_rig.h"

static const char entry[] = "store/entry.hgs", code[] = "shaders/code";

// The value of a flag of a worker.
static void flag_of(pid_t pid, const char *flag, char *out, size_t size)
{
    char path[64], text[16384];
    snprintf(path, sizeof path, "/proc/%d/cmdline", (int)pid);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    const size_t length = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[length] = 0;
    out[0] = 0;
    for (size_t at = 0; at < length; at += strlen(text + at) + 1)
        if (strcmp(text + at, flag) == 0)
            snprintf(out, size, "%s", text + at + strlen(flag) + 1);
    assert_true(out[0] == '/');
}

static bool has(const char *folder, const char *name)
{
    char path[2000];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return access(path, F_OK) == 0;
}

static void begin_idle(struct daemon *d)
{
    tenant_rig_init(d);
    daemon_option(d, "worker-idle", "0.2");
    daemon_start(d);
}

static void leave(struct peer *p, struct daemon *d, pid_t pid)
{
    char text[80];
    snprintf(text, sizeof text, "worker %d of anna is stopped", (int)pid);
    peer_call(p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    daemon_wait_log(d, text);
}

static void baked_data_stay_with_their_tenant(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    char annas[512], berts[512];
    begin_idle(&d);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    flag_of(pid, "--cache-dir", annas, sizeof annas);
    flag_of(tenant_await_worker(&d, "bert", 0), "--cache-dir", berts, sizeof berts);
    assert_string_not_equal(annas, berts);
    test_text_write(annas, entry, "baked");
    test_text_write(annas, code, "compiled");
    leave(&anna, &d, pid);
    assert_false(has(annas, entry) || has(annas, code)); // whoever has that place now
    assert_false(has(berts, entry) || has(berts, code));
    peer_scene(&anna, "hall"); // in a worker that has met nobody before
    pid = tenant_await_worker(&d, "anna", pid);
    flag_of(pid, "--cache-dir", annas, sizeof annas);
    assert_true(has(annas, entry));
    assert_false(has(annas, code));
    // Its next process finds what the one before it had.
    test_text_write(annas, code, "compiled");
    kill(pid, SIGKILL);
    pid_t next = tenant_await_worker(&d, "anna", pid);
    flag_of(next, "--cache-dir", berts, sizeof berts);
    assert_string_equal(annas, berts);
    assert_true(has(annas, entry) && has(annas, code));
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

static void enter_and_upload(
    struct peer *p, struct daemon *d, struct hgp_upload *upload, char hex[HG_SHA256_HEX])
{
    *upload = (struct hgp_upload){.total = 5, .data = {(const uint8_t *)"model", 5}};
    assert_int_equal(hg_sha256("model", 5, upload->hash), HG_OK);
    hg_sha256_hex(upload->hash, hex);
    tenant_enter(p, d, "anna-token-1", "hall");
    peer_call(p, HGP_T_upload, upload, HGP_T_ok);
}

// A daemon that is killed leaves homes behind; the next one gives tenants what is theirs.
static void homes_are_recovered(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna;
    char cache[512], uploads[520], hex[HG_SHA256_HEX];
    struct hgp_upload upload;
    begin_idle(&d);
    enter_and_upload(&anna, &d, &upload, hex);
    flag_of(tenant_await_worker(&d, "anna", 0), "--cache-dir", cache, sizeof cache);
    test_text_write(cache, entry, "baked");
    test_text_write(cache, code, "compiled");
    daemon_signal(&d, SIGKILL);
    daemon_reap(&d);
    peer_close(&anna);
    daemon_start(&d);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    assert_false(has(cache, code)); // of the home nothing is left
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    flag_of(pid, "--cache-dir", cache, sizeof cache);
    flag_of(pid, "--upload-dir", uploads, sizeof uploads - 8);
    strcat(uploads, "/uploads");
    assert_true(has(cache, entry));
    assert_true(has(uploads, hex) && peer_has_upload(&anna, upload.hash));
    peer_close(&anna);
    daemon_finish(&d);
}

// A program that takes over finds workers in their homes, and knows whose the contents in them are.
static void homes_are_taken_over(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna;
    char cache[512], uploads[520], hex[HG_SHA256_HEX];
    struct hgp_upload upload;
    begin_idle(&d);
    enter_and_upload(&anna, &d, &upload, hex);
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    flag_of(pid, "--cache-dir", cache, sizeof cache);
    flag_of(pid, "--upload-dir", uploads, sizeof uploads - 8);
    strcat(uploads, "/uploads");
    test_text_write(cache, entry, "baked");
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "took over");
    assert_true(peer_has_upload(&anna, upload.hash));
    assert_int_equal(tenant_await_worker(&d, "anna", 0), pid);
    assert_true(has(cache, entry) && has(uploads, hex));
    leave(&anna, &d, pid);
    assert_false(has(uploads, hex));
    assert_true(peer_has_upload(&anna, upload.hash));
    peer_close(&anna);
    daemon_finish(&d);
}

// A worker is shown the contents that its tenant has sent, before and after it began, and no
// others.
static void uploads_are_shown_to_their_tenant(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    char annas[520], berts[520], hex[2][HG_SHA256_HEX];
    struct hgp_upload uploads[2] = {{.total = 5, .data = {(const uint8_t *)"first", 5}},
        {.total = 6, .data = {(const uint8_t *)"second", 6}}};
    struct stat st;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(
            hg_sha256(uploads[i].data.data, uploads[i].data.size, uploads[i].hash), HG_OK);
        hg_sha256_hex(uploads[i].hash, hex[i]);
    }
    begin_idle(&d);
    tenant_enter(&anna, &d, "anna-token-1", NULL);
    peer_call(&anna, HGP_T_upload, &uploads[0], HGP_T_ok);
    peer_scene(&anna, "hall");
    peer_call(&anna, HGP_T_upload, &uploads[1], HGP_T_ok);
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    flag_of(pid, "--upload-dir", annas, sizeof annas - 8);
    strcat(annas, "/uploads");
    flag_of(tenant_await_worker(&d, "bert", 0), "--upload-dir", berts, sizeof berts - 8);
    strcat(berts, "/uploads");
    assert_true(has(annas, hex[0]) && has(annas, hex[1]));
    assert_false(has(berts, hex[0]) || has(berts, hex[1]));
    assert_int_equal(stat(annas, &st), 0);
    assert_true(S_ISDIR(st.st_mode));
    leave(&anna, &d, pid);
    assert_false(has(annas, hex[0]) || has(annas, hex[1]));
    assert_true(peer_has_upload(&anna, uploads[0].hash));
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

// A spare is in its namespaces before it has a tenant: what is moved into its home is seen there.
static void a_confined_spare_sees_its_tenant_s_files(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna;
    char cache[512], path[1400], hex[HG_SHA256_HEX];
    struct hgp_upload upload = {.total = 5, .data = {(const uint8_t *)"model", 5}};
    assert_int_equal(hg_sha256("model", 5, upload.hash), HG_OK);
    hg_sha256_hex(upload.hash, hex);
    tenant_rig_init(&d);
    daemon_option(&d, "worker-idle", "0.2");
    daemon_option(&d, "sandbox", "best-effort"); // as far as this system allows
    daemon_start(&d);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    peer_call(&anna, HGP_T_upload, &upload, HGP_T_ok);
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    flag_of(pid, "--cache-dir", cache, sizeof cache);
    test_text_write(cache, entry, "baked");
    leave(&anna, &d, pid);
    peer_scene(&anna, "hall");
    pid = tenant_await_worker(&d, "anna", pid);
    flag_of(pid, "--cache-dir", cache, sizeof cache);
    snprintf(path, sizeof path, "/proc/%d/root%s", (int)pid, cache);
    assert_true(has(path, entry));
    flag_of(pid, "--upload-dir", cache, sizeof cache);
    snprintf(path, sizeof path, "/proc/%d/root%s/uploads", (int)pid, cache);
    assert_true(has(path, hex));
    peer_close(&anna);
    daemon_finish(&d);
}

// As a worker does that was taken over: what it fills the disk with goes, and it as well. The same
// with a daemon that found the worker there when it took over.
static void a_folder_without_limit_goes_with_its_worker(void **state)
{
    (void)state;
    const off_t large = (off_t)520 << 20;
    struct daemon d;
    struct peer anna, bert;
    char cache[512], path[600];
    tenant_rig_init(&d);
    daemon_option(&d, "cache-limit", "16"); // 1 MiB for each of 8
    daemon_start(&d);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    const pid_t other = tenant_await_worker(&d, "bert", 0);
    for (int i = 0; i < 2; i++) {
        flag_of(pid, "--cache-dir", cache, sizeof cache);
        snprintf(path, sizeof path, "%s/junk", cache);
        const int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        assert_true(fd >= 0);
        assert_int_equal(posix_fallocate(fd, 0, large), 0);
        close(fd);
        daemon_wait_log(&d, "far above what cache-limit allows");
        pid = tenant_await_worker(&d, "anna", pid);
        flag_of(pid, "--cache-dir", cache, sizeof cache);
        assert_false(has(cache, "junk"));
        assert_true(has(cache, "store") && has(cache, "shaders"));
        peer_call(&anna, HGP_T_node_set, &(struct hgp_node_set){.node = anna.first_id}, HGP_T_ok);
        peer_call(&bert, HGP_T_node_set, &(struct hgp_node_set){.node = bert.first_id}, HGP_T_ok);
        assert_int_equal(tenant_await_worker(&d, "bert", 0), other);
        if (i == 0) {
            daemon_signal(&d, SIGUSR2);
            daemon_wait_log(&d, "took over");
        }
    }
    snprintf(path, sizeof path, "%s/cache/discarded", d.folder);
    daemon_signal(&d, SIGTERM);
    daemon_wait(&d);
    assert_int_not_equal(rmdir(path) == 0 || errno == ENOENT, 0); // all of it was removed
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

// Where shaders cannot be compiled in advance tenants are served all the same.
static void shaders_are_compiled_by_nobody_s_worker(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna;
    begin_idle(&d);
    pid_t spare = tenant_await_worker(&d, "", 0);
    daemon_wait_log(&d, "shaders are compiled in advance");
    assert_true(tenant_await_worker(&d, "", spare) != spare); // begins with them
    daemon_finish(&d);
    tenant_rig_init(&d);
    daemon_write(&d, "die.compile", "");
    daemon_start(&d);
    daemon_wait_log(&d, "shaders are not compiled in advance");
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    tenant_await_worker(&d, "anna", 0);
    peer_close(&anna);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(baked_data_stay_with_their_tenant),
        cmocka_unit_test(homes_are_recovered),
        cmocka_unit_test(homes_are_taken_over),
        cmocka_unit_test(uploads_are_shown_to_their_tenant),
        cmocka_unit_test(a_confined_spare_sees_its_tenant_s_files),
        cmocka_unit_test(a_folder_without_limit_goes_with_its_worker),
        cmocka_unit_test(shaders_are_compiled_by_nobody_s_worker),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
