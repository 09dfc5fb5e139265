#include "renderer/image/metrics.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/flip.h"
#include "renderer/image/planes.h"

static const double identical_psnr_db = 999.0;
static const float flip_pixels_per_degree = 67.0f;
// The heat maps of plain differences are hottest at this difference.
static const float hottest_difference = 0.125f;

// Premultiplied colour and alpha of pixel i, not clamped.
static void raw_pixel(const struct hg_image *image, size_t i, double rgba[4])
{
    if (image->format == HG_PIXEL_RGBA8) {
        const uint8_t *p = (const uint8_t *)image->pixels + i * 4;
        for (int c = 0; c < 4; c++)
            rgba[c] = p[c] / 255.0;
    } else {
        const float *p = (const float *)image->pixels + i * 4;
        for (int c = 0; c < 4; c++)
            rgba[c] = (double)p[c];
    }
    for (int c = 0; c < 3; c++)
        rgba[c] *= rgba[3];
}

static size_t pixel_count(const struct hg_image *image)
{
    return (size_t)image->width * image->height;
}

// Which pixels count; none: all do.
struct selection {
    const uint8_t *counts; // [pixels], 0 or 1
    size_t count;          // of those that count
};

static bool is_counted(const struct selection *s, size_t i)
{
    return !s->counts || s->counts[i];
}

static double psnr(
    const struct hg_image *a, const struct hg_image *b, const struct selection *s, float *error)
{
    double sum = 0;
    for (size_t i = 0; i < pixel_count(a); i++) {
        float pa[3], pb[3], largest = 0;
        hg_display_pixel(a, i, pa);
        hg_display_pixel(b, i, pb);
        for (int c = 0; c < 3; c++) {
            float d = fabsf(pa[c] - pb[c]);
            sum += (double)d * (double)d;
            largest = fmaxf(largest, d);
        }
        error[i] = largest / hottest_difference;
    }
    double mse = sum / (3.0 * (double)s->count);
    return mse > 0 ? fmin(-10.0 * log10(mse), identical_psnr_db) : identical_psnr_db;
}

struct difference {
    double rmse, max;
};

// A difference that is not a number counts as infinite: it must never pass a test.
static double distance(double a, double b)
{
    if (a == b || (isnan(a) && isnan(b)))
        return 0;
    double d = fabs(a - b);
    return isnan(d) ? INFINITY : d;
}

// Alpha counts as a fourth channel when either picture is anywhere not opaque.
static struct difference differences(
    const struct hg_image *a, const struct hg_image *b, const struct selection *s, float *error)
{
    double color = 0, alpha = 0, max = 0;
    bool opaque = true;
    for (size_t i = 0; i < pixel_count(a); i++) {
        double pa[4], pb[4], largest = 0;
        raw_pixel(a, i, pa);
        raw_pixel(b, i, pb);
        opaque = opaque && pa[3] == 1 && pb[3] == 1;
        for (int c = 0; c < 4; c++) {
            double d = distance(pa[c], pb[c]);
            *(c < 3 ? &color : &alpha) += d * d;
            largest = fmax(largest, d);
        }
        max = fmax(max, largest);
        error[i] = (float)fmin(largest / (double)hottest_difference, 1.0);
    }
    double values = (double)s->count * (opaque ? 3 : 4);
    return (struct difference){.rmse = sqrt((color + alpha) / values), .max = max};
}

static void gaussian_taps(struct hg_taps *taps, int radius, float sigma)
{
    float sum = 0;
    taps->radius = radius;
    for (int i = -radius; i <= radius; i++)
        sum += taps->x[i + radius] = expf(-(float)(i * i) / (2.0f * sigma * sigma));
    for (int i = 0; i <= 2 * radius; i++)
        taps->y[i] = taps->x[i] /= sum;
}

enum { ssim_radius = 5 };

// Planes of the local moments; the first two hold the pictures.
struct moments {
    float *a, *b, *product, *scratch, *mean_a, *mean_b, *aa, *bb, *ab;
};

enum { moment_planes = 9 };

static void filter_product(struct moments *m, const struct hg_image *size,
    const struct hg_taps *taps, const float *p, const float *q, float *dst)
{
    for (size_t i = 0; i < pixel_count(size); i++)
        m->product[i] = p[i] * q[i];
    hg_plane_filter_add(
        dst, m->product, m->scratch, (const uint32_t[2]){size->width, size->height}, taps, 1);
}

static void local_moments(const struct hg_image *a, const struct hg_image *b, struct moments *m)
{
    struct hg_taps taps;
    gaussian_taps(&taps, ssim_radius, 1.5f);
    for (size_t i = 0; i < pixel_count(a); i++) {
        float pa[3], pb[3]; // luma of ITU-R BT.601, as in the authors' experiments
        hg_display_pixel(a, i, pa);
        hg_display_pixel(b, i, pb);
        m->a[i] = 0.299f * pa[0] + 0.587f * pa[1] + 0.114f * pa[2];
        m->b[i] = 0.299f * pb[0] + 0.587f * pb[1] + 0.114f * pb[2];
    }
    hg_plane_filter_add(
        m->mean_a, m->a, m->scratch, (const uint32_t[2]){a->width, a->height}, &taps, 1);
    hg_plane_filter_add(
        m->mean_b, m->b, m->scratch, (const uint32_t[2]){a->width, a->height}, &taps, 1);
    filter_product(m, a, &taps, m->a, m->a, m->aa);
    filter_product(m, a, &taps, m->b, m->b, m->bb);
    filter_product(m, a, &taps, m->a, m->b, m->ab);
}

// Wang, Bovik, Sheikh, Simoncelli 2004, equation 13, with K1 = 0.01, K2 = 0.03 and L = 1.
static double ssim_at(const struct moments *m, size_t i)
{
    const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    double ma = (double)m->mean_a[i], mb = (double)m->mean_b[i];
    double va = (double)m->aa[i] - ma * ma, vb = (double)m->bb[i] - mb * mb;
    double cov = (double)m->ab[i] - ma * mb;
    return (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

// Mean over the pixels whose window lies inside; over all when the picture is smaller, or when none
// of the former counts.
static double mean_ssim(const struct hg_image *size, const struct moments *m,
    const struct selection *which, float *error)
{
    bool whole = size->width <= 2 * ssim_radius || size->height <= 2 * ssim_radius;
    uint32_t margin = whole ? 0 : ssim_radius;
    double sum = 0, all = 0;
    size_t count = 0;
    for (uint32_t y = 0; y < size->height; y++)
        for (uint32_t x = 0; x < size->width; x++) {
            size_t i = (size_t)y * size->width + x;
            double s = ssim_at(m, i);
            error[i] = is_counted(which, i) ? (float)(1.0 - s) : 0.0f;
            if (!is_counted(which, i))
                continue;
            all += s;
            if (x < margin || y < margin || x >= size->width - margin || y >= size->height - margin)
                continue;
            sum += s;
            count++;
        }
    return count > 0 ? sum / (double)count : all / (double)which->count;
}

static enum hg_status ssim(const struct hg_image *a, const struct hg_image *b,
    const struct selection *s, float *error, double *value)
{
    size_t n = pixel_count(a);
    float *block = hg_planes_create(a->width, a->height, moment_planes);
    if (!block)
        return HG_E_NOMEM;
    struct moments m = {block, block + n, block + 2 * n, block + 3 * n, block + 4 * n,
        block + 5 * n, block + 6 * n, block + 7 * n, block + 8 * n};
    local_moments(a, b, &m);
    *value = mean_ssim(a, &m, s, error);
    hg_free(block);
    return HG_OK;
}

static enum hg_status flip(const struct hg_image *a, const struct hg_image *b,
    const struct selection *s, float *error, double *value)
{
    enum hg_status st = hg_flip_map(a, b, flip_pixels_per_degree, error);
    if (st)
        return st;
    double sum = 0;
    for (size_t i = 0; i < pixel_count(a); i++) {
        error[i] = is_counted(s, i) ? error[i] : 0.0f;
        sum += (double)error[i];
    }
    *value = sum / (double)s->count;
    return HG_OK;
}

static enum hg_status measure(const struct hg_image_pair *pair, const struct selection *s,
    enum hg_metric metric, float *error, double *value)
{
    switch (metric) {
    case HG_METRIC_PSNR:
        *value = psnr(pair->a, pair->b, s, error);
        return HG_OK;
    case HG_METRIC_RMSE:
        *value = differences(pair->a, pair->b, s, error).rmse;
        return HG_OK;
    case HG_METRIC_MAX:
        *value = differences(pair->a, pair->b, s, error).max;
        return HG_OK;
    case HG_METRIC_SSIM:
        return ssim(pair->a, pair->b, s, error, value);
    case HG_METRIC_FLIP:
        return flip(pair->a, pair->b, s, error, value);
    }
    return HG_E_INVAL;
}

static bool comparable(const struct hg_image *a, const struct hg_image *b, struct hg_error *err)
{
    if (a->width != b->width || a->height != b->height) {
        hg_error_set(err, HG_E_INVAL, "compare", "size", "%ux%u px against %ux%u px", a->width,
            a->height, b->width, b->height);
        return false;
    }
    if (a->format != b->format || a->format == HG_PIXEL_RGBA16 || !a->pixels || !b->pixels) {
        hg_error_set(err, HG_E_INVAL, "compare", "format", "both must be RGBA8 or both RGBA32F");
        return false;
    }
    return true;
}

// ---- masks --------------------------------------------------------------------------------------

// A copy of b with the pixels of a where they do not count.
struct masked {
    struct hg_image b;
    uint8_t *counts;
};

static void masked_finish(struct masked *m)
{
    hg_image_finish(&m->b);
    hg_free(m->counts);
    *m = (struct masked){0};
}

static enum hg_status masked_init(
    struct masked *m, const struct hg_image_pair *pair, struct selection *s)
{
    const size_t pixels = pixel_count(pair->a), bytes = hg_pixel_bytes(pair->a->format);
    enum hg_status status =
        hg_image_create(pair->b->width, pair->b->height, pair->b->format, NULL, &m->b);
    m->counts = hg_calloc(pixels, 1);
    if (status || !m->counts)
        return status ? status : HG_E_NOMEM;
    s->count = 0;
    for (size_t i = 0; i < pixels; i++) {
        float luma[3];
        hg_display_pixel(pair->mask, i, luma);
        m->counts[i] = 0.2126f * luma[0] + 0.7152f * luma[1] + 0.0722f * luma[2] >= 0.5f;
        s->count += m->counts[i];
        const struct hg_image *from = m->counts[i] ? pair->b : pair->a;
        memcpy(
            (uint8_t *)m->b.pixels + i * bytes, (const uint8_t *)from->pixels + i * bytes, bytes);
    }
    m->b.has_alpha = pair->b->has_alpha;
    s->counts = m->counts;
    return HG_OK;
}

static enum hg_status check_mask(const struct hg_image_pair *pair, struct hg_error *err)
{
    const struct hg_image *mask = pair->mask, *a = pair->a;
    if (mask->width != a->width || mask->height != a->height)
        return hg_error_set(err, HG_E_INVAL, "compare", "mask", "%ux%u px for pictures of %ux%u px",
            mask->width, mask->height, a->width, a->height);
    return mask->format == HG_PIXEL_RGBA8 && mask->pixels
               ? HG_OK
               : hg_error_set(err, HG_E_INVAL, "compare", "mask", "must be RGBA8");
}

// ---- all ----------------------------------------------------------------------------------------

static enum hg_status measure_masked(const struct hg_image_pair *pair, enum hg_metric metric,
    float *error, double *value, struct hg_error *err)
{
    struct selection s = {.count = pixel_count(pair->a)};
    struct masked masked = {0};
    struct hg_image_pair use = *pair;
    enum hg_status status = HG_OK;
    if (pair->mask) {
        status = check_mask(pair, err);
        if (status)
            return status;
        status = masked_init(&masked, pair, &s);
        use.b = &masked.b;
    }
    if (!status && s.count == 0)
        status = hg_error_set(err, HG_E_INVAL, "compare", "mask", "leaves no pixel");
    else if (status || (status = measure(&use, &s, metric, error, value)) != HG_OK)
        hg_error_set(err, status, "compare", NULL, "%s", hg_status_text(status));
    masked_finish(&masked);
    return status;
}

enum hg_status hg_image_compare(const struct hg_image_pair *pair, enum hg_metric metric,
    double *value, struct hg_image *diff, struct hg_error *err)
{
    *value = 0;
    if (diff)
        *diff = (struct hg_image){0};
    if (!comparable(pair->a, pair->b, err))
        return HG_E_INVAL;
    float *error = hg_planes_create(pair->a->width, pair->a->height, 1);
    enum hg_status status = error ? measure_masked(pair, metric, error, value, err)
                                  : hg_error_set(err, HG_E_NOMEM, "compare", NULL, "no memory");
    if (!status && diff) {
        status = hg_heat_map(error, pair->a->width, pair->a->height, diff);
        if (status)
            hg_error_set(err, status, "compare", "diff", "%s", hg_status_text(status));
    }
    hg_free(error);
    if (status)
        *value = 0;
    return status;
}
