#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>

#include "tests/unit/client/cli_harness.h"

struct harness h;

void expect_run(int code, const char *text, const char *fake, const char *command)
{
    int got = harness_run(&h, "FAKE='%s'; export FAKE; %s", fake, command);
    if (got != code)
        fail_msg("%s: exit %d instead of %d: %s", command, got, code, h.output);
    if (text && !strstr(h.output, text))
        fail_msg("%s: '%s' is not in: %s", command, text, h.output);
}

void expect_file(const char *name, const char *text)
{
    if (!harness_read(&h, name))
        fail_msg("%s is missing", name);
    if (!strstr(h.output, text))
        fail_msg("%s: '%s' is not in: %s", name, text, h.output);
}

void expect_no_file(const char *name)
{
    if (harness_read(&h, name))
        fail_msg("%s was written", name);
}

int cli_setup(void **state)
{
    (void)state;
    harness_begin(&h);
    harness_write(&h, "s.gltf", "{}", 2);
    harness_write(&h, "t.txt", "other", 5);
    return 0;
}

int cli_teardown(void **state)
{
    (void)state;
    harness_end(&h);
    return 0;
}
