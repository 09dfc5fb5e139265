// script.h - the language of helio run: text to steps. Pure; the words live in the script's arena.
// Floor 6 (client). The language is described in docs/client.md.
#ifndef HG_CLIENT_CLI_RUN_SCRIPT_H
#define HG_CLIENT_CLI_RUN_SCRIPT_H

#include "base/arena.h"
#include "client/cli/options.h"
#include "protocol/hgp.h"

enum { HG_CLI_VIEWS_MAX = 16 }; // of a script's scene, counted from 1

enum hg_cli_step_kind {
    HG_CLI_STEP_CONNECT, // path = url or NULL
    HG_CLI_STEP_SCENE,   // name
    HG_CLI_STEP_SWITCH,  // x = number of the view that the lines behind are about; now: close it
    HG_CLI_STEP_LOAD,    // path, asset (0 = next), name (size of points, or NULL)
    HG_CLI_STEP_VIEW,    // view
    HG_CLI_STEP_ENVIRONMENT,     // environment, path (FILE)
    HG_CLI_STEP_VARIANT,         // name, asset
    HG_CLI_STEP_NODE,            // name, node
    HG_CLI_STEP_MATERIAL,        // name, material
    HG_CLI_STEP_LIGHT,           // name, light, path (of a profile, "none", or NULL)
    HG_CLI_STEP_CLIP,            // clip
    HG_CLI_STEP_OVERRIDE,        // name (NULL = all go), override
    HG_CLI_STEP_VIEW_VARIANT,    // name, asset
    HG_CLI_STEP_CAMERA,          // camera
    HG_CLI_STEP_CAMERA_NODE,     // name
    HG_CLI_STEP_CAMERA_FIT,      // number = vertical field of view in degrees
    HG_CLI_STEP_TIME,            // number, name (NULL = all), asset (0 = all loaded)
    HG_CLI_STEP_FRAME,           // path (may be NULL), now
    HG_CLI_STEP_EXPECT_IMAGE,    // metric, path, op, number, mask (may be NULL)
    HG_CLI_STEP_EXPECT_STAT,     // name, op, value, number
    HG_CLI_STEP_EXPECT_PICK,     // x, y, name (NULL = nothing)
    HG_CLI_STEP_EXPECT_SEEN,     // x, y, width, height, name, op, number
    HG_CLI_STEP_EXPECT_DISTANCE, // x, y, width, height (of the second pixel), op, number
    HG_CLI_STEP_EXPECT_HASH,     // name = 64 hexadecimal digits
};

enum hg_cli_op {
    HG_CLI_OP_GE,
    HG_CLI_OP_LE,
    HG_CLI_OP_GT,
    HG_CLI_OP_LT,
    HG_CLI_OP_EQ,
    HG_CLI_OP_NE
};

struct hg_cli_step {
    enum hg_cli_step_kind kind;
    const char *file; // the script, or one that it includes
    uint32_t line;    // from 1
    const char *text; // the line as written, trimmed
    const char *path, *name, *mask;
    const char *value; // the word that is compared
    uint32_t asset, x, y, width, height;
    double number; // true and false are 1 and 0; NAN: the value is no number
    enum hg_cli_op op;
    enum hgp_metric metric;
    bool now;            // frame: do not wait until it is settled; view: close it
    enum hgp_up_axis up; // load
    union {
        struct hgp_view_set view;
        struct hgp_environment_set environment;
        struct hgp_node_set node;
        struct hgp_material_set material;
        struct hgp_light_set light;
        struct hgp_view_clip clip; // planes in the script's arena
        struct hgp_node_override override;
        struct {
            struct hgp_view_camera camera;
            struct hgp_view_fit fit; // kind CAMERA_FIT
        };
    };
};

struct hg_cli_script {
    struct hg_arena arena;
    struct hg_cli_step *steps; // heap
    size_t count, capacity;
};

// Value of ${name} in a line of `file`; NULL when it is not defined. Lives until the next call.
typedef const char *hg_cli_variable_fn(
    void *user, const char *file, const char *name, size_t length);
// Text of a script that is included, terminated; freed with hg_free.
typedef enum hg_status hg_cli_include_fn(
    void *user, const char *path, char **text, struct hg_error *err);

// Where a script takes from what is not in its text.
struct hg_cli_script_source {
    hg_cli_variable_fn *variable;
    hg_cli_include_fn *include; // NULL: nothing can be included
    void *user;
};

// Parses a whole script (terminated text) with what it includes. HG_E_INVAL: err->what =
// "FILE:LINE", err->reason; what reading an included file gives. *out is freed with
// hg_cli_script_finish.
enum hg_status hg_cli_script_parse(const char *file, const char *text,
    const struct hg_cli_script_source *source, struct hg_cli_script *out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_cli_script_finish(struct hg_cli_script *script);

bool hg_cli_op_holds(enum hg_cli_op op, double seen, double wanted);

#endif
