// frames.h - what the files of `helio render` that make frames share. Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_RENDER_FRAMES_H
#define HG_CLIENT_CLI_RENDER_FRAMES_H

#include "client/cli/render/render.h"

enum { HG_CLI_PATIENCE_S = 120 }; // for the film of a view that is stopped in the middle of a step

// Pictures that depend on those before. A picture's job holds that of the one before, so files that
// are there already are of this series or are made again. Pictures that are left as they are do not
// bring the view their history: it comes from OUT.history, or they are made once more.
struct hg_cli_series {
    uint32_t held;   // the view has the history of picture held - 1; 0: of none
    uint32_t losses; // of the view, when it got it
    bool kept;       // the history of picture held - 1 is in its file
    uint8_t job[][32];
};

// frame_stats.c: adds a frame to r->frames.
enum hg_status hg_cli_frame_note(struct hg_cli_render *r, const struct hgp_frame *frame,
    const char *name, uint64_t total_ns, struct hg_error *err) HG_MUST_CHECK;

// frame_light.c: notes a picture that is nearly all black or clipped.
void hg_cli_frame_note_light(
    struct hg_cli_render *r, const struct hgp_frame *frame, const char *name);

// frame_losses.c. Number of the connection; requests and cameras of an earlier one may be lost.
uint32_t hg_cli_frame_connection(const struct hg_cli_render *r);
// How often the view lost what its worker held of it, films and history: the worker was replaced,
// or the session went on on another connection, and its views were closed meanwhile.
uint32_t hg_cli_frame_losses(const struct hg_cli_render *r);
// Sends the camera again if the connection has been made again since.
enum hg_status hg_cli_frame_keep_camera(
    struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;

// frame_existing.c. The job of the frame that the view would give; zeros where nothing asks for it.
// after: job of the picture that this one depends on, or NULL.
enum hg_status hg_cli_frame_ask_job(struct hg_cli_render *r, const uint8_t *after, uint8_t job[32],
    struct hg_error *err) HG_MUST_CHECK;
// Does `name` hold what this command would write? The worker decodes all of it.
enum hg_status hg_cli_frame_check_existing(struct hg_cli_render *r, const char *name,
    const uint8_t job[32], bool *good, struct hg_error *err) HG_MUST_CHECK;

// frame_wait.c: the settled frame, whose film is written to OUT.checkpoint in intervals.
enum hg_status hg_cli_frame_wait(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    struct helio_message **frame, struct hg_error *err) HG_MUST_CHECK;
// What a command that is stopped leaves of the frame it was at.
void hg_cli_frame_leave_checkpoint(
    struct hg_cli_render *r, const char *name, const uint8_t job[32]);
// Gives the view the film in OUT.checkpoint, where one is to be taken up.
enum hg_status hg_cli_frame_resume(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    struct hg_error *err) HG_MUST_CHECK;

// frames.c: frames of --frames by their place from 0.
int32_t hg_cli_frame_at(const struct hg_cli_render *r, uint32_t index); // its number
uint32_t hg_cli_frame_count(const struct hg_cli_render *r);
void hg_cli_frame_file(const struct hg_cli_render *r, int32_t frame, char *dst, size_t size);
// No frame's file is a folder: what no repetition changes is said before the first frame.
enum hg_status hg_cli_frame_check_files(
    const struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;
// Poses the animations at this time.
enum hg_status hg_cli_frame_set_time(
    struct hg_cli_render *r, double time_s, struct hg_error *err) HG_MUST_CHECK;
// Poses the scene, seeds the view and turns its camera.
enum hg_status hg_cli_frame_go_to(
    struct hg_cli_render *r, uint32_t index, struct hg_error *err) HG_MUST_CHECK;
// *there: --skip-existing leaves the file alone.
enum hg_status hg_cli_frame_check(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    bool *there, struct hg_error *err) HG_MUST_CHECK;
// The frame at that place of the list: its pose, and its file if it is not there.
enum hg_status hg_cli_frame_render(
    struct hg_cli_render *r, uint32_t index, struct hg_error *err) HG_MUST_CHECK;
// frame_claims.c: all frames, with other commands that do the same (--claim).
enum hg_status hg_cli_frames_share(struct hg_cli_render *r, struct hg_error *err) HG_MUST_CHECK;
// Renders a frame and, if it is wanted, writes it. *again: the picture was made without the history
// that it needs, and has no owner.
enum hg_status hg_cli_frame_make(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    bool wanted, bool *again, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_frame_drop_film(struct hg_cli_render *r, const char *name);

// frame_series.c: pictures that depend on those before.
bool hg_cli_is_series(const struct hg_cli_render *r);
// The view has lost its history.
bool hg_cli_series_is_lost(const struct hg_cli_render *r);
enum hg_status hg_cli_series_render_frame(
    struct hg_cli_render *r, uint32_t index, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_series_drop_history(const struct hg_cli_render *r, uint32_t index);

#endif
