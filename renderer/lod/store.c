#include "renderer/lod/store.h"

#include <string.h>

#include "base/alloc.h"

enum hg_status hg_lod_stored_key(
    const struct hg_mesh_part *part, const struct hg_lod_params *params, struct hg_store_key *out)
{
    uint8_t key[HG_SHA256_BYTES];
    memset(out, 0, sizeof *out);
    const enum hg_status status = hg_lod_key(part, params, key);
    return status == HG_OK ? hg_store_key("clusters", HG_LOD_VERSION, key, sizeof key, out)
                           : status;
}

void hg_lod_stored_close(struct hg_lod_stored *stored)
{
    hg_lod_close(stored->lod);
    hg_store_entry_close(stored->entry);
    hg_free(stored->head);
    *stored = (struct hg_lod_stored){0};
}

// Blocks that do not belong together cannot come from one writer, but a cache is not trusted.
static enum hg_status check_blocks(const struct hg_lod_stored *s)
{
    const struct hg_lod *lod = s->lod;
    if (hg_store_entry_blocks(s->entry) < lod->chunk_count + 1)
        return HG_E_NOTFOUND;
    for (uint32_t i = 0; i < lod->chunk_count; i++) {
        if (hg_store_entry_size(s->entry, i + 1) != lod->chunks[i].bytes)
            return HG_E_NOTFOUND;
    }
    return HG_OK;
}

enum hg_status hg_lod_stored_find(struct hg_store *store, const struct hg_store_key *key,
    struct hg_lod_stored *out, struct hg_error *err)
{
    *out = (struct hg_lod_stored){0};
    struct hg_lod_stored s = {0};
    enum hg_status status = hg_store_find(store, key, &s.entry, err);
    if (status != HG_OK)
        return status;
    const size_t size = hg_store_entry_size(s.entry, 0);
    s.head = hg_calloc(size, 1);
    if (s.head == NULL)
        status = hg_error_set(err, HG_E_NOMEM, "cluster file", NULL, "no memory");
    if (status == HG_OK)
        status = hg_store_entry_read(s.entry, 0, s.head, size, err);
    if (status == HG_OK)
        status = hg_lod_open_head(s.head, size, &s.lod, err);
    if (status == HG_OK)
        status = check_blocks(&s);
    if (status == HG_OK) {
        *out = s;
        return HG_OK;
    }
    hg_lod_stored_close(&s);
    return status == HG_E_NOMEM
               ? status
               : hg_error_set(err, HG_E_NOTFOUND, "cluster file", NULL, "the entry is damaged");
}

enum hg_status hg_lod_stored_read(
    const struct hg_lod_stored *stored, uint32_t chunk, void *dst, struct hg_error *err)
{
    return hg_store_entry_read(
        stored->entry, chunk + 1, dst, stored->lod->chunks[chunk].bytes, err);
}

enum hg_status hg_lod_stored_write(struct hg_store *store, const struct hg_store_key *key,
    const char *name, const uint8_t *data, size_t size, struct hg_error *err)
{
    struct hg_lod *lod;
    struct hg_store_writer *writer;
    enum hg_status status = hg_lod_open(data, size, &lod, err);
    if (status != HG_OK)
        return status;
    status = hg_store_begin(store, key, &writer, err);
    if (status != HG_OK) {
        hg_lod_close(lod);
        return status;
    }
    hg_store_label(writer, "mesh %s: %llu triangles", name != NULL ? name : "",
        (unsigned long long)lod->source_triangles);
    const uint64_t head = lod->chunk_count > 0 ? lod->chunks[0].offset : size;
    status = hg_store_write(writer, 0, data, (size_t)head, err);
    for (uint32_t i = 0; i < lod->chunk_count && status == HG_OK; i++) {
        const struct hg_lod_chunk *c = &lod->chunks[i];
        status = hg_store_write(writer, i + 1, data + c->offset, c->bytes, err);
    }
    hg_lod_close(lod);
    if (status == HG_OK)
        return hg_store_commit(writer, err);
    hg_store_abort(writer);
    return status;
}
