// program.h - programs that this one starts: where they are, and their start.
// Floor 0. Thread-safe as long as no thread sets environment variables.
#ifndef HG_BASE_PROGRAM_H
#define HG_BASE_PROGRAM_H

#include <stddef.h>
#include <sys/types.h>

// The value of an environment variable where it has one, else ../libexec/`name` beside the running
// program. path [size] is cut to fit; whether there is such a program is not looked at.
void hg_program_path(const char *variable, const char *name, char *path, size_t size);
// `name` below the prefix that the running program is installed in (its folder's parent), likewise.
void hg_program_prefix_path(const char *name, char *path, size_t size);
// Starts a program with descriptor fds[0] as its fds[1] and with default signals, in a process
// group of its own, so that Ctrl-C reaches only this one. argv ends with NULL. close_from:
// descriptors from there on are closed, even those that outlive exec; 0: none is. Returns 0, or
// errno and *pid is 0.
int hg_program_spawn(
    const char *path, const char *const *argv, const int fds[2], int close_from, pid_t *pid);

#endif
