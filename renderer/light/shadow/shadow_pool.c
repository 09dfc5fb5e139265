#include "renderer/light/shadow/shadow_pool.h"

#include <math.h>
#include <string.h>

#include "renderer/light/shadow/shadow_plan.h"
#include "renderer/math/vec.h"

#define BORDER_PX (0.5f * (HG_SHADOW_PAGE_PX - HG_SHADOW_PAGE_INNER_PX))
#define TOUCH_PX  4.0f // about boxes of casters, for lines, points and rounding
#define FINER     0.7f // of a texel of the whole map: coarser levels would not be worth it
#define RECENT    8u   // pictures: a page that was wanted since is still used

// --- geometry of the levels ----------------------------------------------------------------------

float hg_shadow_page_texel(const struct hg_gpu_shadow *whole, uint32_t level)
{
    const float coarsest = exp2f(floorf(log2f(whole->texel_size * FINER)));
    return ldexpf(coarsest, (int)level - (HG_SHADOW_PAGE_LEVELS - 1));
}

float hg_shadow_page_side(const struct hg_gpu_shadow *whole, uint32_t level)
{
    return HG_SHADOW_PAGE_INNER_PX * hg_shadow_page_texel(whole, level);
}

void hg_shadow_page_plane(const struct hg_gpu_shadow *whole, const float position[3], float out[2])
{
    float d[3];
    hg_sub3(position, (const float *)&whole->origin_ws, d);
    out[0] = hg_dot3(d, (const float *)&whole->right_ws);
    out[1] = hg_dot3(d, (const float *)&whole->up_ws);
}

// --- what is held --------------------------------------------------------------------------------

static uint16_t *chain_of(struct hg_shadow_pool *p, uint32_t level, int32_t x, int32_t y)
{
    const uint32_t hash =
        (uint32_t)x * 0x9e3779b1u ^ (uint32_t)y * 0x85ebca6bu ^ level * 0xc2b2ae35u;
    return &p->first[(hash >> 16 ^ hash) % HG_SHADOW_POOL_MOST_PAGES];
}

struct hg_shadow_page *hg_shadow_pool_find(
    struct hg_shadow_pool *p, uint32_t level, int32_t x, int32_t y)
{
    for (uint16_t at = *chain_of(p, level, x, y); at > 0; at = p->next[at - 1]) {
        struct hg_shadow_page *page = &p->pages[at - 1];
        if (page->level == level && page->x == x && page->y == y)
            return page;
    }
    return NULL;
}

static void release(struct hg_shadow_pool *p, struct hg_shadow_page *page)
{
    const uint16_t number = (uint16_t)(page - p->pages + 1);
    uint16_t *link = chain_of(p, page->level, page->x, page->y);
    if (!page->taken)
        return;
    while (*link != number)
        link = &p->next[*link - 1];
    *link = p->next[number - 1];
    page->taken = false;
}

void hg_shadow_pool_forget(struct hg_shadow_pool *p)
{
    for (uint32_t i = 0; i < HG_SHADOW_POOL_MOST_PAGES; i++)
        release(p, &p->pages[i]);
}

void hg_shadow_pool_note(struct hg_shadow_pool *p)
{
    for (uint32_t i = 0; p->due.maps && i < p->due.count; i++)
        if (p->due.maps[i].stale)
            release(p, &p->pages[p->due.order[i]]);
    p->due.maps = NULL;
    p->due.count = 0;
}

void hg_shadow_pool_begin(
    struct hg_shadow_pool *p, const struct hg_gpu_shadow *place, const struct hg_gpu_shadow *whole)
{
    struct hg_gpu_shadow projection = *whole;
    projection.rect_px = (struct hg_vec2){0, 0}; // where the whole map is does not matter
    const uint32_t side = (uint32_t)place->size_px / HG_SHADOW_PAGE_PX;
    hg_shadow_pool_note(p);
    if (side != p->side || memcmp(&projection, &p->whole, sizeof projection) != 0 ||
        memcmp(&place->rect_px, &p->rect_px, sizeof p->rect_px) != 0)
        hg_shadow_pool_forget(p);
    p->whole = projection;
    p->side = side;
    p->rect_px = place->rect_px;
    p->picture++;
}

// Bounds that are no numbers may be anywhere.
static void bounds_of(
    const struct hg_gpu_shadow *whole, const struct hg_box *casters, float low[2], float high[2])
{
    for (int i = 0; i < 2; i++) {
        low[i] = INFINITY;
        high[i] = -INFINITY;
    }
    for (int c = 0; c < 8; c++) {
        float at[2];
        const float corner[3] = {c & 1 ? casters->max[0] : casters->min[0],
            c & 2 ? casters->max[1] : casters->min[1], c & 4 ? casters->max[2] : casters->min[2]};
        hg_shadow_page_plane(whole, corner, at);
        for (int i = 0; i < 2; i++) {
            low[i] = fminf(low[i], at[i]);
            high[i] = fmaxf(high[i], at[i]);
        }
    }
    for (int i = 0; i < 2; i++)
        if (!(low[i] <= high[i])) {
            low[i] = -INFINITY;
            high[i] = INFINITY;
        }
}

void hg_shadow_pool_touch(struct hg_shadow_pool *p, const struct hg_box *casters)
{
    float low[2], high[2];
    bounds_of(&p->whole, casters, low, high);
    for (uint32_t i = 0; i < HG_SHADOW_POOL_MOST_PAGES; i++) {
        struct hg_shadow_page *page = &p->pages[i];
        if (!page->taken)
            continue;
        const float side = hg_shadow_page_side(&p->whole, page->level);
        const float margin = (BORDER_PX + TOUCH_PX) * side / HG_SHADOW_PAGE_INNER_PX;
        const float first[2] = {(float)page->x * side - margin, (float)page->y * side - margin};
        const float across = side + 2 * margin;
        if (low[0] <= first[0] + across && low[1] <= first[1] + across && high[0] >= first[0] &&
            high[1] >= first[1])
            release(p, page);
    }
}

bool hg_shadow_pool_serves_others(const struct hg_shadow_pool *p, const void *view)
{
    for (uint32_t i = 0; i < HG_SHADOW_POOL_MOST_PAGES; i++)
        if (p->pages[i].taken && p->pages[i].by != view &&
            p->picture - p->pages[i].wanted <= RECENT)
            return true;
    return false;
}

// --- places --------------------------------------------------------------------------------------

static uint32_t count_of(const struct hg_shadow_pool *p, const void *view)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < p->side * p->side; i++)
        count += p->pages[i].taken && p->pages[i].by == view;
    return count;
}

// A free page, or the one that was not wanted for longest: another view's that is still used goes
// to a view that has fewer. NULL: there is none.
static struct hg_shadow_page *find_room(struct hg_shadow_pool *p, const void *view)
{
    struct hg_shadow_page *best = NULL;
    for (uint32_t i = 0; i < p->side * p->side; i++) {
        struct hg_shadow_page *page = &p->pages[i];
        if (!page->taken)
            return page;
        if (page->wanted != p->picture && (best == NULL || page->wanted < best->wanted))
            best = page;
    }
    if (best == NULL || best->by == view || p->picture - best->wanted > RECENT)
        return best;
    return count_of(p, best->by) > count_of(p, view) + 1 ? best : NULL;
}

static void make_map(
    const struct hg_shadow_pool *p, const struct hg_shadow_page *page, struct hg_shadow_map *map)
{
    const uint32_t slot = (uint32_t)(page - p->pages);
    const float side = hg_shadow_page_side(&p->whole, page->level);
    *map = (struct hg_shadow_map){.gpu = p->whole, .stale = true};
    struct hg_gpu_shadow *s = &map->gpu;
    float *origin = (float *)&s->origin_ws;
    hg_mad3(origin, (const float *)&s->right_ws, ((float)page->x + 0.5f) * side, origin);
    hg_mad3(origin, (const float *)&s->up_ws, ((float)page->y + 0.5f) * side, origin);
    s->size_px = HG_SHADOW_PAGE_PX;
    s->extent = (float)HG_SHADOW_PAGE_INNER_PX / HG_SHADOW_PAGE_PX;
    s->texel_size = hg_shadow_page_texel(&p->whole, page->level);
    s->scale = 2 / (HG_SHADOW_PAGE_PX * s->texel_size);
    s->rect_px.x = p->rect_px.x + (float)(slot % p->side * HG_SHADOW_PAGE_PX);
    s->rect_px.y = p->rect_px.y + (float)(slot / p->side * HG_SHADOW_PAGE_PX);
    hg_shadow_map_project(map);
}

bool hg_shadow_pool_take(struct hg_shadow_pool *p, const struct hg_shadow_page *wanted,
    struct hg_shadow_map *map, uint32_t *evicted)
{
    struct hg_shadow_page *page = find_room(p, wanted->by);
    if (page == NULL)
        return false;
    *evicted += page->taken;
    release(p, page);
    *page = *wanted;
    page->taken = true;
    page->wanted = p->picture;
    uint16_t *chain = chain_of(p, page->level, page->x, page->y);
    p->next[page - p->pages] = *chain;
    *chain = (uint16_t)(page - p->pages + 1);
    make_map(p, page, map);
    p->due.order[p->due.count++] = (uint32_t)(page - p->pages);
    return true;
}
