// script_set.c - the lines of scripts that begin with `set`.
#include <string.h>

#include "client/cli/render/render.h"
#include "client/cli/run/script.h"
#include "client/cli/run/script_words.h"
#include "client/cli/suggest.h"

static const double pi = 3.14159265358979323846;

static enum hg_status set_size(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_size size;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "size", &text, err);
    if (status)
        return status;
    status = hg_cli_parse_size("size", text, &size, &inner);
    if (status)
        return hg_words_rename_error(&inner, "size", err);
    s->view.has_width = s->view.has_height = true;
    s->view.width = size.width;
    s->view.height = size.height;
    return HG_OK;
}

static enum hg_status set_region(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_region region = {0};
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "region", &text, err);
    if (status)
        return status;
    if (strcmp(text, "none") != 0 && hg_cli_parse_region("region", text, &region, &inner))
        return hg_words_rename_error(&inner, "region", err);
    hg_cli_set_region(&region, &s->view);
    return HG_OK;
}

static enum hg_status set_background(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_background b;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "background", &text, err);
    if (status)
        return status;
    status = hg_cli_parse_background("background", text, &b, &inner);
    if (status)
        return hg_words_rename_error(&inner, "background", err);
    hg_cli_set_background(&b, &s->view);
    return HG_OK;
}

static enum hg_status set_exposure(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_exposure exposure;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "exposure", &text, err);
    if (status)
        return status;
    status = hg_cli_parse_exposure("exposure", text, &exposure, &inner);
    if (status)
        return hg_words_rename_error(&inner, "exposure", err);
    hg_cli_set_exposure(&exposure, &s->view);
    return HG_OK;
}

static enum hg_status set_rotation(
    struct hg_words *w, struct hgp_environment_set *e, struct hg_error *err)
{
    double degrees;
    enum hg_status status = hg_words_take_number(w, "rotation", -36000, 36000, &degrees, err);
    e->has_rotation_rad = !status;
    e->rotation_rad = (float)((double)(float)degrees * pi / 180);
    return status;
}

static enum hg_status set_env_value(
    struct hg_words *w, struct hgp_environment_set *e, struct hg_error *err)
{
    const struct hg_words_fields fields = {HGP_T_environment_set, e};
    if (hg_words_accept(w, "rotation"))
        return set_rotation(w, e, err);
    if (hg_words_accept(w, "sun")) {
        e->has_sun = true;
        e->sun = !hg_words_accept(w, "off");
        return e->sun ? hg_words_take_field(w, "sun", "sun_direction", &fields, err) : HG_OK;
    }
    if (hg_words_accept(w, "intensity"))
        return hg_words_take_field(w, "intensity", "intensity", &fields, err);
    if (hg_words_accept(w, "turbidity"))
        return hg_words_take_field(w, "turbidity", "turbidity", &fields, err);
    return hg_words_error(err, "'%s' is not intensity, rotation, turbidity or sun", w->at[w->next]);
}

static enum hg_status set_env(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hgp_environment_set *e = &s->environment;
    enum hg_status status = hg_words_take(w, "environment", &text, err);
    s->kind = HG_CLI_STEP_ENVIRONMENT;
    e->has_kind = true;
    if (status)
        return status;
    if (strcmp(text, "none") == 0) {
        e->kind = HGP_environment_kind_NONE;
    } else if (strcmp(text, "auto") == 0) {
        e->kind = HGP_environment_kind_AUTO;
    } else if (strcmp(text, "sky") == 0) {
        e->kind = HGP_environment_kind_SKY;
    } else {
        e->kind = HGP_environment_kind_FILE;
        s->path = text;
    }
    while (!status && w->next < w->count)
        status = set_env_value(w, e, err);
    return status;
}

static enum hg_status set_variant(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_VARIANT;
    enum hg_status status = hg_words_take(w, "variant", &s->name, err);
    return status ? status : hg_words_take_asset(w, s, err);
}

// What is set of a thing that has a name: fields of a message.
struct named_fields {
    const char *thing, *missing, *known; // for messages
    const char *const *names;            // ends with NULL
    const char *file;                    // a word that a path follows; NULL: none
};

// One of the fields and its value. *found: it was one of them.
static enum hg_status set_field(struct hg_words *w, const char *const *names,
    const struct hg_words_fields *fields, bool *found, struct hg_error *err)
{
    *found = true;
    for (; *names; names++)
        if (hg_words_accept(w, *names))
            return hg_words_take_field(w, *names, *names, fields, err);
    *found = false;
    return HG_OK;
}

static enum hg_status set_named(struct hg_words *w, struct hg_cli_step *s,
    const struct named_fields *named, const struct hg_words_fields *fields, struct hg_error *err)
{
    bool found = true;
    enum hg_status status = hg_words_take(w, named->thing, &s->name, err);
    if (status)
        return status;
    if (w->next == w->count)
        return hg_words_error(err, "%s is missing", named->missing);
    while (!status && found && w->next < w->count) {
        if (named->file && hg_words_accept(w, named->file))
            status = hg_words_take(w, named->file, &s->path, err);
        else
            status = set_field(w, named->names, fields, &found, err);
    }
    return found ? status : hg_words_error(err, "'%s' is not %s", w->at[w->next], named->known);
}

static enum hg_status set_node(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const char *const names[] = {"translation", "rotation", "scale", "visible",
        "next-translation", "next-rotation", "next-scale", "catches_shadows", "layers", NULL};
    static const struct named_fields named = {"node name",
        "translation, rotation, scale or visible",
        "[next-]translation, rotation, scale, visible, catches_shadows or layers", names, NULL};
    s->kind = HG_CLI_STEP_NODE;
    return set_named(w, s, &named, &(struct hg_words_fields){HGP_T_node_set, &s->node}, err);
}

static enum hg_status set_material(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const char *const names[] = {"base_color", "emissive", "metallic", "roughness",
        "emissive_strength", "normal_scale", "alpha_cutoff", "double_sided", "unlit", "alpha_mode",
        NULL};
    static const struct named_fields named = {
        "material name", "what to set", "a value of materials", names, NULL};
    s->kind = HG_CLI_STEP_MATERIAL;
    return set_named(
        w, s, &named, &(struct hg_words_fields){HGP_T_material_set, &s->material}, err);
}

static enum hg_status set_light(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const char *const names[] = {"kind", "color", "intensity", "range", "inner_cone_rad",
        "outer_cone_rad", "casts_shadow", "radius", "width", "height", "angular_diameter_rad",
        "lumens", "profile_absolute", NULL};
    static const struct named_fields named = {
        "light name", "what to set", "a value of lights", names, "profile"};
    s->kind = HG_CLI_STEP_LIGHT;
    return set_named(w, s, &named, &(struct hg_words_fields){HGP_T_light_set, &s->light}, err);
}

static enum hg_status set_shutter(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const struct hg_words_fields fields = {HGP_T_view_set, &s->view};
    enum hg_status status = hg_words_take_field(w, "shutter", "shutter_open", &fields, err);
    if (status)
        return status;
    status = hg_words_take_field(w, "shutter", "shutter_close", &fields, err);
    if (status)
        return status;
    return s->view.shutter_close < s->view.shutter_open
               ? hg_words_error(err, "shutter closes before it opens")
               : HG_OK;
}

static enum hg_status set_planes(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hg_script_view *told = &w->views->items[w->views->now];
    enum hg_status status = hg_words_take(w, "planes", &told->planes, err);
    if (status)
        return status;
    if (strcmp(told->planes, "none") == 0)
        told->planes = NULL;
    s->view.has_planes = true;
    return HG_OK;
}

// The same list stands for other planes in another mode, and with --denoise.
static enum hg_status follow_planes(
    struct hg_words *w, struct hgp_view_set *view, struct hg_error *err)
{
    struct hg_script_view *told = &w->views->items[w->views->now];
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
        return hg_words_error(err, "aov: a debug view has no planes");
    view->has_planes = true;
    if (hg_cli_parse_planes("aov", told->planes, told->path, &view->planes, &inner))
        return hg_words_rename_error(&inner, "aov", err);
    if (told->path && told->denoise)
        view->planes |= 1u << HGP_plane_NOISY;
    return HG_OK;
}

static void offer(struct hg_suggestion *near, const char *word)
{
    if (word)
        hg_suggest_offer(near, word, strlen(word));
}

enum hg_status hg_script_parse_set(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const struct {
        const char *key;
        enum hg_status (*parse)(struct hg_words *, struct hg_cli_step *, struct hg_error *);
    } keys[] = {{"size", set_size}, {"region", set_region}, {"background", set_background},
        {"exposure", set_exposure}, {"env", set_env}, {"variant", set_variant}, {"node", set_node},
        {"material", set_material}, {"light", set_light}, {"shutter", set_shutter},
        {"aov", set_planes}, {"clip", hg_script_set_clip}, {"override", hg_script_set_override},
        {"view-variant", hg_script_set_view_variant}};
    s->kind = HG_CLI_STEP_VIEW;
    const char *word = w->next < w->count ? w->at[w->next] : "";
    const struct hgp_view_param *param = hgp_view_param_find_word(word);
    if (param) {
        w->next++;
        const struct hg_words_fields fields = {HGP_T_view_set, &s->view};
        enum hg_status status = hg_words_take_field(w, word, param->name, &fields, err);
        return status ? status : follow_planes(w, &s->view, err);
    }
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (!hg_words_accept(w, keys[i].key))
            continue;
        enum hg_status status = keys[i].parse(w, s, err);
        return !status && s->kind == HG_CLI_STEP_VIEW ? follow_planes(w, &s->view, err) : status;
    }
    if (w->next == w->count)
        return hg_words_error(err, "what to set is missing");
    struct hg_suggestion near = hg_suggest_begin(word, strlen(word));
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        offer(&near, keys[i].key);
    for (uint32_t i = 0; i < HGP_VIEW_PARAM_COUNT; i++)
        offer(&near, hgp_view_param_word(&hgp_view_params[i]));
    return hg_words_error(err, "'%s' cannot be set%s%s%s", word,
        near.word[0] ? "; did you mean " : "", near.word, near.word[0] ? "?" : "");
}
