#include "renderer/gpu/readback.h"

#include "base/alloc.h"

struct hg_gpu_lent {
    struct hg_gpu_lent *next;
    struct hg_gpu_buffer buffer;
    struct hg_refbuf *bytes; // one reference of its own; NULL: idle
};

// Its readers are done.
static bool reclaim(struct hg_refbuf **bytes)
{
    if (*bytes != NULL && hg_refbuf_is_shared(*bytes))
        return false;
    hg_refbuf_unref(*bytes);
    *bytes = NULL;
    return true;
}

// Takes it out of its list.
static void drop(struct hg_gpu *gpu, struct hg_gpu_lent **link)
{
    struct hg_gpu_lent *it = *link;
    *link = it->next;
    hg_refbuf_unref(it->bytes);
    hg_gpu_buffer_destroy(gpu, &it->buffer);
    hg_free(it);
}

// Keeps one idle buffer of those that were lent; NULL: there is none.
static struct hg_gpu_lent *find_idle(struct hg_gpu *gpu, struct hg_gpu_lent **list)
{
    struct hg_gpu_lent *found = NULL;
    for (struct hg_gpu_lent **link = list; *link != NULL;) {
        struct hg_gpu_lent *it = *link;
        if (reclaim(&it->bytes) && found != NULL) {
            drop(gpu, link);
            continue;
        }
        found = it->bytes == NULL ? it : found;
        link = &it->next;
    }
    return found;
}

// What is lent stays with its readers.
static enum hg_status leave_to_readers(
    struct hg_gpu *gpu, struct hg_gpu_readback *r, const char *name, struct hg_error *err)
{
    struct hg_gpu_lent *to = find_idle(gpu, &r->others);
    if (to == NULL) {
        to = hg_calloc(1, sizeof *to);
        if (to == NULL)
            return hg_error_set(err, HG_E_NOMEM, name, NULL, "out of host memory");
        to->next = r->others;
        r->others = to;
    }
    const struct hg_gpu_buffer idle = to->buffer;
    to->buffer = r->buffer;
    to->bytes = r->lent;
    r->buffer = idle;
    r->lent = NULL;
    return HG_OK;
}

enum hg_status hg_gpu_readback_reserve(struct hg_gpu *gpu, struct hg_gpu_readback *r,
    uint64_t size_bytes, const char *name, struct hg_error *err)
{
    const enum hg_status status = reclaim(&r->lent) ? HG_OK : leave_to_readers(gpu, r, name, err);
    return status == HG_OK ? hg_gpu_buffer_reserve(
                                 gpu, HG_GPU_BUFFER_READBACK, size_bytes, name, &r->buffer, err)
                           : status;
}

struct hg_refbuf *hg_gpu_readback_lend(struct hg_gpu_readback *r, size_t size)
{
    if (r->lent == NULL)
        r->lent = hg_refbuf_wrap(r->buffer.mapped, size);
    return r->lent != NULL ? hg_refbuf_ref(r->lent) : NULL;
}

uint64_t hg_gpu_readback_bytes(const struct hg_gpu_readback *r)
{
    uint64_t bytes = r->buffer.size_bytes;
    for (const struct hg_gpu_lent *it = r->others; it != NULL; it = it->next)
        bytes += it->buffer.size_bytes;
    return bytes;
}

void hg_gpu_lent_sweep(struct hg_gpu *gpu, struct hg_gpu_lent **list, bool all)
{
    for (struct hg_gpu_lent **link = list; *link != NULL;) {
        if (reclaim(&(*link)->bytes) || all)
            drop(gpu, link);
        else
            link = &(*link)->next;
    }
}

void hg_gpu_readback_finish(
    struct hg_gpu *gpu, struct hg_gpu_readback *r, struct hg_gpu_lent **list)
{
    struct hg_gpu_lent *own = r->others;
    if (!reclaim(&r->lent)) {
        struct hg_gpu_lent *it = hg_calloc(1, sizeof *it);
        // Without memory for the list the buffer is not destroyed: readers come first.
        if (it != NULL) {
            *it = (struct hg_gpu_lent){own, r->buffer, r->lent};
            own = it;
        }
    } else {
        hg_gpu_buffer_destroy(gpu, &r->buffer);
    }
    hg_gpu_lent_sweep(gpu, &own, false);
    while (own != NULL) {
        struct hg_gpu_lent *it = own;
        own = it->next;
        it->next = *list;
        *list = it;
    }
    *r = (struct hg_gpu_readback){0};
}
