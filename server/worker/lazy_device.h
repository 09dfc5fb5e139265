// lazy_device.h - opens the device while a session's first asset is being loaded.
// Floor 6, private to server/worker. Thread: the render thread; the work is done by one of its own.
//
// Most sessions look at what they load, some only ask about it. So the device is opened only when
// the load takes longer than a moment, or when a message needs it.
#ifndef HG_SERVER_WORKER_LAZY_DEVICE_H
#define HG_SERVER_WORKER_LAZY_DEVICE_H

#include <pthread.h>

#include "renderer/renderer.h"

struct lazy_device {
    bool started; // a thread is there to be joined
    bool hurry, stop;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    pthread_t thread;
    struct hg_renderer_params params;
    struct hg_renderer *renderer;
};

// Begins, unless it has begun. What the parameters point to must outlive the opener. Where no
// thread is to be had nothing happens.
void hg_lazy_device_start(struct lazy_device *opener, const struct hg_renderer_params *params);
// Waits for the device and returns it, once. NULL: opening was not started, or failed.
struct hg_renderer *hg_lazy_device_take(struct lazy_device *opener);
// A device that was not taken is closed.
void hg_lazy_device_finish(struct lazy_device *opener);

#endif
