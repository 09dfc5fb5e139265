#include "renderer/scene/formats/text_scan.h"

#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

bool hg_text_line(struct hg_text *t, struct hg_text *line)
{
    if (t->at >= t->end)
        return false;
    const char *p = t->at;
    while (p < t->end && *p != '\n' && *p != '\r')
        p++;
    *line = (struct hg_text){t->at, p};
    if (p < t->end)
        p += *p == '\r' && p + 1 < t->end && p[1] == '\n' ? 2 : 1;
    t->at = p;
    return true;
}

struct hg_text hg_text_word(struct hg_text *t)
{
    hg_text_skip_space(t);
    struct hg_text word = {t->at, t->at};
    while (t->at < t->end && !hg_text_is_space(*t->at))
        t->at++;
    word.end = t->at;
    return word;
}

bool hg_text_is(struct hg_text word, const char *lower_case)
{
    const size_t n = strlen(lower_case);
    return (size_t)(word.end - word.at) == n && strncasecmp(word.at, lower_case, n) == 0;
}

struct hg_text hg_text_trim(struct hg_text t)
{
    hg_text_skip_blanks(&t);
    while (t.end > t.at && hg_text_is_space(t.end[-1]))
        t.end--;
    return t;
}

// ---- numbers -----------------------------------------------------------------------------------

enum { EXACT_TENS = 22, DIGITS_OF_U64 = 19, LONGEST = 800, MOST_EXPONENT = 100000 };

struct decimal { // digits * 10^exponent
    uint64_t digits;
    int32_t exponent;
    bool negative, exact; // not exact: nonzero digits were left out
    const char *end;      // NULL: not a number
};

static bool is_digit(const char *p, const char *end)
{
    return p < end && *p >= '0' && *p <= '9';
}

// A digit as long as 64 bits hold it; later ones count as powers of ten.
static void add_digit(struct decimal *d, char c, bool fraction, int *held)
{
    if (*held < DIGITS_OF_U64) {
        d->digits = d->digits * 10 + (uint64_t)(c - '0');
        *held += d->digits != 0;
        d->exponent -= fraction;
        return;
    }
    d->exact = d->exact && c == '0';
    d->exponent += !fraction;
}

static const char *scan_exponent(const char *p, const char *end, int32_t *exponent)
{
    const char *q = p + 1;
    const bool negative = q < end && *q == '-';
    if (q < end && (*q == '-' || *q == '+'))
        q++;
    if (!is_digit(q, end))
        return p;
    int32_t value = 0;
    for (; is_digit(q, end); q++)
        value = value < MOST_EXPONENT ? value * 10 + (*q - '0') : value;
    *exponent += negative ? -value : value;
    return q;
}

static struct decimal scan_decimal(const char *p, const char *end)
{
    struct decimal d = {.exact = true};
    int held = 0;
    d.negative = p < end && *p == '-';
    if (p < end && (*p == '-' || *p == '+'))
        p++;
    const char *first = p;
    for (; is_digit(p, end); p++)
        add_digit(&d, *p, false, &held);
    bool any = p > first;
    if (p < end && *p == '.') {
        const char *point = p++;
        for (; is_digit(p, end); p++)
            add_digit(&d, *p, true, &held);
        any = any || p > point + 1;
    }
    if (!any)
        return d;
    if (p < end && (*p == 'e' || *p == 'E' || *p == 'd' || *p == 'D')) // D: Fortran
        p = scan_exponent(p, end, &d.exponent);
    d.end = p;
    return d;
}

static locale_t plain_locale;

static void make_plain_locale(void)
{
    plain_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
}

// The library's conversion, of at most LONGEST digits: more cannot change how a double is rounded
// but for being nonzero, which a last 1 stands for.
static double convert_slowly(const struct decimal *d, const char *start)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    char text[LONGEST + 32];
    size_t n = 0;
    int32_t exponent = 0;
    bool point = false;
    pthread_once(&once, make_plain_locale);
    const char *p = start;
    for (; p < d->end && (*p == '.' || *p == '-' || *p == '+' || is_digit(p, d->end)); p++) {
        point = point || *p == '.';
        if (!is_digit(p, d->end))
            continue;
        if (n < LONGEST) {
            if (n > 0 || *p != '0')
                text[n++] = *p;
            exponent -= point;
        } else {
            if (*p != '0')
                text[LONGEST - 1] = '1';
            exponent += !point;
        }
    }
    int32_t written = 0;
    if (p < d->end)
        (void)scan_exponent(p, d->end, &written);
    snprintf(text + n, sizeof text - n, "e%d", exponent + written);
    return plain_locale ? strtod_l(text, NULL, plain_locale) : strtod(text, NULL);
}

// Clinger 1990, "How to Read Floating Point Numbers Accurately": a product or a quotient of two
// numbers that doubles hold is rounded once.
static bool convert_exactly(const struct decimal *d, double *out)
{
    static const double tens[EXACT_TENS + 1] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9,
        1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    if (!d->exact || d->digits > UINT64_C(1) << 53 || d->exponent < -EXACT_TENS ||
        d->exponent > EXACT_TENS)
        return d->digits == 0 && d->exact && (*out = 0, true);
    const double value = (double)d->digits;
    *out = d->exponent < 0 ? value / tens[-d->exponent] : value * tens[d->exponent];
    return true;
}

// "inf", "infinity" and "nan" as printf writes them, and "-nan(ind)" of others.
static bool scan_special(struct hg_text *t, double *out)
{
    const char *p = t->at;
    const bool negative = p < t->end && *p == '-';
    if (p < t->end && (*p == '-' || *p == '+'))
        p++;
    if (t->end - p < 3)
        return false;
    if (strncasecmp(p, "inf", 3) == 0)
        *out = negative ? -INFINITY : INFINITY;
    else if (strncasecmp(p, "nan", 3) == 0)
        *out = NAN;
    else
        return false;
    while (p < t->end && !hg_text_is_space(*p))
        p++;
    t->at = p;
    return true;
}

bool hg_text_number(struct hg_text *t, double *out)
{
    hg_text_skip_blanks(t);
    const struct decimal d = scan_decimal(t->at, t->end);
    if (!d.end)
        return scan_special(t, out);
    if (!convert_exactly(&d, out))
        *out = convert_slowly(&d, t->at);
    if (d.negative)
        *out = -*out;
    t->at = d.end;
    return true;
}

bool hg_text_number_word(struct hg_text *t, double *out)
{
    struct hg_text rest = *t;
    if (!hg_text_number(&rest, out) || (rest.at < rest.end && !hg_text_is_space(*rest.at)))
        return false;
    *t = rest;
    return true;
}
