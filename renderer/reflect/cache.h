// cache.h - a radiance cache of a scene: cube maps with a G-buffer, lit where rays ask.
// Floor 2 (reflect). Thread: the render thread; lookups from any.
//
// A texel holds a surface that lies there from its probe, and the radiance that this sends back.
// It is the one that the first reflection met who asks for the texel, is lit then, and lit again
// when the light is another one. Probes are not prefiltered. Two tests keep a texel from what it
// does not show: whether it is as fine as the lobe asks for, and whether its surface is the one
// that was hit. Source: Hirvonen et al. 2019, "Accurate Real-Time Specular Reflections with
// Radiance Caching".
#ifndef HG_RENDERER_REFLECT_CACHE_H
#define HG_RENDERER_REFLECT_CACHE_H

#include "renderer/gi/field.h"
#include "renderer/gi/patches.h"
#include "renderer/host_shading/lobe.h"

#define HG_CACHE_MOST_PROBES 16
#define HG_CACHE_SIDE        32 // texels along a face, unless another number is asked for

struct hg_radiance_cache; // of one scene

enum hg_status hg_radiance_cache_create(struct hg_radiance_cache **out) HG_MUST_CHECK; // HG_E_NOMEM
void hg_radiance_cache_destroy(struct hg_radiance_cache *cache); // accepts NULL

// What the cache is of.
struct hg_cache_key {
    uint64_t light;        // differs: texels are lit again
    double origin[3];      // of the geometry; a change empties the cache
    uint32_t side;         // texels along a face; a change empties the cache
    uint32_t lit_enough;   // times that a texel is lit until its mean is good: light that is chosen
                           // by chance, like that of one among many lamps
    uint64_t budget_bytes; // 0 = unlimited
};
// Places probes where the field's see farthest, away from each other. HG_E_LIMIT, HG_E_NOMEM: the
// cache is empty.
enum hg_status hg_radiance_cache_sync(struct hg_radiance_cache *cache,
    const struct hg_cache_key *key, const struct hg_gi_field *field) HG_MUST_CHECK;

// A place in it.
struct hg_cache_place {
    uint32_t probe, texel;
};
enum hg_cache_answer {
    HG_CACHE_NOTHING, // no probe has it
    HG_CACHE_EMPTY,   // not requested yet, or it shows what has moved
    HG_CACHE_UNLIT,   // shows the surface, and was never lit
    HG_CACHE_STALE,   // lit by the light of before, or too seldom
    HG_CACHE_FOUND,
};
// What a ray met.
struct hg_cache_query {
    float position[3], normal[3];
    float roughness, length; // of the surface that mirrors; of the ray
    struct hg_lobe_sample sample;
    bool filled; // places that are empty do not count
};
// radiance: of STALE and FOUND. place: of all but NOTHING.
enum hg_cache_answer hg_radiance_cache_find(const struct hg_radiance_cache *cache,
    const struct hg_cache_query *query, struct hg_cache_place *place, float radiance[3]);

// True for the first who asks for a place since it was captured or lit last.
bool hg_radiance_cache_ask(struct hg_radiance_cache *cache, struct hg_cache_place place);
// A place without light from now on shows this surface.
void hg_radiance_cache_fill(struct hg_radiance_cache *cache, struct hg_cache_place place,
    const struct hg_gi_patch *surface);
// What a place shows.
void hg_radiance_cache_surface(
    const struct hg_radiance_cache *cache, struct hg_cache_place place, struct hg_gi_patch *out);
void hg_radiance_cache_light(
    struct hg_radiance_cache *cache, struct hg_cache_place place, const float radiance[3]);

struct hg_radiance_cache_stats {
    uint32_t probes, side;
    uint64_t captured, lit; // texels, since creation
    uint64_t bytes;
};
void hg_radiance_cache_stats(
    const struct hg_radiance_cache *cache, struct hg_radiance_cache_stats *out); // NULL: zeroed

#endif
