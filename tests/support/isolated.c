// isolated.c - linked to a test, lets it run a second time with parsers of foreign formats in
// processes of their own: whenever $HELIO_LOADER names helio-loader.
#include <stdio.h>
#include <stdlib.h>

#include "server/loader/loader_client.h"

__attribute__((constructor)) static void isolate(void)
{
    struct hg_error err = {0};
    if (!getenv("HELIO_LOADER"))
        return;
    const struct loader_options options = {.cpu_s = 60, .sandbox = "require", .log = "off"};
    if (hg_loader_start(&options, &err) == HG_OK)
        return;
    fprintf(stderr, "no loader: %s\n", err.reason);
    abort();
}
