// tiled_areas.c - see tiled_areas.h.
#include "renderer/frame/streaming/tiled_areas.h"

#define AREA_LEAST_PX 8          // areas are cut at multiples of this
#define MOST_SHARES   (1u << 20) // of the geometry of shadow maps

bool hg_tiled_areas_split(struct hg_tiled_areas *areas)
{
    struct hg_tiled_area *a = &areas->items[areas->count - 1], b = *a;
    const VkExtent2D size = a->rect.extent;
    const bool wide = size.width >= size.height;
    uint32_t half = (wide ? size.width : size.height) / 2;
    if (half > AREA_LEAST_PX)
        half -= half % AREA_LEAST_PX;
    if (half == 0 || areas->count == HG_TILED_MAX_AREAS)
        return false;
    if (wide) {
        b.rect.offset.x += (int32_t)half;
        b.rect.extent.width -= half;
        a->rect.extent.width = half;
    } else {
        b.rect.offset.y += (int32_t)half;
        b.rect.extent.height -= half;
        a->rect.extent.height = half;
    }
    areas->items[areas->count++] = *a; // the first half is finished first
    areas->items[areas->count - 2] = b;
    return true;
}

bool hg_tiled_areas_share(struct hg_tiled_areas *areas)
{
    struct hg_tiled_area *a = &areas->items[areas->count - 1], b = *a;
    if (a->shares >= MOST_SHARES || areas->count == HG_TILED_MAX_AREAS)
        return false;
    a->shares = b.shares = a->shares > 0 ? 2 * a->shares : 2;
    b.share += b.shares / 2;
    areas->items[areas->count++] = b;
    return true;
}
