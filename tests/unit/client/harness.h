// harness.h - runs helio and fake peers from tests. One temporary folder per program.
#ifndef HG_TESTS_UNIT_CLIENT_HARNESS_H
#define HG_TESTS_UNIT_CLIENT_HARNESS_H

#include <stdbool.h>
#include <stddef.h>

#include "tests/support/folder.h"

struct harness {
    char folder[TEST_FOLDER_MAX]; // made by harness_begin, removed with everything in it by
                                  // harness_end
    char output[65536];           // of the last command, both streams
    int server_pid;
};

void harness_begin(struct harness *h);
void harness_end(struct harness *h);
// Runs a shell command in the folder; $HELIO and $PEER name the programs. Returns the exit code,
// or 1000 + signal.
int harness_run(struct harness *h, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
// Starts a fake daemon on unix:FOLDER/sock with the words `fake`, replacing the one before.
void harness_serve(struct harness *h, const char *fake);
void harness_write(const struct harness *h, const char *name, const void *data, size_t size);
// Text of a file of the folder into h->output; false when there is none.
bool harness_read(struct harness *h, const char *name);

#endif
