// oiio_baseline.h - page packs against OpenImageIO's own texture system: one trace of samples
// through both, one thread, with the same memory for texels. Private to renderer/bench.
//
// The trace: at each moment 24 of the textures, drifting; 64 x 64 trilinear samples of each over a
// patch whose scale goes from the whole texture to its texels and back. Both begin each of three
// alternating rounds with nothing in memory. OpenImageIO reads tiled TIFF files
// (64 x 64, deflate) that hold the same mips as the packs. Files are in the system's page cache for
// both.
#ifndef HG_RENDERER_BENCH_OIIO_BASELINE_H
#define HG_RENDERER_BENCH_OIIO_BASELINE_H

#include "base/bytes.h"
#include "base/status.h"

struct hg_bench_oiio_params {
    const char *cache_dir; // packs go to its store, the tiled files beside it for a while
    uint64_t memory_bytes; // of decoded pages, and of decoded tiles
    uint64_t host_bytes;   // of decoded images while packs are made; 0 = 512 MiB
    uint32_t made, side_px;
    const char *const *images; // [image_count] files; those of more than 8 bits are left out
    uint32_t image_count;
    uint32_t moments;
    bool (*progress)(void *user, uint32_t done); // of HG_BENCH_OIIO_STEPS; false cancels
    void *progress_user;
};

#define HG_BENCH_OIIO_STEPS 8 // packs, files, two times three rounds

struct hg_bench_oiio_side {
    double samples_per_s;             // median of the rounds
    uint64_t bytes_read, texel_bytes; // of a round: read from files, decoded
    double mean;                      // of the green samples
};

struct hg_bench_oiio_result {
    uint32_t images;
    uint64_t samples, set_bytes; // set: all mips as RGBA8
    struct hg_bench_oiio_side packs, oiio;
};

// HG_E_STATE (no cache folder, no count of bytes read), HG_E_CANCELLED, those of page_source.h and
// writer.h.
enum hg_status hg_bench_oiio_run(const struct hg_bench_oiio_params *params,
    struct hg_bench_oiio_result *out, struct hg_error *err) HG_MUST_CHECK;
// "peer":{...}
void hg_bench_oiio_put(struct hg_writer *w, const struct hg_bench_oiio_params *params,
    const struct hg_bench_oiio_result *result);

#endif
