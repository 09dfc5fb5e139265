#include "base/cond.h"

#include <errno.h>
#include <time.h>

#include "base/clock.h"

void hg_cond_init(pthread_cond_t *cond)
{
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(cond, &monotonic);
    pthread_condattr_destroy(&monotonic);
}

bool hg_cond_wait(pthread_cond_t *cond, pthread_mutex_t *lock, uint64_t until_ns)
{
    if (until_ns == HG_COND_FOREVER) {
        pthread_cond_wait(cond, lock);
        return true;
    }
    const struct timespec until = {
        .tv_sec = (time_t)(until_ns / 1000000000u), .tv_nsec = (long)(until_ns % 1000000000u)};
    return pthread_cond_timedwait(cond, lock, &until) != ETIMEDOUT;
}

uint64_t hg_cond_after(uint64_t ns)
{
    const uint64_t now = hg_clock_now_ns();
    return ns < HG_COND_FOREVER - now ? now + ns : HG_COND_FOREVER;
}
