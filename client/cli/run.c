// run.c - helio run: executes the steps of a script.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/cli/cli.h"
#include "client/cli/junit.h"
#include "client/cli/script.h"

enum { SCRIPT_BYTES = 16 * 1024 * 1024, ASSETS_MAX = 256 };

static const double pi = 3.14159265358979323846;

struct run {
    struct hg_cli cli;
    const struct hg_cli_options *o;
    struct hg_cli_script script;
    struct hg_cli_junit junit;
    struct hg_cli_texts files; // read by a private worker
    enum hg_cli_doing doing;
    char folder[4096]; // of the script, for ${SCRIPT_DIR}

    uint32_t assets[ASSETS_MAX], asset_count; // loaded, as sent
    uint32_t lights;
    bool has_demo, has_env, has_camera;
    bool dirty;                  // changed since `frame` was made
    uint32_t width, height;      // of the view
    struct helio_message *frame; // newest one, or NULL
};

// ---- variables ---------------------------------------------------------------------------------

static const char *variable(void *user, const char *name, size_t length)
{
    struct run *r = user;
    char text[256];
    for (uint32_t i = r->o->define.count; i-- > 0;) {
        const char *d = r->o->define.items[i];
        if (strncmp(d, name, length) == 0 && d[length] == '=')
            return d + length + 1;
    }
    if (length == strlen("SCRIPT_DIR") && memcmp(name, "SCRIPT_DIR", length) == 0)
        return r->folder;
    if (length >= sizeof text)
        return NULL;
    snprintf(text, sizeof text, "%.*s", (int)length, name);
    return getenv(text);
}

static enum hg_status check_defines(const struct hg_cli_options *o, struct hg_error *err)
{
    for (uint32_t i = 0; i < o->define.count; i++)
        if (!strchr(o->define.items[i], '=') || o->define.items[i][0] == '=')
            return hg_error_set(
                err, HG_E_INVAL, "--define", NULL, "'%s' is not NAME=VALUE", o->define.items[i]);
    return HG_OK;
}

// ---- connection --------------------------------------------------------------------------------

static void forget(struct run *r)
{
    helio_message_free(r->frame);
    r->frame = NULL;
    r->asset_count = r->lights = 0;
    r->has_demo = r->has_env = r->has_camera = false;
    r->dirty = true;
    r->width = HGP_STANDARD_width;
    r->height = HGP_STANDARD_height;
}

static enum hg_status connect_to(struct run *r, const char *url, struct hg_error *err)
{
    forget(r);
    r->doing = HG_CLI_DOING_CONNECT;
    struct hg_cli_progress progress = r->cli.progress;
    hg_cli_finish(&r->cli);
    r->cli.progress = progress;
    r->cli.progress.warnings = 0; // said
    struct hgp_view_set view = {.view = HG_CLI_VIEW};
    enum hg_status status = hg_cli_connect(&r->cli, url, &r->files, true, err);
    if (status)
        return status;
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

static enum hg_status need_connection(struct run *r, struct hg_error *err)
{
    return r->cli.h ? HG_OK : connect_to(r, r->o->connect, err);
}

// The worker starts before the script loads anything: its folders are gathered first.
static void gather_files(struct run *r)
{
    for (size_t i = 0; i < r->script.count; i++) {
        const struct hg_cli_step *s = &r->script.steps[i];
        bool read = s->kind == HG_CLI_STEP_LOAD || (s->kind == HG_CLI_STEP_ENVIRONMENT && s->path);
        if (read && r->files.count < HG_CLI_TEXTS_MAX)
            r->files.items[r->files.count++] = s->path;
    }
}

// ---- edits -------------------------------------------------------------------------------------

static enum hg_status call_ok(
    struct run *r, enum hgp_type type, const void *message, struct hg_error *err)
{
    r->dirty = true;
    return helio_call_for(r->cli.h, type, message, HGP_T_ok, NULL, err);
}

// Asset numbers of scripts count from 1; those on the wire lie in the session's range.
static uint32_t wire_asset(const struct run *r, uint32_t asset)
{
    return r->cli.scene.first_id + asset - 1;
}

static enum hg_status do_load(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    char *path;
    struct hgp_asset_loaded loaded;
    uint32_t number = s->asset ? s->asset : r->asset_count + 1;
    r->doing = HG_CLI_DOING_INPUT;
    hg_cli_progress_stage(&r->cli.progress, "loading");
    if (number > r->cli.scene.id_count || r->asset_count == ASSETS_MAX)
        return hg_error_set(err, HG_E_LIMIT, "load", NULL, "too many assets");
    enum hg_status status = hg_cli_server_path(&r->cli, s->path, &path, err);
    if (status)
        return status;
    status = helio_load(r->cli.h, wire_asset(r, number), path, &loaded, err);
    hg_free(path);
    if (status)
        return status;
    r->assets[r->asset_count++] = wire_asset(r, number);
    r->lights += loaded.lights;
    r->has_demo |= strcmp(s->path, "demo:") == 0;
    r->dirty = true;
    return HG_OK;
}

static enum hg_status do_environment(
    struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_environment_set e = s->environment;
    char *path = NULL;
    r->doing = HG_CLI_DOING_INPUT;
    if (s->path) {
        enum hg_status status = hg_cli_server_path(&r->cli, s->path, &path, err);
        if (status)
            return status;
        e.has_path = true;
        e.path = hgp_str_make(path);
    }
    r->has_env = true;
    enum hg_status status = call_ok(r, HGP_T_environment_set, &e, err);
    hg_free(path);
    return status;
}

static enum hg_status do_view(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_view_set view = s->view;
    view.view = HG_CLI_VIEW;
    enum hg_status status = call_ok(r, HGP_T_view_set, &view, err);
    if (status || !view.has_width)
        return status;
    r->width = view.width;
    r->height = view.height;
    return HG_OK;
}

// A material by "ASSET:INDEX", or by its name in the scene's description.
static enum hg_status find_material(
    struct run *r, const char *name, uint64_t *id, struct hg_error *err)
{
    char *text;
    json_error_t wrong;
    *id = hg_cli_parse_object(&r->cli, name);
    if (*id)
        return HG_OK;
    enum hg_status status = helio_query_json(r->cli.h, HGP_T_info_query, 0, &text, err);
    if (status)
        return status;
    json_t *info = json_loads(text, 0, &wrong), *asset, *entry;
    helio_text_free(text);
    size_t a, i;
    json_array_foreach(json_object_get(info, "assets"), a, asset)
    {
        json_array_foreach(json_object_get(asset, "materials"), i, entry)
        {
            const char *known = json_string_value(json_object_get(entry, "name"));
            if (known && strcmp(known, name) == 0 && !*id && a < r->asset_count)
                *id = helio_object_id(r->assets[a], (uint32_t)i);
        }
    }
    json_decref(info);
    return *id ? HG_OK
               : hg_error_set(err, HG_E_NOTFOUND, "material", name,
                     "no material of that name; ASSET:INDEX names one by number");
}

static enum hg_status do_camera(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_view_camera camera = s->camera;
    enum hg_status status = HG_OK;
    camera.has_lens_radius = camera.has_focus_distance = true; // not those of the camera before
    if (s->kind == HG_CLI_STEP_CAMERA_FIT)
        status = hg_cli_fit_camera(
            &r->cli, s->number * pi / 180, (double)r->width / r->height, &camera, err);
    else if (s->kind == HG_CLI_STEP_CAMERA_NODE)
        status = hg_cli_find_camera(&r->cli, s->name, &camera.camera, err);
    camera.has_camera = camera.camera != 0;
    camera.view = HG_CLI_VIEW;
    camera.input_seq = s->line;
    r->has_camera = true;
    r->dirty = true;
    return status ? status : hg_cli_send_camera(&r->cli, &camera, err);
}

static enum hg_status do_time(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < r->asset_count && !status; i++) {
        if (s->asset && r->assets[i] != wire_asset(r, s->asset))
            continue;
        struct hgp_animation_set a = {.asset = r->assets[i], .animation = -1, .time_s = s->number};
        status = call_ok(r, HGP_T_animation_set, &a, err);
    }
    return status;
}

static enum hg_status do_edit(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status;
    if (s->kind == HG_CLI_STEP_VARIANT) {
        struct hgp_variant_set v = {
            .asset = wire_asset(r, s->asset ? s->asset : 1), .variant = hgp_str_make(s->name)};
        return call_ok(r, HGP_T_variant_set, &v, err);
    }
    if (s->kind == HG_CLI_STEP_NODE) {
        struct hgp_node_set n = s->node;
        status = hg_cli_find_node(&r->cli, s->name, &n.node, err);
        return status ? status : call_ok(r, HGP_T_node_set, &n, err);
    }
    struct hgp_material_set m = s->material;
    status = find_material(r, s->name, &m.material, err);
    return status ? status : call_ok(r, HGP_T_material_set, &m, err);
}

// ---- frames ------------------------------------------------------------------------------------

// What helio render would do: light for a scene without any, a camera when none was chosen.
static enum hg_status complete_scene(struct run *r, struct hg_error *err)
{
    enum hg_status status;
    if (!r->has_env && !r->has_demo && r->asset_count && !r->lights) {
        struct hgp_environment_set sky = {.has_kind = true, .kind = HGP_environment_kind_SKY};
        status = call_ok(r, HGP_T_environment_set, &sky, err);
        if (status)
            return status;
        r->has_env = true;
    }
    if (r->has_camera)
        return HG_OK;
    uint64_t node;
    status = hg_cli_find_camera(&r->cli, NULL, &node, err);
    if (status)
        return status;
    struct hg_cli_step step = {.kind = HG_CLI_STEP_CAMERA_FIT, .number = 45};
    if (node) {
        step.kind = HG_CLI_STEP_CAMERA;
        step.camera.camera = node;
    }
    return do_camera(r, &step, err);
}

static enum hg_status take_frame(
    struct run *r, const struct hg_cli_format *format, bool now, struct hg_error *err)
{
    struct hgp_frame_request request = {
        .view = HG_CLI_VIEW,
        .settled = !now,
        .has_encoding = true,
        .encoding = format->encoding,
        .has_quality = true,
        .quality = format->quality,
    };
    helio_message_free(r->frame);
    r->frame = NULL;
    r->doing = HG_CLI_DOING_RENDER;
    hg_cli_progress_stage(&r->cli.progress, "rendering");
    r->dirty = true;
    enum hg_status status = complete_scene(r, err);
    if (status)
        return status;
    status = helio_frame(r->cli.h, &request, &r->frame, err);
    if (status)
        return status;
    status = hg_cli_drain_queue(&r->cli, err);
    r->dirty = status != HG_OK;
    return status;
}

static const struct hg_cli_format png = {HGP_encoding_PNG8, 90, NULL};

static enum hg_status do_frame(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hg_cli_format format = png;
    if (!s->path)
        return take_frame(r, &png, s->now, err);
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = hg_cli_format_of(s->path, NULL, &format, err);
    if (status)
        return status;
    status = hg_cli_check_output(format.path, err);
    if (status)
        return status;
    status = take_frame(r, &format, s->now, err);
    if (status)
        return status;
    const struct hgp_frame *frame = &r->frame->body->frame;
    r->doing = HG_CLI_DOING_OUTPUT;
    return hg_cli_write_output(format.path, frame->data.data, frame->data.size, err);
}

// ---- expectations ------------------------------------------------------------------------------

// What an expectation found; not finding it at all is a status.
struct sight {
    bool holds;
    char seen[256];
};

static enum hg_status see_image(
    struct run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    struct hg_cli_bytes reference = {0};
    enum hg_status status =
        hg_file_read(s->path, HG_CLI_IMAGE_BYTES, &reference.data, &reference.size, err);
    if (status)
        return status;
    const struct hgp_frame *frame = &r->frame->body->frame;
    struct hg_cli_comparison result = {
        .metric = s->metric,
        .a = {(uint8_t *)(uintptr_t)frame->data.data, frame->data.size},
        .b = reference,
    };
    status = hg_cli_compare(&r->cli, &result, err);
    hg_free(reference.data);
    if (status)
        return status;
    sight->holds = hg_cli_op_holds(s->op, result.value, s->number);
    snprintf(sight->seen, sizeof sight->seen, "%.6g", result.value);
    return HG_OK;
}

// "a.b.c" as one key, or as a path of keys; numbers index arrays.
static json_t *find_key(json_t *object, const char *key)
{
    json_t *whole = json_object_get(object, key);
    if (whole || !object)
        return whole;
    char part[128];
    size_t n = strcspn(key, ".");
    if (n >= sizeof part)
        return NULL;
    snprintf(part, sizeof part, "%.*s", (int)n, key);
    json_t *child = json_is_array(object) ? json_array_get(object, strtoul(part, NULL, 10))
                                          : json_object_get(object, part);
    return key[n] ? find_key(child, key + n + 1) : child;
}

static enum hg_status see_stat(
    struct run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    json_t *stats;
    enum hg_status status = hg_cli_stats(&r->cli, &stats, err);
    if (status)
        return status;
    json_t *value = find_key(stats, s->name);
    if (json_is_number(value) || json_is_boolean(value)) {
        double v = json_is_number(value) ? json_number_value(value) : json_is_true(value);
        sight->holds = hg_cli_op_holds(s->op, v, s->number);
        snprintf(sight->seen, sizeof sight->seen, "%.9g", v);
    } else {
        sight->holds = false;
        snprintf(sight->seen, sizeof sight->seen, "%s", value ? "not a number" : "no such key");
    }
    json_decref(stats);
    return HG_OK;
}

static enum hg_status see_pick(
    struct run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    struct hgp_pick pick = {.view = HG_CLI_VIEW, .x = s->x, .y = s->y};
    struct helio_message *answer;
    uint64_t wanted = 0;
    enum hg_status status = s->name ? hg_cli_find_node(&r->cli, s->name, &wanted, err) : HG_OK;
    if (status)
        return status;
    status = helio_call_for(r->cli.h, HGP_T_pick, &pick, HGP_T_picked, &answer, err);
    if (status)
        return status;
    const struct hgp_picked *got = &answer->body->picked;
    sight->holds = s->name ? got->hit && got->node == wanted : !got->hit;
    if (got->hit)
        snprintf(sight->seen, sizeof sight->seen, "node %u:%u",
            (unsigned)(got->node >> 32) - r->cli.scene.first_id + 1, (unsigned)got->node);
    else
        snprintf(sight->seen, sizeof sight->seen, "nothing");
    helio_message_free(answer);
    return HG_OK;
}

static enum hg_status see_hash(struct run *r, const struct hg_cli_step *s, struct sight *sight)
{
    const struct hgp_frame *frame = &r->frame->body->frame;
    char hex[65] = "no hash: the frame is not settled and lossless";
    for (int i = 0; frame->has_hash && i < 32; i++)
        snprintf(hex + 2 * i, 3, "%02x", frame->hash[i]);
    sight->holds = strcmp(hex, s->name) == 0;
    snprintf(sight->seen, sizeof sight->seen, "%s", hex);
    return HG_OK;
}

static enum hg_status see(
    struct run *r, const struct hg_cli_step *s, struct sight *sight, struct hg_error *err)
{
    r->doing = HG_CLI_DOING_RENDER;
    if (r->dirty || !r->frame) {
        enum hg_status status = take_frame(r, &png, false, err);
        if (status)
            return status;
    }
    switch (s->kind) {
    case HG_CLI_STEP_EXPECT_IMAGE:
        return see_image(r, s, sight, err);
    case HG_CLI_STEP_EXPECT_STAT:
        return see_stat(r, s, sight, err);
    case HG_CLI_STEP_EXPECT_PICK:
        return see_pick(r, s, sight, err);
    default:
        return see_hash(r, s, sight);
    }
}

static bool is_connection_lost(struct run *r)
{
    struct helio_info info = {.state = HELIO_CLOSED};
    if (r->cli.h)
        helio_get_info(r->cli.h, &info);
    return info.state == HELIO_CLOSED || hg_cli_is_stopped();
}

// A failed expectation is noted and the script goes on; HG_OK unless the connection is gone.
static enum hg_status do_expect(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    char name[256], message[1024], reason[400];
    struct sight sight = {0};
    uint64_t begin = hg_clock_now_ns();
    enum hg_status status = see(r, s, &sight, err);
    if (status && is_connection_lost(r))
        return status;
    snprintf(name, sizeof name, "line %u: %s", s->line, s->text);
    if (status) {
        hg_error_format(err, reason, sizeof reason);
        snprintf(message, sizeof message, "%.200s:%u: expected: %.200s; seen: %s", r->o->args[0],
            s->line, s->text, reason);
    } else {
        snprintf(message, sizeof message, "%.200s:%u: expected: %.200s; seen: %s", r->o->args[0],
            s->line, s->text, sight.seen);
    }
    if (!sight.holds) {
        char clean[1024];
        hg_cli_progress_clear(&r->cli.progress);
        hg_cli_clean(clean, sizeof clean, message, strlen(message));
        fprintf(stderr, "%s\n", clean);
    }
    if (hg_cli_junit_add(&r->junit, name, sight.holds ? HG_CLI_PASSED : HG_CLI_DIFFERS, message,
            hg_clock_now_ns() - begin))
        return hg_error_set(err, HG_E_NOMEM, "report", NULL, "no memory");
    return HG_OK;
}

// ---- the command -------------------------------------------------------------------------------

static enum hg_status do_step(struct run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    if (s->kind == HG_CLI_STEP_CONNECT)
        return connect_to(r, s->path, err);
    enum hg_status status = need_connection(r, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    switch (s->kind) {
    case HG_CLI_STEP_LOAD:
        return do_load(r, s, err);
    case HG_CLI_STEP_VIEW:
        return do_view(r, s, err);
    case HG_CLI_STEP_ENVIRONMENT:
        return do_environment(r, s, err);
    case HG_CLI_STEP_VARIANT:
    case HG_CLI_STEP_NODE:
    case HG_CLI_STEP_MATERIAL:
        return do_edit(r, s, err);
    case HG_CLI_STEP_CAMERA:
    case HG_CLI_STEP_CAMERA_NODE:
    case HG_CLI_STEP_CAMERA_FIT:
        return do_camera(r, s, err);
    case HG_CLI_STEP_TIME:
        return do_time(r, s, err);
    case HG_CLI_STEP_FRAME:
        return do_frame(r, s, err);
    default:
        return do_expect(r, s, err);
    }
}

static enum hg_status read_script(struct run *r, struct hg_error *err)
{
    uint8_t *text;
    size_t size;
    const char *path = r->o->args[0], *slash = strrchr(path, '/');
    snprintf(
        r->folder, sizeof r->folder, "%.*s", slash ? (int)(slash - path) : 1, slash ? path : ".");
    enum hg_status status = check_defines(r->o, err);
    if (status)
        return status;
    status = r->o->junit ? hg_cli_check_output(r->o->junit, err) : HG_OK;
    if (status)
        return status;
    r->doing = HG_CLI_DOING_INPUT;
    status = hg_file_read(path, SCRIPT_BYTES, &text, &size, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    if (strlen((const char *)text) != size)
        status = hg_error_set(err, HG_E_INVAL, path, NULL, "holds a zero byte");
    else
        status = hg_cli_script_parse(path, (const char *)text, variable, r, &r->script, err);
    hg_free(text);
    return status;
}

// The line that ended the script, on the error stream and in the report.
static void report_broken(struct run *r, const struct hg_cli_step *s, const struct hg_error *err)
{
    char name[256], message[1024], reason[400];
    hg_error_format(err, reason, sizeof reason);
    snprintf(name, sizeof name, "line %u: %s", s->line, s->text);
    snprintf(
        message, sizeof message, "%.200s:%u: %.200s: %s", r->o->args[0], s->line, s->text, reason);
    hg_cli_progress_clear(&r->cli.progress);
    fprintf(stderr, "%s:%u: %.200s\n", r->o->args[0], s->line, s->text);
    if (hg_cli_junit_add(&r->junit, name, HG_CLI_BROKEN, message, 0))
        fprintf(stderr, "helio: no memory for the report\n");
}

static enum hg_status write_report(struct run *r, struct hg_error *err)
{
    struct hg_writer w = {0};
    enum hg_status status = hg_cli_junit_write(&r->junit, r->o->args[0], &w);
    if (status)
        hg_error_set(err, status, r->o->junit, NULL, "no memory for the report");
    else
        status = hg_cli_write_output(r->o->junit, w.data, w.size, err);
    hg_writer_finish(&w);
    return status;
}

static enum hg_cli_exit run_all(struct run *r)
{
    struct hg_error err = {0};
    enum hg_cli_exit code = HG_CLI_EXIT_OK;
    enum hg_status status = read_script(r, &err);
    if (status && r->script.count == 0) {
        code = hg_cli_report(NULL, r->doing, &err);
        if (hg_cli_junit_add(&r->junit, "script", HG_CLI_BROKEN, err.reason, 0))
            return code;
    }
    if (!status)
        gather_files(r);
    for (size_t i = 0; !status && i < r->script.count; i++) {
        const struct hg_cli_step *s = &r->script.steps[i];
        status = hg_cli_is_stopped() ? HG_E_CANCELLED : do_step(r, s, &err);
        if (status) {
            err.status = status;
            report_broken(r, s, &err);
            code = hg_cli_report(&r->cli, r->doing, &err);
        }
    }
    size_t failed = hg_cli_junit_count(&r->junit, HG_CLI_DIFFERS);
    if (!status) {
        hg_cli_progress_clear(&r->cli.progress);
        fprintf(r->o->junit && hg_cli_is_stdout(r->o->junit) ? stderr : stdout,
            "%s: %zu expectation%s, %zu failed\n", r->o->args[0], r->junit.count,
            r->junit.count == 1 ? "" : "s", failed);
        code = failed ? HG_CLI_EXIT_FAILED : HG_CLI_EXIT_OK;
    }
    if (r->o->junit && write_report(r, &err))
        code = hg_cli_report(&r->cli, HG_CLI_DOING_OUTPUT, &err);
    return code;
}

enum hg_cli_exit hg_cli_run(const struct hg_cli_options *options)
{
    struct run *r = hg_calloc(1, sizeof *r);
    if (!r)
        return HG_CLI_EXIT_LIMIT;
    r->o = options;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    hg_cli_init(&r->cli, options);
    forget(r);
    enum hg_cli_exit code = run_all(r);
    helio_message_free(r->frame);
    hg_cli_finish(&r->cli);
    hg_cli_junit_finish(&r->junit);
    hg_cli_script_finish(&r->script);
    hg_free(r);
    return code;
}
