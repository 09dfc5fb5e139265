// session_state.h - inside of a viewer's session. Private to session*.c. Floor 6 (client).
#ifndef HG_CLIENT_VIEW_SESSION_STATE_H
#define HG_CLIENT_VIEW_SESSION_STATE_H

#include <pthread.h>

#include "client/cli/run/recording.h"
#include "client/cli/render/render.h"
#include "client/view/session.h"

enum {
    HG_VIEW_REQUESTS_MAX = 64,
    HG_VIEW_ASSETS_MAX = 64,
    HG_VIEW_PATH_BYTES = 4096,
    HG_VIEW_HIDDEN_MAX = 256, // nodes, in one view alone
    HG_VIEW_CREDIT = 32, // frames under way at most; the daemon keeps as many as the network takes
};

// What the window wants, guarded by the lock.
struct hg_view_wanted {
    bool stop, open, has_camera, has_pose, has_clip, statistics;
    char path[HG_VIEW_PATH_BYTES]; // of the file to open; "" = the same scene
    struct hgp_view_camera camera;
    double pose_s;
    struct hg_clipping_list clip;
    struct hg_view_request requests[HG_VIEW_REQUESTS_MAX];
    uint32_t first, count;
    uint64_t input_seq;
};

// What the window may see, guarded by the lock.
struct hg_view_shown {
    struct hg_view_status status;
    struct hg_view_scene scene;
    struct hg_view_picture picture; // the newest one
    bool has_picture;               // not taken yet
    struct hgp_view_camera fitted;
    struct hg_view_answer answers[HG_VIEW_ANSWERS_MAX]; // by number; status.answers is the newest
    struct hg_tree nodes;                               // not taken yet; else empty
    bool has_nodes;
};

// Of frames that depend on others: what could not be decoded.
struct hg_view_stream {
    bool awaits_key;   // frames are left out until a key frame comes, which was asked for
    uint32_t failures; // key frames in a row
};

// How this view alone shows the scene.
struct hg_view_look {
    uint64_t selected; // node, 0 = none
    uint64_t hidden[HG_VIEW_HIDDEN_MAX];
    size_t hidden_count;
};

// Of the session's thread alone.
struct hg_view_work {
    struct hg_cli_options options;
    char path[HG_VIEW_PATH_BYTES]; // options.args[0] once a file was opened
    struct hg_cli_render render;
    struct hg_view_decoder decoder;
    struct hg_view_stream stream;
    struct hg_view_picture picture; // being decoded
    struct hg_warp_depth depth;     // of the newest frame's state
    uint32_t assets[HG_VIEW_ASSETS_MAX], asset_count;
    bool may_edit; // the session's role
    struct hg_view_look look;
    struct hg_cli_recorder *recorder; // NULL: nothing is recorded
    uint64_t ping_ns;                 // when the newest one was sent
};

struct hg_view_session {
    pthread_t thread;
    bool is_running;
    pthread_mutex_t lock;
    int wake_fd;
    void (*changed)(void *user);
    void *user;
    struct hg_view_wanted wanted;
    struct hg_view_shown shown;
    struct hg_view_work work;
};

// session_open.c: connects, loads the scene, makes the view and subscribes to it.
enum hg_status hg_view_open_scene(struct hg_view_session *s, struct hg_error *err) HG_MUST_CHECK;
// Where the view's camera stands: eye, target and lens of *camera; its other members stay.
enum hg_status hg_view_ask_place(
    struct hg_view_session *s, struct hgp_view_camera *camera, struct hg_error *err) HG_MUST_CHECK;
// session_requests.c. Sends what the window wants. What the server refuses is said, and the session
// goes on; its end is found out by helio_process.
void hg_view_do_wanted(struct hg_view_session *s);
// session.c. The window is to look at what is shown.
void hg_view_tell(struct hg_view_session *s);
// An answer that is an error comes back as a message.
enum hg_status hg_view_send(
    struct hg_view_session *s, enum hgp_type type, const void *message, struct hg_error *err);
void hg_view_say_error(struct hg_view_session *s, const struct hg_error *err);
// What is being done; share < 0: how far it is is not known.
void hg_view_say_stage(struct hg_view_session *s, const char *stage, double share);
// A remark that does not end anything.
void hg_view_say(struct hg_view_session *s, const char *fmt, ...) HG_PRINTF(2, 3);

#endif
