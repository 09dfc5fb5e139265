// rate_control.h - the quality that keeps frames with loss within a bit rate.
// Floor 6, private to server/worker. Pure: measurements in, quality out; one thread at a time.
//
// Encoders run at constant quality; this chooses it frame by frame, so that one rule serves video,
// JPEG and tiles, frame rates may vary, and no encoder is reopened. A leaky bucket holds what was
// sent beyond the rate; a frame may take its share of the rate less a part of the bucket. The size
// of the next frame is taken for that of the newest, times 2 for every 16 steps of quality.
#ifndef HG_SERVER_WORKER_ENCODE_RATE_CONTROL_H
#define HG_SERVER_WORKER_ENCODE_RATE_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

// Zero-initialised.
struct rate_control {
    uint64_t now_ns;     // of the newest frame
    double interval_s;   // between frames, smoothed
    double bucket_bits;  // sent beyond the rate
    double size_bits;    // of the newest frame that counts
    uint8_t quality;     // it had; 0 = none yet
    uint8_t now_quality; // of the frame that is being encoded
};

// Of the frame that is encoded now, at most `quality` (1..100); bitrate 0 (bit/s): `quality`.
uint8_t hg_rate_control_next(
    struct rate_control *rc, uint8_t quality, uint32_t bitrate, uint64_t now_ns);
// It took so many bytes. is_usual: frames after it are like it (a key frame of video is not).
void hg_rate_control_spent(struct rate_control *rc, uint64_t bytes, bool is_usual);

#endif
