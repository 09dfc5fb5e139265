// readback.h - what the device wrote for the host, lent to readers without a copy.
// Floor 1 (gpu). Thread: the render thread; references to what is lent are dropped on any thread.
#ifndef HG_RENDERER_GPU_READBACK_H
#define HG_RENDERER_GPU_READBACK_H

#include "base/refbuf.h"
#include "renderer/gpu/gpu.h"

// A buffer that was lent, in a list.
struct hg_gpu_lent;

// Zero-initialise.
struct hg_gpu_readback {
    struct hg_gpu_buffer buffer; // written next, or newest; read it through `mapped`
    struct hg_refbuf *lent;      // its bytes; NULL: it has had no reader
    struct hg_gpu_lent *others;  // with readers, or idle
};

// Makes room to write to: another buffer where the one before still has readers, who keep what they
// were lent. What it holds is undefined. HG_E_NOMEM, HG_E_LIMIT, device errors.
enum hg_status hg_gpu_readback_reserve(struct hg_gpu *gpu, struct hg_gpu_readback *readback,
    uint64_t size_bytes, const char *name, struct hg_error *err) HG_MUST_CHECK;
// One reference to its first bytes, as of now; they do not change until it is dropped. NULL: no
// memory.
struct hg_refbuf *hg_gpu_readback_lend(struct hg_gpu_readback *readback, size_t size) HG_MUST_CHECK;
uint64_t hg_gpu_readback_bytes(const struct hg_gpu_readback *readback);
// Destroys it; buffers with readers are added to a list.
void hg_gpu_readback_finish(
    struct hg_gpu *gpu, struct hg_gpu_readback *readback, struct hg_gpu_lent **list);

// Destroys those of the list whose readers are done. `all`: there are no readers any more.
void hg_gpu_lent_sweep(struct hg_gpu *gpu, struct hg_gpu_lent **list, bool all);

#endif
