// wire.h - what worker and loader say to each other. Both are of one build and on one machine, so
// these are structs; every field of a loader's is checked by who reads it (loader_client.c).
// Floor 6, private to server/.
//
// The link to the spawner: a byte asks for a loader, and a packet answers with its socket or with
// an errno. That socket (SOCK_SEQPACKET) carries one request and one reply after the other. The
// spawner has the loader's end of it, too: when the worker closes its own the spawner kills the
// loader, and when a loader ends it says how.
#ifndef HG_SERVER_LOADER_WIRE_H
#define HG_SERVER_LOADER_WIRE_H

#include "base/isolate.h"

enum { LOADER_NAME_BYTES = 256, LOADERS_AT_A_TIME = 256 };
enum { LOADER_EXIT_MEMORY = 20, LOADER_EXIT_SANDBOX = 21, LOADER_EXIT_PROTOCOL = 22 };

struct loader_spawned {
    int32_t error; // 0: a descriptor comes along
};

// With one descriptor for the result, which is empty, and before it one for data or file.
struct loader_request {
    uint32_t op, args_size;
    uint64_t data_size;
    bool has_data, has_file;
    char name[LOADER_NAME_BYTES];
    uint8_t args[HG_ISOLATE_ARGS_BYTES]; // as many as args_size
};

struct loader_reply {
    bool ended; // no answer, but the end of the process: `how` as waitpid has it
    int32_t how;
    uint32_t status;
    uint64_t size; // of the result
    struct hg_error err;
};

#endif
