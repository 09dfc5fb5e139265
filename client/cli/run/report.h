// report.h - what the expectations of scripts found, and its reports: JUnit XML as CI systems read
// it, and a page of HTML with pictures. Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_RUN_REPORT_H
#define HG_CLIENT_CLI_RUN_REPORT_H

#include "base/arena.h"
#include "base/bytes.h"

enum hg_cli_verdict {
    HG_CLI_PASSED,
    HG_CLI_UPDATED, // passed: the reference was replaced (--update-references)
    HG_CLI_DIFFERS, // the expectation does not hold
    HG_CLI_BROKEN,  // the line that ended its script
    HG_CLI_SKIPPED, // never ran: its script ended before
};

// Names of files below the folder of the report; NULL = none.
struct hg_cli_pictures {
    const char *picture, *reference, *difference;
};

struct hg_cli_case {
    uint32_t suite; // index
    enum hg_cli_verdict verdict;
    const char *name, *message;
    struct hg_cli_pictures pictures;
    uint64_t took_ns;
};

// Zero-initialise. A suite per script.
struct hg_cli_report {
    struct hg_arena arena; // of all texts
    const char **suites;
    size_t suite_count, suite_capacity;
    struct hg_cli_case *cases;
    size_t count, capacity;
};

// Cases that are added from here on belong to a new suite. HG_E_NOMEM.
enum hg_status hg_cli_report_begin(struct hg_cli_report *report, const char *suite) HG_MUST_CHECK;
// Appends a copy of *c, with its texts, to the newest suite. HG_E_NOMEM.
enum hg_status hg_cli_report_add(
    struct hg_cli_report *report, const struct hg_cli_case *c) HG_MUST_CHECK;
// Cases of that verdict, of one suite or (suite < 0) of all.
size_t hg_cli_report_count(
    const struct hg_cli_report *report, int64_t suite, enum hg_cli_verdict verdict);
void hg_cli_report_finish(struct hg_cli_report *report);

// Text in which markup and characters that XML 1.0 does not allow are escaped or replaced.
void hg_cli_report_escape(struct hg_writer *w, const char *text);

// junit.c: the whole document. folder: of the pictures, named as attachments; NULL = none are.
// HG_E_NOMEM.
enum hg_status hg_cli_report_write_junit(
    const struct hg_cli_report *report, const char *folder, struct hg_writer *w) HG_MUST_CHECK;
// report_html.c: a page that needs no other file but the pictures beside it. HG_E_NOMEM.
enum hg_status hg_cli_report_write_html(
    const struct hg_cli_report *report, struct hg_writer *w) HG_MUST_CHECK;

#endif
