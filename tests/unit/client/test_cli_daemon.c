// helio message, kick, drain, tickets against a fake daemon.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "tests/unit/client/cli_harness.h"

// As expect_run, of a command at the fake daemon.
static void expect_at(int code, const char *text, const char *command)
{
    char line[512];
    snprintf(line, sizeof line, "$HELIO %s --connect unix:sock", command);
    expect_run(code, text, "", line);
}

static void test_message(void **state)
{
    (void)state;
    harness_serve(&h, "log=logm");
    expect_at(0, NULL, "message 'back soon'");
    expect_file("logm", "message_send 'back soon' session=0 scene=''\n");
    expect_at(0, NULL, "message hello --session 7");
    expect_file("logm", "message_send 'hello' session=7 scene=''\n");
    expect_at(0, NULL, "message hello --scene show");
    expect_file("logm", "message_send 'hello' session=0 scene='show'\n");
    expect_at(2, "message", "message");
    expect_at(2, "--session", "message hello --session 0");
    expect_at(2, "--block", "message hello --block 5");
    expect_run(2, "--connect: is needed", "", "$HELIO message hello");
    harness_serve(&h, "fail=message_send:8");
    expect_at(2, "as the test wants", "message hello --session 9");
}

static void test_kick(void **state)
{
    (void)state;
    harness_serve(&h, "log=logk");
    expect_at(0, NULL, "kick 3 4 --reason 'too long' --block 60");
    expect_file("logk", "kick 3 reason='too long' block=60\nkick 4 reason='too long' block=60\n");
    expect_at(0, NULL, "kick 18446744073709551615");
    expect_file("logk", "kick 18446744073709551615 reason='' block=0\n");
    expect_at(2, "kick", "kick");
    expect_at(2, "abc: is no number of a session", "kick 5 abc");
    expect_at(2, "0: is no number", "kick 0");
    expect_at(2, "18446744073709551616: is no number", "kick 18446744073709551616");
    expect_at(2, "--block", "kick 5 --block 0");
    expect_file("logk", "kick 3");
    assert_null(strstr(h.output, "kick 5")); // none before all numbers are known to be good
}

static void test_drain(void **state)
{
    (void)state;
    harness_serve(&h, "log=logd");
    expect_at(0, NULL, "drain");
    expect_file("logd", "drain_set ms=30000 reason='' stay=0 cancel=0\n");
    expect_at(0, NULL, "drain --deadline 1.5 --reason update --stay");
    expect_file("logd", "drain_set ms=1500 reason='update' stay=1 cancel=0\n");
    expect_at(0, NULL, "drain --cancel");
    expect_file("logd", "stay=0 cancel=1\n");
    expect_at(2, "--deadline", "drain --deadline -1");
    expect_at(2, NULL, "drain now");
}

static void test_tickets(void **state)
{
    (void)state;
    harness_serve(&h, "log=logt");
    expect_at(0, "no tickets", "tickets list");
    expect_at(0, "hj-secret\n", "tickets make --scene show");
    expect_file("logt", "join_make scene='show' role=VIEW uses=0 valid=0 label=''\n");
    expect_at(0, "\"secret\": \"hj-secret\"",
        "tickets make --scene show --role edit --uses 3 --valid 60 --label ann --json");
    expect_file("logt", "join_make scene='show' role=EDIT uses=3 valid=60 label='ann'\n");
    expect_at(0, NULL, "tickets revoke 4 5");
    expect_file("logt", "join_revoke 4\njoin_revoke 5\n");
    expect_at(0, NULL, "tickets revoke all");
    expect_file("logt", "join_revoke 0\n");
    expect_at(2, "--scene: is needed", "tickets make");
    expect_at(2, "--role", "tickets make --scene show --role admin");
    expect_at(2, "--uses", "tickets make --scene show --uses 0");
    expect_at(2, "revoke takes the numbers", "tickets revoke");
    expect_at(2, "x: is no number", "tickets revoke 6 x");
    expect_at(2, "takes list, make or revoke", "tickets fly");
    expect_file("logt", "join_revoke 5");
    assert_null(strstr(h.output, "join_revoke 6"));
    harness_serve(&h, "tickets=1");
    expect_at(0, "ann", "tickets list");
    expect_at(0, "\"ticket\": 4", "tickets list --json");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_message),
        cmocka_unit_test(test_kick),
        cmocka_unit_test(test_drain),
        cmocka_unit_test(test_tickets),
    };
    return cmocka_run_group_tests(tests, cli_setup, cli_teardown);
}
