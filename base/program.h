// program.h - where the programs of libexec are that this one starts.
// Floor 0. Thread-safe as long as no thread sets environment variables.
#ifndef HG_BASE_PROGRAM_H
#define HG_BASE_PROGRAM_H

#include <stddef.h>

// The value of an environment variable where it has one, else ../libexec/`name` beside the running
// program. path [size] is cut to fit; whether there is such a program is not looked at.
void hg_program_path(const char *variable, const char *name, char *path, size_t size);
// `name` below the prefix that the running program is installed in (its folder's parent), likewise.
void hg_program_prefix_path(const char *name, char *path, size_t size);

#endif
