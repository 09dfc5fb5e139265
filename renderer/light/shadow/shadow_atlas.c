#include "renderer/light/shadow/shadow_atlas.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"

#define IDLE_NS 1000000000u // an owner that took no step for so long loses its atlas first

// --- images --------------------------------------------------------------------------------------

static enum hg_status create_image(
    struct hg_gpu *gpu, uint32_t side, struct hg_gpu_image *out, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_2D,
        .format = VK_FORMAT_D32_SFLOAT,
        .width = side,
        .height = side,
        .attachment = true,
        .name = "shadow atlas"};
    return hg_gpu_image_create(gpu, &params, out, err);
}

enum hg_status hg_shadow_atlases_init(
    struct hg_shadow_atlases *s, struct hg_gpu *gpu, struct hg_error *err)
{
    s->gpu = gpu;
    return create_image(gpu, 1, &s->none, err);
}

static void drop(struct hg_shadow_atlases *s, struct hg_shadow_atlas *a)
{
    hg_gpu_image_destroy(s->gpu, &a->image);
    hg_shadow_plan_finish(&a->held);
    hg_free(a->pool);
    *a = (struct hg_shadow_atlas){0};
}

void hg_shadow_atlases_finish(struct hg_shadow_atlases *s)
{
    if (!s->gpu)
        return;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        drop(s, &s->items[i]);
    hg_gpu_image_destroy(s->gpu, &s->none);
}

void hg_shadow_atlases_note_drawn(struct hg_shadow_atlases *s, struct hg_shadow_atlas *a)
{
    a->revision = ++s->revision;
}

// Another image, which holds nothing.
static enum hg_status resize(
    struct hg_shadow_atlases *s, struct hg_shadow_atlas *a, uint32_t side_px, struct hg_error *err)
{
    struct hg_gpu_image next = {0};
    const enum hg_status status = create_image(s->gpu, side_px, &next, err);
    if (status)
        return status;
    hg_gpu_image_destroy(s->gpu, &a->image);
    a->image = next;
    a->held.count = 0;
    a->plan = NULL;
    hg_shadow_atlases_note_drawn(s, a);
    return HG_OK;
}

// --- what is held --------------------------------------------------------------------------------

static bool overlap(const struct hg_gpu_shadow *a, const struct hg_gpu_shadow *b)
{
    return a->rect_px.x < b->rect_px.x + b->size_px && b->rect_px.x < a->rect_px.x + a->size_px &&
           a->rect_px.y < b->rect_px.y + b->size_px && b->rect_px.y < a->rect_px.y + a->size_px;
}

static void drop_under(struct hg_shadow_atlas *a, const struct hg_gpu_shadow *place)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < a->held.count; i++)
        if (!overlap(&a->held.maps[i].gpu, place))
            a->held.maps[kept++] = a->held.maps[i];
    a->held.count = kept;
}

// The same projection, in the same place or in any; NULL: it is not held.
static const struct hg_shadow_map *find(const struct hg_shadow_atlas *a, const void *who,
    const struct hg_shadow_map *map, bool anywhere)
{
    for (uint32_t i = 0; i < a->held.count; i++) {
        const struct hg_shadow_map *held = &a->held.maps[i];
        struct hg_gpu_shadow there = held->gpu;
        if (anywhere)
            there.rect_px = map->gpu.rect_px;
        if (there.origin_ws.x == map->gpu.origin_ws.x &&
            memcmp(&there, &map->gpu, sizeof there) == 0 && (!held->own || a->owner == who))
            return held;
    }
    return NULL;
}

static bool is_pool(const struct hg_shadow_plan *plan, uint32_t map)
{
    return plan->paged && map == plan->pool;
}

// Takes over what became of the plan that was drawn last.
static void note(struct hg_shadow_atlas *a)
{
    struct hg_shadow_plan *plan = a->plan;
    if (a->pool)
        hg_shadow_pool_note(a->pool);
    for (uint32_t i = 0; plan && i < plan->count; i++) {
        struct hg_shadow_map *map = &plan->maps[i];
        const bool there = !map->stale || map->partly;
        if (is_pool(plan, i) || (!there && !map->touched) ||
            (there && !map->touched && find(a, a->user, map, false)))
            continue;
        drop_under(a, &map->gpu);
        if (there && !hg_grow(&a->held.maps, &a->held.capacity, (size_t)a->held.count + 1,
                         sizeof *a->held.maps)) // else it is drawn again
            a->held.maps[a->held.count++] = *map;
        map->touched = false;
    }
    a->plan = NULL;
}

void hg_shadow_atlases_note(struct hg_shadow_atlases *s, const void *user)
{
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        if (s->items[i].user == user)
            note(&s->items[i]);
}

// Where it lies in the atlas it holds what it held; else nothing.
static enum hg_status keep_pool(
    struct hg_shadow_atlas *a, const struct hg_shadow_user *user, const struct hg_shadow_map *pool)
{
    if (!a->pool)
        a->pool = hg_calloc(1, sizeof *a->pool);
    if (!a->pool)
        return HG_E_NOMEM;
    if (find(a, user->lighting, pool, false))
        return HG_OK;
    hg_shadow_pool_forget(a->pool);
    drop_under(a, &pool->gpu);
    if (hg_grow(&a->held.maps, &a->held.capacity, (size_t)a->held.count + 1, sizeof *a->held.maps))
        return HG_E_NOMEM;
    a->held.maps[a->held.count++] = *pool;
    return HG_OK;
}

static bool is_empty(const struct hg_shadow_rect *r)
{
    return r->x0 >= r->x1 || r->y0 >= r->y1;
}

// Casters moved since it was drawn.
static void age(struct hg_shadow_atlas *a, const struct hg_lighting_view *view)
{
    const struct hg_box *moved;
    uint32_t count;
    note(a);
    if (a->shape == view->shape_revision)
        return;
    if (!view->moved_since || !view->moved_since(view->shapes, a->shape, &moved, &count))
        count = a->held.count = 0;
    for (uint32_t k = 0; a->pool && k < count; k++)
        hg_shadow_pool_touch(a->pool, &moved[k]);
    for (uint32_t i = 0; i < a->held.count; i++) {
        struct hg_shadow_map *map = &a->held.maps[i];
        if (map->gpu.scale == 0) // the pool
            continue;
        map->dirty = map->stale ? map->dirty : (struct hg_shadow_rect){0};
        for (uint32_t k = 0; k < count; k++)
            hg_shadow_map_touch(map, &moved[k]);
        map->stale = !is_empty(&map->dirty);
        map->partly = true;
    }
    a->shape = view->shape_revision;
}

enum hg_status hg_shadow_atlas_plan(struct hg_shadow_atlas *a, const struct hg_shadow_user *user)
{
    struct hg_shadow_plan *plan = user->plan;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < plan->count; i++) {
        struct hg_shadow_map *map = &plan->maps[i];
        const struct hg_shadow_map *held =
            is_pool(plan, i) ? NULL : find(a, user->lighting, map, false);
        map->stale = held ? held->stale : !is_pool(plan, i);
        map->partly = held != NULL;
        map->dirty = held && held->stale ? held->dirty : (struct hg_shadow_rect){0};
        map->own = held && held->own;
        map->touched = false;
        if (is_pool(plan, i))
            status = keep_pool(a, user, map);
    }
    a->user = user->lighting;
    a->plan = plan;
    a->used_ns = hg_clock_now_ns();
    return status;
}

// --- whose it is ---------------------------------------------------------------------------------

static struct hg_shadow_atlas *own_of(const struct hg_shadow_atlases *s, const void *owner)
{
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        if (s->items[i].image.width > 0 && s->items[i].owner == owner)
            return (struct hg_shadow_atlas *)&s->items[i];
    return NULL;
}

static uint32_t kept_count(const struct hg_shadow_atlases *s)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        count += s->items[i].owner != NULL;
    return count;
}

static bool have_room(const struct hg_shadow_atlases *s, const void *owner)
{
    return own_of(s, owner) != NULL || kept_count(s) + 1 < HG_SHADOW_ATLASES;
}

void hg_shadow_atlases_release(struct hg_shadow_atlases *s, const void *owner)
{
    struct hg_shadow_atlas *own = own_of(s, owner);
    if (!own)
        return;
    note(own);
    own->owner = NULL;
    own->busy = false;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++) { // one that no view keeps is enough
        struct hg_shadow_atlas *other = &s->items[i];
        if (other == own || other->image.width == 0 || other->owner)
            continue;
        note(other);
        if (other->image.width >= own->image.width) {
            drop(s, own);
            return;
        }
        drop(s, other);
    }
}

void hg_shadow_atlases_leave(struct hg_shadow_atlases *s, const void *owner)
{
    hg_shadow_atlases_note(s, owner);
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        if (s->items[i].user == owner)
            s->items[i].user = NULL;
    hg_shadow_atlases_release(s, owner);
}

// At rest the picture is to be the same bytes however the camera came: sides and places of maps are
// those of the plan.
static bool is_strict(const struct hg_shadow_user *u)
{
    return !u->view->moves && !u->view->once;
}

static bool fits(const struct hg_shadow_atlas *a, const struct hg_shadow_user *u)
{
    return is_strict(u) ? a->image.width == u->plan->atlas_px : a->image.width >= u->plan->atlas_px;
}

// Maps of the plan that would have to be drawn.
static uint32_t lacking(const struct hg_shadow_atlas *a, const struct hg_shadow_user *u)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < u->plan->count; i++) {
        const struct hg_shadow_map *map = &u->plan->maps[i];
        if (!is_pool(u->plan, i) && u->view->moves && map->refines)
            continue;
        const struct hg_shadow_map *held = find(a, u->lighting, map, !is_strict(u));
        count += !held || held->stale;
    }
    return count;
}

// The pages of others would go if a view that refines kept it.
static bool is_needed(const struct hg_shadow_atlas *a, const struct hg_shadow_user *u)
{
    return u->keeping != HG_SHADOW_SHARES && a->pool &&
           hg_shadow_pool_serves_others(a->pool, u->lighting);
}

// The one with most of the maps, of those that no view keeps or, if it lacks none, of all.
static struct hg_shadow_atlas *find_best(
    struct hg_shadow_atlases *s, const struct hg_shadow_user *u)
{
    struct hg_shadow_atlas *best = NULL;
    uint32_t least = 0;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++) {
        struct hg_shadow_atlas *a = &s->items[i];
        if (a->image.width == 0 || !fits(a, u) || is_needed(a, u))
            continue;
        const uint32_t count = lacking(a, u);
        if (a->owner && (u->keeping == HG_SHADOW_KEEPS || a->busy || count > 0))
            continue;
        if (best && (count > least || (count == least && best->owner == NULL)))
            continue;
        best = a;
        least = count;
    }
    return best;
}

static struct hg_shadow_atlas *find_free(struct hg_shadow_atlases *s)
{
    struct hg_shadow_atlas *found = NULL;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        if (s->items[i].image.width == 0)
            return &s->items[i];
        else if (!s->items[i].owner)
            found = &s->items[i];
    return found;
}

// Those that refine take turns in a circle: taking the one that was used last lets the others get
// on. An owner that rests itself is the exception.
static struct hg_shadow_atlas *find_victim(struct hg_shadow_atlases *s)
{
    struct hg_shadow_atlas *oldest = NULL, *newest = NULL;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++) {
        struct hg_shadow_atlas *a = &s->items[i];
        if (!a->owner)
            continue;
        oldest = !oldest || a->used_ns < oldest->used_ns ? a : oldest;
        newest = !newest || a->used_ns > newest->used_ns ? a : newest;
    }
    return hg_clock_now_ns() - oldest->used_ns > IDLE_NS ? oldest : newest;
}

// *shares: it stays another's.
static struct hg_shadow_atlas *choose(
    struct hg_shadow_atlases *s, const struct hg_shadow_user *u, bool *shares)
{
    *shares = u->keeping == HG_SHADOW_SHARES;
    struct hg_shadow_atlas *own = own_of(s, u->lighting);
    if (own && !*shares)
        return own;
    struct hg_shadow_atlas *best = find_best(s, u);
    *shares |= best && best->owner;
    if (*shares)
        return best ? best : find_free(s);
    if (!have_room(s, u->lighting))
        return find_victim(s);
    return best ? best : find_free(s);
}

enum hg_status hg_shadow_atlases_take(struct hg_shadow_atlases *s, const struct hg_shadow_user *u,
    struct hg_shadow_atlas **out, struct hg_error *err)
{
    bool shares;
    *out = NULL;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        age(&s->items[i], u->view);
    if (u->keeping == HG_SHADOW_SHARES)
        hg_shadow_atlases_release(s, u->lighting);
    struct hg_shadow_atlas *a = choose(s, u, &shares);
    const enum hg_status status =
        a->image.width > 0 && fits(a, u) ? HG_OK : resize(s, a, u->plan->atlas_px, err);
    if (status)
        return status;
    a->shape = u->view->shape_revision;
    if (!shares) {
        a->owner = u->lighting;
        a->busy = u->keeping == HG_SHADOW_KEEPS;
    }
    *out = a;
    return HG_OK;
}
