// io_thread.h - the thread of the socketpair: bytes to commands, messages to bytes, pulses.
// Floor 6, private to server/worker.
#ifndef HG_SERVER_WORKER_IO_THREAD_H
#define HG_SERVER_WORKER_IO_THREAD_H

#include "server/worker/worker.h"

// Runs until the link closes. HG_E_CLOSED on orderly end, HG_E_IO when arrays could not be read
// back, after an error message to the peer, else what broke.
enum hg_status hg_io_thread_run(struct worker *w) HG_MUST_CHECK;

// From now on a disk that does not give back what was spilled ends the process by way of
// hg_io_thread_run.
void hg_io_thread_watch_disk(struct worker *w);

#endif
