#include "renderer/scene/formats/texture_file.h"

#include <stdio.h>
#include <string.h>

#include "renderer/scene/fetch.h"

struct hg_texture *hg_texture_find(const struct hg_asset *asset, const char *name)
{
    for (uint32_t i = 0; i < asset->texture_count; i++)
        if (strcmp(asset->textures[i]->head.name, name) == 0)
            return asset->textures[i];
    return NULL;
}

// Names that were tried, for messages.
struct searched {
    char text[140];
    size_t used;
};

static enum hg_status fetch(const struct hg_load_params *params, const char *name,
    uint64_t limit_bytes, struct hg_image_source *source, struct hg_error *err)
{
    if (params->fetch == hg_fetch_file)
        return hg_fetch_resolve(params->fetch_user, name, &source->path, err);
    return params->fetch(params->fetch_user, name, limit_bytes, &source->encoded, err);
}

static void note_searched(struct searched *s, const char *name)
{
    if (s->used < sizeof s->text)
        s->used += (size_t)snprintf(
            s->text + s->used, sizeof s->text - s->used, "%s%s", s->used ? ", " : "", name);
}

// A file names its textures as they lay on its author's machine: what is not there is looked for by
// its base name, beside the file and in textures/.
static enum hg_status fetch_elsewhere(const struct hg_load_params *params, const char *name,
    uint64_t limit_bytes, struct hg_image_source *source, struct searched *searched)
{
    static const char *const folders[] = {"", "textures/"};
    const char *slash = strrchr(name, '/'), *base = slash ? slash + 1 : name;
    enum hg_status status = HG_E_NOTFOUND;
    for (size_t i = 0; i < 2 && status && status != HG_E_NOMEM && *base; i++) {
        char other[1100];
        snprintf(other, sizeof other, "%s%s", folders[i], base);
        if (strcmp(other, name) == 0)
            continue;
        note_searched(searched, other);
        status = fetch(params, other, limit_bytes, source, NULL);
    }
    return status;
}

enum hg_status hg_texture_fetch(const struct hg_load_params *params, struct hg_asset *asset,
    char *name, uint64_t limit_bytes, struct hg_image_source *source)
{
    for (char *c = name; *c; c++) // Windows exporters
        *c = *c == '\\' ? '/' : *c;
    struct hg_error error = {0};
    struct searched searched = {0};
    note_searched(&searched, name);
    enum hg_status status = fetch(params, name, limit_bytes, source, &error);
    if (status && status != HG_E_NOMEM)
        status = fetch_elsewhere(params, name, limit_bytes, source, &searched);
    if (status && status != HG_E_NOMEM)
        hg_asset_warn(asset, name, "%.60s; searched: %s; white is shown instead",
            error.reason[0] ? error.reason : hg_status_text(status), searched.text);
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
