// Reports: JUnit is well-formed XML, HTML has no markup of the texts, whatever bytes they hold.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "client/cli/run/report.h"

// A small checker of the XML that reports use: one root, matched tags, quoted attributes with legal
// characters and known entities. Returns the number of elements, or -1.
static int check_xml(const char *p)
{
    const char *open[16];
    size_t lengths[16];
    int depth = 0, elements = 0;
    if (strncmp(p, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", 39) != 0)
        return -1;
    for (p += 39; *p;) {
        if (*p == ' ' || *p == '\n') {
            p++;
            continue;
        }
        if (*p != '<' && depth > 0) { // text
            if (*p == '>' || (unsigned char)*p < 0x20)
                return -1;
            p++;
            continue;
        }
        if (*p++ != '<' || (elements && depth == 0))
            return -1;
        bool closing = *p == '/';
        p += closing;
        size_t n = strcspn(p, " />");
        if (closing) {
            if (!depth || lengths[depth - 1] != n || memcmp(open[depth - 1], p, n) || p[n] != '>')
                return -1;
            depth--;
            p += n + 1;
            continue;
        }
        const char *name = p;
        elements++;
        for (p += n; *p == ' ';) {
            p += 1 + strcspn(p + 1, "=");
            if (*p++ != '=' || *p++ != '"')
                return -1;
            for (; *p && *p != '"'; p++) {
                if (*p == '<' || (unsigned char)*p < 0x20)
                    return -1;
                if (*p == '&' && strncmp(p, "&amp;", 5) && strncmp(p, "&lt;", 4) &&
                    strncmp(p, "&gt;", 4) && strncmp(p, "&quot;", 6) && strncmp(p, "&apos;", 6) &&
                    strncmp(p, "&#10;", 5) && strncmp(p, "&#9;", 4))
                    return -1;
            }
            if (*p++ != '"')
                return -1;
        }
        if (p[0] == '/' && p[1] == '>') {
            p += 2;
        } else if (*p++ == '>' && depth < 16) {
            lengths[depth] = n;
            open[depth++] = name;
        } else {
            return -1;
        }
    }
    return depth == 0 ? elements : -1;
}

static void add(struct hg_cli_report *report, const char *name, enum hg_cli_verdict verdict,
    const char *message)
{
    const struct hg_cli_case c = {.verdict = verdict, .name = name, .message = message};
    assert_int_equal(hg_cli_report_add(report, &c), HG_OK);
}

static char *render(const struct hg_cli_report *report, bool html, const char *folder)
{
    struct hg_writer w = {0};
    assert_int_equal(
        html ? hg_cli_report_write_html(report, &w) : hg_cli_report_write_junit(report, folder, &w),
        HG_OK);
    char *text = calloc(w.size + 1, 1);
    assert_non_null(text);
    memcpy(text, w.data, w.size);
    hg_writer_finish(&w);
    return text;
}

static void test_report(void **state)
{
    (void)state;
    struct hg_cli_report report = {0};
    assert_int_equal(hg_cli_report_begin(&report, "dir/s&t.hs"), HG_OK);
    add(&report, "line 1: a <b> & \"c\"", HG_CLI_PASSED, "");
    add(&report, "two", HG_CLI_DIFFERS, "saw 'x'\n\ty");
    add(&report, "three", HG_CLI_BROKEN, "\x01\x02 caf\xc3\xa9");
    add(&report, "four", HG_CLI_SKIPPED, NULL);
    assert_int_equal(hg_cli_report_begin(&report, "other.hs"), HG_OK);
    add(&report, "five", HG_CLI_UPDATED, "replaced");
    char *text = render(&report, false, NULL);
    assert_int_equal(check_xml(text), 1 + 2 + 5 + 3);
    assert_non_null(strstr(text, "tests=\"4\" failures=\"1\" errors=\"1\" skipped=\"1\""));
    assert_non_null(strstr(text, "tests=\"1\" failures=\"0\" errors=\"0\" skipped=\"0\""));
    assert_non_null(strstr(text, "a &lt;b&gt; &amp; &quot;c&quot;"));
    assert_non_null(strstr(text, "?? caf\xc3\xa9"));
    free(text);
    text = render(&report, true, NULL);
    assert_non_null(strstr(text, "1 passed, 1 updated, 1 failed, 1 errors, 1 skipped"));
    assert_non_null(strstr(text, "a &lt;b&gt; &amp; &quot;c&quot;"));
    assert_null(strstr(text, "<b>"));
    free(text);
    hg_cli_report_finish(&report);
    text = render(&report, false, NULL);
    assert_int_equal(check_xml(text), 1);
    free(text);
}

static void test_pictures(void **state)
{
    (void)state;
    struct hg_cli_report report = {0};
    const struct hg_cli_case c = {.verdict = HG_CLI_DIFFERS,
        .name = "n",
        .message = "m",
        .pictures = {"1 <p>.png", "1-r.exr", NULL}};
    assert_int_equal(hg_cli_report_begin(&report, "s"), HG_OK);
    assert_int_equal(hg_cli_report_add(&report, &c), HG_OK);
    char *text = render(&report, false, "out&");
    assert_true(check_xml(text) > 0);
    assert_non_null(strstr(text, "[[ATTACHMENT|out&amp;/1 &lt;p&gt;.png]]"));
    assert_non_null(strstr(text, "[[ATTACHMENT|out&amp;/1-r.exr]]"));
    free(text);
    text = render(&report, false, NULL);
    assert_null(strstr(text, "ATTACHMENT"));
    free(text);
    text = render(&report, true, NULL);
    assert_non_null(strstr(text, "src=\"1%20%3Cp%3E.png\""));
    assert_non_null(strstr(text, "href=\"1-r.exr\""));
    assert_null(strstr(text, "src=\"1-r.exr\"")); // browsers do not show it
    free(text);
    hg_cli_report_finish(&report);
}

static bool is_utf8(const char *text)
{
    for (const unsigned char *p = (const unsigned char *)text; *p; p++) {
        int more = *p < 0x80 ? 0 : *p >= 0xf0 ? 3 : *p >= 0xe0 ? 2 : *p >= 0xc2 ? 1 : -1;
        for (; more > 0; more--)
            if ((*++p & 0xc0) != 0x80)
                return false;
        if (more < 0)
            return false;
    }
    return true;
}

static void test_any_bytes(void **state)
{
    (void)state;
    uint32_t seed = 12345;
    for (int round = 0; round < 2000; round++) {
        char name[64];
        for (size_t i = 0; i < sizeof name - 1; i++) {
            seed = seed * 1664525u + 1013904223u;
            name[i] = (char)(1 + (seed >> 24) % 255);
        }
        name[sizeof name - 1] = 0;
        struct hg_cli_report report = {0};
        assert_int_equal(hg_cli_report_begin(&report, name), HG_OK);
        add(&report, name, HG_CLI_DIFFERS, name);
        char *text = render(&report, false, NULL);
        assert_int_equal(check_xml(text), 4);
        assert_true(is_utf8(text));
        free(text);
        text = render(&report, true, NULL);
        assert_true(is_utf8(text));
        free(text);
        hg_cli_report_finish(&report);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_report),
        cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_any_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
