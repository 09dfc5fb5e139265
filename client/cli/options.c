#include "client/cli/options.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "client/cli/suggest.h"

const struct hg_cli_command_row hg_cli_commands[HG_CLI_COMMAND_COUNT] = {
#define HG_CLI_COMMAND(symbol, name, arguments, least, most, summary, description)                 \
    {HG_CLI_##symbol, name, arguments, least, most, summary, description},
#include "client/cli/options.def"
};

const struct hg_cli_option_row hg_cli_option_rows[] = {
#define HG_CLI_GROUP(symbol, title) {.name = title},
#define HG_CLI_OPTION(field, name, letter, kind, argument, commands, low, high, choices, text)     \
    {name, letter, HG_CLI_KIND_##kind, argument, commands, low, high, choices, text,               \
        offsetof(struct hg_cli_options, field), offsetof(struct hg_cli_options, has_##field),      \
        NULL},
#define HG_CLI_VIEW_OPTION(field, param, name, kind, argument, low, text)                          \
    {name, 0, HG_CLI_KIND_##kind, argument, HG_CLI_RENDER | HG_CLI_WINDOW, low, 0, NULL, text,     \
        offsetof(struct hg_cli_options, field), offsetof(struct hg_cli_options, has_##field),      \
        &hgp_view_params[HGP_VIEW_##param]},
#include "client/cli/options.def"
};

const char *const hg_cli_group_titles[HG_CLI_GROUP_COUNT] = {
#define HG_CLI_GROUP(symbol, title) title,
#include "client/cli/options.def"
};

const uint32_t hg_cli_option_count = sizeof hg_cli_option_rows / sizeof *hg_cli_option_rows;

enum hg_cli_group hg_cli_option_group(uint32_t index)
{
    const struct hg_cli_option_row *row = &hg_cli_option_rows[index];
    if (row->param && row->param->path_only)
        return HG_CLI_GROUP_PATH;
    uint32_t group = 0;
    for (uint32_t i = 0; i <= index; i++)
        group += hg_cli_option_rows[i].commands == 0;
    return (enum hg_cli_group)(group - 1);
}

void hg_cli_option_choices(const struct hg_cli_option_row *row, char dst[HG_CLI_CHOICES_BYTES])
{
    const bool derived = row->param && row->kind == HG_CLI_KIND_CHOICE;
    size_t used = 0;
    snprintf(dst, HG_CLI_CHOICES_BYTES, "%s", row->choices ? row->choices : "");
    for (uint32_t i = 0; derived && i <= (uint32_t)row->param->most; i++) {
        char word[HGP_WORD_BYTES];
        hgp_enum_word(row->param->values, i, word);
        const int n = snprintf(dst + used, HG_CLI_CHOICES_BYTES - used, "%s%s", i ? "|" : "", word);
        used += (size_t)n;
        if (used >= HG_CLI_CHOICES_BYTES)
            return;
    }
}

void hg_cli_option_text(const struct hg_cli_option_row *row, char dst[HG_CLI_OPTION_TEXT_BYTES])
{
    char text[HGP_VIEW_TEXT_BYTES] = "";
    if (row->param && !row->text)
        hgp_view_param_text(row->param, true, text);
    snprintf(dst, HG_CLI_OPTION_TEXT_BYTES, "%s", row->text ? row->text : text);
    if (row->kind == HG_CLI_KIND_SIZE)
        snprintf(dst, HG_CLI_OPTION_TEXT_BYTES, "%s; default %dx%d", row->text,
            (int)HGP_STANDARD_width, (int)HGP_STANDARD_height);
}

enum hg_status hg_cli_parse_number(
    const char *what, const char *text, double low, double high, double *out, struct hg_error *err)
{
    char *end;
    *out = 0;
    errno = 0;
    double v = strtod(text, &end);
    if (end == text || *end || !isfinite(v) || strpbrk(text, "xXpP \t\n"))
        return hg_error_set(err, HG_E_INVAL, what, NULL, "'%s' is not a number", text);
    if (v < low || v > high)
        return hg_error_set(err, HG_E_INVAL, what, NULL, "%s is outside %g to %g", text, low, high);
    *out = v;
    return HG_OK;
}

enum hg_status hg_cli_parse_u32(const char *what, const char *text, uint32_t low, uint32_t high,
    uint32_t *out, struct hg_error *err)
{
    *out = 0;
    size_t length = strlen(text);
    if (!length || length > 10 || strspn(text, "0123456789") != length)
        return hg_error_set(err, HG_E_INVAL, what, NULL, "'%s' is not a whole number", text);
    unsigned long long v = strtoull(text, NULL, 10);
    if (v < low || v > high)
        return hg_error_set(err, HG_E_INVAL, what, NULL, "%s is outside %u to %u", text, low, high);
    *out = (uint32_t)v;
    return HG_OK;
}

enum hg_status hg_cli_parse_numbers(
    const char *what, const char *text, uint32_t count, double *out, struct hg_error *err)
{
    const char *at = text;
    memset(out, 0, count * sizeof *out);
    for (uint32_t i = 0; i < count; i++) {
        char part[64];
        size_t length = strcspn(at, ",");
        bool last = i + 1 == count;
        if (!length || length >= sizeof part || (at[length] == ',') == last) {
            memset(out, 0, count * sizeof *out);
            return hg_error_set(err, HG_E_INVAL, what, NULL,
                "'%s' is not %u numbers separated by commas", text, count);
        }
        snprintf(part, sizeof part, "%.*s", (int)length, at);
        enum hg_status status = hg_cli_parse_number(what, part, -1e30, 1e30, &out[i], err);
        if (status)
            return status;
        at += length + !last;
    }
    return HG_OK;
}

enum hg_status hg_cli_parse_size(
    const char *what, const char *text, struct hg_cli_size *out, struct hg_error *err)
{
    char width[16];
    const char *x = strchr(text, 'x');
    *out = (struct hg_cli_size){0};
    if (!x || x == text || (size_t)(x - text) >= sizeof width)
        return hg_error_set(
            err, HG_E_INVAL, what, NULL, "'%s' is not a size such as 1920x1080", text);
    snprintf(width, sizeof width, "%.*s", (int)(x - text), text);
    struct hg_cli_size size;
    const uint32_t least = (uint32_t)hgp_view_params[HGP_VIEW_width].least;
    const uint32_t most = (uint32_t)hgp_view_params[HGP_VIEW_width].most;
    enum hg_status status = hg_cli_parse_u32(what, width, least, most, &size.width, err);
    if (status)
        return status;
    status = hg_cli_parse_u32(what, x + 1, least, most, &size.height, err);
    if (status)
        return status;
    *out = size;
    return HG_OK;
}

// #rgb, #rrggbb or a name, as a linear colour.
static bool parse_display_color(const char *text, double out[3])
{
    static const char *const names[][2] = {// the basic colours of CSS
        {"white", "#ffffff"}, {"silver", "#c0c0c0"}, {"grey", "#808080"}, {"gray", "#808080"},
        {"black", "#000000"}, {"red", "#ff0000"}, {"maroon", "#800000"}, {"yellow", "#ffff00"},
        {"olive", "#808000"}, {"lime", "#00ff00"}, {"green", "#008000"}, {"aqua", "#00ffff"},
        {"teal", "#008080"}, {"blue", "#0000ff"}, {"navy", "#000080"}, {"fuchsia", "#ff00ff"},
        {"purple", "#800080"}};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcasecmp(text, names[i][0]) == 0)
            text = names[i][1];
    const size_t digits = *text == '#' ? strspn(text + 1, "0123456789abcdefABCDEF") : 0;
    if ((digits != 3 && digits != 6) || text[1 + digits])
        return false;
    const unsigned long bits = strtoul(text + 1, NULL, 16);
    for (int i = 0; i < 3; i++) {
        const unsigned long level =
            digits == 6 ? bits >> (16 - 8 * i) & 255 : (bits >> (8 - 4 * i) & 15) * 17;
        const double c = (double)level / 255; // IEC 61966-2-1
        out[i] = c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
    }
    return true;
}

enum hg_status hg_cli_parse_region(
    const char *what, const char *text, struct hg_cli_region *out, struct hg_error *err)
{
    double v[4];
    struct hg_error inner;
    *out = (struct hg_cli_region){0};
    enum hg_status status = hg_cli_parse_numbers(what, text, 4, v, &inner);
    for (int i = 0; !status && i < 4; i++)
        if (v[i] < (i < 2 ? 0 : 1) || v[i] > 16384 || v[i] != floor(v[i]))
            status = HG_E_INVAL;
    if (status)
        return hg_error_set(err, HG_E_INVAL, what, NULL,
            "'%s' is not X,Y,WIDTH,HEIGHT in pixels from the top left corner", text);
    *out = (struct hg_cli_region){(uint32_t)v[0], (uint32_t)v[1], (uint32_t)v[2], (uint32_t)v[3]};
    return HG_OK;
}

enum hg_status hg_cli_parse_background(
    const char *what, const char *text, struct hg_cli_background *out, struct hg_error *err)
{
    static const struct {
        const char *word;
        int kind;
    } words[] = {{"env", HG_CLI_BACKGROUND_ENV}, {"none", HG_CLI_BACKGROUND_NONE},
        {"blur", HG_CLI_BACKGROUND_BLUR}};
    struct hg_error inner;
    *out = (struct hg_cli_background){0};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(text, words[i].word) == 0) {
            out->kind = words[i].kind;
            return HG_OK;
        }
    out->kind = HG_CLI_BACKGROUND_DISPLAY;
    if (parse_display_color(text, out->color))
        return HG_OK;
    out->kind = HG_CLI_BACKGROUND_COLOR;
    enum hg_status status = hg_cli_parse_numbers(what, text, 3, out->color, &inner);
    for (int i = 0; !status && i < 3; i++)
        status = out->color[i] < 0 ? HG_E_INVAL : HG_OK;
    if (!status)
        return HG_OK;
    *out = (struct hg_cli_background){0};
    return hg_error_set(err, HG_E_INVAL, what, NULL,
        "'%s' is not env, none, blur, #rrggbb, a basic colour of CSS such as white or teal, or "
        "three linear components R,G,B",
        text);
}

static enum hg_status parse_sun(
    const char *what, const char *text, struct hg_cli_sun *out, struct hg_error *err)
{
    double v[3] = {0};
    uint32_t count = 2;
    struct hg_error inner;
    *out = (struct hg_cli_sun){.off = strcmp(text, "off") == 0};
    if (out->off)
        return HG_OK;
    const char *comma = strchr(text, ',');
    if (comma && strchr(comma + 1, ','))
        count = 3;
    enum hg_status status = hg_cli_parse_numbers(what, text, count, v, &inner);
    if (status)
        return hg_error_set(err, HG_E_INVAL, what, NULL,
            "'%s' is not off, AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,TURBIDITY", text);
    if (fabs(v[0]) > 36000 || fabs(v[1]) > 90 || (count == 3 && (v[2] < 1 || v[2] > 10)))
        return hg_error_set(err, HG_E_INVAL, what, NULL,
            "'%s': elevation is -90 to 90 degrees, turbidity 1 to 10", text);
    *out = (struct hg_cli_sun){.azimuth = v[0], .elevation = v[1], .turbidity = v[2]};
    return HG_OK;
}

enum hg_status hg_cli_parse_exposure(
    const char *what, const char *text, struct hg_cli_exposure *out, struct hg_error *err)
{
    const double least = hgp_view_params[HGP_VIEW_exposure_ev].least;
    const double most = hgp_view_params[HGP_VIEW_exposure_ev].most;
    const bool automatic = strncmp(text, "auto", 4) == 0, camera = strncmp(text, "camera", 6) == 0;
    const char *number = text + (automatic ? 4 : camera ? 6 : 0);
    struct hg_error inner = {0};
    double ev = 0;
    *out = (struct hg_cli_exposure){.automatic = automatic, .camera = camera};
    if (number > text && !*number)
        return HG_OK;
    enum hg_status status = number > text && !strchr("+-", *number) ? HG_E_INVAL : HG_OK;
    if (!status)
        status = hg_cli_parse_number(what, number, least, most, &ev, &inner);
    out->ev = status ? 0 : ev;
    if (!status)
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, what, NULL,
        "'%s' is not a number of stops from %g to %g, auto, camera, or one of these and such a "
        "number "
        "as in auto+1",
        text, least, most);
}

enum hg_status hg_cli_parse_point_size(
    const char *what, const char *text, struct hgp_asset_load *out, struct hg_error *err)
{
    char number[64];
    double value;
    const size_t length = strlen(text);
    const bool metres = length > 0 && text[length - 1] == 'm';
    if (length >= sizeof number)
        return hg_error_set(err, HG_E_INVAL, what, NULL, "'%s' is not a number", text);
    snprintf(number, sizeof number, "%.*s", (int)(length - metres), text);
    enum hg_status status =
        hg_cli_parse_number(what, number, metres ? 1e-9 : 0.001, metres ? 1e9 : 1000, &value, err);
    if (status)
        return status;
    out->has_point_scale = !metres;
    out->has_point_diameter = metres;
    *(metres ? &out->point_diameter : &out->point_scale) = (float)value;
    return HG_OK;
}

static enum hg_status parse_choice(
    const char *what, const char *choices, const char *text, const char **out, struct hg_error *err)
{
    size_t length = strlen(text);
    for (const char *at = choices; length;) {
        size_t n = strcspn(at, "|");
        const bool unsigned_axis = // "z" is "+Z"
            *at == '+' && n == length + 1 && strncasecmp(at + 1, text, length) == 0;
        if ((n == length && memcmp(at, text, n) == 0) || unsigned_axis) {
            *out = text;
            return HG_OK;
        }
        if (!at[n])
            break;
        at += n + 1;
    }
    struct hg_suggestion near = hg_suggest_begin(text, length);
    hg_suggest_offer_choices(&near, choices);
    return hg_error_set(err, HG_E_INVAL, what, NULL, "'%s' is none of %s%s", text, choices,
        hg_suggest_text(&near).text);
}

static enum hg_status add_text(
    const char *what, struct hg_cli_texts *texts, const char *text, struct hg_error *err)
{
    if (texts->count == HG_CLI_TEXTS_MAX)
        return hg_error_set(
            err, HG_E_INVAL, what, NULL, "given more than %d times", HG_CLI_TEXTS_MAX);
    texts->items[texts->count++] = text;
    return HG_OK;
}

static enum hg_status set_value(const struct hg_cli_option_row *row, const char *text,
    struct hg_cli_options *out, struct hg_error *err)
{
    char what[64], choices[HG_CLI_CHOICES_BYTES];
    void *value = (char *)out + row->value_offset;
    const double high = row->param ? row->param->most : row->high;
    snprintf(what, sizeof what, "--%s", row->name);
    *(bool *)((char *)out + row->has_offset) = true;
    if (row->kind != HG_CLI_KIND_FLAG && !*text)
        return hg_error_set(err, HG_E_INVAL, what, NULL, "needs a value");
    switch (row->kind) {
    case HG_CLI_KIND_FLAG:
        *(bool *)value = true;
        return HG_OK;
    case HG_CLI_KIND_TEXT:
    case HG_CLI_KIND_FILE:
        *(const char **)value = text;
        return HG_OK;
    case HG_CLI_KIND_TEXTS:
    case HG_CLI_KIND_FOLDER:
        return add_text(what, value, text, err);
    case HG_CLI_KIND_U32:
        return hg_cli_parse_u32(what, text, (uint32_t)row->low, (uint32_t)high, value, err);
    case HG_CLI_KIND_F64:
        return hg_cli_parse_number(what, text, row->low, high, value, err);
    case HG_CLI_KIND_SIZE:
        return hg_cli_parse_size(what, text, value, err);
    case HG_CLI_KIND_VEC3:
        return hg_cli_parse_numbers(what, text, 3, ((struct hg_cli_vec3 *)value)->v, err);
    case HG_CLI_KIND_REGION:
        return hg_cli_parse_region(what, text, value, err);
    case HG_CLI_KIND_CHOICE:
        hg_cli_option_choices(row, choices);
        if (strcmp(row->name, "quality") == 0 && strspn(text, "0123456789") == strlen(text))
            return hg_error_set(err, HG_E_INVAL, what, NULL,
                "'%s' is none of %s; of JPEG files it is --jpeg-quality %s", text, choices, text);
        return parse_choice(what, choices, text, value, err);
    case HG_CLI_KIND_FRAMES:
        return hg_frame_ranges_parse(what, text, value, err);
    case HG_CLI_KIND_SUN:
        return parse_sun(what, text, value, err);
    case HG_CLI_KIND_EXPOSURE:
        return hg_cli_parse_exposure(what, text, value, err);
    case HG_CLI_KIND_BACKGROUND:
        return hg_cli_parse_background(what, text, value, err);
    }
    return HG_E_INTERNAL;
}

static const struct hg_cli_option_row *find_long(uint32_t command, const char *name, size_t length)
{
    for (uint32_t i = 0; i < hg_cli_option_count; i++) {
        const struct hg_cli_option_row *row = &hg_cli_option_rows[i];
        if ((row->commands & command) && strlen(row->name) == length &&
            memcmp(row->name, name, length) == 0)
            return row;
    }
    return NULL;
}

static const struct hg_cli_option_row *find_short(uint32_t command, char letter)
{
    for (uint32_t i = 0; i < hg_cli_option_count; i++)
        if ((hg_cli_option_rows[i].commands & command) && hg_cli_option_rows[i].letter == letter)
            return &hg_cli_option_rows[i];
    return NULL;
}

// What other programs call it.
static const char *other_name(uint32_t command, const char *name, size_t length)
{
    static const char *const names[][2] = {{"width", "size"}, {"height", "size"},
        {"resolution", "size"}, {"environment", "env"}, {"hdri", "env"}, {"hdr", "env"},
        {"ibl", "env"}, {"azimuth", "view"}, {"elevation", "view"}, {"angle", "view"},
        {"direction", "view"}, {"background-color", "background"}, {"bg", "background"},
        {"engine", "mode"}, {"renderer", "mode"}, {"start", "frames"}, {"end", "frames"},
        {"animation-time", "at"}, {"dof", "lens-radius"}, {"light", "sun"}};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strlen(names[i][0]) == length && memcmp(names[i][0], name, length) == 0 &&
            find_long(command, names[i][1], strlen(names[i][1])) != NULL)
            return names[i][1];
    return NULL;
}

// Of an option that the command does not have: the nearest one that it has, or another command
// that has it.
static enum hg_status refuse_option(uint32_t command, const char *word, struct hg_error *err)
{
    const bool is_long = word[1] == '-';
    const char *name = word + 1 + is_long;
    const size_t length = strcspn(name, "=");
    struct hg_suggestion near = hg_suggest_begin(name, length);
    for (uint32_t i = 0; is_long && i < hg_cli_option_count; i++)
        if (hg_cli_option_rows[i].commands & command)
            hg_suggest_offer(&near, hg_cli_option_rows[i].name, strlen(hg_cli_option_rows[i].name));
    for (int i = 0; is_long && i < HG_CLI_COMMAND_COUNT; i++)
        if (find_long(hg_cli_commands[i].command, name, length))
            return hg_error_set(err, HG_E_INVAL, word, NULL,
                "unknown option; it is one of helio %s", hg_cli_commands[i].name);
    const char *other = is_long ? other_name(command, name, length) : NULL;
    if (other != NULL || near.word[0])
        return hg_error_set(err, HG_E_INVAL, word, NULL, "unknown option; did you mean --%s?",
            other != NULL ? other : near.word);
    return hg_error_set(err, HG_E_INVAL, word, NULL, "unknown option; --help lists all of them");
}

static enum hg_status refuse_command(const char *word, struct hg_error *err)
{
    struct hg_suggestion near = hg_suggest_begin(word, strlen(word));
    if (word[0] == '-')
        hg_suggest_offer_choices(&near, "--help|--version");
    for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++)
        hg_suggest_offer(&near, hg_cli_commands[i].name, strlen(hg_cli_commands[i].name));
    if (near.word[0])
        return hg_error_set(
            err, HG_E_INVAL, word, NULL, "unknown command; did you mean helio %s?", near.word);
    if (strpbrk(word, "./:"))
        return hg_error_set(err, HG_E_INVAL, word, NULL,
            "is not a command; a scene is rendered by helio render SCENE -o OUT");
    return hg_error_set(err, HG_E_INVAL, word, NULL, "unknown command; see helio --help");
}

// Parses the option at argv[*at]; leaves *at on the last word it used.
static enum hg_status parse_option(
    int argc, const char *const *argv, int *at, struct hg_cli_options *out, struct hg_error *err)
{
    const char *word = argv[*at], *value = NULL;
    const struct hg_cli_option_row *row;
    if (word[1] == '-') {
        size_t length = strcspn(word + 2, "=");
        row = find_long(out->command, word + 2, length);
        value = word[2 + length] ? word + 3 + length : NULL;
    } else {
        row = find_short(out->command, word[1]);
        value = word[2] ? word + 2 : NULL;
    }
    if (!row)
        return refuse_option(out->command, word, err);
    if (row->kind == HG_CLI_KIND_FLAG && value)
        return hg_error_set(err, HG_E_INVAL, word, NULL, "takes no value");
    if (row->kind != HG_CLI_KIND_FLAG && !value) {
        if (*at + 1 >= argc)
            return hg_error_set(err, HG_E_INVAL, word, NULL, "needs %s", row->argument);
        value = argv[++*at];
    }
    return set_value(row, value, out, err);
}

static enum hg_status check_counts(const struct hg_cli_command_row *row,
    const struct hg_cli_options *options, struct hg_error *err)
{
    if (options->help || options->arg_count >= row->least)
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, row->name, NULL, "needs %s", row->arguments);
}

enum hg_status hg_cli_parse(
    int argc, const char *const *argv, struct hg_cli_options *out, struct hg_error *err)
{
    const struct hg_cli_command_row *row = NULL;
    *out = (struct hg_cli_options){.program = "helio"};
    if (argc < 2)
        return hg_error_set(err, HG_E_INVAL, "helio", NULL, "needs a command; see helio --help");
    for (int i = 0; i < HG_CLI_COMMAND_COUNT; i++)
        if (strcmp(argv[1], hg_cli_commands[i].name) == 0)
            row = &hg_cli_commands[i];
    if (!row)
        return refuse_command(argv[1], err);
    out->command = row->command;
    out->argv = argv;
    bool only_args = false;
    for (int i = 2; i < argc; i++) {
        enum hg_status status = HG_OK;
        if (!only_args && (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0))
            out->help = true;
        else if (!only_args && strcmp(argv[i], "--") == 0)
            only_args = true;
        else if (!only_args && argv[i][0] == '-' && argv[i][1])
            status = parse_option(argc, argv, &i, out, err);
        else if (out->arg_count == row->most)
            status = hg_error_set(err, HG_E_INVAL, argv[i], NULL, "one argument too many");
        else
            out->args[out->arg_count++] = argv[i];
        if (status)
            return status;
    }
    return check_counts(row, out, err);
}
