// junit.h - JUnit XML reports, as CI systems read them. Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_JUNIT_H
#define HG_CLIENT_CLI_JUNIT_H

#include "base/bytes.h"

enum hg_cli_verdict { HG_CLI_PASSED, HG_CLI_DIFFERS, HG_CLI_BROKEN };

struct hg_cli_case {
    char name[256];
    enum hg_cli_verdict verdict;
    char message[512]; // of a case that did not pass
    uint64_t took_ns;
};

struct hg_cli_junit {
    struct hg_cli_case *cases;
    size_t count, capacity;
};

// HG_E_NOMEM.
enum hg_status hg_cli_junit_add(struct hg_cli_junit *junit, const char *name,
    enum hg_cli_verdict verdict, const char *message, uint64_t took_ns) HG_MUST_CHECK;
size_t hg_cli_junit_count(const struct hg_cli_junit *junit, enum hg_cli_verdict verdict);
// The whole document into *w. Texts may hold any bytes. HG_E_NOMEM.
enum hg_status hg_cli_junit_write(
    const struct hg_cli_junit *junit, const char *suite, struct hg_writer *w) HG_MUST_CHECK;
void hg_cli_junit_finish(struct hg_cli_junit *junit);

#endif
