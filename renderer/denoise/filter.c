// filter.c - weighted means over windows of pixels, with weights from patches and features.
#include <math.h>
#include <stdatomic.h>

#include "base/alloc.h"
#include "base/simd.h"
#include "renderer/denoise/internal.h"

enum {
    TILE_X = 32, // px that are filtered together, so that patch distances stay in the cache
    TILE_Y = 8,
    MOST_PATCH = 3,
    SETS = 2 * HG_DN_KINDS,
    WIDE = TILE_X + 2 * MOST_PATCH,
    TALL = TILE_Y + 2 * MOST_PATCH,
    TERMS = 4,                        // of the model: 1 and the normal
    MATRIX = TERMS * (TERMS + 1) / 2, // its upper triangle
};

// Similarity of features.
#define NORMAL_REACH    0.25f // of unit normals
#define DISPARITY_REACH 0.02f // of the disparity itself
#define SLOPE_REACH     0.25f // of what the surface's slope explains
#define SEEN_SCALE      0.3f  // of squared differences of disparity, for light that is mirrored
#define TONE_REACH      0.3f  // of the larger albedo
#define ROUGH_REACH     0.15f
#define RIDGE           0.02f // what a slope along the normal has to be worth, as variance of normals

struct tile {
    float distance[SETS][TALL][WIDE]; // of pixels, then of patches
    float rows[TALL][WIDE];
    float lobe[HG_DN_LOBES][TILE_Y][TILE_X]; // weights by features
    float matrix[SETS][MATRIX][TILE_Y][TILE_X];
    float right[SETS][TERMS][3][TILE_Y][TILE_X];
};

struct work {
    const struct hg_dn_planes *p;
    const struct hg_dn_filter *f;
    uint32_t columns;
    atomic_bool failed;
};

// Approximates exp(-x); 0 from x = 8 on.
static inline float falloff(float x)
{
    const float low = x > 0.0f ? x : 0.0f;
    const float y = 1.0f - (low < 8.0f ? low : 8.0f) * 0.125f;
    const float y2 = y * y, y4 = y2 * y2;
    return y4 * y4;
}

// --- patches -------------------------------------------------------------------------------------

// Squared difference of two pixels minus its expected variance, in units of the variance.
HG_SIMD_LOOP static void pixel_distances(
    const struct work *w, struct tile *t, int set, size_t at, ptrdiff_t to)
{
    const int patch = w->f->patch;
    const float *restrict guide = w->f->guide[set / 2][set % 2];
    const float *restrict variance = w->f->variance[set / 2];
    const float k2 = w->f->strength * w->f->strength;
    for (int y = 0; y < TILE_Y + 2 * patch; y++) {
        const size_t row = at + (size_t)((y - patch) * (ptrdiff_t)w->p->stride) - (size_t)patch;
        const float *restrict a = guide + row, *restrict b = guide + row + (size_t)to;
        const float *restrict va = variance + row, *restrict vb = variance + row + (size_t)to;
        float *restrict out = t->distance[set][y];
        for (int x = 0; x < TILE_X + 2 * patch; x++) {
            const float d = a[x] - b[x], least = va[x] < vb[x] ? va[x] : vb[x];
            const float floor = 1e-6f * (a[x] * a[x] + b[x] * b[x]) + 1e-12f;
            out[x] = (d * d - va[x] - least) / (k2 * (va[x] + vb[x]) + floor);
        }
    }
}

// Means over patches, in place: the result of pixel (x, y) of the tile lies there.
HG_SIMD_LOOP static void patch_distances(const struct work *w, struct tile *t, int set)
{
    const int patch = w->f->patch, side = 2 * patch + 1;
    const float scale = 1.0f / (float)(side * side);
    for (int y = 0; y < TILE_Y + 2 * patch; y++) {
        const float *restrict in = t->distance[set][y];
        float *restrict out = t->rows[y];
        for (int x = 0; x < TILE_X; x++)
            out[x] = in[x];
        for (int i = 1; i < side; i++) {
            for (int x = 0; x < TILE_X; x++)
                out[x] += in[x + i];
        }
    }
    for (int y = 0; y < TILE_Y; y++) {
        float *restrict out = t->distance[set][y];
        for (int x = 0; x < TILE_X; x++)
            out[x] = t->rows[y][x];
        for (int i = 1; i < side; i++) {
            for (int x = 0; x < TILE_X; x++)
                out[x] += t->rows[y + i][x];
        }
        HG_SIMD_APART
        for (int x = 0; x < TILE_X; x++)
            out[x] = falloff(out[x] * scale);
    }
}

// --- features ------------------------------------------------------------------------------------

static inline float least(float a, float b)
{
    return a < b ? a : b;
}

static inline float most(float a, float b)
{
    return a > b ? a : b;
}

HG_SIMD_LOOP static void feature_weights(
    const struct hg_dn_planes *p, struct tile *t, int lobe, size_t at, int dx, int dy)
{
    const struct hg_dn_face *face = &p->face[lobe];
    const ptrdiff_t to = dy * (ptrdiff_t)p->stride + dx;
    const float length = sqrtf((float)(dx * dx + dy * dy));
    const float near = lobe == HG_DN_MIRRORS ? SEEN_SCALE : 1.0f;
    const float rough_scale = lobe == HG_DN_MIRRORS ? 1.0f / (ROUGH_REACH * ROUGH_REACH) : 0.0f;
    for (int y = 0; y < TILE_Y; y++) {
        const size_t row = at + (size_t)y * p->stride;
        const float *n0 = face->normal[0] + row, *n1 = face->normal[1] + row;
        const float *n2 = face->normal[2] + row, *nv = face->normal_var + row;
        const float *z = face->disparity + row, *zv = face->disparity_var + row;
        const float *zx = face->disparity_dx + row, *zy = face->disparity_dy + row;
        const float *tone = face->tone + row, *tv = face->tone_var + row;
        const float *rough = p->roughness + row, *seen = p->seen + row;
        float *restrict out = t->lobe[lobe][y];
        HG_SIMD_APART
        for (int x = 0; x < TILE_X; x++) {
            const ptrdiff_t q = x + to;
            const float a = n0[x] - n0[q], b = n1[x] - n1[q], c = n2[x] - n2[q];
            float d = most(a * a + b * b + c * c - nv[x] - least(nv[x], nv[q]), 0.0f) /
                      (NORMAL_REACH * NORMAL_REACH + nv[x]);
            const float step = zx[x] * (float)dx + zy[x] * (float)dy;
            const float off = z[q] - z[x] - step;
            const float reach = DISPARITY_REACH * z[x] +
                                SLOPE_REACH * (fabsf(zx[x]) + fabsf(zy[x])) * length + 1e-12f;
            d += near * most(off * off - zv[x] - least(zv[x], zv[q]), 0.0f) /
                 (reach * reach + zv[x]);
            const float e = tone[x] - tone[q], r = rough[x] - rough[q];
            const float m = TONE_REACH * most(tone[x], tone[q]);
            d += most(e * e - tv[x] - least(tv[x], tv[q]), 0.0f) / (m * m + tv[x] + 1e-6f);
            out[x] = seen[q] * falloff(d + r * r * rough_scale);
        }
    }
}

// --- sums ----------------------------------------------------------------------------------------

// Adds one neighbour of each pixel. Cross-filtering: the light of a half is weighted by the other.
HG_SIMD_LOOP static void add(const struct work *w, struct tile *t, int set, size_t at, ptrdiff_t to)
{
    const struct hg_dn_planes *p = w->p;
    const struct hg_dn_light *light = &p->light[set / 2][set % 2];
    const int other = p->halves ? set ^ 1 : set;
    for (int y = 0; y < TILE_Y; y++) {
        const size_t row = at + (size_t)y * p->stride, q = row + (size_t)to;
        const float *patch = t->distance[other][y], *lobe = t->lobe[hg_dn_lobe(set / 2)][y];
        float f[TERMS][TILE_X], wf[TERMS][TILE_X];
        for (int x = 0; x < TILE_X; x++) {
            f[0][x] = 1.0f;
            wf[0][x] = patch[x] * lobe[x];
        }
        for (int i = 1; i < TERMS; i++) {
            const float *n = p->face[hg_dn_lobe(set / 2)].normal[i - 1];
            for (int x = 0; x < TILE_X; x++) {
                f[i][x] = n[q + (size_t)x] - n[row + (size_t)x];
                wf[i][x] = wf[0][x] * f[i][x];
            }
        }
        int k = 0;
        for (int i = 0; i < TERMS; i++) {
            for (int j = i; j < TERMS; j++, k++) {
                float *restrict sum = t->matrix[set][k][y];
                for (int x = 0; x < TILE_X; x++)
                    sum[x] += wf[i][x] * f[j][x];
            }
            for (int j = 0; j < 3; j++) {
                const float *restrict c = light->rgb[j] + q;
                float *restrict sum = t->right[set][i][j][y];
                for (int x = 0; x < TILE_X; x++)
                    sum[x] += wf[i][x] * c[x];
            }
        }
    }
}

// --- solving -------------------------------------------------------------------------------------

// Cholesky's decomposition of the normal equations; the value at the pixel itself is the model's
// constant term. Ridge: without normals that differ, the mean.
static void solve(const struct tile *t, int set, int y, int x, float out[3])
{
    double a[TERMS][TERMS], b[TERMS][3];
    int k = 0;
    for (int i = 0; i < TERMS; i++) {
        for (int j = i; j < TERMS; j++)
            a[i][j] = a[j][i] = (double)t->matrix[set][k++][y][x];
        for (int c = 0; c < 3; c++)
            b[i][c] = (double)t->right[set][i][c][y][x];
    }
    for (int i = 1; i < TERMS; i++)
        a[i][i] += (double)RIDGE * a[0][0];
    // Eliminates from the last term on, so that the first row is left with the constant.
    for (int i = TERMS - 1; i > 0; i--) {
        for (int r = 0; r < i; r++) {
            const double factor = a[r][i] / a[i][i];
            for (int j = 0; j < i; j++)
                a[r][j] -= factor * a[i][j];
            for (int c = 0; c < 3; c++)
                b[r][c] -= factor * b[i][c];
        }
    }
    for (int c = 0; c < 3; c++)
        out[c] = a[0][0] > 0.0 ? (float)(b[0][c] / a[0][0]) : 0.0f;
}

static void finish(
    const struct work *w, const struct tile *t, int set, size_t at, int rows, int columns)
{
    const struct hg_dn_light *out = &w->f->out[set / 2][set % 2];
    for (int y = 0; y < rows; y++) {
        for (int x = 0; x < columns; x++) {
            const size_t i = at + (size_t)y * w->p->stride + (size_t)x;
            float value[3] = {0};
            if (w->p->seen[i] > 0.0f && t->matrix[set][0][y][x] > 0.0f)
                solve(t, set, y, x, value);
            for (int c = 0; c < 3; c++)
                out->rgb[c][i] = value[c] > 0.0f ? value[c] : 0.0f;
            out->luma[i] = hg_dn_luma(out->rgb[0][i], out->rgb[1][i], out->rgb[2][i]);
        }
    }
}

static void filter_tile(void *user, size_t index)
{
    struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    const struct hg_dn_rect *r = &w->f->rect;
    const uint32_t x0 = r->x + (uint32_t)(index % w->columns) * TILE_X;
    const uint32_t y0 = r->y + (uint32_t)(index / w->columns) * TILE_Y;
    const size_t at = hg_dn_at(p, x0, y0);
    const int radius = w->f->radius, sets = p->halves ? 2 : 1;
    struct tile *t = hg_calloc(1, sizeof *t);
    if (t == NULL) {
        w->failed = true;
        return;
    }
    for (int dy = -radius; dy <= radius; dy++) {
        for (int dx = -radius; dx <= radius; dx++) {
            const ptrdiff_t to = dy * (ptrdiff_t)p->stride + dx;
            for (int lobe = 0; lobe < HG_DN_LOBES; lobe++)
                feature_weights(p, t, lobe, at, dx, dy);
            for (int set = 0; set < SETS; set += 3 - sets) {
                pixel_distances(w, t, set, at, to);
                patch_distances(w, t, set);
            }
            for (int set = 0; set < SETS; set += 3 - sets)
                add(w, t, set, at, to);
        }
    }
    const uint32_t below = r->y + r->height - y0, right = r->x + r->width - x0;
    const int rows = below < TILE_Y ? (int)below : TILE_Y;
    const int columns = right < TILE_X ? (int)right : TILE_X;
    for (int set = 0; set < SETS; set += 3 - sets)
        finish(w, t, set, at, rows, columns);
    hg_free(t);
}

enum hg_status hg_dn_filter_run(
    const struct hg_dn_planes *p, struct hg_jobs *jobs, const struct hg_dn_filter *filter)
{
    const struct hg_dn_rect *r = &filter->rect;
    struct work work = {.p = p, .f = filter, .columns = (r->width + TILE_X - 1) / TILE_X};
    const size_t rows = (r->height + TILE_Y - 1) / TILE_Y;
    hg_jobs_for(jobs, rows * work.columns, filter_tile, &work);
    return work.failed ? HG_E_NOMEM : HG_OK;
}
