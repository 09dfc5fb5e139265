// shaper.h - a proxy that makes a connection slow: rate, delay, jitter, stalls. For tests and
// benchmarks; it listens on the loopback address and connects to a unix socket only.
//
// Each direction is a queue before a token bucket, and a delay line behind it: what has passed the
// bucket comes out after the delay, in order. Of the queue no more than its limit is read, so that
// the sender feels a full one as it does that of a router. The client's direction is delayed, not
// limited.
#ifndef HG_TESTS_SUPPORT_SHAPER_H
#define HG_TESTS_SUPPORT_SHAPER_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// ---- token bucket (pure) ------------------------------------------------------------------------

// Fills at `rate` up to `burst`; what passes takes as many tokens as it has bytes. A piece above
// the burst passes when the bucket is full, and leaves a debt.
struct shaper_bucket {
    double rate;   // bytes a second; 0 = nothing passes
    double burst;  // bytes, above 0
    double tokens; // at since_ns
    uint64_t since_ns;
};

void shaper_bucket_init(
    struct shaper_bucket *b, double rate, double burst, uint64_t now_ns); // full
void shaper_bucket_set_rate(struct shaper_bucket *b, double rate, uint64_t now_ns);
// Takes `bytes` when they may pass now.
bool shaper_bucket_take(struct shaper_bucket *b, size_t bytes, uint64_t now_ns);
// How long until they may; UINT64_MAX: never at this rate.
uint64_t shaper_bucket_wait_ns(const struct shaper_bucket *b, size_t bytes, uint64_t now_ns);

// ---- the proxy ----------------------------------------------------------------------------------

// From `at_ns` after the start on the rate is this one. 0 is a stall.
struct shaper_step {
    uint64_t at_ns;
    double rate;
};

struct shaper_options {
    double rate;                     // bytes a second, to the client; until the first step
    uint64_t delay_ns, jitter_ns;    // one way, and at most that much more, equally distributed
    size_t queue_bytes;              // 0: 256 KiB
    const struct shaper_step *steps; // by time; outlive the shaper
    uint32_t step_count;
};

struct shaper {
    struct shaper_options options;
    char target[108]; // path of a unix socket
    int listener, port, stop_fd;
    uint64_t started_ns;
    _Atomic double rate;         // overrides options and steps while it is not below 0
    _Atomic uint64_t down_bytes; // that have come out towards clients
    pthread_t thread;
};

// False: no socket or no thread.
bool shaper_start(struct shaper *s, const char *target, const struct shaper_options *options);
void shaper_set_rate(struct shaper *s, double rate); // from now on; below 0: as the steps say
void shaper_stop(struct shaper *s);                  // closes all connections

#endif
