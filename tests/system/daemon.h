// daemon.h - for system tests: a heliod of one's own, and raw connections to it.
// Everything waits for something, with a deadline; failures end the test with what was missing.
#ifndef HG_TESTS_SYSTEM_DAEMON_H
#define HG_TESTS_SYSTEM_DAEMON_H

#include <stdbool.h>
#include <sys/types.h>

#include "protocol/hgp.h"
#include "tests/support/folder.h"

struct daemon {
    char folder[TEST_FOLDER_MAX]; // temporary: socket, cache, tripwires, log
    pid_t pid;
    int port;      // of the first tcp listener, 0 = none
    int passed_fd; // listening socket handed over as a service manager does; 0 = none
    char *args[64];
    int arg_count;
};

// Makes the folder. One worker is shared by all tenants, unless the option isolation is added
// again. Add options before daemon_start; unix:FOLDER/sock is always listened to.
void daemon_init(struct daemon *d);
// With a tcp listener and the tokens view-token-1 (anna), edit-token-1 (bert) and admin-token-1.
void daemon_init_tokens(struct daemon *d);
void daemon_option(struct daemon *d, const char *name, const char *value); // value NULL: a switch
// Uses the worker of $HELIO_TEST_WORKER, else the fake one. Waits until it listens.
void daemon_start(struct daemon *d);
void daemon_begin(struct daemon *d); // daemon_init, daemon_start
// Runs heliod to its end (bad configurations); returns its exit code. stderr goes to FOLDER/log.
int daemon_run(struct daemon *d);
void daemon_watch(struct daemon *d); // killed when the test program ends before daemon_finish
void daemon_signal(struct daemon *d, int number);
int daemon_wait(struct daemon *d);    // for its end; returns the exit code
void daemon_reap(struct daemon *d);   // after a SIGKILL
void daemon_finish(struct daemon *d); // SIGKILL if it still runs; removes the folder
void daemon_write(struct daemon *d, const char *name, const char *text); // a file in the folder
bool daemon_has_file(struct daemon *d, const char *name);
size_t daemon_file_size(struct daemon *d, const char *name); // 0 = not there
char *daemon_read(struct daemon *d, const char *name);       // caller frees
void daemon_wait_log(struct daemon *d, const char *text);    // until the log contains it
pid_t daemon_worker(struct daemon *d, pid_t other_than);     // newest worker, once it is another
double daemon_metric(struct daemon *d, const char *name);    // of /metrics, over tcp
uint64_t daemon_rss_bytes(struct daemon *d);
double daemon_cpu_s(pid_t pid);          // seconds of processor time of all threads of a process
uint64_t daemon_allowed(uint64_t bytes); // more under sanitizers, which keep what was freed

struct peer {
    int fd;
    uint32_t next_request, first_id;
    uint64_t session;
    uint8_t *payload; // of the newest message
    char limit[65];   // of the newest `limited`, which is read past
    uint32_t retry_after_ms;
    struct hg_arena arena;
    struct hgp_header header;
    union hgp_any m; // decoded
};

void peer_connect(struct peer *p, struct daemon *d, bool tcp); // only the socket
void peer_hello(struct peer *p);                               // preface, hello, welcome
void peer_auth(struct peer *p, const char *token);             // auth, no answer awaited
void peer_open(struct peer *p, struct daemon *d);              // unix, open session
void peer_enter(struct peer *p, struct daemon *d, const char *token); // tcp, open session
bool peer_says(const struct peer *p, const char *text); // the error that came has it as its reason
bool peer_has_upload(struct peer *p, const uint8_t hash[32]); // upload_query of one content
void peer_scene(struct peer *p, const char *name);
void peer_open_scene(struct peer *p, struct daemon *d, const char *name); // both
void peer_view(struct peer *p, uint32_t view, uint32_t width, uint32_t height);
// peer_open_scene without a name, peer_view 1.
void peer_open_view(struct peer *p, struct daemon *d, uint32_t width, uint32_t height);
void peer_close(struct peer *p);
void peer_raw(struct peer *p, const void *data, size_t size);
uint32_t peer_send(struct peer *p, enum hgp_type type, const void *message); // returns request id
void peer_tell(struct peer *p, enum hgp_type type, const void *message);     // request 0
// Reads the next message into p->header and p->m. False: the peer closed.
bool peer_next(struct peer *p);
bool peer_next_within(struct peer *p, int timeout_ms); // false also on timeout
// Reads until the final answer of the request.
void peer_answer(struct peer *p, uint32_t request, enum hgp_type type);
void peer_error(struct peer *p, uint32_t request, enum hg_status status);
// peer_send + peer_answer.
void peer_call(struct peer *p, enum hgp_type type, const void *message, enum hgp_type answer);
void peer_refused(struct peer *p, enum hgp_type type, const void *message, enum hg_status status);
void peer_end(struct peer *p); // the daemon closes the connection

#endif
