// test_state_log.c - the state log: what was durable is read again, whatever happened to its end.
#include <fcntl.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/crc32c.h"
#include "base/file.h"
#include "base/log.h"
#include "server/broker/state/state_file.h"
#include "server/broker/state/state_log.h"
#include "tests/support/folder.h"

struct bodies {
    char text[8192]; // all of them, each with a line end
    uint32_t count;
};

static enum hg_status take(void *user, const uint8_t *body, size_t size)
{
    struct bodies *b = user;
    size_t length = strlen(b->text);
    b->count++;
    if (size < sizeof b->text - length - 1) // large ones are counted only
        snprintf(
            b->text + length, sizeof b->text - length, "%.*s\n", (int)size, (const char *)body);
    return size == 6 && memcmp(body, "refuse", 6) == 0 ? HG_E_FORMAT : HG_OK;
}

struct rig {
    char folder[TEST_FOLDER_MAX], state[TEST_FOLDER_MAX + 16], file[TEST_FOLDER_MAX + 32];
    bool go_on;
    struct hg_state_log *log;
    struct bodies read;
};

static void init(struct rig *r)
{
    *r = (struct rig){0};
    assert_true(test_folder_make(r->folder, "state"));
    snprintf(r->state, sizeof r->state, "%s/state", r->folder);
    snprintf(r->file, sizeof r->file, "%s/state.log", r->state);
}

static enum hg_status try_open(struct rig *r, struct hg_state_log **out)
{
    struct hg_error err = {0};
    r->read = (struct bodies){0};
    return hg_state_log_open(&(struct hg_state_log_options){.folder = r->state,
                                 .wait_for_sync = true,
                                 .go_on = r->go_on,
                                 .sync_interval_ns = 1000000},
        take, &r->read, out, &err);
}

static void open_log(struct rig *r)
{
    assert_int_equal(try_open(r, &r->log), HG_OK);
}

static uint64_t put(struct rig *r, const char *text, struct hg_packet *packet)
{
    struct hg_writer w = {0};
    hg_write_bytes(&w, text, strlen(text));
    return hg_state_log_append(r->log, &w, packet);
}

// Until the log has news, at most so long; false: it has none.
static bool poll_log(struct rig *r, int ms)
{
    struct pollfd fd = {.fd = hg_state_log_fd(r->log), .events = POLLIN};
    if (poll(&fd, 1, ms) <= 0)
        return false;
    hg_state_log_poll(r->log);
    return true;
}

static void await(struct rig *r, uint64_t position)
{
    for (int i = 0; hg_state_log_reached(r->log)->durable < position; i++)
        assert_true(poll_log(r, 20000) && i < 10000);
}

static void close_log(struct rig *r)
{
    hg_state_log_close(r->log);
    r->log = NULL;
}

static void finish(struct rig *r)
{
    close_log(r);
    assert_true(test_folder_remove(r->folder));
}

static struct hg_packet *packet_of(const char *text)
{
    struct hg_packet *packet =
        hg_packet_create(&(struct hgp_header){.length = (uint32_t)strlen(text)});
    assert_non_null(packet);
    memcpy(packet->payload, text, strlen(text));
    return packet;
}

static void checksum_is_crc32c(void **state)
{
    (void)state;
    uint8_t zeros[32] = {0}, odd[3] = {1, 2, 3};
    assert_int_equal(hg_crc32c(0, "123456789", 9), 0xe3069283u); // check value of the algorithm
    assert_int_equal(hg_crc32c(0, zeros, 32), 0x8a9136aau);      // RFC 3720, B.4
    assert_int_equal(hg_crc32c(hg_crc32c(0, odd, 1), odd + 1, 2), hg_crc32c(0, odd, 3));
}

static void durable_records_are_read_again(void **state)
{
    (void)state;
    struct rig r;
    init(&r);
    open_log(&r);
    assert_int_equal(r.read.count, 0);
    struct hg_packet *packet = packet_of("-payload");
    put(&r, "one", NULL);
    put(&r, "two", packet);
    hg_packet_unref(packet); // the log has its own reference
    hg_state_log_sync_file(r.log, open(r.folder, O_RDONLY | O_DIRECTORY), NULL);
    await(&r, put(&r, "three", NULL));
    // A copy of the file as a kill at this moment would leave it.
    uint8_t *data;
    size_t size;
    assert_int_equal(hg_file_read(r.file, 1 << 20, &data, &size, NULL), HG_OK);
    close_log(&r);
    test_file_write(r.file, data, size);
    hg_free(data);
    open_log(&r);
    assert_string_equal(r.read.text, "one\ntwo-payload\nthree\n");
    finish(&r);
}

// Those who ask learn it; the log goes on.
static void files_that_cannot_be_synced(void **state)
{
    (void)state;
    struct rig r;
    struct hg_state_sync bad = {0}, good = {0};
    int ends[2];
    init(&r);
    open_log(&r);
    assert_int_equal(pipe(ends), 0); // fsync of a pipe fails
    hg_state_log_sync_file(r.log, ends[0], &bad);
    hg_state_log_sync_file(r.log, open(r.folder, O_RDONLY | O_DIRECTORY), &bad);
    hg_state_log_sync_file(r.log, open(r.folder, O_RDONLY | O_DIRECTORY), &good);
    assert_int_equal(bad.left, 2);
    await(&r, put(&r, "one", NULL));
    assert_int_equal(bad.left, 0);
    assert_int_equal(bad.status, HG_E_IO);
    assert_int_equal(good.left, 0);
    assert_int_equal(good.status, HG_OK);
    close(ends[1]);
    finish(&r);
}

// Cut at every byte: those that are there completely are read, and the log goes on behind them.
static void torn_tails_are_cut_off(void **state)
{
    (void)state;
    static const char *const texts[] = {"a", "second", "c", "the fourth record"};
    struct rig r;
    uint8_t *data;
    size_t size, ends[5] = {HG_STATE_HEADER_BYTES};
    init(&r);
    open_log(&r);
    for (int i = 0; i < 4; i++) {
        await(&r, put(&r, texts[i], NULL));
        ends[i + 1] = ends[i] + HG_STATE_PREFIX_BYTES + strlen(texts[i]);
    }
    close_log(&r);
    assert_int_equal(hg_file_read(r.file, 1 << 20, &data, &size, NULL), HG_OK);
    assert_int_equal(size, ends[4]);
    for (size_t cut = 0; cut <= size; cut++) {
        char wanted[64] = "";
        for (int i = 0; i < 4 && ends[i + 1] <= cut; i++)
            snprintf(wanted + strlen(wanted), sizeof wanted - strlen(wanted), "%s\n", texts[i]);
        test_file_write(r.file, data, cut);
        open_log(&r);
        assert_string_equal(r.read.text, wanted);
        await(&r, put(&r, "more", NULL));
        close_log(&r);
        strcat(wanted, "more\n");
        open_log(&r);
        assert_string_equal(r.read.text, wanted);
        close_log(&r);
    }
    hg_free(data);
    finish(&r);
}

// The file is there, and is the log that was damaged; it is removed.
static bool is_kept(const char *path, const uint8_t *data, size_t size)
{
    uint8_t *found;
    size_t found_size;
    if (hg_file_read(path, 1 << 20, &found, &found_size, NULL))
        return false;
    assert_int_equal(found_size, size);
    assert_memory_equal(found, data, size);
    hg_free(found);
    assert_int_equal(unlink(path), 0);
    return true;
}

// A damaged byte: what is before it is read, nothing of it or behind it.
static void damage_ends_the_log(void **state)
{
    (void)state;
    struct rig r;
    uint8_t *data;
    size_t size;
    char kept[TEST_FOLDER_MAX + 48];
    init(&r);
    open_log(&r);
    put(&r, "first", NULL);
    await(&r, put(&r, "second", NULL));
    close_log(&r);
    snprintf(kept, sizeof kept, "%s.damaged", r.file);
    assert_int_equal(hg_file_read(r.file, 1 << 20, &data, &size, NULL), HG_OK);
    const size_t second = HG_STATE_HEADER_BYTES + HG_STATE_PREFIX_BYTES + 5;
    for (size_t at = HG_STATE_HEADER_BYTES; at < size; at++)
        for (int bit = 0; bit < 8; bit++) {
            data[at] ^= (uint8_t)(1 << bit);
            test_file_write(r.file, data, size);
            open_log(&r);
            assert_string_equal(r.read.text, at < second ? "" : "first\n");
            close_log(&r);
            // The second record is whole, and where it begins is known.
            const bool is_known = at >= HG_STATE_HEADER_BYTES + 4 && at < second;
            assert_int_equal(is_kept(kept, data, size), is_known);
            data[at] ^= (uint8_t)(1 << bit);
        }
    hg_free(data);
    finish(&r);
}

static void others_are_refused(void **state)
{
    (void)state;
    struct rig r;
    struct hg_state_log *other;
    uint8_t header[HG_STATE_HEADER_BYTES];
    init(&r);
    open_log(&r);
    assert_int_equal(try_open(&r, &other), HG_E_BUSY);
    await(&r, put(&r, "refuse", NULL));
    close_log(&r);
    assert_int_equal(try_open(&r, &other), HG_E_FORMAT); // says the one who takes the records
    hg_state_header_encode(header);
    header[8]++; // a version for which the header's checksum does not hold
    test_file_write(r.file, header, sizeof header);
    assert_int_equal(try_open(&r, &other), HG_E_FORMAT);
    uint32_t crc = hg_crc32c(0, header, 12);
    memcpy(header + 12, &crc, 4);
    test_file_write(r.file, header, sizeof header);
    assert_int_equal(try_open(&r, &other), HG_E_VERSION);
    test_file_write(r.file, "this is no log", 14);
    assert_int_equal(try_open(&r, &other), HG_E_FORMAT);
    unlink(r.file);
    open_log(&r);
    finish(&r);
}

// A snapshot stands for what was before it, what comes while it is written follows it.
static void rewriting_keeps_what_comes_meanwhile(void **state)
{
    (void)state;
    struct rig r;
    enum { LARGE = 8 << 20 };
    char *large = malloc(LARGE + 1);
    memset(large, 'x', LARGE);
    large[LARGE] = 0;
    init(&r);
    open_log(&r);
    await(&r, put(&r, large, NULL));
    assert_true(hg_state_log_wants_snapshot(r.log, hg_clock_now_ns()));
    hg_state_log_begin_snapshot(r.log, hg_clock_now_ns());
    for (int i = 0; i < 3; i++)
        put(&r, large, NULL); // so that it takes some steps
    put(&r, "all", NULL);
    hg_state_log_end_snapshot(r.log);
    for (int i = 0; i < 20; i++)
        await(&r, put(&r, "later", NULL));
    while (hg_state_log_wants_snapshot(r.log, hg_clock_now_ns()))
        assert_true(poll_log(&r, 20000));
    close_log(&r);
    open_log(&r);
    assert_int_equal(r.read.count, 3 + 1 + 20);
    assert_memory_equal(r.read.text, "all\nlater\nlater\n", 16);
    free(large);
    finish(&r);
}

// The old file takes no more while a new one is written: what came after the snapshot is not lost.
static void failures_while_rewriting(void **state)
{
    (void)state;
    struct rig r;
    struct rlimit before, small;
    enum { LARGE = 33 << 20 }; // takes much longer to write than to go on here
    char *large = malloc(LARGE + 1);
    memset(large, 'x', LARGE);
    large[LARGE] = 0;
    init(&r);
    open_log(&r);
    await(&r, put(&r, large, NULL));
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = HG_STATE_HEADER_BYTES + HG_STATE_PREFIX_BYTES + LARGE + 20;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    large[LARGE / 4] = 0;
    hg_state_log_begin_snapshot(r.log, hg_clock_now_ns());
    for (int i = 0; i < 3; i++)
        put(&r, large, NULL); // less than the limit, and two steps at least
    hg_state_log_end_snapshot(r.log);
    uint64_t position = put(&r, "after the snapshot", NULL);
    while (hg_state_log_reached(r.log)->durable < position) {
        assert_true(poll_log(&r, 20000));
        if (!hg_state_log_refusal(r.log) || !hg_state_log_wants_snapshot(r.log, UINT64_MAX))
            continue;
        hg_state_log_begin_snapshot(r.log, hg_clock_now_ns());
        put(&r, "all, after the snapshot", NULL);
        hg_state_log_end_snapshot(r.log);
    }
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    close_log(&r);
    open_log(&r);
    assert_non_null(strstr(r.read.text, "after the snapshot"));
    free(large);
    finish(&r);
}

// From the log's thread, of which a poll has seen the end.
static void count_failures(void *user, const struct hg_log_record *record)
{
    *(_Atomic int *)user += strstr(record->text, "cannot be rewritten") != NULL;
}

static void fail_snapshot(struct rig *r)
{
    hg_state_log_begin_snapshot(r->log, hg_clock_now_ns());
    put(r, "a state that is too long", NULL);
    hg_state_log_end_snapshot(r->log);
    assert_true(poll_log(r, 20000));
}

// A disk that takes no more: nothing counts as durable, until a snapshot could be written.
static void full_disk(bool go_on)
{
    _Atomic int told = 0;
    struct rig r;
    struct rlimit before, small;
    init(&r);
    r.go_on = go_on;
    open_log(&r);
    await(&r, put(&r, "before", NULL));
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = HG_STATE_HEADER_BYTES + 20; // tears the next record
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    uint64_t lost = put(&r, "during the failure", NULL);
    while (!hg_state_log_wants_snapshot(r.log, hg_clock_now_ns()))
        assert_true(poll_log(&r, 20000));
    assert_int_equal(hg_state_log_refusal(r.log), go_on ? HG_OK : HG_E_NOSPACE);
    assert_true((hg_state_log_reached(r.log)->durable >= lost) == go_on);
    hg_log_set_sink(count_failures, &told);
    for (int i = 0; i < 3; i++) // the disk is still full, and the log says so once
        fail_snapshot(&r);
    hg_log_set_sink(NULL, NULL);
    assert_int_equal(told, 1);
    assert_true((hg_state_log_reached(r.log)->durable >= lost) == go_on);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    uint64_t now_ns = hg_clock_now_ns();
    assert_false(hg_state_log_wants_snapshot(r.log, now_ns)); // not at once again
    assert_true(hg_state_log_wants_snapshot(r.log, now_ns + 2000000000u));
    hg_state_log_begin_snapshot(r.log, now_ns);
    put(&r, "before and during", NULL);
    hg_state_log_end_snapshot(r.log);
    while (hg_state_log_wants_snapshot(r.log, UINT64_MAX) ||
           hg_state_log_reached(r.log)->durable < lost)
        assert_true(poll_log(&r, 20000));
    assert_int_equal(hg_state_log_refusal(r.log), HG_OK);
    uint64_t after = put(&r, "after", NULL);
    while (hg_state_log_reached(r.log)->durable == UINT64_MAX ||
           hg_state_log_reached(r.log)->durable < after)
        assert_true(poll_log(&r, 20000));
    close_log(&r);
    open_log(&r);
    assert_string_equal(r.read.text, "before and during\nafter\n");
    finish(&r);
}

static void full_disk_refuses(void **state)
{
    (void)state;
    full_disk(false);
}

static void full_disk_goes_on(void **state)
{
    (void)state;
    full_disk(true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(checksum_is_crc32c),
        cmocka_unit_test(durable_records_are_read_again),
        cmocka_unit_test(files_that_cannot_be_synced),
        cmocka_unit_test(torn_tails_are_cut_off),
        cmocka_unit_test(damage_ends_the_log),
        cmocka_unit_test(others_are_refused),
        cmocka_unit_test(rewriting_keeps_what_comes_meanwhile),
        cmocka_unit_test(failures_while_rewriting),
        cmocka_unit_test(full_disk_refuses),
        cmocka_unit_test(full_disk_goes_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
