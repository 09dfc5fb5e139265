// hits.c - see hits.h.
#include "renderer/reflect/hits.h"

#include <float.h>

#include "renderer/host_shading/surfaces.h"

#define AT_ONCE 64 // rays that one job looks up

static void add(const struct hg_reflect *r, size_t i, const float radiance[3], float open)
{
    const float w = r->samples[i].weight;
    if (!(radiance[0] + radiance[1] + radiance[2] < FLT_MAX))
        return; // filters would spread what is not a number
    r->sums[i] +=
        (hg_reflect_sums){w * radiance[0], w * radiance[1], w * radiance[2], w * open, w, 0, 0, 0};
}

// --- what they meet ------------------------------------------------------------------------------

static void surface_of_hit(const struct hg_reflect_work *w, size_t i, struct hg_gi_patch *out)
{
    const struct hg_reflect_texel *t = &w->r->texels[i];
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->r->hits.mapped + i;
    const float *d = w->r->samples[i].direction;
    struct hg_host_surface surface;
    hg_host_surface_at(w->p->world.surfaces, hit, d, &surface);
    hg_mad3(t->position, d, t->length, out->position);
    hg_copy3(surface.normal, out->normal);
    hg_copy3(surface.material->albedo, out->albedo);
    hg_copy3(surface.material->emission, out->emission);
}

// Of a ray that met something: what the cache has, or that the texel waits (HG_REFLECT_LATE).
static void look_up(const struct hg_reflect_work *w, size_t i, bool filled)
{
    struct hg_reflect *r = w->r;
    const struct hg_reflect_texel *t = &r->texels[i];
    struct hg_cache_query q = {
        .roughness = t->roughness, .length = t->length, .sample = r->samples[i], .filled = filled};
    struct hg_gi_patch surface;
    float radiance[3] = {0};
    surface_of_hit(w, i, &surface);
    hg_copy3(surface.position, q.position);
    hg_copy3(surface.normal, q.normal);
    const enum hg_cache_answer answer =
        hg_radiance_cache_find(w->p->cache, &q, &r->places[i], radiance);
    r->sources[i] = HG_REFLECT_LATE;
    r->answers[i] = (uint8_t)answer;
    if (answer < HG_CACHE_STALE)
        return;
    add(r, i, radiance, 0);
    r->sources[i] = HG_REFLECT_CACHED;
}

static void find(void *user, size_t index)
{
    const struct hg_reflect_work *w = user;
    struct hg_reflect *r = w->r;
    static const float none[3] = {0};
    const uint32_t *list = r->list.mapped;
    for (size_t k = index * AT_ONCE; k < (index + 1) * AT_ONCE && k < r->ray_count; k++) {
        const uint32_t i = list[k];
        const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)r->hits.mapped + i;
        const bool met = hit->draw != HG_HIT_NONE && r->samples[i].weight > 0;
        r->sources[i] = met ? HG_REFLECT_LATE : HG_REFLECT_SKY;
        r->answers[i] = HG_CACHE_NOTHING;
        if (!met)
            add(r, i, none, 1);
        else if (w->p->cache)
            look_up(w, i, false);
    }
}

// --- light ---------------------------------------------------------------------------------------

// Texels that wait for light; those of the cache whose light is old have it for now, and come last.
static uint32_t list_waiting(struct hg_reflect *r)
{
    const uint32_t *list = r->list.mapped;
    uint32_t waiting = 0;
    for (uint32_t k = 0; k < r->ray_count; k++)
        if (r->sources[list[k]] == HG_REFLECT_LATE)
            r->waiting[waiting++] = list[k];
    const uint32_t late = waiting;
    for (uint32_t k = 0; k < r->ray_count && late < HG_REFLECT_MOST_LIT; k++)
        if (r->sources[list[k]] == HG_REFLECT_CACHED && r->answers[list[k]] == HG_CACHE_STALE)
            r->waiting[waiting++] = list[k];
    return waiting;
}

// Every n-th of them where there are more than one picture has time for, others in the next one.
struct turn {
    uint32_t at, step;
};
static struct turn take_turn(const struct hg_reflect *r, uint32_t waiting)
{
    const uint32_t step = (waiting + HG_REFLECT_MOST_LIT - 1) / HG_REFLECT_MOST_LIT;
    return (struct turn){step > 0 ? r->number % step : 0, step > 0 ? step : 1};
}

// Places of the cache that were not requested before take the surface of the first hit that
// requests them; the other hits look them up again.
static void fill_places(const struct hg_reflect_work *w, uint32_t waiting)
{
    struct hg_reflect *r = w->r;
    const struct turn turn = take_turn(r, waiting);
    for (uint32_t k = turn.at; k < waiting; k += turn.step) {
        const uint32_t i = r->waiting[k];
        struct hg_gi_patch surface;
        if (r->answers[i] != HG_CACHE_EMPTY)
            continue;
        if (!hg_radiance_cache_ask(w->p->cache, r->places[i])) {
            look_up(w, i, true);
            continue;
        }
        surface_of_hit(w, i, &surface);
        hg_radiance_cache_fill(w->p->cache, r->places[i], &surface);
        r->answers[i] = HG_CACHE_UNLIT;
        r->stats.captured++;
    }
}

// What is lit for this picture: places of the cache, each once, and hits that it has no place for.
static void choose_lit(const struct hg_reflect_work *w, uint32_t waiting)
{
    struct hg_reflect *r = w->r;
    const struct turn turn = take_turn(r, waiting);
    r->ask_count = r->light.count = 0;
    for (uint32_t k = turn.at; k < waiting && r->ask_count < HG_REFLECT_MOST_LIT; k += turn.step) {
        const uint32_t i = r->waiting[k];
        const bool cached = r->answers[i] >= HG_CACHE_UNLIT;
        if (r->sources[i] == HG_REFLECT_CACHED && r->answers[i] != HG_CACHE_STALE)
            continue;
        struct hg_reflect_ask *ask = &r->asks[r->ask_count++];
        *ask = (struct hg_reflect_ask){i, r->places[i], cached, UINT32_MAX};
        if (cached && !hg_radiance_cache_ask(w->p->cache, r->places[i]))
            continue; // another texel's
        ask->point = r->light.count++;
        if (cached)
            hg_radiance_cache_surface(w->p->cache, r->places[i], &r->light.points[ask->point]);
        else
            surface_of_hit(w, i, &r->light.points[ask->point]);
    }
}

static void spread_light(const struct hg_reflect_work *w)
{
    struct hg_reflect *r = w->r;
    for (uint32_t k = 0; k < r->ask_count; k++) {
        const struct hg_reflect_ask *ask = &r->asks[k];
        if (ask->cached && ask->point != UINT32_MAX)
            hg_radiance_cache_light(w->p->cache, ask->place, r->light.radiance[ask->point]);
    }
    for (uint32_t k = 0; k < r->ask_count; k++) {
        const struct hg_reflect_ask *ask = &r->asks[k];
        if (r->sources[ask->texel] == HG_REFLECT_CACHED)
            continue; // old light was good enough for this picture
        if (ask->cached)
            look_up(w, ask->texel, true);
        else
            add(r, ask->texel, r->light.radiance[ask->point], 0);
        r->sources[ask->texel] = HG_REFLECT_SHADED;
    }
}

enum hg_status hg_reflect_shade(const struct hg_reflect_work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    const struct hg_gi_patch_lighting with = {r->jobs, w->p->sources, &w->p->world, r->number};
    hg_jobs_for(r->jobs, (r->ray_count + AT_ONCE - 1) / AT_ONCE, find, (void *)w);
    const uint32_t waiting = list_waiting(r);
    if (w->p->cache)
        fill_places(w, waiting);
    choose_lit(w, waiting);
    r->stats.lit += r->light.count;
    const enum hg_status status = hg_gi_patches_light(&r->light, &with, &r->stats.shadow_rays, err);
    if (status == HG_OK)
        spread_light(w);
    return status;
}
