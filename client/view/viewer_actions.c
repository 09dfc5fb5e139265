// viewer_actions.c - what the viewer's actions do.
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "client/cli/cli.h"
#include "client/view/viewer.h"

static const double pi = 3.14159265358979323846;

void hg_viewer_ask(struct hg_viewer *v, const struct hg_view_request *request)
{
    if (!hg_view_session_ask(v->session, request))
        hg_viewer_say(v, "the server does not answer: not done");
}

static void set_view(struct hg_viewer *v, const struct hgp_view_set *view)
{
    const struct hg_view_request request = {.ask = HG_VIEW_ASK_SET, .view = *view};
    hg_viewer_ask(v, &request);
}

bool hg_viewer_may_edit(struct hg_viewer *v)
{
    if (!v->status.may_edit)
        hg_viewer_say(v, "this session may look, not change the scene");
    return v->status.may_edit;
}

static uint32_t side(int px)
{
    return (uint32_t)(px < 16 ? 16 : px > 16384 ? 16384 : px);
}

// Setting what the view has already would begin a new picture, and void questions about the old
// one.
void hg_viewer_send_size(struct hg_viewer *v)
{
    const struct hg_cli_size size = {side(v->width), side(v->height)};
    if (size.width == v->choice.size.width && size.height == v->choice.size.height)
        return;
    v->choice.size = size;
    set_view(
        v, &(struct hgp_view_set){
               .has_width = true, .width = size.width, .has_height = true, .height = size.height});
}

void hg_viewer_begin_scene(struct hg_viewer *v)
{
    const struct hg_cli_options *o = v->o;
    const struct hgp_view_camera *camera = &v->scene->camera;
    v->choice = (struct hg_viewer_choice){.path = o->mode && strcmp(o->mode, "path") == 0,
        .ground = o->ground,
        .background = HGP_background_ENV,
        .light = HGP_environment_kind_AUTO,
        .rotation_deg = o->env_rotation,
        .exposure_ev = o->has_exposure ? o->exposure.ev : 0,
        .camera = -1,
        .size =
            o->has_size ? o->size : (struct hg_cli_size){HGP_STANDARD_width, HGP_STANDARD_height}};
    v->clock = (struct hg_viewer_clock){0};
    v->measured.newest_seq = 0;
    hg_navigate_set_size(&v->navigate, v->scene->radius);
    if (camera->has_eye && camera->has_target)
        hg_navigate_look(&v->navigate, camera->eye, camera->target, camera);
    for (uint32_t i = 0; camera->has_camera && i < v->scene->camera_count; i++)
        if (v->scene->cameras[i].id == camera->camera)
            v->choice.camera = (int32_t)i;
    hg_viewer_reset_panels(v);
    hg_viewer_send_size(v);
}

// ---- cameras -----------------------------------------------------------------------------------

static void set_style(struct hg_viewer *v, enum hg_navigate_style style)
{
    v->navigate.style = style;
}

static void choose_camera(struct hg_viewer *v, int step)
{
    const int32_t count = (int32_t)v->scene->camera_count;
    if (count == 0) {
        hg_viewer_say(v, "the scene has no cameras");
        return;
    }
    v->choice.camera = v->choice.camera < 0 ? (step > 0 ? 0 : count - 1)
                                            : (v->choice.camera + step + count) % count;
    const struct hg_view_name *name = &v->scene->cameras[v->choice.camera];
    hg_viewer_ask(v, &(struct hg_view_request){.ask = HG_VIEW_ASK_NODE, .node = name->id});
    hg_viewer_say(v, "camera %s", name->text);
}

static void go_to_start(struct hg_viewer *v)
{
    const struct hgp_view_camera *camera = &v->scene->camera;
    if (!camera->has_eye)
        return;
    hg_navigate_look(&v->navigate, camera->eye, camera->target, camera);
    hg_viewer_send_camera(v);
}

// ---- the picture -------------------------------------------------------------------------------

static void choose_mode(struct hg_viewer *v)
{
    v->choice.path = !v->choice.path;
    set_view(v, &(struct hgp_view_set){.has_mode = true,
                    .mode = v->choice.path ? HGP_render_mode_PATH : HGP_render_mode_REALTIME});
    hg_viewer_say(v, "%s", v->choice.path ? "path tracing" : "real time");
}

static void choose_exposure(struct hg_viewer *v, double step)
{
    v->choice.exposure_ev = step == 0 ? 0 : v->choice.exposure_ev + step;
    set_view(v, &(struct hgp_view_set){.has_exposure_mode = true,
                    .exposure_mode = HGP_exposure_mode_AUTO,
                    .has_exposure_ev = true,
                    .exposure_ev = (float)v->choice.exposure_ev});
    hg_viewer_say(v, "exposure auto%+.2f", v->choice.exposure_ev);
}

static void choose_background(struct hg_viewer *v)
{
    static const struct {
        enum hgp_background kind;
        const char *name;
    } kinds[] = {{HGP_background_ENV, "environment"}, {HGP_background_BLUR, "blurred"},
        {HGP_background_NONE, "none"}};
    uint32_t i = 0;
    while (i < 2 && kinds[i].kind != v->choice.background)
        i++;
    i = (i + 1) % 3;
    v->choice.background = kinds[i].kind;
    set_view(v, &(struct hgp_view_set){.has_background = true, .background = kinds[i].kind});
    hg_viewer_say(v, "background %s", kinds[i].name);
}

// The view is another one after each opening of a scene: it begins without.
static void choose_reprojection(struct hg_viewer *v)
{
    v->choice.reprojects = !v->choice.reprojects;
    set_view(v, &(struct hgp_view_set){.has_depth = true, .depth = v->choice.reprojects});
    hg_viewer_say(v, "reprojection between frames %s", v->choice.reprojects ? "on" : "off");
}

static void choose_ground(struct hg_viewer *v)
{
    v->choice.ground = !v->choice.ground;
    set_view(v, &(struct hgp_view_set){.has_ground = true,
                    .ground = v->choice.ground ? HGP_ground_Y : HGP_ground_NONE});
    hg_viewer_say(v, "ground %s", v->choice.ground ? "on" : "off");
}

// ---- the scene ---------------------------------------------------------------------------------

static void choose_variant(struct hg_viewer *v, bool back)
{
    struct hg_view_request request = {.ask = HG_VIEW_ASK_VARIANT};
    const uint32_t count = v->scene->variant_count + 1;
    if (count == 1) {
        hg_viewer_say(v, "the scene has no variants");
        return;
    }
    v->choice.variant = (v->choice.variant + (back ? count - 1 : 1)) % count;
    const char *name = v->choice.variant ? v->scene->variants[v->choice.variant - 1].text : "";
    snprintf(request.text, sizeof request.text, "%s", name);
    hg_viewer_ask(v, &request);
    hg_viewer_say(v, "variant %s", *name ? name : "of the file");
}

static void choose_light(struct hg_viewer *v)
{
    static const struct {
        enum hgp_environment_kind kind;
        const char *name;
    } kinds[] = {{HGP_environment_kind_AUTO, "auto"}, {HGP_environment_kind_SKY, "sky"},
        {HGP_environment_kind_NONE, "none"}};
    uint32_t i = 0;
    if (!hg_viewer_may_edit(v))
        return;
    while (i < 2 && kinds[i].kind != v->choice.light)
        i++;
    i = (i + 1) % 3;
    v->choice.light = kinds[i].kind;
    hg_viewer_ask(v, &(struct hg_view_request){.ask = HG_VIEW_ASK_ENVIRONMENT,
                         .environment = {.has_kind = true, .kind = kinds[i].kind}});
    hg_viewer_say(v, "environment %s", kinds[i].name);
}

static void rotate_light(struct hg_viewer *v, double degrees)
{
    if (!hg_viewer_may_edit(v))
        return;
    v->choice.rotation_deg = remainder(v->choice.rotation_deg + degrees, 360);
    hg_viewer_ask(v, &(struct hg_view_request){.ask = HG_VIEW_ASK_ENVIRONMENT,
                         .environment = {.has_rotation_rad = true,
                             .rotation_rad = (float)(v->choice.rotation_deg * pi / 180)}});
    hg_viewer_say(v, "environment turned by %.0f degrees", v->choice.rotation_deg);
}

static void play(struct hg_viewer *v)
{
    if (v->scene->duration_s <= 0) {
        hg_viewer_say(v, "the scene has no animations");
        return;
    }
    if (!hg_viewer_may_edit(v))
        return;
    v->clock.plays = !v->clock.plays;
    v->clock.before_ns = hg_clock_now_ns();
}

static void step_time(struct hg_viewer *v, double seconds)
{
    if (v->scene->duration_s <= 0 || !hg_viewer_may_edit(v))
        return;
    v->clock.plays = false;
    v->clock.time_s = fmod(v->clock.time_s + seconds + v->scene->duration_s, v->scene->duration_s);
    hg_view_session_pose(v->session, v->clock.time_s);
    hg_viewer_say(v, "%.2f of %.2f s", v->clock.time_s, v->scene->duration_s);
}

// ---- files and the window ----------------------------------------------------------------------

static void shoot(struct hg_viewer *v)
{
    struct hg_view_request request = {.ask = HG_VIEW_ASK_SHOT};
    const uint64_t now_ns = hg_clock_wall_ns();
    const time_t seconds = (time_t)(now_ns / 1000000000);
    struct tm when;
    char stamp[40];
    localtime_r(&seconds, &when);
    strftime(stamp, sizeof stamp, "%Y%m%d-%H%M%S", &when);
    if (snprintf(request.text, sizeof request.text, "%s/helio-%s-%03u.png",
            v->o->shots ? v->o->shots : ".", stamp,
            (unsigned)(now_ns / 1000000 % 1000)) >= (int)sizeof request.text)
        hg_viewer_say(v, "the name of the folder of --screenshots is too long");
    else
        hg_viewer_ask(v, &request);
}

static bool is_full(const struct hg_viewer *v)
{
    return SDL_GetWindowFlags(v->window) & SDL_WINDOW_FULLSCREEN_DESKTOP;
}

static void switch_full(struct hg_viewer *v)
{
    if (SDL_SetWindowFullscreen(v->window, is_full(v) ? 0 : SDL_WINDOW_FULLSCREEN_DESKTOP))
        hg_viewer_say(v, "no full screen: %s", SDL_GetError());
}

static void leave(struct hg_viewer *v)
{
    if (v->help)
        v->help = false;
    else if (hg_viewer_escape(v))
        return;
    else if (is_full(v))
        switch_full(v);
    else
        v->quits = true;
}

// What works without a scene. False: the action is another one.
static bool do_window(struct hg_viewer *v, enum hg_view_action action)
{
    switch (action) {
    case HG_VIEW_DO_HELP:
        v->help = !v->help;
        return true;
    case HG_VIEW_DO_STATISTICS:
        v->statistics = !v->statistics;
        hg_view_session_want_statistics(v->session, v->statistics);
        v->help = false;
        return true;
    case HG_VIEW_DO_FULL_SCREEN:
        switch_full(v);
        return true;
    case HG_VIEW_DO_LEAVE:
        leave(v);
        return true;
    case HG_VIEW_DO_TREE:
        hg_viewer_switch_panel(v, HG_VIEWER_TREE);
        return true;
    case HG_VIEW_DO_CUTS:
        hg_viewer_switch_panel(v, HG_VIEWER_CLIPPING);
        return true;
    case HG_VIEW_DO_MEASURE:
        hg_viewer_switch_measure(v);
        return true;
    case HG_VIEW_DO_RELOAD:
        hg_view_session_open(v->session, NULL);
        return true;
    default:
        return false;
    }
}

// All of the scene from a named side.
static void show_side(struct hg_viewer *v, enum hg_view_action action)
{
    static const char *const names[] = {"front", "right", "back", "left", "top", "bottom", "iso"};
    struct hg_view_request request = {.ask = HG_VIEW_ASK_FIT};
    if (action < HG_VIEW_DO_FRONT || action > HG_VIEW_DO_ISOMETRIC)
        return;
    snprintf(request.text, sizeof request.text, "%s", names[action - HG_VIEW_DO_FRONT]);
    hg_viewer_ask(v, &request);
}

static void do_camera(struct hg_viewer *v, enum hg_view_action action, bool shift)
{
    switch (action) {
    case HG_VIEW_DO_ORBIT:
        set_style(v, HG_NAVIGATE_ORBIT);
        break;
    case HG_VIEW_DO_FLY:
        set_style(v, HG_NAVIGATE_FLY);
        break;
    case HG_VIEW_DO_WALK:
        set_style(v, HG_NAVIGATE_WALK);
        break;
    case HG_VIEW_DO_FIT:
        hg_viewer_ask(v, &(struct hg_view_request){
                             .ask = HG_VIEW_ASK_FIT, .node = shift ? v->panels.tree.selected : 0});
        break;
    case HG_VIEW_DO_START:
        go_to_start(v);
        break;
    case HG_VIEW_DO_CAMERA:
        choose_camera(v, shift ? -1 : 1);
        break;
    default:
        show_side(v, action);
    }
}

static void do_picture(struct hg_viewer *v, enum hg_view_action action, bool shift)
{
    switch (action) {
    case HG_VIEW_DO_MODE:
        choose_mode(v);
        break;
    case HG_VIEW_DO_VARIANT:
        choose_variant(v, shift);
        break;
    case HG_VIEW_DO_PLAY:
        play(v);
        break;
    case HG_VIEW_DO_TIME_BACK:
    case HG_VIEW_DO_TIME_ON:
        step_time(v, action == HG_VIEW_DO_TIME_ON ? 1 / 24.0 : -1 / 24.0);
        break;
    case HG_VIEW_DO_LIGHT:
        choose_light(v);
        break;
    case HG_VIEW_DO_ROTATE:
        rotate_light(v, shift ? -15 : 15);
        break;
    case HG_VIEW_DO_BACKGROUND:
        choose_background(v);
        break;
    case HG_VIEW_DO_REPROJECT:
        choose_reprojection(v);
        break;
    case HG_VIEW_DO_GROUND:
        choose_ground(v);
        break;
    case HG_VIEW_DO_DARKER:
    case HG_VIEW_DO_BRIGHTER:
        choose_exposure(v, action == HG_VIEW_DO_BRIGHTER ? 1 / 3.0 : -1 / 3.0);
        break;
    case HG_VIEW_DO_EXPOSURE:
        choose_exposure(v, 0);
        break;
    case HG_VIEW_DO_SHOT:
        shoot(v);
        break;
    default:
        break;
    }
}

void hg_viewer_do(struct hg_viewer *v, enum hg_view_action action, bool shift)
{
    v->dirty = true;
    if (do_window(v, action) || v->status.state != HG_VIEW_OPEN)
        return;
    do_camera(v, action, shift);
    do_picture(v, action, shift);
}
