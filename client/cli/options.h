// options.h - the command line of `helio`, parsed by the table options.def.
// Floor 6 (client). Texts point into argv.
#ifndef HG_CLIENT_CLI_OPTIONS_H
#define HG_CLIENT_CLI_OPTIONS_H

#include "base/status.h"
#include "client/cli/render/frame_list.h"
#include "protocol/view_params.h"

enum {
    HG_CLI_TEXTS_MAX = 64,
    HG_CLI_ARGS_MAX = 64,
};

enum hg_cli_command_index {
#define HG_CLI_COMMAND(symbol, ...) HG_CLI_INDEX_##symbol,
#include "client/cli/options.def"
    HG_CLI_COMMAND_COUNT
};

enum hg_cli_command {
#define HG_CLI_COMMAND(symbol, ...) HG_CLI_##symbol = 1 << HG_CLI_INDEX_##symbol,
#include "client/cli/options.def"
};

// Headings of the help of commands with many options.
enum hg_cli_group {
#define HG_CLI_GROUP(symbol, title) HG_CLI_GROUP_##symbol,
#include "client/cli/options.def"
    HG_CLI_GROUP_COUNT
};

enum hg_cli_kind {
    HG_CLI_KIND_FLAG,
    HG_CLI_KIND_TEXT,
    HG_CLI_KIND_FILE,
    HG_CLI_KIND_TEXTS,
    HG_CLI_KIND_FOLDER, // repeated
    HG_CLI_KIND_U32,
    HG_CLI_KIND_F64,
    HG_CLI_KIND_SIZE,
    HG_CLI_KIND_VEC3,
    HG_CLI_KIND_REGION,
    HG_CLI_KIND_CHOICE,
    HG_CLI_KIND_FRAMES,
    HG_CLI_KIND_BACKGROUND,
    HG_CLI_KIND_SUN,
    HG_CLI_KIND_EXPOSURE,
};

struct hg_cli_texts {
    const char *items[HG_CLI_TEXTS_MAX];
    uint32_t count;
};

struct hg_cli_size {
    uint32_t width, height;
};

struct hg_cli_vec3 {
    double v[3];
};

struct hg_cli_background {
    enum {
        HG_CLI_BACKGROUND_ENV,
        HG_CLI_BACKGROUND_NONE,
        HG_CLI_BACKGROUND_COLOR,
        HG_CLI_BACKGROUND_BLUR,
        HG_CLI_BACKGROUND_DISPLAY,
    } kind;
    double color[3]; // linear
};

struct hg_cli_sun {
    bool off;
    double azimuth, elevation; // degrees
    double turbidity;          // 0: not given
};

struct hg_cli_exposure {
    bool automatic, camera;
    double ev; // stops; of the others what is added to the metered one, or the camera's
};

struct hg_cli_region {
    uint32_t x, y, width, height; // px
};

#define HG_CLI_TYPE_FLAG       bool
#define HG_CLI_TYPE_TEXT       const char *
#define HG_CLI_TYPE_FILE       const char *
#define HG_CLI_TYPE_TEXTS      struct hg_cli_texts
#define HG_CLI_TYPE_FOLDER     struct hg_cli_texts
#define HG_CLI_TYPE_U32        uint32_t
#define HG_CLI_TYPE_F64        double
#define HG_CLI_TYPE_SIZE       struct hg_cli_size
#define HG_CLI_TYPE_VEC3       struct hg_cli_vec3
#define HG_CLI_TYPE_REGION     struct hg_cli_region
#define HG_CLI_TYPE_CHOICE     const char *
#define HG_CLI_TYPE_FRAMES     struct hg_frame_ranges
#define HG_CLI_TYPE_BACKGROUND struct hg_cli_background
#define HG_CLI_TYPE_SUN        struct hg_cli_sun
#define HG_CLI_TYPE_EXPOSURE   struct hg_cli_exposure

// Every option's value, and whether it was given.
struct hg_cli_options {
    enum hg_cli_command command;
    const char *program;     // "helio"
    const char *const *argv; // the whole command line
    const char *args[HG_CLI_ARGS_MAX];
    uint32_t arg_count;
    bool help;
#define HG_CLI_OPTION(field, name, letter, kind, ...)                                              \
    HG_CLI_TYPE_##kind field;                                                                      \
    bool has_##field;
#define HG_CLI_VIEW_OPTION(field, param, name, kind, ...)                                          \
    HG_CLI_TYPE_##kind field;                                                                      \
    bool has_##field;
#include "client/cli/options.def"
};

struct hg_cli_command_row {
    enum hg_cli_command command;
    const char *name, *arguments;
    uint32_t least, most;
    const char *summary, *description;
};

// A row of commands 0 is no option: the group of those behind it begins, under its name.
struct hg_cli_option_row {
    const char *name;
    char letter; // 0 = none
    enum hg_cli_kind kind;
    const char *argument;
    uint32_t commands; // bits
    double low, high;
    const char *choices, *text;
    size_t value_offset, has_offset;
    const struct hgp_view_param *param; // that it sets; NULL: none, or more than one
};

extern const struct hg_cli_command_row hg_cli_commands[HG_CLI_COMMAND_COUNT];
extern const struct hg_cli_option_row hg_cli_option_rows[];
extern const uint32_t hg_cli_option_count;

extern const char *const hg_cli_group_titles[HG_CLI_GROUP_COUNT];
// The group of the option hg_cli_option_rows[index].
enum hg_cli_group hg_cli_option_group(uint32_t index);

// Choices and explanation of an option, wherever they come from.
enum { HG_CLI_CHOICES_BYTES = 128, HG_CLI_OPTION_TEXT_BYTES = 512 };
void hg_cli_option_choices(const struct hg_cli_option_row *row, char dst[HG_CLI_CHOICES_BYTES]);
void hg_cli_option_text(const struct hg_cli_option_row *row, char dst[HG_CLI_OPTION_TEXT_BYTES]);

// Parses argv (with the command at argv[1]). HG_E_INVAL: err->what names the option or argument.
// --help anywhere sets `help` and forgives missing arguments.
enum hg_status hg_cli_parse(int argc, const char *const *argv, struct hg_cli_options *out,
    struct hg_error *err) HG_MUST_CHECK;

// One value as options of that kind take it; also used by scripts. `what` names it in messages.
enum hg_status hg_cli_parse_number(const char *what, const char *text, double low, double high,
    double *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_parse_u32(const char *what, const char *text, uint32_t low, uint32_t high,
    uint32_t *out, struct hg_error *err) HG_MUST_CHECK;
// `count` numbers separated by commas.
enum hg_status hg_cli_parse_numbers(const char *what, const char *text, uint32_t count, double *out,
    struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_parse_size(const char *what, const char *text, struct hg_cli_size *out,
    struct hg_error *err) HG_MUST_CHECK;
// "X,Y,WIDTH,HEIGHT", the last two not 0.
enum hg_status hg_cli_parse_region(const char *what, const char *text, struct hg_cli_region *out,
    struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_parse_background(const char *what, const char *text,
    struct hg_cli_background *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_cli_parse_exposure(const char *what, const char *text,
    struct hg_cli_exposure *out, struct hg_error *err) HG_MUST_CHECK;
// "1.5" or "0.02m": the point size of an asset. HG_E_INVAL.
enum hg_status hg_cli_parse_point_size(const char *what, const char *text,
    struct hgp_asset_load *out, struct hg_error *err) HG_MUST_CHECK;

#endif
