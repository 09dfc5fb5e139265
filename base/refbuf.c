#include "base/refbuf.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/spill.h"

static struct hg_refbuf *create(size_t size, bool spilled)
{
    size_t total;
    if (!hg_add_size(size, sizeof(struct hg_refbuf), &total) || !hg_align_size(total, 64, &total))
        return NULL;
    const bool large = spilled && total >= HG_SPILL_FROM_BYTES;
    struct hg_refbuf *buf = large ? hg_spill_calloc(1, total) : hg_calloc_aligned(64, total);
    if (!buf)
        return NULL;
    atomic_init(&buf->refs, 1);
    buf->size = size;
    buf->data = (uint8_t *)(buf + 1);
    return buf;
}

struct hg_refbuf *hg_refbuf_create(size_t size)
{
    return create(size, false);
}

struct hg_refbuf *hg_refbuf_create_spilled(size_t size)
{
    return create(size, true);
}

struct hg_refbuf *hg_refbuf_wrap(void *data, size_t size)
{
    struct hg_refbuf *buf = create(0, false);
    if (!buf)
        return NULL;
    buf->size = size;
    buf->data = data;
    return buf;
}

bool hg_refbuf_is_shared(const struct hg_refbuf *buf)
{
    return atomic_load_explicit(&buf->refs, memory_order_acquire) > 1;
}

struct hg_refbuf *hg_refbuf_ref(struct hg_refbuf *buf)
{
    atomic_fetch_add_explicit(&buf->refs, 1, memory_order_relaxed);
    return buf;
}

void hg_refbuf_unref(struct hg_refbuf *buf)
{
    if (buf && atomic_fetch_sub_explicit(&buf->refs, 1, memory_order_acq_rel) == 1)
        hg_free(buf);
}
