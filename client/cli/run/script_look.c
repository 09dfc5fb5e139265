// script_look.c - lines of scripts about how the view shows the scene: set clip, set override, set
// view-variant, expect seen, expect distance.
#include <string.h>

#include "client/cli/run/script_words.h"

enum { PLANES_MOST = 6 };

// ---- clipping planes ---------------------------------------------------------------------------

static enum hg_status take_color(
    struct hg_words *w, const char *what, float color[3], struct hg_error *err)
{
    double values[3];
    const enum hg_status status = hg_words_take_numbers(w, what, 3, values, err);
    for (int i = 0; i < 3 && !status; i++) {
        if (!(values[i] >= 0 && values[i] <= 1))
            return hg_words_error(err, "%s: %g is outside of 0..1", what, values[i]);
        color[i] = (float)values[i];
    }
    return status;
}

// material | none | color R,G,B | hatch R,G,B [PX]
static enum hg_status take_caps(
    struct hg_words *w, struct hgp_view_clip *clip, struct hg_error *err)
{
    const char *style;
    uint32_t value;
    double px;
    enum hg_status status = hg_words_take(w, "style of caps", &style, err);
    if (status)
        return status;
    if (!hgp_enum_value("cap_style", style, &value))
        return hg_words_error(err, "'%s' is none of material color hatch none", style);
    clip->has_caps = true;
    clip->caps = (enum hgp_cap_style)value;
    if (clip->caps == HGP_cap_style_COLOR || clip->caps == HGP_cap_style_HATCH) {
        status = take_color(w, "colour of caps", clip->cap_color, err);
        clip->has_cap_color = !status;
    }
    if (status || clip->caps != HGP_cap_style_HATCH || w->next == w->count)
        return status;
    status = hg_words_take_number(w, "distance of lines", 2, 256, &px, err);
    clip->has_hatch_px = !status;
    clip->hatch_px = (float)px;
    return status;
}

enum hg_status hg_script_set_clip(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_clip_plane *planes = hg_arena_alloc(w->arena, PLANES_MOST, sizeof *planes);
    s->kind = HG_CLI_STEP_CLIP;
    s->clip = (struct hgp_view_clip){0};
    if (!planes)
        return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory for the script");
    s->clip.planes.items = planes;
    if (hg_words_accept(w, "none"))
        return HG_OK;
    while (w->next < w->count) {
        double v[4];
        if (hg_words_accept(w, "caps"))
            return take_caps(w, &s->clip, err);
        if (s->clip.planes.count == PLANES_MOST)
            return hg_words_error(err, "more than %d planes", PLANES_MOST);
        enum hg_status status = hg_words_take_numbers(w, "normal of the plane", 3, v, err);
        if (!status)
            status = hg_words_take_number(w, "distance of the plane", -1e9, 1e9, &v[3], err);
        if (status)
            return status;
        planes[s->clip.planes.count++] =
            (struct hgp_clip_plane){{(float)v[0], (float)v[1], (float)v[2]}, (float)v[3]};
    }
    return s->clip.planes.count ? HG_OK
                                : hg_words_error(err, "'none' or a plane NX,NY,NZ D is missing");
}

// ---- overrides ---------------------------------------------------------------------------------

static enum hg_status take_answer(
    struct hg_words *w, const char *what, bool *out, struct hg_error *err)
{
    *out = hg_words_accept(w, "yes") || hg_words_accept(w, "true");
    return *out || hg_words_accept(w, "no") || hg_words_accept(w, "false")
               ? HG_OK
               : hg_words_error(err, "%s: yes or no is missing", what);
}

static enum hg_status take_property(
    struct hg_words *w, struct hgp_node_override *o, struct hg_error *err)
{
    double v[4];
    enum hg_status status;
    if (hg_words_accept(w, "hidden")) {
        o->set |= 1;
        return take_answer(w, "hidden", &o->hidden, err);
    }
    if (hg_words_accept(w, "selected")) {
        o->set |= 4;
        return take_answer(w, "selected", &o->selected, err);
    }
    if (hg_words_accept(w, "alpha")) {
        status = hg_words_take_number(w, "alpha", 0, 1, v, err);
        o->set |= 8;
        o->alpha = (float)v[0];
        return status;
    }
    if (!hg_words_accept(w, "tint"))
        return hg_words_error(err, "'%s' is none of hidden selected tint alpha", w->at[w->next]);
    status = take_color(w, "tint", o->tint, err);
    if (!status)
        status = hg_words_take_number(w, "strength of the tint", 0, 1, &v[3], err);
    o->set |= 2;
    o->tint[3] = (float)v[3];
    return status;
}

enum hg_status hg_script_set_override(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_OVERRIDE;
    s->override = (struct hgp_node_override){0};
    if (hg_words_accept(w, "none"))
        return HG_OK; // without a name: all of them go
    enum hg_status status = hg_words_take(w, "node name", &s->name, err);
    if (status || hg_words_accept(w, "none"))
        return status;
    if (w->next == w->count)
        return hg_words_error(err, "hidden, selected, tint, alpha or none is missing");
    while (!status && w->next < w->count)
        status = take_property(w, &s->override, err);
    return status;
}

enum hg_status hg_script_set_view_variant(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    s->kind = HG_CLI_STEP_VIEW_VARIANT;
    const enum hg_status status = hg_words_take(w, "variant", &s->name, err);
    return status ? status : hg_words_take_asset(w, s, err);
}

// ---- expectations ------------------------------------------------------------------------------

enum hg_status hg_script_expect_seen(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const char *const names[4] = {"x", "y", "width", "height"};
    uint32_t *const to[4] = {&s->x, &s->y, &s->width, &s->height};
    s->kind = HG_CLI_STEP_EXPECT_SEEN;
    for (int i = 0; i < 4; i++) {
        const enum hg_status status =
            hg_words_take_u32(w, names[i], i < 2 ? 0 : 1, i < 2 ? 16383 : 16384, to[i], err);
        if (status)
            return status;
    }
    if (!hg_words_accept(w, "node"))
        return hg_words_error(err, "'node NAME' is missing");
    return hg_words_take(w, "node name", &s->name, err);
}

enum hg_status hg_script_expect_distance(
    struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    static const char *const names[4] = {
        "x of the first", "y of the first", "x of the second", "y of the second"};
    uint32_t *const to[4] = {&s->x, &s->y, &s->width, &s->height};
    s->kind = HG_CLI_STEP_EXPECT_DISTANCE;
    for (int i = 0; i < 4; i++) {
        const enum hg_status status = hg_words_take_u32(w, names[i], 0, 16383, to[i], err);
        if (status)
            return status;
    }
    return HG_OK;
}
