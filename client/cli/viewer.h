// viewer.h - a viewer without a window, for benchmarks and tests: it subscribes to a view, turns
// the camera around the scene, takes frames, says that it has them, and measures how old they are.
// Floor 6 (client). Thread: one at a time.
//
// Times are of the client's CLOCK_MONOTONIC; those in frames are brought there by the offset of the
// daemon's clock, taken from the ping with the least round trip (Cristian 1989, "Probabilistic
// clock synchronization").
#ifndef HG_CLIENT_CLI_VIEWER_H
#define HG_CLIENT_CLI_VIEWER_H

#include "client/include/helio/helio.h"

enum { HG_VIEWER_POSES = 4096, HG_VIEWER_VIEW = 1 };

// What passes between a pose that is sent and its frame, in this order.
enum hg_viewer_stage {
    HG_VIEWER_UPLINK, // client to daemon
    HG_VIEWER_INPUT,  // daemon to worker
    HG_VIEWER_WAIT,   // until it is the view's turn
    HG_VIEWER_RENDER,
    HG_VIEWER_READ, // pixels, and until an encoder has time
    HG_VIEWER_ENCODE,
    HG_VIEWER_OUTPUT,   // worker to daemon
    HG_VIEWER_DOWNLINK, // until the client has all of it
    HG_VIEWER_STAGES
};
extern const char *const hg_viewer_stage_names[HG_VIEWER_STAGES];

// The first frame that shows a pose, or one behind it.
struct hg_viewer_sample {
    uint64_t seq, shown_ns;
    uint64_t latency_ns; // since that pose was sent
    int64_t stage_ns[HG_VIEWER_STAGES];
    uint32_t bytes;
};

struct hg_viewer;

struct hg_viewer_options {
    const char *url, *token, *scene_name, *asset; // asset: loaded when the scene is new, unless
    enum hg_status (*build)(struct hg_viewer *v, struct hg_error *err); // this makes it
    uint32_t width, height;
    uint32_t poses;     // of a turn around the scene, at most HG_VIEWER_POSES; 0, 1: 300, as a pose
                        // that leaves the picture as it is brings no frame
    double poses_per_s; // 0: the next one as soon as the one before is shown
    float target_fps;              // of the view
    enum hgp_encoding encoding;
    bool path;           // mode PATH
    bool plain;          // without global illumination, at a fixed exposure
    uint64_t timeout_ns; // of each answer
};

struct hg_viewer {
    struct hg_viewer_options options;
    struct helio *h;
    struct hgp_scene_opened scene;
    struct hgp_view_camera fit; // what the poses turn
    int64_t offset_ns;          // of the daemon's clock from ours
    uint64_t rtt_ns;
    uint64_t seq, next_pose_ns;        // of the newest pose; when the next one is due
    uint64_t sent_ns[HG_VIEWER_POSES]; // by seq
    uint64_t shown_seq, stale;         // of the newest frame; frames older than one before
    uint64_t frames, bytes, sample_count;
    uint64_t enough;  // samples after which hg_viewer_run returns at once; 0: it goes on
    bool settled;     // the newest frame is, without loss
    uint8_t hash[32]; // of its pixels
    void (*on_sample)(void *user, const struct hg_viewer_sample *sample); // NULL: none
    void *user;
};

// Connects, opens the scene and the view, takes the clock's offset, and subscribes. On failure
// hg_viewer_close is still to be called.
enum hg_status hg_viewer_open(struct hg_viewer *v, struct hg_error *err) HG_MUST_CHECK;
void hg_viewer_close(struct hg_viewer *v);
// Takes what comes until then; with `moves` it sends poses when they are due.
enum hg_status hg_viewer_run(
    struct hg_viewer *v, uint64_t until_ns, bool moves, struct hg_error *err) HG_MUST_CHECK;
// Until the newest pose is shown, or settled and without loss. HG_E_TIMEOUT: says what did not
// come.
enum hg_status hg_viewer_await(
    struct hg_viewer *v, bool settled, uint64_t timeout_ns, struct hg_error *err) HG_MUST_CHECK;
// Whether its picture is watched (view_set.hidden).
enum hg_status hg_viewer_hide(struct hg_viewer *v, bool hidden, struct hg_error *err) HG_MUST_CHECK;

#endif
