#include "client/cli/run/script.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/render/render.h"
#include "client/cli/run/script_words.h"
#include "client/cli/suggest.h"

static const double pi = 3.14159265358979323846;

// ---- camera, time, frame -----------------------------------------------------------------------

static enum hg_status take_lens(struct hg_words *w, struct hgp_view_camera *c, struct hg_error *err)
{
    const struct hg_words_fields fields = {HGP_T_view_camera, c};
    enum hg_status status = HG_OK;
    while (!status && w->next < w->count) {
        if (hg_words_accept(w, "lens"))
            status = hg_words_take_field(w, "lens", "lens_radius", &fields, err);
        else if (hg_words_accept(w, "focus"))
            status = hg_words_take_field(w, "focus", "focus_distance", &fields, err);
        else
            break;
    }
    return status;
}

static enum hg_status take_target_and_fov(
    struct hg_words *w, double target[3], struct hgp_view_camera *c, struct hg_error *err)
{
    double fov = 45;
    enum hg_status status = HG_OK;
    while (!status && w->next < w->count) {
        if (hg_words_accept(w, "target"))
            status = hg_words_take_numbers(w, "target", 3, target, err);
        else if (hg_words_accept(w, "fov"))
            status = hg_words_take_number(w, "fov", 0.1, 179, &fov, err);
        else
            break;
    }
    c->has_vfov_rad = true;
    c->vfov_rad = (float)(fov * pi / 180);
    return status;
}

static enum hg_status place_orbit(
    const double place[3], const double target[3], struct hgp_view_camera *c, struct hg_error *err)
{
    if (place[2] < 0)
        return hg_words_error(err, "the radius is negative");
    helio_camera_orbit(place[0], place[1], place[2], target, c);
    return HG_OK;
}

static enum hg_status place_eye(
    const double place[3], const double target[3], struct hgp_view_camera *c, struct hg_error *err)
{
    if (memcmp(place, target, 3 * sizeof *place) == 0)
        return hg_words_error(err, "eye and target are the same point");
    c->has_eye = c->has_target = true;
    for (int i = 0; i < 3; i++) {
        c->eye[i] = (float)place[i];
        c->target[i] = (float)target[i];
    }
    return HG_OK;
}

static enum hg_status parse_fit(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *view;
    struct hg_error inner = {0};
    double fov = 45;
    enum hg_status status = HG_OK;
    s->kind = HG_CLI_STEP_CAMERA_FIT;
    if (hg_words_accept(w, "view")) {
        status = hg_words_take(w, "view", &view, err);
        if (!status && hg_cli_parse_view("view", view, &s->fit, &inner))
            status = hg_words_rename_error(&inner, "view", err);
    }
    if (!status && hg_words_accept(w, "fov"))
        status = hg_words_take_number(w, "fov", 0.1, 179, &fov, err);
    s->fit.has_vfov_rad = true;
    s->fit.vfov_rad = (float)(fov * pi / 180);
    return status ? status : take_lens(w, &s->camera, err);
}

static enum hg_status parse_camera(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    double place[3], target[3] = {0};
    struct hgp_view_camera *c = &s->camera;
    s->kind = HG_CLI_STEP_CAMERA;
    if (hg_words_accept(w, "node")) {
        s->kind = HG_CLI_STEP_CAMERA_NODE;
        enum hg_status named = hg_words_take(w, "node name", &s->name, err);
        return named ? named : take_lens(w, c, err);
    }
    if (hg_words_accept(w, "fit"))
        return parse_fit(w, s, err);
    bool orbit = hg_words_accept(w, "orbit");
    if (!orbit && !hg_words_accept(w, "eye"))
        return hg_words_error(err, "orbit, eye, node or fit is missing");
    enum hg_status status = hg_words_take_numbers(w, orbit ? "orbit" : "eye", 3, place, err);
    if (status)
        return status;
    status = take_target_and_fov(w, target, c, err);
    if (status)
        return status;
    status = take_lens(w, c, err);
    if (status)
        return status;
    return orbit ? place_orbit(place, target, c, err) : place_eye(place, target, c, err);
}

static enum hg_status parse_connect(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    (void)err;
    *w->views = (struct hg_script_views){0};
    s->kind = HG_CLI_STEP_CONNECT;
    s->path = w->next < w->count ? w->at[w->next++] : NULL;
    return HG_OK;
}

static enum hg_status parse_scene(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    *w->views = (struct hg_script_views){0};
    s->kind = HG_CLI_STEP_SCENE;
    enum hg_status status = hg_words_take(w, "name of a scene", &s->name, err);
    return status || *s->name ? status : hg_words_error(err, "the scene's name is empty");
}

static enum hg_status parse_view(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_SWITCH;
    enum hg_status status = hg_words_take_u32(w, "view", 1, HG_CLI_VIEWS_MAX, &s->x, err);
    if (status)
        return status;
    s->now = hg_words_accept(w, "close");
    if (s->now && s->x == 1)
        return hg_words_error(err, "view 1 cannot be closed: it is there as long as the scene");
    w->views->now = s->now ? 0 : s->x - 1;
    if (s->now)
        w->views->items[s->x - 1] = (struct hg_script_view){0};
    return HG_OK;
}

static enum hg_status parse_load(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_LOAD;
    enum hg_status status = hg_words_take(w, "path", &s->path, err);
    if (!status)
        status = hg_words_take_asset(w, s, err);
    if (!status && hg_words_accept(w, "up")) {
        const char *axis;
        struct hg_error inner = {0};
        status = hg_words_take(w, "axis", &axis, err);
        if (!status && hg_cli_parse_up("up", axis, &s->up, &inner))
            status = hg_words_rename_error(&inner, "up", err);
    }
    if (status || !hg_words_accept(w, "point-size"))
        return status;
    struct hgp_asset_load ignored = {0};
    status = hg_words_take(w, "size of points", &s->name, err);
    return status ? status : hg_cli_parse_point_size("point-size", s->name, &ignored, err);
}

static enum hg_status parse_time(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_TIME;
    enum hg_status status = hg_words_take_number(w, "time", 0, 1e12, &s->number, err);
    if (!status && hg_words_accept(w, "animation"))
        status = hg_words_take(w, "animation", &s->name, err);
    return status ? status : hg_words_take_asset(w, s, err);
}

static enum hg_status parse_frame(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_FRAME;
    struct hg_cli_format ignored;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "file to write", &s->path, err);
    if (!status && hg_cli_format_of(s->path, NULL, &ignored, &inner))
        status = hg_words_rename_error(&inner, s->path, err);
    s->now = !status && hg_words_accept(w, "now");
    return status;
}

static enum hg_status parse_wait(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_FRAME;
    return hg_words_accept(w, "settled") ? HG_OK : hg_words_error(err, "'settled' is missing");
}

// ---- expect ------------------------------------------------------------------------------------

static const char *const op_texts[] = {">=", "<=", ">", "<", "==", "!="};

static enum hg_status take_comparison(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    enum hg_status status = hg_words_take(w, "a comparison such as >=", &text, err);
    if (status)
        return status;
    for (int i = 0; i < 6; i++)
        if (strcmp(text, op_texts[i]) == 0) {
            s->op = (enum hg_cli_op)i;
            return HG_OK;
        }
    return hg_words_error(err, "'%s' is none of >= <= > < == !=", text);
}

static enum hg_status take_bound(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status = take_comparison(w, s, err);
    return status ? status : hg_words_take_number(w, "number", -1e300, 1e300, &s->number, err);
}

// A number, true or false (yes or no), or with == and != any text.
static enum hg_status take_value(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hg_error ignored;
    enum hg_status status = take_comparison(w, s, err);
    if (!status)
        status = hg_words_take(w, "value", &s->value, err);
    if (status)
        return status;
    s->number = NAN;
    if (strcmp(s->value, "true") == 0 || strcmp(s->value, "yes") == 0)
        s->number = 1;
    else if (strcmp(s->value, "false") == 0 || strcmp(s->value, "no") == 0)
        s->number = 0;
    else if (hg_cli_parse_number("value", s->value, -1e300, 1e300, &s->number, &ignored))
        s->number = NAN;
    if (!isnan(s->number) || s->op == HG_CLI_OP_EQ || s->op == HG_CLI_OP_NE)
        return HG_OK;
    return hg_words_error(err, "'%s' is no number: texts are compared with == and !=", s->value);
}

static enum hg_status take_number(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const enum hg_status status = take_comparison(w, s, err);
    return status ? status : hg_words_take_number(w, "value", -1e300, 1e300, &s->number, err);
}

static enum hg_status parse_pick(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_EXPECT_PICK;
    enum hg_status status = hg_words_take_u32(w, "x", 0, 16383, &s->x, err);
    if (status)
        return status;
    status = hg_words_take_u32(w, "y", 0, 16383, &s->y, err);
    if (status || hg_words_accept(w, "nothing"))
        return status;
    if (!hg_words_accept(w, "node"))
        return hg_words_error(err, "'node NAME' or 'nothing' is missing");
    return hg_words_take(w, "node name", &s->name, err);
}

static enum hg_status parse_expect(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *what;
    uint32_t metric;
    enum hg_status status = hg_words_take(w, "what to expect", &what, err);
    if (status)
        return status;
    if (strcmp(what, "pick") == 0)
        return parse_pick(w, s, err);
    if (strcmp(what, "seen") == 0 || strcmp(what, "distance") == 0) {
        status = what[0] == 's' ? hg_script_expect_seen(w, s, err)
                                : hg_script_expect_distance(w, s, err);
        return status ? status : take_number(w, s, err);
    }
    if (strcmp(what, "hash") == 0) {
        s->kind = HG_CLI_STEP_EXPECT_HASH;
        status = hg_words_take(w, "hash", &s->name, err);
        if (status)
            return status;
        return strlen(s->name) == 64 && strspn(s->name, "0123456789abcdef") == 64
                   ? HG_OK
                   : hg_words_error(err, "'%s' is not 64 lower-case hexadecimal digits", s->name);
    }
    if (strcmp(what, "stat") == 0) {
        s->kind = HG_CLI_STEP_EXPECT_STAT;
        status = hg_words_take(w, "key", &s->name, err);
        return status ? status : take_value(w, s, err);
    }
    if (!hgp_enum_value("metric", what, &metric))
        return hg_words_error(
            err, "'%s' is none of psnr ssim flip rmse max stat pick seen distance hash", what);
    s->kind = HG_CLI_STEP_EXPECT_IMAGE;
    s->metric = (enum hgp_metric)metric;
    status = hg_words_take(w, "image file", &s->path, err);
    if (!status)
        status = take_bound(w, s, err);
    if (!status && hg_words_accept(w, "mask"))
        status = hg_words_take(w, "mask file", &s->mask, err);
    return status;
}

bool hg_cli_op_holds(enum hg_cli_op op, double seen, double wanted)
{
    switch (op) {
    case HG_CLI_OP_GE:
        return seen >= wanted;
    case HG_CLI_OP_LE:
        return seen <= wanted;
    case HG_CLI_OP_GT:
        return seen > wanted;
    case HG_CLI_OP_LT:
        return seen < wanted;
    case HG_CLI_OP_EQ:
        return seen == wanted;
    case HG_CLI_OP_NE:
        return seen != wanted;
    }
    return false;
}

// ---- lines -------------------------------------------------------------------------------------

static enum hg_status parse_words(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const struct {
        const char *verb;
        enum hg_status (*parse)(struct hg_words *, struct hg_cli_step *, struct hg_error *);
    } verbs[] = {{"connect", parse_connect}, {"scene", parse_scene}, {"view", parse_view},
        {"load", parse_load}, {"set", hg_script_parse_set}, {"camera", parse_camera},
        {"time", parse_time}, {"at", parse_time}, {"frame", parse_frame}, {"wait", parse_wait},
        {"expect", parse_expect}};
    for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++) {
        if (!hg_words_accept(w, verbs[i].verb))
            continue;
        enum hg_status status = verbs[i].parse(w, s, err);
        if (status || w->next == w->count)
            return status;
        return hg_words_error(err, "'%s' is one word too many", w->at[w->next]);
    }
    struct hg_suggestion near = hg_suggest_begin(w->at[0], strlen(w->at[0]));
    for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++)
        hg_suggest_offer(&near, verbs[i].verb, strlen(verbs[i].verb));
    return hg_words_error(err, "unknown command '%s'%s%s%s", w->at[0],
        near.word[0] ? "; did you mean " : "", near.word, near.word[0] ? "?" : "");
}

enum { INCLUDES_MOST = 16, INCLUDED_BYTES_MOST = 64 * 1024 * 1024 };

struct parser {
    struct hg_cli_script *out;
    const struct hg_cli_script_source *source;
    struct hg_script_views views;
    uint32_t depth;        // of includes
    size_t included_bytes; // of all of them
};

static enum hg_status parse_text(
    struct parser *p, const char *file, const char *text, struct hg_error *err);

static enum hg_status parse_include(struct parser *p, struct hg_words *w, struct hg_error *err)
{
    const char *path;
    char *text;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "file to include", &path, err);
    if (status)
        return status;
    if (w->next < w->count)
        return hg_words_error(err, "'%s' is one word too many", w->at[w->next]);
    if (!p->source->include)
        return hg_words_error(err, "nothing can be included here");
    if (p->depth == INCLUDES_MOST)
        return hg_words_error(err, "includes nest deeper than %d", INCLUDES_MOST);
    status = p->source->include(p->source->user, path, &text, &inner);
    if (status)
        return hg_error_set(err, status, NULL, NULL, "%s: %s", path, inner.reason);
    p->included_bytes += strlen(text);
    p->depth++;
    status = p->included_bytes > INCLUDED_BYTES_MOST
                 ? hg_words_error(
                       err, "all includes together are longer than %d bytes", INCLUDED_BYTES_MOST)
                 : parse_text(p, path, text, err);
    p->depth--;
    hg_free(text);
    return status;
}

static enum hg_status parse_line(
    struct parser *p, struct hg_words *w, const char *line, uint32_t number, struct hg_error *err)
{
    struct hg_cli_script *script = p->out;
    enum hg_status status = hg_words_split(w, line, err);
    if (status || w->count == 0)
        return status;
    if (hg_words_accept(w, "include"))
        return parse_include(p, w, err);
    if (hg_grow(&script->steps, &script->capacity, script->count + 1, sizeof *script->steps))
        return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory for the script");
    struct hg_cli_step *s = &script->steps[script->count];
    *s = (struct hg_cli_step){.file = w->file, .line = number};
    const char *begin = line + strspn(line, " \t");
    s->text = hg_arena_strndup(&script->arena, begin, strlen(begin));
    status = s->text ? parse_words(w, s, err) : HG_E_NOMEM;
    script->count += !status;
    return status;
}

// Errors that have no place yet get this file's and the line's.
static enum hg_status parse_text(
    struct parser *p, const char *given, const char *text, struct hg_error *err)
{
    char line[HG_SCRIPT_LINE_BYTES], place[256];
    struct hg_error inner = {0};
    enum hg_status status = HG_OK;
    uint32_t number = 0;
    const char *file = hg_arena_strndup(&p->out->arena, given, strlen(given));
    if (!file)
        return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory for the script");
    for (const char *at = text; *at && !status;) {
        size_t length = strcspn(at, "\n");
        number++;
        if (length >= sizeof line) {
            status = hg_words_error(&inner, "the line is too long");
            break;
        }
        snprintf(line, sizeof line, "%.*s", (int)length, at);
        size_t end = strlen(line);
        if (end && line[end - 1] == '\r')
            line[end - 1] = 0;
        struct hg_words w = {
            .arena = &p->out->arena, .source = p->source, .file = file, .views = &p->views};
        status = parse_line(p, &w, line, number, &inner);
        at += length + (at[length] == '\n');
    }
    if (!status)
        return HG_OK;
    snprintf(place, sizeof place, "%.200s:%u", file, number);
    return hg_error_set(err, status, inner.what[0] ? inner.what : place, NULL, "%s", inner.reason);
}

enum hg_status hg_cli_script_parse(const char *file, const char *text,
    const struct hg_cli_script_source *source, struct hg_cli_script *out, struct hg_error *err)
{
    *out = (struct hg_cli_script){0};
    struct parser parser = {.out = out, .source = source};
    enum hg_status status = parse_text(&parser, file, text, err);
    if (status)
        hg_cli_script_finish(out);
    return status;
}

void hg_cli_script_finish(struct hg_cli_script *script)
{
    hg_arena_finish(&script->arena);
    hg_free(script->steps);
    *script = (struct hg_cli_script){0};
}
