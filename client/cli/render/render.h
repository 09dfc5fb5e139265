// render.h - what the files of `helio render` share. Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_RENDER_RENDER_H
#define HG_CLIENT_CLI_RENDER_RENDER_H

#include "client/cli/animations.h"
#include "client/cli/cli.h"

// The frames of a series in their order; numbers is freed with hg_free.
struct hg_cli_frame_numbers {
    int32_t *numbers;
    uint32_t count;
};

// The scene's file.
struct hg_cli_loaded {
    uint32_t animations, lights;
    struct hg_cli_animations chosen; // of --animation
    enum hgp_up_axis up;
    char up_reason[136]; // why it is up; "" = not stated
};

// The camera, which goes around its target; frames 0: it stays.
struct hg_cli_turntable {
    bool fitted;     // to the whole scene
    uint32_t frames; // once around
    bool moves;      // frames say where the next one is: shutter and motion
    struct hgp_view_camera start;
    struct hgp_view_camera sent; // the newest one, and on which connection: a camera is not
    uint32_t connection;         // answered, so the next one may have lost it
};

// What is known of the light: whether a series has the exposure that its first picture metered; the
// first picture that is nearly all black or clipped, and how many there are.
struct hg_cli_light {
    bool metered;
    float ev; // that is, where it was metered
    uint32_t poor_frames;
    bool black;
    float share;
    char name[256];
};

// OUT.checkpoint of a picture that was stopped.
struct hg_cli_film_kept {
    bool is_left, failed; // failed: one could not be written
    uint32_t samples;     // fewer do not take its place
};

// What is known of the other side.
struct hg_cli_daemon {
    uint32_t losses;    // of the view, when the job of the current frame was asked for
    uint64_t closes_ns; // when it stops; 0: it said nothing
    bool has_said;      // just now
};

struct hg_cli_render {
    struct hg_cli cli;
    const struct hg_cli_options *o;
    struct hg_cli_format format;
    const char *output; // as --output names it, without its format
    bool streams;       // it is no regular file: nothing can be beside it or taken up
    struct hg_cli_size size;
    uint32_t planes; // bits of enum hgp_plane
    struct hg_cli_loaded loaded;
    enum hg_cli_doing doing;
    uint64_t load_ns, upload_bytes, first_frame_ns;
    float shutter[2];             // frames from the pose
    json_t *frames, *last;        // one object per frame written; the newest of them (borrowed)
    uint32_t skipped;             // files that were left as they were
    uint32_t next;                // index of the first frame that is not there yet
    struct hg_cli_film_kept film; // of the first frame that is not there yet
    struct hg_cli_daemon daemon;
    struct hg_cli_light light;
    struct hg_writer parts;           // of the frame that is waited for, as far as they have come
    struct hg_cli_frame_numbers list; // of --frames and --turntable; empty: one picture
    struct hg_cli_turntable turntable;
    struct hg_cli_series *series; // of pictures that depend on those before; NULL = of none
};

// Writes `pattern` with the frame's number: a run of #, or %d / %0Nd. False without a place for it.
bool hg_cli_frame_name(const char *pattern, int32_t frame, char *dst, size_t size);

// "depth,normal,direct", names of enum hgp_plane with - or _; `direct` and `indirect` stand for
// their three, `cryptomatte` for its three, `all` for every one that the mode has. HG_E_INVAL lists
// the names, or tells the one that path mode alone has.
enum hg_status hg_cli_parse_planes(const char *what, const char *text, bool path, uint32_t *out,
    struct hg_error *err) HG_MUST_CHECK;

// render.c: a scene and a view as options describe them; also for `helio view`.

// HG_E_INVAL names the option that is wrong.
enum hg_status hg_cli_render_check_scene(
    const struct hg_cli_options *o, struct hg_error *err) HG_MUST_CHECK;
// Opens the session, and with_scene a private scene. The private worker may read what the options
// name.
enum hg_status hg_cli_render_connect(
    struct hg_cli_render *r, bool with_scene, struct hg_error *err) HG_MUST_CHECK;
// Loads the scene's file, and sets the environment.
enum hg_status hg_cli_render_load(struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;
// Makes the view and sends its camera, which is r->turntable.start then.
enum hg_status hg_cli_render_set_view(struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;

// frame_losses.c: sends the view's camera, and keeps it.
enum hg_status hg_cli_frame_camera(struct hg_cli_render *r, const struct hgp_view_camera *camera,
    struct hg_error *err) HG_MUST_CHECK;

// view.c: view parameters from options; pure. r->format, size, planes and
// shutter are known.
void hg_cli_render_view(const struct hg_cli_render *r, struct hgp_view_set *view);
// HG_E_INVAL: an option of path mode without it.
enum hg_status hg_cli_check_mode(
    const struct hg_cli_options *o, struct hg_error *err) HG_MUST_CHECK;
// Time of the animations from the picture before to the one at `index` of the list.
float hg_cli_series_s(const struct hg_cli_render *r, uint32_t index);
bool hg_cli_is_path(const struct hg_cli_options *o);
double hg_cli_fps(const struct hg_cli_options *o); // frames per second
// Files for compositing, which hold radiance as it is: exposure 0 unless another one was chosen.
bool hg_cli_is_linear(enum hgp_encoding encoding);
// Whether the exposure is metered: the default, but for EXR files.
bool hg_cli_meters_exposure(const struct hg_cli_render *r);
void hg_cli_set_exposure(const struct hg_cli_exposure *exposure, struct hgp_view_set *view);
// --quality: values for what no option says. `line`: which, as a sentence; empty without it.
void hg_cli_apply_quality(struct hg_cli_options *o, char *line, size_t size);
// The region of a view as --region and `set region` have it.
void hg_cli_set_region(const struct hg_cli_region *region, struct hgp_view_set *view);
// The background of a view as --background and `set background` have it.
void hg_cli_set_background(const struct hg_cli_background *background, struct hgp_view_set *view);

// watch.c: --watch. Renders, and again whenever a file changes; Ctrl-C in between is the exit code
// 0.
enum hg_cli_exit hg_cli_watch(
    const struct hg_cli_options *o, enum hg_cli_exit (*render)(const struct hg_cli_options *));
enum hg_status hg_cli_check_watch(
    const struct hg_cli_options *o, struct hg_error *err) HG_MUST_CHECK;

// turntable.c: where the camera stands in a frame.
void hg_cli_turntable_camera(
    const struct hg_cli_turntable *turntable, int32_t frame, struct hgp_view_camera *out);

// frames.c: renders and writes the requested frames; the view and its camera are set.
enum hg_status hg_cli_render_frames(struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_render_stats(struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;
// frame_light.c. Warns of pictures that are nearly all black or clipped, with what may help.
void hg_cli_render_warn_of_light(struct hg_cli_render *r);
// Says that the sky fills in for a scene with lights.
void hg_cli_render_say_fill(struct hg_cli_render *r);
// Says what was written, and how long it took.
void hg_cli_render_summary(struct hg_cli_render *r);
// Says how a command that was stopped is taken up again.
void hg_cli_render_stopped(struct hg_cli_render *r);

// checkpoint.c: the file OUT.checkpoint, which holds a film and the hash of the job it belongs to.

// What is kept of a picture: its film, as OUT.checkpoint, or what comes after it needs, as
// OUT.history.
struct hg_cli_kept {
    struct hg_cli *cli;
    enum hgp_checkpoint_kind kind;
    const char *output;
    const uint8_t *job; // [32]
    uint32_t least;     // fewer samples are not written
    uint32_t total;     // of the whole picture; 0: of a history
};
// What a checkpoint says of itself.
struct hg_cli_checkpoint_head {
    enum hgp_checkpoint_kind kind;
    uint8_t job[32], hash[32]; // of the picture; of the data, `bytes` of them
    uint32_t samples, total;   // that it holds; of the whole picture
    uint64_t bytes;
};
// False: there is no such file, or it is no checkpoint.
bool hg_cli_checkpoint_look(
    enum hgp_checkpoint_kind kind, const char *output, struct hg_cli_checkpoint_head *out);
// Asks the worker for it and writes it; *samples: of it. HG_E_STATE: there is none yet, or it has
// fewer than `least`; nothing is written. `seconds`: how long to wait for an answer.
enum hg_status hg_cli_checkpoint_save(const struct hg_cli_kept *kept, double seconds,
    uint32_t *samples, struct hg_error *err) HG_MUST_CHECK;
// Gives the file's to the view. *samples: per pixel it holds, 0 when there is no file or it is of
// another job, cut short or damaged (said as a notice on the error stream).
enum hg_status hg_cli_checkpoint_load(
    const struct hg_cli_kept *kept, uint32_t *samples, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_checkpoint_remove(enum hgp_checkpoint_kind kind, const char *output);

#endif
