// sandbox.h - what a worker gives up before it reads its first file.
// Floor 6, private to server/worker. Thread: before there are others.
#ifndef HG_SERVER_WORKER_SANDBOX_H
#define HG_SERVER_WORKER_SANDBOX_H

#include "server/worker/worker.h"

// No new privileges, memory limit, Landlock and seccomp where the kernel has them. Logs what holds.
enum hg_status hg_sandbox_enter(
    const struct worker_options *options, struct hg_error *err) HG_MUST_CHECK;

#endif
