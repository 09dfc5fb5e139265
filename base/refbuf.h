// refbuf.h - immutable reference-counted bytes that cross threads (frames, uploads).
// Floor 0. ref/unref are thread-safe; bytes are written only before the first ref is shared.
#ifndef HG_BASE_REFBUF_H
#define HG_BASE_REFBUF_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

struct hg_refbuf {
    _Atomic uint32_t refs;
    size_t size;
    _Alignas(64) uint8_t data[];
};

// One reference, zeroed bytes; NULL when memory is not to be had.
struct hg_refbuf *hg_refbuf_create(size_t size) HG_MUST_CHECK;
// The same for what is kept and seldom looked at: large ones are spilled (spill.h).
struct hg_refbuf *hg_refbuf_create_spilled(size_t size) HG_MUST_CHECK;
struct hg_refbuf *hg_refbuf_ref(struct hg_refbuf *buf);
// Accepts NULL.
void hg_refbuf_unref(struct hg_refbuf *buf);

#endif
