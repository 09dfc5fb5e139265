#include "renderer/light/shadow/shadow_pages.h"

#include <math.h>
#include <string.h>

#include "renderer/light/shadow/shadow_plan.h"
#include "renderer/math/vec.h"

#define SIDE      HG_SHADOW_PAGE_WINDOW
#define SEEN_PX   8    // every so many pixels of the picture ask, across and down
#define COARSE    4.0f // times a pixel: a shadow's edge that is seen to be coarse

// --- geometry of the levels ----------------------------------------------------------------------

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

void hg_shadow_pages_begin(
    struct hg_shadow_pages *p, struct hg_shadow_pool *pool, const struct hg_gpu_camera *camera)
{
    const struct hg_gpu_shadow none = {0}, *whole = pool != NULL ? &pool->whole : &none;
    if (memcmp(whole, &p->whole, sizeof *whole) != 0)
        memset(p->requests, 0, sizeof p->requests);
    p->whole = *whole;
    p->pool = pool;
    hg_shadow_page_plane(whole, (const float *)&camera->eye_ws, p->eye);
    p->per_depth = camera->orthographic != 0 ? 0 : camera->pixel_angle;
    p->constant = camera->orthographic != 0 ? camera->pixel_size : 0;
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
    hg_shadow_page_plane(&p->whole, position, at);
    if (level >= HG_SHADOW_PAGE_LEVELS || !is_in_whole(p, at))
        return;
    const float side = hg_shadow_page_side(&p->whole, level);
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
    if (p->pool == NULL)
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

// Words of the table cannot tell pages apart that are too far from each other.
static bool is_far(const struct hg_shadow_pages *p, const struct hg_shadow_page *page)
{
    const float side = hg_shadow_page_side(&p->whole, page->level);
    const float most = (float)(HG_SHADOW_PAGE_TAG_MASK / 4 * SIDE);
    return fabsf((float)page->x - p->eye[0] / side) > most ||
           fabsf((float)page->y - p->eye[1] / side) > most;
}

// Pages of the pool in the window of the view; of two at one place the one that it wants, else the
// one that any view wanted last.
static void fill_table(struct hg_shadow_pages *p)
{
    const struct hg_shadow_page *pages = p->pool->pages;
    memset(p->table, 0, sizeof p->table);
    for (uint32_t i = 0; i < p->pool->side * p->pool->side; i++) {
        const struct hg_shadow_page *page = &pages[i];
        const uint32_t place = page->level * SIDE * SIDE + place_of(page->x, page->y);
        const uint32_t other = p->table[place] & HG_SHADOW_PAGE_SLOT_MASK;
        if (!page->taken)
            continue;
        p->stats.held++;
        if ((other > 0 && pages[other - 1].wanted > page->wanted) ||
            (page->wanted != p->pool->picture && is_far(p, page)))
            continue;
        p->table[place] = tag_of(page->x, page->y) | (i + 1);
    }
}

// Marks what is held of what was asked for, and lists the most asked for of the rest.
static uint32_t find_missing(struct hg_shadow_pages *p, struct missing list[HG_SHADOW_FRESH_PAGES])
{
    uint32_t count = 0;
    for (uint32_t level = 0; level < HG_SHADOW_PAGE_LEVELS; level++)
        for (uint32_t i = 0; i < SIDE * SIDE; i++) {
            const struct hg_shadow_page_request *r = &p->requests[level][i];
            if (r->count == 0)
                continue;
            struct hg_shadow_page *page = hg_shadow_pool_find(p->pool, level, r->x, r->y);
            p->stats.asked++;
            p->stats.hits += page != NULL;
            if (page == NULL) {
                insert(list, &count, (struct missing){*r, level});
                continue;
            }
            page->wanted = p->pool->picture;
            page->by = p->view;
        }
    return count;
}

uint32_t hg_shadow_pages_plan(struct hg_shadow_pages *p, struct hg_shadow_map *maps)
{
    struct missing list[HG_SHADOW_FRESH_PAGES];
    struct hg_shadow_pool *pool = p->pool;
    p->stats = (struct hg_shadow_page_stats){0};
    if (pool == NULL) {
        memset(p->table, 0, sizeof p->table);
        return 0;
    }
    p->stats.room = pool->side * pool->side;
    const uint32_t count = find_missing(p, list);
    for (uint32_t i = 0; i < count; i++) {
        const struct missing *m = &list[i];
        const struct hg_shadow_page page = {
            .x = m->request.x, .y = m->request.y, .level = m->level, .by = p->view};
        if (!hg_shadow_pool_take(pool, &page, &maps[p->stats.drawn], &p->stats.evicted))
            break;
        p->stats.drawn++;
    }
    pool->due.maps = maps;
    fill_table(p);
    return p->stats.drawn;
}

// --- looking up ----------------------------------------------------------------------------------

bool hg_shadow_pages_find(const struct hg_shadow_pages *p, const float position[3],
    float view_depth, struct hg_shadow_page_found *out)
{
    float at[2];
    *out = (struct hg_shadow_page_found){0};
    if (p->pool == NULL)
        return false;
    hg_shadow_page_plane(&p->whole, position, at);
    out->wanted = level_of(p, view_depth);
    if (!is_in_whole(p, at))
        return false;
    for (uint32_t i = 0; i < HG_SHADOW_PAGE_TRIES; i++) {
        const uint32_t level = out->wanted + i;
        if (level >= HG_SHADOW_PAGE_LEVELS)
            return false;
        const float side = hg_shadow_page_side(&p->whole, level);
        const int32_t x = (int32_t)floorf(at[0] / side), y = (int32_t)floorf(at[1] / side);
        const uint32_t word = p->table[level * SIDE * SIDE + place_of(x, y)];
        if (word == 0 || (word & ~HG_SHADOW_PAGE_SLOT_MASK) != tag_of(x, y))
            continue;
        out->page = p->pool->pages[(word & HG_SHADOW_PAGE_SLOT_MASK) - 1];
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
    const bool has = p->pool != NULL;
    const float finest = has ? hg_shadow_page_texel(&p->whole, 0) : 1;
    out->rect_px = has ? p->pool->rect_px : (struct hg_vec2){0, 0};
    out->side = has ? p->pool->side : 0;
    out->texel = finest;
    out->per_depth = p->per_depth / finest;
    out->constant = p->constant / finest;
}
