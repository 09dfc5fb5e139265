// JUnit reports are well-formed XML, whatever bytes the texts hold.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "client/cli/junit.h"

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

static char *render(const struct hg_cli_junit *junit, const char *suite)
{
    struct hg_writer w = {0};
    assert_int_equal(hg_cli_junit_write(junit, suite, &w), HG_OK);
    char *text = calloc(w.size + 1, 1);
    assert_non_null(text);
    memcpy(text, w.data, w.size);
    hg_writer_finish(&w);
    return text;
}

static void test_report(void **state)
{
    (void)state;
    struct hg_cli_junit junit = {0};
    assert_int_equal(hg_cli_junit_add(&junit, "line 1: a <b> & \"c\"", HG_CLI_PASSED, "", 1), 0);
    assert_int_equal(hg_cli_junit_add(&junit, "two", HG_CLI_DIFFERS, "saw 'x'\n\ty", 2), 0);
    assert_int_equal(
        hg_cli_junit_add(&junit, "three", HG_CLI_BROKEN, "\x01\x02 caf\xc3\xa9", 3), 0);
    char *text = render(&junit, "dir/s&t.hs");
    assert_int_equal(check_xml(text), 1 + 1 + 3 + 2);
    assert_non_null(strstr(text, "tests=\"3\" failures=\"1\" errors=\"1\""));
    assert_non_null(strstr(text, "a &lt;b&gt; &amp; &quot;c&quot;"));
    assert_non_null(strstr(text, "?? caf\xc3\xa9"));
    free(text);
    hg_cli_junit_finish(&junit);
    text = render(&junit, "empty");
    assert_int_equal(check_xml(text), 2);
    free(text);
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
        struct hg_cli_junit junit = {0};
        assert_int_equal(hg_cli_junit_add(&junit, name, HG_CLI_DIFFERS, name, 1), 0);
        char *text = render(&junit, name);
        assert_int_equal(check_xml(text), 4);
        assert_true(is_utf8(text));
        free(text);
        hg_cli_junit_finish(&junit);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_report),
        cmocka_unit_test(test_any_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
