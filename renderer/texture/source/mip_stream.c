// mip_stream.c - see mip_stream.h.
#include "renderer/texture/source/mip_stream.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/texture/source/half.h"

// Weight of colour where alpha is 0, so that hidden texels still have a colour.
#define ALPHA_FLOOR  (1.0f / 1024.0f)
#define ENCODE_STEPS 4096

static float decode_table[256];                // sRGB code to linear
static float encode_limit[257];                // smallest linear value of a code; [256] = infinity
static uint8_t encode_guess[ENCODE_STEPS + 1]; // code at the low end of a step
static pthread_once_t tables_once = PTHREAD_ONCE_INIT;

static double srgb_to_linear(double c)
{
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

static void make_tables(void)
{
    for (int i = 0; i < 256; i++) {
        decode_table[i] = (float)srgb_to_linear(i / 255.0);
        encode_limit[i] = i == 0 ? -INFINITY : (float)srgb_to_linear((i - 0.5) / 255.0);
    }
    encode_limit[256] = INFINITY;
    int code = 0;
    for (int i = 0; i <= ENCODE_STEPS; i++) {
        while ((float)i / ENCODE_STEPS >= encode_limit[code + 1])
            code++;
        encode_guess[i] = (uint8_t)code;
    }
}

static uint8_t encode_srgb(float linear)
{
    if (!(linear > 0.0f))
        return 0;
    if (linear >= 1.0f)
        return 255;
    int code = encode_guess[(int)(linear * ENCODE_STEPS)];
    while (linear >= encode_limit[code + 1])
        code++;
    return (uint8_t)code;
}

static uint8_t encode_unorm(float value)
{
    const float half_up = value * 255.0f + 0.5f; // lroundf would be a call for each texel
    return !(value > 0.0f) ? 0 : value >= 1.0f ? 255 : (uint8_t)half_up;
}

uint32_t hg_mips_count(uint32_t width, uint32_t height)
{
    const uint32_t longer = width > height ? width : height;
    return 32u - (uint32_t)__builtin_clz(longer | 1u);
}

uint32_t hg_mips_side(uint32_t side, uint32_t mip)
{
    return side >> mip > 0 ? side >> mip : 1;
}

uint32_t hg_mips_texel_bytes(enum hg_pixel_format format, bool half)
{
    return format == HG_PIXEL_RGBA8 && !half ? 4 : 8;
}

// Overlap of a texel with texels first.. of the mip above: at most 3 weights, sum 1.
struct taps {
    uint32_t first, count;
    float weights[3];
};

static struct taps taps_at(uint32_t i, uint32_t src, uint32_t dst)
{
    struct taps t = {0};
    const double scale = (double)src / dst, from = i * scale, to = from + scale;
    t.first = (uint32_t)from;
    for (uint32_t x = t.first; x < src && t.count < 3; x++) {
        const double a = from > x ? from : x, b = to < x + 1.0 ? to : x + 1.0;
        if (b - a <= 1e-9)
            break;
        t.weights[t.count++] = (float)((b - a) / scale);
    }
    return t;
}

// What makes one mip (1..) from the rows of the mip above: four floats per texel.
struct level {
    uint32_t width, height, y; // y: row that is being summed
    struct taps taps;          // of row y
    struct taps *columns;      // [width]; NULL for exactly 2 or 1 columns each
    float *sum;                // [width of the mip above * 4]
    float *row;                // [width * 4]
    float *ring;               // [3][width * 4] newest rows, for normals
};

struct hg_mip_stream {
    struct hg_mip_stream_params params;
    uint32_t count, texel_bytes, y; // y: next row of mip 0
    struct level levels[HG_MIPS_MAX];
    float *top;    // [width * 4] row of mip 0
    void *encoded; // one row of texels
};

// --- mip 0 to floats -----------------------------------------------------------------------------

static float to_finite(float v)
{
    return v != v ? 0.0f : v > 65504.0f ? 65504.0f : v < -65504.0f ? -65504.0f : v;
}

static void load_rgba8(const uint8_t *src, uint32_t count, bool srgb, float *dst)
{
    for (uint32_t i = 0; i < count; i++, src += 4, dst += 4) {
        for (int c = 0; c < 3; c++)
            dst[c] = srgb ? decode_table[src[c]] : (float)src[c] * (1.0f / 255.0f);
        dst[3] = (float)src[3] * (1.0f / 255.0f);
    }
}

static void load_rgba16(const uint16_t *src, uint32_t count, bool srgb, float *dst)
{
    for (uint32_t i = 0; i < count * 4; i++) {
        const float v = (float)src[i] * (1.0f / 65535.0f);
        dst[i] = srgb && (i & 3) != 3 ? (float)srgb_to_linear((double)v) : v;
    }
}

static void load_row(
    enum hg_pixel_format format, bool srgb, const void *pixels, uint32_t count, float *dst)
{
    if (format == HG_PIXEL_RGBA8) {
        load_rgba8(pixels, count, srgb, dst);
    } else if (format == HG_PIXEL_RGBA16) {
        load_rgba16(pixels, count, srgb, dst);
    } else {
        const float *src = pixels;
        for (size_t i = 0; i < (size_t)count * 4; i++)
            dst[i] = to_finite(src[i]);
    }
}

// To what can be summed: colours weighted by alpha, normals as vectors.
static void prepare_row(const struct hg_mip_stream_params *p, float *row)
{
    float *const end = row + (size_t)p->width * 4;
    if (p->filter == HG_MIP_NORMAL) {
        for (float *t = row; t < end; t += 4) {
            for (int c = 0; c < 3; c++)
                t[c] = t[c] * 2.0f - 1.0f;
            t[3] = sqrtf(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
        }
    } else if (p->filter == HG_MIP_WEIGHTED) {
        for (float *t = row; t < end; t += 4) {
            const float a = t[3] + ALPHA_FLOOR;
            t[0] *= a;
            t[1] *= a;
            t[2] *= a;
        }
    }
}

// --- filtering -----------------------------------------------------------------------------------

static void filter_columns(const float *src, uint32_t src_width, const struct level *l)
{
    float *dst = l->row;
    if (src_width == l->width) { // 1 texel wide
        memcpy(dst, src, (size_t)l->width * 4 * sizeof *dst);
        return;
    }
    if (src_width == l->width * 2) {
        for (uint32_t i = 0; i < l->width; i++)
            for (int c = 0; c < 4; c++)
                dst[i * 4 + c] = 0.5f * (src[i * 8 + c] + src[i * 8 + 4 + c]);
        return;
    }
    for (uint32_t i = 0; i < l->width; i++) {
        const struct taps *t = &l->columns[i];
        for (int c = 0; c < 4; c++) {
            float sum = 0.0f;
            for (uint32_t k = 0; k < t->count; k++)
                sum += t->weights[k] * src[(t->first + k) * 4 + c];
            dst[i * 4 + c] = sum;
        }
    }
}

// --- floats to texels ----------------------------------------------------------------------------

static void resolve_texel(enum hg_mip_filter filter, const float in[4], float out[4])
{
    memcpy(out, in, 4 * sizeof *out);
    if (filter == HG_MIP_NORMAL) {
        const float length2 = in[0] * in[0] + in[1] * in[1] + in[2] * in[2];
        const float scale = length2 > 1e-12f ? 0.5f / sqrtf(length2) : 0.0f;
        out[0] = in[0] * scale + 0.5f;
        out[1] = in[1] * scale + 0.5f;
        out[2] = length2 > 1e-12f ? in[2] * scale + 0.5f : 1.0f;
        out[3] = 1.0f;
    } else if (filter == HG_MIP_WEIGHTED) {
        const float scale = 1.0f / (in[3] + ALPHA_FLOOR);
        for (int c = 0; c < 3; c++)
            out[c] = in[c] * scale;
    }
}

static void store_half(const float *row, uint32_t width, enum hg_mip_filter filter, uint16_t *dst)
{
    for (uint32_t i = 0; i < width; i++, row += 4, dst += 4) {
        float v[4];
        resolve_texel(filter, row, v);
        for (int c = 0; c < 4; c++)
            dst[c] = hg_half_from_float(v[c]);
    }
}

static void store_rgba8(
    const float *row, uint32_t width, enum hg_mip_filter filter, bool srgb, uint8_t *dst)
{
    for (uint32_t i = 0; i < width; i++, row += 4, dst += 4) {
        float v[4];
        resolve_texel(filter, row, v);
        for (int c = 0; c < 3; c++)
            dst[c] = srgb ? encode_srgb(v[c]) : encode_unorm(v[c]);
        dst[3] = encode_unorm(v[3]);
    }
}

static enum hg_status encode_row(
    struct hg_mip_stream *s, uint32_t mip, uint32_t y, const float *row)
{
    const struct hg_mip_stream_params *p = &s->params;
    const uint32_t width = s->levels[mip].width;
    if (s->texel_bytes == 8)
        store_half(row, width, p->filter, s->encoded);
    else
        store_rgba8(row, width, p->filter, p->srgb, s->encoded);
    return p->row(p->user, mip, y, s->encoded);
}

// --- what normals lose ---------------------------------------------------------------------------

// Squared change per texel between two mean normals that lie `distance` texels apart. A mean normal
// is the sum of vectors over the sum of their lengths (the fourth float).
static float squared_slope(const float *a, const float *b, uint32_t distance)
{
    if (distance == 0 || a[3] < 1e-6f || b[3] < 1e-6f)
        return 0.0f;
    float sum = 0.0f;
    for (int c = 0; c < 3; c++) {
        const float d = b[c] / b[3] - a[c] / a[3];
        sum += d * d;
    }
    return sum / (float)(distance * distance);
}

// 1 - sqrt(2 / kappa) of the normals under a texel, without the variation that linear filtering
// between its neighbours brings back (a ramp of slope g has g^2 / 12 within a texel).
static float kept_width(const float *texel, float slope2)
{
    if (texel[3] < 1e-6f)
        return 1.0f;
    const float length2 = texel[0] * texel[0] + texel[1] * texel[1] + texel[2] * texel[2];
    float lost = 1.0f - length2 / (texel[3] * texel[3]) - slope2 * (1.0f / 12.0f);
    lost = lost > 0.0f ? lost : 0.0f;
    const float r2 = lost < 1.0f ? 1.0f - lost : 0.0f;
    const float width2 = 2.0f * lost / (sqrtf(r2) * (3.0f - r2) + 1e-6f);
    return width2 < 1.0f ? 1.0f - sqrtf(width2) : 0.0f;
}

static uint32_t code_of_width(const struct hg_mip_stream *s, float width)
{
    return s->texel_bytes == 8 ? hg_half_from_float(width) : encode_unorm(width);
}

static enum hg_status give_normals(struct hg_mip_stream *s, uint32_t mip, uint32_t y)
{
    const struct hg_mip_stream_params *p = &s->params;
    const struct level *l = &s->levels[mip];
    const size_t pitch = (size_t)l->width * 4;
    const uint32_t above = y > 0 ? y - 1 : y, below = y + 1 < l->height ? y + 1 : y;
    const float *row = l->ring + y % 3 * pitch, *up = l->ring + above % 3 * pitch,
                *down = l->ring + below % 3 * pitch;
    if (s->texel_bytes == 8)
        store_half(row, l->width, p->filter, s->encoded);
    else
        store_rgba8(row, l->width, p->filter, p->srgb, s->encoded);
    for (uint32_t x = 0; x < l->width; x++) {
        const uint32_t left = x > 0 ? x - 1 : x, right = x + 1 < l->width ? x + 1 : x;
        const float slope2 = squared_slope(row + left * 4, row + right * 4, right - left) +
                             squared_slope(up + x * 4, down + x * 4, below - above);
        const uint32_t code = code_of_width(s, kept_width(row + x * 4, slope2));
        if (s->texel_bytes == 8)
            ((uint16_t *)s->encoded)[x * 4 + 3] = (uint16_t)code;
        else
            ((uint8_t *)s->encoded)[x * 4 + 3] = (uint8_t)code;
    }
    return p->row(p->user, mip, y, s->encoded);
}

// Normals wait for the row below.
static enum hg_status give_row(struct hg_mip_stream *s, uint32_t mip)
{
    const struct level *l = &s->levels[mip];
    if (l->ring == NULL)
        return encode_row(s, mip, l->y, l->row);
    const size_t pitch = (size_t)l->width * 4;
    memcpy(l->ring + l->y % 3 * pitch, l->row, pitch * sizeof *l->row);
    enum hg_status status = l->y > 0 ? give_normals(s, mip, l->y - 1) : HG_OK;
    if (status == HG_OK && l->y + 1 == l->height)
        status = give_normals(s, mip, l->y);
    return status;
}

// --- the stream ----------------------------------------------------------------------------------

// Adds row y of the mip above to mip `mip`; the rows that it completes go on downwards. A row lies
// under at most two rows of the next mip. The depth is that of the chain.
static enum hg_status add_row(
    struct hg_mip_stream *s, uint32_t mip, uint32_t y, const float *row, uint32_t width)
{
    struct level *l = &s->levels[mip];
    const uint32_t above = hg_mips_side(s->params.height, mip - 1);
    const size_t n = (size_t)width * 4;
    while (l->y < l->height && y >= l->taps.first) {
        const uint32_t k = y - l->taps.first;
        if (k == 0)
            memset(l->sum, 0, n * sizeof *l->sum);
        const float weight = l->taps.weights[k];
        for (size_t i = 0; i < n; i++)
            l->sum[i] += weight * row[i];
        if (k + 1 < l->taps.count)
            break;
        filter_columns(l->sum, width, l);
        enum hg_status status = give_row(s, mip);
        if (status == HG_OK && mip + 1 < s->count)
            status = add_row(s, mip + 1, l->y, l->row, l->width);
        if (status != HG_OK)
            return status;
        l->y++;
        if (l->y < l->height)
            l->taps = taps_at(l->y, above, l->height);
    }
    return HG_OK;
}

// Mip 0 of normals has lost nothing, whatever the file has as alpha.
static void clear_variance(struct hg_mip_stream *s, const void *texels)
{
    const uint32_t width = s->params.width;
    if (texels != s->encoded)
        memcpy(s->encoded, texels, (size_t)width * s->texel_bytes);
    for (uint32_t i = 0; i < width; i++) {
        if (s->texel_bytes == 8)
            ((uint16_t *)s->encoded)[i * 4 + 3] = 0x3c00; // 1
        else
            ((uint8_t *)s->encoded)[i * 4 + 3] = 255;
    }
}

enum hg_status hg_mip_stream_push(struct hg_mip_stream *s, const void *pixels)
{
    const struct hg_mip_stream_params *p = &s->params;
    const void *texels = pixels;
    if (s->texel_bytes == 8 || s->count > 1)
        load_row(p->format, p->srgb, pixels, p->width, s->top);
    if (s->texel_bytes == 8) {
        store_half(s->top, p->width, HG_MIP_PLAIN, s->encoded);
        texels = s->encoded;
    }
    if (p->filter == HG_MIP_NORMAL) {
        clear_variance(s, texels);
        texels = s->encoded;
    }
    const uint32_t y = s->y++;
    const enum hg_status status = p->row(p->user, 0, y, texels);
    if (status != HG_OK || s->count == 1)
        return status;
    prepare_row(p, s->top);
    return add_row(s, 1, y, s->top, p->width);
}

static bool init_level(struct hg_mip_stream *s, uint32_t mip)
{
    struct level *l = &s->levels[mip];
    const uint32_t src_width = hg_mips_side(s->params.width, mip - 1);
    l->width = hg_mips_side(s->params.width, mip);
    l->height = hg_mips_side(s->params.height, mip);
    l->taps = taps_at(0, hg_mips_side(s->params.height, mip - 1), l->height);
    l->sum = hg_calloc((size_t)src_width * 4, sizeof *l->sum);
    l->row = hg_calloc((size_t)l->width * 4, sizeof *l->row);
    const bool normals = s->params.filter == HG_MIP_NORMAL;
    if (normals)
        l->ring = hg_calloc((size_t)l->width * 12, sizeof *l->ring);
    if (l->sum == NULL || l->row == NULL || (normals && l->ring == NULL))
        return false;
    if (src_width == l->width || src_width == l->width * 2)
        return true;
    l->columns = hg_calloc(l->width, sizeof *l->columns);
    for (uint32_t i = 0; l->columns != NULL && i < l->width; i++)
        l->columns[i] = taps_at(i, src_width, l->width);
    return l->columns != NULL;
}

enum hg_status hg_mip_stream_create(
    const struct hg_mip_stream_params *params, struct hg_mip_stream **out)
{
    *out = NULL;
    const uint32_t w = params->width, h = params->height;
    if (w == 0 || h == 0 || w > HG_MIPS_SIDE_PX || h > HG_MIPS_SIDE_PX)
        return HG_E_INVAL;
    pthread_once(&tables_once, make_tables);
    struct hg_mip_stream *s = hg_calloc(1, sizeof *s);
    if (s == NULL)
        return HG_E_NOMEM;
    s->params = *params;
    s->count = hg_mips_count(w, h);
    s->texel_bytes = hg_mips_texel_bytes(params->format, params->half);
    s->top = hg_calloc((size_t)w * 4, sizeof *s->top);
    s->encoded = hg_calloc(w, s->texel_bytes);
    bool good = s->top != NULL && s->encoded != NULL;
    for (uint32_t i = 1; good && i < s->count; i++)
        good = init_level(s, i);
    if (!good) {
        hg_mip_stream_destroy(s);
        return HG_E_NOMEM;
    }
    *out = s;
    return HG_OK;
}

void hg_mip_stream_destroy(struct hg_mip_stream *s)
{
    if (s == NULL)
        return;
    for (uint32_t i = 0; i < HG_MIPS_MAX; i++) {
        hg_free(s->levels[i].columns);
        hg_free(s->levels[i].sum);
        hg_free(s->levels[i].row);
        hg_free(s->levels[i].ring);
    }
    hg_free(s->top);
    hg_free(s->encoded);
    hg_free(s);
}

void hg_mips_to_half(
    enum hg_pixel_format format, bool srgb, const void *pixels, size_t count, uint16_t *dst)
{
    pthread_once(&tables_once, make_tables);
    const uint8_t *src = pixels;
    for (size_t done = 0; done < count;) {
        float row[64 * 4];
        const uint32_t some = count - done < 64 ? (uint32_t)(count - done) : 64;
        load_row(format, srgb, src + done * hg_pixel_bytes(format), some, row);
        store_half(row, some, HG_MIP_PLAIN, dst + done * 4);
        done += some;
    }
}

// --- masks ---------------------------------------------------------------------------------------

static uint64_t count_all(const uint64_t histogram[256])
{
    uint64_t count = 0;
    for (int a = 0; a < 256; a++)
        count += histogram[a];
    return count;
}

static float coverage_of(const uint64_t histogram[256], float cutoff)
{
    uint64_t passed = 0;
    for (int a = 0; a < 256; a++)
        if ((float)a * (1.0f / 255.0f) >= cutoff)
            passed += histogram[a];
    return (float)passed / (float)count_all(histogram);
}

void hg_mips_mask_table(
    const uint64_t top[256], const uint64_t mip[256], float cutoff, uint8_t table[256])
{
    const double want = (double)coverage_of(top, cutoff) * (double)count_all(mip);
    uint64_t passed = 0;
    int best = 256;
    double best_gap = want; // nothing passes
    for (int a = 255; a > 0; a--) {
        passed += mip[a];
        const double gap = fabs((double)passed - want);
        if (gap < best_gap) {
            best_gap = gap;
            best = a;
        }
    }
    const float scale = cutoff * 255.0f / ((float)best - 0.25f);
    for (int a = 0; a < 256; a++)
        table[a] = encode_unorm((float)a * (1.0f / 255.0f) * scale);
}
