// fake_tripwires.h - how tests make the fake worker fall over.
//
// Tripwires are files in the folder $HELIO_FAKE_DIR, looked at whenever a message NAME comes:
//   die.NAME   removed, then the process kills itself      kill.NAME   the same, but stays
//   hang.NAME  removed, then nothing happens any more      busy.NAME   removed, then pulses report
//                                                                      a step that does not end
//   stuck.NAME stays, and the message is not answered; pulses report that a thread hangs in it
//   die.start  removed at start, then exit before worker_ready
//   die.compile  removed by the process that compiles shaders, which then fails
// The folder also gets: pid, and count.NAME, one byte per message of that name.
#ifndef HG_TESTS_SYSTEM_FAKE_TRIPWIRES_H
#define HG_TESTS_SYSTEM_FAKE_TRIPWIRES_H

#include "protocol/hgp.h"

// What tripwires came to. Zero-initialised = nothing.
struct fake_trip {
    bool hung;              // nothing happens any more
    uint64_t busy_since_ns; // a step does not end; 0 = none
    struct hgp_busy busy;   // with channel 0: not known at what
};

// Is the file KIND.NAME there? It is removed unless it stays.
bool fake_trip(const char *kind, const char *name, bool stays);
// Appends to a file of the folder.
void fake_note(const char *name, const void *text, size_t size);
// Counts the message, and does what its tripwires say.
void fake_trip_message(struct fake_trip *trip, const struct hgp_header *header);
// Is the message one that a thread hangs in from now on?
bool fake_trip_sticks(struct fake_trip *trip, const struct hgp_header *header);

#endif
