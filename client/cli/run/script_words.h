// script_words.h - a line of a script as words, and what they are read as. Private to script*.c.
// Floor 6 (client). Pure. Errors are HG_E_INVAL with a reason, without a place.
#ifndef HG_CLIENT_CLI_RUN_SCRIPT_WORDS_H
#define HG_CLIENT_CLI_RUN_SCRIPT_WORDS_H

#include "client/cli/run/script.h"

enum { HG_WORDS_MAX = 32, HG_SCRIPT_LINE_BYTES = 8192 };

// The view as the lines before have left it, as far as its planes depend on that.
struct hg_script_view {
    const char *planes; // NULL = none
    bool path, denoise, debug;
};

struct hg_script_views {
    struct hg_script_view items[HG_CLI_VIEWS_MAX];
    uint32_t now; // index of the one that lines are about
};

// One line being parsed.
struct hg_words {
    const char *at[HG_WORDS_MAX];
    uint32_t count, next;
    struct hg_arena *arena; // of the words
    const struct hg_cli_script_source *source;
    const char *file; // of the line
    struct hg_script_views *views;
};

enum hg_status hg_words_error(struct hg_error *err, const char *fmt, ...) HG_PRINTF(2, 3);
// What a parser that names options said, with `what` instead of the option. HG_E_INVAL.
enum hg_status hg_words_rename_error(
    const struct hg_error *inner, const char *what, struct hg_error *err);

// Appends the words of a line, quotes, escapes and variables replaced.
enum hg_status hg_words_split(
    struct hg_words *w, const char *line, struct hg_error *err) HG_MUST_CHECK;

// Takes the next word if it is this one.
bool hg_words_accept(struct hg_words *w, const char *text);
// The others take what must be there; `what` names it in errors.
enum hg_status hg_words_take(
    struct hg_words *w, const char *what, const char **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_words_take_number(struct hg_words *w, const char *what, double low, double high,
    double *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_words_take_u32(struct hg_words *w, const char *what, uint32_t low, uint32_t high,
    uint32_t *out, struct hg_error *err) HG_MUST_CHECK;
// `count` numbers as "a,b,c" or as separate words.
enum hg_status hg_words_take_numbers(struct hg_words *w, const char *what, uint32_t count,
    double *out, struct hg_error *err) HG_MUST_CHECK;
// Values of a message of the protocol.
struct hg_words_fields {
    enum hgp_type type;
    void *message;
};
// The value of an optional field, by its kind and range there; `word` names it in errors. In
// `field` - stands for _. Kinds: F32, U32, BOOL, ENUM, VEC3, VEC4.
enum hg_status hg_words_take_field(struct hg_words *w, const char *word, const char *field,
    const struct hg_words_fields *fields, struct hg_error *err) HG_MUST_CHECK;
// [as N], to s->asset.
enum hg_status hg_words_take_asset(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;

// script_look.c; the expectations without their comparison
enum hg_status hg_script_set_clip(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_script_set_override(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_script_set_view_variant(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_script_expect_seen(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_script_expect_distance(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;

// script_set.c
enum hg_status hg_script_parse_set(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err) HG_MUST_CHECK;

#endif
