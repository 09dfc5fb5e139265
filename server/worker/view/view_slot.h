// view_slot.h - views of a session: settings, waiting requests, progress.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_SLOT_H
#define HG_SERVER_WORKER_VIEW_VIEW_SLOT_H

#include "renderer/renderer.h"
#include "server/worker/encode/encode_queue.h"
#include "server/worker/session.h"
#include "server/worker/view/view_control.h"

// A client waiting for one frame of a view.
struct frame_wait {
    struct frame_wait *next;
    uint32_t request;
    bool settled, parts;
    bool exposure; // for the exposure alone, which is answered once it is metered; settled, too
    enum hgp_encoding encoding;
    uint8_t quality;
    uint32_t rate[2]; // frames per second as a ratio; 0 = not said
    uint64_t progress_sent_ns;
    uint32_t most_missing; // pages and clusters, since the request
    uint32_t most_baking;  // mesh parts
    uint64_t baked_before; // texels, when it was asked for; `began` then
    bool began;
};

// When a camera came to the daemon and to the worker; 0 = not known, or none came.
struct view_input {
    uint64_t daemon_ns, worker_ns;
};

// What the view shows.
struct view_settings {
    struct hg_view_params params;
    struct hg_view_camera camera;
    bool camera_given;        // by a view_camera; else it follows the scene (view_fit.h)
    uint64_t camera_node;     // 0: `camera` counts
    uint64_t camera_revision; // of the scene that it was taken from; UINT64_MAX: none yet
    struct view_input input;  // of its newest view_camera
    bool changed;             // since the newest step
    bool has_exposure_mode;   // a message said it
    bool has_temporal;        // likewise
};

// What the client can decode, the best first; see view_codec.h.
struct view_codecs {
    uint8_t items[16];
    uint32_t count;
    uint32_t refused, slow; // 1 << enum hgp_encoding; slow: did not hold target_fps here
    uint64_t slow_until_ns; // when those are tried again
    uint32_t slow_times;    // that some were, since the size is as it is
    double narrow_rate; // bytes/s at which frames that are no video were poor; 0 = they were not
    int announced;      // encoding that the client was informed of, or -1
};

// Frame delivery to a subscriber.
struct view_subscription {
    enum hgp_encoding encoding, still_encoding;
    struct view_codecs codecs;
    enum hgp_encoding motion; // chosen of `codecs`, or `encoding`
    uint8_t quality, hidden, names, depth;
    uint32_t bitrate; // bit/s, 0 = by quality alone
    float max_fps, target_fps;
    bool key_frame;  // the next frame depends on none before it
    uint32_t credit; // frames that may still be sent
    uint64_t sent_ns, sent_number, sent_samples;
    float sent_ev; // exposure
    bool fresh;    // nothing of the newest step's state has been sent yet
    // When the settled frame is sent without loss, of which one with loss has been sent already: it
    // would be long on the wire. 0 = none is due
    uint64_t still_due_ns;
};

// What steps came to.
struct view_progress {
    struct hg_frame_info info; // of the newest step
    uint64_t first_number;     // of the frames that show the same state
    bool stepped;
    bool failed;                      // the newest step failed; rests until something changes
    uint64_t failed_revision;         // of the scene then
    uint32_t failed_textures_sent;    // textures that could not be read, as far as the client knows
    struct hg_untraced untraced_sent; // primitives that are left out of path-traced pictures, too
    uint64_t sample_ns;               // of the newest step
    uint64_t began_ns, stepped_ns;    // when it began and ended
    struct view_input input;          // of the camera that it shows
    uint64_t moved_ns;                // when the newest step of a moving picture ended
    uint64_t spent_ns;                // rendering, since the state was new
};

// The frame key requested last: settled frames carry the key that they were rendered from.
struct view_frame_key {
    bool asked;
    enum hgp_encoding encoding;
    uint8_t quality;
    uint8_t after[32]; // key of the picture before in a series; zero = none
};

// Checkpoints on their way in parts: what is sent, what has come of `receive_bytes`.
struct view_checkpoint {
    struct hg_writer sending, receiving;
    enum hgp_checkpoint_kind receiving_kind;
    uint64_t receive_bytes;
    struct hgp_checkpoint sending_notes; // without data
};

struct view_slot {
    struct view_slot *next;
    uint32_t number;
    struct hg_view *view;
    struct encode_stream *encoder;
    struct turn turn;
    struct frame_wait *waits; // oldest first
    struct view_settings settings;
    struct view_subscription subscription;
    struct hg_control control; // of the subscription
    struct view_progress progress;
    struct view_frame_key frame_key;
    struct view_checkpoint checkpoint;
};

struct view_slot *hg_view_slot_find(struct session *session, uint32_t number); // may be NULL
// HG_E_DEVICE, HG_E_NOMEM and errors of hg_view_create.
enum hg_status hg_view_slot_create(struct render_state *s, struct session *session, uint32_t number,
    struct view_slot **out, struct hg_error *err) HG_MUST_CHECK;
// Frames that are being encoded are still sent.
void hg_view_slot_destroy(struct render_state *s, struct session *session, struct view_slot *view);

// Does a client watch it that can be sent a frame?
bool hg_view_slot_is_watched(const struct view_slot *view);
// Does its newest step show another state than it has to show now?
bool hg_view_slot_is_stale(const struct session *session, const struct view_slot *view);

#endif
