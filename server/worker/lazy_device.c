#include "server/worker/lazy_device.h"

#include "base/cond.h"
#include "base/log.h"

enum { MOMENT_NS = 20 * 1000 * 1000 };

// True when the device is to be opened.
static bool wait_a_moment(struct lazy_device *o)
{
    const uint64_t until_ns = hg_cond_after(MOMENT_NS);
    pthread_mutex_lock(&o->lock);
    while (!o->hurry && !o->stop && hg_cond_wait(&o->changed, &o->lock, until_ns))
        ;
    const bool open = !o->stop;
    pthread_mutex_unlock(&o->lock);
    return open;
}

static void *lazy_device_main(void *arg)
{
    struct lazy_device *o = arg;
    struct hg_error err = {0};
    // A caller that needs the device tries again and gets the reason.
    if (wait_a_moment(o) && hg_renderer_create(&o->params, &o->renderer, &err))
        hg_debug(WORKER, "%s: %s", err.what, err.reason);
    return NULL;
}

void hg_lazy_device_start(struct lazy_device *o, const struct hg_renderer_params *params)
{
    if (o->started)
        return;
    *o = (struct lazy_device){.params = *params};
    pthread_mutex_init(&o->lock, NULL);
    hg_cond_init(&o->changed);
    o->started = pthread_create(&o->thread, NULL, lazy_device_main, o) == 0;
    if (!o->started) {
        pthread_cond_destroy(&o->changed);
        pthread_mutex_destroy(&o->lock);
    }
}

static void join(struct lazy_device *o, bool stop)
{
    if (!o->started)
        return;
    pthread_mutex_lock(&o->lock);
    o->hurry = true;
    o->stop = stop;
    pthread_cond_signal(&o->changed);
    pthread_mutex_unlock(&o->lock);
    pthread_join(o->thread, NULL);
    pthread_cond_destroy(&o->changed);
    pthread_mutex_destroy(&o->lock);
    o->started = false;
}

struct hg_renderer *hg_lazy_device_take(struct lazy_device *o)
{
    join(o, false);
    struct hg_renderer *renderer = o->renderer;
    o->renderer = NULL;
    return renderer;
}

void hg_lazy_device_finish(struct lazy_device *o)
{
    join(o, true);
    hg_renderer_destroy(o->renderer);
    o->renderer = NULL;
}
