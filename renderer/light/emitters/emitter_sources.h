// emitter_sources.h - emissive parts, their power, and their leaves of the light tree.
// Private to the emitters. Floor 2 (light). Thread: the render thread.
#ifndef HG_RENDERER_LIGHT_EMITTERS_EMITTER_SOURCES_H
#define HG_RENDERER_LIGHT_EMITTERS_EMITTER_SOURCES_H

#include "renderer/light/emitters/emitters.h"
#include "renderer/light/emitters/emissive_mips.h"

#define HG_EMITTER_MOST_SHIFT 8 // 256 triangles per leaf

// An emissive part.
struct hg_emitter_source {
    const struct hg_emitter_part *part;
    const struct hg_emissive_mips *glow; // NULL: no texture
    uint32_t glow_index;                 // in `glows`, UINT32_MAX: none
    float luminance;                     // of the factor
    uint32_t first_leaf, leaf_count;     // of hg_emitter_sources_plan
    uint32_t first_weight;               // likewise
};

// An emissive texture, by content.
struct hg_emitter_glow {
    uint64_t texture, revision;
    enum hg_texture_use use;
    struct hg_emissive_mips glow;
    bool used;
};

// Zero-initialise.
struct hg_emitter_sources {
    struct hg_emitter_source *items; // by draw, then primitive
    size_t capacity;
    uint32_t count;
    uint64_t triangles; // of all of them
    struct hg_emitter_glow *glows;
    size_t glow_capacity;
    uint32_t glow_count;
};

// Leaves hold runs of 1 << shift consecutive triangles.
struct hg_emitter_plan {
    uint32_t shift, leaf_count;
    uint32_t weight_count; // a u16 per triangle where a leaf has several, else none
    uint64_t left_out;     // triangles
};

// Hashes the emissive parts into *signature. Parts are borrowed until the next call. HG_E_NOMEM.
enum hg_status hg_emitter_sources_collect(struct hg_emitter_sources *sources,
    const struct hg_emitter_input *input, uint64_t *signature) HG_MUST_CHECK;
void hg_emitter_sources_finish(struct hg_emitter_sources *sources); // accepts zeroed ones
// Chooses the shortest runs that fit that many bytes, and assigns leaves to sources; sources that
// still do not fit are dropped.
//   leaf_bytes   of the tables, per leaf
struct hg_emitter_plan hg_emitter_sources_plan(
    struct hg_emitter_sources *sources, uint64_t room_bytes, uint64_t leaf_bytes);

#endif
