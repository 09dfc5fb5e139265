// scene_text_scan.c - numbers of texts are those that the C library makes of them, to the last bit;
// lines and words.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/scene/formats/text_scan.h"

static double scan(const char *text, size_t *used)
{
    struct hg_text t = {text, text + strlen(text)};
    double v = -77;
    *used = hg_text_number(&t, &v) ? (size_t)(t.at - text) : 0;
    return v;
}

static void expect_as_strtod(const char *text)
{
    size_t used;
    char *end;
    const double got = scan(text, &used), want = strtod(text, &end);
    if (used != (size_t)(end - text) || memcmp(&got, &want, sizeof got) != 0)
        fail_msg("\"%.60s\": %.17g (%zu), strtod says %.17g (%zu)", text, got, used, want,
            (size_t)(end - text));
}

static void test_numbers(void **state)
{
    (void)state;
    static const char *const texts[] = {"0", "-0", "1", "+1.5", "-.5", "5.", "1e3", "1E-3", "1e+22",
        "1e23", "123456789012345678", "9007199254740993", "9007199254740992.99999999999999999",
        "0.1", "0.30000000000000004", "5123456.789", "1e308", "1e309", "-1e400", "4.9e-324",
        "2.4703282292062327e-324", "2.4703282292062328e-324", "1e-400", "00000.000001",
        "1797693134862315807e290", "0e99999999", "179769313486231580793728971405301e276", "8.5e",
        "8.5e+", "3d", "12abc"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (strcmp(texts[i], "3d") != 0)
            expect_as_strtod(texts[i]);
}

static void test_numbers_by_chance(void **state)
{
    (void)state;
    uint64_t seed = 0x9e3779b97f4a7c15;
    static const char *const formats[] = {"%.17g", "%.6f", "%.25e", "%.9g", "%.19e"};
    for (int i = 0; i < 50000; i++) {
        char text[400];
        double v;
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        uint64_t bits = seed;
        if (i % 2) // of everyday size
            bits = (bits & 0x800fffffffffffffu) | (uint64_t)(1023 - 20 + seed % 40) << 52;
        memcpy(&v, &bits, sizeof v);
        if (!isfinite(v))
            continue;
        snprintf(text, sizeof text, formats[i % 5], v);
        expect_as_strtod(text);
    }
}

// Halfway between two doubles, then a digit far behind that decides.
static void test_digits_far_behind_count(void **state)
{
    (void)state;
    char text[2000];
    for (size_t zeros = 10; zeros < 1900; zeros += 630) {
        snprintf(text, sizeof text, "9007199254740993.%0*d", (int)zeros, 0);
        size_t used;
        assert_true(scan(text, &used) == 9007199254740992.0);
        strcat(text, "1");
        assert_true(scan(text, &used) == 9007199254740994.0);
        assert_int_equal(used, strlen(text));
    }
}

static void test_what_is_no_number(void **state)
{
    (void)state;
    static const char *const texts[] = {"", "-", ".", "e5", "+.e1", "abc", "-x", "in", "--1"};
    size_t used;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        (void)scan(texts[i], &used);
        assert_int_equal(used, 0);
    }
    assert_true(isnan(scan("nan", &used)) && used == 3);
    assert_true(isnan(scan("-nan(ind)", &used)) && used == 9);
    assert_true(scan("-inf", &used) == -INFINITY);
    static const char comma[] = "1,5";
    struct hg_text t = {comma, comma + strlen(comma)};
    double v;
    assert_false(hg_text_number_word(&t, &v));
}

static void test_lines(void **state)
{
    (void)state;
    static const char text[] = "a\nb\r\nc\rd\n\ne";
    struct hg_text t = {text, text + strlen(text)}, line;
    char got[32] = "";
    while (hg_text_line(&t, &line)) {
        strncat(got, line.at, (size_t)(line.end - line.at));
        strcat(got, "|");
    }
    assert_string_equal(got, "a|b|c|d||e|");
    static const char words[] = " \t one\v two\n";
    t = (struct hg_text){words, words + strlen(words)};
    assert_true(hg_text_is(hg_text_word(&t), "one"));
    assert_true(hg_text_is(hg_text_word(&t), "two"));
    struct hg_text end = hg_text_word(&t);
    assert_true(end.at == end.end);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_numbers_by_chance), cmocka_unit_test(test_digits_far_behind_count),
        cmocka_unit_test(test_what_is_no_number), cmocka_unit_test(test_lines)};
    return cmocka_run_group_tests_name("scene_text_scan", tests, NULL, NULL);
}
