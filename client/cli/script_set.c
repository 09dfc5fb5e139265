// script_set.c - the lines of scripts that begin with `set`.
#include <string.h>

#include "client/cli/render.h"
#include "client/cli/script.h"
#include "client/cli/script_words.h"

static const double pi = 3.14159265358979323846;

static enum hg_status set_size(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_size size;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "size", &text, err);
    if (!status)
        status = hg_words_rename_error(
            hg_cli_parse_size("size", text, &size, &inner), &inner, "size", err);
    if (status)
        return status;
    s->view.has_width = s->view.has_height = true;
    s->view.width = size.width;
    s->view.height = size.height;
    return HG_OK;
}

static enum hg_status set_background(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    const char *text;
    struct hg_cli_background b;
    struct hg_error inner = {0};
    enum hg_status status = hg_words_take(w, "background", &text, err);
    if (!status)
        status = hg_words_rename_error(
            hg_cli_parse_background("background", text, &b, &inner), &inner, "background", err);
    if (status)
        return status;
    hg_cli_set_background(&b, &s->view);
    return HG_OK;
}

// A parameter of view_set that a word sets alone, by the table of view parameters.
static enum hg_status set_param(struct hg_words *w, const char *word,
    const struct hgp_view_param *param, struct hgp_view_set *view, struct hg_error *err)
{
    const struct hgp_field *field = hgp_view_param_field(param);
    void *value = (char *)view + field->offset;
    bool *has = (bool *)((char *)view + field->has_offset);
    enum hg_status status;
    if (param->kind == HGP_K_ENUM)
        status = hg_words_take_enum(w, param->values, value, err);
    else if (param->kind == HGP_K_U32)
        status =
            hg_words_take_u32(w, word, (uint32_t)param->least, (uint32_t)param->most, value, err);
    else
        return hg_words_take_f32(w, word, param->least, param->most, value, has, err);
    *has = !status;
    return status;
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
    } else if (strcmp(text, "sky") == 0) {
        e->kind = HGP_environment_kind_SKY;
    } else {
        e->kind = HGP_environment_kind_FILE;
        s->path = text;
    }
    while (!status && w->next < w->count) {
        if (hg_words_accept(w, "intensity"))
            status =
                hg_words_take_f32(w, "intensity", 0, 1e9, &e->intensity, &e->has_intensity, err);
        else if (hg_words_accept(w, "rotation")) {
            status = hg_words_take_f32(
                w, "rotation", -36000, 36000, &e->rotation_rad, &e->has_rotation_rad, err);
            e->rotation_rad = (float)(e->rotation_rad * pi / 180);
        } else if (hg_words_accept(w, "turbidity"))
            status =
                hg_words_take_f32(w, "turbidity", 1, 10, &e->turbidity, &e->has_turbidity, err);
        else if (hg_words_accept(w, "sun"))
            status =
                hg_words_take_floats(w, "sun", 3, e->sun_direction, &e->has_sun_direction, err);
        else
            status = hg_words_error(
                err, "'%s' is not intensity, rotation, turbidity or sun", w->at[w->next]);
    }
    return status;
}

static enum hg_status set_variant(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_VARIANT;
    enum hg_status status = hg_words_take(w, "variant", &s->name, err);
    return status ? status : hg_words_take_asset(w, s, err);
}

static enum hg_status set_node(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_node_set *n = &s->node;
    s->kind = HG_CLI_STEP_NODE;
    enum hg_status status = hg_words_take(w, "node name", &s->name, err);
    if (!status && w->next == w->count)
        status = hg_words_error(err, "translation, rotation, scale or visible is missing");
    while (!status && w->next < w->count) {
        if (hg_words_accept(w, "translation"))
            status =
                hg_words_take_floats(w, "translation", 3, n->translation, &n->has_translation, err);
        else if (hg_words_accept(w, "rotation"))
            status = hg_words_take_floats(w, "rotation", 4, n->rotation, &n->has_rotation, err);
        else if (hg_words_accept(w, "scale"))
            status = hg_words_take_floats(w, "scale", 3, n->scale, &n->has_scale, err);
        else if (hg_words_accept(w, "visible"))
            status = hg_words_take_bool(w, "visible", &n->visible, &n->has_visible, err);
        else if (hg_words_accept(w, "next-translation"))
            status = hg_words_take_floats(
                w, "next-translation", 3, n->next_translation, &n->has_next_translation, err);
        else if (hg_words_accept(w, "next-rotation"))
            status = hg_words_take_floats(
                w, "next-rotation", 4, n->next_rotation, &n->has_next_rotation, err);
        else if (hg_words_accept(w, "next-scale"))
            status =
                hg_words_take_floats(w, "next-scale", 3, n->next_scale, &n->has_next_scale, err);
        else if (hg_words_accept(w, "catches_shadows"))
            status = hg_words_take_bool(
                w, "catches_shadows", &n->catches_shadows, &n->has_catches_shadows, err);
        else
            status = hg_words_error(err,
                "'%s' is not [next-]translation, rotation, scale, visible or catches_shadows",
                w->at[w->next]);
    }
    return status;
}

static enum hg_status set_material_value(
    struct hg_words *w, struct hgp_material_set *m, struct hg_error *err)
{
    if (hg_words_accept(w, "base_color"))
        return hg_words_take_floats(w, "base_color", 4, m->base_color, &m->has_base_color, err);
    if (hg_words_accept(w, "emissive"))
        return hg_words_take_floats(w, "emissive", 3, m->emissive, &m->has_emissive, err);
    if (hg_words_accept(w, "metallic"))
        return hg_words_take_f32(w, "metallic", 0, 1, &m->metallic, &m->has_metallic, err);
    if (hg_words_accept(w, "roughness"))
        return hg_words_take_f32(w, "roughness", 0, 1, &m->roughness, &m->has_roughness, err);
    if (hg_words_accept(w, "emissive_strength"))
        return hg_words_take_f32(
            w, "emissive_strength", 0, 1e9, &m->emissive_strength, &m->has_emissive_strength, err);
    if (hg_words_accept(w, "normal_scale"))
        return hg_words_take_f32(
            w, "normal_scale", -1000, 1000, &m->normal_scale, &m->has_normal_scale, err);
    if (hg_words_accept(w, "alpha_cutoff"))
        return hg_words_take_f32(
            w, "alpha_cutoff", 0, 1e9, &m->alpha_cutoff, &m->has_alpha_cutoff, err);
    if (hg_words_accept(w, "double_sided"))
        return hg_words_take_bool(w, "double_sided", &m->double_sided, &m->has_double_sided, err);
    if (hg_words_accept(w, "unlit"))
        return hg_words_take_bool(w, "unlit", &m->unlit, &m->has_unlit, err);
    if (hg_words_accept(w, "alpha_mode")) {
        uint32_t mode = 0;
        enum hg_status status = hg_words_take_enum(w, "alpha_mode", &mode, err);
        m->alpha_mode = (enum hgp_alpha_mode)mode;
        m->has_alpha_mode = !status;
        return status;
    }
    return hg_words_error(err, "'%s' is not a value of materials", w->at[w->next]);
}

static enum hg_status set_material(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_MATERIAL;
    enum hg_status status = hg_words_take(w, "material name", &s->name, err);
    if (!status && w->next == w->count)
        status = hg_words_error(err, "what to set is missing");
    while (!status && w->next < w->count)
        status = set_material_value(w, &s->material, err);
    return status;
}
static enum hg_status set_shutter(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_view_set *v = &s->view;
    enum hg_status status =
        hg_words_take_f32(w, "shutter", -1, 1, &v->shutter_open, &v->has_shutter_open, err);
    if (!status)
        status =
            hg_words_take_f32(w, "shutter", -1, 1, &v->shutter_close, &v->has_shutter_close, err);
    return !status && v->shutter_close < v->shutter_open
               ? hg_words_error(err, "shutter closes before it opens")
               : status;
}

static enum hg_status set_planes(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status = hg_words_take(w, "planes", &w->view->planes, err);
    if (!status && strcmp(w->view->planes, "none") == 0)
        w->view->planes = NULL;
    s->view.has_planes = true;
    return status;
}

// The same list stands for other planes in another mode, and with --denoise.
static enum hg_status follow_planes(
    struct hg_words *w, struct hgp_view_set *view, struct hg_error *err)
{
    struct hg_script_view *told = w->view;
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
    enum hg_status status =
        hg_cli_parse_planes("aov", told->planes, told->path, &view->planes, &inner);
    view->has_planes = true;
    if (told->path && told->denoise)
        view->planes |= 1u << HGP_plane_NOISY;
    return hg_words_rename_error(status, &inner, "aov", err);
}

enum hg_status hg_script_parse_set(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const struct {
        const char *key;
        enum hg_status (*parse)(struct hg_words *, struct hg_cli_step *, struct hg_error *);
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
        if (!hg_words_accept(w, keys[i].key))
            continue;
        enum hg_status status = keys[i].parse(w, s, err);
        return !status && s->kind == HG_CLI_STEP_VIEW ? follow_planes(w, &s->view, err) : status;
    }
    if (w->next == w->count)
        return hg_words_error(err, "what to set is missing");
    return hg_words_error(err, "'%s' cannot be set", w->at[w->next]);
}
