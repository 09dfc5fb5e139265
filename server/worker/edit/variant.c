#include "server/worker/edit/variant.h"

#include <stdio.h>
#include <string.h>

// "'red', 'blue', ..."
static void list_names(const struct hg_asset *asset, char *dst, size_t size)
{
    static const char rest[] = ", ...";
    size_t used = 0;
    for (uint32_t i = 0; i < asset->variants.count; i++) {
        const char *name = asset->variants.names[i], *comma = i > 0 ? ", " : "";
        if (used + strlen(comma) + strlen(name) + sizeof "''" + sizeof rest > size) {
            snprintf(dst + used, size - used, "%s", i > 0 ? rest : "...");
            return;
        }
        used += (size_t)snprintf(dst + used, size - used, "%s'%s'", comma, name);
    }
}

enum hg_status hg_variant_find(
    const struct hg_asset *asset, struct hgp_str name, int32_t *index, struct hg_error *err)
{
    char known[160] = "none";
    *index = -1;
    if (!name.size)
        return HG_OK;
    for (uint32_t i = 0; i < asset->variants.count; i++)
        if (strlen(asset->variants.names[i]) == name.size &&
            memcmp(asset->variants.names[i], name.data, name.size) == 0) {
            *index = (int32_t)i;
            return HG_OK;
        }
    list_names(asset, known, sizeof known);
    return hg_error_set(err, HG_E_NOTFOUND, asset->label, "variant",
        "no variant '%.*s'; there is %s", (int)(name.size < 64 ? name.size : 64), name.data, known);
}
