// texture_file.h - textures of image files that materials name, for formats without embedded ones.
// Floor 2, private to scene/. One thread per asset.
#ifndef HG_RENDERER_SCENE_FORMATS_TEXTURE_FILE_H
#define HG_RENDERER_SCENE_FORMATS_TEXTURE_FILE_H

#include "renderer/scene/asset.h"

// The texture made for this name before, so that files are read once; NULL: none.
struct hg_texture *hg_texture_find(const struct hg_asset *asset, const char *name);
// Finds the file of a name (backslashes become slashes in it). One that is missing or lies outside
// of the roots is a warning, and `source` stays empty. HG_E_NOMEM.
enum hg_status hg_texture_fetch(const struct hg_load_params *params, struct hg_asset *asset,
    char *name, uint64_t limit_bytes, struct hg_image_source *source) HG_MUST_CHECK;
// Whether the image can be read as far as its header shows; a warning where not.
bool hg_texture_is_usable(
    struct hg_asset *asset, const char *name, const struct hg_image_source *source);

#endif
