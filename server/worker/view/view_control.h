// view_control.h - controller of one subscribed view: what the network delivers of its frames, when
// the next one may begin, and what it may cost.
// Floor 6, private to server/worker. Pure: times are passed in. Thread: the render thread.
//
// Frames never wait in a queue. Each one is remembered until the client names it in a credit
// message; what that says gives the rate of the bottleneck and the least round trip, as BBR has
// them (Cardwell et al. 2016, "BBR: Congestion-Based Congestion Control"), and from both follows
// when the bottleneck has taken all that was sent. The next frame begins so that it is ready then,
// with the newest input. A frame that is overdue holds the following ones: the picture freezes
// and no queue forms.
//
// Quality follows from the same rate: of lossy encodings the best quality, or the bit rate, at
// which a frame fits into the interval of the chosen frame rate. A client that names no frames is
// bounded by its credit alone.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_CONTROL_H
#define HG_SERVER_WORKER_VIEW_VIEW_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

enum {
    HG_CONTROL_FLIGHTS = 64,      // frames that may be under way
    HG_CONTROL_LEAST_QUALITY = 20 // of JPEG; below it frames come less often instead
};

// What the client asks for.
struct hg_control_goal {
    float fps;        // 0 = nothing gives way
    uint8_t quality;  // of lossy frames, at most
    uint32_t bitrate; // of video, at most; bit/s, 0 = no limit
    uint32_t sharing; // views that move and render in turns, this one included; at least 1
};

// What the next frame is made with.
struct hg_control_choice {
    uint8_t quality;
    uint32_t bitrate; // bit/s; 0 = not known, no limit
    float target_ms;  // of its rendering; 0 = any
};

// A frame that was encoded and handed on.
struct hg_control_sent {
    uint64_t number, bytes, encode_ns, sent_ns;
    uint8_t quality;
    bool lossy;  // its size depends on the quality
    bool failed; // it could not be encoded: what is under way is forgotten
};

// A client's report of a frame (`taken`), and when it reached the daemon.
struct hg_control_delivery {
    uint64_t number, at_ns;
    uint64_t begun_ns, received_ns; // first and last byte, of the client's clock; 0 = not reported
    uint64_t rtt_ns;                // of a ping; 0 = not reported
};

struct hg_control_flight {
    uint64_t number, begin_ns, bytes;
    uint64_t sent_ns;     // 0: it is being encoded
    uint64_t expected_ns; // when its report is due; 0 = not known
};

// The least of a measure in the last ten to twenty seconds.
struct hg_control_least {
    uint64_t ns, next_ns; // of the running and of the next window; 0 = none yet
    uint64_t since_ns;
};

// Zero-initialised: nothing is known.
struct hg_control {
    struct hg_control_flight flights[HG_CONTROL_FLIGHTS]; // a ring, oldest first
    uint32_t first, count;
    bool informed; // the client names frames
    double rate;   // bytes a second; 0 = not known
    struct hg_control_least rtt;
    uint64_t free_ns;                    // when the bottleneck has taken all that was sent
    uint64_t acked_ns;                   // when the newest frame was reported
    double work_ns;                      // from the begin of rendering until it is sent
    double encode_ns, read_ns, delay_ns; // delay: until it is known to have come
    double usual_bytes;                  // of a lossy frame at quality 80
    double still_bytes;                  // of a lossless one
    struct hg_control_choice now;        // the newest
    uint32_t encoding, encoded;          // of lossy frames now; how many had it
    uint64_t sent, delivered, held;      // frames; held: times that one had to wait for a delivery
    bool holds;
};

// A subscription begins: nothing is under way. informed: its client names frames. What is known of
// the network stays.
void hg_control_begin(struct hg_control *c, bool informed);
// A frame goes to the encoder; its rendering began at begin_ns, and reading it took read_ns.
void hg_control_queued(struct hg_control *c, uint64_t number, uint64_t begin_ns, uint64_t read_ns);
void hg_control_sent(struct hg_control *c, const struct hg_control_sent *sent);
void hg_control_delivered(struct hg_control *c, const struct hg_control_delivery *d);
// When the rendering of the next frame may begin: a time that is not after now_ns, or one that is,
// or UINT64_MAX: not before something is delivered. All that was delivered until now_ns is known.
uint64_t hg_control_due_ns(struct hg_control *c, uint64_t now_ns);
struct hg_control_choice hg_control_choose(
    struct hg_control *c, const struct hg_control_goal *goal);
// Frames have this encoding from now on: what was measured of another one counts no more.
void hg_control_set_encoding(struct hg_control *c, uint32_t encoding);
// Its encoder takes much longer than a frame's interval: the next one of the client's should take
// its place, if there is one.
bool hg_control_encoder_is_slow(const struct hg_control *c, float fps);
// The picture has another size: what was measured of its encoder counts no more.
void hg_control_forget_encoder(struct hg_control *c);
// At this frame rate the network takes frames with loss of this encoding in poor quality only.
bool hg_control_is_narrow(const struct hg_control *c, float fps);
// How long a view has to rest before a lossless frame of `pixels` is sent: as long as it will be on
// the wire, where nothing else passes meanwhile. 0 = it is not worth waiting.
uint64_t hg_control_rest_ns(const struct hg_control *c, uint64_t pixels);
// Bytes that are under way.
uint64_t hg_control_bytes(const struct hg_control *c);

#endif
