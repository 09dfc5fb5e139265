#include "renderer/scene/texture_file.h"

#include <string.h>

#include "renderer/scene/fetch.h"

struct hg_texture *hg_texture_find(const struct hg_asset *asset, const char *name)
{
    for (uint32_t i = 0; i < asset->texture_count; i++)
        if (strcmp(asset->textures[i]->head.name, name) == 0)
            return asset->textures[i];
    return NULL;
}

enum hg_status hg_texture_fetch(const struct hg_load_params *params, struct hg_asset *asset,
    char *name, uint64_t limit_bytes, struct hg_image_source *source)
{
    for (char *c = name; *c; c++) // Windows exporters
        *c = *c == '\\' ? '/' : *c;
    struct hg_error error = {0};
    enum hg_status status;
    if (params->fetch == hg_fetch_file)
        status = hg_fetch_resolve(params->fetch_user, name, &source->path, &error);
    else
        status = params->fetch(params->fetch_user, name, limit_bytes, &source->encoded, &error);
    if (status && status != HG_E_NOMEM)
        hg_asset_warn(asset, name, "%.180s; white is shown instead",
            error.reason[0] ? error.reason : hg_status_text(status));
    return status == HG_E_NOMEM ? status : HG_OK;
}

bool hg_texture_is_usable(
    struct hg_asset *asset, const char *name, const struct hg_image_source *source)
{
    struct hg_image_info info;
    struct hg_error error = {0};
    bool usable = source->pixels.pixels != NULL;
    if (source->path)
        usable = !hg_image_probe_file(source->path, &info, &error);
    else if (source->encoded)
        usable = !hg_image_probe_memory(
            &(struct hg_image_bytes){source->encoded->data, source->encoded->size, source->label},
            &info, &error);
    if (!usable && error.reason[0])
        hg_asset_warn(asset, name, "%.180s; white is shown instead", error.reason);
    return usable;
}
