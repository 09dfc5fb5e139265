// disk_queue.h - work on the disk that the loop does not wait for: a thread does one piece after
// another, in the order in which they were pushed.
// Floor 6 (broker). Thread: the loop; `run` is called in the queue's own thread.
#ifndef HG_BROKER_DISK_QUEUE_H
#define HG_BROKER_DISK_QUEUE_H

#include <stdbool.h>

#include "base/status.h"

struct hg_disk_queue;

// Embedded in what it is for. Until `done` is called, the thread may be using it.
struct hg_disk_job {
    struct hg_disk_job *next;
    void (*run)(struct hg_disk_job *job);  // in the thread
    void (*done)(struct hg_disk_job *job); // in the loop, in the same order; may free it
};

// HG_E_NOMEM: no memory, or no thread; HG_E_LIMIT: no descriptor.
enum hg_status hg_disk_queue_create(struct hg_disk_queue **out) HG_MUST_CHECK;
// Waits for all jobs, and ends the thread. Accepts NULL.
void hg_disk_queue_destroy(struct hg_disk_queue *queue);
void hg_disk_queue_push(struct hg_disk_queue *queue, struct hg_disk_job *job);
int hg_disk_queue_fd(const struct hg_disk_queue *queue); // readable: call hg_disk_queue_poll
// Calls `done` of the jobs that have run.
void hg_disk_queue_poll(struct hg_disk_queue *queue);
// Until nothing is left, and all are done. The one call here that waits for the disk.
void hg_disk_queue_wait(struct hg_disk_queue *queue);
// Nothing was pushed that is not done.
bool hg_disk_queue_is_idle(const struct hg_disk_queue *queue);

#endif
