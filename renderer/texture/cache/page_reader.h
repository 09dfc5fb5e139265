// page_reader.h - threads that read pages from their sources.
// Floor 2 (texture). Push, pop and wait by one thread. At most `limit` reads exist at a time; their
// texels are the only memory they take.
#ifndef HG_RENDERER_TEXTURE_CACHE_PAGE_READER_H
#define HG_RENDERER_TEXTURE_CACHE_PAGE_READER_H

#include "renderer/texture/source/page_source.h"

struct hg_page_reader;

struct hg_page_read {
    struct hg_page_source *source;
    void *user;
    uint64_t key, stamp; // for the caller, as `user`
    uint32_t mip, x, y;
    // answer
    enum hg_status status; // of hg_page_source_read
    struct hg_error err;
    uint64_t ns;
    void *texels; // owned by the read
};

// HG_E_NOMEM.
enum hg_status hg_page_reader_create(
    unsigned threads, uint32_t limit, struct hg_page_reader **out) HG_MUST_CHECK;
// Waits for reads that run. Accepts NULL.
void hg_page_reader_destroy(struct hg_page_reader *reader);
// A read to fill in, NULL while `limit` reads are out.
struct hg_page_read *hg_page_reader_take(struct hg_page_reader *reader);
void hg_page_reader_push(struct hg_page_reader *reader, struct hg_page_read *read);
// A read that is done; give it back after use. Waits up to timeout_ns; NULL when there is none.
struct hg_page_read *hg_page_reader_pop(struct hg_page_reader *reader, uint64_t timeout_ns);
void hg_page_reader_give(struct hg_page_reader *reader, struct hg_page_read *read);
// Puts back what was popped: the next pop returns it.
void hg_page_reader_unpop(struct hg_page_reader *reader, struct hg_page_read *read);
// Reads that were pushed and not popped yet; taken and not given back.
uint32_t hg_page_reader_pending(const struct hg_page_reader *reader);
uint32_t hg_page_reader_out(const struct hg_page_reader *reader);

#endif
