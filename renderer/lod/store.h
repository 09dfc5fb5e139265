// store.h - cluster files in the store: baked once, then read chunk by chunk.
// Floor 2 (geometry). Any thread.
//
// An entry is of the kind "clusters" and has the key of hg_lod_key. Block 0 is the file up to its
// first chunk, block 1 + i the encoded bytes of chunk i.
#ifndef HG_RENDERER_LOD_STORE_H
#define HG_RENDERER_LOD_STORE_H

#include "renderer/lod/lod.h"
#include "base/store/store.h"

// An open entry. Zeroed = none; hg_lod_stored_close frees it.
struct hg_lod_stored {
    struct hg_store_entry *entry;
    struct hg_lod *lod; // its `data` ends before the first chunk
    uint8_t *head;
};

// The key of a part's entry. HG_E_NOMEM.
enum hg_status hg_lod_stored_key(const struct hg_mesh_part *part,
    const struct hg_lod_params *params, struct hg_store_key *out) HG_MUST_CHECK;

// HG_E_NOTFOUND (absent or damaged), HG_E_NOMEM.
enum hg_status hg_lod_stored_find(struct hg_store *store, const struct hg_store_key *key,
    struct hg_lod_stored *out, struct hg_error *err) HG_MUST_CHECK;
void hg_lod_stored_close(struct hg_lod_stored *stored); // accepts a zeroed one
// Encoded bytes of a chunk (lod->chunks[chunk].bytes of them), for hg_lod_decode. Thread-safe.
// HG_E_HASH: damaged, the entry is gone; bake it again.
enum hg_status hg_lod_stored_read(const struct hg_lod_stored *stored, uint32_t chunk, void *dst,
    struct hg_error *err) HG_MUST_CHECK;

// Writes a baked file; `name` (may be NULL) says in the cache what it is. HG_E_BUSY (another writer
// is at it), statuses of hg_store_write.
enum hg_status hg_lod_stored_write(struct hg_store *store, const struct hg_store_key *key,
    const char *name, const uint8_t *data, size_t size, struct hg_error *err) HG_MUST_CHECK;

#endif
