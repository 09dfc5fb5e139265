#include "base/program.h"

#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

extern char **environ;

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

int hg_program_spawn(
    const char *path, const char *const *argv, const int fds[2], int close_from, pid_t *pid)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t all, none;
    *pid = 0;
    int failed = posix_spawn_file_actions_init(&actions);
    if (failed)
        return failed;
    failed = posix_spawnattr_init(&attributes);
    if (failed) {
        posix_spawn_file_actions_destroy(&actions);
        return failed;
    }
    sigfillset(&all);
    sigemptyset(&none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    failed = posix_spawn_file_actions_adddup2(&actions, fds[0], fds[1]);
    if (!failed && close_from > 0)
        failed = posix_spawn_file_actions_addclosefrom_np(&actions, close_from);
    if (!failed)
        failed = posix_spawn(pid, path, &actions, &attributes, (char *const *)argv, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    if (failed)
        *pid = 0;
    return failed;
}
