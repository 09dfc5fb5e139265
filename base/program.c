#include "base/program.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void hg_program_prefix_path(const char *name, char *path, size_t size)
{
    char self[3072];
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    self[n > 0 ? n : 0] = 0;
    for (int i = 0; i < 2; i++) { // the program's name, then its folder's
        char *slash = strrchr(self, '/');
        if (slash)
            *slash = 0;
    }
    snprintf(path, size, "%s/%s", self, name);
}

void hg_program_path(const char *variable, const char *name, char *path, size_t size)
{
    char below[256];
    const char *given = getenv(variable);
    if (given && *given) {
        snprintf(path, size, "%s", given);
        return;
    }
    snprintf(below, sizeof below, "libexec/%s", name);
    hg_program_prefix_path(below, path, size);
}
