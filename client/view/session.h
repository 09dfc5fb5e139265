// session.h - a viewer's conversation with the server, on a thread of its own: opens the scene,
// sends the newest camera and the edits, decodes the newest frame.
//
// Floor 6 (client). Thread: the functions below belong to the thread of the window; none of them
// waits for the server. The session's thread owns the connection. Frames never queue: of those that
// have come only the newest is decoded. Cameras, poses of
// animations and clipping planes never queue either: the newest replaces one that is not sent yet.
#ifndef HG_CLIENT_VIEW_SESSION_H
#define HG_CLIENT_VIEW_SESSION_H

#include "client/cli/options.h"
#include "client/view/clipping.h"
#include "client/view/decode.h"
#include "client/view/tree.h"
#include "client/view/warp.h"

enum {
    HG_VIEW_NAMES_MAX = 64, // cameras and variants that can be chosen
    HG_VIEW_NAME_BYTES = 64,
    HG_VIEW_STAGES_MAX = 16,
    HG_VIEW_TEXT_BYTES = 512,
    HG_VIEW_ANSWERS_MAX = 16, // that are kept until the window takes them
};

struct hg_view_session;

enum hg_view_state {
    HG_VIEW_OPENING, // `text` says what is being done
    HG_VIEW_OPEN,
    HG_VIEW_FAILED, // `text` says why; hg_view_session_open tries again
};

struct hg_view_name {
    char text[HG_VIEW_NAME_BYTES]; // control bytes replaced
    uint64_t id;                   // node of a camera
};

// What the scene offers.
struct hg_view_scene {
    struct hg_view_name cameras[HG_VIEW_NAMES_MAX], variants[HG_VIEW_NAMES_MAX];
    uint32_t camera_count, variant_count;
    double duration_s;             // of the longest animation; 0 = there is none
    double radius;                 // of the scene's bounds, metres
    bool has_box;                  // false: it is empty
    float min[3], max[3];          // its bounds, metres
    struct hgp_view_camera camera; // that the view begins with
};

// What the server's controller knows of the network and has chosen (`flow` of stats_query).
struct hg_view_flow {
    bool is_known;
    double target_fps, target_ms, rate_mbit_s, rtt_ms, delay_ms;
    uint32_t quality;
    uint64_t bitrate, under_way, bytes_under_way, held;
};

struct hg_view_status {
    enum hg_view_state state;
    char text[HG_VIEW_TEXT_BYTES];
    char title[256];   // name of the scene
    char server[160];  // program or device at the other end
    double share;      // of what is being done, 0 to 1; < 0: unknown
    uint32_t scene;    // counts scenes that were opened: hg_view_session_scene has another one
    uint32_t messages; // counts `message`, a remark or an error that does not end anything
    char message[HG_VIEW_TEXT_BYTES];
    uint32_t fits, answers, lists;   // that have come: hg_view_session_fitted, _answer, _nodes
    uint64_t frames, bytes, dropped; // received in all; frames that a newer one replaced
    uint64_t rtt_ns;                 // of the newest ping; 0 = none yet
    uint32_t reconnects;
    struct hg_view_flow flow; // while statistics are wanted
    bool may_edit;            // the session's role
    int exit_code;            // FAILED: of the error; a refusal later does not count
};

// Where a picture comes from.
struct hg_view_facts {
    uint64_t number, revision, input_seq, received_ns, decode_ns;
    uint32_t samples, missing_pages, missing_clusters, bytes;
    enum hgp_encoding encoding;
    enum hgp_render_mode mode;
    bool settled, lossless, has_hash;
    float noise, exposure_ev; // noise < 0: unknown
    uint8_t hash[32];
    uint32_t stage_count;
    struct {
        char name[20];
        uint64_t ns;
    } stages[HG_VIEW_STAGES_MAX];
};

struct hg_view_picture {
    struct hg_view_pixels pixels;
    struct hg_view_facts facts;
    struct hg_warp_depth depth; // of its state, where the view has `depth`
};

// What the window asks for, beside cameras, poses and clipping planes.
enum hg_view_ask {
    HG_VIEW_ASK_SET,         // view: view_set
    HG_VIEW_ASK_ENVIRONMENT, // environment
    HG_VIEW_ASK_VARIANT,     // text
    HG_VIEW_ASK_NODE,        // node: a camera; likewise, where that camera of the scene stands
    HG_VIEW_ASK_FIT,         // text = a named side, or empty; node = what is to be shown, 0 = all;
                             // the camera that shows it: hg_view_session_fitted has the answer
    HG_VIEW_ASK_PICK,        // at: what is seen there in that frame, or in the newest, becomes the
                             // selection; an answer
    HG_VIEW_ASK_CENTRE,      // at: likewise, for the camera's target; an answer
    HG_VIEW_ASK_POINT,       // at: place and normal there in that frame, for measuring; an answer
    HG_VIEW_ASK_SELECT,      // node: the view outlines it; 0 = nothing
    HG_VIEW_ASK_VISIBLE,     // node, visible: an edit of the scene; an answer once it is done
    HG_VIEW_ASK_LIST,        // the nodes: hg_view_session_nodes has the answer
    HG_VIEW_ASK_SHOT,        // text = file; the newest frame, without loss
};

struct hg_view_request {
    enum hg_view_ask ask;
    union {
        struct hgp_view_set view;
        struct hgp_environment_set environment;
        struct {
            uint64_t node;
            bool visible;
        };
        struct {
            uint32_t x, y;  // px of the picture
            uint64_t frame; // its number
        } at;
    };
    char text[HG_VIEW_TEXT_BYTES];
};

// What was found or done. A request that failed has a message in place of it.
struct hg_view_answer {
    enum hg_view_ask ask;
    bool hit;                     // PICK, CENTRE, POINT: false: nothing is there
    bool visible;                 // VISIBLE
    uint64_t node;                // of the hit, or that was edited
    uint64_t revision;            // of the frame that was looked at, or of the scene with the edit
    float position[3], normal[3]; // world space, metres
};

void hg_view_picture_finish(struct hg_view_picture *picture);

// Starts the thread and opens the scene of `options`, which are borrowed. `changed` is called on
// the session's thread when the status changed or a picture came: it wakes the window.
enum hg_status hg_view_session_create(const struct hg_cli_options *options,
    void (*changed)(void *user), void *user, struct hg_view_session **out,
    struct hg_error *err) HG_MUST_CHECK;
// Ends the connection and the thread. Accepts NULL.
void hg_view_session_destroy(struct hg_view_session *s);

// Opens another file in place of the scene, or (NULL) the same scene again.
void hg_view_session_open(struct hg_view_session *s, const char *path);

void hg_view_session_status(struct hg_view_session *s, struct hg_view_status *out);
void hg_view_session_scene(struct hg_view_session *s, struct hg_view_scene *out);
// The newest picture; false: the one that `picture` holds is. The memory of the old one goes back.
bool hg_view_session_take(struct hg_view_session *s, struct hg_view_picture *picture);

// The newest one wins. Members view and input_seq are set here; returns the number that the frame
// which shows it has as input_seq.
uint64_t hg_view_session_camera(struct hg_view_session *s, const struct hgp_view_camera *camera);
void hg_view_session_pose(struct hg_view_session *s, double time_s);
void hg_view_session_clip(struct hg_view_session *s, const struct hg_clipping_list *planes);
// False: 64 requests wait already.
bool hg_view_session_ask(struct hg_view_session *s, const struct hg_view_request *request);
// Are the status' `flow` and what else costs a question wanted?
void hg_view_session_want_statistics(struct hg_view_session *s, bool wanted);
bool hg_view_session_fitted(struct hg_view_session *s, struct hgp_view_camera *camera);
// The answer of this number, counted from 1; false: it was not taken in time.
bool hg_view_session_answer(
    struct hg_view_session *s, uint32_t number, struct hg_view_answer *answer);
// The newest list of nodes, which the caller has to finish from now on; false: it was taken.
bool hg_view_session_nodes(struct hg_view_session *s, struct hg_tree *tree);

// The answer to stats_query; false: it has no flow.
bool hg_view_read_flow(const char *text, size_t size, struct hg_view_flow *out);

#endif
