// info.c - helio info: what a scene file holds, as a table or JSON.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/cli.h"

enum { LIST_LINES = 24 }; // longer lists are cut; --json prints them whole

static void print_scalar(const json_t *value)
{
    char text[512];
    if (json_is_string(value)) {
        hg_cli_clean(text, sizeof text, json_string_value(value), json_string_length(value));
        fputs(text, stdout);
    } else if (json_is_integer(value)) {
        printf("%lld", (long long)json_integer_value(value));
    } else if (json_is_real(value)) {
        printf("%.6g", json_real_value(value));
    } else {
        fputs(json_is_true(value) ? "yes" : json_is_false(value) ? "no" : "-", stdout);
    }
}

static bool is_scalar(const json_t *value)
{
    return !json_is_object(value) && !json_is_array(value);
}

static bool is_flat(const json_t *array)
{
    size_t i;
    json_t *entry;
    json_array_foreach((json_t *)(uintptr_t)array, i, entry) if (!is_scalar(entry)) return false;
    return true;
}

// Members of an object on one line: "key value, key value".
static void print_inline(json_t *object)
{
    const char *key;
    json_t *value;
    const char *separator = "";
    if (!json_is_object(object)) {
        print_scalar(object);
        return;
    }
    json_object_foreach(object, key, value)
    {
        if (json_is_object(value) || (json_is_array(value) && !is_flat(value)))
            continue;
        printf("%s%s ", separator, key);
        separator = ", ";
        if (is_scalar(value)) {
            print_scalar(value);
            continue;
        }
        for (size_t i = 0; i < json_array_size(value); i++) {
            printf("%s", i ? " " : "");
            print_scalar(json_array_get(value, i));
        }
    }
}

static void print_list(json_t *array, int indent)
{
    size_t count = json_array_size(array);
    if (is_flat(array) && count && !json_is_string(json_array_get(array, 0))) {
        for (size_t i = 0; i < count; i++) {
            printf("%s", i ? "  " : "");
            print_scalar(json_array_get(array, i));
        }
        putchar('\n');
        return;
    }
    printf("%zu\n", count);
    for (size_t i = 0; i < count && i < LIST_LINES; i++) {
        printf("%*s", indent + 2, "");
        print_inline(json_array_get(array, i));
        putchar('\n');
    }
    if (count > LIST_LINES)
        printf("%*s... %zu more\n", indent + 2, "", count - LIST_LINES);
}

static void print_object(json_t *object, int indent)
{
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value)
    {
        printf("%*s%-*s", indent, "", 22 - indent, key);
        if (json_is_object(value)) {
            putchar('\n');
            print_object(value, indent + 2);
        } else if (json_is_array(value)) {
            print_list(value, indent);
        } else {
            print_scalar(value);
            putchar('\n');
        }
    }
}

static enum hg_status print_info(struct hg_cli *cli, struct hg_error *err)
{
    char *text;
    json_error_t wrong;
    enum hg_status status = helio_query_json(cli->h, HGP_T_info_query, 0, &text, err);
    if (status)
        return status;
    json_t *info = json_loads(text, 0, &wrong);
    helio_text_free(text);
    if (!json_is_object(info)) {
        json_decref(info);
        return hg_error_set(err, HG_E_FORMAT, "info", NULL, "the worker's JSON is not an object");
    }
    // The scene of this command holds the one asset that it loaded.
    json_t *asset = json_array_get(json_object_get(info, "assets"), 0);
    if (json_is_object(asset)) {
        json_incref(asset);
        json_decref(info);
        info = asset;
    }
    hg_cli_progress_clear(&cli->progress);
    if (cli->options->json) {
        json_dumpf(info, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
        putchar('\n');
    } else {
        print_object(info, 0);
    }
    json_decref(info);
    return fflush(stdout) ? hg_error_set(err, HG_E_IO, "standard output", NULL, "cannot write")
                          : HG_OK;
}

static enum hg_status info_all(struct hg_cli *cli, enum hg_cli_doing *doing, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    struct hg_cli_texts files = {.items = {o->args[0]}, .count = 1};
    char *path;
    cli->embedded = !o->connect;
    *doing = HG_CLI_DOING_INPUT;
    enum hg_status status = hg_cli_server_path(cli, o->args[0], &path, err);
    if (status)
        return status;
    *doing = HG_CLI_DOING_CONNECT;
    status = hg_cli_connect(cli, o->connect, &files, true, err);
    if (!status) // what is printed holds the warnings
        helio_set_handlers(cli->h,
            &(struct helio_handlers){
                .user = &cli->progress, .tick = hg_cli_on_tick, .progress = hg_cli_on_progress});
    struct hgp_asset_load load = {
        .asset = cli->scene.first_id,
        .path = hgp_str_make(path),
        .has_scene_index = o->has_scene_index,
        .scene_index = (int32_t)o->scene_index,
        .has_up = o->has_up,
    };
    if (!status && o->has_up)
        status = hg_cli_parse_up("--up", o->up, &load.up, err);
    if (!status) {
        *doing = HG_CLI_DOING_INPUT;
        hg_cli_progress_stage(&cli->progress, "loading");
        status = helio_call_for(cli->h, HGP_T_asset_load, &load, HGP_T_asset_loaded, NULL, err);
    }
    hg_free(path);
    return status ? status : print_info(cli, err);
}

enum hg_cli_exit hg_cli_info(const struct hg_cli_options *options)
{
    struct hg_cli cli;
    struct hg_error err = {0};
    enum hg_cli_doing doing;
    hg_cli_init(&cli, options);
    enum hg_status status = info_all(&cli, &doing, &err);
    enum hg_cli_exit code = status ? hg_cli_report(&cli, doing, &err) : HG_CLI_EXIT_OK;
    hg_cli_finish(&cli, code);
    return code;
}
