// page_pack.h - all pages of one mip chain as an entry of the store.
// Floor 2 (texture).
//
// Block 0 describes the chain; block 1 + n is page n (hg_page_number), the last of them the tail
// page. A page holds its payload and the 2 texels around it that lie inside the mip: what lies
// beyond the edges follows from the wrap modes when it is read, so one pack serves them all. For
// REPEAT, pages at the left and right edge also hold the 2 columns of the other edge; the 2 rows of
// the other edge follow in blocks of their own, one per mip and column of pages (rows from the top
// have left when those from the bottom come). Alpha is stored unscaled, with its histograms, and
// serves masks of any cutoff.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_PACK_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_PACK_H

#include "base/jobs.h"
#include "base/store/store.h"
#include "renderer/texture/source/page_codec.h"
#include "renderer/texture/source/pages.h"

#define HG_PAGE_PACK_VERSION 3 // raise with every change of filters, codec or layout

// Identity of a pack.
struct hg_page_chain {
    uint8_t content[HG_SHA256_BYTES]; // of the image
    uint32_t width, height, texel_bytes;
    enum hg_mip_filter filter;
    bool srgb;
};

// Alpha of each mip, for masks.
struct hg_page_histograms {
    uint64_t counts[HG_MIPS_MAX][256];
};

enum hg_status hg_page_pack_key(
    const struct hg_page_chain *chain, struct hg_store_key *out) HG_MUST_CHECK;

// --- writing: rows of mips in, blocks of the store out. One thread at a time.

struct hg_page_packer;

// `writer` is borrowed. Holds 132 rows of each mip. jobs: pages are compressed on it; NULL = this
// thread alone. HG_E_NOMEM.
enum hg_status hg_page_packer_create(const struct hg_page_chain *chain,
    struct hg_store_writer *writer, struct hg_jobs *jobs,
    struct hg_page_packer **out) HG_MUST_CHECK;
void hg_page_packer_destroy(struct hg_page_packer *packer); // accepts NULL
// For hg_mip_stream_params.row; user is the packer. HG_E_NOMEM, statuses of hg_store_write.
enum hg_status hg_page_packer_row(
    void *packer, uint32_t mip, uint32_t y, const void *texels) HG_MUST_CHECK;
// After the last row: the description.
enum hg_status hg_page_packer_end(
    struct hg_page_packer *packer, struct hg_error *err) HG_MUST_CHECK;
// Why a row was refused.
const struct hg_error *hg_page_packer_error(const struct hg_page_packer *packer);
uint64_t hg_page_packer_bytes(const struct hg_page_packer *packer); // memory it holds

// --- reading

struct hg_page_pack {
    struct hg_store_entry *entry;
    struct hg_page_layout layout;
    uint32_t texel_bytes;
    struct hg_page_histograms *histograms; // NULL unless RGBA8 with weighted colours
};

// Per-thread buffers to read pages; about 1.5 MB.
struct hg_page_scratch;
struct hg_page_scratch *hg_page_scratch_create(void) HG_MUST_CHECK; // NULL: no memory
void hg_page_scratch_destroy(struct hg_page_scratch *scratch);      // accepts NULL

// HG_E_NOTFOUND: not in the store (or of another shape), HG_E_NOMEM.
enum hg_status hg_page_pack_open(struct hg_store *store, const struct hg_page_chain *chain,
    struct hg_page_pack *out, struct hg_error *err) HG_MUST_CHECK;
void hg_page_pack_finish(struct hg_page_pack *pack); // accepts a zeroed pack
// One page; many threads may read one pack. HG_E_HASH (damaged, the entry is gone from the store),
// HG_E_INVAL (no such page).
enum hg_status hg_page_pack_read(const struct hg_page_pack *pack, struct hg_page_request *read,
    struct hg_page_scratch *scratch, struct hg_error *err) HG_MUST_CHECK;

#endif
