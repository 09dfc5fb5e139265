#include "client/cli/script.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/render.h"

enum { WORDS_MAX = 32, LINE_BYTES = 8192 };

static const double pi = 3.14159265358979323846;

// What the lines before have told the view, as far as its planes depend on it.
struct told {
    const char *planes; // NULL = none
    bool path, denoise, debug;
};

// One line being parsed.
struct words {
    const char *at[WORDS_MAX];
    uint32_t count, next;
    struct hg_arena *arena;
    hg_cli_variable_fn *variable;
    void *user;
    struct told *told;
};

static enum hg_status wrong(struct hg_error *err, const char *fmt, ...) HG_PRINTF(2, 3);

static enum hg_status wrong(struct hg_error *err, const char *fmt, ...)
{
    char reason[256];
    va_list args;
    va_start(args, fmt);
    vsnprintf(reason, sizeof reason, fmt, args);
    va_end(args);
    return hg_error_set(err, HG_E_INVAL, NULL, NULL, "%s", reason);
}

// ---- words -------------------------------------------------------------------------------------

struct buffer {
    char text[LINE_BYTES];
    size_t size;
};

static bool put(struct buffer *b, const char *text, size_t n)
{
    if (n >= sizeof b->text - b->size)
        return false;
    memcpy(b->text + b->size, text, n);
    b->size += n;
    return true;
}

// Expands the ${NAME} at *at, leaving *at behind it.
static enum hg_status expand(
    const struct words *w, const char **at, struct buffer *b, struct hg_error *err)
{
    const char *name = *at + 2, *end = strchr(name, '}');
    if (!end || end == name)
        return wrong(err, "'${' without a name and '}'");
    const char *value = w->variable ? w->variable(w->user, name, (size_t)(end - name)) : NULL;
    if (!value)
        return wrong(err, "the variable '%.*s' is not defined", (int)(end - name), name);
    if (!put(b, value, strlen(value)))
        return wrong(err, "the line is too long");
    *at = end + 1;
    return HG_OK;
}

// Reads one word that starts at *at into *b.
static enum hg_status read_word(
    const struct words *w, const char **at, struct buffer *b, struct hg_error *err)
{
    char quote = 0;
    const char *p = *at;
    for (; *p && (quote || (*p != ' ' && *p != '\t')); p++) {
        if (quote ? *p == quote : *p == '"' || *p == '\'') {
            quote = quote ? 0 : *p;
            continue;
        }
        if (quote != '\'' && p[0] == '$' && p[1] == '{') {
            enum hg_status status = expand(w, &p, b, err);
            if (status)
                return status;
            p--;
            continue;
        }
        if (quote != '\'' && *p == '\\' && p[1])
            p++;
        if (!put(b, p, 1))
            return wrong(err, "the line is too long");
    }
    if (quote)
        return wrong(err, "a quotation mark %c is not closed", quote);
    *at = p;
    return HG_OK;
}

static enum hg_status split(struct words *w, const char *line, struct hg_error *err)
{
    struct buffer b;
    for (const char *at = line;;) {
        at += strspn(at, " \t");
        if (!*at || *at == '#')
            return HG_OK;
        b.size = 0;
        enum hg_status status = read_word(w, &at, &b, err);
        if (status)
            return status;
        if (w->count == WORDS_MAX)
            return wrong(err, "more than %d words", WORDS_MAX);
        w->at[w->count] = hg_arena_strndup(w->arena, b.text, b.size);
        if (!w->at[w->count++])
            return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory for the script");
    }
}

static bool is_next(const struct words *w, const char *text)
{
    return w->next < w->count && strcmp(w->at[w->next], text) == 0;
}

static bool accept(struct words *w, const char *text)
{
    bool yes = is_next(w, text);
    w->next += yes;
    return yes;
}

static enum hg_status take(
    struct words *w, const char *what, const char **out, struct hg_error *err)
{
    *out = NULL;
    if (w->next >= w->count)
        return wrong(err, "%s is missing", what);
    *out = w->at[w->next++];
    return HG_OK;
}

// The inner parsers name options; here the line is named.
static enum hg_status renamed(
    enum hg_status status, const struct hg_error *inner, const char *what, struct hg_error *err)
{
    return status ? wrong(err, "%s: %s", what, inner->reason) : HG_OK;
}

static enum hg_status take_number(
    struct words *w, const char *what, double low, double high, double *out, struct hg_error *err)
{
    const char *text;
    struct hg_error inner = {0};
    *out = 0;
    enum hg_status status = take(w, what, &text, err);
    if (status)
        return status;
    return renamed(hg_cli_parse_number(what, text, low, high, out, &inner), &inner, what, err);
}

static enum hg_status take_u32(struct words *w, const char *what, uint32_t low, uint32_t high,
    uint32_t *out, struct hg_error *err)
{
    const char *text;
    struct hg_error inner = {0};
    *out = 0;
    enum hg_status status = take(w, what, &text, err);
    if (status)
        return status;
    return renamed(hg_cli_parse_u32(what, text, low, high, out, &inner), &inner, what, err);
}

// `count` numbers as "a,b,c" or as separate words.
static enum hg_status take_numbers(
    struct words *w, const char *what, uint32_t count, double *out, struct hg_error *err)
{
    if (w->next < w->count && strchr(w->at[w->next], ',')) {
        struct hg_error inner = {0};
        return renamed(
            hg_cli_parse_numbers(what, w->at[w->next++], count, out, &inner), &inner, what, err);
    }
    for (uint32_t i = 0; i < count; i++) {
        enum hg_status status = take_number(w, what, -1e30, 1e30, &out[i], err);
        if (status)
            return status;
    }
    return HG_OK;
}

static enum hg_status take_floats(
    struct words *w, const char *what, uint32_t count, float *out, bool *has, struct hg_error *err)
{
    double v[4];
    enum hg_status status = take_numbers(w, what, count, v, err);
    for (uint32_t i = 0; !status && i < count; i++)
        out[i] = (float)v[i];
    *has = !status;
    return status;
}

static enum hg_status take_bool(
    struct words *w, const char *what, bool *out, bool *has, struct hg_error *err)
{
    *out = accept(w, "yes") || accept(w, "on") || accept(w, "true");
    *has = *out || accept(w, "no") || accept(w, "off") || accept(w, "false");
    return *has ? HG_OK : wrong(err, "%s: yes or no is missing", what);
}

static enum hg_status take_enum(
    struct words *w, const char *enum_name, uint32_t *out, struct hg_error *err)
{
    const char *text;
    enum hg_status status = take(w, enum_name, &text, err);
    if (!status && !hgp_enum_value(enum_name, text, out))
        status = wrong(err, "'%s' is not a %s", text, enum_name);
    return status;
}

// ---- set ---------------------------------------------------------------------------------------

static enum hg_status take_f32_in(struct words *w, const char *what, double low, double high,
    float *out, bool *has, struct hg_error *err)
{
    double v;
    enum hg_status status = take_number(w, what, low, high, &v, err);
    *out = (float)v;
    *has = !status;
    return status;
}

static enum hg_status set_size(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_size size;
    struct hg_error inner = {0};
    enum hg_status status = take(w, "size", &text, err);
    if (!status)
        status = renamed(hg_cli_parse_size("size", text, &size, &inner), &inner, "size", err);
    if (status)
        return status;
    s->view.has_width = s->view.has_height = true;
    s->view.width = size.width;
    s->view.height = size.height;
    return HG_OK;
}

static enum hg_status set_background(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_background b;
    struct hg_error inner = {0};
    enum hg_status status = take(w, "background", &text, err);
    if (!status)
        status = renamed(
            hg_cli_parse_background("background", text, &b, &inner), &inner, "background", err);
    if (status)
        return status;
    hg_cli_set_background(&b, &s->view);
    return HG_OK;
}

// A parameter of view_set that a word sets alone, by the table of view parameters.
static enum hg_status set_param(struct words *w, const char *word,
    const struct hgp_view_param *param, struct hgp_view_set *view, struct hg_error *err)
{
    const struct hgp_field *field = hgp_view_param_field(param);
    void *value = (char *)view + field->offset;
    bool *has = (bool *)((char *)view + field->has_offset);
    enum hg_status status;
    if (param->kind == HGP_K_ENUM)
        status = take_enum(w, param->values, value, err);
    else if (param->kind == HGP_K_U32)
        status = take_u32(w, word, (uint32_t)param->least, (uint32_t)param->most, value, err);
    else
        return take_f32_in(w, word, param->least, param->most, value, has, err);
    *has = !status;
    return status;
}

static enum hg_status set_env(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hgp_environment_set *e = &s->environment;
    enum hg_status status = take(w, "environment", &text, err);
    s->kind = HG_CLI_STEP_ENVIRONMENT;
    e->has_kind = true;
    if (status)
        return status;
    if (strcmp(text, "none") == 0) {
        e->kind = HGP_environment_kind_NONE;
    } else if (strcmp(text, "sky") == 0) {
        e->kind = HGP_environment_kind_SKY;
    } else {
        e->kind = HGP_environment_kind_FILE;
        s->path = text;
    }
    while (!status && w->next < w->count) {
        if (accept(w, "intensity"))
            status = take_f32_in(w, "intensity", 0, 1e9, &e->intensity, &e->has_intensity, err);
        else if (accept(w, "rotation")) {
            status = take_f32_in(
                w, "rotation", -36000, 36000, &e->rotation_rad, &e->has_rotation_rad, err);
            e->rotation_rad = (float)(e->rotation_rad * pi / 180);
        } else if (accept(w, "turbidity"))
            status = take_f32_in(w, "turbidity", 1, 10, &e->turbidity, &e->has_turbidity, err);
        else if (accept(w, "sun"))
            status = take_floats(w, "sun", 3, e->sun_direction, &e->has_sun_direction, err);
        else
            status =
                wrong(err, "'%s' is not intensity, rotation, turbidity or sun", w->at[w->next]);
    }
    return status;
}

static enum hg_status take_asset(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    return accept(w, "as") ? take_u32(w, "asset", 1, UINT32_MAX, &s->asset, err) : HG_OK;
}

static enum hg_status set_variant(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_VARIANT;
    enum hg_status status = take(w, "variant", &s->name, err);
    return status ? status : take_asset(w, s, err);
}

static enum hg_status set_node(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_node_set *n = &s->node;
    s->kind = HG_CLI_STEP_NODE;
    enum hg_status status = take(w, "node name", &s->name, err);
    if (!status && w->next == w->count)
        status = wrong(err, "translation, rotation, scale or visible is missing");
    while (!status && w->next < w->count) {
        if (accept(w, "translation"))
            status = take_floats(w, "translation", 3, n->translation, &n->has_translation, err);
        else if (accept(w, "rotation"))
            status = take_floats(w, "rotation", 4, n->rotation, &n->has_rotation, err);
        else if (accept(w, "scale"))
            status = take_floats(w, "scale", 3, n->scale, &n->has_scale, err);
        else if (accept(w, "visible"))
            status = take_bool(w, "visible", &n->visible, &n->has_visible, err);
        else if (accept(w, "next-translation"))
            status = take_floats(
                w, "next-translation", 3, n->next_translation, &n->has_next_translation, err);
        else if (accept(w, "next-rotation"))
            status =
                take_floats(w, "next-rotation", 4, n->next_rotation, &n->has_next_rotation, err);
        else if (accept(w, "next-scale"))
            status = take_floats(w, "next-scale", 3, n->next_scale, &n->has_next_scale, err);
        else if (accept(w, "catches_shadows"))
            status =
                take_bool(w, "catches_shadows", &n->catches_shadows, &n->has_catches_shadows, err);
        else
            status = wrong(err,
                "'%s' is not [next-]translation, rotation, scale, visible or catches_shadows",
                w->at[w->next]);
    }
    return status;
}

static enum hg_status set_material_value(
    struct words *w, struct hgp_material_set *m, struct hg_error *err)
{
    if (accept(w, "base_color"))
        return take_floats(w, "base_color", 4, m->base_color, &m->has_base_color, err);
    if (accept(w, "emissive"))
        return take_floats(w, "emissive", 3, m->emissive, &m->has_emissive, err);
    if (accept(w, "metallic"))
        return take_f32_in(w, "metallic", 0, 1, &m->metallic, &m->has_metallic, err);
    if (accept(w, "roughness"))
        return take_f32_in(w, "roughness", 0, 1, &m->roughness, &m->has_roughness, err);
    if (accept(w, "emissive_strength"))
        return take_f32_in(
            w, "emissive_strength", 0, 1e9, &m->emissive_strength, &m->has_emissive_strength, err);
    if (accept(w, "normal_scale"))
        return take_f32_in(
            w, "normal_scale", -1000, 1000, &m->normal_scale, &m->has_normal_scale, err);
    if (accept(w, "alpha_cutoff"))
        return take_f32_in(w, "alpha_cutoff", 0, 1e9, &m->alpha_cutoff, &m->has_alpha_cutoff, err);
    if (accept(w, "double_sided"))
        return take_bool(w, "double_sided", &m->double_sided, &m->has_double_sided, err);
    if (accept(w, "unlit"))
        return take_bool(w, "unlit", &m->unlit, &m->has_unlit, err);
    if (accept(w, "alpha_mode")) {
        uint32_t mode = 0;
        enum hg_status status = take_enum(w, "alpha_mode", &mode, err);
        m->alpha_mode = (enum hgp_alpha_mode)mode;
        m->has_alpha_mode = !status;
        return status;
    }
    return wrong(err, "'%s' is not a value of materials", w->at[w->next]);
}

static enum hg_status set_material(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_MATERIAL;
    enum hg_status status = take(w, "material name", &s->name, err);
    if (!status && w->next == w->count)
        status = wrong(err, "what to set is missing");
    while (!status && w->next < w->count)
        status = set_material_value(w, &s->material, err);
    return status;
}
static enum hg_status set_shutter(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_view_set *v = &s->view;
    enum hg_status status =
        take_f32_in(w, "shutter", -1, 1, &v->shutter_open, &v->has_shutter_open, err);
    if (!status)
        status = take_f32_in(w, "shutter", -1, 1, &v->shutter_close, &v->has_shutter_close, err);
    return !status && v->shutter_close < v->shutter_open
               ? wrong(err, "shutter closes before it opens")
               : status;
}

static enum hg_status set_planes(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status = take(w, "planes", &w->told->planes, err);
    if (!status && strcmp(w->told->planes, "none") == 0)
        w->told->planes = NULL;
    s->view.has_planes = true;
    return status;
}

// The same list stands for other planes in another mode, and with --denoise.
static enum hg_status follow_planes(
    struct words *w, struct hgp_view_set *view, struct hg_error *err)
{
    struct told *told = w->told;
    struct hg_error inner = {0};
    if (view->has_mode)
        told->path = view->mode == HGP_render_mode_PATH;
    if (view->has_denoise)
        told->denoise = view->denoise != HGP_denoise_OFF;
    if (view->has_debug_view)
        told->debug = view->debug_view != HGP_debug_view_OFF;
    if (!told->planes)
        return HG_OK;
    if (told->debug)
        return wrong(err, "aov: a debug view has no planes");
    enum hg_status status =
        hg_cli_parse_planes("aov", told->planes, told->path, &view->planes, &inner);
    view->has_planes = true;
    if (told->path && told->denoise)
        view->planes |= 1u << HGP_plane_NOISY;
    return renamed(status, &inner, "aov", err);
}

static enum hg_status parse_set(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const struct {
        const char *key;
        enum hg_status (*parse)(struct words *, struct hg_cli_step *, struct hg_error *);
    } keys[] = {{"size", set_size}, {"background", set_background}, {"env", set_env},
        {"variant", set_variant}, {"node", set_node}, {"material", set_material},
        {"shutter", set_shutter}, {"aov", set_planes}};
    s->kind = HG_CLI_STEP_VIEW;
    const char *word = w->next < w->count ? w->at[w->next] : "";
    const struct hgp_view_param *param = hgp_view_param_find_word(word);
    if (param) {
        w->next++;
        enum hg_status status = set_param(w, word, param, &s->view, err);
        return status ? status : follow_planes(w, &s->view, err);
    }
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (!accept(w, keys[i].key))
            continue;
        enum hg_status status = keys[i].parse(w, s, err);
        return !status && s->kind == HG_CLI_STEP_VIEW ? follow_planes(w, &s->view, err) : status;
    }
    if (w->next == w->count)
        return wrong(err, "what to set is missing");
    return wrong(err, "'%s' cannot be set", w->at[w->next]);
}

// ---- camera, time, frame -----------------------------------------------------------------------

static enum hg_status take_lens(struct words *w, struct hgp_view_camera *c, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    while (!status && w->next < w->count) {
        if (accept(w, "lens"))
            status = take_f32_in(w, "lens", 0, 1e6, &c->lens_radius, &c->has_lens_radius, err);
        else if (accept(w, "focus"))
            status =
                take_f32_in(w, "focus", 0, 1e12, &c->focus_distance, &c->has_focus_distance, err);
        else
            break;
    }
    return status;
}

static enum hg_status take_target_and_fov(
    struct words *w, double target[3], struct hgp_view_camera *c, struct hg_error *err)
{
    double fov = 45;
    enum hg_status status = HG_OK;
    while (!status && w->next < w->count) {
        if (accept(w, "target"))
            status = take_numbers(w, "target", 3, target, err);
        else if (accept(w, "fov"))
            status = take_number(w, "fov", 0.1, 179, &fov, err);
        else
            break;
    }
    c->has_vfov_rad = true;
    c->vfov_rad = (float)(fov * pi / 180);
    return status;
}

static enum hg_status parse_camera(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    double place[3], target[3] = {0};
    struct hgp_view_camera *c = &s->camera;
    s->kind = HG_CLI_STEP_CAMERA;
    if (accept(w, "node")) {
        s->kind = HG_CLI_STEP_CAMERA_NODE;
        enum hg_status named = take(w, "node name", &s->name, err);
        return named ? named : take_lens(w, c, err);
    }
    if (accept(w, "fit")) {
        s->kind = HG_CLI_STEP_CAMERA_FIT;
        s->number = 45;
        enum hg_status fov =
            accept(w, "fov") ? take_number(w, "fov", 0.1, 179, &s->number, err) : HG_OK;
        return fov ? fov : take_lens(w, c, err);
    }
    bool orbit = accept(w, "orbit");
    if (!orbit && !accept(w, "eye"))
        return wrong(err, "orbit, eye, node or fit is missing");
    enum hg_status status = take_numbers(w, orbit ? "orbit" : "eye", 3, place, err);
    if (!status)
        status = take_target_and_fov(w, target, c, err);
    if (!status)
        status = take_lens(w, c, err);
    if (status)
        return status;
    if (orbit && place[2] < 0)
        return wrong(err, "the radius is negative");
    if (orbit) {
        helio_camera_orbit(place[0], place[1], place[2], target, c);
        return HG_OK;
    }
    if (memcmp(place, target, sizeof place) == 0)
        return wrong(err, "eye and target are the same point");
    c->has_eye = c->has_target = true;
    for (int i = 0; i < 3; i++) {
        c->eye[i] = (float)place[i];
        c->target[i] = (float)target[i];
    }
    return HG_OK;
}

static enum hg_status parse_connect(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    (void)err;
    *w->told = (struct told){0};
    s->kind = HG_CLI_STEP_CONNECT;
    s->path = w->next < w->count ? w->at[w->next++] : NULL;
    return HG_OK;
}

static enum hg_status parse_load(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_LOAD;
    enum hg_status status = take(w, "path", &s->path, err);
    return status ? status : take_asset(w, s, err);
}

static enum hg_status parse_time(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_TIME;
    enum hg_status status = take_number(w, "time", 0, 1e12, &s->number, err);
    return status ? status : take_asset(w, s, err);
}

static enum hg_status parse_frame(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_FRAME;
    enum hg_status status = take(w, "file to write", &s->path, err);
    s->now = !status && accept(w, "now");
    return status;
}

static enum hg_status parse_wait(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_FRAME;
    return accept(w, "settled") ? HG_OK : wrong(err, "'settled' is missing");
}

// ---- expect ------------------------------------------------------------------------------------

static const char *const op_texts[] = {">=", "<=", ">", "<", "==", "!="};

static enum hg_status take_comparison(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    enum hg_status status = take(w, "a comparison such as >=", &text, err);
    if (status)
        return status;
    for (int i = 0; i < 6; i++)
        if (strcmp(text, op_texts[i]) == 0) {
            s->op = (enum hg_cli_op)i;
            return take_number(w, "number", -1e300, 1e300, &s->number, err);
        }
    return wrong(err, "'%s' is none of >= <= > < == !=", text);
}

static enum hg_status parse_pick(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_EXPECT_PICK;
    enum hg_status status = take_u32(w, "x", 0, 16383, &s->x, err);
    if (!status)
        status = take_u32(w, "y", 0, 16383, &s->y, err);
    if (status || accept(w, "nothing"))
        return status;
    if (!accept(w, "node"))
        return wrong(err, "'node NAME' or 'nothing' is missing");
    return take(w, "node name", &s->name, err);
}

static enum hg_status parse_expect(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *what;
    uint32_t metric;
    enum hg_status status = take(w, "what to expect", &what, err);
    if (status)
        return status;
    if (strcmp(what, "pick") == 0)
        return parse_pick(w, s, err);
    if (strcmp(what, "hash") == 0) {
        s->kind = HG_CLI_STEP_EXPECT_HASH;
        status = take(w, "hash", &s->name, err);
        if (!status && (strlen(s->name) != 64 || strspn(s->name, "0123456789abcdef") != 64))
            status = wrong(err, "'%s' is not 64 lower-case hexadecimal digits", s->name);
        return status;
    }
    if (strcmp(what, "stat") == 0) {
        s->kind = HG_CLI_STEP_EXPECT_STAT;
        status = take(w, "key", &s->name, err);
        return status ? status : take_comparison(w, s, err);
    }
    if (!hgp_enum_value("metric", what, &metric))
        return wrong(err, "'%s' is none of psnr ssim flip rmse max stat pick hash", what);
    s->kind = HG_CLI_STEP_EXPECT_IMAGE;
    s->metric = (enum hgp_metric)metric;
    status = take(w, "image file", &s->path, err);
    return status ? status : take_comparison(w, s, err);
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

static enum hg_status parse_words(struct words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const struct {
        const char *verb;
        enum hg_status (*parse)(struct words *, struct hg_cli_step *, struct hg_error *);
    } verbs[] = {{"connect", parse_connect}, {"load", parse_load}, {"set", parse_set},
        {"camera", parse_camera}, {"time", parse_time}, {"at", parse_time}, {"frame", parse_frame},
        {"wait", parse_wait}, {"expect", parse_expect}};
    for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++) {
        if (!accept(w, verbs[i].verb))
            continue;
        enum hg_status status = verbs[i].parse(w, s, err);
        if (!status && w->next < w->count)
            status = wrong(err, "'%s' is one word too many", w->at[w->next]);
        return status;
    }
    return wrong(err, "unknown command '%s'", w->at[0]);
}

static enum hg_status parse_line(struct hg_cli_script *script, struct words *w, const char *line,
    uint32_t number, struct hg_error *err)
{
    enum hg_status status = split(w, line, err);
    if (status || w->count == 0)
        return status;
    if (hg_grow(&script->steps, &script->capacity, script->count + 1, sizeof *script->steps))
        return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory for the script");
    struct hg_cli_step *s = &script->steps[script->count];
    *s = (struct hg_cli_step){.line = number};
    const char *begin = line + strspn(line, " \t");
    s->text = hg_arena_strndup(&script->arena, begin, strlen(begin));
    status = s->text ? parse_words(w, s, err) : HG_E_NOMEM;
    script->count += !status;
    return status;
}

enum hg_status hg_cli_script_parse(const char *file, const char *text, hg_cli_variable_fn *variable,
    void *user, struct hg_cli_script *out, struct hg_error *err)
{
    char line[LINE_BYTES], place[256];
    struct hg_error inner = {0};
    enum hg_status status = HG_OK;
    struct told told = {0};
    *out = (struct hg_cli_script){0};
    uint32_t number = 0;
    for (const char *at = text; *at && !status;) {
        size_t length = strcspn(at, "\n");
        number++;
        if (length >= sizeof line) {
            status = wrong(&inner, "the line is too long");
            break;
        }
        snprintf(line, sizeof line, "%.*s", (int)length, at);
        size_t end = strlen(line);
        if (end && line[end - 1] == '\r')
            line[end - 1] = 0;
        struct words w = {.arena = &out->arena, .variable = variable, .user = user, .told = &told};
        status = parse_line(out, &w, line, number, &inner);
        at += length + (at[length] == '\n');
    }
    if (!status)
        return HG_OK;
    hg_cli_script_finish(out);
    snprintf(place, sizeof place, "%.200s:%u", file, number);
    return hg_error_set(err, status, place, NULL, "%s", inner.reason);
}

void hg_cli_script_finish(struct hg_cli_script *script)
{
    hg_arena_finish(&script->arena);
    hg_free(script->steps);
    *script = (struct hg_cli_script){0};
}
