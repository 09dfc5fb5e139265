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

static bool have(const struct hg_roots *roots, const char *real)
{
    for (uint32_t i = 0; i < roots->count; i++)
        if (lies_under(real, roots->items[i]))
            return true;
    return false;
}

static bool is_allowed(const struct hg_roots *roots, const char *real)
{
    return have(roots, real) && (!roots->within || have(roots->within, real));
}

// Real path of `path` under `root`; when the file is missing, that of the nearest folder above it
// that is there (*missing).
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
    while (!real && joined[0] && strcmp(joined, "/") != 0) {
        char *slash = strrchr(joined, '/');
        if (!slash)
            break;
        slash[slash == joined] = 0;
        real = realpath(joined, NULL);
    }
    return real;
}

// The roots by their last names: errors do not reveal where they lie on the machine.
static void list_roots(const struct hg_roots *roots, char *text, size_t size)
{
    size_t used = 0;
    text[0] = 0;
    for (uint32_t i = 0; i < roots->count && used < size; i++) {
        const char *slash = strrchr(roots->items[i], '/');
        used += (size_t)snprintf(text + used, size - used, "%s'%s'", i ? ", " : "",
            slash && slash[1] ? slash + 1 : roots->items[i]);
    }
}

static enum hg_status not_found(
    const struct hg_roots *roots, const char *path, bool inside, struct hg_error *err)
{
    char names[200];
    list_roots(roots, names, sizeof names);
    if (inside && path[0] != '/')
        return hg_error_set(err, HG_E_NOTFOUND, path, NULL,
            "no such file; names count from the asset roots %s", names);
    if (inside)
        return hg_error_set(err, HG_E_NOTFOUND, path, NULL, "no such file");
    if (!roots->count)
        return hg_error_set(
            err, HG_E_PERM, path, NULL, "does not lie under an asset root: there are none");
    return hg_error_set(
        err, HG_E_PERM, path, NULL, "does not lie under an asset root; names count from %s", names);
}

enum hg_status hg_roots_resolve(
    const struct hg_roots *roots, const char *path, char **out, struct hg_error *err)
{
    bool inside = false;
    *out = NULL;
    for (uint32_t i = 0; i < roots->count && *path; i++) {
        bool missing;
        char *real = resolve_under(roots->items[i], path, &missing);
        const bool found =
                       real && !missing && have(roots, real), // the one that the name stands for
            allowed = real && is_allowed(roots, real);
        if (found && allowed) {
            *out = real;
            return HG_OK;
        }
        inside |= allowed;
        free(real);
        if (found)
            return not_found(roots, path, false, err);
    }
    return not_found(roots, path, inside, err);
}
