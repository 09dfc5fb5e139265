// run_edit.c - helio run: steps that change the scene or the view.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/cli/animations.h"
#include "client/cli/run/run.h"
#include "client/cli/suggest.h"

enum { PROFILE_BYTES = 4194304 }; // of a photometric file, light_set.profile

static enum hg_status call_ok(
    struct hg_cli_run *r, enum hgp_type type, const void *message, struct hg_error *err)
{
    hg_cli_run_changed(r);
    return helio_call_for(r->cli.h, type, message, HGP_T_ok, NULL, err);
}

// Asset numbers of scripts count from 1; those on the wire lie in the session's range.
static uint32_t wire_asset(const struct hg_cli_run *r, uint32_t asset)
{
    return r->cli.scene.first_id + asset - 1;
}

static enum hg_status do_load(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    char *path;
    uint32_t number = s->asset ? s->asset : r->scene.asset_count + 1;
    r->doing = HG_CLI_DOING_INPUT;
    hg_cli_progress_stage(&r->cli.progress, "loading");
    if (number > r->cli.scene.id_count || r->scene.asset_count == HG_CLI_RUN_ASSETS_MAX)
        return hg_error_set(err, HG_E_LIMIT, "load", NULL, "too many assets");
    enum hg_status status = hg_cli_server_path(&r->cli, s->path, &path, err);
    if (status)
        return status;
    const uint64_t begin_ns = hg_clock_now_ns();
    struct hgp_asset_load load = {
        .asset = wire_asset(r, number), .path = hgp_str_make(path), .has_up = true, .up = s->up};
    if (s->name != NULL)
        status = hg_cli_parse_point_size("load", s->name, &load, err);
    if (!status)
        status = helio_call_for(r->cli.h, HGP_T_asset_load, &load, HGP_T_asset_loaded, NULL, err);
    r->load_ns += hg_clock_now_ns() - begin_ns;
    hg_free(path);
    if (status)
        return status;
    r->scene.assets[r->scene.asset_count++] = wire_asset(r, number);
    hg_cli_run_changed(r);
    return HG_OK;
}

static enum hg_status do_environment(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
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
    enum hg_status status = call_ok(r, HGP_T_environment_set, &e, err);
    hg_free(path);
    return status;
}

static enum hg_status do_view(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_view_set view = s->view;
    view.view = r->cli.view;
    hg_cli_run_now(r)->has_exposure |= view.has_exposure_mode;
    return call_ok(r, HGP_T_view_set, &view, err);
}

// Objects that the scene's description lists by name.
struct named {
    const char *list, *what, *unknown;
};

static const struct named named_materials = {
    "materials", "material", "no material of that name; ASSET:INDEX names one by number"};
static const struct named named_lights = {
    "lights", "light", "no light of that name; ASSET:INDEX names one by number"};

// One of them by "ASSET:INDEX", or by its name.
static enum hg_status find_named(struct hg_cli_run *r, const struct named *of, const char *name,
    uint64_t *id, struct hg_error *err)
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
    struct hg_suggestion near = hg_suggest_begin(name, strlen(name));
    size_t a, i;
    json_array_foreach(json_object_get(info, "assets"), a, asset)
    {
        json_array_foreach(json_object_get(asset, of->list), i, entry)
        {
            const char *known = json_string_value(json_object_get(entry, "name"));
            if (known)
                hg_suggest_offer(&near, known, strlen(known));
            if (known && strcmp(known, name) == 0 && !*id && a < r->scene.asset_count)
                *id = helio_object_id(r->scene.assets[a], (uint32_t)i);
        }
    }
    json_decref(info);
    return *id ? HG_OK
               : hg_error_set(err, HG_E_NOTFOUND, of->what, name, "%s%s", of->unknown,
                     hg_suggest_text(&near).text);
}

static enum hg_status do_camera(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_view_camera camera = s->camera;
    enum hg_status status = HG_OK;
    camera.has_lens_radius = camera.has_focus_distance = true; // not those of the camera before
    if (s->kind == HG_CLI_STEP_CAMERA_FIT) {
        struct hgp_view_fit fit = s->fit;
        fit.view = r->cli.view;
        status = helio_camera_fit(r->cli.h, &fit, &camera, err);
    } else if (s->kind == HG_CLI_STEP_CAMERA_NODE) {
        status = hg_cli_find_camera(&r->cli, "camera node", s->name, &camera.camera, err);
    }
    camera.has_camera = camera.camera != 0;
    hg_cli_run_now(r)->fitted = s->kind == HG_CLI_STEP_CAMERA_FIT && !camera.has_camera;
    camera.view = r->cli.view;
    camera.input_seq = s->line;
    hg_cli_run_now(r)->has_camera = true;
    hg_cli_run_now(r)->dirty = true;
    return status ? status : hg_cli_send_camera(&r->cli, &camera, err);
}

static enum hg_status do_time(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < r->scene.asset_count && !status; i++) {
        if (s->asset && r->scene.assets[i] != wire_asset(r, s->asset))
            continue;
        struct hg_cli_animations chosen = {.count = s->name != NULL};
        hg_cli_run_changed(r);
        if (s->name)
            status = hg_cli_animation_find(&r->cli, i, "at", s->name, chosen.items, err);
        if (!status)
            status = hg_cli_animations_pose(&r->cli, r->scene.assets[i], &chosen, s->number, err);
    }
    return status;
}

static enum hg_status do_light(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    struct hgp_light_set l = s->light;
    uint8_t *data = NULL;
    size_t size = 0;
    enum hg_status status = find_named(r, &named_lights, s->name, &l.light, err);
    l.has_profile = s->path != NULL;
    if (!status && s->path && strcmp(s->path, "none") != 0)
        status = hg_file_read(s->path, PROFILE_BYTES, &data, &size, err);
    if (!status) {
        l.profile = (struct hgp_bytes){data, (uint32_t)size};
        status = call_ok(r, HGP_T_light_set, &l, err);
    }
    if (status == HG_E_FORMAT && strcmp(err->what, "profile") == 0) // the server knows no file
        snprintf(err->what, sizeof err->what, "%s", s->path);
    hg_free(data);
    return status;
}

// Variants, nodes, lights and materials.
static enum hg_status do_object(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
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
    if (s->kind == HG_CLI_STEP_LIGHT)
        return do_light(r, s, err);
    struct hgp_material_set m = s->material;
    status = find_named(r, &named_materials, s->name, &m.material, err);
    return status ? status : call_ok(r, HGP_T_material_set, &m, err);
}

enum hg_status hg_cli_run_edit(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    switch (s->kind) {
    case HG_CLI_STEP_LOAD:
        return do_load(r, s, err);
    case HG_CLI_STEP_VIEW:
        return do_view(r, s, err);
    case HG_CLI_STEP_ENVIRONMENT:
        return do_environment(r, s, err);
    case HG_CLI_STEP_CAMERA:
    case HG_CLI_STEP_CAMERA_NODE:
    case HG_CLI_STEP_CAMERA_FIT:
        return do_camera(r, s, err);
    case HG_CLI_STEP_TIME:
        return do_time(r, s, err);
    case HG_CLI_STEP_CLIP:
    case HG_CLI_STEP_OVERRIDE:
    case HG_CLI_STEP_VIEW_VARIANT:
        return hg_cli_run_look(r, s, err);
    default:
        return do_object(r, s, err);
    }
}

enum hg_status hg_cli_run_complete(struct hg_cli_run *r, struct hg_error *err)
{
    // What is in the scene comes from others, who may be loading just now: the daemon's automatic
    // camera follows them.
    if (hg_cli_run_now(r)->has_camera || r->scene.asset_count == 0)
        return HG_OK;
    const struct hg_cli_step step = {
        .kind = HG_CLI_STEP_CAMERA_FIT, .fit = {.has_cameras = true, .cameras = true}};
    return do_camera(r, &step, err);
}
