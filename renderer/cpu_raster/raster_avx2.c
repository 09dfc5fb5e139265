// raster_avx2.c - eight vertices or triangles at a time. See raster_kernel.h.
#include <stdlib.h>
#include <string.h>

#include "renderer/cpu_raster/raster_kernel.h"

#if defined(__x86_64__)

#include <immintrin.h>

#define TARGET __attribute__((target("avx2,fma")))
#define INLINE TARGET __attribute__((always_inline)) static inline

#define MANY_PIXELS  32           // in the box of a triangle that is drawn by itself
#define HUGE_SIZE    (1024 * 256) // 1/256 px: edges of longer triangles need 64 bits
#define MOST_WAITING 136          // 128 triangles, and what is stored behind them

// Triangles that may cover the centre of a pixel, waiting for company.
struct queue {
    int32_t corner[3][MOST_WAITING]; // counter-clockwise on the screen
    int32_t first_x[HG_RASTER_MOST_VERTICES], first_y[MOST_WAITING]; // px
    int32_t width[HG_RASTER_MOST_VERTICES], height[MOST_WAITING];    // px
    int32_t triangle[MOST_WAITING];
    uint32_t count;
};

bool hg_raster_has_avx2(void)
{
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}

// --- vertices ------------------------------------------------------------------------------------

struct three {
    __m256 x, y, z;
};

// Eight points of three numbers.
INLINE struct three load_points(const float *p)
{
    const __m256 a =
        _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p)), _mm_loadu_ps(p + 12), 1);
    const __m256 b =
        _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p + 4)), _mm_loadu_ps(p + 16), 1);
    const __m256 c =
        _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p + 8)), _mm_loadu_ps(p + 20), 1);
    // Of each half: a = x0 y0 z0 x1, b = y1 z1 x2 y2, c = z2 x3 y3 z3.
    const __m256 xy23 = _mm256_shuffle_ps(b, c, _MM_SHUFFLE(2, 1, 3, 2)); // x2 y2 x3 y3
    const __m256 yz01 = _mm256_shuffle_ps(a, b, _MM_SHUFFLE(1, 0, 2, 1)); // y0 z0 y1 z1
    return (struct three){_mm256_shuffle_ps(a, xy23, _MM_SHUFFLE(2, 0, 3, 0)),
        _mm256_shuffle_ps(yz01, xy23, _MM_SHUFFLE(3, 1, 2, 0)),
        _mm256_shuffle_ps(yz01, c, _MM_SHUFFLE(3, 0, 3, 1))};
}

INLINE __m256 row(const float *m, int stride, struct three p)
{
    const __m256 sum = _mm256_add_ps(_mm256_mul_ps(_mm256_broadcast_ss(m + stride), p.y),
        _mm256_mul_ps(_mm256_broadcast_ss(m + 2 * stride), p.z));
    return _mm256_add_ps(_mm256_mul_ps(_mm256_broadcast_ss(m), p.x), sum);
}

INLINE void project_eight(
    const struct hg_raster_shot *s, struct three p, struct hg_raster_vertices *out, uint32_t at)
{
    struct three r;
    r.x = _mm256_add_ps(row(s->rotate, 3, p), _mm256_broadcast_ss(&s->shift[0]));
    r.y = _mm256_add_ps(row(s->rotate + 1, 3, p), _mm256_broadcast_ss(&s->shift[1]));
    r.z = _mm256_add_ps(row(s->rotate + 2, 3, p), _mm256_broadcast_ss(&s->shift[2]));
    const __m256 x = _mm256_add_ps(row(s->project, 4, r), _mm256_broadcast_ss(&s->clip[0]));
    const __m256 y = _mm256_add_ps(row(s->project + 1, 4, r), _mm256_broadcast_ss(&s->clip[1]));
    const __m256 z = _mm256_add_ps(row(s->project + 2, 4, r), _mm256_broadcast_ss(&s->clip[2]));
    const __m256 w = _mm256_add_ps(row(s->project + 3, 4, r), _mm256_broadcast_ss(&s->clip[3]));
    const __m256 per_w = _mm256_div_ps(_mm256_set1_ps(1.0f), w);
    const __m256 half_x = _mm256_broadcast_ss(&s->half_width);
    const __m256 half_y = _mm256_broadcast_ss(&s->half_height);
    _mm256_storeu_ps(out->x + at, _mm256_fmadd_ps(_mm256_mul_ps(x, per_w), half_x, half_x));
    _mm256_storeu_ps(out->y + at, _mm256_fmadd_ps(_mm256_mul_ps(y, per_w), half_y, half_y));
    _mm256_storeu_ps(out->z + at, _mm256_mul_ps(z, per_w));
}

TARGET static void project_all(const struct hg_raster_shot *s, struct hg_raster_vertices *out)
{
    uint32_t i = 0;
    for (; i + 8 <= s->vertex_count; i += 8)
        project_eight(s, load_points(s->positions + (size_t)i * 3), out, i);
    if (i == s->vertex_count)
        return;
    float rest[24] = {0};
    memcpy(rest, s->positions + (size_t)i * 3, (size_t)(s->vertex_count - i) * 12);
    project_eight(s, load_points(rest), out, i);
}

// --- corners -------------------------------------------------------------------------------------

INLINE __m256i snap(__m256 v)
{
    return _mm256_cvtps_epi32(
        _mm256_mul_ps(_mm256_sub_ps(v, _mm256_set1_ps(0.5f)), _mm256_set1_ps(256.0f)));
}

// Corners of eight triangles: every third of 24 numbers, beginning with the k-th.
INLINE void load_corners(const uint32_t *indices, uint32_t first, __m256i corner[3])
{
    const __m256i base = _mm256_set1_epi32((int)first);
    const __m256i a = _mm256_loadu_si256((const __m256i *)(const void *)indices);
    const __m256i b = _mm256_loadu_si256((const __m256i *)(const void *)(indices + 8));
    const __m256i c = _mm256_loadu_si256((const __m256i *)(const void *)(indices + 16));
    const __m256i k0 = _mm256_blend_epi32(_mm256_blend_epi32(a, b, 0x92), c, 0x24);
    const __m256i k1 = _mm256_blend_epi32(_mm256_blend_epi32(a, b, 0x24), c, 0x49);
    const __m256i k2 = _mm256_blend_epi32(_mm256_blend_epi32(a, b, 0x49), c, 0x92);
    corner[0] = _mm256_permutevar8x32_epi32(k0, _mm256_setr_epi32(0, 3, 6, 1, 4, 7, 2, 5));
    corner[1] = _mm256_permutevar8x32_epi32(k1, _mm256_setr_epi32(1, 4, 7, 2, 5, 0, 3, 6));
    corner[2] = _mm256_permutevar8x32_epi32(k2, _mm256_setr_epi32(2, 5, 0, 3, 6, 1, 4, 7));
    for (int k = 0; k < 3; k++)
        corner[k] = _mm256_sub_epi32(corner[k], base);
}

INLINE __m256i least3(const __m256i v[3])
{
    return _mm256_min_epi32(_mm256_min_epi32(v[0], v[1]), v[2]);
}

INLINE __m256i most3(const __m256i v[3])
{
    return _mm256_max_epi32(_mm256_max_epi32(v[0], v[1]), v[2]);
}

// The second and third corner change places where the triangle runs clockwise.
INLINE void push(struct queue *q, const __m256i corner[3], __m256i clockwise, const __m256i box[4],
    uint32_t first, uint32_t mask, const uint64_t *pack)
{
    const __m256i order =
        _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)&pack[mask]));
    const __m256i number =
        _mm256_add_epi32(_mm256_set1_epi32((int)first), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    const __m256i all[8] = {corner[0], _mm256_blendv_epi8(corner[1], corner[2], clockwise),
        _mm256_blendv_epi8(corner[2], corner[1], clockwise), box[0], box[1], box[2], box[3],
        number};
    int32_t *to[8] = {q->corner[0], q->corner[1], q->corner[2], q->first_x, q->first_y, q->width,
        q->height, q->triangle};
    for (int i = 0; i < 8; i++)
        _mm256_storeu_si256(
            (__m256i *)(void *)(to[i] + q->count), _mm256_permutevar8x32_epi32(all[i], order));
    q->count += (uint32_t)__builtin_popcount(mask);
}

// Pixels whose centres lie between the corners, in the tile: first, and how many.
INLINE void span(__m256i low, __m256i high, int32_t first, int32_t end, __m256i *at, __m256i *count)
{
    const __m256i begin = _mm256_srai_epi32(_mm256_add_epi32(low, _mm256_set1_epi32(255)), 8);
    const __m256i last = _mm256_add_epi32(_mm256_srai_epi32(high, 8), _mm256_set1_epi32(1));
    *at = _mm256_max_epi32(begin, _mm256_set1_epi32(first));
    *count = _mm256_sub_epi32(_mm256_min_epi32(last, _mm256_set1_epi32(end)), *at);
}

// --- pixels --------------------------------------------------------------------------------------

struct edges {
    __m256i at[3], dx[3], dy[3];
};

INLINE void edge_of(const __m256i x[3], const __m256i y[3], int a, int b, __m256i first_x,
    __m256i first_y, struct edges *out)
{
    const __m256i dx = _mm256_sub_epi32(x[b], x[a]), dy = _mm256_sub_epi32(y[b], y[a]);
    const __m256i zero = _mm256_setzero_si256();
    const __m256i left = _mm256_cmpgt_epi32(dy, zero);
    const __m256i top =
        _mm256_and_si256(_mm256_cmpeq_epi32(dy, zero), _mm256_cmpgt_epi32(zero, dx));
    const __m256i own = _mm256_or_si256(left, top); // -1: points on the edge are inside
    const __m256i to_x = _mm256_sub_epi32(_mm256_slli_epi32(first_x, 8), x[a]);
    const __m256i to_y = _mm256_sub_epi32(_mm256_slli_epi32(first_y, 8), y[a]);
    const __m256i at = _mm256_sub_epi32(_mm256_mullo_epi32(dy, to_x), _mm256_mullo_epi32(dx, to_y));
    out->at[a] = _mm256_sub_epi32(at, _mm256_add_epi32(own, _mm256_set1_epi32(1)));
    out->dx[a] = _mm256_slli_epi32(dy, 8);
    out->dy[a] = _mm256_sub_epi32(zero, _mm256_slli_epi32(dx, 8));
}

struct planes {
    __m256 at, dx, dy;
};

INLINE struct planes depth_planes(const __m256 x[3], const __m256 y[3], const __m256 z[3])
{
    const __m256 half = _mm256_set1_ps(0.5f);
    const __m256 dx01 = _mm256_sub_ps(x[0], x[1]), dy01 = _mm256_sub_ps(y[0], y[1]);
    const __m256 dx20 = _mm256_sub_ps(x[2], x[0]), dy20 = _mm256_sub_ps(y[2], y[0]);
    const __m256 dz01 = _mm256_sub_ps(z[0], z[1]), dz20 = _mm256_sub_ps(z[2], z[0]);
    const __m256 area = _mm256_sub_ps(_mm256_mul_ps(dx01, dy20), _mm256_mul_ps(dy01, dx20));
    const __m256 per_area = _mm256_div_ps(_mm256_set1_ps(1.0f), area);
    struct planes p;
    p.dx = _mm256_sub_ps(_mm256_mul_ps(dz01, _mm256_mul_ps(dy20, per_area)),
        _mm256_mul_ps(dz20, _mm256_mul_ps(dy01, per_area)));
    p.dy = _mm256_sub_ps(_mm256_mul_ps(dz20, _mm256_mul_ps(dx01, per_area)),
        _mm256_mul_ps(dz01, _mm256_mul_ps(dx20, per_area)));
    p.at = _mm256_sub_ps(z[0], _mm256_add_ps(_mm256_mul_ps(p.dx, _mm256_sub_ps(x[0], half)),
                                   _mm256_mul_ps(p.dy, _mm256_sub_ps(y[0], half))));
    return p;
}

// Pixels that eight triangles cover, one each. places: of their keys.
INLINE void put(
    const struct hg_raster_tile *tile, __m256 depth, __m256i place, __m256i order, uint32_t mask)
{
    uint32_t bits[8], places[8], orders[8];
    _mm256_storeu_ps((float *)(void *)bits, depth);
    _mm256_storeu_si256((__m256i *)(void *)places, place);
    _mm256_storeu_si256((__m256i *)(void *)orders, order);
    for (; mask != 0; mask &= mask - 1) {
        const uint32_t i = (uint32_t)__builtin_ctz(mask);
        const uint64_t mine = (uint64_t)bits[i] << 32 | orders[i];
        uint64_t *key = &tile->keys[places[i]];
        if (mine > *key)
            *key = mine;
    }
}

INLINE __m256i load_queue(const int32_t *from)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)from);
}

TARGET static void fill_eight(const struct hg_raster_shot *s, const struct hg_raster_tile *tile,
    const struct hg_raster_vertices *v, const struct queue *q, uint32_t first, __m256i valid)
{
    __m256 fx[3], fy[3], fz[3];
    __m256i x[3], y[3];
    for (int k = 0; k < 3; k++) {
        const __m256i corner = _mm256_and_si256(load_queue(q->corner[k] + first), valid);
        fx[k] = _mm256_i32gather_ps(v->x, corner, 4);
        fy[k] = _mm256_i32gather_ps(v->y, corner, 4);
        fz[k] = _mm256_i32gather_ps(v->z, corner, 4);
        x[k] = snap(fx[k]);
        y[k] = snap(fy[k]);
    }
    const __m256i px = load_queue(q->first_x + first), py = load_queue(q->first_y + first);
    const __m256i width = _mm256_and_si256(load_queue(q->width + first), valid);
    const __m256i height = _mm256_and_si256(load_queue(q->height + first), valid);
    const __m256i order =
        _mm256_sub_epi32(_mm256_set1_epi32((int)s->order), load_queue(q->triangle + first));
    const __m256i place = _mm256_add_epi32(
        _mm256_slli_epi32(_mm256_sub_epi32(py, _mm256_set1_epi32(tile->y)), HG_RASTER_WIDE_SHIFT),
        _mm256_sub_epi32(px, _mm256_set1_epi32(tile->x)));
    struct edges e;
    for (int k = 0; k < 3; k++)
        edge_of(x, y, k, (k + 1) % 3, px, py, &e);
    const struct planes p = depth_planes(fx, fy, fz);
    const __m256 one = _mm256_set1_ps(1.0f), zero = _mm256_setzero_ps();
    for (int j = 0;; j++) {
        const __m256i rows = _mm256_cmpgt_epi32(height, _mm256_set1_epi32(j));
        if (_mm256_testz_si256(rows, rows))
            break;
        __m256i at[3] = {e.at[0], e.at[1], e.at[2]};
        const __m256 down = _mm256_cvtepi32_ps(_mm256_add_epi32(py, _mm256_set1_epi32(j)));
        for (int i = 0;; i++) {
            const __m256i columns =
                _mm256_and_si256(rows, _mm256_cmpgt_epi32(width, _mm256_set1_epi32(i)));
            if (_mm256_testz_si256(columns, columns))
                break;
            const __m256i outside = _mm256_or_si256(_mm256_or_si256(at[0], at[1]), at[2]); // sign
            const __m256 inside = _mm256_castsi256_ps(_mm256_andnot_si256(outside, columns));
            if (_mm256_movemask_ps(inside) != 0) {
                const __m256 right = _mm256_cvtepi32_ps(_mm256_add_epi32(px, _mm256_set1_epi32(i)));
                const __m256 depth =
                    _mm256_fmadd_ps(p.dy, down, _mm256_fmadd_ps(p.dx, right, p.at));
                const uint32_t mask = (uint32_t)_mm256_movemask_ps(
                    _mm256_and_ps(inside, _mm256_cmp_ps(depth, zero, _CMP_GT_OQ)));
                put(tile, _mm256_min_ps(depth, one),
                    _mm256_add_epi32(place, _mm256_set1_epi32(j * HG_RASTER_WIDE + i)), order,
                    mask);
            }
            for (int k = 0; k < 3; k++)
                at[k] = _mm256_add_epi32(at[k], e.dx[k]);
        }
        for (int k = 0; k < 3; k++)
            e.at[k] = _mm256_add_epi32(e.at[k], e.dy[k]);
    }
}

// --- one large triangle --------------------------------------------------------------------------

// Eight pixels of a row from `keys` on.
INLINE void put_row(uint64_t *keys, __m256i depth, __m256i order, __m256i inside)
{
    const __m256i low = _mm256_unpacklo_epi32(order, depth);
    const __m256i high = _mm256_unpackhi_epi32(order, depth);
    const __m256i may_low = _mm256_unpacklo_epi32(inside, inside);
    const __m256i may_high = _mm256_unpackhi_epi32(inside, inside);
    const __m256i mine[2] = {
        _mm256_permute2x128_si256(low, high, 0x20), _mm256_permute2x128_si256(low, high, 0x31)};
    const __m256i may[2] = {_mm256_permute2x128_si256(may_low, may_high, 0x20),
        _mm256_permute2x128_si256(may_low, may_high, 0x31)};
    for (int i = 0; i < 2; i++) {
        __m256i *at = (__m256i *)(void *)(keys + 4 * i);
        const __m256i old = _mm256_loadu_si256(at);
        const __m256i wins = _mm256_and_si256(may[i], _mm256_cmpgt_epi64(mine[i], old));
        _mm256_storeu_si256(at, _mm256_blendv_epi8(old, mine[i], wins));
    }
}

// Edges at the first pixel, by 256: pixels are whole numbers of 256 apart, so signs stay.
struct whole_edges {
    int32_t at[3], dx[3], dy[3];
};

static void open_edges(const int32_t x[3], const int32_t y[3], int32_t first_x, int32_t first_y,
    struct whole_edges *out)
{
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3;
        const int64_t dx = x[b] - x[a], dy = y[b] - y[a];
        const int64_t on_edge = dy > 0 || (dy == 0 && dx < 0) ? 0 : 1;
        const int64_t at = dy * (first_x * 256 - x[a]) - dx * (first_y * 256 - y[a]) - on_edge;
        out->at[a] = (int32_t)(at >> 8);
        out->dx[a] = (int32_t)dy;
        out->dy[a] = (int32_t)-dx;
    }
}

struct single {
    __m256 fx[3], fy[3], fz[3]; // px, depth; all lanes alike
    int32_t x[3], y[3];         // 1/256 px
};

static bool is_huge(const struct single *t)
{
    for (int k = 0; k < 3; k++)
        if (abs(t->x[k] - t->x[(k + 1) % 3]) > HUGE_SIZE ||
            abs(t->y[k] - t->y[(k + 1) % 3]) > HUGE_SIZE)
            return true;
    return false;
}

TARGET static void load_single(
    const struct hg_raster_vertices *v, const int32_t corner[3], struct single *out)
{
    for (int k = 0; k < 3; k++) {
        out->fx[k] = _mm256_broadcast_ss(&v->x[corner[k]]);
        out->fy[k] = _mm256_broadcast_ss(&v->y[corner[k]]);
        out->fz[k] = _mm256_broadcast_ss(&v->z[corner[k]]);
        out->x[k] = _mm256_extract_epi32(snap(out->fx[k]), 0);
        out->y[k] = _mm256_extract_epi32(snap(out->fy[k]), 0);
    }
}

// Rows of eight pixels, from a multiple of eight on. t: counter-clockwise on the screen, no longer
// than HUGE_SIZE.
TARGET static void fill_single(const struct hg_raster_shot *s, const struct hg_raster_tile *tile,
    const struct single *t, const int32_t box[4], uint32_t triangle)
{
    const struct planes p = depth_planes(t->fx, t->fy, t->fz);
    const int32_t first_x = tile->x + ((box[0] - tile->x) & ~7), end_x = box[0] + box[2];
    const __m256i steps = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256i order = _mm256_set1_epi32((int)(s->order - triangle));
    const __m256 one = _mm256_set1_ps(1.0f), zero = _mm256_setzero_ps();
    struct whole_edges e;
    open_edges(t->x, t->y, first_x, box[1], &e);
    for (int32_t j = 0; j < box[3]; j++) {
        uint64_t *keys = tile->keys + (box[1] + j - tile->y) * HG_RASTER_WIDE + (first_x - tile->x);
        const __m256 down = _mm256_set1_ps((float)(box[1] + j));
        __m256i at[3], step[3];
        for (int k = 0; k < 3; k++) {
            const __m256i dx = _mm256_set1_epi32(e.dx[k]);
            at[k] = _mm256_add_epi32(
                _mm256_set1_epi32(e.at[k] + e.dy[k] * j), _mm256_mullo_epi32(dx, steps));
            step[k] = _mm256_slli_epi32(dx, 3);
        }
        for (int32_t i = first_x; i < end_x; i += 8, keys += 8) {
            const __m256i outside = _mm256_or_si256(_mm256_or_si256(at[0], at[1]), at[2]);
            for (int k = 0; k < 3; k++)
                at[k] = _mm256_add_epi32(at[k], step[k]);
            if (_mm256_movemask_ps(_mm256_castsi256_ps(outside)) == 0xff)
                continue;
            const __m256 right = _mm256_cvtepi32_ps(_mm256_add_epi32(_mm256_set1_epi32(i), steps));
            const __m256 depth = _mm256_fmadd_ps(p.dy, down, _mm256_fmadd_ps(p.dx, right, p.at));
            const __m256 shows =
                _mm256_andnot_ps(_mm256_castsi256_ps(_mm256_srai_epi32(outside, 31)),
                    _mm256_cmp_ps(depth, zero, _CMP_GT_OQ));
            put_row(keys, _mm256_castps_si256(_mm256_min_ps(depth, one)), order,
                _mm256_castps_si256(shows));
        }
    }
}

// Lanes of eight triangles, one by one.
TARGET static void fill_each(const struct hg_raster_shot *s, const struct hg_raster_tile *tile,
    const struct hg_raster_vertices *v, const __m256i corner[3], const __m256i box[4],
    uint32_t first, uint32_t mask)
{
    int32_t corners[3][8], boxes[4][8];
    for (int k = 0; k < 3; k++)
        _mm256_storeu_si256((__m256i *)(void *)corners[k], corner[k]);
    for (int k = 0; k < 4; k++)
        _mm256_storeu_si256((__m256i *)(void *)boxes[k], box[k]);
    for (; mask != 0; mask &= mask - 1) {
        const uint32_t i = (uint32_t)__builtin_ctz(mask);
        const int32_t b[4] = {boxes[0][i], boxes[1][i], boxes[2][i], boxes[3][i]};
        int32_t c[3] = {corners[0][i], corners[1][i], corners[2][i]};
        struct single t;
        load_single(v, c, &t);
        const int64_t area = (int64_t)(t.x[0] - t.x[1]) * (t.y[2] - t.y[0]) -
                             (int64_t)(t.x[2] - t.x[0]) * (t.y[0] - t.y[1]);
        if (area == 0 || (s->sides & (area > 0 ? HG_RASTER_SHOWS_CCW : HG_RASTER_SHOWS_CW)) == 0)
            continue;
        if (area < 0)
            load_single(v, (const int32_t[]){c[0], c[2], c[1]}, &t);
        if (is_huge(&t))
            hg_raster_triangle(s, tile, v, first + i);
        else
            fill_single(s, tile, &t, b, first + i);
    }
}

// --- triangles that may show ---------------------------------------------------------------------

INLINE uint32_t mask_of(__m256i lanes)
{
    return (uint32_t)_mm256_movemask_ps(_mm256_castsi256_ps(lanes));
}

// Eight triangles, of which `valid` exist. Those of many pixels are drawn at once.
TARGET static void sort_eight(const struct hg_raster_shot *s, const struct hg_raster_tile *tile,
    const struct hg_raster_vertices *v, const uint32_t *indices, uint32_t first, __m256i valid,
    struct queue *q)
{
    __m256i corner[3], x[3], y[3], box[4];
    load_corners(indices, s->first_vertex, corner);
    for (int k = 0; k < 3; k++) {
        corner[k] = _mm256_and_si256(corner[k], valid);
        x[k] = snap(_mm256_i32gather_ps(v->x, corner[k], 4));
        y[k] = snap(_mm256_i32gather_ps(v->y, corner[k], 4));
    }
    const __m256i low_x = least3(x), high_x = most3(x), low_y = least3(y), high_y = most3(y);
    span(low_x, high_x, tile->x, tile->end_x, &box[0], &box[2]);
    span(low_y, high_y, tile->y, tile->end_y, &box[1], &box[3]);
    const __m256i zero = _mm256_setzero_si256();
    const __m256i shows = _mm256_and_si256(valid,
        _mm256_and_si256(_mm256_cmpgt_epi32(box[2], zero), _mm256_cmpgt_epi32(box[3], zero)));
    const __m256i size =
        _mm256_or_si256(_mm256_sub_epi32(high_x, low_x), _mm256_sub_epi32(high_y, low_y));
    const __m256i large =
        _mm256_or_si256(_mm256_cmpgt_epi32(size, _mm256_set1_epi32(HG_RASTER_LARGE - 1)),
            _mm256_cmpgt_epi32(_mm256_mullo_epi32(box[2], box[3]), _mm256_set1_epi32(MANY_PIXELS)));
    const __m256i area = _mm256_sub_epi32(
        _mm256_mullo_epi32(_mm256_sub_epi32(x[0], x[1]), _mm256_sub_epi32(y[2], y[0])),
        _mm256_mullo_epi32(_mm256_sub_epi32(x[2], x[0]), _mm256_sub_epi32(y[0], y[1])));
    const __m256i ccw = _mm256_cmpgt_epi32(area, zero), cw = _mm256_cmpgt_epi32(zero, area);
    const __m256i side = _mm256_or_si256((s->sides & HG_RASTER_SHOWS_CCW) != 0 ? ccw : zero,
        (s->sides & HG_RASTER_SHOWS_CW) != 0 ? cw : zero);
    const uint32_t few = mask_of(_mm256_andnot_si256(large, _mm256_and_si256(shows, side)));
    if (few != 0)
        push(q, corner, cw, box, first, few, s->pack);
    const uint32_t many = mask_of(_mm256_and_si256(large, shows));
    if (many != 0)
        fill_each(s, tile, v, corner, box, first, many);
}

// The first `count` of eight; all when there are more.
INLINE __m256i first_of(uint32_t count)
{
    return _mm256_cmpgt_epi32(
        _mm256_set1_epi32((int)(count < 8 ? count : 8)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
}

TARGET void hg_raster_avx2(const struct hg_raster_shot *s, const struct hg_raster_tile *tile)
{
    struct hg_raster_vertices v;
    struct queue q;
    q.count = 0;
    project_all(s, &v);
    for (uint32_t i = 0; i < s->count; i += 8) {
        const uint32_t left = s->count - i;
        uint32_t rest[24] = {0};
        const uint32_t *indices = s->indices + (size_t)i * 3;
        if (left < 8)
            indices = memcpy(rest, indices, (size_t)left * 12);
        sort_eight(s, tile, &v, indices, i, first_of(left), &q);
    }
    for (uint32_t i = 0; i < q.count; i += 8)
        fill_eight(s, tile, &v, &q, i, first_of(q.count - i));
}

#else

bool hg_raster_has_avx2(void)
{
    return false;
}

void hg_raster_avx2(const struct hg_raster_shot *shot, const struct hg_raster_tile *tile)
{
    hg_raster_plain(shot, tile);
}

#endif
