// Streams cut at every place give the messages that were put in, and nothing of what is damaged.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "protocol/framing.h"

enum { LIMIT = 4 << 20 };

// Messages that count how many of them live.
struct message {
    struct hgp_header header;
    uint8_t payload[];
};

static int living;

static void *create(const struct hgp_header *header)
{
    // Exactly as large as announced, so that a write behind it is seen.
    struct message *m = hg_realloc(NULL, sizeof *m + header->length, 1);
    if (!m)
        return NULL;
    m->header = *header;
    living++;
    return m;
}

static uint8_t *payload(void *message)
{
    return ((struct message *)message)->payload;
}

static void destroy(void *message)
{
    living--;
    hg_free(message);
}

static const struct hgp_frame_class frames = {create, payload, destroy};

// ---- a stream to read
// ----------------------------------------------------------------------------

static uint8_t byte_of(uint32_t message, uint32_t at)
{
    return (uint8_t)(message * 31 + at * 7 + (at >> 8));
}

static void put_message(struct hg_writer *w, uint32_t number, uint32_t length)
{
    uint8_t head[HGP_HEADER_BYTES];
    hgp_header_encode(&(struct hgp_header){.length = length,
                          .type = (uint16_t)(number * 3),
                          .flags = number % 2 ? HGP_FLAG_OPTIONAL : 0,
                          .request = number,
                          .channel = ~number},
        head);
    hg_write_bytes(w, head, sizeof head);
    for (uint32_t i = 0; i < length; i++)
        hg_write_bytes(w, &(uint8_t){byte_of(number, i)}, 1);
}

static void make_stream(struct hg_writer *w, const uint32_t *lengths, uint32_t count)
{
    *w = (struct hg_writer){0};
    hg_write_bytes(w, HGP_PREFACE, HGP_PREFACE_BYTES);
    for (uint32_t i = 0; i < count; i++)
        put_message(w, i, lengths[i]);
    assert_false(w->failed);
}

// ---- a reader
// ------------------------------------------------------------------------------------

struct reader {
    struct hgp_framer framer;
    const uint32_t *lengths;
    uint32_t count, received;
    bool prefaced;
};

static void take_all(struct reader *r)
{
    void *message;
    if (!r->prefaced) {
        const uint8_t *preface = hgp_framer_take(&r->framer, HGP_PREFACE_BYTES);
        if (!preface)
            return;
        assert_memory_equal(preface, HGP_PREFACE, HGP_PREFACE_BYTES);
        r->prefaced = true;
    }
    enum hg_status status;
    while ((status = hgp_framer_next(&r->framer, LIMIT, &message)) == HG_OK) {
        const struct message *m = message;
        assert_true(r->received < r->count);
        assert_int_equal(m->header.length, r->lengths[r->received]);
        assert_int_equal(m->header.type, r->received * 3);
        assert_int_equal(m->header.flags, r->received % 2);
        assert_int_equal(m->header.request, r->received);
        assert_int_equal(m->header.channel, ~r->received);
        for (uint32_t i = 0; i < m->header.length; i++)
            if (m->payload[i] != byte_of(r->received, i))
                fail_msg("message %u differs at byte %u", r->received, i);
        r->received++;
        destroy(message);
    }
    assert_int_equal(status, HG_E_AGAIN);
    assert_null(message);
}

// Hands over `size` bytes as a socket would: at most what the framer has room for.
static void feed(struct reader *r, const uint8_t *data, size_t size)
{
    while (size) {
        size_t room;
        uint8_t *dst = hgp_framer_space(&r->framer, &room);
        assert_non_null(dst);
        assert_true(room > 0 && room <= HGP_FRAMER_READ_BYTES);
        size_t step = size < room ? size : room;
        memcpy(dst, data, step);
        hgp_framer_fill(&r->framer, step);
        take_all(r);
        data += step;
        size -= step;
    }
}

static struct reader make_reader(const uint32_t *lengths, uint32_t count)
{
    return (struct reader){.framer = {.frames = &frames}, .lengths = lengths, .count = count};
}

static void finish_reader(struct reader *r, size_t bytes)
{
    assert_true(r->framer.total_bytes == bytes);
    hgp_framer_finish(&r->framer);
    assert_int_equal(living, 0);
}

// ---- tests
// ---------------------------------------------------------------------------------------

static const uint32_t small[] = {0, 1, 0, 15, 16, 17, 40, 3};
enum { SMALL = sizeof small / sizeof *small };

static uint32_t whole_messages(size_t bytes)
{
    size_t end = HGP_PREFACE_BYTES;
    uint32_t n = 0;
    for (; n < SMALL && end + HGP_HEADER_BYTES + small[n] <= bytes; n++)
        end += HGP_HEADER_BYTES + small[n];
    return bytes < HGP_PREFACE_BYTES ? 0 : n;
}

static void test_every_prefix_and_split(void **state)
{
    (void)state;
    struct hg_writer w;
    make_stream(&w, small, SMALL);
    for (size_t prefix = 0; prefix <= w.size; prefix++)
        for (size_t split = 0; split <= prefix; split++) {
            struct reader r = make_reader(small, SMALL);
            feed(&r, w.data, split);
            assert_int_equal(r.received, whole_messages(split));
            feed(&r, w.data + split, prefix - split);
            assert_int_equal(r.received, whole_messages(prefix));
            if (prefix == w.size)
                assert_true(hgp_framer_is_empty(&r.framer));
            finish_reader(&r, prefix);
        }
    hg_writer_finish(&w);
}

static void test_every_step(void **state)
{
    (void)state;
    struct hg_writer w;
    make_stream(&w, small, SMALL);
    for (size_t step = 1; step <= w.size; step++) {
        struct reader r = make_reader(small, SMALL);
        for (size_t at = 0; at < w.size; at += step)
            feed(&r, w.data + at, w.size - at < step ? w.size - at : step);
        assert_int_equal(r.received, SMALL);
        finish_reader(&r, w.size);
    }
    hg_writer_finish(&w);
}

// Payloads around the sizes at which the way of reading changes.
static void test_large_payloads(void **state)
{
    (void)state;
    static const uint32_t lengths[] = {5, HGP_FRAMER_CHUNK_BYTES - HGP_HEADER_BYTES - 1,
        HGP_FRAMER_CHUNK_BYTES - HGP_HEADER_BYTES, HGP_FRAMER_CHUNK_BYTES - 1, 0,
        HGP_FRAMER_CHUNK_BYTES, HGP_FRAMER_DIRECT_BYTES - 1, HGP_FRAMER_DIRECT_BYTES,
        HGP_FRAMER_DIRECT_BYTES + 1, 2 * HGP_FRAMER_READ_BYTES + 3, 1, LIMIT};
    static const size_t steps[] = {997, 4096, HGP_FRAMER_DIRECT_BYTES, HGP_FRAMER_CHUNK_BYTES,
        HGP_FRAMER_CHUNK_BYTES + 1, 3 * HGP_FRAMER_READ_BYTES};
    enum { COUNT = sizeof lengths / sizeof *lengths };
    struct hg_writer w;
    make_stream(&w, lengths, COUNT);
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        struct reader r = make_reader(lengths, COUNT);
        for (size_t at = 0; at < w.size; at += steps[i])
            feed(&r, w.data + at, w.size - at < steps[i] ? w.size - at : steps[i]);
        assert_int_equal(r.received, COUNT);
        assert_true(hgp_framer_is_empty(&r.framer));
        finish_reader(&r, w.size);
    }
    hg_writer_finish(&w);
}

// A chunk that another stream leaves behind: full of whole messages, from its first byte on.
static void leave_full_chunk(struct hgp_chunk_pool *pool)
{
    struct hgp_framer f = {.frames = &frames, .pool = pool};
    size_t room;
    uint8_t *dst = hgp_framer_space(&f, &room);
    assert_non_null(dst);
    assert_int_equal(room, HGP_FRAMER_CHUNK_BYTES);
    for (size_t at = 0; at + HGP_HEADER_BYTES <= room; at += HGP_HEADER_BYTES)
        hgp_header_encode(&(struct hgp_header){.type = 999, .request = 999}, dst + at);
    hgp_framer_fill(&f, room);
    hgp_framer_finish(&f);
    assert_int_equal(pool->count, 1);
}

// What another stream has left is never taken for this one's: at no prefix is there a message, or a
// byte of one, more than came.
static void test_reused_chunks(void **state)
{
    (void)state;
    struct hgp_chunk_pool pool = {0};
    struct hg_writer w;
    make_stream(&w, small, SMALL);
    for (size_t prefix = 0; prefix <= w.size; prefix++)
        for (size_t split = 0; split <= prefix; split++) {
            leave_full_chunk(&pool);
            struct reader r = make_reader(small, SMALL);
            r.framer.pool = &pool;
            feed(&r, w.data, split);
            feed(&r, w.data + split, prefix - split);
            assert_int_equal(r.received, whole_messages(prefix));
            assert_int_equal(pool.count, prefix ? 0 : 1);
            finish_reader(&r, prefix);
        }
    hgp_chunk_pool_finish(&pool);
    hg_writer_finish(&w);
}

// A pool has a bound, and an idle one gives everything back.
static void test_pool_is_bounded(void **state)
{
    (void)state;
    enum { STREAMS = HGP_FRAMER_POOL_CHUNKS + 3 };
    struct hgp_chunk_pool pool = {0};
    struct hgp_framer f[STREAMS];
    size_t room;
    for (int i = 0; i < STREAMS; i++) {
        f[i] = (struct hgp_framer){.frames = &frames, .pool = &pool};
        assert_non_null(hgp_framer_space(&f[i], &room));
    }
    for (int i = 0; i < STREAMS; i++)
        assert_true(hgp_framer_rest(&f[i]));
    assert_int_equal(pool.count, HGP_FRAMER_POOL_CHUNKS);
    hgp_chunk_pool_trim(&pool);
    assert_int_equal(pool.count, HGP_FRAMER_POOL_CHUNKS);
    hg_alloc_fail_at(1); // what the pool has takes no memory
    for (int i = 0; i < HGP_FRAMER_POOL_CHUNKS; i++)
        assert_non_null(hgp_framer_space(&f[i], &room));
    hg_alloc_fail_at(0);
    for (int i = 0; i < STREAMS; i++)
        hgp_framer_finish(&f[i]);
    hgp_chunk_pool_trim(&pool); // all of them were needed since the last time
    assert_int_equal(pool.count, HGP_FRAMER_POOL_CHUNKS);
    for (int i = 0; i < HGP_FRAMER_POOL_CHUNKS; i++)
        hgp_chunk_pool_trim(&pool);
    assert_int_equal(pool.count, 0);
    hgp_chunk_pool_finish(&pool);
}

static void put_header(struct hgp_framer *f, uint32_t length, uint16_t flags)
{
    size_t room;
    uint8_t *dst = hgp_framer_space(f, &room);
    assert_non_null(dst);
    assert_true(room >= HGP_HEADER_BYTES);
    hgp_header_encode(&(struct hgp_header){.length = length, .flags = flags}, dst);
    hgp_framer_fill(f, HGP_HEADER_BYTES);
}

// With the header alone, before there is memory for the payload.
static void test_refusals(void **state)
{
    (void)state;
    void *message = &living;
    struct hgp_framer f = {.frames = &frames};
    put_header(&f, 100, 0);
    assert_int_equal(hgp_framer_next(&f, 99, &message), HG_E_LIMIT);
    assert_null(message);
    assert_int_equal(hgp_framer_next(&f, 100, &message), HG_E_AGAIN); // the limit may have changed
    assert_int_equal(living, 1);
    assert_false(hgp_framer_is_empty(&f));
    hgp_framer_finish(&f);
    assert_int_equal(living, 0);
    put_header(&f, 0, 2);
    assert_int_equal(hgp_framer_next(&f, LIMIT, &message), HG_E_FORMAT);
    hgp_framer_finish(&f);
}

static void test_no_memory(void **state)
{
    (void)state;
    struct hgp_framer f = {.frames = &frames};
    size_t room;
    void *message;
    hg_alloc_fail_at(1);
    assert_null(hgp_framer_space(&f, &room));
    assert_int_equal(room, 0);
    hg_alloc_fail_at(0);
    put_header(&f, 8, 0);
    hg_alloc_fail_at(1);
    assert_int_equal(hgp_framer_next(&f, LIMIT, &message), HG_E_NOMEM);
    assert_null(message);
    hg_alloc_fail_at(0);
    hgp_framer_finish(&f);
    assert_int_equal(living, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_prefix_and_split),
        cmocka_unit_test(test_every_step),
        cmocka_unit_test(test_large_payloads),
        cmocka_unit_test(test_reused_chunks),
        cmocka_unit_test(test_pool_is_bounded),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_no_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
