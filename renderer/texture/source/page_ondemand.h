// page_ondemand.h - pages whose texels are made when they are asked for.
// Floor 2, private to the page sources. Any thread.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_ONDEMAND_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_ONDEMAND_H

#include "renderer/texture/source/page_image.h"

// The page `at` (x, y) of a mip, or the tail page, from a backing of kind HG_PAGES_ON_DEMAND.
// tiles: of files. *bytes: decoded of a file. HG_E_NOMEM, HG_E_IO or what the file's reader says,
// HG_E_HASH (the file was changed).
enum hg_status hg_page_make(struct hg_tile_cache *tiles, const struct hg_page_backing *backing,
    const struct hg_page_chain *chain, const struct hg_page_view *view, uint32_t mip,
    const uint32_t at[2], void *texels, uint64_t *bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
