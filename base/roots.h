// roots.h - files under the folders that a process may read.
// Floor 0. Thread-safe; no shared state.
#ifndef HG_BASE_ROOTS_H
#define HG_BASE_ROOTS_H

#include <stdint.h>

#include "base/status.h"

// Folders by their real paths. Borrowed.
struct hg_roots {
    const char *const *items; // [count]
    uint32_t count;
    const struct hg_roots *within; // files lie under one of these as well; NULL: wherever
};

// The real path of `path`, which is absolute or counts from one of the roots, when it lies under a
// root; freed with hg_free. HG_E_NOTFOUND: a root has no such file. HG_E_PERM: outside of the
// roots; the error does not reveal whether such a file exists. Errors name the roots by their last
// names only. `within` changes no answer but from a file to HG_E_PERM.
enum hg_status hg_roots_resolve(
    const struct hg_roots *roots, const char *path, char **out, struct hg_error *err) HG_MUST_CHECK;
#endif
