// run.h - what the files of helio run share: the session that a script drives. Private to run*.c.
// Floor 6 (client). One thread.
#ifndef HG_CLIENT_CLI_RUN_RUN_H
#define HG_CLIENT_CLI_RUN_RUN_H

#include "client/cli/cli.h"
#include "client/cli/run/recording.h"
#include "client/cli/run/report.h"
#include "client/cli/run/script.h"

enum { HG_CLI_RUN_ASSETS_MAX = 256 };

// A view of the scene.
struct hg_cli_run_view {
    bool is_open;
    bool has_camera, fitted; // the script chose one, or was given one; it shows the whole scene
    bool has_exposure, is_linear; // the script chose one; the view has that of EXR files
    bool dirty;                   // it or the scene changed since `frame` was rendered
    struct helio_message *frame;  // newest one, or NULL
    uint64_t frame_ns;            // how long it took
};

// State of the scene that a script has open; reset by `connect` and `scene`.
struct hg_cli_run_scene {
    uint32_t assets[HG_CLI_RUN_ASSETS_MAX], asset_count; // loaded, as sent
    bool is_open, is_joined;                             // joined: other sessions made it
    struct hg_cli_run_view views[HG_CLI_VIEWS_MAX];
};

struct hg_cli_run {
    struct hg_cli cli;
    const struct hg_cli_options *o;
    struct hg_cli_report *report;
    struct hg_cli_recorder *recorder; // borrowed; NULL: nothing is recorded
    const struct hg_cli_script *script;
    struct hg_cli_texts files; // read by a private worker
    enum hg_cli_doing doing;
    uint64_t load_ns, first_frame_ns;
    struct hg_cli_run_scene scene;
};

// The view that the lines are about, cli.view.
static inline struct hg_cli_run_view *hg_cli_run_now(struct hg_cli_run *r)
{
    return &r->scene.views[r->cli.view - 1];
}
// The scene has changed: no view's frame shows it.
void hg_cli_run_changed(struct hg_cli_run *r);
// Goes to another view, which is opened when it is not there, or closes it and goes to the first.
enum hg_status hg_cli_run_switch(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;

// run_session.c: the connection and scene that the next step needs; they may be open already.
// `scene`: the name of the one that it is for, NULL = a private one.
enum hg_status hg_cli_run_connect(
    struct hg_cli_run *r, const char *url, const char *scene, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_run_need_scene(struct hg_cli_run *r, struct hg_error *err) HG_MUST_CHECK;
// Leaves the scene and joins (or makes) the one of that name. HG_E_NOTFOUND: there is none, and the
// session may not make it.
enum hg_status hg_cli_run_join(
    struct hg_cli_run *r, const char *name, struct hg_error *err) HG_MUST_CHECK;
// Frees what belongs to the scene; the session does not use it any more.
void hg_cli_run_forget(struct hg_cli_run *r);

// run_edit.c: steps that change the scene or the view.
enum hg_status hg_cli_run_edit(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
// run_look.c: planes, overrides and variants of the view; pixels of a node in a rectangle, and the
// distance of the surfaces at two pixels.
enum hg_status hg_cli_run_look(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_run_seen(struct hg_cli_run *r, const struct hg_cli_step *s, uint32_t *pixels,
    struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_run_distance(struct hg_cli_run *r, const struct hg_cli_step *s, bool *hit,
    double *distance, struct hg_error *err) HG_MUST_CHECK;
// A camera when none was chosen, as helio render has it; it stays while the scene changes.
enum hg_status hg_cli_run_complete(struct hg_cli_run *r, struct hg_error *err) HG_MUST_CHECK;

// run_frame.c: renders, and writes the file that the step names, if any.
enum hg_status hg_cli_run_frame(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
// Renders scene.frame; now: the next frame, settled or not.
enum hg_status hg_cli_run_take(struct hg_cli_run *r, const struct hg_cli_format *format, bool now,
    struct hg_error *err) HG_MUST_CHECK;
extern const struct hg_cli_format hg_cli_run_png;

// run_replay.c: helio run --replay.
enum hg_cli_exit hg_cli_run_replay(const struct hg_cli_options *options);

// run_expect.c: an expectation that does not hold is reported and the script goes on; HG_OK unless
// the connection is lost.
enum hg_status hg_cli_run_expect(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
bool hg_cli_run_is_expectation(const struct hg_cli_step *s);

#endif
