// fuzz.h - what every fuzz harness defines, and how it says that something is wrong.
// Test code. One thread.
//
// A harness is one C file with LLVMFuzzerTestOneInput. The preset `fuzz` links it with libFuzzer;
// every other build links replay.c, which runs the corpus and deterministic mutations of it.
#ifndef HG_TESTS_FUZZ_FUZZ_H
#define HG_TESTS_FUZZ_FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

// Returns 0. Must not keep state between calls, print, or exit. Aborts when an input shows a bug.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define FUZZ_CHECK(condition)                                                                      \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);         \
            abort();                                                                               \
        }                                                                                          \
    } while (0)

#endif
