// session_stream.h - streams of messages that are whole, or damaged a little. Test code.
#ifndef HG_TESTS_FUZZ_SESSION_STREAM_H
#define HG_TESTS_FUZZ_SESSION_STREAM_H

#include "protocol/hgp.h"
#include "tests/fuzz/mutate.h"

// Reads the corpus of clients' messages; fails the running test without one.
void session_stream_load(void);
void session_stream_free(void);
// Appends one message: as it is, with a damaged payload of the right length, or with damage
// anywhere, header included. None ends the daemon: drain_set is sent undamaged only, with which the
// daemon stays.
void session_stream_put(struct hg_writer *w, struct fuzz_random *random);

#endif
