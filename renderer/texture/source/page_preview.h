// page_preview.h - preview of an image that is too large for memory, while it is baked: texels of
// some rows, at most HG_PAGE_PREVIEW_SIDE a side.
// Floor 2, private to page_source.c and page_load.c.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_PREVIEW_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_PREVIEW_H

#include "renderer/texture/source/page_image.h"

#define HG_PAGE_PREVIEW_SIDE 512u

// First mip of the chain that is no larger, the tail at most.
uint32_t hg_page_preview_mip(const struct hg_page_layout *layout);
// Reads the middle row of each texel of that mip, skips the others where the file allows it, and
// publishes image->preview now and then, rows that are not read yet as the last one before them.
// One thread, which holds the image (busy), without the lock. Errors are left for the bake to
// report.
void hg_page_preview_read(struct hg_page_sources *sources, struct hg_page_image *image,
    const struct hg_image_source *origin);
void hg_page_preview_drop(struct hg_page_image *image); // the lock is held

#endif
