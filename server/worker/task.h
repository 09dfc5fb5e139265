// task.h - slow work off the render thread: loading files, comparing images.
// Floor 6, private to server/worker.
#ifndef HG_SERVER_WORKER_TASK_H
#define HG_SERVER_WORKER_TASK_H

#include "renderer/light/env/env_file.h"
#include "renderer/renderer.h"
#include "server/worker/reply.h"

enum task_kind { TASK_ASSET, TASK_ENVIRONMENT, TASK_COMPARE, TASK_IMAGE };

// One file or comparison, with a thread of its own. While it runs, later messages of its session
// wait, so that messages of a session take effect in order.
struct task {
    enum task_kind kind;
    struct reply_to to;
    uint64_t session;
    struct hg_refbuf *payload; // keeps message alive
    struct hg_refbuf *roots;   // as of the session
    struct hg_arena arena;     // lists of message
    union hgp_any message;
    struct hg_writer file; // IMAGE: when it came in parts
    struct hg_jobs *jobs;
    uint64_t memory_bytes; // ASSET: that it may take; 0 = no limit
    _Atomic bool cancel;
    struct watch watch;
    uint64_t progress_sent_ns;
    // Results:
    enum hg_status status;
    struct hg_error err;
    struct hg_asset *asset;
    struct hg_environment_file environment;
    double value;
    struct hg_image_summary summary; // IMAGE
    struct hg_writer diff;
    uint32_t width, height;
};

// Starts `task` (owned by its thread until it comes back through the inbox). HG_E_LIMIT.
enum hg_status hg_task_start(struct task *task) HG_MUST_CHECK;
void hg_task_destroy(struct task *task); // accepts NULL

#endif
