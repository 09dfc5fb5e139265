// page_coarse.c - previews of images that are not baked yet, in slots of their own.
//
// The entries of a set without pages point to pages of its preview, always coarser than the
// requested ones: shaders count all of them as missing, and exact samples wait.
#include "base/alloc.h"
#include "renderer/texture/cache/cache_internal.h"

#define COARSE_KEY (1ull << 41) // + entry: keys of these slots
#define LINGER     30           // frames after the first page of its own

// The pages of the preview: of `first` and up, row by row, the tail last.
static uint32_t number_of(const struct hg_page_set *set, const struct page_place *place)
{
    const struct hg_page_layout *l = &set->info->layout;
    const uint32_t first = hg_page_number(l, set->coarse_mip, 0, 0);
    return hg_page_number(l, place->mip, place->x, place->y) - first;
}

static bool tail_is_there(const struct hg_page_cache *c, const struct hg_page_set *set)
{
    return c->table.entries[set->table + set->entries - 1] >> HG_PAGE_COARSER_SHIFT == 0;
}

// --- away with it --------------------------------------------------------------------------------

void hg_page_coarse_forget(struct hg_page_cache *c, struct hg_page_set *set)
{
    for (uint32_t i = 0; i < set->coarse_count; i++)
        hg_residency_remove(c->residency[set->pool], set->coarse_slots[i]);
    set->coarse_count = set->coarse_number = set->coarse_since = 0;
}

// Entries name pages of the set alone.
static void drop(struct hg_page_cache *c, struct hg_page_set *set)
{
    struct hg_residency *r = c->residency[set->pool];
    struct hg_residency_stats stats;
    hg_page_coarse_forget(c, set);
    hg_residency_stats(r, &stats);
    hg_page_table_clear(c, set);
    for (uint32_t mip = set->info->layout.tail + 1; mip-- > 0;)
        for (uint32_t slot = 0; slot < stats.slots; slot++) {
            const uint64_t key = hg_residency_item(r, slot);
            struct page_place place;
            if (key >= set->table && key < (uint64_t)set->table + set->entries &&
                hg_page_table_place(set, (uint32_t)key, &place) && place.mip == mip)
                hg_page_table_add(c, set, &place, slot);
        }
}

// --- showing it ----------------------------------------------------------------------------------

// The finest page of the preview that is coarser than this place.
static uint32_t entry_for(
    const struct hg_page_cache *c, const struct hg_page_set *set, struct page_place place)
{
    const uint32_t tail = set->info->layout.tail, mip = place.mip;
    uint32_t coarser = 1; // also the tail's own, whose page holds the next mip, too
    if (mip < tail) {
        const uint32_t to = set->coarse_mip > mip + 1 ? set->coarse_mip : mip + 1;
        coarser = to - mip;
        while (place.mip < to && hg_page_table_parent(set, &place, &place))
            ;
    }
    const uint32_t slot = set->coarse_slots[number_of(set, &place)];
    return hg_pool_place(&c->pools[set->pool], slot) | coarser << HG_PAGE_COARSER_SHIFT;
}

static void show(struct hg_page_cache *c, struct hg_page_set *set)
{
    for (uint32_t i = 0; i < set->entries; i++) {
        struct page_place place;
        if (hg_page_table_place(set, set->table + i, &place))
            hg_page_table_set_entry(c, set->table + i, entry_for(c, set, place));
    }
}

// Slots for all its pages, or none.
static bool take_slots(struct hg_page_cache *c, struct hg_page_set *set)
{
    struct hg_residency *r = c->residency[set->pool];
    struct hg_residency_stats stats;
    const struct page_place first = {.mip = set->coarse_mip};
    const uint32_t count =
        set->info->layout.pages - hg_page_number(&set->info->layout, first.mip, 0, 0);
    hg_residency_stats(r, &stats);
    if (count > HG_PAGE_COARSE_SLOTS || 2 * (stats.pinned + count) > stats.slots ||
        hg_residency_available(r, HG_RESIDENCY_GENTLE) < count)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t evicted;
        const uint64_t key = COARSE_KEY + set->table + i;
        if (hg_residency_place(r, key, HG_RESIDENCY_GENTLE, &set->coarse_slots[i], &evicted) !=
            HG_OK)
            break;
        set->coarse_count++;
        hg_residency_pin(r, set->coarse_slots[i]);
        if (evicted != HG_RESIDENCY_NO_KEY)
            hg_page_cache_forget(c, evicted);
    }
    if (set->coarse_count < count)
        hg_page_coarse_forget(c, set);
    return set->coarse_count == count;
}

static enum hg_status write_pages(
    struct hg_page_cache *c, struct hg_page_set *set, struct hg_error *err)
{
    const struct hg_page_layout *l = &set->info->layout;
    const uint32_t first = l->pages - set->coarse_count;
    void *texels = hg_calloc((size_t)HG_PAGE_PITCH * HG_PAGE_PITCH, set->info->texel_bytes);
    if (texels == NULL)
        return hg_error_set(err, HG_E_NOMEM, "textures", NULL, "no memory");
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < set->coarse_count && status == HG_OK; i++) {
        uint32_t x, y;
        const uint32_t mip = hg_page_find(l, first + i, &x, &y);
        if (hg_page_source_preview_page(set->source, mip, x, y, texels))
            status = hg_pool_write(&c->pools[set->pool], set->coarse_slots[i], texels, err);
    }
    hg_free(texels);
    return status;
}

static enum hg_status look_for(
    struct hg_page_cache *c, struct hg_page_set *set, struct hg_error *err)
{
    const uint32_t number = hg_page_source_preview(set->source, &set->coarse_mip);
    const bool fresh = set->coarse_count == 0;
    if (number == 0 || number == set->coarse_number || (fresh && !take_slots(c, set)))
        return HG_OK;
    const enum hg_status status = write_pages(c, set, err);
    if (status != HG_OK) {
        hg_page_coarse_forget(c, set);
        return status;
    }
    set->coarse_number = number;
    if (fresh)
        show(c, set);
    return HG_OK;
}

enum hg_status hg_page_coarse_update(
    struct hg_page_cache *c, enum hg_page_mode mode, struct hg_error *err)
{
    const uint64_t revision = hg_page_sources_revision(c->sources);
    const bool look = revision != c->coarse_revision;
    enum hg_status status = HG_OK;
    c->coarse_revision = revision;
    for (uint32_t i = 0; i < c->set_count && status == HG_OK; i++) {
        struct hg_page_set *set = c->sets[i];
        if (set->refs == 0 || set->failed || set->table == 0)
            continue;
        if (set->resident == 0 && look)
            status = look_for(c, set, err);
        if (set->coarse_count == 0 || !tail_is_there(c, set))
            continue;
        const uint32_t frame = hg_residency_frame(c->residency[set->pool]);
        if (set->coarse_since == 0)
            set->coarse_since = frame + 1;
        if (mode == HG_PAGES_EXACT || frame + 1 - set->coarse_since > LINGER)
            drop(c, set);
    }
    return status;
}
