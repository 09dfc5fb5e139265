// cond.h - condition variables that wait until a time of base/clock.h. Floor 0.
#ifndef HG_BASE_COND_H
#define HG_BASE_COND_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#define HG_COND_FOREVER UINT64_MAX

// For hg_cond_wait; ended with pthread_cond_destroy.
void hg_cond_init(pthread_cond_t *cond);
// Holding the lock. False: the time has come, hg_clock_now_ns() >= until_ns.
bool hg_cond_wait(pthread_cond_t *cond, pthread_mutex_t *lock, uint64_t until_ns);
// Now and so much later; FOREVER stays.
uint64_t hg_cond_after(uint64_t ns);

#endif
