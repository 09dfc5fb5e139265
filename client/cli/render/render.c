// render.c - helio render: its arguments, the scene and the view. What is written: frames.c.
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/render/frames.h"
#include "client/cli/render/render.h"

static const double pi = 3.14159265358979323846;

// ---- arguments ---------------------------------------------------------------------------------

static enum hg_status usage(struct hg_error *err, const char *option, const char *reason)
{
    return hg_error_set(err, HG_E_INVAL, option, NULL, "%s", reason);
}

static bool is_fit(const struct hg_cli_options *o)
{
    return o->has_camera && strcmp(o->camera, "fit") == 0;
}

static enum hg_status check_camera(const struct hg_cli_options *o, struct hg_error *err)
{
    if (o->has_camera && (o->has_orbit || o->has_eye || o->has_target))
        return usage(err, "--camera", "cannot be combined with --orbit, --eye or --target");
    if (o->has_camera && !is_fit(o) && o->has_fov)
        return usage(err, "--camera", "cannot be combined with --fov, unless it is fit");
    if (o->has_view && ((o->has_camera && !is_fit(o)) || o->has_orbit || o->has_eye))
        return usage(err, "--view", "cannot be combined with --orbit, --eye or a camera by name");
    if (o->has_orbit && o->has_eye)
        return usage(err, "--orbit", "cannot be combined with --eye");
    if (o->has_target && !o->has_orbit && !o->has_eye)
        return usage(err, "--target", "needs --orbit or --eye");
    if (o->has_eye && memcmp(&o->eye, &o->target, sizeof o->eye) == 0)
        return usage(err, "--eye", "and --target are the same point");
    if ((o->has_next_eye || o->has_next_target) && !o->has_eye)
        return usage(err, o->has_next_eye ? "--next-eye" : "--next-target", "needs --eye");
    if (o->has_focus && !o->has_lens_radius && !o->has_sensor_mm)
        return usage(err, "--focus", "needs --lens-radius, or --f-number and --sensor-height");
    if (o->has_orbit && o->orbit.v[2] < 0)
        return usage(err, "--orbit", "the radius is negative");
    return HG_OK;
}

static enum hg_status check_region(const struct hg_cli_options *o, struct hg_error *err)
{
    const uint32_t width = o->has_size ? o->size.width : HGP_STANDARD_width;
    const uint32_t height = o->has_size ? o->size.height : HGP_STANDARD_height;
    if (o->has_region &&
        (o->region.x + o->region.width > width || o->region.y + o->region.height > height))
        return hg_error_set(err, HG_E_INVAL, "--region", NULL,
            "is not inside of the picture of %ux%u px", width, height);
    return HG_OK;
}

static enum hg_status check_combinations(const struct hg_cli_options *o, struct hg_error *err)
{
    if (!o->has_output)
        return usage(err, "--output", "is needed: the file to write");
    if (o->has_samples && o->has_spp && o->samples != o->spp)
        return usage(err, "--spp", "and --samples differ");
    if (o->has_at && o->has_frames && !o->has_turntable)
        return usage(err, "--at", "cannot be combined with --frames");
    if (o->has_fps && !o->has_frames && !o->has_turntable && !o->has_shutter && !o->has_shutter_s &&
        !o->has_aov)
        return usage(
            err, "--fps", "needs --frames, --turntable, --shutter, --shutter-time or --aov");
    if (o->animate_seed && !o->has_frames && !o->has_turntable)
        return usage(err, "--animate-seed", "needs --frames or --turntable");
    if (o->claim && !o->has_frames && !o->has_turntable)
        return usage(err, "--claim", "needs --frames or --turntable");
    if (o->has_turntable && o->has_camera && !is_fit(o))
        return usage(err, "--turntable",
            "needs a view with a target: --orbit or --eye with --target, or no --camera");
    if (o->has_turntable && (o->has_next_eye || o->has_next_target))
        return usage(err, "--turntable", "moves the camera; --next-eye and --next-target do, too");
    return HG_OK;
}

static enum hg_status check_scene(const struct hg_cli_options *o, struct hg_error *err)
{
    if (o->has_upload && !o->has_connect)
        return usage(err, "--upload", "needs --connect");
    if (o->has_upload && o->arg_count > 0 && strcmp(o->args[0], "demo:") == 0)
        return usage(err, "--upload", "has nothing to send for demo:");
    if (o->has_sun && o->has_env && strcmp(o->env, "sky") != 0)
        return usage(err, "--sun", "is of the built-in sky: it needs --env sky");
    bool env_off = o->has_env && strcmp(o->env, "none") == 0;
    if (env_off && (o->has_env_intensity || o->has_env_rotation))
        return usage(err, "--env", "none has neither intensity nor rotation");
    return HG_OK;
}

// A stream keeps nothing that a later command could find.
static enum hg_status check_stream(const struct hg_cli_options *o, struct hg_error *err)
{
    const char *option = o->claim            ? "--claim"
                         : o->skip_existing  ? "--skip-existing"
                         : o->resume         ? "--resume"
                         : o->has_checkpoint ? "--checkpoint"
                                             : NULL;
    return option ? usage(err, option, "needs a file as --output, not a pipe or a device") : HG_OK;
}

// The frames of --frames, or all of --turntable. What is denoised depends on the frames before.
static enum hg_status list_frames(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    const struct hg_frame_ranges turn = {.items = {{0, (int32_t)o->turntable - 1, 1}}, .count = 1};
    if (!o->has_frames && !o->has_turntable)
        return HG_OK;
    enum hg_status status = hg_frame_ranges_list(
        o->has_frames ? &o->frames : &turn, &r->list.numbers, &r->list.count, err);
    if (!status && o->claim && o->denoise && r->list.count > 1)
        status = usage(err, "--claim",
            "frames of --denoise depend on those before, so that one command renders them all");
    for (uint32_t i = 1; !status && o->denoise && i < r->list.count; i++)
        if (r->list.numbers[i] < r->list.numbers[i - 1])
            status =
                usage(err, "--frames", "have to ascend with --denoise, which uses those before");
    return status;
}

// A place for the frame's number: several frames need it, and a picture without one has none.
static enum hg_status check_name(struct hg_cli_render *r, struct hg_error *err)
{
    char name[4096];
    if (strlen(r->output) + 32 >= sizeof name)
        return usage(err, "--output", "the name is too long");
    const bool numbered = hg_cli_frame_name(r->output, 0, name, sizeof name);
    r->streams = hg_cli_is_stream(numbered ? name : r->output);
    if (r->list.count > 1 && !numbered && !r->streams)
        return usage(
            err, "--output", "the file's name needs #### or %04d for the number of the frame");
    if (r->list.count == 0 && numbered)
        return usage(err, "--output",
            "# or %04d in the file's name is the number of a frame: it needs --frames or "
            "--turntable");
    return r->streams ? check_stream(r->o, err) : HG_OK;
}

static enum hg_status check_output(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    enum hg_status status = hg_cli_format_of(o->output, o, &r->format, err);
    if (status)
        return status;
    r->output = r->format.path;
    status = check_name(r, err);
    if (!status && r->format.encoding == HGP_encoding_JPEG && o->has_background &&
        o->background.kind == HG_CLI_BACKGROUND_NONE)
        status = usage(err, "--background", "none is transparent, which JPEG files have not");
    if (status || !o->has_aov)
        return status;
    bool exr =
        r->format.encoding == HGP_encoding_EXR_HALF || r->format.encoding == HGP_encoding_EXR_FLOAT;
    if (!exr)
        return usage(err, "--aov", "needs a file that ends in .exr");
    if (o->has_debug_view && strcmp(o->debug_view, "off") != 0)
        return usage(err, "--aov", "a debug view has no planes");
    status = hg_cli_parse_planes("--aov", o->aov, hg_cli_is_path(o), &r->planes, err);
    r->planes |= o->denoise ? 1u << HGP_plane_NOISY : 0; // goes with the other planes
    return status;
}

static enum hg_status parse_shutter(struct hg_cli_render *r, struct hg_error *err)
{
    const char *text = r->o->shutter, *colon = r->o->has_shutter ? strchr(text, ':') : NULL;
    char first[32];
    double open = 0, close = 0;
    if (!r->o->has_shutter)
        return HG_OK;
    snprintf(first, sizeof first, "%.*s", colon ? (int)(colon - text) : 31, text);
    enum hg_status status = hg_cli_parse_number("--shutter", first, -1, 2, &open, err);
    if (status)
        return status;
    if (colon) {
        status = hg_cli_parse_number("--shutter", colon + 1, -1, 1, &close, err);
        if (status)
            return status;
    } else {
        close = open / 2;
        open = -close;
    }
    if (open > 1 || close < open)
        return usage(err, "--shutter", "closes before it opens");
    r->shutter[0] = (float)open;
    r->shutter[1] = (float)close;
    return HG_OK;
}

enum hg_status hg_cli_render_check_scene(const struct hg_cli_options *o, struct hg_error *err)
{
    enum hg_status status = hg_cli_check_mode(o, err);
    if (!status && o->has_view)
        status = hg_cli_parse_view("--view", o->view, &(struct hgp_view_fit){0}, err);
    if (!status && o->has_point_size)
        status = hg_cli_parse_point_size(
            "--point-size", o->point_size, &(struct hgp_asset_load){0}, err);
    if (!status)
        status = check_scene(o, err);
    return status ? status : check_camera(o, err);
}

static enum hg_status check_arguments(struct hg_cli_render *r, struct hg_error *err)
{
    enum hg_status status = hg_cli_render_check_scene(r->o, err);
    if (!status)
        status = parse_shutter(r, err);
    if (!status)
        status = check_combinations(r->o, err);
    if (!status)
        status = check_region(r->o, err);
    if (!status)
        status = hg_cli_check_watch(r->o, err);
    if (!status)
        status = list_frames(r, err);
    return status ? status : check_output(r, err);
}

// ---- scene -------------------------------------------------------------------------------------

static bool is_env_file(const struct hg_cli_options *o)
{
    return o->has_env && strcmp(o->env, "none") != 0 && strcmp(o->env, "sky") != 0 &&
           strcmp(o->env, "auto") != 0;
}

// As asset_load lists them, with their uris in the same block behind the list. NULL: no memory.
static struct hgp_asset_file *copy_files(const struct hg_cli_files *files)
{
    size_t bytes = files->count * sizeof(struct hgp_asset_file);
    for (uint32_t i = 0; i < files->count; i++)
        bytes += strlen(files->items[i].uri) + 1;
    struct hgp_asset_file *list = hg_calloc(1, bytes);
    if (!list)
        return NULL;
    char *names = (char *)(list + files->count);
    for (uint32_t i = 0; i < files->count; i++) {
        const size_t length = strlen(files->items[i].uri);
        memcpy(names, files->items[i].uri, length + 1);
        list[i].uri = (struct hgp_str){names, (uint32_t)length};
        memcpy(list[i].hash, files->items[i].hash, sizeof list[i].hash);
        names += length + 1;
    }
    return list;
}

static enum hg_status upload_asset(struct hg_cli_render *r, struct hgp_asset_load *load,
    struct hgp_asset_file **list, struct hg_error *err)
{
    struct hg_cli_files files;
    uint64_t sent = 0;
    *list = NULL;
    enum hg_status status = hg_cli_files_of_asset(r->o->args[0], &files, err);
    if (status)
        return status;
    status = helio_upload(r->cli.h, files.items, files.count, &sent, err);
    r->upload_bytes += sent;
    if (status)
        goto done;
    *list = copy_files(&files);
    if (!*list) {
        status = hg_error_set(err, HG_E_NOMEM, r->o->args[0], NULL, "no memory for its files");
        goto done;
    }
    load->files.items = *list;
    load->files.count = files.count;
done:
    hg_cli_files_free(&files);
    return status;
}

// Says that a file was turned without being asked to.
static void take_up(struct hg_cli_render *r, const struct hgp_asset_loaded *loaded)
{
    if (!loaded->has_up || !loaded->has_up_reason)
        return;
    r->loaded.up = loaded->up;
    hg_cli_clean(r->loaded.up_reason, sizeof r->loaded.up_reason, loaded->up_reason.data,
        loaded->up_reason.size);
    if (r->o->has_up || loaded->up == HGP_up_axis_Y || r->cli.progress.mode == HG_CLI_PROGRESS_JSON)
        return;
    hg_cli_progress_clear(&r->cli.progress);
    fprintf(stderr, "note: %s: %s is up: %s; --up AXIS changes it\n", r->o->args[0],
        hg_cli_up_name(loaded->up), r->loaded.up_reason);
}

static enum hg_status load_scene(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    struct hgp_asset_load load = {.asset = r->cli.scene.first_id};
    struct hgp_asset_file *list = NULL;
    struct helio_message *answer = NULL;
    char *path = NULL;
    uint64_t begin = hg_clock_now_ns();
    load.has_scene_index = o->has_scene_index;
    load.scene_index = (int32_t)o->scene_index;
    load.has_variant = o->has_variant;
    if (o->has_variant)
        load.variant = hgp_str_make(o->variant);
    load.has_up = o->has_up;
    if (o->has_up && hg_cli_parse_up("--up", o->up, &load.up, err))
        return err->status;
    if (o->has_point_size &&
        hg_cli_parse_point_size("--point-size", o->point_size, &load, err) != HG_OK)
        return err->status;
    r->doing = HG_CLI_DOING_INPUT;
    hg_cli_progress_stage(&r->cli.progress, o->upload ? "uploading" : "loading");
    enum hg_status status = o->upload ? upload_asset(r, &load, &list, err)
                                      : hg_cli_server_path(&r->cli, o->args[0], &path, err);
    if (status)
        goto done;
    if (path)
        load.path = hgp_str_make(path);
    status = helio_call_for(r->cli.h, HGP_T_asset_load, &load, HGP_T_asset_loaded, &answer, err);
    if (status && o->has_variant && strcmp(err->where, "variant") == 0)
        r->doing = HG_CLI_DOING_ARGUMENTS; // the file is good, the option is not
    if (status)
        goto done;
    r->loaded.animations = answer->body->asset_loaded.animations;
    r->loaded.lights = answer->body->asset_loaded.lights;
    take_up(r, &answer->body->asset_loaded);
    hg_cli_progress_warnings(&r->cli.progress);
    status = hg_cli_check_warnings(&r->cli, err);
done:
    helio_message_free(answer);
    hg_free(path);
    hg_free(list);
    r->load_ns = hg_clock_now_ns() - begin;
    return status;
}

// The environment is an image: sent, or named as the server knows it. *path lives as long as `env`.
static enum hg_status set_env_file(
    struct hg_cli_render *r, struct hgp_environment_set *env, char **path, struct hg_error *err)
{
    const char *name = r->o->env;
    enum hg_status status;
    env->kind = HGP_environment_kind_FILE;
    if (r->o->upload) {
        struct helio_file file = {.path = name, .uri = name};
        uint64_t sent = 0;
        status = helio_upload(r->cli.h, &file, 1, &sent, err);
        r->upload_bytes += sent;
        env->has_hash = true;
        memcpy(env->hash, file.hash, sizeof env->hash);
        return status;
    }
    status = hg_cli_server_path(&r->cli, name, path, err);
    if (status)
        return status;
    env->has_path = true;
    env->path = hgp_str_make(*path);
    return HG_OK;
}

// The sun of the built-in sky where a camera of --orbit AZ,EL would stand.
static void set_sun(const struct hg_cli_sun *sun, struct hgp_environment_set *env)
{
    const double azimuth = sun->azimuth * pi / 180, elevation = sun->elevation * pi / 180;
    env->has_sun = true;
    env->sun = !sun->off;
    env->has_turbidity = sun->turbidity > 0;
    env->turbidity = (float)sun->turbidity;
    env->has_sun_direction = !sun->off;
    env->sun_direction[0] = (float)(cos(elevation) * sin(azimuth));
    env->sun_direction[1] = (float)sin(elevation);
    env->sun_direction[2] = (float)(cos(elevation) * cos(azimuth));
}

// Without --env, the scene keeps the light that the server gives it.
static enum hg_status set_environment(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    hg_cli_render_say_fill(r);
    struct hgp_environment_set env = {.has_kind = o->has_env || o->has_sun,
        .kind = HGP_environment_kind_SKY,
        .has_intensity = o->has_env_intensity,
        .intensity = (float)o->env_intensity,
        .has_rotation_rad = o->has_env_rotation,
        .rotation_rad = (float)(o->env_rotation * pi / 180)};
    char *path = NULL;
    if (o->has_env && strcmp(o->env, "none") == 0)
        env.kind = HGP_environment_kind_NONE;
    if (o->has_env && strcmp(o->env, "auto") == 0)
        env.kind = HGP_environment_kind_AUTO;
    if (o->has_sun)
        set_sun(&o->sun, &env);
    enum hg_status status = is_env_file(o) ? set_env_file(r, &env, &path, err) : HG_OK;
    if (!status && (env.has_kind || env.has_intensity || env.has_rotation_rad))
        status = helio_call_for(r->cli.h, HGP_T_environment_set, &env, HGP_T_ok, NULL, err);
    hg_free(path);
    return status;
}

// ---- view --------------------------------------------------------------------------------------

static enum hg_status set_catchers(struct hg_cli_render *r, struct hg_error *err)
{
    struct hgp_node_set node = {.has_catches_shadows = true, .catches_shadows = true};
    for (uint32_t i = 0; i < r->o->catcher.count; i++) {
        enum hg_status status = hg_cli_find_node(&r->cli, r->o->catcher.items[i], &node.node, err);
        if (status) {
            r->doing = HG_CLI_DOING_ARGUMENTS;
            return status;
        }
        status = helio_call_for(r->cli.h, HGP_T_node_set, &node, HGP_T_ok, NULL, err);
        if (status)
            return status;
    }
    return HG_OK;
}

static enum hg_status set_view(struct hg_cli_render *r, struct hg_error *err)
{
    struct hgp_view_set view;
    hg_cli_render_view(r, &view);
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
    if (status == HG_E_UNSUPPORTED) // the words are right; the device or the build cannot
        r->doing = HG_CLI_DOING_RENDER;
    return status;
}

// Where --eye stands and looks, now and a frame later.
static void place_eye(const struct hg_cli_options *o, struct hgp_view_camera *camera)
{
    camera->has_eye = camera->has_target = true;
    camera->has_next_eye = o->has_next_eye;
    camera->has_next_target = o->has_next_target;
    for (int i = 0; i < 3; i++) {
        camera->eye[i] = (float)o->eye.v[i];
        camera->target[i] = (float)o->target.v[i];
        camera->next_eye[i] = (float)o->next_eye.v[i];
        camera->next_target[i] = (float)o->next_target.v[i];
    }
    if (o->eye.v[0] == o->target.v[0] && o->eye.v[2] == o->target.v[2]) {
        camera->has_up = true; // +Y would be the line of sight
        camera->up[2] = o->eye.v[1] > o->target.v[1] ? -1 : 1;
    }
}

// Without --orbit and --eye: a camera of the scene by name, else what the server finds: the scene's
// first camera that sees geometry, unless --view, --fov or --camera fit ask for all of the scene.
static enum hg_status find_place(
    struct hg_cli_render *r, double fov, struct hgp_view_camera *camera, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    if (o->has_camera && !is_fit(o)) {
        enum hg_status named =
            hg_cli_find_camera(&r->cli, "--camera", o->camera, &camera->camera, err);
        camera->has_camera = camera->camera != 0;
        return named;
    }
    struct hgp_view_fit fit = {.view = HG_CLI_VIEW,
        .has_vfov_rad = true,
        .vfov_rad = (float)fov,
        .has_turntable = o->has_turntable,
        .turntable = o->has_turntable,
        .has_cameras = true,
        .cameras = !o->has_view && !o->has_fov && !o->has_camera && !o->has_turntable};
    enum hg_status status = o->has_view ? hg_cli_parse_view("--view", o->view, &fit, err) : HG_OK;
    return status ? status : helio_camera_fit(r->cli.h, &fit, camera, err);
}

static enum hg_status set_camera(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    double fov = (o->has_fov ? o->fov : 45) * pi / 180;
    struct hgp_view_camera camera = {.view = HG_CLI_VIEW,
        .input_seq = 1,
        .has_lens_radius = o->has_lens_radius,
        .lens_radius = (float)o->lens_radius,
        .has_focus_distance = o->has_focus,
        .focus_distance = (float)o->focus};
    enum hg_status status = HG_OK;
    if (o->has_orbit)
        helio_camera_orbit(o->orbit.v[0], o->orbit.v[1], o->orbit.v[2], o->target.v, &camera);
    else if (o->has_eye)
        place_eye(o, &camera);
    else
        status = find_place(r, fov, &camera, err);
    if (status)
        return status;
    if (!camera.has_camera) {
        camera.has_vfov_rad = true;
        camera.vfov_rad = (float)fov;
    }
    const bool fitted = !o->has_orbit && !o->has_eye && !camera.has_camera;
    r->turntable = (struct hg_cli_turntable){.fitted = fitted,
        .frames = o->turntable,
        .moves = o->has_shutter || o->has_shutter_s || (r->planes >> HGP_plane_MOTION & 1),
        .start = camera};
    return hg_cli_frame_camera(r, &camera, err);
}

// ---- the command -------------------------------------------------------------------------------

// By name, or by whatever name they have. Devices (a terminal, /dev/null) take several outputs.
static bool is_same_file(const char *a, const char *b)
{
    struct stat one, other;
    a = hg_cli_output_path(a);
    b = hg_cli_output_path(b);
    if (hg_cli_is_stdout(a) && hg_cli_is_stdout(b))
        return true;
    if (stat(a, &one) != 0 || stat(b, &other) != 0)
        return strcmp(a, b) == 0;
    return one.st_dev == other.st_dev && one.st_ino == other.st_ino && !S_ISCHR(one.st_mode);
}

// Nothing that is written may take the place of what is read, or of what was written before.
static enum hg_status check_distinct(const struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    const bool here = !o->connect || o->upload;
    const char *env = is_env_file(o) && here ? o->env : NULL;
    if (env && is_same_file(r->output, env))
        return usage(err, "--output", "is the file of --env");
    if (o->stats_file && is_same_file(o->stats_file, r->output))
        return usage(err, "--stats", "is the file of --output");
    if (o->stats_file && here &&
        (is_same_file(o->stats_file, o->args[0]) || (env && is_same_file(o->stats_file, env))))
        return usage(err, "--stats", "is a file that is read");
    return HG_OK;
}

static enum hg_status check_readable(
    struct hg_cli_render *r, const char *name, struct hg_error *err)
{
    char *path = NULL;
    enum hg_status status = hg_cli_server_path(&r->cli, name, &path, err);
    hg_free(path);
    return status;
}

static enum hg_status check_files(struct hg_cli_render *r, struct hg_error *err)
{
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = hg_cli_check_output(r->output, err);
    if (!status)
        status = hg_cli_frame_check_files(r, err);
    if (status)
        return status;
    status = r->o->stats_file ? hg_cli_check_output(r->o->stats_file, err) : HG_OK;
    if (status)
        return status;
    status = check_distinct(r, err);
    if (status)
        return status;
    // A private worker is not started for a file that does not exist.
    r->doing = HG_CLI_DOING_INPUT;
    r->cli.embedded = !r->o->connect;
    status = check_readable(r, r->o->args[0], err);
    if (status)
        return status;
    return is_env_file(r->o) ? check_readable(r, r->o->env, err) : HG_OK;
}

enum hg_status hg_cli_render_connect(struct hg_cli_render *r, bool with_scene, struct hg_error *err)
{
    struct hg_cli_texts files = {0};
    if (r->o->arg_count > 0)
        files.items[files.count++] = r->o->args[0];
    if (is_env_file(r->o))
        files.items[files.count++] = r->o->env;
    r->doing = HG_CLI_DOING_CONNECT;
    return hg_cli_connect(&r->cli, r->o->connect, &files, with_scene, err);
}

// Finds --animation, or tells what is not shown without it.
static enum hg_status choose_animations(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    struct hg_cli_animations *chosen = &r->loaded.chosen;
    char left_out[160];
    enum hg_status status = HG_OK;
    chosen->count = 0; // --watch loads again
    for (uint32_t i = 0; i < o->animation.count && !status; i++) {
        status = hg_cli_animation_find(
            &r->cli, 0, "--animation", o->animation.items[i], &chosen->items[chosen->count++], err);
        if (status == HG_E_NOTFOUND)
            r->doing = HG_CLI_DOING_ARGUMENTS;
    }
    if (chosen->count || r->loaded.animations < 2 || !(o->has_frames || o->has_at))
        return status;
    status = hg_cli_animations_left_out(&r->cli, left_out, sizeof left_out, err);
    if (!status && left_out[0])
        hg_cli_progress_say(&r->cli.progress,
            "animations that move what earlier ones do are not shown: %s (--animation NAME)",
            left_out);
    return status;
}

enum hg_status hg_cli_render_load(struct hg_cli_render *r, struct hg_error *err)
{
    enum hg_status status = load_scene(r, err);
    if (!status)
        status = choose_animations(r, err);
    if (!status)
        status = set_environment(r, err);
    return status ? status : set_catchers(r, err);
}

enum hg_status hg_cli_render_set_view(struct hg_cli_render *r, struct hg_error *err)
{
    enum hg_status status = set_view(r, err);
    if (!status &&
        (r->o->has_at ||
            r->o->has_animation)) // the pose that is rendered is what the camera is fitted to
        status = hg_cli_frame_set_time(r, r->o->at, err);
    return status ? status : set_camera(r, err);
}

static enum hg_status render_all(struct hg_cli_render *r, struct hg_error *err)
{
    static enum hg_status (*const steps[])(struct hg_cli_render *, struct hg_error *) = {
        hg_cli_render_load, hg_cli_render_set_view, hg_cli_render_frames};
    enum hg_status status = check_files(r, err);
    if (!status)
        status = hg_cli_render_connect(r, true, err);
    for (size_t i = 0; !status && i < sizeof steps / sizeof *steps; i++)
        status = steps[i](r, err);
    if (status)
        return status;
    hg_cli_render_warn_of_light(r);
    return r->o->stats_file ? hg_cli_render_stats(r, err) : HG_OK;
}

static enum hg_cli_exit render_once(const struct hg_cli_options *options)
{
    struct hg_cli_options chosen = *options;
    char line[160];
    hg_cli_apply_quality(&chosen, line, sizeof line);
    chosen.skip_existing |= chosen.claim;
    struct hg_cli_render r = {.o = &chosen,
        .size = {HGP_STANDARD_width, HGP_STANDARD_height},
        .doing = HG_CLI_DOING_ARGUMENTS};
    struct hg_error err = {0};
    if (options->has_size)
        r.size = options->size;
    signal(SIGPIPE, SIG_IGN); // frames are worth more than who reads their progress
    hg_cli_init(&r.cli, options);
    r.frames = json_array();
    enum hg_status status = r.frames ? check_arguments(&r, &err) : HG_E_NOMEM;
    if (!status && line[0])
        hg_cli_progress_say(&r.cli.progress, "%s", line);
    if (!status)
        status = render_all(&r, &err);
    enum hg_cli_exit code = status ? hg_cli_report(&r.cli, r.doing, &err) : HG_CLI_EXIT_OK;
    if (!status)
        hg_cli_render_summary(&r);
    if (code == HG_CLI_EXIT_STOPPED || (status && (r.film.is_left || r.film.failed || r.next > 0)))
        hg_cli_render_stopped(&r);
    hg_cli_finish(&r.cli, code);
    json_decref(r.frames);
    hg_free(r.series);
    hg_free(r.list.numbers);
    hg_writer_finish(&r.parts);
    return code;
}

enum hg_cli_exit hg_cli_render(const struct hg_cli_options *options)
{
    return options->watch ? hg_cli_watch(options, render_once) : render_once(options);
}
