// cli.h - what the commands of `helio` share: the connection, exit codes, progress, messages.
// Floor 6 (client). One thread. Only the files of client/cli print.
#ifndef HG_CLIENT_CLI_CLI_H
#define HG_CLIENT_CLI_CLI_H

#include <jansson.h>

#include "base/arena.h"
#include "client/cli/options.h"
#include "client/cli/progress.h"
#include "client/include/helio/helio.h"

enum hg_cli_exit {
    HG_CLI_EXIT_OK = 0,
    HG_CLI_EXIT_FAILED = 1,
    HG_CLI_EXIT_USAGE = 2,
    HG_CLI_EXIT_INPUT = 3,
    HG_CLI_EXIT_UNREACHABLE = 4,
    HG_CLI_EXIT_NOT_ALLOWED = 5,
    HG_CLI_EXIT_LIMIT = 6,
    HG_CLI_EXIT_RENDER = 7,
    HG_CLI_EXIT_STOPPED = 8,
    HG_CLI_EXIT_DEVICE = 9,
};

// What was being done when a status came back; decides between exit codes.
enum hg_cli_doing {
    HG_CLI_DOING_ARGUMENTS, // the user's words: 2
    HG_CLI_DOING_CONNECT,   // 4
    HG_CLI_DOING_INPUT,     // 3
    HG_CLI_DOING_RENDER,    // 7, or 9 where it is of no use to try again
    HG_CLI_DOING_OUTPUT,    // 7
};

enum {
    HG_CLI_IMAGE_BYTES = 256 * 1024 * 1024, // greatest image file of a comparison
    HG_CLI_VIEW = 1,                        // the view that a command begins with
};

struct hg_cli {
    const struct hg_cli_options *options;
    struct helio *h;
    bool embedded;
    const char *scene_name; // that is opened after hg_cli_connect, for load balancers; NULL = that
                            // of the options
    struct hgp_scene_opened scene;
    uint32_t view; // whose statistics are asked for
    struct hg_cli_progress progress;
    uint64_t begin_ns, connect_ns; // start of the program; how long connecting took
};

// Prints "helio: what: where: reason" (peer bytes made harmless) and returns the exit code.
enum hg_cli_exit hg_cli_report(
    struct hg_cli *cli, enum hg_cli_doing doing, const struct hg_error *err);
// A copy of `text` without control bytes, cut to fit.
void hg_cli_clean(char *dst, size_t size, const char *text, size_t length);

void hg_cli_init(struct hg_cli *cli, const struct hg_cli_options *options);
void hg_cli_disconnect(struct hg_cli *cli);
// The end of the command, which the JSON stream says.
void hg_cli_finish(struct hg_cli *cli, enum hg_cli_exit code);

// The folder of caches: `given`, or what the environment says. False: it names none.
bool hg_cli_cache_dir(const char *given, char *path, size_t size);

// Arguments that a private worker and helio-bench take alike: the folders of `files` (may be NULL;
// NULL entries and "demo:" are skipped) and the options' roots as --asset-root, caches, budgets,
// device, log levels. HG_E_INVAL names the option that is wrong. Freed with hg_cli_args_finish.
struct hg_cli_args {
    const char **items; // [count], then NULL; NULL when empty
    size_t count, capacity;
    struct hg_arena arena;
    char no_cache[512]; // why the worker has no cache folder; empty: it has one
};
enum hg_status hg_cli_args_make(struct hg_cli_args *args, const struct hg_cli_options *options,
    const struct hg_cli_texts *files, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_args_finish(struct hg_cli_args *args); // accepts a zeroed one

// Opens the session: to `url`, or (NULL) a private worker that may read the folders of `files`
// (NULL entries and "demo:" are skipped) and the options' roots. Opens a private scene as well
// when `with_scene`. On failure *err is filled and *doing says what failed.
enum hg_status hg_cli_connect(struct hg_cli *cli, const char *url, const struct hg_cli_texts *files,
    bool with_scene, struct hg_error *err) HG_MUST_CHECK;
// Takes over a connection that was made otherwise (cli->h): its handlers, and Ctrl-C.
void hg_cli_attach(struct hg_cli *cli);
// True once Ctrl-C (or SIGTERM) was seen.
bool hg_cli_is_stopped(void);

// Turns a path into what the server is asked for: absolute for a private worker (the file must
// exist), as given for a daemon. *out is freed with hg_free.
enum hg_status hg_cli_server_path(
    const struct hg_cli *cli, const char *path, char **out, struct hg_error *err) HG_MUST_CHECK;

// Turns the other side's error into *err (may be NULL), peer bytes made harmless.
enum hg_status hg_cli_error_of(const struct hgp_error *e, struct hg_error *err);

// After a frame that was refused because frames have taken the pixels of this second: waits until
// the daemon has more, and returns HG_OK. Else `refused`, the status of *err, or why waiting ended.
enum hg_status hg_cli_wait_for_pixels(
    struct hg_cli *cli, enum hg_status refused, struct hg_error *err) HG_MUST_CHECK;

// Errors of messages without an answer (view_camera), and other stray messages, are taken
// from the queue; the first error is returned.
enum hg_status hg_cli_drain_queue(struct hg_cli *cli, struct hg_error *err) HG_MUST_CHECK;

// With --strict: HG_E_FORMAT when there were warnings about the scene.
enum hg_status hg_cli_check_warnings(const struct hg_cli *cli, struct hg_error *err) HG_MUST_CHECK;

// output.c: names of outputs. "-" is the standard output; what is no regular file is a stream,
// which is written through (base/file.h).

// The path that a name stands for.
const char *hg_cli_output_path(const char *name);
bool hg_cli_is_stdout(const char *name);
bool hg_cli_is_stream(const char *name);
// Checks that the output can be made: its folder exists and is writable.
enum hg_status hg_cli_check_output(const char *name, struct hg_error *err) HG_MUST_CHECK;
// HG_E_INVAL: a folder has this name, and no output can take its place.
enum hg_status hg_cli_check_no_folder(const char *path, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_write_output(
    const char *name, const void *data, size_t size, struct hg_error *err) HG_MUST_CHECK;

// What a picture's name and the options (may be NULL) ask for: by the name's ending, by FORMAT:
// before it, or PNG on the standard output. HG_E_INVAL for unknown endings.
struct hg_cli_format {
    enum hgp_encoding encoding;
    uint8_t quality;
    const char *path; // without FORMAT:
};
enum hg_status hg_cli_format_of(const char *name, const struct hg_cli_options *options,
    struct hg_cli_format *out, struct hg_error *err) HG_MUST_CHECK;

// Camera by name or number among the scene's camera nodes. option: for messages. HG_E_NOTFOUND.
enum hg_status hg_cli_find_camera(struct hg_cli *cli, const char *option, const char *name,
    uint64_t *node, struct hg_error *err) HG_MUST_CHECK;
// Object "ASSET:INDEX", assets counted from 1; 0 when `name` is not of that form.
uint64_t hg_cli_parse_object(const struct hg_cli *cli, const char *name);
// A node by name (exact), or else "ASSET:INDEX". HG_E_NOTFOUND.
enum hg_status hg_cli_find_node(
    struct hg_cli *cli, const char *name, uint64_t *node, struct hg_error *err) HG_MUST_CHECK;
// Names of up_axis as options and scripts spell them: auto, +X, ... HG_E_INVAL names the option.
enum hg_status hg_cli_parse_up(
    const char *option, const char *text, enum hgp_up_axis *up, struct hg_error *err) HG_MUST_CHECK;
const char *hg_cli_up_name(enum hgp_up_axis up);
// A view's name or its angles AZIMUTH,ELEVATION in degrees. HG_E_INVAL names the option.
enum hg_status hg_cli_parse_view(const char *option, const char *text, struct hgp_view_fit *fit,
    struct hg_error *err) HG_MUST_CHECK;
// helio_send that waits while the connection is made again, or too much waits to be sent.
enum hg_status hg_cli_send(struct hg_cli *cli, enum hgp_type type, const void *message,
    uint32_t *request, struct hg_error *err) HG_MUST_CHECK;
// Sends a camera; errors about it come back with the next call.
enum hg_status hg_cli_send_camera(
    struct hg_cli *cli, const struct hgp_view_camera *camera, struct hg_error *err) HG_MUST_CHECK;

struct hg_cli_bytes {
    uint8_t *data;
    size_t size;
};

// Two image files and what the server's metric says about them.
struct hg_cli_comparison {
    enum hgp_metric metric;
    struct hg_cli_bytes a, b; // borrowed
    struct hg_cli_bytes mask; // borrowed; empty: all pixels count
    bool want_diff;
    double value;             // out
    struct hg_cli_bytes diff; // out: a PNG file, freed with hg_free; empty unless wanted
};
enum hg_status hg_cli_compare(
    struct hg_cli *cli, struct hg_cli_comparison *comparison, struct hg_error *err) HG_MUST_CHECK;

// Sends every file that an asset needs; *files is an array of *count, freed with hg_cli_files_free.
struct hg_cli_files {
    struct helio_file *items;
    uint32_t count;
};
enum hg_status hg_cli_files_of_asset(
    const char *path, struct hg_cli_files *out, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_files_free(struct hg_cli_files *files);

// Statistics of the view as the worker has them. New reference.
enum hg_status hg_cli_stats(struct hg_cli *cli, json_t **out, struct hg_error *err) HG_MUST_CHECK;
// The provenance of a frame as statistics hold it; `name`: its file. New reference; NULL: no
// memory.
json_t *hg_cli_frame_json(const struct hgp_frame *frame, const char *name, uint64_t total_ns);
// Adds to the worker's statistics what its `frame` lacks of the newest frame (may be NULL),
// `client`, and whether the camera was fitted, of which the worker sees no more than a camera.
// HG_E_NOMEM.
struct hg_cli_client_stats {
    uint64_t load_ns, first_frame_ns, uploaded_bytes;
    uint32_t skipped_frames;
    bool fitted;
};
enum hg_status hg_cli_stats_complete(json_t *stats, const struct hg_cli *cli, json_t *newest,
    const struct hg_cli_client_stats *own, struct hg_error *err) HG_MUST_CHECK;

// ---- commands for administrators of a daemon ----------------------------------------------------

// The end of a command: reports the error, if there is one.
enum hg_cli_exit hg_cli_end(
    struct hg_cli *cli, enum hg_cli_doing doing, enum hg_status status, const struct hg_error *err);
// A whole command: connects to the daemon, acts, ends.
enum hg_cli_exit hg_cli_at_daemon(const struct hg_cli_options *options,
    enum hg_status (*act)(struct hg_cli *cli, struct hg_error *err));
// The JSON that answers a query; *out is released with json_decref.
enum hg_status hg_cli_query(
    struct hg_cli *cli, enum hgp_type type, json_t **out, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_print_json(const json_t *value);
void hg_cli_print_table(json_t *list); // of objects, as columns named by the first one's keys
// Prints what sessions_query answers every --interval, a line each, until the connection ends.
enum hg_status hg_cli_follow_sessions(struct hg_cli *cli, struct hg_error *err) HG_MUST_CHECK;

// The commands.
enum hg_cli_exit hg_cli_render(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_info(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_compare_command(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_run(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_window(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_bake(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_cache(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_bench(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_serve(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_ping(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_stats_command(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_quarantine(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_sessions(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_message(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_kick(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_drain(const struct hg_cli_options *options);
enum hg_cli_exit hg_cli_tickets(const struct hg_cli_options *options);

#endif
