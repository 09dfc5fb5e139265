// page_table.c - the host's copy of the page table (see cache_internal.h).
#include "renderer/texture/cache/cache_internal.h"

static uint32_t across(uint32_t side, uint32_t mip)
{
    return (hg_mips_side(side, mip) + HG_PAGE_TEXELS - 1) / HG_PAGE_TEXELS;
}

struct hg_page_set *hg_page_table_set(const struct hg_page_cache *cache, uint32_t entry)
{
    uint32_t low = 0, high = cache->set_count; // first set behind the entry
    while (low < high) {
        const uint32_t middle = (low + high) / 2;
        if (cache->sets[middle]->table <= entry)
            low = middle + 1;
        else
            high = middle;
    }
    struct hg_page_set *set = low > 0 ? cache->sets[low - 1] : NULL;
    return set != NULL && set->table > 0 && entry - set->table < set->entries ? set : NULL;
}

bool hg_page_table_place(const struct hg_page_set *set, uint32_t entry, struct page_place *out)
{
    const struct hg_page_layout *l = &set->info->layout;
    uint32_t rest = entry - set->table;
    *out = (struct page_place){.mip = l->tail};
    for (uint32_t mip = 0; mip < l->tail; mip++) {
        const uint32_t side_log2 = l->grid_log2 - mip;
        if (rest >> (2 * side_log2) == 0) {
            *out = (struct page_place){mip, rest & ((1u << side_log2) - 1), rest >> side_log2};
            return out->x < across(l->width, mip) && out->y < across(l->height, mip);
        }
        rest -= 1u << (2 * side_log2);
    }
    return rest == 0;
}

uint32_t hg_page_table_entry(const struct hg_page_set *set, const struct page_place *place)
{
    return set->table + hg_page_entry(&set->info->layout, place->mip, place->x, place->y);
}

static uint32_t at_most(uint32_t value, uint32_t most)
{
    return value < most ? value : most;
}

bool hg_page_table_parent(
    const struct hg_page_set *set, const struct page_place *place, struct page_place *out)
{
    const struct hg_page_layout *l = &set->info->layout;
    const struct page_place child = *place; // `out` may be the same
    const uint32_t mip = child.mip + 1;
    if (child.mip >= l->tail)
        return false;
    *out = (struct page_place){.mip = mip};
    if (mip < l->tail) {
        out->x = at_most(child.x >> 1, across(l->width, mip) - 1);
        out->y = at_most(child.y >> 1, across(l->height, mip) - 1);
    }
    return true;
}

// Entry of a page of which nothing is there.
static uint32_t nothing_entry(const struct hg_page_set *set)
{
    return set->nothing | HG_PAGE_NOTHING << HG_PAGE_COARSER_SHIFT;
}

static void touch(struct hg_page_cache *cache, uint32_t first, uint32_t end)
{
    if (cache->table.dirty_first >= cache->table.dirty_end) {
        cache->table.dirty_first = first;
        cache->table.dirty_end = end;
        return;
    }
    cache->table.dirty_first = first < cache->table.dirty_first ? first : cache->table.dirty_first;
    cache->table.dirty_end = end > cache->table.dirty_end ? end : cache->table.dirty_end;
}

void hg_page_table_set_entry(struct hg_page_cache *cache, uint32_t entry, uint32_t value)
{
    cache->table.entries[entry] = value;
    touch(cache, entry, entry + 1);
}

void hg_page_table_clear(struct hg_page_cache *cache, const struct hg_page_set *set)
{
    for (uint32_t i = 0; i < set->entries; i++)
        cache->table.entries[set->table + i] = nothing_entry(set);
    touch(cache, set->table, set->table + set->entries);
}

// Columns or rows of pages in `mip` whose ancestor at place->mip is `at`: [first, end).
struct span {
    uint32_t first, end;
};

static struct span descendants(uint32_t side, uint32_t mip, uint32_t up, uint32_t at, bool whole)
{
    const uint32_t count = across(side, mip);
    if (whole)
        return (struct span){0, count};
    const uint32_t last = across(side, mip + up) - 1;
    return (struct span){
        at_most(at << up, count), at == last ? count : at_most((at + 1) << up, count)};
}

// Redirects to `slot` the entries of the page and its descendants that point to an ancestor coarser
// than `place` (add), or to the page's own slot (remove).
static void change(struct hg_page_cache *cache, const struct hg_page_set *set,
    const struct page_place *place, uint32_t slot, uint32_t coarser, bool add)
{
    const struct hg_page_layout *l = &set->info->layout;
    const bool whole = place->mip == l->tail;
    for (uint32_t mip = 0; mip <= place->mip; mip++) {
        const uint32_t up = place->mip - mip;
        struct span x = {0, 1}, y = {0, 1};
        if (mip < l->tail) {
            x = descendants(l->width, mip, up, place->x, whole);
            y = descendants(l->height, mip, up, place->y, whole);
        }
        for (uint32_t row = y.first; row < y.end; row++) {
            const struct page_place first = {mip, mip < l->tail ? x.first : 0, row};
            const uint32_t at = hg_page_table_entry(set, &first);
            for (uint32_t i = 0; i < x.end - x.first; i++) {
                uint32_t *entry = &cache->table.entries[at + i];
                const uint32_t had = *entry >> HG_PAGE_COARSER_SHIFT;
                if (add ? had <= up : had != up)
                    continue;
                const uint32_t now = coarser == HG_PAGE_NOTHING ? HG_PAGE_NOTHING : coarser + up;
                *entry = slot | now << HG_PAGE_COARSER_SHIFT;
            }
            touch(cache, at, at + (x.end - x.first));
        }
    }
}

// `add` compares with <=: an entry that names this very level belongs to a page that was there.
void hg_page_table_add(struct hg_page_cache *cache, const struct hg_page_set *set,
    const struct page_place *place, uint32_t slot)
{
    change(cache, set, place, hg_pool_place(&cache->pools[set->pool], slot), 0, true);
}

void hg_page_table_remove(
    struct hg_page_cache *cache, const struct hg_page_set *set, const struct page_place *place)
{
    struct page_place parent;
    uint32_t entry = nothing_entry(set);
    if (hg_page_table_parent(set, place, &parent))
        entry = cache->table.entries[hg_page_table_entry(set, &parent)];
    const uint32_t coarser = entry >> HG_PAGE_COARSER_SHIFT;
    change(cache, set, place, entry & HG_PAGE_SLOT_MASK,
        coarser == HG_PAGE_NOTHING ? HG_PAGE_NOTHING : coarser + 1, false);
}
