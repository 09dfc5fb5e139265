// cli_harness.h - the harness of programs that test helio: one folder, expectations of commands.
#ifndef HG_TESTS_UNIT_CLIENT_CLI_HARNESS_H
#define HG_TESTS_UNIT_CLIENT_CLI_HARNESS_H

#include "tests/unit/client/harness.h"

extern struct harness h;

// Runs `command` with FAKE=fake; text (may be NULL) is part of its output.
void expect_run(int code, const char *text, const char *fake, const char *command);
// The file is there and contains text; it is in h.output.
void expect_file(const char *name, const char *text);
void expect_no_file(const char *name);

// Of cmocka's groups.
int cli_setup(void **state);
int cli_teardown(void **state);

#endif
