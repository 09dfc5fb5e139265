// worker.h - the parts of helio-worker and how they meet.
// Floor 6, private to server/worker.
//
// Three kinds of threads: the loop thread owns the socketpair (io_thread.c); the render thread owns the
// renderer, the scenes and the sessions (dispatch.c and everything it calls); task threads load
// files and encode frames (task.c). They meet only in the bounded queues of struct worker.
#ifndef HG_SERVER_WORKER_WORKER_H
#define HG_SERVER_WORKER_WORKER_H

#include <stdatomic.h>

#include "base/queue.h"
#include "base/refbuf.h"
#include "base/spill.h"
#include "protocol/hgp.h"
#include "renderer/renderer.h"

enum { WORKER_EXIT_DISK = 9 };

struct worker_options {
    int fd;             // the socketpair's end; default 3
    char **asset_roots; // [asset_root_count] real paths
    uint32_t asset_root_count;
    const char *cache_dir;  // NULL: none
    const char *shader_dir; // NULL: embedded shaders
    const char *device;     // NULL: best
    uint64_t memory_limit_bytes, texture_budget_bytes, geometry_budget_bytes; // 0 = unlimited
    uint64_t host_budget_bytes, cache_limit_bytes;
    bool no_sandbox, no_spill, device_info, validation, warm_up;
};

// A message on its way to the render thread, or a finished task.
struct command {
    struct hgp_header header;
    struct hg_refbuf *payload; // bytes of the message; NULL for a finished task
    struct task *task;         // finished task, else NULL
    struct command *next;      // while queued behind a session's running task
};

struct worker {
    struct worker_options options;
    struct hg_queue inbox;  // struct command *, loop and tasks -> render
    struct hg_queue outbox; // struct hg_refbuf *, whole messages, render and tasks -> loop
    struct hg_queue encode; // struct encode_job *, render -> encoder thread
    _Atomic uint64_t step_started_ns; // of the render thread; 0 = idle (read by the loop)
    _Atomic uint32_t view_count;
    _Atomic uint64_t encode_ns; // of the newest frame
    _Atomic bool stop, device_lost, disk_lost;
    struct hg_spill_loss loss; // once disk_lost is set
};

// ---- io_thread.c: the loop thread --------------------------------------------------------------------

// Runs until the link closes. HG_E_CLOSED on orderly end, HG_E_IO when arrays could not be read
// back, which the peer was told, else what broke.
enum hg_status link_run(struct worker *w);

// From now on a disk that does not give back what was spilled ends the process by way of link_run.
void link_watch_disk(struct worker *w);

// Encodes a message and hands it to the loop; waits while the outbox is full. Any thread.
void link_send(
    struct worker *w, uint32_t channel, uint32_t request, enum hgp_type type, const void *message);
// The same, but dropped when the outbox is full (progress).
void link_send_lossy(
    struct worker *w, uint32_t channel, uint32_t request, enum hgp_type type, const void *message);
void link_send_error(
    struct worker *w, uint32_t channel, uint32_t request, const struct hg_error *err);
// Ends the process soon: only a new one gets a clean device. link_send_error calls it for
// HG_E_DEVICE_LOST instead of answering; the broker asks again, or says that the worker died.
void link_lose_device(struct worker *w, const struct hg_error *err);

// ---- dispatch.c: the render thread ----------------------------------------------------------------

void *render_main(void *worker);

// ---- sandbox.c ----------------------------------------------------------------------------------

// No new privileges, memory limit, Landlock and seccomp where the kernel has them. Logs what holds.
enum hg_status sandbox_enter(
    const struct worker_options *options, struct hg_error *err) HG_MUST_CHECK;

#endif
