#include "renderer/image/ktx2/basislz.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/image/ktx2/huffman.h"

enum {
    HISTORY = 1 << 13,       // selectors remembered, at most
    REPEAT_PREDICTION = 256, // the symbol behind the 4^4 predictions of 2 x 2 blocks
    LEAST_REPEATS = 3,
    LONG_RUN = 63,
};

struct endpoint {
    uint8_t colour[3]; // 5 bits
    uint8_t intensity; // row of the table of modifiers
};

struct hg_basislz {
    struct endpoint *endpoints;
    uint8_t (*selectors)[4]; // rows of a block, 2 bits a texel, the left one lowest
    unsigned endpoint_count, selector_count, history_size;
    struct hg_huffman prediction, endpoint_delta, selector, run;
};

static enum hg_status damaged(const char *name, const char *part, struct hg_error *err)
{
    return hg_error_set(err, HG_E_FORMAT, name, part, "the BasisLZ data are damaged");
}

static enum hg_status ok_or_damaged(bool ok)
{
    return ok ? HG_OK : HG_E_FORMAT;
}

// ---- codebooks ---------------------------------------------------------------------------------

static unsigned next_value(
    const struct hg_huffman deltas[3], struct hg_bits *bits, unsigned previous)
{
    const struct hg_huffman *table = &deltas[previous < 10 ? 0 : previous < 22 ? 1 : 2];
    return (previous + hg_huffman_decode(table, bits)) & 31;
}

static bool decode_endpoints(struct hg_basislz *z, const struct hg_huffman colours[3],
    const struct hg_huffman *intensities, struct hg_bits *bits)
{
    const bool grey = hg_bits_take(bits, 1) != 0;
    struct endpoint last = {{16, 16, 16}, 0};
    for (unsigned i = 0; i < z->endpoint_count && !bits->failed; i++) {
        last.intensity = (last.intensity + hg_huffman_decode(intensities, bits)) & 7;
        for (unsigned c = 0; c < 3; c++)
            last.colour[c] =
                grey && c > 0 ? last.colour[0] : (uint8_t)next_value(colours, bits, last.colour[c]);
        z->endpoints[i] = last;
    }
    return !bits->failed;
}

static enum hg_status read_endpoints(struct hg_basislz *z, struct hg_bits bits)
{
    struct hg_huffman tables[4] = {0};
    enum hg_status status = HG_OK;
    for (unsigned i = 0; i < 4 && status == HG_OK; i++)
        status = hg_huffman_read(&tables[i], &bits);
    if (status == HG_OK)
        status = ok_or_damaged(decode_endpoints(z, tables, &tables[3], &bits));
    for (unsigned i = 0; i < 4; i++)
        hg_huffman_finish(&tables[i]);
    return status;
}

static enum hg_status read_selectors(struct hg_basislz *z, struct hg_bits bits)
{
    struct hg_huffman deltas = {0};
    const unsigned other_codings = hg_bits_take(&bits, 2); // which no KTX2 has
    const bool raw = hg_bits_take(&bits, 1) != 0;
    enum hg_status status = ok_or_damaged(!bits.failed && other_codings == 0);
    if (status == HG_OK && !raw)
        status = hg_huffman_read(&deltas, &bits);
    for (unsigned i = 0; i < z->selector_count && status == HG_OK; i++) {
        for (unsigned row = 0; row < 4; row++)
            z->selectors[i][row] = (uint8_t)(raw || i == 0 ? hg_bits_take(&bits, 8)
                                                           : hg_huffman_decode(&deltas, &bits) ^
                                                                 z->selectors[i - 1][row]);
        status = ok_or_damaged(!bits.failed);
    }
    hg_huffman_finish(&deltas);
    return status;
}

static enum hg_status read_tables(struct hg_basislz *z, struct hg_bits bits)
{
    struct hg_huffman *const tables[] = {&z->prediction, &z->endpoint_delta, &z->selector, &z->run};
    for (unsigned i = 0; i < sizeof tables / sizeof *tables; i++) {
        const enum hg_status status = hg_huffman_read(tables[i], &bits);
        if (status != HG_OK)
            return status;
    }
    z->history_size = hg_bits_take(&bits, 13);
    return ok_or_damaged(!bits.failed);
}

static enum hg_status read_parts(
    struct hg_basislz *z, const struct hg_basislz_parts *parts, const char **part)
{
    *part = "endpoints";
    enum hg_status status =
        read_endpoints(z, hg_bits_make(parts->endpoints, parts->endpoint_bytes));
    if (status != HG_OK)
        return status;
    *part = "selectors";
    status = read_selectors(z, hg_bits_make(parts->selectors, parts->selector_bytes));
    if (status != HG_OK)
        return status;
    *part = "tables";
    return read_tables(z, hg_bits_make(parts->tables, parts->table_bytes));
}

enum hg_status hg_basislz_create(const struct hg_basislz_parts *parts, const char *name,
    struct hg_basislz **out, struct hg_error *err)
{
    *out = NULL;
    if (parts->endpoint_count == 0 || parts->selector_count == 0)
        return damaged(name, "codebooks", err);
    struct hg_basislz *z = hg_calloc(1, sizeof *z);
    if (z != NULL) {
        z->endpoint_count = parts->endpoint_count;
        z->selector_count = parts->selector_count;
        z->endpoints = hg_calloc(z->endpoint_count, sizeof *z->endpoints);
        z->selectors = hg_calloc(z->selector_count, sizeof *z->selectors);
    }
    enum hg_status status = HG_E_NOMEM;
    const char *part = NULL;
    if (z != NULL && z->endpoints != NULL && z->selectors != NULL)
        status = read_parts(z, parts, &part);
    if (status == HG_OK) {
        *out = z;
        return HG_OK;
    }
    hg_basislz_destroy(z);
    return status == HG_E_NOMEM
               ? hg_error_set(err, HG_E_NOMEM, name, NULL, "no memory for codebooks")
               : damaged(name, part, err);
}

void hg_basislz_destroy(struct hg_basislz *z)
{
    if (z == NULL)
        return;
    hg_huffman_finish(&z->prediction);
    hg_huffman_finish(&z->endpoint_delta);
    hg_huffman_finish(&z->selector);
    hg_huffman_finish(&z->run);
    hg_free(z->endpoints);
    hg_free(z->selectors);
    hg_free(z);
}

// ---- slices ------------------------------------------------------------------------------------

struct hg_basislz_slice {
    const struct hg_basislz *codebooks;
    char *name;
    struct hg_bits bits;
    uint32_t blocks_x, y; // y: the row that comes next
    uint16_t *above;      // [blocks_x] endpoints of the row before
    uint8_t *below;       // [(blocks_x + 1) / 2] predictions for the odd row
    unsigned prediction, predictions_left;
    unsigned endpoint; // of the block before
    unsigned runs_left;
    uint16_t *history; // [codebooks->history_size] selectors
    unsigned rover;    // where the next new one goes
};

enum hg_status hg_basislz_slice_open(const struct hg_basislz *codebooks,
    const struct hg_image_bytes *bytes, uint32_t blocks_x, struct hg_basislz_slice **out,
    struct hg_error *err)
{
    *out = NULL;
    struct hg_basislz_slice *s = hg_calloc(1, sizeof *s);
    if (s != NULL) {
        s->codebooks = codebooks;
        s->name = hg_strdup(bytes->name);
        s->bits = hg_bits_make(bytes->data, bytes->size);
        s->blocks_x = blocks_x;
        s->above = hg_calloc(blocks_x, sizeof *s->above);
        s->below = hg_calloc((blocks_x + 1) / 2, sizeof *s->below);
        s->history = hg_calloc(HISTORY, sizeof *s->history);
        s->rover = codebooks->history_size / 2;
    }
    if (s == NULL || s->name == NULL || s->above == NULL || s->below == NULL ||
        s->history == NULL) {
        hg_basislz_slice_close(s);
        return hg_error_set(err, HG_E_NOMEM, bytes->name, NULL, "no memory for a slice");
    }
    *out = s;
    return HG_OK;
}

void hg_basislz_slice_close(struct hg_basislz_slice *s)
{
    if (s == NULL)
        return;
    hg_free(s->name);
    hg_free(s->above);
    hg_free(s->below);
    hg_free(s->history);
    hg_free(s);
}

// A count in pieces of `width` bits, each below a bit that says whether more come.
static unsigned take_count(struct hg_bits *bits, unsigned width)
{
    unsigned value = 0;
    for (unsigned at = 0; at < 28; at += width) {
        const unsigned piece = hg_bits_take(bits, width + 1);
        value |= (piece & ((1u << width) - 1)) << at;
        if (piece >> width == 0)
            return value;
    }
    bits->failed = true;
    return 0;
}

// Predictions of the 2 x 2 blocks that begin here, two bits each.
static unsigned next_prediction(struct hg_basislz_slice *s)
{
    if (s->predictions_left > 0) {
        s->predictions_left--;
        return s->prediction;
    }
    const unsigned symbol = hg_huffman_decode(&s->codebooks->prediction, &s->bits);
    if (symbol == REPEAT_PREDICTION)
        s->predictions_left = take_count(&s->bits, 4) + LEAST_REPEATS - 1;
    else
        s->prediction = symbol;
    return s->prediction;
}

// `above_left` is the endpoint of the block above the one before.
static bool next_endpoint(
    struct hg_basislz_slice *s, uint32_t x, unsigned prediction, unsigned above_left)
{
    enum { left, above, diagonal };
    const unsigned count = s->codebooks->endpoint_count;
    if (prediction == above || prediction == diagonal) {
        if (s->y == 0 || (prediction == diagonal && x == 0))
            return false;
        s->endpoint = prediction == above ? s->above[x] : above_left;
    } else if (prediction == left) {
        if (x == 0)
            return false;
    } else {
        s->endpoint += hg_huffman_decode(&s->codebooks->endpoint_delta, &s->bits);
        s->endpoint -= s->endpoint >= count ? count : 0;
    }
    return s->endpoint < count;
}

static bool selector_from_history(struct hg_basislz_slice *s, unsigned index, unsigned *selector)
{
    if (index >= s->codebooks->history_size)
        return false;
    *selector = s->history[index];
    s->history[index] = s->history[index / 2];
    s->history[index / 2] = (uint16_t)*selector;
    return *selector < s->codebooks->selector_count;
}

static bool next_selector(struct hg_basislz_slice *s, unsigned *selector)
{
    const struct hg_basislz *z = s->codebooks;
    if (s->runs_left > 0) {
        s->runs_left--;
        return selector_from_history(s, 0, selector);
    }
    const unsigned symbol = hg_huffman_decode(&z->selector, &s->bits);
    if (symbol == z->selector_count + z->history_size) {
        const unsigned run = hg_huffman_decode(&z->run, &s->bits);
        s->runs_left = (run == LONG_RUN ? take_count(&s->bits, 7) : run) + LEAST_REPEATS - 1;
        return selector_from_history(s, 0, selector);
    }
    if (symbol >= z->selector_count)
        return selector_from_history(s, symbol - z->selector_count, selector);
    *selector = symbol;
    if (z->history_size > 0) {
        s->history[s->rover++] = (uint16_t)symbol;
        if (s->rover == z->history_size)
            s->rover = z->history_size / 2;
    }
    return true;
}

static uint8_t clamp8(int value)
{
    return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
}

// Texels are the block's colour and one of four steps of its intensity.
static void draw_block(
    const struct endpoint *e, const uint8_t selector[4], uint8_t *texels, size_t row_bytes)
{
    static const uint8_t steps[8][2] = {
        {2, 8}, {5, 17}, {9, 29}, {13, 42}, {18, 60}, {24, 80}, {33, 106}, {47, 183}};
    const int small = steps[e->intensity][0], large = steps[e->intensity][1];
    const int modifiers[4] = {-large, -small, small, large};
    uint8_t colours[4][3];
    for (unsigned i = 0; i < 4; i++)
        for (unsigned c = 0; c < 3; c++)
            colours[i][c] = clamp8((e->colour[c] << 3 | e->colour[c] >> 2) + modifiers[i]);
    for (unsigned y = 0; y < 4; y++)
        for (unsigned x = 0; x < 4; x++)
            memcpy(texels + y * row_bytes + 4 * (size_t)x, colours[selector[y] >> 2 * x & 3], 3);
}

enum hg_status hg_basislz_slice_row(
    struct hg_basislz_slice *s, uint8_t *texels, struct hg_error *err)
{
    const struct hg_basislz *z = s->codebooks;
    const size_t row_bytes = (size_t)s->blocks_x * 16;
    unsigned predictions = 0, above_left = 0;
    for (uint32_t x = 0; x < s->blocks_x; x++) {
        if (x % 2 == 0 && s->y % 2 == 0) {
            predictions = next_prediction(s);
            s->below[x / 2] = (uint8_t)(predictions >> 4);
        } else if (x % 2 == 0) {
            predictions = s->below[x / 2];
        }
        unsigned selector;
        if (!next_endpoint(s, x, predictions & 3, above_left) || !next_selector(s, &selector) ||
            s->bits.failed)
            return damaged(s->name, "slice", err);
        predictions >>= 2;
        above_left = s->above[x];
        s->above[x] = (uint16_t)s->endpoint;
        draw_block(
            &z->endpoints[s->endpoint], z->selectors[selector], texels + 16 * (size_t)x, row_bytes);
    }
    s->y++;
    return HG_OK;
}
