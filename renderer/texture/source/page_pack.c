// page_pack.c - see page_pack.h.
#include "renderer/texture/source/page_pack.h"

#include <string.h>

#include "base/alloc.h"

enum {
    LEVEL = 1, // of Zstandard: residuals hold few matches, higher levels cost time and bytes
    BORDER = HG_PAGE_BORDER,
    BAND = HG_PAGE_PITCH,
    PAGE_BYTES_MAX = HG_PAGE_PITCH * HG_PAGE_PITCH * 8,
    BATCH = 16, // pages compressed at once; each takes about 1 MB
};

static bool has_histograms(const struct hg_page_chain *c)
{
    return c->texel_bytes == 4 && c->filter == HG_MIP_WEIGHTED;
}

static void describe(const struct hg_page_chain *chain, struct hg_writer *w)
{
    hg_write_u32(w, chain->width);
    hg_write_u32(w, chain->height);
    hg_write_u32(w, chain->texel_bytes);
    hg_write_u32(w, chain->filter);
    hg_write_u32(w, chain->srgb);
}

enum hg_status hg_page_pack_key(const struct hg_page_chain *chain, struct hg_store_key *out)
{
    struct hg_writer w = {0};
    hg_write_bytes(&w, chain->content, sizeof chain->content);
    describe(chain, &w);
    const enum hg_status status =
        w.failed ? HG_E_NOMEM : hg_store_key("pages", HG_PAGE_PACK_VERSION, w.data, w.size, out);
    hg_writer_finish(&w);
    return status;
}

// The part of a mip that a page holds: payload and border, without what lies beyond the edges.
struct rect {
    uint32_t x, y, width, height;
};

static void span_of(uint32_t page, uint32_t side, uint32_t *first, uint32_t *length)
{
    const uint32_t start = page * HG_PAGE_TEXELS, end = start + HG_PAGE_TEXELS + BORDER;
    *first = page > 0 ? start - BORDER : 0;
    *length = (end < side ? end : side) - *first;
}

static struct rect rect_of(const struct hg_page_layout *l, uint32_t mip, uint32_t x, uint32_t y)
{
    struct rect r;
    span_of(x, hg_mips_side(l->width, mip), &r.x, &r.width);
    span_of(y, hg_mips_side(l->height, mip), &r.y, &r.height);
    return r;
}

// The columns (or rows) of the other edge that REPEAT shows beside a page; length 0: none. The last
// page may be so narrow that the one before it sees across the edge, too.
static void beyond_edge(uint32_t page, uint32_t side, uint32_t *first, uint32_t *length)
{
    *first = *length = 0;
    if (side <= HG_PAGE_TEXELS || (page > 0 && (page + 1) * HG_PAGE_TEXELS + BORDER <= side))
        return;
    *first = page == 0 ? side - BORDER : 0;
    *length = BORDER;
}

static bool has_strips(const struct hg_page_layout *l, uint32_t mip)
{
    return mip < l->tail && hg_mips_side(l->height, mip) > HG_PAGE_TEXELS;
}

// Block with the outer rows above and below the pages of a column.
static uint32_t strip_block(const struct hg_page_layout *l, uint32_t mip, uint32_t x)
{
    uint32_t block = l->pages + 1 + x;
    for (uint32_t i = 0; i < mip; i++)
        block += has_strips(l, i) ? hg_pages_across(l->width, i) : 0;
    return block;
}

static uint32_t count_blocks(const struct hg_page_layout *l)
{
    return strip_block(l, l->tail, 0);
}

// --- writing -------------------------------------------------------------------------------------

// Rows of one mip that are not all in finished pages.
struct band {
    uint8_t *rows;  // [BAND] rows of the mip
    uint8_t *outer; // [4] its last two and its first two; NULL when it has no strips
    uint32_t first, count;
    uint32_t page_row; // next one to be cut
};

struct slot {
    struct hg_page_codec *codec;
    struct hg_writer out;
    enum hg_status status;
};

struct hg_page_packer {
    struct hg_page_chain chain;
    struct hg_page_layout layout;
    struct hg_store_writer *writer;
    struct hg_jobs *jobs;
    struct band bands[HG_MIPS_MAX];
    uint8_t *tail[HG_MIPS_MAX]; // whole mips
    struct hg_page_histograms *histograms;
    struct slot slots[BATCH];
    uint64_t bytes;
    struct hg_error err;
    uint32_t mip, page_x; // of the batch: first page of slots[0]
};

static void *take(struct hg_page_packer *p, size_t count, size_t size)
{
    p->bytes += (uint64_t)count * size;
    return hg_calloc(count, size);
}

static bool allocate(struct hg_page_packer *p)
{
    const struct hg_page_layout *l = &p->layout;
    bool good = true;
    for (uint32_t i = 0; i < l->mips && good; i++) {
        const size_t row = (size_t)hg_mips_side(l->width, i) * p->chain.texel_bytes;
        const uint32_t h = hg_mips_side(l->height, i);
        if (i < l->tail)
            good = (p->bands[i].rows = take(p, h < BAND ? h : BAND, row)) != NULL;
        if (good && has_strips(l, i))
            good = (p->bands[i].outer = take(p, 4, row)) != NULL;
        if (i >= l->tail)
            good = (p->tail[i] = take(p, h, row)) != NULL;
    }
    if (good && has_histograms(&p->chain))
        good = (p->histograms = take(p, 1, sizeof *p->histograms)) != NULL;
    return good;
}

enum hg_status hg_page_packer_create(const struct hg_page_chain *chain,
    struct hg_store_writer *writer, struct hg_jobs *jobs, struct hg_page_packer **out)
{
    *out = NULL;
    struct hg_page_packer *p = hg_calloc(1, sizeof *p);
    if (p == NULL)
        return HG_E_NOMEM;
    p->chain = *chain;
    p->layout = hg_page_layout_of(chain->width, chain->height);
    p->writer = writer;
    p->jobs = jobs;
    if (!allocate(p)) {
        hg_page_packer_destroy(p);
        return HG_E_NOMEM;
    }
    *out = p;
    return HG_OK;
}

void hg_page_packer_destroy(struct hg_page_packer *p)
{
    if (p == NULL)
        return;
    for (uint32_t i = 0; i < HG_MIPS_MAX; i++) {
        hg_free(p->bands[i].rows);
        hg_free(p->bands[i].outer);
        hg_free(p->tail[i]);
    }
    for (uint32_t i = 0; i < BATCH; i++) {
        hg_page_codec_destroy(p->slots[i].codec);
        hg_writer_finish(&p->slots[i].out);
    }
    hg_free(p->histograms);
    hg_free(p);
}

const struct hg_error *hg_page_packer_error(const struct hg_page_packer *packer)
{
    return &packer->err;
}

uint64_t hg_page_packer_bytes(const struct hg_page_packer *packer)
{
    return packer->bytes;
}

static enum hg_status fail(struct hg_page_packer *p, enum hg_status status)
{
    return hg_error_set(&p->err, status, "pages", NULL, "%s", hg_status_text(status));
}

// Rows of a mip and the columns that a page of it shows: its own, then those beyond the edge.
static enum hg_status encode_span(struct hg_page_packer *p, struct slot *s, uint32_t mip,
    uint32_t x, const uint8_t *rows, uint32_t height)
{
    const uint32_t width = hg_mips_side(p->layout.width, mip), texel = p->chain.texel_bytes;
    const size_t pitch = (size_t)width * texel, at = s->out.size;
    uint32_t first, length, other, other_length;
    span_of(x, width, &first, &length);
    beyond_edge(x, width, &other, &other_length);
    hg_write_u32(&s->out, 0);
    const struct hg_texel_layout own = {length, height, texel, pitch};
    const struct hg_texel_layout beyond = {other_length, height, texel, pitch};
    enum hg_status status =
        hg_page_encode(s->codec, rows + (size_t)first * texel, &own, LEVEL, &s->out);
    if (status == HG_OK)
        hg_write_patch_u32(&s->out, at, (uint32_t)(s->out.size - at - 4));
    if (status == HG_OK && other_length > 0)
        status = hg_page_encode(s->codec, rows + (size_t)other * texel, &beyond, LEVEL, &s->out);
    return status;
}

static enum hg_status ready_slot(struct slot *s)
{
    if (s->codec == NULL)
        s->codec = hg_page_codec_create();
    s->out.size = 0;
    s->out.failed = false;
    return s->codec != NULL ? HG_OK : HG_E_NOMEM;
}

static void encode_slot(void *user, size_t index)
{
    struct hg_page_packer *p = user;
    struct slot *s = &p->slots[index];
    const struct band *b = &p->bands[p->mip];
    const uint32_t x = p->page_x + (uint32_t)index;
    const struct rect r = rect_of(&p->layout, p->mip, x, b->page_row);
    const size_t pitch = (size_t)hg_mips_side(p->layout.width, p->mip) * p->chain.texel_bytes;
    s->status = ready_slot(s);
    if (s->status == HG_OK)
        s->status = encode_span(p, s, p->mip, x, b->rows + (r.y - b->first) * pitch, r.height);
}

// The mip is complete: its outer rows, for the pages at the other edge.
static enum hg_status write_strips(struct hg_page_packer *p, uint32_t mip)
{
    struct slot *s = &p->slots[0];
    const size_t pitch = (size_t)hg_mips_side(p->layout.width, mip) * p->chain.texel_bytes;
    for (uint32_t x = 0; x < hg_pages_across(p->layout.width, mip); x++) {
        enum hg_status status = ready_slot(s);
        for (uint32_t edge = 0; edge < 2 && status == HG_OK; edge++) {
            const size_t at = s->out.size;
            hg_write_u32(&s->out, 0);
            status = encode_span(p, s, mip, x, p->bands[mip].outer + edge * BORDER * pitch, BORDER);
            if (status == HG_OK)
                hg_write_patch_u32(&s->out, at, (uint32_t)(s->out.size - at - 4));
        }
        if (status != HG_OK)
            return fail(p, status);
        status = hg_store_write(
            p->writer, strip_block(&p->layout, mip, x), s->out.data, s->out.size, &p->err);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}

static void keep_outer(struct hg_page_packer *p, uint32_t mip, uint32_t y, const void *texels)
{
    const uint32_t height = hg_mips_side(p->layout.height, mip);
    const size_t pitch = (size_t)hg_mips_side(p->layout.width, mip) * p->chain.texel_bytes;
    uint8_t *outer = p->bands[mip].outer;
    if (outer != NULL && y + BORDER >= height)
        memcpy(outer + (y + BORDER - height) * pitch, texels, pitch);
    if (outer != NULL && y < BORDER)
        memcpy(outer + (BORDER + y) * pitch, texels, pitch);
}

static enum hg_status cut_batch(struct hg_page_packer *p, uint32_t mip, uint32_t x, uint32_t count)
{
    p->mip = mip;
    p->page_x = x;
    if (p->jobs != NULL)
        hg_jobs_for(p->jobs, count, encode_slot, p);
    for (uint32_t i = 0; p->jobs == NULL && i < count; i++)
        encode_slot(p, i);
    const uint32_t first = hg_page_number(&p->layout, mip, x, p->bands[mip].page_row);
    for (uint32_t i = 0; i < count; i++) {
        const struct slot *s = &p->slots[i];
        if (s->status != HG_OK)
            return fail(p, s->status);
        const enum hg_status status =
            hg_store_write(p->writer, 1 + first + i, s->out.data, s->out.size, &p->err);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}

// Without jobs one codec is enough.
static enum hg_status cut_page_row(struct hg_page_packer *p, uint32_t mip)
{
    const uint32_t across = hg_pages_across(p->layout.width, mip);
    const uint32_t most = p->jobs != NULL ? BATCH : 1;
    for (uint32_t x = 0; x < across; x += most) {
        const uint32_t count = across - x < most ? across - x : most;
        const enum hg_status status = cut_batch(p, mip, x, count);
        if (status != HG_OK)
            return status;
    }
    p->bands[mip].page_row++;
    return HG_OK;
}

static enum hg_status add_to_band(struct hg_page_packer *p, uint32_t mip, const void *texels)
{
    struct band *b = &p->bands[mip];
    const uint32_t height = hg_mips_side(p->layout.height, mip);
    const size_t pitch = (size_t)hg_mips_side(p->layout.width, mip) * p->chain.texel_bytes;
    memcpy(b->rows + b->count++ * pitch, texels, pitch);
    while (b->page_row < hg_pages_across(p->layout.height, mip)) {
        uint32_t first, length;
        span_of(b->page_row, height, &first, &length);
        if (b->first + b->count < first + length)
            break;
        const enum hg_status status = cut_page_row(p, mip);
        if (status != HG_OK)
            return status;
        // Keep what the next row of pages starts with.
        span_of(b->page_row, height > b->page_row * HG_PAGE_TEXELS ? height : UINT32_MAX, &first,
            &length);
        const uint32_t end = b->first + b->count, kept = end > first ? end - first : 0;
        memmove(b->rows, b->rows + (b->count - kept) * pitch, kept * pitch);
        b->first = end - kept;
        b->count = kept;
    }
    return HG_OK;
}

static enum hg_status write_tail(struct hg_page_packer *p)
{
    const struct hg_page_layout *l = &p->layout;
    struct hg_writer out = {0};
    struct slot *s = &p->slots[0];
    enum hg_status status = ready_slot(s);
    for (uint32_t i = l->tail; i < l->mips && status == HG_OK; i++) {
        const uint32_t w = hg_mips_side(l->width, i), h = hg_mips_side(l->height, i);
        const size_t at = out.size;
        hg_write_u32(&out, 0);
        const struct hg_texel_layout layout = {
            w, h, p->chain.texel_bytes, (size_t)w * p->chain.texel_bytes};
        status = hg_page_encode(s->codec, p->tail[i], &layout, LEVEL, &out);
        if (status == HG_OK)
            hg_write_patch_u32(&out, at, (uint32_t)(out.size - at - 4));
    }
    if (status == HG_OK)
        status = hg_store_write(p->writer, l->pages, out.data, out.size, &p->err);
    else
        fail(p, status);
    hg_writer_finish(&out);
    return status;
}

enum hg_status hg_page_packer_row(void *packer, uint32_t mip, uint32_t y, const void *texels)
{
    struct hg_page_packer *p = packer;
    const uint32_t w = hg_mips_side(p->layout.width, mip);
    const uint8_t *alpha = texels;
    for (uint32_t i = 0; p->histograms != NULL && i < w; i++)
        p->histograms->counts[mip][alpha[i * 4 + 3]]++;
    if (mip < p->layout.tail) {
        keep_outer(p, mip, y, texels);
        const enum hg_status status = add_to_band(p, mip, texels);
        const bool last = y + 1 == hg_mips_side(p->layout.height, mip);
        return status == HG_OK && last && has_strips(&p->layout, mip) ? write_strips(p, mip)
                                                                      : status;
    }
    const size_t pitch = (size_t)w * p->chain.texel_bytes;
    memcpy(p->tail[mip] + y * pitch, texels, pitch);
    return mip + 1 == p->layout.mips ? write_tail(p) : HG_OK;
}

enum hg_status hg_page_packer_end(struct hg_page_packer *p, struct hg_error *err)
{
    struct hg_writer w = {0};
    describe(&p->chain, &w);
    for (uint32_t m = 0; p->histograms != NULL && m < p->layout.mips; m++)
        for (int a = 0; a < 256; a++)
            hg_write_u64(&w, p->histograms->counts[m][a]);
    enum hg_status status = w.failed ? hg_error_set(err, HG_E_NOMEM, "pages", NULL, "no memory")
                                     : hg_store_write(p->writer, 0, w.data, w.size, err);
    hg_writer_finish(&w);
    return status;
}

// --- opening -------------------------------------------------------------------------------------

static bool parse_head(
    struct hg_page_pack *pack, const struct hg_page_chain *chain, const uint8_t *data, size_t size)
{
    struct hg_writer expected = {0};
    describe(chain, &expected);
    bool good = !expected.failed && size >= expected.size &&
                memcmp(data, expected.data, expected.size) == 0;
    struct hg_reader r = hg_reader_make(data, size);
    (void)hg_read_bytes(&r, expected.size);
    hg_writer_finish(&expected);
    for (uint32_t m = 0; good && pack->histograms != NULL && m < pack->layout.mips; m++)
        for (int a = 0; a < 256; a++)
            pack->histograms->counts[m][a] = hg_read_u64(&r);
    return good && !r.failed && r.pos == size;
}

static enum hg_status load_head(
    struct hg_page_pack *pack, const struct hg_page_chain *chain, struct hg_error *err)
{
    const uint32_t size = hg_store_entry_size(pack->entry, 0);
    if (size == 0 || size > 1u << 20 ||
        hg_store_entry_blocks(pack->entry) != count_blocks(&pack->layout))
        return hg_error_set(err, HG_E_NOTFOUND, "pages", NULL, "a pack of another shape");
    uint8_t *data = hg_calloc(size, 1);
    if (has_histograms(chain))
        pack->histograms = hg_calloc(1, sizeof *pack->histograms);
    enum hg_status status = HG_E_NOMEM;
    if (data != NULL && (pack->histograms != NULL || !has_histograms(chain)))
        status = hg_store_entry_read(pack->entry, 0, data, size, err);
    else
        hg_error_set(err, status, "pages", NULL, "no memory");
    if (status == HG_OK && !parse_head(pack, chain, data, size))
        status = HG_E_NOTFOUND;
    hg_free(data);
    return status == HG_E_HASH ? HG_E_NOTFOUND : status;
}

enum hg_status hg_page_pack_open(struct hg_store *store, const struct hg_page_chain *chain,
    struct hg_page_pack *out, struct hg_error *err)
{
    *out = (struct hg_page_pack){.layout = hg_page_layout_of(chain->width, chain->height),
        .texel_bytes = chain->texel_bytes};
    struct hg_store_key key;
    enum hg_status status = hg_page_pack_key(chain, &key);
    if (status == HG_OK)
        status = hg_store_find(store, &key, &out->entry, err);
    else
        hg_error_set(err, status, "pages", NULL, "no memory");
    if (status == HG_OK)
        status = load_head(out, chain, err);
    if (status != HG_OK)
        hg_page_pack_finish(out);
    return status;
}

void hg_page_pack_finish(struct hg_page_pack *pack)
{
    hg_store_entry_close(pack->entry);
    hg_free(pack->histograms);
    memset(pack, 0, sizeof *pack);
}

// --- reading -------------------------------------------------------------------------------------

struct hg_page_scratch {
    struct hg_page_codec *codec;
    uint8_t *packed;
    size_t capacity;
    uint8_t parts[4][PAGE_BYTES_MAX]; // decoded; the mips of a tail lie behind each other
};

struct hg_page_scratch *hg_page_scratch_create(void)
{
    struct hg_page_scratch *s = hg_calloc(1, sizeof *s);
    if (s != NULL && (s->codec = hg_page_codec_create()) != NULL)
        return s;
    hg_free(s);
    return NULL;
}

void hg_page_scratch_destroy(struct hg_page_scratch *s)
{
    if (s == NULL)
        return;
    hg_page_codec_destroy(s->codec);
    hg_free(s->packed);
    hg_free(s);
}

static enum hg_status load_block(const struct hg_page_pack *pack, struct hg_page_scratch *s,
    uint32_t block, uint32_t *size, struct hg_error *err)
{
    *size = hg_store_entry_size(pack->entry, block);
    if (*size == 0 || *size > 2 * PAGE_BYTES_MAX)
        return hg_error_set(err, HG_E_HASH, "pages", NULL, "block %u has %u bytes", block, *size);
    if (hg_grow(&s->packed, &s->capacity, *size, 1) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "pages", NULL, "no memory");
    return hg_store_entry_read(pack->entry, block, s->packed, *size, err);
}

// The checksums matched, so the writer is at fault; the page is rejected nevertheless.
static enum hg_status not_a_page(uint32_t block, struct hg_error *err)
{
    return hg_error_set(err, HG_E_HASH, "pages", NULL, "block %u is no page", block);
}

struct reading {
    const struct hg_page_pack *pack;
    struct hg_page_request *page;
    struct hg_page_scratch *scratch;
    struct hg_error *err;
};

// Decodes `rows` rows from `y` on: the page's own columns to parts[index], those beyond the edge to
// parts[index + 1], where the wrap mode shows them.
static bool decode_span(const struct reading *q, struct hg_reader *r, uint32_t y, uint32_t rows,
    int index, struct hg_page_part parts[4])
{
    const uint32_t width = hg_mips_side(q->pack->layout.width, q->page->mip);
    const uint32_t texel = q->pack->texel_bytes;
    uint32_t first[2], length[2];
    span_of(q->page->x, width, &first[0], &length[0]);
    beyond_edge(q->page->x, width, &first[1], &length[1]);
    const uint32_t sizes[2] = {hg_read_u32(r), 0};
    for (int i = 0; i < 2 && length[i] > 0; i++) {
        const size_t size = i == 0 ? sizes[0] : r->size - r->pos;
        const uint8_t *data = hg_read_bytes(r, size);
        if (data == NULL)
            return false;
        if (i == 1 && q->page->view->wrap_s != HG_WRAP_REPEAT)
            break;
        uint8_t *dst = q->scratch->parts[index + i];
        const size_t pitch = (size_t)length[i] * texel;
        const struct hg_texel_layout layout = {length[i], rows, texel, pitch};
        if (hg_page_decode(q->scratch->codec, data, size, &layout, dst) != HG_OK)
            return false;
        parts[index + i] = (struct hg_page_part){dst, pitch, first[i], y, length[i], rows};
    }
    return true;
}

static enum hg_status read_own(struct reading *q, struct hg_page_part parts[4])
{
    const struct rect r = rect_of(&q->pack->layout, q->page->mip, q->page->x, q->page->y);
    const uint32_t block =
        1 + hg_page_number(&q->pack->layout, q->page->mip, q->page->x, q->page->y);
    uint32_t size;
    const enum hg_status status = load_block(q->pack, q->scratch, block, &size, q->err);
    if (status != HG_OK)
        return status;
    q->page->bytes += size;
    struct hg_reader reader = hg_reader_make(q->scratch->packed, size);
    return decode_span(q, &reader, r.y, r.height, 0, parts) ? HG_OK : not_a_page(block, q->err);
}

// Rows of the other edge, where REPEAT shows them.
static enum hg_status read_strip(struct reading *q, struct hg_page_part parts[4])
{
    const struct hg_page_layout *l = &q->pack->layout;
    uint32_t first, length, size;
    beyond_edge(q->page->y, hg_mips_side(l->height, q->page->mip), &first, &length);
    if (length == 0 || q->page->view->wrap_t != HG_WRAP_REPEAT)
        return HG_OK;
    const uint32_t block = strip_block(l, q->page->mip, q->page->x);
    const enum hg_status status = load_block(q->pack, q->scratch, block, &size, q->err);
    if (status != HG_OK)
        return status;
    q->page->bytes += size;
    struct hg_reader r = hg_reader_make(q->scratch->packed, size);
    for (int edge = 0; edge < 2; edge++) { // the last rows, then the first
        const uint32_t bytes = hg_read_u32(&r);
        const uint8_t *data = hg_read_bytes(&r, bytes);
        if (data == NULL)
            break;
        struct hg_reader part = hg_reader_make(data, bytes);
        if ((edge == 1) == (first == 0))
            return decode_span(q, &part, first, length, 2, parts) ? HG_OK
                                                                  : not_a_page(block, q->err);
    }
    return not_a_page(block, q->err);
}

static enum hg_status read_tail(struct reading *q)
{
    const struct hg_page_layout *l = &q->pack->layout;
    const uint32_t texel = q->pack->texel_bytes;
    struct hg_page_scratch *s = q->scratch;
    const uint8_t *levels[HG_MIPS_MAX] = {0};
    uint32_t size;
    const enum hg_status status = load_block(q->pack, s, l->pages, &size, q->err);
    if (status != HG_OK)
        return status;
    q->page->bytes += size;
    struct hg_reader r = hg_reader_make(s->packed, size);
    uint8_t *texels = s->parts[0];
    for (uint32_t i = l->tail; i < l->mips; i++) {
        const uint32_t w = hg_mips_side(l->width, i), h = hg_mips_side(l->height, i);
        const uint32_t length = hg_read_u32(&r);
        const uint8_t *data = hg_read_bytes(&r, length);
        const struct hg_texel_layout layout = {w, h, texel, (size_t)w * texel};
        if (data == NULL || hg_page_decode(s->codec, data, length, &layout, texels) != HG_OK)
            return not_a_page(l->pages, q->err);
        levels[i] = texels;
        texels += (size_t)w * h * texel;
    }
    hg_page_assemble_tail(q->page->view, levels, q->page->texels);
    return HG_OK;
}

enum hg_status hg_page_pack_read(const struct hg_page_pack *pack, struct hg_page_request *read,
    struct hg_page_scratch *scratch, struct hg_error *err)
{
    const struct hg_page_layout *l = &pack->layout;
    const uint32_t mip = read->mip, x = read->x, y = read->y;
    read->bytes = 0;
    if (hg_page_number(l, mip, x, y) == UINT32_MAX)
        return hg_error_set(err, HG_E_INVAL, "pages", NULL, "no page %u, %u of mip %u", x, y, mip);
    struct reading q = {pack, read, scratch, err};
    if (mip == l->tail)
        return read_tail(&q);
    struct hg_page_part parts[4] = {0};
    enum hg_status status = read_own(&q, parts);
    if (status == HG_OK)
        status = read_strip(&q, parts);
    if (status == HG_OK)
        hg_page_assemble(read->view, mip, x, y, parts, read->texels);
    return status;
}
