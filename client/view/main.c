// main.c - helio-view, the program behind `helio view`: a window for a scene.
#include <stdio.h>
#include <sys/stat.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/cli.h"
#include "client/cli/render/render.h"
#include "client/view/viewer.h"

// What is wrong on the command line is said before a window opens.
static enum hg_status check(
    const struct hg_cli_options *o, enum hg_cli_doing *doing, struct hg_error *err)
{
    struct stat st;
    *doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = hg_cli_render_check_scene(o, err);
    if (status)
        return status;
    if (o->join && !o->connect)
        return hg_error_set(err, HG_E_INVAL, "--join", NULL, "needs --connect");
    if (o->arg_count == 0 && !o->join)
        return hg_error_set(err, HG_E_INVAL, "SCENE", NULL, "is missing");
    if (o->shots && (stat(o->shots, &st) || !S_ISDIR(st.st_mode)))
        return hg_error_set(
            err, HG_E_INVAL, "--screenshots", NULL, "'%s' is not a folder", o->shots);
    if (o->arg_count == 0 || (o->connect && !o->upload) || strcmp(o->args[0], "demo:") == 0)
        return HG_OK;
    *doing = HG_CLI_DOING_INPUT;
    char *path = NULL;
    const struct hg_cli cli = {.options = o, .embedded = true};
    status = hg_cli_server_path(&cli, o->args[0], &path, err);
    hg_free(path);
    return status;
}

int main(int argc, char **argv)
{
    static struct hg_cli_options options;
    struct hg_error err = {0};
    enum hg_cli_doing doing = HG_CLI_DOING_ARGUMENTS;
    if (argc < 2 || strcmp(argv[1], "view") != 0) {
        fprintf(stderr, "helio-view: is started by `helio view`\n");
        return HG_CLI_EXIT_USAGE;
    }
    enum hg_status status = hg_cli_parse(argc, (const char *const *)argv, &options, &err);
    if (!status)
        status = check(&options, &doing, &err);
    if (status)
        return (int)hg_cli_report(NULL, doing, &err);
    if (options.connect && !options.has_reconnect) {
        options.has_reconnect = true;
        options.reconnect = 30;
    }
    return hg_viewer_run(&options);
}
