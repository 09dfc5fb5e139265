// view.c - helio render: from its options to the parameters of the view.
#include <stdio.h>
#include <string.h>

#include "client/cli/render/render.h"

bool hg_cli_is_path(const struct hg_cli_options *o)
{
    return o->mode && strcmp(o->mode, "path") == 0;
}

double hg_cli_fps(const struct hg_cli_options *o)
{
    return o->has_fps ? o->fps : 24;
}

static bool is_given(const struct hg_cli_options *o, const struct hg_cli_option_row *row)
{
    return *(const bool *)((const char *)o + row->has_offset);
}

// An option given that says something about path tracing only; NULL: none.
static const char *find_path_option(
    const struct hg_cli_options *o, char name[HG_CLI_OPTION_TEXT_BYTES])
{
    for (uint32_t i = 0; i < hg_cli_option_count; i++) {
        const struct hg_cli_option_row *row = &hg_cli_option_rows[i];
        if (!row->param || !row->param->path_only || !is_given(o, row))
            continue;
        snprintf(name, HG_CLI_OPTION_TEXT_BYTES, "--%s", row->name);
        return name;
    }
    const bool planes = o->has_aov; // of motion, which the next place of a camera counts for
    return o->has_denoise                  ? "--denoise"
           : o->has_lens_radius            ? "--lens-radius"
           : o->has_focus                  ? "--focus"
           : o->has_shutter                ? "--shutter"
           : o->has_catcher                ? "--catcher"
           : o->has_next_eye && !planes    ? "--next-eye"
           : o->has_next_target && !planes ? "--next-target"
           : o->has_resume                 ? "--resume"
           : o->has_checkpoint             ? "--checkpoint"
                                           : NULL;
}

enum hg_status hg_cli_check_mode(const struct hg_cli_options *o, struct hg_error *err)
{
    char text[HG_CLI_OPTION_TEXT_BYTES];
    const char *name = hg_cli_is_path(o) ? NULL : find_path_option(o, text);
    return name ? hg_error_set(err, HG_E_INVAL, name, NULL, "needs --mode path") : HG_OK;
}

void hg_cli_set_region(const struct hg_cli_region *region, struct hgp_view_set *view)
{
    view->has_region = true;
    view->region[0] = (float)region->x;
    view->region[1] = (float)region->y;
    view->region[2] = (float)region->width;
    view->region[3] = (float)region->height;
}

void hg_cli_set_background(const struct hg_cli_background *background, struct hgp_view_set *view)
{
    static const enum hgp_background kinds[] = {[HG_CLI_BACKGROUND_ENV] = HGP_background_ENV,
        [HG_CLI_BACKGROUND_NONE] = HGP_background_NONE,
        [HG_CLI_BACKGROUND_COLOR] = HGP_background_COLOR,
        [HG_CLI_BACKGROUND_BLUR] = HGP_background_BLUR,
        [HG_CLI_BACKGROUND_DISPLAY] = HGP_background_DISPLAY};
    view->has_background = true;
    view->background = kinds[background->kind];
    view->has_background_color = background->kind == HG_CLI_BACKGROUND_COLOR ||
                                 background->kind == HG_CLI_BACKGROUND_DISPLAY;
    for (int i = 0; i < 3; i++)
        view->background_color[i] = (float)background->color[i];
}

void hg_cli_set_exposure(const struct hg_cli_exposure *exposure, struct hgp_view_set *view)
{
    view->has_exposure_mode = view->has_exposure_ev = true;
    view->exposure_mode = exposure->automatic ? HGP_exposure_mode_AUTO
                          : exposure->camera  ? HGP_exposure_mode_CAMERA
                                              : HGP_exposure_mode_FIXED;
    view->exposure_ev = (float)exposure->ev;
}

bool hg_cli_is_linear(enum hgp_encoding encoding)
{
    return encoding == HGP_encoding_EXR_HALF || encoding == HGP_encoding_EXR_FLOAT;
}

static struct hg_cli_exposure exposure_of(const struct hg_cli_render *r)
{
    const bool linear = hg_cli_is_linear(r->format.encoding);
    const bool camera = r->o->has_f_number || r->o->has_shutter_s || r->o->has_iso;
    return r->o->has_exposure
               ? r->o->exposure
               : (struct hg_cli_exposure){.automatic = !linear && !camera, .camera = camera};
}

bool hg_cli_meters_exposure(const struct hg_cli_render *r)
{
    return exposure_of(r).automatic;
}

// Parameters that an option sets alone.
#define VALUE_U32(field)    o->field
#define VALUE_F64(field)    (float)o->field
#define VALUE_CHOICE(field) choice(HGP_VIEW_##field, o->field)

static uint32_t choice(enum hgp_view_param_index param, const char *text)
{
    uint32_t value = 0;
    if (text)
        (void)hgp_enum_value(hgp_view_params[param].values, text, &value);
    return value;
}

static void set_simple(const struct hg_cli_options *o, struct hgp_view_set *view)
{
#define HGP_VIEW_OPTION(field, kind, name, argument, least)                                        \
    view->has_##field = o->has_##field;                                                            \
    view->field = VALUE_##kind(field);
#include "protocol/view_params.def"
    if (o->has_spp && !o->has_samples) {
        view->has_samples = true;
        view->samples = o->spp;
    }
}

static bool is_animation(const struct hg_cli_render *r)
{
    return r->list.count > 1;
}

float hg_cli_series_s(const struct hg_cli_render *r, uint32_t index)
{
    const struct hg_cli_frame_numbers *list = &r->list;
    const uint32_t i = index > 0 ? index : 1;
    const int32_t step = list->count > 1 ? list->numbers[i] - list->numbers[i - 1] : 1;
    return (float)(step / hg_cli_fps(r->o));
}

// Frame times, shutter and the time between the pictures of a series.
static void set_times(const struct hg_cli_render *r, struct hgp_view_set *view)
{
    const struct hg_cli_options *o = r->o;
    const double fps = hg_cli_fps(o);
    view->has_frame_s = o->has_shutter || o->has_shutter_s || (r->planes >> HGP_plane_MOTION & 1);
    view->frame_s = (float)(1 / fps);
    view->has_shutter_open = view->has_shutter_close = o->has_shutter;
    view->shutter_open = r->shutter[0];
    view->shutter_close = r->shutter[1];
    view->has_series_s = o->denoise && is_animation(r);
    view->series_s = hg_cli_series_s(r, 0);
}

void hg_cli_render_view(const struct hg_cli_render *r, struct hgp_view_set *view)
{
    const struct hg_cli_options *o = r->o;
    *view = (struct hgp_view_set){
        .view = HG_CLI_VIEW,
        .has_width = true,
        .width = r->size.width,
        .has_height = true,
        .height = r->size.height,
        .has_still_encoding = true,
        .still_encoding = r->format.encoding,
        .has_quality = true,
        .quality = r->format.quality,
        .has_denoise = o->denoise,
        .denoise = is_animation(r) ? HGP_denoise_ANIMATION : HGP_denoise_STILL,
        .has_planes = r->planes != 0,
        .planes = r->planes,
    };
    set_simple(o, view);
    set_times(r, view);
    const struct hg_cli_exposure exposure = exposure_of(r);
    hg_cli_set_exposure(&exposure, view);
    view->has_ground = o->ground;
    view->ground = HGP_ground_Y;
    if (o->has_region)
        hg_cli_set_region(&o->region, view);
    if (o->has_background)
        hg_cli_set_background(&o->background, view);
}
