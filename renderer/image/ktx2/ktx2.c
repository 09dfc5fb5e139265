#include "renderer/image/ktx2/ktx2.h"

#include <errno.h>
#include <pthread.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>
#include <zstd_errors.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/checked.h"
#include "renderer/image/ktx2/basislz.h"
#include "renderer/image/ktx2/uastc.h"

enum {
    HEAD_BYTES = 104, // identifier, header, index and the first level's place
    INPUT_BYTES = 1 << 16,
    MAX_DESCRIPTOR = 1 << 12,
    MAX_KEYS = 1 << 20,
    MAX_LEVELS = 32,
    MAX_BASISLZ = 1 << 30,
    FRAME_HEAD_BYTES = 18,  // of Zstandard, at most
    LEAST_WINDOW_LOG = 23,  // 8 MiB, which every Zstandard decoder is to take (RFC 8878)
    MOST_WINDOW_LOG = 27,   //
    ZSTD_BYTES = 384 << 10, // its own state, one block in and one out
};

enum scheme { SCHEME_NONE, SCHEME_BASISLZ, SCHEME_ZSTD };
enum model { MODEL_ETC1S = 163, MODEL_UASTC = 166 };

// What the decoded channels of a texel mean.
enum meaning {
    MEANS_RGB, // alpha is 1
    MEANS_RGBA,
    MEANS_GREY,   // red, in all three
    MEANS_RG,     // blue is 0
    MEANS_RG_AT_A // red and alpha of what is decoded are red and green
};

struct span {
    uint64_t offset, length;
};

struct hg_ktx2_reader {
    struct hg_image_reader_info info;
    char *name;
    pthread_mutex_t lock;
    FILE *file;          // NULL: bytes
    const uint8_t *data; // borrowed
    uint64_t size;

    enum scheme scheme;
    enum model model;
    enum meaning meaning;
    bool srgb, has_second_slice;
    struct span level, descriptor, keys, globals;
    uint64_t level_bytes;   // uncompressed
    uint64_t inflate_bytes; // that Zstandard takes
    uint32_t blocks_x, blocks_y, level_count;

    struct decoding {          // from the first row until a failure or the end
        uint64_t at;           // of the level that is read next
        uint8_t *input;        // [INPUT_BYTES] of a level under Zstandard
        ZSTD_inBuffer pending; // of it
        ZSTD_DStream *inflate;
        uint8_t *blocks;      // a row of UASTC blocks
        uint8_t *slice_bytes; // the level of a file of ETC1S
        struct hg_basislz *codebooks;
        struct hg_basislz_slice *slices[2]; // colour, alpha
        uint8_t *alpha;                     // 4 rows of the second slice
        uint8_t *texels;                    // 4 rows, RGBA8
        uint32_t next_block_row;
    } decoding;
    uint32_t next_row;
};

static enum hg_status malformed(
    const struct hg_ktx2_reader *r, const char *where, const char *reason, struct hg_error *err)
{
    return hg_error_set(err, HG_E_FORMAT, r->name, where, "%s", reason);
}

static enum hg_status unsupported(
    const struct hg_ktx2_reader *r, const char *where, const char *reason, struct hg_error *err)
{
    return hg_error_set(err, HG_E_UNSUPPORTED, r->name, where, "%s", reason);
}

// ---- bytes of the file -------------------------------------------------------------------------

static enum hg_status read_at(
    struct hg_ktx2_reader *r, uint64_t offset, void *dst, size_t size, struct hg_error *err)
{
    if (!hg_range_ok(offset, size, r->size))
        return malformed(r, NULL, "the KTX2 ends too early", err);
    if (r->file == NULL) {
        memcpy(dst, r->data + offset, size);
        return HG_OK;
    }
    for (size_t done = 0; done < size;) {
        const ssize_t n =
            pread(fileno(r->file), (uint8_t *)dst + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return hg_error_set(err, HG_E_IO, r->name, NULL, "cannot read: %s",
                n < 0 ? strerror(errno) : "the file became shorter");
        done += (size_t)n;
    }
    return HG_OK;
}

// A part of the file in memory of its own.
static enum hg_status read_span(struct hg_ktx2_reader *r, const struct span *span, uint64_t limit,
    uint8_t **out, struct hg_error *err)
{
    *out = NULL;
    if (!hg_range_ok(span->offset, span->length, r->size))
        return malformed(r, NULL, "a part of the KTX2 lies past its end", err);
    if (span->length > limit)
        return hg_error_set(err, HG_E_LIMIT, r->name, NULL, "a part of %llu bytes is too large",
            (unsigned long long)span->length);
    *out = hg_calloc(span->length + 1, 1);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, r->name, NULL, "no memory for a part of the KTX2");
    return read_at(r, span->offset, *out, (size_t)span->length, err);
}

// ---- the header --------------------------------------------------------------------------------

static enum hg_status check_header(const struct hg_ktx2_reader *r, const uint32_t fields[9],
    uint32_t max_side_px, struct hg_error *err)
{
    enum { format, type_size, width, height, depth, layers, faces, levels, scheme };
    if (fields[format] != 0 || fields[type_size] != 1 || fields[scheme] > SCHEME_ZSTD)
        return unsupported(r, "byte 12", "a KTX2 that holds no Basis Universal texture", err);
    if (fields[width] == 0 || fields[height] == 0 || fields[depth] > 1 || fields[layers] > 1 ||
        fields[faces] != 1)
        return unsupported(r, "byte 20", "a KTX2 that is not one flat picture", err);
    if (fields[levels] > MAX_LEVELS)
        return malformed(r, "byte 40", "more mips than there can be", err);
    if (fields[width] > max_side_px || fields[height] > max_side_px)
        return hg_error_set(err, HG_E_LIMIT, r->name, "size", "%ux%u px is more than %u a side",
            fields[width], fields[height], max_side_px);
    return HG_OK;
}

static enum hg_status read_header(
    struct hg_ktx2_reader *r, uint32_t max_side_px, struct hg_error *err)
{
    uint8_t bytes[HEAD_BYTES];
    uint32_t fields[9];
    enum hg_status status = read_at(r, 0, bytes, sizeof bytes, err);
    if (status != HG_OK)
        return status;
    struct hg_reader h = hg_reader_make(bytes, sizeof bytes);
    hg_read_bytes(&h, 12); // identifier: known
    for (unsigned i = 0; i < 9; i++)
        fields[i] = hg_read_u32(&h);
    status = check_header(r, fields, max_side_px, err);
    if (status != HG_OK)
        return status;
    r->info.width = fields[2];
    r->info.height = fields[3];
    r->blocks_x = r->info.width / 4 + (r->info.width % 4 != 0);
    r->blocks_y = r->info.height / 4 + (r->info.height % 4 != 0);
    r->level_count = fields[7];
    r->scheme = (enum scheme)fields[8];
    r->descriptor.offset = hg_read_u32(&h);
    r->descriptor.length = hg_read_u32(&h);
    r->keys.offset = hg_read_u32(&h);
    r->keys.length = hg_read_u32(&h);
    r->globals.offset = hg_read_u64(&h);
    r->globals.length = hg_read_u64(&h);
    r->level.offset = hg_read_u64(&h);
    r->level.length = hg_read_u64(&h);
    r->level_bytes = hg_read_u64(&h);
    return HG_OK;
}

// What the samples of the data format descriptor say the channels are.
static bool read_meaning(struct hg_ktx2_reader *r, const uint8_t *samples, size_t count)
{
    enum { etc1s_rgb = 0, etc1s_rrr = 3, etc1s_ggg = 4, etc1s_aaa = 15 };
    enum { uastc_rgb = 0, uastc_rgba = 3, uastc_rrr = 4, uastc_rrrg = 5, uastc_rg = 6 };
    const unsigned first = samples[3] & 15, second = count > 1 ? samples[16 + 3] & 15 : 0;
    r->has_second_slice = r->model == MODEL_ETC1S && count > 1;
    if (r->model == MODEL_UASTC) {
        r->meaning = first == uastc_rgba   ? MEANS_RGBA
                     : first == uastc_rrr  ? MEANS_GREY
                     : first == uastc_rg   ? MEANS_RG
                     : first == uastc_rrrg ? MEANS_RG_AT_A
                                           : MEANS_RGB;
        return first == uastc_rgb || (first >= uastc_rgba && first <= uastc_rg);
    }
    r->meaning = !r->has_second_slice  ? first == etc1s_rrr ? MEANS_GREY : MEANS_RGB
                 : second == etc1s_aaa ? MEANS_RGBA
                                       : MEANS_RG_AT_A;
    return (first == etc1s_rgb || first == etc1s_rrr) &&
           (!r->has_second_slice || second == etc1s_aaa || second == etc1s_ggg);
}

static enum hg_status read_descriptor(struct hg_ktx2_reader *r, struct hg_error *err)
{
    enum { head = 28, sample = 16, transfer_srgb = 2, premultiplied = 1 };
    uint8_t *bytes;
    enum hg_status status = read_span(r, &r->descriptor, MAX_DESCRIPTOR, &bytes, err);
    if (status != HG_OK) {
        hg_free(bytes);
        return status;
    }
    const uint64_t size = r->descriptor.length;
    const size_t block = size < head ? 0 : 4u + bytes[10] + 256u * bytes[11];
    if (block < head + sample || block > size) {
        status = malformed(r, "descriptor", "the data format descriptor is too short", err);
    } else if (bytes[12] != MODEL_ETC1S && bytes[12] != MODEL_UASTC) {
        status = unsupported(r, "descriptor", "a KTX2 that holds no Basis Universal texture", err);
    } else if (bytes[15] & premultiplied) {
        status = unsupported(r, "descriptor", "colours multiplied with alpha", err);
    } else {
        r->model = (enum model)bytes[12];
        r->srgb = bytes[14] == transfer_srgb;
        if (!read_meaning(r, bytes + head, (block - head) / sample))
            status = unsupported(r, "descriptor", "channels that have no meaning here", err);
        else if ((r->model == MODEL_ETC1S) != (r->scheme == SCHEME_BASISLZ))
            status = malformed(r, "descriptor", "its coding and its compression do not fit", err);
    }
    hg_free(bytes);
    return status;
}

// Values of the keys that would turn or swap what is shown.
static enum hg_status read_keys(struct hg_ktx2_reader *r, struct hg_error *err)
{
    static const char orientation[] = "KTXorientation", swizzle[] = "KTXswizzle";
    uint8_t *bytes;
    enum hg_status status = read_span(r, &r->keys, MAX_KEYS, &bytes, err);
    struct hg_reader keys = hg_reader_make(bytes, status == HG_OK ? (size_t)r->keys.length : 0);
    while (status == HG_OK && keys.size - keys.pos >= 4) {
        const uint32_t length = hg_read_u32(&keys);
        const char *pair = (const char *)hg_read_bytes(&keys, length);
        if (pair == NULL || memchr(pair, 0, length) == NULL) {
            status = malformed(r, "keys", "a key runs past the end", err);
            break;
        }
        const size_t key = strlen(pair) + 1;
        const char *value = pair + key; // a 0 stands behind the last pair
        if (strcmp(pair, orientation) == 0 && length - key >= 2 && memcmp(value, "rd", 2) != 0)
            status = unsupported(r, orientation, "a picture that is turned", err);
        if (strcmp(pair, swizzle) == 0 && length - key >= 4 && memcmp(value, "rgba", 4) != 0)
            status = unsupported(r, swizzle, "channels that are swapped", err);
        while (keys.pos % 4 != 0 && keys.pos < keys.size)
            keys.pos++;
    }
    hg_free(bytes);
    return status;
}

// ---- decoders ----------------------------------------------------------------------------------

static enum hg_status no_memory(const struct hg_ktx2_reader *r, struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, r->name, NULL, "no memory to decode it");
}

// The largest window that a frame of the level may ask for.
static int window_log(const struct hg_ktx2_reader *r)
{
    int log = LEAST_WINDOW_LOG;
    while (log < MOST_WINDOW_LOG && UINT64_C(1) << log < r->level_bytes)
        log++;
    return log;
}

static enum hg_status start_uastc(struct hg_ktx2_reader *r, struct hg_error *err)
{
    r->decoding.blocks = hg_calloc(r->blocks_x, HG_UASTC_BLOCK_BYTES);
    if (r->decoding.blocks == NULL)
        return no_memory(r, err);
    if (r->scheme != SCHEME_ZSTD)
        return HG_OK;
    r->decoding.input = hg_calloc(INPUT_BYTES, 1);
    r->decoding.inflate = r->decoding.input != NULL ? ZSTD_createDStream() : NULL;
    const bool ok =
        r->decoding.inflate != NULL && !ZSTD_isError(ZSTD_DCtx_setParameter(r->decoding.inflate,
                                           ZSTD_d_windowLogMax, window_log(r)));
    return ok ? HG_OK : no_memory(r, err);
}

static enum hg_status open_slice(
    struct hg_ktx2_reader *r, unsigned index, const struct span *span, struct hg_error *err)
{
    if (!hg_range_ok(span->offset, span->length, r->level.length))
        return malformed(r, "level 0", "a slice lies outside", err);
    const struct hg_image_bytes bytes = {
        r->decoding.slice_bytes + span->offset, (size_t)span->length, r->name};
    return hg_basislz_slice_open(
        r->decoding.codebooks, &bytes, r->blocks_x, &r->decoding.slices[index], err);
}

static enum hg_status start_slices(
    struct hg_ktx2_reader *r, const uint8_t *globals, struct hg_error *err)
{
    enum { p_frame = 2, image_bytes = 20 };
    struct hg_reader g = hg_reader_make(globals, (size_t)r->globals.length);
    struct hg_basislz_parts parts = {0};
    parts.endpoint_count = hg_read_u16(&g);
    parts.selector_count = hg_read_u16(&g);
    parts.endpoint_bytes = hg_read_u32(&g);
    parts.selector_bytes = hg_read_u32(&g);
    parts.table_bytes = hg_read_u32(&g);
    hg_read_u32(&g); // of what extends it: none of ETC1S
    const uint32_t flags = hg_read_u32(&g);
    struct span slices[2];
    for (unsigned i = 0; i < 2; i++) {
        slices[i].offset = hg_read_u32(&g);
        slices[i].length = hg_read_u32(&g);
    }
    const uint32_t levels = r->level_count > 0 ? r->level_count : 1;
    hg_read_bytes(&g, (size_t)(levels - 1) * image_bytes);
    parts.endpoints = hg_read_bytes(&g, parts.endpoint_bytes);
    parts.selectors = hg_read_bytes(&g, parts.selector_bytes);
    parts.tables = hg_read_bytes(&g, parts.table_bytes);
    if (g.failed)
        return malformed(r, "global data", "they end too early", err);
    if (flags & p_frame)
        return unsupported(r, "global data", "a frame of a video", err);
    enum hg_status status = hg_basislz_create(&parts, r->name, &r->decoding.codebooks, err);
    for (unsigned i = 0; i < 1u + r->has_second_slice && status == HG_OK; i++)
        status = open_slice(r, i, &slices[i], err);
    return status;
}

static enum hg_status start_etc1s(struct hg_ktx2_reader *r, struct hg_error *err)
{
    uint8_t *globals;
    enum hg_status status = read_span(r, &r->globals, MAX_BASISLZ, &globals, err);
    if (status == HG_OK)
        status = read_span(r, &r->level, MAX_BASISLZ, &r->decoding.slice_bytes, err);
    if (status == HG_OK)
        status = start_slices(r, globals, err);
    hg_free(globals);
    if (status == HG_OK && r->has_second_slice) {
        r->decoding.alpha = hg_calloc((size_t)r->blocks_x * 16, 4);
        if (r->decoding.alpha == NULL)
            status = no_memory(r, err);
    }
    return status;
}

// What the first rows take.
static enum hg_status start(struct hg_ktx2_reader *r, struct hg_error *err)
{
    enum hg_status status = r->model == MODEL_UASTC ? start_uastc(r, err) : start_etc1s(r, err);
    if (status != HG_OK)
        return status;
    r->decoding.texels = hg_calloc((size_t)r->blocks_x * 16, 4);
    return r->decoding.texels != NULL ? HG_OK : no_memory(r, err);
}

// Rows begin again at the first.
static void stop(struct hg_ktx2_reader *r)
{
    hg_basislz_slice_close(r->decoding.slices[0]);
    hg_basislz_slice_close(r->decoding.slices[1]);
    hg_basislz_destroy(r->decoding.codebooks);
    ZSTD_freeDStream(r->decoding.inflate);
    hg_free(r->decoding.input);
    hg_free(r->decoding.blocks);
    hg_free(r->decoding.slice_bytes);
    hg_free(r->decoding.alpha);
    hg_free(r->decoding.texels);
    r->decoding = (struct decoding){0};
}

// ---- what is known before rows -----------------------------------------------------------------

static void describe(struct hg_ktx2_reader *r)
{
    static const uint8_t channels[] = {
        [MEANS_RGB] = 3, [MEANS_RGBA] = 4, [MEANS_GREY] = 1, [MEANS_RG] = 2, [MEANS_RG_AT_A] = 2};
    const uint64_t row = (uint64_t)r->blocks_x * 64;
    r->info.channels = channels[r->meaning];
    r->info.has_alpha = r->meaning == MEANS_RGBA;
    r->info.mips = 1;
    r->info.file_bytes = r->size;
    memcpy(r->info.file_format, "ktx2", 5);
    r->info.row_buffer_bytes = row;
    if (r->model == MODEL_ETC1S)
        r->info.row_buffer_bytes += r->globals.length + r->level.length + row;
    else
        r->info.row_buffer_bytes += row / 4 + r->inflate_bytes;
}

// A frame that says how much it holds takes no more than that.
static enum hg_status check_frame(struct hg_ktx2_reader *r, struct hg_error *err)
{
    uint8_t head[FRAME_HEAD_BYTES];
    const uint64_t window = UINT64_C(1) << window_log(r);
    const size_t n = r->level.length < sizeof head ? (size_t)r->level.length : sizeof head;
    const enum hg_status status = read_at(r, r->level.offset, head, n, err);
    if (status != HG_OK)
        return status;
    const unsigned long long content = ZSTD_getFrameContentSize(head, n);
    if (content == ZSTD_CONTENTSIZE_ERROR)
        return malformed(r, "level 0", "no Zstandard data", err);
    const bool is_small = content == r->level_bytes && content < window;
    r->inflate_bytes = (is_small ? content : window) + INPUT_BYTES + ZSTD_BYTES;
    return HG_OK;
}

static enum hg_status check_slices(const struct hg_ktx2_reader *r, struct hg_error *err)
{
    if (!hg_range_ok(r->globals.offset, r->globals.length, r->size))
        return malformed(r, "global data", "they lie past the end of the file", err);
    if (r->globals.length > MAX_BASISLZ || r->level.length > MAX_BASISLZ)
        return hg_error_set(
            err, HG_E_LIMIT, r->name, "level 0", "more than %d bytes of ETC1S", MAX_BASISLZ);
    return HG_OK;
}

static enum hg_status check_level(struct hg_ktx2_reader *r, struct hg_error *err)
{
    uint64_t bytes;
    if (!hg_range_ok(r->level.offset, r->level.length, r->size))
        return malformed(r, "level 0", "it lies past the end of the file", err);
    if (r->model == MODEL_ETC1S)
        return check_slices(r, err);
    const bool ok = hg_mul_u64((uint64_t)r->blocks_x * r->blocks_y, HG_UASTC_BLOCK_BYTES, &bytes) &&
                    r->level_bytes == bytes &&
                    (r->scheme == SCHEME_ZSTD || r->level.length == bytes);
    if (!ok)
        return malformed(r, "level 0", "its bytes are not those of its size", err);
    return r->scheme == SCHEME_ZSTD ? check_frame(r, err) : HG_OK;
}

static enum hg_status look(struct hg_ktx2_reader *r, uint32_t max_side_px, struct hg_error *err)
{
    enum hg_status status = read_header(r, max_side_px, err);
    if (status == HG_OK)
        status = read_descriptor(r, err);
    if (status == HG_OK)
        status = read_keys(r, err);
    if (status == HG_OK)
        status = check_level(r, err);
    if (status == HG_OK)
        describe(r);
    return status;
}

enum hg_status hg_ktx2_reader_open(FILE *file, const struct hg_image_bytes *bytes,
    uint32_t max_side_px, struct hg_ktx2_reader **out, struct hg_error *err)
{
    const char *name = bytes->name;
    *out = NULL;
    struct stat st = {0};
    struct hg_ktx2_reader *r = hg_calloc(1, sizeof *r);
    if (r == NULL || (r->name = hg_strdup(name)) == NULL) {
        hg_free(r);
        return hg_error_set(err, HG_E_NOMEM, name, NULL, "no memory for the file");
    }
    pthread_mutex_init(&r->lock, NULL);
    r->file = file;
    r->data = bytes->data;
    r->size = bytes->size;
    enum hg_status status = HG_OK;
    if (file != NULL && fstat(fileno(file), &st) != 0)
        status = hg_error_set(err, HG_E_IO, name, NULL, "cannot read: %s", strerror(errno));
    if (file != NULL)
        r->size = (uint64_t)st.st_size;
    if (status == HG_OK)
        status = look(r, max_side_px, err);
    if (status == HG_OK)
        *out = r;
    else
        hg_ktx2_reader_close(r);
    return status;
}

void hg_ktx2_reader_close(struct hg_ktx2_reader *r)
{
    if (r == NULL)
        return;
    stop(r);
    hg_free(r->name);
    pthread_mutex_destroy(&r->lock);
    hg_free(r);
}

const struct hg_image_reader_info *hg_ktx2_reader_info(const struct hg_ktx2_reader *r)
{
    return &r->info;
}

// ---- rows --------------------------------------------------------------------------------------

// More of a level under Zstandard.
static enum hg_status refill(struct hg_ktx2_reader *r, struct hg_error *err)
{
    const uint64_t left = r->level.length - r->decoding.at;
    const size_t n = left < INPUT_BYTES ? (size_t)left : INPUT_BYTES;
    if (n == 0)
        return malformed(r, "level 0", "the Zstandard data end too early", err);
    enum hg_status status = read_at(r, r->level.offset + r->decoding.at, r->decoding.input, n, err);
    r->decoding.at += n;
    r->decoding.pending = (ZSTD_inBuffer){r->decoding.input, n, 0};
    return status;
}

static enum hg_status inflate_failed(
    const struct hg_ktx2_reader *r, size_t result, struct hg_error *err)
{
    const ZSTD_ErrorCode code = ZSTD_getErrorCode(result);
    if (code == ZSTD_error_memory_allocation)
        return no_memory(r, err);
    const enum hg_status status =
        code == ZSTD_error_frameParameter_windowTooLarge ? HG_E_LIMIT : HG_E_FORMAT;
    return hg_error_set(err, status, r->name, "level 0", "%s", ZSTD_getErrorName(result));
}

static enum hg_status inflate(
    struct hg_ktx2_reader *r, void *dst, size_t size, struct hg_error *err)
{
    ZSTD_outBuffer out = {dst, size, 0};
    while (out.pos < size) {
        const size_t before = out.pos;
        const size_t rc = ZSTD_decompressStream(r->decoding.inflate, &out, &r->decoding.pending);
        if (ZSTD_isError(rc))
            return inflate_failed(r, rc, err);
        if (out.pos == before && r->decoding.pending.pos == r->decoding.pending.size) {
            enum hg_status status = refill(r, err);
            if (status != HG_OK)
                return status;
        }
    }
    return HG_OK;
}

static enum hg_status uastc_row(struct hg_ktx2_reader *r, bool wanted, struct hg_error *err)
{
    const size_t row = (size_t)r->blocks_x * HG_UASTC_BLOCK_BYTES;
    enum hg_status status = HG_OK;
    if (r->scheme == SCHEME_ZSTD)
        status = inflate(r, r->decoding.blocks, row, err);
    else if (wanted)
        status = read_at(
            r, r->level.offset + row * r->decoding.next_block_row, r->decoding.blocks, row, err);
    for (uint32_t x = 0; x < r->blocks_x && wanted && status == HG_OK; x++) {
        uint8_t texels[16][4];
        hg_uastc_decode(r->decoding.blocks + (size_t)x * HG_UASTC_BLOCK_BYTES, r->srgb, texels);
        for (unsigned y = 0; y < 4; y++)
            memcpy(r->decoding.texels + (y * (size_t)r->blocks_x + x) * 16, texels[4 * y], 16);
    }
    return status;
}

static enum hg_status etc1s_row(struct hg_ktx2_reader *r, struct hg_error *err)
{
    enum hg_status status = hg_basislz_slice_row(r->decoding.slices[0], r->decoding.texels, err);
    if (status == HG_OK && r->has_second_slice)
        status = hg_basislz_slice_row(r->decoding.slices[1], r->decoding.alpha, err);
    const size_t count = (size_t)r->blocks_x * 16;
    for (size_t i = 0; i < count && status == HG_OK; i++)
        r->decoding.texels[4 * i + 3] = r->has_second_slice ? r->decoding.alpha[4 * i + 1] : 255;
    return status;
}

static void apply_meaning(const struct hg_ktx2_reader *r)
{
    const size_t count = (size_t)r->blocks_x * 16;
    for (size_t i = 0; i < count && r->meaning != MEANS_RGBA; i++) {
        uint8_t *t = r->decoding.texels + 4 * i;
        if (r->meaning == MEANS_GREY)
            t[1] = t[2] = t[0];
        if (r->meaning == MEANS_RG_AT_A)
            t[1] = t[3];
        if (r->meaning == MEANS_RG_AT_A || r->meaning == MEANS_RG)
            t[2] = 0;
        t[3] = 255;
    }
}

// The row of blocks that holds the next row, in r->decoding.texels.
static enum hg_status reach_row(struct hg_ktx2_reader *r, struct hg_error *err)
{
    const uint32_t wanted = r->next_row / 4;
    enum hg_status status = HG_OK;
    if (r->decoding.texels == NULL)
        status = start(r, err);
    for (; r->decoding.next_block_row <= wanted && status == HG_OK; r->decoding.next_block_row++) {
        const bool last = r->decoding.next_block_row == wanted;
        status = r->model == MODEL_UASTC ? uastc_row(r, last, err) : etc1s_row(r, err);
        if (status != HG_OK)
            break;
        if (last)
            apply_meaning(r);
    }
    return status;
}

static void convert(const uint8_t *texels, size_t count, enum hg_pixel_format format, void *pixels)
{
    for (size_t i = 0; i < count * 4; i++) {
        if (format == HG_PIXEL_RGBA16)
            ((uint16_t *)pixels)[i] = (uint16_t)(texels[i] * 257);
        else if (format == HG_PIXEL_RGBA32F)
            ((float *)pixels)[i] = (float)texels[i] / 255.0f;
        else
            ((uint8_t *)pixels)[i] = texels[i];
    }
}

enum hg_status hg_ktx2_reader_rows(struct hg_ktx2_reader *r, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err)
{
    const size_t row = (size_t)r->info.width * hg_pixel_bytes(format);
    enum hg_status status = HG_OK;
    pthread_mutex_lock(&r->lock);
    if (count > r->info.height - r->next_row)
        status = hg_error_set(err, HG_E_INVAL, r->name, NULL, "no more rows");
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        status = reach_row(r, err);
        if (status != HG_OK)
            break;
        convert(r->decoding.texels + (size_t)(r->next_row % 4) * r->blocks_x * 16, r->info.width,
            format, (uint8_t *)pixels + i * row);
        r->next_row++;
    }
    if (status != HG_OK && status != HG_E_INVAL)
        stop(r); // what decodes is in no defined state
    pthread_mutex_unlock(&r->lock);
    return status;
}

void hg_ktx2_reader_skip(struct hg_ktx2_reader *r, uint32_t count)
{
    pthread_mutex_lock(&r->lock);
    const uint32_t left = r->info.height - r->next_row;
    r->next_row += count < left ? count : left;
    pthread_mutex_unlock(&r->lock);
}
