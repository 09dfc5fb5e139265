#include "tests/fuzz/session_stream.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "tests/fuzz/session_messages.h"

enum { MAX_MESSAGES = 512, CAPACITY = 64 * 1024 };

// Messages of the corpus, each with its header; valid ones.
static struct fuzz_piece messages[MAX_MESSAGES];
static size_t message_count;

static void add_message(const uint8_t *data, size_t size)
{
    assert_true(message_count < MAX_MESSAGES);
    uint8_t *copy = malloc(size);
    assert_non_null(copy);
    memcpy(copy, data, size);
    messages[message_count++] = (struct fuzz_piece){copy, size};
}

static void add(enum hgp_type type, const void *message)
{
    struct hg_writer w = {0};
    struct hgp_fault fault = {0};
    if (hgp_encode(&w, 1, (struct hgp_envelope){type, 9, 0}, message, &fault))
        fail_msg("%s: %s", hgp_find((uint16_t)type)->name, fault.field);
    add_message(w.data, w.size);
    hg_writer_finish(&w);
}

static void add_messages(const uint8_t *data, size_t size)
{
    for (size_t at = HGP_PREFACE_BYTES; at < size;) {
        struct hgp_header h;
        assert_int_equal(hgp_header_decode(data + at, size - at, UINT32_MAX, &h), HG_OK);
        size_t total = HGP_HEADER_BYTES + (size_t)h.length;
        assert_true(total <= size - at);
        // The first two would end most sessions early, the third ends the daemon.
        if (h.type != HGP_T_hello && h.type != HGP_T_auth && h.type != HGP_T_drain_set)
            add_message(data + at, total);
        at += total;
    }
}

void session_stream_load(void)
{
    char folder[1024], path[1400];
    struct dirent **entries;
    snprintf(folder, sizeof folder, "%s/tests/fuzz/corpus/hgp_c2s", getenv("HELIO_SOURCE_DIR"));
    int count = scandir(folder, &entries, NULL, alphasort);
    assert_true(count > 10);
    for (int i = 0; i < count; i++) {
        uint8_t *data;
        size_t size;
        snprintf(path, sizeof path, "%s/%s", folder, entries[i]->d_name);
        // Streams without a preface are for workers.
        if (entries[i]->d_name[0] != '.' &&
            hg_file_read(path, CAPACITY, &data, &size, NULL) == HG_OK) {
            if (size > HGP_PREFACE_BYTES && memcmp(data, HGP_PREFACE, HGP_PREFACE_BYTES) == 0)
                add_messages(data, size);
            hg_free(data);
        }
        free(entries[i]);
    }
    free(entries);
    size_t from_corpus = message_count;
    for (int i = 0; i < 2; i++) // so that most of what is sent fits together
        session_messages(add);
    assert_true(from_corpus > 50 && message_count > from_corpus + 50);
}

void session_stream_free(void)
{
    for (size_t i = 0; i < message_count; i++)
        free((void *)messages[i].data);
    message_count = 0;
}

static bool is_drain(const uint8_t *message)
{
    struct hgp_header h;
    return hgp_header_decode(message, HGP_HEADER_BYTES, UINT32_MAX, &h) == HG_OK &&
           h.type == HGP_T_drain_set;
}

// Whether a message became one that drains the daemon: a bit makes one of others.
static bool drains(const uint8_t *data, size_t size, const struct fuzz_piece *in)
{
    return size >= HGP_HEADER_BYTES && is_drain(data) && !is_drain(in->data);
}

// One message of the corpus: as it is, with a damaged payload of the right length, or with damage
// anywhere, header included.
void session_stream_put(struct hg_writer *w, struct fuzz_random *random)
{
    uint8_t buffer[CAPACITY];
    const struct fuzz_piece *in = &messages[fuzz_below(random, message_count)];
    const struct fuzz_piece *other = &messages[fuzz_below(random, message_count)];
    size_t size = in->size, kind = fuzz_below(random, 12);
    memcpy(buffer, in->data, size);
    if (is_drain(in->data) || (kind == 0 && is_drain(other->data)))
        kind = 11; // damage could take away that the daemon stays
    if (kind == 0)
        size = fuzz_mutate(random, buffer, size, sizeof buffer, other);
    if (kind > 0 && kind < 4 && size > HGP_HEADER_BYTES) {
        size = HGP_HEADER_BYTES + fuzz_mutate(random, buffer + HGP_HEADER_BYTES,
                                      size - HGP_HEADER_BYTES, sizeof buffer - HGP_HEADER_BYTES,
                                      other);
        uint32_t length = (uint32_t)(size - HGP_HEADER_BYTES);
        for (size_t i = 0; i < 4; i++)
            buffer[i] = (uint8_t)(length >> (8 * i));
    }
    if (!drains(buffer, size, in))
        hg_write_bytes(w, buffer, size);
}
