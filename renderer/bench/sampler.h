// sampler.h - textures sampled by the host through a bounded number of decoded pages.
// Private to renderer/bench. Thread: one.
#ifndef HG_RENDERER_BENCH_SAMPLER_H
#define HG_RENDERER_BENCH_SAMPLER_H

#include "renderer/texture/source/page_source.h"

struct hg_bench_sampler;

// RGBA8 sources, borrowed, that can be read at once. Pages take at most memory_bytes; those used
// longest ago leave. HG_E_INVAL (texels of another size, no room for a page), HG_E_NOMEM.
enum hg_status hg_bench_sampler_create(struct hg_page_source *const *sources, uint32_t count,
    uint64_t memory_bytes, struct hg_bench_sampler **out, struct hg_error *err) HG_MUST_CHECK;
void hg_bench_sampler_destroy(struct hg_bench_sampler *sampler); // accepts NULL
// Samples of one texture follow, which count as used at the same time.
void hg_bench_sampler_begin(struct hg_bench_sampler *sampler);
// Trilinear, repeating, of the stored bytes / 255; uv in 0..1. footprint: side of the square that
// the sample covers, in texture coordinates. False: a page cannot be read (err).
bool hg_bench_sampler_sample(struct hg_bench_sampler *sampler, uint32_t texture, const float uv[2],
    float footprint, float rgba[4], struct hg_error *err);
// Bytes of pages decoded since creation.
uint64_t hg_bench_sampler_decoded_bytes(const struct hg_bench_sampler *sampler);

#endif
