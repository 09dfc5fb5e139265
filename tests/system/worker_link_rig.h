// worker_link_rig.h - a real helio-worker on a socketpair, spoken to message by message.
#ifndef HG_TESTS_SYSTEM_WORKER_LINK_RIG_H
#define HG_TESTS_SYSTEM_WORKER_LINK_RIG_H

#include <sys/types.h>

#include "protocol/hgp.h"
#include "tests/support/folder.h"

enum { ANSWER_TIMEOUT_MS = 60000, FIRST_ID = 1000, ID_COUNT = 100 };

struct rig {
    int fd;
    pid_t pid;
    char root[TEST_FOLDER_MAX], path[4200];
    uint32_t next_request;
    // The newest answer:
    struct hgp_header header;
    uint8_t *payload;
    struct hg_arena arena;
    union hgp_any message;
    struct hgp_limited limited; // the newest; its text is gone
    char limit[64];
};

int link_start(void **state); // set-up of a test
// The same with more options, of which the last is NULL; at most 16.
int link_start_with(void **state, const char *const *options);
// With a folder for what is large; on a disk, where the build is on one.
int link_start_with_cache(void **state);
// With a GiB of memory.
int link_start_with_limit(void **state);
char *link_cache_folder(char *path, size_t size);
// Tear-down: the worker has to end with exit code 0.
int link_stop(void **state);
// Tear-down of a test whose worker serves the next one as well (a start takes 3 s of processor
// time): sessions 1 to 3 end, and their scenes with them.
int link_detach(void **state);

// Sends; returns the number of the request.
uint32_t link_ask(struct rig *rig, uint32_t channel, enum hgp_type type, const void *message);
void link_write(int fd, const void *data, size_t size);
void link_read(struct rig *rig); // the next message
// Reads until the final answer of `request`; pulses, progress and notices pass by.
void link_expect(struct rig *rig, uint32_t request, enum hgp_type type);
// where: the field that the error names; NULL: any.
void link_expect_error(struct rig *rig, uint32_t request, enum hg_status code, const char *where);
// A session with a scene of that key, that may edit.
void link_attach(struct rig *rig, uint32_t channel, const char *scene);

#endif
