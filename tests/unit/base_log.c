// log.h and status.h: levels by scope, configuration, one safe line per record.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>
#include <unistd.h>

#include "base/log.h"
#include "base/status.h"

static struct hg_log_record last;
static char last_text[1100];
static int records;

static void keep(void *user, const struct hg_log_record *record)
{
    (*(int *)user)++;
    last = *record;
    snprintf(last_text, sizeof last_text, "%s", record->text);
}

static int set_up(void **state)
{
    (void)state;
    records = 0;
    hg_log_set_sink(keep, &records);
    hg_log_set_level(HG_LOG_INFO);
    return 0;
}

static void test_record(void **state)
{
    (void)state;
    hg_log_write(HG_LOG_WARN, HG_LOG_NET, HG_E_TIMEOUT, 42, "after %d %s", 3, "tries");
    assert_int_equal(records, 1);
    assert_int_equal(last.level, HG_LOG_WARN);
    assert_int_equal(last.scope, HG_LOG_NET);
    assert_int_equal(last.status, HG_E_TIMEOUT);
    assert_int_equal(last.session, 42);
    assert_true(last.wall_ns > 0);
    assert_string_equal(last_text, "after 3 tries");
    hg_fault(GPU, HG_E_DEVICE, "gone");
    assert_int_equal(last.level, HG_LOG_ERROR);
    assert_int_equal(last.status, HG_E_DEVICE);
}

static void test_levels(void **state)
{
    (void)state;
    hg_debug(NET, "dropped");
    assert_int_equal(records, 0);
    hg_log_set_scope_level(HG_LOG_NET, HG_LOG_DEBUG);
    hg_debug(NET, "kept");
    hg_debug(GPU, "dropped");
    assert_int_equal(records, 1);
    hg_log_set_level(HG_LOG_ERROR);
    hg_warn(NET, "dropped");
    assert_int_equal(records, 1);
    hg_log_set_sink(NULL, NULL);
    hg_fault(NET, HG_E_IO, "dropped");
    assert_false(hg_log_is_enabled(HG_LOG_ERROR, HG_LOG_NET));
    assert_int_equal(records, 1);
}

static void test_configure(void **state)
{
    (void)state;
    struct hg_error err = {0};
    assert_int_equal(hg_log_configure("warn,net=debug,gpu=info", &err), HG_OK);
    assert_true(hg_log_is_enabled(HG_LOG_DEBUG, HG_LOG_NET));
    assert_true(hg_log_is_enabled(HG_LOG_INFO, HG_LOG_GPU));
    assert_false(hg_log_is_enabled(HG_LOG_INFO, HG_LOG_AUTH));
    assert_true(hg_log_is_enabled(HG_LOG_WARN, HG_LOG_AUTH));
    static const char *const bad[] = {"loud", "net=loud", "nothing=info", "=info",
        "net=", "debug,x", "debug,,info", "net", "INFO", "info ,net=debug"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        err = (struct hg_error){0};
        assert_int_equal(hg_log_configure(bad[i], &err), HG_E_INVAL);
        assert_true(err.reason[0]);
        assert_false(hg_log_is_enabled(HG_LOG_INFO, HG_LOG_AUTH)); // nothing changed
        assert_true(hg_log_is_enabled(HG_LOG_DEBUG, HG_LOG_NET));
    }
    assert_int_equal(hg_log_configure("debug", &err), HG_OK);
    assert_true(hg_log_is_enabled(HG_LOG_DEBUG, HG_LOG_AUTH));
    assert_int_equal(hg_log_configure("", &err), HG_OK);
}

// One record through the logfmt sink into `line`.
static void write_line(const struct hg_log_record *record, char *line, size_t size)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    hg_log_sink_logfmt((void *)(intptr_t)ends[1], record);
    close(ends[1]);
    ssize_t n = read(ends[0], line, size - 1);
    close(ends[0]);
    assert_true(n > 0);
    line[n] = 0;
}

static void test_logfmt(void **state)
{
    (void)state;
    char line[4096];
    struct hg_log_record record = {.wall_ns = UINT64_C(1000000000) * 86400 + 123456789,
        .level = HG_LOG_WARN,
        .scope = HG_LOG_AUTH,
        .status = HG_E_AUTH,
        .session = 7,
        .text = "no"};
    write_line(&record, line, sizeof line);
    assert_string_equal(line,
        "ts=1970-01-02T00:00:00.123Z level=warn scope=auth status=auth session=7 msg=\"no\"\n");
    record.status = HG_OK;
    record.session = 0;
    write_line(&record, line, sizeof line);
    assert_string_equal(line, "ts=1970-01-02T00:00:00.123Z level=warn scope=auth msg=\"no\"\n");
}

static void test_escaping(void **state)
{
    (void)state;
    char line[4096];
    struct hg_log_record record = {
        .scope = HG_LOG_NET, .text = "a\nb\r\t\x1b[31m \"q\" \\ \x7f \xc3\xa9"};
    write_line(&record, line, sizeof line);
    assert_non_null(
        strstr(line, "msg=\"a\\x0ab\\x0d\\x09\\x1b[31m \\\"q\\\" \\\\ \\x7f \xc3\xa9\"\n"));
    assert_ptr_equal(strchr(line, '\n'), line + strlen(line) - 1);
}

static void test_escaping_of_foreign_bytes(void **state)
{
    (void)state;
    char line[4096];
    struct hg_log_record record = {.scope = HG_LOG_NET,
        .text = "\xff \xc3 \xc2\x9b \xed\xa0\x80 \xc2\xa0 \xf0\x9f\x99\x82 \xe2\x82"};
    write_line(&record, line, sizeof line);
    assert_non_null(strstr(line, "msg=\"\\xff \\xc3 \\xc2\\x9b \\xed\\xa0\\x80 \xc2\xa0 "
                                 "\xf0\x9f\x99\x82 \\xe2\\x82\"\n"));
}

// Text of any length stays one line with its end.
static void test_long_text(void **state)
{
    (void)state;
    static char text[5000], line[8192];
    memset(text, '\n', sizeof text - 1); // every byte grows to four
    struct hg_log_record record = {.scope = HG_LOG_NET, .text = text};
    write_line(&record, line, sizeof line);
    size_t length = strlen(line);
    assert_true(length < 2500);
    assert_string_equal(line + length - 2, "\"\n");
    assert_ptr_equal(strchr(line, '\n'), line + length - 1);
    memset(text, 'x', sizeof text - 1);
    hg_info(NET, "%s", text);
    assert_int_equal(strlen(last_text), 1023);
}

// ---- status.h ----------------------------------------------------------------------------------

static void test_status_names(void **state)
{
    (void)state;
    static const int values[] = {
#define HG_STATUS(sym, value, name, text) value,
#include "base/status.def"
#undef HG_STATUS
    };
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        const char *name = hg_status_name((enum hg_status)values[i]);
        assert_string_not_equal(name, "unknown");
        assert_true(hg_status_text((enum hg_status)values[i])[0]);
        for (size_t n = 0; n < i; n++) {
            assert_int_not_equal(values[i], values[n]);
            assert_string_not_equal(name, hg_status_name((enum hg_status)values[n]));
        }
    }
    assert_string_equal(hg_status_name((enum hg_status)9999), "unknown");
    // These numbers are on the wire.
    assert_int_equal(HG_E_INVAL, 1);
    assert_int_equal(HG_E_FORMAT, 6);
    assert_int_equal(HG_E_WORKER, 21);
}

// Details are UTF-8 whatever was put in, also where they were cut: they are sent to clients.
static void test_errors_are_utf8(void **state)
{
    (void)state;
    struct hg_error err;
    char text[600];
    memset(text, 'x', 254);
    strcpy(text + 254, "\xc3\xa9\xc3\xa9"); // cut in the middle of the first
    hg_error_set(&err, HG_E_FORMAT, text, "\xff/a", "%s", "\xc3 b \xe2\x82");
    assert_int_equal(strlen(err.what), 254);
    assert_string_equal(err.where, "?/a");
    assert_string_equal(err.reason, "? b ");
}

static void test_errors(void **state)
{
    (void)state;
    struct hg_error err;
    char text[1024], tiny[8], longer[600];
    assert_int_equal(
        hg_error_set(&err, HG_E_FORMAT, "a.gltf", "/meshes/0", "count %u", 7u), HG_E_FORMAT);
    hg_error_format(&err, text, sizeof text);
    assert_string_equal(text, "a.gltf: /meshes/0: count 7 (format)");
    assert_int_equal(hg_error_set(&err, HG_E_NOMEM, NULL, NULL, "%s", ""), HG_E_NOMEM);
    hg_error_format(&err, text, sizeof text);
    assert_string_equal(text, "memory could not be taken (no-memory)");
    assert_int_equal(hg_error_set(NULL, HG_E_IO, "x", NULL, "y"), HG_E_IO);
    memset(longer, 'x', sizeof longer - 1);
    longer[sizeof longer - 1] = 0;
    hg_error_set(&err, HG_E_IO, longer, longer, "%s", longer);
    assert_int_equal(strlen(err.what), sizeof err.what - 1);
    assert_int_equal(strlen(err.where), sizeof err.where - 1);
    assert_int_equal(strlen(err.reason), sizeof err.reason - 1);
    hg_error_format(&err, tiny, sizeof tiny);
    assert_string_equal(tiny, "xxxxxxx");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_record, set_up),
        cmocka_unit_test_setup(test_levels, set_up),
        cmocka_unit_test_setup(test_configure, set_up),
        cmocka_unit_test_setup(test_logfmt, set_up),
        cmocka_unit_test_setup(test_escaping, set_up),
        cmocka_unit_test_setup(test_escaping_of_foreign_bytes, set_up),
        cmocka_unit_test_setup(test_long_text, set_up),
        cmocka_unit_test(test_status_names),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_errors_are_utf8),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
