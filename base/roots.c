#include "base/roots.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool lies_under(const char *path, const char *root)
{
    size_t n = strlen(root);
    return strncmp(path, root, n) == 0 &&
           (path[n] == '/' || path[n] == 0 || (n && root[n - 1] == '/'));
}

static bool is_allowed(const struct hg_roots *roots, const char *real)
{
    for (uint32_t i = 0; i < roots->count; i++)
        if (lies_under(real, roots->items[i]))
            return true;
    return false;
}

// Real path of `path` under `root`; when the file is missing, that of its folder (*missing).
static char *resolve_under(const char *root, const char *path, bool *missing)
{
    char joined[PATH_MAX];
    int n = path[0] == '/' ? snprintf(joined, sizeof joined, "%s", path)
                           : snprintf(joined, sizeof joined, "%s/%s", root, path);
    *missing = true;
    if (n < 0 || n >= (int)sizeof joined)
        return NULL;
    char *real = realpath(joined, NULL);
    *missing = !real;
    char *slash = strrchr(joined, '/');
    if (real || !slash)
        return real;
    slash[slash == joined] = 0;
    return realpath(joined, NULL);
}

enum hg_status hg_roots_resolve(
    const struct hg_roots *roots, const char *path, char **out, struct hg_error *err)
{
    bool inside = false;
    *out = NULL;
    for (uint32_t i = 0; i < roots->count && *path; i++) {
        bool missing;
        char *real = resolve_under(roots->items[i], path, &missing);
        bool allowed = real && is_allowed(roots, real);
        if (allowed && !missing) {
            *out = real;
            return HG_OK;
        }
        inside |= allowed;
        free(real);
    }
    if (inside)
        return hg_error_set(err, HG_E_NOTFOUND, path, NULL, "no such file");
    return hg_error_set(err, HG_E_PERM, path, NULL, "does not lie under an asset root");
}
