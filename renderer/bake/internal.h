// internal.h - the halves of bake.c. Private to renderer/bake.
#ifndef HG_RENDERER_BAKE_INTERNAL_H
#define HG_RENDERER_BAKE_INTERNAL_H

#include "base/bytes.h"
#include "renderer/bake/bake.h"
#include "base/store/store.h"

// False when the caller wants to stop.
bool hg_bake_tell(const struct hg_bake *bake, const char *stage, uint64_t done, uint64_t total);

// Entries of the scene, found or made.
struct hg_bake_entries {
    struct hg_store_key *keys; // freed with hg_free
    size_t count, capacity;
};

enum hg_status hg_bake_note(struct hg_bake_entries *entries, const struct hg_store_key *key,
    struct hg_error *err) HG_MUST_CHECK;

// Each appends one member of the report, and notes its entries.
enum hg_status hg_bake_textures(const struct hg_bake *bake, struct hg_store *store,
    struct hg_bake_entries *entries, struct hg_writer *report, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_bake_geometry(const struct hg_bake *bake, struct hg_store *store,
    struct hg_bake_entries *entries, struct hg_writer *report, struct hg_error *err) HG_MUST_CHECK;

#endif
