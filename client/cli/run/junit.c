// junit.c - reports as JUnit XML. See report.h.
#include <stdio.h>
#include <string.h>

#include "client/cli/run/report.h"

static void put(struct hg_writer *w, const char *text)
{
    hg_write_bytes(w, text, strlen(text));
}

static void put_attribute(struct hg_writer *w, const char *name, const char *value)
{
    put(w, " ");
    put(w, name);
    put(w, "=\"");
    hg_cli_report_escape(w, value);
    put(w, "\"");
}

static void put_seconds(struct hg_writer *w, uint64_t ns)
{
    char text[40];
    snprintf(text, sizeof text, "%.6f", (double)ns / 1e9);
    put_attribute(w, "time", text);
}

// Pictures as the attachments that Jenkins and GitLab read from the output of a case.
static void put_pictures(struct hg_writer *w, const struct hg_cli_pictures *p, const char *folder)
{
    const char *const names[] = {p->picture, p->reference, p->difference};
    if (!folder || !(p->picture || p->reference || p->difference))
        return;
    put(w, "      <system-out>");
    for (int i = 0; i < 3; i++) {
        if (!names[i])
            continue;
        put(w, "[[ATTACHMENT|");
        hg_cli_report_escape(w, folder);
        put(w, "/");
        hg_cli_report_escape(w, names[i]);
        put(w, "]]&#10;");
    }
    put(w, "</system-out>\n");
}

static void put_case(
    struct hg_writer *w, const char *suite, const struct hg_cli_case *c, const char *folder)
{
    static const char *const elements[] = {
        [HG_CLI_DIFFERS] = "failure", [HG_CLI_BROKEN] = "error", [HG_CLI_SKIPPED] = "skipped"};
    put(w, "    <testcase");
    put_attribute(w, "classname", suite);
    put_attribute(w, "name", c->name);
    put_seconds(w, c->took_ns);
    if (c->verdict == HG_CLI_PASSED || c->verdict == HG_CLI_UPDATED) {
        put(w, "/>\n");
        return;
    }
    put(w, ">\n      <");
    put(w, elements[c->verdict]);
    if (c->message)
        put_attribute(w, "message", c->message);
    put(w, "/>\n");
    put_pictures(w, &c->pictures, folder);
    put(w, "    </testcase>\n");
}

static void put_suite(
    struct hg_writer *w, const struct hg_cli_report *r, uint32_t suite, const char *folder)
{
    char counts[160];
    uint64_t total = 0;
    size_t count = 0;
    for (size_t i = 0; i < r->count; i++) {
        const bool here = r->cases[i].suite == suite;
        total += here ? r->cases[i].took_ns : 0;
        count += here;
    }
    snprintf(counts, sizeof counts,
        " tests=\"%zu\" failures=\"%zu\" errors=\"%zu\" skipped=\"%zu\"", count,
        hg_cli_report_count(r, suite, HG_CLI_DIFFERS), hg_cli_report_count(r, suite, HG_CLI_BROKEN),
        hg_cli_report_count(r, suite, HG_CLI_SKIPPED));
    put(w, "  <testsuite");
    put_attribute(w, "name", r->suites[suite]);
    put(w, counts);
    put_seconds(w, total);
    put(w, ">\n");
    for (size_t i = 0; i < r->count; i++)
        if (r->cases[i].suite == suite)
            put_case(w, r->suites[suite], &r->cases[i], folder);
    put(w, "  </testsuite>\n");
}

enum hg_status hg_cli_report_write_junit(
    const struct hg_cli_report *r, const char *folder, struct hg_writer *w)
{
    put(w, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n");
    for (uint32_t i = 0; i < r->suite_count; i++)
        put_suite(w, r, i, folder);
    put(w, "</testsuites>\n");
    return w->failed ? HG_E_NOMEM : HG_OK;
}
