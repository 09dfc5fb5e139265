// isolate.h - parsers of foreign formats in processes of their own, as seen by code that needs what
// they read. A program that has such processes (server/loader) sets the functions; without them the
// same parsers run in this process.
// Floor 0. Any thread; one process belongs to one thread at a time.
//
// A process that was given a hostile file may be in its hands: a result is bytes that the caller
// checks like those of a stranger. They do not change any more once they are there.
#ifndef HG_BASE_ISOLATE_H
#define HG_BASE_ISOLATE_H

#include <stdatomic.h>

#include "base/bytes.h"
#include "base/status.h"

// What a process is asked for; who makes and reads arguments and results is named behind.
enum hg_isolate_op {
    HG_ISOLATE_IMPORT = 1,   // renderer/scene/formats/import
    HG_ISOLATE_DRACO,        // renderer/scene/formats/gltf: decodes a mesh
    HG_ISOLATE_DRACO_VALUES, // of that mesh
    HG_ISOLATE_IMAGE_OPEN,   // renderer/image, as the rest
    HG_ISOLATE_IMAGE_PART,
    HG_ISOLATE_IMAGE_MIP,
    HG_ISOLATE_IMAGE_TEXT,
    HG_ISOLATE_IMAGE_READ,
    HG_ISOLATE_OPS
};

enum { HG_ISOLATE_ARGS_BYTES = 16384 };

struct hg_isolate_call {
    enum hg_isolate_op op;
    const void *args; // [args_size] at most HG_ISOLATE_ARGS_BYTES; copied
    size_t args_size;
    const void *data; // [data_size] copied; NULL: none
    size_t data_size;
    int file; // > 0: an open file that the process may read, instead of data
    // Asked every now and then; false ends the process. May be NULL.
    bool (*go_on)(void *user);
    void *user;
};

struct hg_isolate_result {
    const uint8_t *data; // mapped, read-only
    size_t size;
};

struct hg_isolated; // a process

struct hg_isolate_ops {
    // `name` of the file in messages (copied). HG_E_LIMIT: too many at a time; HG_E_WORKER: none
    // can be started.
    enum hg_status (*open)(
        void *user, const char *name, struct hg_isolated **out, struct hg_error *err);
    // HG_E_LIMIT: it took more time or memory than it may; HG_E_FORMAT: it crashed; HG_E_CANCELLED;
    // what the parser says. After all but the last there is no process any more, and every further
    // call fails.
    enum hg_status (*call)(struct hg_isolated *process, const struct hg_isolate_call *call,
        struct hg_isolate_result *out, struct hg_error *err);
    void (*close)(struct hg_isolated *process); // ends it
    void (*release)(struct hg_isolate_result *result);
    void *user;
};

// Borrowed for the life of the process; before there are other threads. NULL: none.
void hg_isolate_set(const struct hg_isolate_ops *ops);
const struct hg_isolate_ops *hg_isolate_get(void);

// Calls of this thread end with HG_E_CANCELLED once *stop is set, for those who cannot be asked in
// between. Borrowed; NULL: none.
void hg_isolate_watch(const _Atomic bool *stop);
bool hg_isolate_is_stopped(void);

// One call of a process that is made for it. As open and call.
enum hg_status hg_isolate_once(const char *name, const struct hg_isolate_call *call,
    struct hg_isolate_result *out, struct hg_error *err) HG_MUST_CHECK;

// The other side: one call as the process gets it, and answers it.
struct hg_isolate_request {
    enum hg_isolate_op op;
    struct hg_reader args;
    const char *name;    // of the file, for messages
    const uint8_t *data; // [data_size] mapped until more comes; NULL: none
    size_t data_size;
    int file;    // -1: none; the process's
    void *state; // kept from call to call; at first NULL
};
typedef enum hg_status hg_isolate_serve_fn(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err);

#endif
