// page_reader.c - see page_reader.h.
#include "renderer/texture/cache/page_reader.h"

#include <pthread.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/queue.h"

#define MAX_THREADS 32

struct hg_page_reader {
    struct hg_queue work, done;
    struct hg_page_read *reads;
    struct hg_page_read **spare;   // a stack
    struct hg_page_read *returned; // by unpop
    uint32_t limit, spare_count, pending;
    unsigned thread_count;
    pthread_t threads[MAX_THREADS];
};

static void *thread_main(void *user)
{
    struct hg_page_reader *reader = user;
    for (struct hg_page_read *read; (read = hg_queue_pop(&reader->work, UINT64_MAX)) != NULL;) {
        const uint64_t start = hg_clock_now_ns();
        read->err = (struct hg_error){0};
        read->status = hg_page_source_read(
            read->source, read->mip, read->x, read->y, read->texels, &read->err);
        read->ns = hg_clock_now_ns() - start;
        if (hg_queue_push(&reader->done, read) != HG_OK)
            break; // never full: it holds as many as there are
    }
    return NULL;
}

static enum hg_status init(struct hg_page_reader *reader, unsigned threads)
{
    enum hg_status status = hg_queue_init(&reader->work, reader->limit);
    if (status == HG_OK)
        status = hg_queue_init(&reader->done, reader->limit);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < reader->limit; i++)
        reader->spare[reader->spare_count++] = &reader->reads[reader->limit - 1 - i];
    for (unsigned i = 0; i < threads && i < MAX_THREADS; i++) {
        if (pthread_create(&reader->threads[i], NULL, thread_main, reader) != 0)
            break;
        reader->thread_count++;
    }
    return reader->thread_count > 0 ? HG_OK : HG_E_NOMEM;
}

enum hg_status hg_page_reader_create(unsigned threads, uint32_t limit, struct hg_page_reader **out)
{
    *out = NULL;
    struct hg_page_reader *reader = hg_calloc(1, sizeof *reader);
    if (reader == NULL)
        return HG_E_NOMEM;
    reader->limit = limit;
    reader->reads = hg_calloc(limit, sizeof *reader->reads);
    reader->spare = hg_calloc(limit, sizeof *reader->spare);
    enum hg_status status = HG_E_NOMEM;
    if (reader->reads != NULL && reader->spare != NULL)
        status = init(reader, threads);
    if (status != HG_OK) {
        hg_page_reader_destroy(reader);
        return status;
    }
    *out = reader;
    return HG_OK;
}

void hg_page_reader_destroy(struct hg_page_reader *reader)
{
    if (reader == NULL)
        return;
    while (reader->work.items != NULL && hg_queue_try_pop(&reader->work) != NULL)
        continue;
    if (reader->work.items != NULL)
        hg_queue_close(&reader->work);
    for (unsigned i = 0; i < reader->thread_count; i++)
        pthread_join(reader->threads[i], NULL);
    while (reader->done.items != NULL && hg_queue_try_pop(&reader->done) != NULL)
        continue;
    hg_queue_finish(&reader->work);
    hg_queue_finish(&reader->done);
    for (uint32_t i = 0; reader->reads != NULL && i < reader->limit; i++)
        hg_free(reader->reads[i].texels);
    hg_free(reader->reads);
    hg_free(reader->spare);
    hg_free(reader);
}

// The largest texels there are; memory of reads that are not in use stays small on the whole.
static bool has_texels(struct hg_page_read *read)
{
    if (read->texels == NULL)
        read->texels = hg_calloc((size_t)HG_PAGE_PITCH * HG_PAGE_PITCH, 8);
    return read->texels != NULL;
}

struct hg_page_read *hg_page_reader_take(struct hg_page_reader *reader)
{
    if (reader->spare_count == 0 || !has_texels(reader->spare[reader->spare_count - 1]))
        return NULL;
    return reader->spare[--reader->spare_count];
}

void hg_page_reader_push(struct hg_page_reader *reader, struct hg_page_read *read)
{
    reader->pending++;
    if (hg_queue_push(&reader->work, read) != HG_OK) {
        reader->pending--; // never: the queue holds as many as there are
        hg_page_reader_give(reader, read);
    }
}

struct hg_page_read *hg_page_reader_pop(struct hg_page_reader *reader, uint64_t timeout_ns)
{
    struct hg_page_read *read = reader->returned;
    reader->returned = NULL;
    if (read != NULL)
        return read;
    if (reader->pending == 0)
        return NULL;
    read =
        timeout_ns > 0 ? hg_queue_pop(&reader->done, timeout_ns) : hg_queue_try_pop(&reader->done);
    reader->pending -= read != NULL;
    return read;
}

void hg_page_reader_give(struct hg_page_reader *reader, struct hg_page_read *read)
{
    reader->spare[reader->spare_count++] = read;
}

void hg_page_reader_unpop(struct hg_page_reader *reader, struct hg_page_read *read)
{
    reader->returned = read;
}

uint32_t hg_page_reader_pending(const struct hg_page_reader *reader)
{
    return reader->pending;
}

uint32_t hg_page_reader_out(const struct hg_page_reader *reader)
{
    return reader->limit - reader->spare_count;
}
