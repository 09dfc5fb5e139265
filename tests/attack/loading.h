// loading.h - for tests of loaders: parts of Collada files, one that takes long to read, and the
// processes that read.
#ifndef HG_TESTS_ATTACK_LOADING_H
#define HG_TESTS_ATTACK_LOADING_H

#include <sys/types.h>

// In this order; geometry is a format with the number of floats ("9") as text.
extern const char loading_head[], loading_geometry[], loading_opening[], loading_leaf[],
    loading_tail[];

// A file that takes more than 2 s of processor time.
void loading_write_slow(const char *path);
// Processes called helio-loader whose parent is `parent`; *last: one of them. The worker's is the
// spawner, and its are the loaders.
int loading_count(pid_t parent, pid_t *last);

#endif
