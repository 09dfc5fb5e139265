// refbuf.h - immutable reference-counted bytes that cross threads (frames, uploads).
// Floor 0. ref/unref are thread-safe; bytes are written only before the first ref is shared.
#ifndef HG_BASE_REFBUF_H
#define HG_BASE_REFBUF_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

struct hg_refbuf {
    _Alignas(64) _Atomic uint32_t refs;
    size_t size;
    uint8_t *data; // behind the struct, but of wrapped ones
};

// One reference, zeroed bytes; NULL when memory is not to be had.
struct hg_refbuf *hg_refbuf_create(size_t size) HG_MUST_CHECK;
// The same for what is kept and seldom looked at: large ones are spilled (spill.h).
struct hg_refbuf *hg_refbuf_create_spilled(size_t size) HG_MUST_CHECK;
// One reference to bytes that another keeps, and keeps from changing, for as long as there are more
// references than its own; NULL when memory is not to be had.
struct hg_refbuf *hg_refbuf_wrap(void *data, size_t size) HG_MUST_CHECK;
// There are others than the caller's own reference. What they read is complete when there are not.
bool hg_refbuf_is_shared(const struct hg_refbuf *buf);
struct hg_refbuf *hg_refbuf_ref(struct hg_refbuf *buf);
// Accepts NULL.
void hg_refbuf_unref(struct hg_refbuf *buf);

#endif
