// viewer.h - the window of `helio view` and its state. Private to viewer*.c and main.c.
// Floor 6 (client). Thread: that of the window; session.h says what the other one does.
#ifndef HG_CLIENT_VIEW_VIEWER_H
#define HG_CLIENT_VIEW_VIEWER_H

#include "client/view/controls.h"
#include "client/view/overlay.h"
#include "client/view/projection.h"
#include "client/view/measure.h"
#include "client/view/session.h"

enum { HG_VIEWER_SENT_MAX = 256 }; // cameras whose way to the picture is measured

// What the user has chosen for the view, as far as keys change it.
struct hg_viewer_choice {
    bool path, ground, reprojects;
    enum hgp_background background;
    enum hgp_environment_kind light;
    double rotation_deg, exposure_ev; // EV is added to the metered one
    uint32_t variant;                 // 0 = the file's own materials, else its number from 1
    int32_t camera;                   // of the scene, -1 = none of them
    struct hg_cli_size size;          // that the view has
};

struct hg_viewer_clock {
    bool plays;
    double time_s;      // of the animations
    uint64_t before_ns; // when time_s was set
};

// Cameras that were sent, by input_seq: a picture says which of them it shows.
struct hg_viewer_sent {
    uint64_t seq, ns; // when it was sent; 0: its way was measured
    struct hgp_view_camera camera;
};

// Measured for the statistics.
struct hg_viewer_measured {
    struct hg_viewer_sent *sent;          // HG_VIEWER_SENT_MAX of them
    uint64_t newest_seq;                  // 0: none was sent since the scene was opened
    double latency_ms;                    // of the newest one that was seen
    double fps, bytes_per_s;
    uint64_t frames, bytes, since_ns; // where the running interval began
};

struct hg_viewer_pointer {
    bool turns, pans;
    bool clicks; // a press that turns, but has not moved far enough for that yet
    int dx, dy;  // how far
};

enum hg_viewer_panel { HG_VIEWER_NO_PANEL, HG_VIEWER_TREE, HG_VIEWER_CLIPPING };

// The panel at the right side, what it shows, and measuring.
struct hg_viewer_panels {
    enum hg_viewer_panel open;
    struct hg_tree tree; // selected: the node that the view outlines; empty: not listed yet
    struct hg_clipping clipping;
    struct hg_measure measure;
    uint64_t listed_ns; // when the nodes were asked for
    uint32_t row;       // of the clipping planes: x, y, z, caps
    bool says_selected; // once its name is known
    bool measures;      // clicks are points to measure between
    bool searches;      // what is typed is the filter of the tree
    bool slides;        // the pointer moves the plane of `row`
};

// Where the rows of the open panel are, below its title.
struct hg_viewer_box {
    SDL_Rect all;
    int x, y, columns, rows; // px; characters and lines that fit
    int advance, line;       // px of a character, of a line
};

// Answers of the session that were taken, as its status counts them.
struct hg_viewer_taken {
    uint32_t scenes, fits, answers, lists, messages;
};

// When the message is to go, the window got its size (0: the view has it), keys were looked at.
struct hg_viewer_times {
    uint64_t message_until_ns, resized_ns, moved_ns;
};

struct hg_viewer_canvas {
    SDL_Texture *texture; // of the picture; NULL: none yet
    struct hg_warp_mesh mesh;
};

struct hg_viewer {
    const struct hg_cli_options *o;
    SDL_Window *window;
    SDL_Renderer *renderer;
    struct hg_viewer_canvas canvas;
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
    struct hg_viewer_panels panels;
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
// Until the picture of the newest camera is there, the one before is shown as that camera sees it,
// where that is wanted.
bool hg_viewer_is_reprojected(const struct hg_viewer *v);
// Where the picture stands in the window. False: there is none yet.
bool hg_viewer_picture_rect(const struct hg_viewer *v, struct hg_projection_rect *rect);

// viewer_actions.c
void hg_viewer_do(struct hg_viewer *v, enum hg_view_action action, bool shift);
void hg_viewer_ask(struct hg_viewer *v, const struct hg_view_request *request);
// Edits change the scene for all its viewers. False: the session's role may not, which was said.
bool hg_viewer_may_edit(struct hg_viewer *v);
// Size of the view = size of the window.
void hg_viewer_send_size(struct hg_viewer *v);
// What the options and the scene begin with.
void hg_viewer_begin_scene(struct hg_viewer *v);

// viewer_panel.c
void hg_viewer_switch_panel(struct hg_viewer *v, enum hg_viewer_panel panel); // shuts it when open
// Of another scene: nothing is selected, cut or measured.
void hg_viewer_reset_panels(struct hg_viewer *v);
// Keys and pointer of the open panel. True: they were for it.
bool hg_viewer_panel_key(struct hg_viewer *v, SDL_Scancode key, bool shift);
bool hg_viewer_panel_pointer(struct hg_viewer *v, const SDL_Event *event);
void hg_viewer_panel_box(const struct hg_viewer *v, struct hg_viewer_box *box);
void hg_viewer_draw_panel(struct hg_viewer *v);
void hg_viewer_type(struct hg_viewer *v, const char *text);
// Takes back what Esc ends first. False: there is nothing.
bool hg_viewer_escape(struct hg_viewer *v);

// viewer_tree.c: rows of the panel of nodes. x, y: character and row in it.
void hg_viewer_select(struct hg_viewer *v, uint64_t node); // 0 = nothing
void hg_viewer_take_nodes(struct hg_viewer *v);            // the session has listed them
void hg_viewer_note_visible(struct hg_viewer *v, const struct hg_view_answer *answer);
void hg_viewer_note_picked(struct hg_viewer *v, const struct hg_view_answer *answer);
void hg_viewer_refresh_tree(struct hg_viewer *v); // asks for nodes when they have changed
bool hg_viewer_tree_key(struct hg_viewer *v, SDL_Scancode key, const struct hg_viewer_box *box);
void hg_viewer_tree_click(struct hg_viewer *v, int x, int y, bool twice);
void hg_viewer_draw_tree(struct hg_viewer *v, const struct hg_viewer_box *box);
const char *hg_viewer_selected_name(const struct hg_viewer *v); // NULL: nothing, or not known yet

// viewer_clipping.c: rows of the panel of clipping planes
bool hg_viewer_clipping_key(struct hg_viewer *v, SDL_Scancode key, bool shift);
void hg_viewer_clipping_click(
    struct hg_viewer *v, const struct hg_viewer_box *box, const SDL_Point *at);
void hg_viewer_clipping_slide(struct hg_viewer *v, const struct hg_viewer_box *box, int x);
void hg_viewer_draw_cuts(struct hg_viewer *v, const struct hg_viewer_box *box);

// viewer_measure.c
void hg_viewer_switch_measure(struct hg_viewer *v);
// A click into the picture: selects, or is a place to measure from.
void hg_viewer_click(struct hg_viewer *v, int x, int y, enum hg_view_ask ask);
void hg_viewer_note_point(struct hg_viewer *v, const struct hg_view_answer *answer);
void hg_viewer_draw_measure(struct hg_viewer *v);

// viewer_text.c
void hg_viewer_draw_text(struct hg_viewer *v);
void hg_viewer_title(const struct hg_viewer *v, char *title, size_t size);

#endif
