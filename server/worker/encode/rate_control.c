#include "server/worker/encode/rate_control.h"

#include <math.h>

#define WINDOW_S       0.5 // the bucket's size, as time at the rate
#define MOST_WINDOWS   2.0
#define STEPS_OCTAVE   16.0 // of quality, for twice the size
#define MOST_RISE      6.0  // of quality, from frame to frame
#define LEAST_INTERVAL 0.004
#define MOST_INTERVAL  0.25

static double clamp(double value, double least, double most)
{
    return value < least ? least : value > most ? most : value;
}

// What the time since the newest frame has let out of the bucket.
static void drain(struct rate_control *rc, uint32_t bitrate, uint64_t now_ns)
{
    const double passed_s = rc->now_ns ? (double)(now_ns - rc->now_ns) * 1e-9 : MOST_INTERVAL;
    const double interval_s = clamp(passed_s, LEAST_INTERVAL, MOST_INTERVAL);
    rc->interval_s = rc->interval_s > 0 ? 0.75 * rc->interval_s + 0.25 * interval_s : interval_s;
    const double most_bits = MOST_WINDOWS * WINDOW_S * bitrate; // what is late is soon forgotten
    rc->bucket_bits = fmax(0, fmin(rc->bucket_bits, most_bits) - passed_s * bitrate);
    rc->now_ns = now_ns;
}

uint8_t hg_rate_control_next(
    struct rate_control *rc, uint8_t quality, uint32_t bitrate, uint64_t now_ns)
{
    double next = quality;
    drain(rc, bitrate, now_ns);
    if (bitrate > 0 && rc->quality > 0 && rc->size_bits > 0) {
        const double full = clamp(rc->bucket_bits / (bitrate * WINDOW_S), 0, 0.9);
        const double target_bits = bitrate * rc->interval_s * (1 - full);
        next = rc->quality + STEPS_OCTAVE * log2(target_bits / rc->size_bits);
        next = clamp(fmin(next, rc->quality + MOST_RISE), 1, quality);
    }
    rc->now_quality = (uint8_t)next;
    return rc->now_quality;
}

void hg_rate_control_spent(struct rate_control *rc, uint64_t bytes, bool is_usual)
{
    rc->bucket_bits += 8.0 * (double)bytes;
    if (!is_usual)
        return;
    rc->size_bits = 8.0 * (double)bytes;
    rc->quality = rc->now_quality;
}
