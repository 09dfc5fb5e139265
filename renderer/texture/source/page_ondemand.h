// page_ondemand.h - pages whose texels are produced on demand.
// Floor 2, private to the page sources. Any thread.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_ONDEMAND_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_ONDEMAND_H

#include "renderer/texture/source/page_image.h"

// One page from a backing of kind HG_PAGES_ON_DEMAND. tiles: of files. HG_E_NOMEM, HG_E_IO,
// statuses of the file's reader, HG_E_HASH (the file was changed).
enum hg_status hg_page_make(struct hg_tile_cache *tiles, const struct hg_page_backing *backing,
    const struct hg_page_chain *chain, struct hg_page_request *read,
    struct hg_error *err) HG_MUST_CHECK;

#endif
