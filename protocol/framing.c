#include "protocol/framing.h"

#include <string.h>

#include "base/alloc.h"

#if defined(__SANITIZE_ADDRESS__) // chunks in a pool may not be read
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(addr, size)   ((void)(addr))
#define ASAN_UNPOISON_MEMORY_REGION(addr, size) ((void)(addr))
#endif

// A chunk from the pool holds what an earlier stream, perhaps another tenant's, has received. No
// stream gets to see that: whatever is read of a chunk (hgp_framer_take, begin_message,
// hgp_framer_peek, the copy in hgp_framer_next, and hg_packet_save_input of the broker) lies
// between start and end, these begin at 0 with each chunk, and end moves only by what the transport
// has written there (hgp_framer_fill). So a chunk need not be cleared; tests/wire/test_framing.c
// gives streams chunks that are full of another one's messages.
static uint8_t *take_chunk(struct hgp_chunk_pool *pool)
{
    if (!pool || !pool->count)
        return hg_pages_calloc(HGP_FRAMER_CHUNK_BYTES);
    uint8_t *chunk = pool->chunks[--pool->count];
    if (pool->unused > pool->count)
        pool->unused = pool->count;
    ASAN_UNPOISON_MEMORY_REGION(chunk, HGP_FRAMER_CHUNK_BYTES);
    return chunk;
}

static void give_chunk(struct hgp_chunk_pool *pool, uint8_t *chunk)
{
    if (!chunk || !pool || pool->count == HGP_FRAMER_POOL_CHUNKS) {
        hg_pages_free(chunk, HGP_FRAMER_CHUNK_BYTES);
        return;
    }
    ASAN_POISON_MEMORY_REGION(chunk, HGP_FRAMER_CHUNK_BYTES);
    pool->chunks[pool->count++] = chunk;
}

void hgp_chunk_pool_trim(struct hgp_chunk_pool *pool)
{
    if (pool->unused)
        hg_pages_free(pool->chunks[--pool->count], HGP_FRAMER_CHUNK_BYTES);
    pool->unused = pool->count;
}

void hgp_chunk_pool_finish(struct hgp_chunk_pool *pool)
{
    while (pool->count)
        hg_pages_free(pool->chunks[--pool->count], HGP_FRAMER_CHUNK_BYTES);
    pool->unused = 0;
}

uint8_t *hgp_framer_space(struct hgp_framer *f, size_t *size)
{
    *size = 0;
    size_t missing = f->partial ? f->length - f->filled : 0;
    if (missing >= HGP_FRAMER_DIRECT_BYTES && f->start == f->end) {
        *size = missing < HGP_FRAMER_READ_BYTES ? missing : HGP_FRAMER_READ_BYTES;
        return f->frames->payload(f->partial) + f->filled;
    }
    if (!f->chunk && !(f->chunk = take_chunk(f->pool)))
        return NULL;
    if (f->start) { // what is left is a part of a header, unless messages wait to be taken
        memmove(f->chunk, f->chunk + f->start, f->end - f->start);
        f->end -= f->start;
        f->start = 0;
    }
    *size = HGP_FRAMER_CHUNK_BYTES - f->end;
    return f->chunk + f->end;
}

void hgp_framer_fill(struct hgp_framer *f, size_t size)
{
    size_t missing = f->partial ? f->length - f->filled : 0;
    if (missing >= HGP_FRAMER_DIRECT_BYTES && f->start == f->end)
        f->filled += size;
    else
        f->end += size;
    f->total_bytes += size;
}

const uint8_t *hgp_framer_take(struct hgp_framer *f, size_t size)
{
    if (f->end - f->start < size)
        return NULL;
    const uint8_t *data = f->chunk + f->start;
    f->start += size;
    return data;
}

static enum hg_status begin_message(struct hgp_framer *f, uint32_t limit)
{
    struct hgp_header header;
    if (f->end - f->start < HGP_HEADER_BYTES)
        return HG_E_AGAIN;
    enum hg_status status =
        hgp_header_decode(f->chunk + f->start, f->end - f->start, limit, &header);
    if (status)
        return status;
    f->partial = f->frames->create(&header);
    if (!f->partial)
        return HG_E_NOMEM;
    f->start += HGP_HEADER_BYTES;
    f->type = header.type;
    f->length = header.length;
    f->filled = 0;
    return HG_OK;
}

enum hg_status hgp_framer_next(struct hgp_framer *f, uint32_t limit, void **message)
{
    *message = NULL;
    enum hg_status status = f->partial ? HG_OK : begin_message(f, limit);
    if (status)
        return status;
    size_t missing = f->length - f->filled, here = f->end - f->start;
    size_t step = here < missing ? here : missing;
    if (step)
        memcpy(f->frames->payload(f->partial) + f->filled, f->chunk + f->start, step);
    f->start += step;
    f->filled += step;
    if (f->filled < f->length)
        return HG_E_AGAIN;
    *message = f->partial;
    f->partial = NULL;
    return HG_OK;
}

bool hgp_framer_peek(const struct hgp_framer *f, uint16_t *type)
{
    struct hgp_header header;
    *type = f->type;
    if (f->partial)
        return true;
    if (!f->chunk || hgp_header_decode(f->chunk + f->start, f->end - f->start, UINT32_MAX, &header))
        return false;
    *type = header.type;
    return true;
}

bool hgp_framer_is_empty(const struct hgp_framer *f)
{
    return !f->partial && f->start == f->end;
}

bool hgp_framer_rest(struct hgp_framer *f)
{
    if (!f->chunk || !hgp_framer_is_empty(f))
        return false;
    give_chunk(f->pool, f->chunk);
    f->chunk = NULL;
    f->start = f->end = 0;
    return true;
}

void hgp_framer_finish(struct hgp_framer *f)
{
    give_chunk(f->pool, f->chunk);
    if (f->partial)
        f->frames->destroy(f->partial);
    *f = (struct hgp_framer){.frames = f->frames, .pool = f->pool};
}
