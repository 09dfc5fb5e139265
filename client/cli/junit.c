#include "client/cli/junit.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"

enum hg_status hg_cli_junit_add(struct hg_cli_junit *junit, const char *name,
    enum hg_cli_verdict verdict, const char *message, uint64_t took_ns)
{
    if (hg_grow(&junit->cases, &junit->capacity, junit->count + 1, sizeof *junit->cases))
        return HG_E_NOMEM;
    struct hg_cli_case *c = &junit->cases[junit->count++];
    *c = (struct hg_cli_case){.verdict = verdict, .took_ns = took_ns};
    snprintf(c->name, sizeof c->name, "%s", name);
    snprintf(c->message, sizeof c->message, "%s", message ? message : "");
    return HG_OK;
}

size_t hg_cli_junit_count(const struct hg_cli_junit *junit, enum hg_cli_verdict verdict)
{
    size_t n = 0;
    for (size_t i = 0; i < junit->count; i++)
        n += junit->cases[i].verdict == verdict;
    return n;
}

static void put(struct hg_writer *w, const char *text)
{
    hg_write_bytes(w, text, strlen(text));
}

// Length of the well-formed UTF-8 character at `p` that XML 1.0 allows; 0 when it is none.
static size_t character(const unsigned char *p)
{
    if (p[0] < 0x80)
        return p[0] >= 0x20 || p[0] == '\t' || p[0] == '\n' ? 1 : 0;
    size_t n = p[0] >= 0xc2 && p[0] < 0xe0   ? 2
               : p[0] >= 0xe0 && p[0] < 0xf0 ? 3
               : p[0] >= 0xf0 && p[0] < 0xf5 ? 4
                                             : 0;
    for (size_t i = 1; i < n; i++)
        if ((p[i] & 0xc0) != 0x80)
            return 0;
    if ((p[0] == 0xe0 && p[1] < 0xa0) || (p[0] == 0xed && p[1] >= 0xa0) ||
        (p[0] == 0xf0 && p[1] < 0x90) || (p[0] == 0xf4 && p[1] >= 0x90))
        return 0;
    if (p[0] == 0xef && p[1] == 0xbf && p[2] >= 0xbe) // U+FFFE, U+FFFF
        return 0;
    return n;
}

// Attribute text.
static void put_escaped(struct hg_writer *w, const char *text)
{
    for (const unsigned char *p = (const unsigned char *)text; *p;) {
        size_t n = character(p);
        const char *entity = *p == '&'    ? "&amp;"
                             : *p == '<'  ? "&lt;"
                             : *p == '>'  ? "&gt;"
                             : *p == '"'  ? "&quot;"
                             : *p == '\'' ? "&apos;"
                             : *p == '\n' ? "&#10;"
                             : *p == '\t' ? "&#9;"
                             : n == 0     ? "?"
                                          : NULL;
        if (entity)
            put(w, entity);
        else
            hg_write_bytes(w, p, n);
        p += n ? n : 1;
    }
}

static void put_seconds(struct hg_writer *w, uint64_t ns)
{
    char text[40];
    snprintf(text, sizeof text, "%.6f", (double)ns / 1e9);
    put(w, text);
}

static void put_case(struct hg_writer *w, const char *suite, const struct hg_cli_case *c)
{
    put(w, "    <testcase classname=\"");
    put_escaped(w, suite);
    put(w, "\" name=\"");
    put_escaped(w, c->name);
    put(w, "\" time=\"");
    put_seconds(w, c->took_ns);
    if (c->verdict == HG_CLI_PASSED) {
        put(w, "\"/>\n");
        return;
    }
    put(w, c->verdict == HG_CLI_DIFFERS ? "\">\n      <failure message=\""
                                        : "\">\n      <error message=\"");
    put_escaped(w, c->message);
    put(w, "\"/>\n    </testcase>\n");
}

enum hg_status hg_cli_junit_write(
    const struct hg_cli_junit *junit, const char *suite, struct hg_writer *w)
{
    char counts[128];
    uint64_t total = 0;
    for (size_t i = 0; i < junit->count; i++)
        total += junit->cases[i].took_ns;
    snprintf(counts, sizeof counts, "\" tests=\"%zu\" failures=\"%zu\" errors=\"%zu\" time=\"",
        junit->count, hg_cli_junit_count(junit, HG_CLI_DIFFERS),
        hg_cli_junit_count(junit, HG_CLI_BROKEN));
    put(w, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n  <testsuite name=\"");
    put_escaped(w, suite);
    put(w, counts);
    put_seconds(w, total);
    put(w, "\">\n");
    for (size_t i = 0; i < junit->count; i++)
        put_case(w, suite, &junit->cases[i]);
    put(w, "  </testsuite>\n</testsuites>\n");
    return w->failed ? HG_E_NOMEM : HG_OK;
}

void hg_cli_junit_finish(struct hg_cli_junit *junit)
{
    hg_free(junit->cases);
    *junit = (struct hg_cli_junit){0};
}
