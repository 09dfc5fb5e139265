// cache.c - see cache.h.
#include "renderer/reflect/cache.h"

#include <float.h>

#include "base/alloc.h"

#define FACES        6
#define LEAST_APART  2.0f  // between probes, in spacings of the field
#define DEPTH_BETA   4.0f  // texels by which a surface may lie off what its texel shows
#define MOST_LIKELY  0.1f  // that another sample falls on the same texel
#define FACING_LEAST 0.5f  // cosine between the normals of both
#define TRIES        3     // nearest probes that are looked at

#define ASKED    0x80000000u // in texel.state
#define FILLED   0x40000000u
#define LIT_MASK 0xffu
#define LIT_MOST 255u

struct texel {
    float position[3], normal[3];
    float radiance[3];
    uint32_t albedo[2]; // halves would do; 16 bits each, of 0..1
    float emission[3];
    uint32_t state; // how often it was lit by the present light, ASKED, FILLED
    uint32_t light; // number of the light that lit it; 0: never
};

struct probe {
    float position[3];
    struct texel *texels; // [FACES][side][side]
};

struct grid { // of a field of probes
    uint32_t counts[3];
    float origin[3], spacing;
};

struct hg_radiance_cache {
    struct hg_cache_key key;
    uint32_t light; // number of the present one, from 1
    uint32_t count;
    struct probe probes[HG_CACHE_MOST_PROBES];
    struct grid placed; // that they were placed on
    struct hg_radiance_cache_stats stats;
};

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_radiance_cache_create(struct hg_radiance_cache **out)
{
    *out = hg_calloc(1, sizeof **out);
    return *out ? HG_OK : HG_E_NOMEM;
}

static void clear(struct hg_radiance_cache *cache)
{
    for (uint32_t i = 0; i < cache->count; i++)
        hg_free(cache->probes[i].texels);
    cache->count = 0;
    cache->stats.bytes = 0;
}

void hg_radiance_cache_destroy(struct hg_radiance_cache *cache)
{
    if (!cache)
        return;
    clear(cache);
    hg_free(cache);
}

// --- placement -----------------------------------------------------------------------------------

// How far a probe of the field sees, in the mean; spacings.
static float sees(const struct hg_gi_field *field, uint32_t probe)
{
    float sum = 0;
    for (int i = 0; i < HG_PROBE_MOMENT_TEXELS; i++)
        sum += field->means[probe].reach[i][0];
    return sum / HG_PROBE_MOMENT_TEXELS;
}

// How well a place suits: it sees far, and is far from the probes that there are.
static float suits(
    const struct hg_radiance_cache *cache, const struct hg_gi_field *field, uint32_t probe)
{
    float at[3], d[3], nearest = FLT_MAX;
    hg_gi_probe_position(field, probe, at);
    for (uint32_t i = 0; i < cache->count; i++) {
        hg_sub3(at, cache->probes[i].position, d);
        nearest = fminf(nearest, hg_length3(d) / field->spacing);
    }
    if (nearest < LEAST_APART)
        return 0;
    return sees(field, probe) * fminf(nearest, 16 * LEAST_APART);
}

// Each where it suits best beside those before. Cost: probes of the field times those placed.
static enum hg_status place(struct hg_radiance_cache *cache, const struct hg_gi_field *field)
{
    const size_t texels = (size_t)FACES * cache->key.side * cache->key.side;
    while (cache->count < HG_CACHE_MOST_PROBES) {
        float best = 0;
        uint32_t chosen = 0;
        for (uint32_t i = 0; i < field->count; i++) {
            const float s = hg_gi_probe_is_awake(field, i) ? suits(cache, field, i) : 0;
            chosen = s > best ? i : chosen;
            best = fmaxf(best, s);
        }
        const uint64_t bytes = cache->stats.bytes + texels * sizeof(struct texel);
        if (!(best > 0))
            return HG_OK;
        if (cache->key.budget_bytes > 0 && bytes > cache->key.budget_bytes)
            return cache->count > 0 ? HG_OK : HG_E_LIMIT;
        struct probe *p = &cache->probes[cache->count];
        p->texels = hg_calloc(texels, sizeof *p->texels);
        if (!p->texels)
            return cache->count > 0 ? HG_OK : HG_E_NOMEM;
        hg_gi_probe_position(field, chosen, p->position);
        cache->count++;
        cache->stats.bytes = bytes;
    }
    return HG_OK;
}

enum hg_status hg_radiance_cache_sync(struct hg_radiance_cache *cache,
    const struct hg_cache_key *key, const struct hg_gi_field *field)
{
    struct grid grid = {.spacing = field->spacing};
    memcpy(grid.counts, field->counts, sizeof grid.counts);
    memcpy(grid.origin, field->origin, sizeof grid.origin);
    const bool is_new = cache->count == 0 || key->side != cache->key.side ||
                        memcmp(key->origin, cache->key.origin, sizeof key->origin) != 0 ||
                        memcmp(&grid, &cache->placed, sizeof grid) != 0;
    cache->light += cache->light == 0 || key->light != cache->key.light;
    cache->key = *key;
    if (!is_new)
        return HG_OK;
    clear(cache);
    cache->placed = grid;
    return place(cache, field);
}

// --- texels --------------------------------------------------------------------------------------

// Axis of a cube's face: 0 .. 5 for +x, -x, +y, ...
static int face_of(const float d[3], float *deep)
{
    const float a[3] = {fabsf(d[0]), fabsf(d[1]), fabsf(d[2])};
    const int axis = a[0] >= a[1] && a[0] >= a[2] ? 0 : a[1] >= a[2] ? 1 : 2;
    *deep = a[axis];
    return 2 * axis + (d[axis] < 0);
}

static uint32_t texel_of(const float d[3], int face, float deep, uint32_t side)
{
    const int axis = face / 2;
    const float scale = 0.5f * (float)side / deep, middle = 0.5f * (float)side;
    const float u = d[(axis + 1) % 3] * scale + middle, v = d[(axis + 2) % 3] * scale + middle;
    const uint32_t x = (uint32_t)hg_clampf(u, 0, (float)(side - 1));
    const uint32_t y = (uint32_t)hg_clampf(v, 0, (float)(side - 1));
    return ((uint32_t)face * side + y) * side + x;
}

static struct texel *at(const struct hg_radiance_cache *cache, struct hg_cache_place place)
{
    return &cache->probes[place.probe].texels[place.texel];
}

// --- lookup --------------------------------------------------------------------------------------

// The nearest probes, nearest first.
static uint32_t nearest(
    const struct hg_radiance_cache *cache, const float p[3], uint32_t out[TRIES])
{
    float best[TRIES];
    uint32_t count = 0;
    for (uint32_t i = 0; i < cache->count; i++) {
        float d[3];
        hg_sub3(p, cache->probes[i].position, d);
        const float d2 = hg_dot3(d, d);
        uint32_t k = count < TRIES ? count++ : TRIES;
        for (; k > 0 && best[k - 1] > d2; k--)
            if (k < TRIES) {
                best[k] = best[k - 1];
                out[k] = out[k - 1];
            }
        if (k < TRIES) {
            best[k] = d2;
            out[k] = i;
        }
    }
    return count;
}

static enum hg_cache_answer look(const struct hg_radiance_cache *cache, uint32_t probe,
    const struct hg_cache_query *q, struct hg_cache_place *place)
{
    const float side = (float)cache->key.side;
    float d[3], deep;
    hg_sub3(q->position, cache->probes[probe].position, d);
    const int face = face_of(d, &deep);
    if (!(deep > 0) ||
        hg_lobe_same_texel(q->roughness, &q->sample, deep, side, q->length) >= MOST_LIKELY)
        return HG_CACHE_NOTHING;
    *place = (struct hg_cache_place){probe, texel_of(d, face, deep, cache->key.side)};
    const struct texel *t = at(cache, *place);
    if ((t->state & FILLED) == 0)
        return HG_CACHE_EMPTY;
    const float slant = hg_length3(d) / deep, axis = face & 1 ? -1.0f : 1.0f;
    const float depth = axis * (t->position[face / 2] - cache->probes[probe].position[face / 2]);
    const bool other = fabsf(deep - depth) * slant >= DEPTH_BETA * deep / side ||
                       hg_dot3(q->normal, t->normal) < FACING_LEAST;
    if (other) // what was there when the light was another one may have moved
        return t->light != cache->light && t->light != 0 ? HG_CACHE_EMPTY : HG_CACHE_NOTHING;
    if (t->light == 0)
        return HG_CACHE_UNLIT;
    const bool fresh = t->light == cache->light && (t->state & LIT_MASK) >= cache->key.lit_enough;
    return fresh ? HG_CACHE_FOUND : HG_CACHE_STALE;
}

enum hg_cache_answer hg_radiance_cache_find(const struct hg_radiance_cache *cache,
    const struct hg_cache_query *query, struct hg_cache_place *place, float radiance[3])
{
    uint32_t probes[TRIES];
    const uint32_t count = nearest(cache, query->position, probes);
    struct hg_cache_place empty = {0};
    bool has_empty = false;
    for (uint32_t i = 0; i < count; i++) {
        const enum hg_cache_answer answer = look(cache, probes[i], query, place);
        if (answer == HG_CACHE_EMPTY && !has_empty) {
            empty = *place;
            has_empty = true;
        }
        if (answer <= HG_CACHE_EMPTY)
            continue;
        hg_copy3(at(cache, *place)->radiance, radiance);
        return answer;
    }
    *place = empty;
    return has_empty && !query->filled ? HG_CACHE_EMPTY : HG_CACHE_NOTHING;
}

// --- surfaces and light --------------------------------------------------------------------------

bool hg_radiance_cache_ask(struct hg_radiance_cache *cache, struct hg_cache_place place)
{
    struct texel *t = at(cache, place);
    const bool first = (t->state & ASKED) == 0;
    t->state |= ASKED;
    return first;
}

static uint32_t pack2(float a, float b)
{
    return (uint32_t)(hg_clampf(a, 0, 1) * 65535) | (uint32_t)(hg_clampf(b, 0, 1) * 65535) << 16;
}

void hg_radiance_cache_fill(
    struct hg_radiance_cache *cache, struct hg_cache_place place, const struct hg_gi_patch *surface)
{
    struct texel *t = at(cache, place);
    *t = (struct texel){.state = FILLED};
    hg_copy3(surface->position, t->position);
    hg_copy3(surface->normal, t->normal);
    t->albedo[0] = pack2(surface->albedo[0], surface->albedo[1]);
    t->albedo[1] = pack2(surface->albedo[2], 0);
    hg_copy3(surface->emission, t->emission);
    cache->stats.captured++;
}

void hg_radiance_cache_surface(
    const struct hg_radiance_cache *cache, struct hg_cache_place place, struct hg_gi_patch *out)
{
    const struct texel *t = at(cache, place);
    hg_copy3(t->position, out->position);
    hg_copy3(t->normal, out->normal);
    out->albedo[0] = (float)(t->albedo[0] & 0xffff) / 65535;
    out->albedo[1] = (float)(t->albedo[0] >> 16) / 65535;
    out->albedo[2] = (float)(t->albedo[1] & 0xffff) / 65535;
    hg_copy3(t->emission, out->emission);
}

void hg_radiance_cache_light(
    struct hg_radiance_cache *cache, struct hg_cache_place place, const float radiance[3])
{
    struct texel *t = at(cache, place);
    const uint32_t lit = t->light == cache->light ? t->state & LIT_MASK : 0;
    const float share = 1 / (float)(lit + 1);
    for (int c = 0; c < 3; c++)
        t->radiance[c] += (radiance[c] - t->radiance[c]) * share;
    t->state = FILLED | (lit < LIT_MOST ? lit + 1 : lit); // and its request is done
    t->light = cache->light;
    cache->stats.lit++;
}

void hg_radiance_cache_stats(
    const struct hg_radiance_cache *cache, struct hg_radiance_cache_stats *out)
{
    *out = cache ? cache->stats : (struct hg_radiance_cache_stats){0};
    out->probes = cache ? cache->count : 0;
    out->side = cache ? cache->key.side : 0;
}
