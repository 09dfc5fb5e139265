// window.c - helio view: starts helio-view (client/view/main.c), which has the window. A program of
// its own, so that `helio` links no window system: docs/decisions/0032.
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/program.h"
#include "client/cli/cli.h"

enum hg_cli_exit hg_cli_window(const struct hg_cli_options *options)
{
    char path[4096];
    struct hg_error err = {0};
    hg_program_path("HELIO_VIEW", "helio-view", path, sizeof path);
    execv(path, (char *const *)(uintptr_t)options->argv);
    const int failed = errno;
    if (failed == ENOENT)
        hg_error_set(&err, HG_E_UNSUPPORTED, path, NULL,
            "is not there: this installation was built without SDL2, which windows need "
            "(packages libsdl2-dev, libsdl2-ttf-dev and libfontconfig-dev before the build)");
    else
        hg_error_set(&err, HG_E_UNSUPPORTED, path, NULL, "cannot start: %s", strerror(failed));
    return hg_cli_report(NULL, HG_CLI_DOING_RENDER, &err);
}
