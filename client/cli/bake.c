// bake.c - helio bake: page packs and cluster files of a scene, into a cache folder.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "client/cli/cli.h"

static enum hg_status check_arguments(const struct hg_cli_options *o, struct hg_error *err)
{
    if (!o->bake_dir)
        return hg_error_set(
            err, HG_E_INVAL, "--output", NULL, "is needed: the cache folder to fill");
    if (o->textures_only && o->geometry_only)
        return hg_error_set(
            err, HG_E_INVAL, "--textures-only", NULL, "cannot be combined with --geometry-only");
    return o->stats_file ? hg_cli_check_output(o->stats_file, err) : HG_OK;
}

// A worker without a cache folder works all the same, but here it is what is asked for.
static enum hg_status check_folder(const char *dir, struct hg_error *err)
{
    struct stat st;
    if (mkdir(dir, 0777) && errno != EEXIST)
        return hg_error_set(err, hg_status_from_errno(errno), dir, NULL,
            "cannot make the folder: %s", strerror(errno));
    if (stat(dir, &st) || !S_ISDIR(st.st_mode))
        return hg_error_set(err, HG_E_INVAL, dir, NULL, "is not a folder");
    if (access(dir, W_OK | X_OK))
        return hg_error_set(
            err, hg_status_from_errno(errno), dir, NULL, "cannot write to it: %s", strerror(errno));
    return HG_OK;
}

static enum hg_status load(struct hg_cli *cli, const char *scene, struct hg_error *err)
{
    struct hgp_asset_load load = {.asset = cli->scene.first_id,
        .has_scene_index = cli->options->has_scene_index,
        .scene_index = (int32_t)cli->options->scene_index};
    if (cli->options->has_point_size &&
        hg_cli_parse_point_size("--point-size", cli->options->point_size, &load, err) != HG_OK)
        return err->status;
    char *path = NULL;
    hg_cli_progress_stage(&cli->progress, "loading");
    enum hg_status status = hg_cli_server_path(cli, scene, &path, err);
    load.path = hgp_str_make(path ? path : "");
    if (!status)
        status = helio_call_for(cli->h, HGP_T_asset_load, &load, HGP_T_asset_loaded, NULL, err);
    hg_free(path);
    return status;
}

static enum hg_status bake(struct hg_cli *cli, char **text, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    struct helio_message *answer = NULL;
    struct hgp_bake request = {.options = hgp_str_make(o->textures_only   ? "{\"geometry\":false}"
                                                       : o->geometry_only ? "{\"textures\":false}"
                                                                          : "{}")};
    *text = NULL;
    hg_cli_progress_stage(&cli->progress, "baking");
    enum hg_status status = helio_call_for(cli->h, HGP_T_bake, &request, HGP_T_json, &answer, err);
    if (!status) {
        const struct hgp_str *json = &answer->body->json.text;
        *text = hg_strndup(json->data ? json->data : "", json->size);
        if (!*text)
            status = hg_error_set(err, HG_E_NOMEM, "bake", NULL, "no memory for the report");
    }
    helio_message_free(answer);
    return status;
}

// Names what could not be baked; true when there is something.
static bool warn_failures(struct hg_cli_progress *progress, const json_t *report)
{
    static const char *const halves[] = {"textures", "geometry"};
    bool any = false;
    for (int i = 0; i < 2; i++) {
        size_t at;
        json_t *entry;
        json_array_foreach(
            json_object_get(json_object_get(report, halves[i]), "failures"), at, entry)
        {
            const char *what = json_string_value(json_object_get(entry, "what"));
            const char *reason = json_string_value(json_object_get(entry, "reason"));
            char clean[600];
            snprintf(clean, sizeof clean, "%s: %s", what ? what : "", reason ? reason : "");
            hg_cli_clean(clean, sizeof clean, clean, strlen(clean));
            hg_cli_progress_say(progress, "not baked: %s", clean);
            any = true;
        }
    }
    return any;
}

static double number_of(const json_t *report, const char *part, const char *key)
{
    return json_number_value(json_object_get(json_object_get(report, part), key));
}

// HG_E_LIMIT: DIR holds less than the scene takes, so that some of it took the place of the rest;
// HG_E_NOSPACE: so does its disk.
static enum hg_status check_room(const json_t *report, struct hg_error *err)
{
    const double limit = number_of(report, "cache", "limit_bytes"),
                 absent = number_of(report, "cache", "absent"),
                 bytes = number_of(report, "textures", "pack_bytes") +
                         number_of(report, "geometry", "file_bytes");
    const bool tight = limit > 0 && bytes > limit && number_of(report, "cache", "evicted") > 0;
    if (absent == 0 && !tight)
        return HG_OK;
    if (!tight)
        return hg_error_set(err, HG_E_NOSPACE, "--output", NULL,
            "%.0f of the scene's packs and files are not there: its disk is full, or another "
            "program deleted them to have room for its own",
            absent);
    return hg_error_set(err, HG_E_LIMIT, "--cache-limit", NULL,
        "the scene takes %.1f MiB and the folder may hold %.1f: not all of it is there",
        bytes / (1 << 20), limit / (1 << 20));
}

static enum hg_status write_report(
    const struct hg_cli_options *o, json_t *report, struct hg_error *err)
{
    char *text = report ? json_dumps(report, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) : NULL;
    enum hg_status status = HG_OK;
    if (!text)
        return hg_error_set(err, HG_E_NOMEM, "report", NULL, "no memory");
    if (o->stats_file)
        status = hg_cli_write_output(o->stats_file, text, strlen(text), err);
    else if (puts(text) == EOF)
        status = hg_error_set(err, HG_E_IO, "standard output", NULL, "cannot write");
    free(text);
    return status;
}

static enum hg_status check_scene(
    const struct hg_cli *cli, const char *name, enum hg_cli_doing *doing, struct hg_error *err)
{
    char *path = NULL;
    enum hg_status status = hg_cli_server_path(cli, name, &path, err);
    hg_free(path);
    if (status)
        *doing = HG_CLI_DOING_INPUT;
    return status;
}

enum hg_cli_exit hg_cli_bake(const struct hg_cli_options *options)
{
    struct hg_cli cli;
    struct hg_error err = {0};
    struct hg_cli_texts files = {.items = {options->args[0]}, .count = 1};
    enum hg_cli_doing doing = HG_CLI_DOING_ARGUMENTS;
    char *text = NULL;
    hg_cli_init(&cli, options);
    cli.embedded = true;
    enum hg_status status = check_arguments(options, &err);
    if (!status)
        status = check_scene(&cli, options->args[0], &doing, &err); // before a folder is made
    if (!status)
        status = check_folder(options->bake_dir, &err);
    if (!status) {
        doing = HG_CLI_DOING_CONNECT;
        status = hg_cli_connect(&cli, NULL, &files, true, &err);
    }
    if (!status) {
        doing = HG_CLI_DOING_INPUT;
        status = load(&cli, options->args[0], &err);
        if (!status)
            status = hg_cli_check_warnings(&cli, &err);
    }
    if (!status) {
        doing = HG_CLI_DOING_RENDER;
        status = bake(&cli, &text, &err);
    }
    hg_cli_progress_clear(&cli.progress);
    json_t *report = text ? json_loads(text, 0, NULL) : NULL;
    if (!status) {
        doing = HG_CLI_DOING_OUTPUT;
        status = write_report(options, report, &err);
    }
    if (!status)
        status = check_room(report, &err);
    bool failed = warn_failures(&cli.progress, report);
    json_decref(report);
    hg_free(text);
    enum hg_cli_exit code = status   ? hg_cli_report(&cli, doing, &err)
                            : failed ? HG_CLI_EXIT_INPUT
                                     : HG_CLI_EXIT_OK;
    hg_cli_finish(&cli, code);
    return code;
}
