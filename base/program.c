#include "base/program.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void hg_program_path(const char *variable, const char *name, char *path, size_t size)
{
    const char *given = getenv(variable);
    if (given && *given) {
        snprintf(path, size, "%s", given);
        return;
    }
    char self[3072];
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    self[n > 0 ? n : 0] = 0;
    for (int i = 0; i < 2; i++) { // the program's name, then its folder's
        char *slash = strrchr(self, '/');
        if (slash)
            *slash = 0;
    }
    snprintf(path, size, "%s/libexec/%s", self, name);
}
