// viewer.h - the window of `helio view` and its state. Private to viewer*.c and main.c.
// Floor 6 (client). Thread: that of the window; session.h says what the other one does.
#ifndef HG_CLIENT_VIEW_VIEWER_H
#define HG_CLIENT_VIEW_VIEWER_H

#include "client/view/controls.h"
#include "client/view/overlay.h"
#include "client/view/session.h"

enum { HG_VIEWER_SENT_MAX = 256 }; // cameras whose way to the picture is measured

// What the user has chosen for the view, as far as keys change it.
struct hg_viewer_choice {
    bool path, ground;
    enum hgp_background background;
    enum hgp_environment_kind light;
    double rotation_deg, exposure_ev; // EV is added to the metered one
    uint32_t variant;                 // 0 = the file's own materials, else its number from 1
    int32_t camera;                   // of the scene, -1 = none of them
};

struct hg_viewer_clock {
    bool plays;
    double time_s;      // of the animations
    uint64_t before_ns; // when time_s was set
};

// Measured for the statistics.
struct hg_viewer_measured {
    uint64_t sent_ns[HG_VIEWER_SENT_MAX]; // of a camera, by input_seq
    double latency_ms;                    // of the newest one that was seen
    double fps, bytes_per_s;
    uint64_t frames, bytes, since_ns; // where the running interval began
};

struct hg_viewer_pointer {
    bool turns, pans;
};

// Answers of the session that were taken, as its status counts them.
struct hg_viewer_taken {
    uint32_t scenes, fits, picks, messages;
};

// When the message is to go, the window got its size (0: the view has it), keys were looked at.
struct hg_viewer_times {
    uint64_t message_until_ns, resized_ns, moved_ns;
};

struct hg_viewer {
    const struct hg_cli_options *o;
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *texture; // of the picture; NULL: none yet
    struct hg_overlay overlay;
    struct hg_view_session *session;
    struct hg_view_status status;
    struct hg_view_scene *scene;
    struct hg_view_picture picture;
    struct hg_navigate navigate;
    struct hg_controls controls;
    struct hg_viewer_pointer pointer;
    struct hg_viewer_choice choice;
    struct hg_viewer_clock clock;
    struct hg_viewer_measured measured;
    uint32_t wake_event; // of SDL, when the session has something new
    struct hg_viewer_taken taken;
    struct hg_viewer_times times;
    bool help, statistics, quits, dirty; // dirty: the window has to be drawn
    int width, height;                   // px of the drawing area
};

// viewer.c. Shows the window until it is closed; the exit code of `helio view`.
int hg_viewer_run(const struct hg_cli_options *options);
// Sends where the camera stands now.
void hg_viewer_send_camera(struct hg_viewer *v);
void hg_viewer_say(struct hg_viewer *v, const char *fmt, ...) HG_PRINTF(2, 3);

// viewer_actions.c
void hg_viewer_do(struct hg_viewer *v, enum hg_view_action action, bool shift);
// Size of the view = size of the window.
void hg_viewer_send_size(struct hg_viewer *v);
// What the options and the scene begin with.
void hg_viewer_begin_scene(struct hg_viewer *v);

// viewer_text.c
void hg_viewer_draw_text(struct hg_viewer *v);
void hg_viewer_title(const struct hg_viewer *v, char *title, size_t size);

#endif
