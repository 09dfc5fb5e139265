// sandbox.h - what a worker gives up before it reads its first file.
// Floor 6, private to server/worker. Thread: before there are others.
#ifndef HG_SERVER_WORKER_SANDBOX_H
#define HG_SERVER_WORKER_SANDBOX_H

#include "server/worker/worker.h"

// require, best-effort, off.
bool hg_sandbox_parse(const char *text, enum hg_sandbox_mode *out);
// No new privileges, memory limit, Landlock and seccomp where the kernel has them. Logs what holds.
// HG_E_UNSUPPORTED with HG_SANDBOX_REQUIRE: the kernel lacks some of it, or what must be impossible
// is not.
enum hg_status hg_sandbox_enter(
    const struct worker_options *options, struct hg_error *err) HG_MUST_CHECK;

#endif
