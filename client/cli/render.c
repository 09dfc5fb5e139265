// render.c - helio render: a scene to image files.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/cli/cli.h"

static const double pi = 3.14159265358979323846;

struct render {
    struct hg_cli cli;
    const struct hg_cli_options *o;
    struct hg_cli_format format;
    struct hg_cli_size size;
    struct hgp_asset_loaded loaded;
    enum hg_cli_doing doing;
    uint64_t load_ns, upload_bytes, first_frame_ns;
    json_t *frames, *last; // one object per frame written; the newest of them (borrowed)
};

// ---- arguments ---------------------------------------------------------------------------------

static enum hg_status usage(struct hg_error *err, const char *option, const char *reason)
{
    return hg_error_set(err, HG_E_INVAL, option, NULL, "%s", reason);
}

// Options that this protocol version has no words for yet.
static enum hg_status check_available(const struct hg_cli_options *o, struct hg_error *err)
{
    if (o->has_aov)
        return usage(err, "--aov", "further images are not available in this version");
    if (o->has_noise)
        return usage(
            err, "--noise", "a noise level is not available in this version; use --samples");
    if (o->has_trace)
        return usage(err, "--trace", "choosing the ray tracer is not available in this version");
    return HG_OK;
}

static enum hg_status check_camera(const struct hg_cli_options *o, struct hg_error *err)
{
    if (o->has_camera && (o->has_orbit || o->has_eye || o->has_target || o->has_fov))
        return usage(err, "--camera", "cannot be combined with --orbit, --eye, --target or --fov");
    if (o->has_orbit && o->has_eye)
        return usage(err, "--orbit", "cannot be combined with --eye");
    if (o->has_target && !o->has_orbit && !o->has_eye)
        return usage(err, "--target", "needs --orbit or --eye");
    if (o->has_eye && memcmp(&o->eye, &o->target, sizeof o->eye) == 0)
        return usage(err, "--eye", "and --target are the same point");
    if (o->has_orbit && o->orbit.v[2] < 0)
        return usage(err, "--orbit", "the radius is negative");
    return HG_OK;
}

static enum hg_status check_combinations(const struct hg_cli_options *o, struct hg_error *err)
{
    if (!o->has_output)
        return usage(err, "--output", "is needed: the file to write");
    if (o->has_samples && o->has_spp && o->samples != o->spp)
        return usage(err, "--spp", "and --samples differ");
    if (o->has_time && o->has_frames)
        return usage(err, "--time", "cannot be combined with --frames");
    if (o->has_fps && !o->has_frames)
        return usage(err, "--fps", "needs --frames");
    if (o->has_upload && !o->has_connect)
        return usage(err, "--upload", "needs --connect");
    if (o->has_upload && strcmp(o->args[0], "demo:") == 0)
        return usage(err, "--upload", "has nothing to send for demo:");
    bool env_off = o->has_env && strcmp(o->env, "none") == 0;
    if (env_off && (o->has_env_intensity || o->has_env_rotation))
        return usage(err, "--env", "none has neither intensity nor rotation");
    return HG_OK;
}

// Writes `pattern` with the frame's number: a run of #, or %d / %0Nd. False without a place.
static bool frame_name(const char *pattern, uint32_t frame, char *dst, size_t size)
{
    const char *at = strchr(pattern, '#');
    if (at) {
        int width = (int)strspn(at, "#");
        snprintf(dst, size, "%.*s%0*u%s", (int)(at - pattern), pattern, width, frame, at + width);
        return true;
    }
    at = strchr(pattern, '%');
    size_t digits = at ? strspn(at + 1, "0123456789") : 0;
    if (!at || digits > 2 || at[1 + digits] != 'd' || (digits && at[1] != '0'))
        return false;
    int width = digits ? atoi(at + 1) : 1;
    snprintf(dst, size, "%.*s%0*u%s", (int)(at - pattern), pattern, width, frame, at + digits + 2);
    return true;
}

static enum hg_status check_output(struct render *r, struct hg_error *err)
{
    char name[4096];
    const struct hg_cli_options *o = r->o;
    if (strlen(o->output) + 32 >= sizeof name)
        return usage(err, "--output", "the name is too long");
    bool numbered = frame_name(o->output, 0, name, sizeof name);
    if (o->has_frames && !numbered && o->frames.first != o->frames.last)
        return usage(err, "--output", "needs #### or %04d for the number of the frame");
    enum hg_status status = hg_cli_format_of(o->output, o, &r->format, err);
    return status;
}

static enum hg_status check_arguments(struct render *r, struct hg_error *err)
{
    enum hg_status status = check_available(r->o, err);
    if (!status)
        status = check_combinations(r->o, err);
    if (!status)
        status = check_camera(r->o, err);
    if (!status)
        status = check_output(r, err);
    return status;
}

// ---- scene -------------------------------------------------------------------------------------

static bool is_env_file(const struct hg_cli_options *o)
{
    return o->has_env && strcmp(o->env, "none") != 0 && strcmp(o->env, "sky") != 0;
}

static enum hg_status upload_asset(struct render *r, struct hgp_asset_load *load,
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
    if (!status && !(*list = hg_calloc(files.count, sizeof **list)))
        status = hg_error_set(err, HG_E_NOMEM, r->o->args[0], NULL, "no memory for its files");
    char *names = NULL; // uris outlive `files` in one block behind the list
    size_t total = 0;
    for (uint32_t i = 0; i < files.count; i++)
        total += strlen(files.items[i].uri) + 1;
    if (!status) {
        void *grown = hg_realloc(*list, files.count * sizeof **list + total, 1);
        if (!grown)
            status = hg_error_set(err, HG_E_NOMEM, r->o->args[0], NULL, "no memory for its files");
        else
            *list = grown;
        names = (char *)(*list + files.count);
    }
    for (uint32_t i = 0; !status && i < files.count; i++) {
        size_t length = strlen(files.items[i].uri);
        memcpy(names, files.items[i].uri, length + 1);
        (*list)[i].uri = (struct hgp_str){names, (uint32_t)length};
        memcpy((*list)[i].hash, files.items[i].hash, sizeof(*list)[i].hash);
        names += length + 1;
    }
    load->files.items = *list;
    load->files.count = files.count;
    hg_cli_files_free(&files);
    return status;
}

static enum hg_status load_scene(struct render *r, struct hg_error *err)
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
    r->doing = HG_CLI_DOING_INPUT;
    hg_cli_progress_stage(&r->cli.progress, o->upload ? "uploading" : "loading");
    enum hg_status status;
    if (o->upload)
        status = upload_asset(r, &load, &list, err);
    else if (!(status = hg_cli_server_path(&r->cli, o->args[0], &path, err)))
        load.path = hgp_str_make(path);
    if (!status)
        status =
            helio_call_for(r->cli.h, HGP_T_asset_load, &load, HGP_T_asset_loaded, &answer, err);
    if (!status)
        r->loaded = answer->body->asset_loaded;
    else if (o->has_variant && strcmp(err->where, "variant") == 0)
        r->doing = HG_CLI_DOING_ARGUMENTS; // the file is good, the option is not
    if (!status)
        status = hg_cli_check_warnings(&r->cli, err);
    helio_message_free(answer);
    hg_free(path);
    hg_free(list);
    r->load_ns = hg_clock_now_ns() - begin;
    return status;
}

// Without --env, a scene that brings no light is lit by the sky; the demo brings its own.
static enum hg_status set_environment(struct render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    bool bare = r->loaded.lights == 0 && strcmp(o->args[0], "demo:") != 0;
    struct hgp_environment_set env = {
        .has_kind = o->has_env || bare, .kind = HGP_environment_kind_SKY};
    char *path = NULL;
    enum hg_status status = HG_OK;
    if (o->has_env && strcmp(o->env, "none") == 0)
        env.kind = HGP_environment_kind_NONE;
    if (is_env_file(o)) {
        env.kind = HGP_environment_kind_FILE;
        if (o->upload) {
            struct helio_file file = {.path = o->env, .uri = o->env};
            uint64_t sent = 0;
            status = helio_upload(r->cli.h, &file, 1, &sent, err);
            r->upload_bytes += sent;
            env.has_hash = true;
            memcpy(env.hash, file.hash, sizeof env.hash);
        } else if (!(status = hg_cli_server_path(&r->cli, o->env, &path, err))) {
            env.has_path = true;
            env.path = hgp_str_make(path);
        }
    }
    env.has_intensity = o->has_env_intensity;
    env.intensity = (float)o->env_intensity;
    env.has_rotation_rad = o->has_env_rotation;
    env.rotation_rad = (float)(o->env_rotation * pi / 180);
    if (!status && (env.has_kind || env.has_intensity || env.has_rotation_rad))
        status = helio_call_for(r->cli.h, HGP_T_environment_set, &env, HGP_T_ok, NULL, err);
    hg_free(path);
    return status;
}

// ---- view --------------------------------------------------------------------------------------

static enum hg_status set_view(struct render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    uint32_t value;
    struct hgp_view_set view = {
        .view = HG_CLI_VIEW,
        .has_width = true,
        .width = r->size.width,
        .has_height = true,
        .height = r->size.height,
        .has_still_encoding = true,
        .still_encoding = r->format.encoding,
        .has_quality = true,
        .quality = r->format.quality,
        .has_exposure_ev = o->has_exposure,
        .exposure_ev = (float)o->exposure,
        .has_samples = o->has_samples || o->has_spp,
        .samples = o->has_samples ? o->samples : o->spp,
        .has_seed = o->has_seed,
        .seed = o->seed,
        .has_error_px = o->has_error_px,
        .error_px = (float)o->error_px,
    };
    if (o->has_mode && hgp_enum_value("render_mode", o->mode, &value)) {
        view.has_mode = true;
        view.mode = (enum hgp_render_mode)value;
    }
    if (o->has_debug_view && hgp_enum_value("debug_view", o->debug_view, &value)) {
        view.has_debug_view = true;
        view.debug_view = (enum hgp_debug_view)value;
    }
    if (o->has_tonemap && hgp_enum_value("tonemap", o->tonemap, &value)) {
        view.has_tonemap = true;
        view.tonemap = (enum hgp_tonemap)value;
    }
    if (o->has_background) {
        view.has_background = true;
        view.background = o->background.kind == HG_CLI_BACKGROUND_ENV    ? HGP_background_ENV
                          : o->background.kind == HG_CLI_BACKGROUND_NONE ? HGP_background_NONE
                                                                         : HGP_background_COLOR;
        view.has_background_color = o->background.kind == HG_CLI_BACKGROUND_COLOR;
        for (int i = 0; i < 3; i++)
            view.background_color[i] = (float)o->background.color[i];
    }
    r->doing = HG_CLI_DOING_ARGUMENTS;
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

static enum hg_status set_camera(struct render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    double fov = (o->has_fov ? o->fov : 45) * pi / 180;
    struct hgp_view_camera camera = {.view = HG_CLI_VIEW, .input_seq = 1};
    enum hg_status status = HG_OK;
    if (o->has_orbit) {
        helio_camera_orbit(o->orbit.v[0], o->orbit.v[1], o->orbit.v[2], o->target.v, &camera);
    } else if (o->has_eye) {
        camera.has_eye = camera.has_target = true;
        for (int i = 0; i < 3; i++) {
            camera.eye[i] = (float)o->eye.v[i];
            camera.target[i] = (float)o->target.v[i];
        }
        if (o->eye.v[0] == o->target.v[0] && o->eye.v[2] == o->target.v[2]) {
            camera.has_up = true; // +Y would be the line of sight
            camera.up[2] = o->eye.v[1] > o->target.v[1] ? -1 : 1;
        }
    } else if (!o->has_fov) {
        status = hg_cli_find_camera(&r->cli, o->camera, &camera.camera, err);
        camera.has_camera = camera.camera != 0;
    }
    if (!status && !camera.has_camera && !camera.has_eye)
        status =
            hg_cli_fit_camera(&r->cli, fov, (double)r->size.width / r->size.height, &camera, err);
    if (!camera.has_camera) {
        camera.has_vfov_rad = true;
        camera.vfov_rad = (float)fov;
    }
    return status ? status : hg_cli_send_camera(&r->cli, &camera, err);
}

// ---- frames ------------------------------------------------------------------------------------

static enum hg_status note_frame(struct render *r, const struct hgp_frame *frame, const char *name,
    uint64_t total_ns, struct hg_error *err)
{
    json_t *stages = json_array();
    for (uint32_t i = 0; i < frame->stages.count; i++) {
        const struct hgp_stage_time *s = &frame->stages.items[i];
        json_array_append_new(
            stages, json_pack("{s:o?, s:f}", "name",
                        json_stringn(s->name.data ? s->name.data : "", s->name.size), "ms",
                        (double)s->ns / 1e6));
    }
    json_t *o = json_pack("{s:s, s:I, s:I, s:I, s:I, s:I, s:b, s:b, s:I, s:f, s:o}", "file", name,
        "width", (json_int_t)frame->width, "height", (json_int_t)frame->height, "samples",
        (json_int_t)frame->samples, "missing_pages", (json_int_t)frame->missing_pages,
        "missing_clusters", (json_int_t)frame->missing_clusters, "settled", frame->settled,
        "lossless", frame->lossless, "bytes", (json_int_t)frame->data.size, "total_ms",
        (double)total_ns / 1e6, "stages", stages);
    if (!o || json_array_append_new(r->frames, o))
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    r->last = o;
    if (frame->has_hash) {
        char hex[65];
        for (int i = 0; i < 32; i++)
            snprintf(hex + 2 * i, 3, "%02x", frame->hash[i]);
        json_object_set_new(o, "hash", json_string(hex));
    }
    return HG_OK;
}

static enum hg_status render_frame(struct render *r, const char *name, struct hg_error *err)
{
    struct hgp_frame_request request = {
        .view = HG_CLI_VIEW,
        .settled = true,
        .has_encoding = true,
        .encoding = r->format.encoding,
        .has_quality = true,
        .quality = r->format.quality,
    };
    struct helio_message *answer;
    uint64_t begin = hg_clock_now_ns();
    r->doing = HG_CLI_DOING_RENDER;
    hg_cli_progress_stage(&r->cli.progress, "rendering");
    enum hg_status status = helio_frame(r->cli.h, &request, &answer, err);
    if (!status)
        status = hg_cli_drain_queue(&r->cli, err);
    if (!status) {
        r->doing = HG_CLI_DOING_INPUT; // what is wrong with the picture came from the files
        status = hg_cli_check_warnings(&r->cli, err);
    }
    if (status) {
        helio_message_free(answer);
        return status;
    }
    r->doing = HG_CLI_DOING_RENDER;
    const struct hgp_frame *frame = &answer->body->frame;
    uint64_t now = hg_clock_now_ns();
    if (!r->first_frame_ns)
        r->first_frame_ns = now - r->cli.begin_ns;
    if (frame->encoding != r->format.encoding || !frame->data.size)
        status = hg_error_set(err, HG_E_FORMAT, "frame", "encoding",
            "the server sent another encoding than the one asked for");
    if (!status)
        status = note_frame(r, frame, name, now - begin, err);
    if (!status) {
        r->doing = HG_CLI_DOING_OUTPUT;
        status = hg_file_write_atomic(name, frame->data.data, frame->data.size, err);
    }
    helio_message_free(answer);
    return status;
}

static enum hg_status set_time(struct render *r, double time_s, struct hg_error *err)
{
    struct hgp_animation_set animation = {
        .asset = r->cli.scene.first_id, .animation = -1, .time_s = time_s};
    r->doing = HG_CLI_DOING_RENDER;
    return helio_call_for(r->cli.h, HGP_T_animation_set, &animation, HGP_T_ok, NULL, err);
}

static enum hg_status render_frames(struct render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    const struct hg_cli_frames *f = &o->frames;
    char name[4096];
    if (!o->has_frames) {
        enum hg_status status = o->has_time ? set_time(r, o->time, err) : HG_OK;
        return status ? status : render_frame(r, o->output, err);
    }
    double fps = o->has_fps ? o->fps : 24;
    uint32_t count = (f->last - f->first) / f->step + 1;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t number = f->first + i * f->step;
        if (!frame_name(o->output, number, name, sizeof name))
            snprintf(name, sizeof name, "%s", o->output);
        snprintf(
            r->cli.progress.prefix, sizeof r->cli.progress.prefix, "frame %u of %u", i + 1, count);
        enum hg_status status = set_time(r, number / fps, err);
        if (!status)
            status = render_frame(r, name, err);
        if (status)
            return status;
    }
    return HG_OK;
}

// ---- statistics --------------------------------------------------------------------------------

static void set_ms(json_t *object, const char *key, uint64_t ns)
{
    json_object_set_new(object, key, json_real((double)ns / 1e6));
}

// The worker's statistics, with the newest frame's provenance and the client's own times.
static enum hg_status write_stats(struct render *r, struct hg_error *err)
{
    json_t *stats;
    r->doing = HG_CLI_DOING_RENDER;
    enum hg_status status = hg_cli_stats(&r->cli, &stats, err);
    if (status)
        return status;
    json_t *frame = json_object_get(stats, "frame");
    if (!json_is_object(frame)) {
        frame = json_object();
        json_object_set_new(stats, "frame", frame);
    }
    json_object_update_missing(frame, r->last);
    json_t *client = json_object();
    set_ms(client, "connect_ms", r->cli.connect_ns);
    set_ms(client, "load_ms", r->load_ns);
    set_ms(client, "first_frame_ms", r->first_frame_ns);
    set_ms(client, "total_ms", hg_clock_now_ns() - r->cli.begin_ns);
    json_object_set_new(client, "uploaded_bytes", json_integer((json_int_t)r->upload_bytes));
    json_object_set_new(client, "embedded", json_boolean(r->cli.embedded));
    json_object_set_new(client, "version", json_string(HELIO_VERSION));
    json_object_set_new(stats, "client", client);
    json_object_set(stats, "frames", r->frames);
    char *text = json_dumps(stats, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(stats);
    if (!text)
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    size_t length = strlen(text);
    text[length] = '\n'; // over the terminator, which is not written
    r->doing = HG_CLI_DOING_OUTPUT;
    status = hg_file_write_atomic(r->o->stats_file, text, length + 1, err);
    free(text);
    return status;
}

// ---- the command -------------------------------------------------------------------------------

static enum hg_status check_files(struct render *r, struct hg_error *err)
{
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = hg_cli_check_output(r->o->output, err);
    if (!status && r->o->stats_file)
        status = hg_cli_check_output(r->o->stats_file, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_INPUT;
    char *path = NULL; // a private worker is not started for a file that does not exist
    r->cli.embedded = !r->o->connect;
    status = hg_cli_server_path(&r->cli, r->o->args[0], &path, err);
    hg_free(path);
    path = NULL;
    if (!status && is_env_file(r->o))
        status = hg_cli_server_path(&r->cli, r->o->env, &path, err);
    hg_free(path);
    return status;
}

static enum hg_status render_all(struct render *r, struct hg_error *err)
{
    struct hg_cli_texts files = {.items = {r->o->args[0]}, .count = 1};
    if (is_env_file(r->o))
        files.items[files.count++] = r->o->env;
    enum hg_status status = check_files(r, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_CONNECT;
    status = hg_cli_connect(&r->cli, r->o->connect, &files, true, err);
    if (!status)
        status = load_scene(r, err);
    if (!status)
        status = set_environment(r, err);
    if (!status)
        status = set_view(r, err);
    if (!status)
        status = set_camera(r, err);
    if (!status)
        status = render_frames(r, err);
    if (!status && r->o->stats_file)
        status = write_stats(r, err);
    return status;
}

enum hg_cli_exit hg_cli_render(const struct hg_cli_options *options)
{
    struct render r = {.o = options, .size = {1280, 720}, .doing = HG_CLI_DOING_ARGUMENTS};
    struct hg_error err = {0};
    if (options->has_size)
        r.size = options->size;
    hg_cli_init(&r.cli, options);
    r.frames = json_array();
    enum hg_status status = r.frames ? check_arguments(&r, &err) : HG_E_NOMEM;
    if (!status)
        status = render_all(&r, &err);
    enum hg_cli_exit code = status ? hg_cli_report(&r.cli, r.doing, &err) : HG_CLI_EXIT_OK;
    size_t done = json_array_size(r.frames);
    if (code == HG_CLI_EXIT_STOPPED && options->has_frames && done)
        fprintf(stderr, "helio: %zu frames are written; --frames %u-%u:%u renders the rest\n", done,
            options->frames.first + (uint32_t)done * options->frames.step, options->frames.last,
            options->frames.step);
    hg_cli_finish(&r.cli);
    json_decref(r.frames);
    return code;
}
