#include "renderer/light/shadow/shadow_pages.h"

#include <math.h>
#include <string.h>

#include "renderer/light/shadow/shadow_plan.h"
#include "renderer/math/vec.h"

#define SIDE      HG_SHADOW_PAGE_WINDOW
#define BORDER_PX (0.5f * (HG_SHADOW_PAGE_PX - HG_SHADOW_PAGE_INNER_PX))
#define TOUCH_PX  4.0f // about boxes of casters, for lines, points and rounding
#define SEEN_PX   8    // every so many pixels of the picture ask, across and down
#define COARSE    4.0f // times a pixel: a shadow's edge that is seen to be coarse
#define FINER     0.7f // of a texel of the whole map: coarser levels would not be worth it

// --- geometry of the levels ----------------------------------------------------------------------

float hg_shadow_page_texel(const struct hg_gpu_shadow *whole, uint32_t level)
{
    const float coarsest = exp2f(floorf(log2f(whole->texel_size * FINER)));
    return ldexpf(coarsest, (int)level - (HG_SHADOW_PAGE_LEVELS - 1));
}

// Metres of a side of a page, without its border.
static float page_side(const struct hg_shadow_pages *p, uint32_t level)
{
    return HG_SHADOW_PAGE_INNER_PX * hg_shadow_page_texel(&p->whole, level);
}

// In the plane of the projection, from the origin of the whole map.
static void plane_of(const struct hg_shadow_pages *p, const float position[3], float out[2])
{
    float d[3];
    hg_sub3(position, (const float *)&p->whole.origin_ws, d);
    out[0] = hg_dot3(d, (const float *)&p->whole.right_ws);
    out[1] = hg_dot3(d, (const float *)&p->whole.up_ws);
}

static bool is_in_whole(const struct hg_shadow_pages *p, const float at[2])
{
    return fmaxf(fabsf(at[0]), fabsf(at[1])) * p->whole.scale <= p->whole.extent;
}

// The finest level whose texels are at least as large as a pixel, so at most two; past the last one
// where the whole map is fine enough.
static uint32_t level_of(const struct hg_shadow_pages *p, float view_depth)
{
    const float texels =
        (view_depth * p->per_depth + p->constant) / hg_shadow_page_texel(&p->whole, 0);
    return (uint32_t)hg_clampf(ceilf(log2f(fmaxf(texels, 1))), 0, HG_SHADOW_PAGE_LEVELS);
}

static uint32_t place_of(int32_t x, int32_t y)
{
    return ((uint32_t)y % SIDE) * SIDE + (uint32_t)x % SIDE;
}

static uint32_t tag_of(int32_t x, int32_t y)
{
    const uint32_t mask = HG_SHADOW_PAGE_TAG_MASK;
    return (((uint32_t)x / SIDE) & mask) << HG_SHADOW_PAGE_TAG_X | (((uint32_t)y / SIDE) & mask)
                                                                       << HG_SHADOW_PAGE_TAG_Y;
}

// --- what is held --------------------------------------------------------------------------------

static uint32_t *word_of(struct hg_shadow_pages *p, uint32_t level, int32_t x, int32_t y)
{
    return &p->table[level * SIDE * SIDE + place_of(x, y)];
}

// The page that the table has, NULL: it has another one or none.
static struct hg_shadow_page *held(struct hg_shadow_pages *p, uint32_t level, int32_t x, int32_t y)
{
    const uint32_t word = *word_of(p, level, x, y), slot = word & HG_SHADOW_PAGE_SLOT_MASK;
    const bool same = slot > 0 && (word & ~HG_SHADOW_PAGE_SLOT_MASK) == tag_of(x, y);
    return same ? &p->pages[slot - 1] : NULL;
}

static void release(struct hg_shadow_pages *p, struct hg_shadow_page *page)
{
    if (page->taken)
        *word_of(p, page->level, page->x, page->y) = 0;
    page->taken = false;
}

void hg_shadow_pages_forget(struct hg_shadow_pages *p)
{
    for (uint32_t i = 0; i < HG_SHADOW_POOL_MOST_PAGES; i++)
        release(p, &p->pages[i]);
}

void hg_shadow_pages_begin(struct hg_shadow_pages *p, const struct hg_gpu_shadow *pool,
    const struct hg_gpu_shadow *whole, const struct hg_gpu_camera *camera)
{
    struct hg_gpu_shadow projection = {0};
    uint32_t side = 0;
    if (pool != NULL) {
        projection = *whole;
        projection.rect_px = (struct hg_vec2){0, 0}; // where the whole map is does not matter
        side = (uint32_t)pool->size_px / HG_SHADOW_PAGE_PX;
    }
    const bool same = side == p->side && memcmp(&projection, &p->whole, sizeof projection) == 0 &&
                      (pool == NULL || memcmp(&pool->rect_px, &p->rect_px, sizeof p->rect_px) == 0);
    if (!same) {
        hg_shadow_pages_forget(p);
        memset(p->requests, 0, sizeof p->requests);
    }
    p->whole = projection;
    p->side = side;
    p->rect_px = pool != NULL ? pool->rect_px : (struct hg_vec2){0, 0};
    p->per_depth = camera->orthographic != 0 ? 0 : camera->pixel_angle;
    p->constant = camera->orthographic != 0 ? camera->pixel_size : 0;
}

void hg_shadow_pages_touch(struct hg_shadow_pages *p, const struct hg_box *casters)
{
    float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int c = 0; c < 8 && p->side > 0; c++) {
        float at[2];
        const float corner[3] = {c & 1 ? casters->max[0] : casters->min[0],
            c & 2 ? casters->max[1] : casters->min[1], c & 4 ? casters->max[2] : casters->min[2]};
        plane_of(p, corner, at);
        for (int i = 0; i < 2; i++) {
            low[i] = fminf(low[i], at[i]);
            high[i] = fmaxf(high[i], at[i]);
        }
    }
    for (int i = 0; i < 2; i++) // bounds that are no numbers may be anywhere
        if (!(low[i] <= high[i])) {
            low[i] = -INFINITY;
            high[i] = INFINITY;
        }
    for (uint32_t i = 0; i < HG_SHADOW_POOL_MOST_PAGES; i++) {
        struct hg_shadow_page *page = &p->pages[i];
        if (!page->taken)
            continue;
        const float side = page_side(p, page->level);
        const float margin = (BORDER_PX + TOUCH_PX) * side / HG_SHADOW_PAGE_INNER_PX;
        const float first[2] = {(float)page->x * side - margin, (float)page->y * side - margin};
        const float across = side + 2 * margin;
        if (low[0] <= first[0] + across && low[1] <= first[1] + across && high[0] >= first[0] &&
            high[1] >= first[1])
            release(p, page);
    }
}

// --- requests ------------------------------------------------------------------------------------

// Of two pages at one place of the window the one that most surfaces ask for remains (Boyer and
// Moore 1991, "MJRTY").
static void ask(struct hg_shadow_pages *p, uint32_t level, int32_t x, int32_t y)
{
    struct hg_shadow_page_request *r = &p->requests[level][place_of(x, y)];
    if (r->count > 0 && (r->x != x || r->y != y)) {
        r->count--;
        return;
    }
    r->x = x;
    r->y = y;
    r->count++;
}

static void ask_for(struct hg_shadow_pages *p, const float position[3], float view_depth)
{
    const uint32_t level = level_of(p, view_depth);
    float at[2];
    plane_of(p, position, at);
    if (level >= HG_SHADOW_PAGE_LEVELS || !is_in_whole(p, at))
        return;
    const float side = page_side(p, level);
    ask(p, level, (int32_t)floorf(at[0] / side), (int32_t)floorf(at[1] / side));
}

// View depth of a reversed depth: clip z over clip w, of the projection of camera.h.
static float view_depth_of(const struct hg_gpu_camera *c, float depth)
{
    const float a = c->proj.m[10], b = c->proj.m[14];
    return c->orthographic != 0 ? (b - depth) / a : b / (depth + a);
}

// What a pixel shows; false: the background.
static bool surface_at(const struct hg_gpu_camera *c, const struct hg_shadow_depth *depth,
    const uint32_t px[2], float position[3], float *view_depth)
{
    const float d = depth->rows[(size_t)px[1] * depth->width + px[0]];
    float at[3];
    if (!(d > 0))
        return false;
    *view_depth = view_depth_of(c, d);
    hg_mad3((const float *)&c->ray_origin_ws, (const float *)&c->ray_y_ws, (float)px[1] + 0.5f, at);
    hg_mad3(at, (const float *)&c->ray_x_ws, (float)px[0] + 0.5f, at);
    if (c->orthographic != 0)
        hg_mad3(at, (const float *)&c->forward_ws, *view_depth, position);
    else
        hg_mad3((const float *)&c->eye_ws, at, *view_depth, position);
    return true;
}

void hg_shadow_pages_see(
    struct hg_shadow_pages *p, const struct hg_gpu_camera *c, const struct hg_shadow_depth *depth)
{
    if (p->side == 0)
        return;
    memset(p->requests, 0, sizeof p->requests);
    for (uint32_t y = SEEN_PX / 2; y < depth->height; y += SEEN_PX)
        for (uint32_t x = SEEN_PX / 2; x < depth->width; x += SEEN_PX) {
            float position[3], view_depth;
            if (surface_at(c, depth, (uint32_t[2]){x, y}, position, &view_depth))
                ask_for(p, position, view_depth);
        }
}

float hg_shadow_pages_share(
    float whole_texel, const struct hg_gpu_camera *c, const struct hg_shadow_depth *depth)
{
    uint32_t seen = 0, coarse = 0;
    for (uint32_t y = SEEN_PX / 2; y < depth->height; y += SEEN_PX)
        for (uint32_t x = SEEN_PX / 2; x < depth->width; x += SEEN_PX) {
            const float d = depth->rows[(size_t)y * depth->width + x];
            if (!(d > 0))
                continue;
            const float pixel =
                c->orthographic != 0 ? c->pixel_size : c->pixel_angle * view_depth_of(c, d);
            seen++;
            coarse += pixel * COARSE < whole_texel;
        }
    return seen > 0 ? (float)coarse / (float)seen : 0;
}

// --- the plan of a picture -----------------------------------------------------------------------

struct missing {
    struct hg_shadow_page_request request;
    uint32_t level;
};

// Most asked for first; then by place, so that the order is one.
static bool comes_before(const struct missing *a, const struct missing *b)
{
    if (a->request.count != b->request.count)
        return a->request.count > b->request.count;
    if (a->level != b->level)
        return a->level > b->level;
    return a->request.y != b->request.y ? a->request.y < b->request.y : a->request.x < b->request.x;
}

static void insert(struct missing list[HG_SHADOW_FRESH_PAGES], uint32_t *count, struct missing m)
{
    uint32_t at = *count;
    if (at == HG_SHADOW_FRESH_PAGES && !comes_before(&m, &list[at - 1]))
        return;
    at = at < HG_SHADOW_FRESH_PAGES ? at : at - 1;
    for (; at > 0 && comes_before(&m, &list[at - 1]); at--)
        list[at] = list[at - 1];
    list[at] = m;
    *count += *count < HG_SHADOW_FRESH_PAGES;
}

// A free page, or the one that was not wanted for longest; NULL: this picture wants all of them.
static struct hg_shadow_page *find_room(struct hg_shadow_pages *p)
{
    struct hg_shadow_page *best = NULL;
    for (uint32_t i = 0; i < p->side * p->side; i++) {
        struct hg_shadow_page *page = &p->pages[i];
        if (!page->taken)
            return page;
        if (page->wanted != p->picture && (best == NULL || page->wanted < best->wanted))
            best = page;
    }
    return best;
}

static void make_map(
    const struct hg_shadow_pages *p, const struct hg_shadow_page *page, struct hg_shadow_map *map)
{
    const uint32_t slot = (uint32_t)(page - p->pages);
    const float side = page_side(p, page->level);
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

static void take(struct hg_shadow_pages *p, struct hg_shadow_page *page, const struct missing *m)
{
    struct hg_shadow_page *other = NULL; // at the same place of the window
    const uint32_t slot =
        *word_of(p, m->level, m->request.x, m->request.y) & HG_SHADOW_PAGE_SLOT_MASK;
    if (slot > 0)
        other = &p->pages[slot - 1];
    if (other != NULL)
        release(p, other);
    release(p, page);
    *page = (struct hg_shadow_page){m->request.x, m->request.y, m->level, p->picture, true};
    *word_of(p, page->level, page->x, page->y) =
        tag_of(page->x, page->y) | ((uint32_t)(page - p->pages) + 1);
}

uint32_t hg_shadow_pages_plan(struct hg_shadow_pages *p, struct hg_shadow_map *maps)
{
    struct missing list[HG_SHADOW_FRESH_PAGES];
    uint32_t count = 0, drawn = 0;
    p->picture++;
    p->stats = (struct hg_shadow_page_stats){.room = p->side * p->side};
    for (uint32_t level = 0; level < HG_SHADOW_PAGE_LEVELS && p->side > 0; level++)
        for (uint32_t i = 0; i < SIDE * SIDE; i++) {
            const struct hg_shadow_page_request *r = &p->requests[level][i];
            if (r->count == 0)
                continue;
            struct hg_shadow_page *page = held(p, level, r->x, r->y);
            p->stats.asked++;
            p->stats.hits += page != NULL;
            if (page != NULL)
                page->wanted = p->picture;
            else
                insert(list, &count, (struct missing){*r, level});
        }
    for (; drawn < count; drawn++) {
        struct hg_shadow_page *page = find_room(p);
        if (page == NULL)
            break;
        p->stats.evicted += page->taken;
        take(p, page, &list[drawn]);
        make_map(p, page, &maps[drawn]);
        p->order[drawn] = (uint32_t)(page - p->pages);
    }
    p->stats.drawn = drawn;
    for (uint32_t i = 0; i < HG_SHADOW_POOL_MOST_PAGES; i++)
        p->stats.held += p->pages[i].taken;
    return drawn;
}

void hg_shadow_pages_drawn(
    struct hg_shadow_pages *p, const struct hg_shadow_map *maps, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (maps[i].stale)
            release(p, &p->pages[p->order[i]]);
}

// --- looking up ----------------------------------------------------------------------------------

bool hg_shadow_pages_find(const struct hg_shadow_pages *p, const float position[3],
    float view_depth, struct hg_shadow_page_found *out)
{
    float at[2];
    *out = (struct hg_shadow_page_found){0};
    if (p->side == 0)
        return false;
    plane_of(p, position, at);
    out->wanted = level_of(p, view_depth);
    if (!is_in_whole(p, at))
        return false;
    for (uint32_t i = 0; i < HG_SHADOW_PAGE_TRIES; i++) {
        const uint32_t level = out->wanted + i;
        if (level >= HG_SHADOW_PAGE_LEVELS)
            return false;
        const float side = page_side(p, level);
        const int32_t x = (int32_t)floorf(at[0] / side), y = (int32_t)floorf(at[1] / side);
        const uint32_t word = p->table[level * SIDE * SIDE + place_of(x, y)];
        if (word == 0 || (word & ~HG_SHADOW_PAGE_SLOT_MASK) != tag_of(x, y))
            continue;
        out->page = p->pages[(word & HG_SHADOW_PAGE_SLOT_MASK) - 1];
        out->slot = (word & HG_SHADOW_PAGE_SLOT_MASK) - 1;
        return true;
    }
    return false;
}

void hg_shadow_pages_color(const struct hg_shadow_pages *p, const struct hg_gpu_camera *camera,
    const struct hg_shadow_depth *depth, const uint32_t px[2], uint8_t out[4])
{
    static const uint8_t levels[8][3] = {{231, 39, 39}, {243, 137, 0}, {237, 225, 0}, {63, 196, 63},
        {0, 203, 194}, {39, 108, 243}, {97, 39, 170}, {188, 63, 218}};
    float position[3], view_depth;
    memset(out, 40, 3);
    out[3] = 255;
    if (!surface_at(camera, depth, px, position, &view_depth))
        return;
    struct hg_shadow_page_found f;
    memset(out, 128, 3);
    if (!hg_shadow_pages_find(p, position, view_depth, &f))
        return;
    const uint8_t *color = levels[(HG_SHADOW_PAGE_LEVELS - 1 - f.page.level) % 8];
    const bool dark = ((f.page.x + f.page.y) & 1) != 0, waits = f.page.level != f.wanted;
    for (int c = 0; c < 3; c++)
        out[c] = (uint8_t)((waits ? 64 + color[c] / 4 : color[c]) * (dark ? 3 : 4) / 4);
}

void hg_shadow_pages_fill(const struct hg_shadow_pages *p, struct hg_gpu_shadow_pages *out)
{
    const float finest = p->side > 0 ? hg_shadow_page_texel(&p->whole, 0) : 1;
    out->rect_px = p->rect_px;
    out->side = p->side;
    out->texel = finest;
    out->per_depth = p->per_depth / finest;
    out->constant = p->constant / finest;
}
