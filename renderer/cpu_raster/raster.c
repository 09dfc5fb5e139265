// raster.c - see raster.h. Runs are put into the tiles that their boxes touch; a job draws a tile.
#include "renderer/cpu_raster/raster.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/cpu_raster/raster_kernel.h"

#define RUNS_PER_JOB 256
#define CACHE_LINE   64
#define MARGIN_PX    1.0f // rounding of corners, here and in drivers

// What llvmpipe cuts reaches beyond twice the image or its depth: parts of the size to each side.
#define AROUND      0.4f
#define AROUND_PX   3.0f // jitter
#define LEAST_DEPTH 1e-6f
#define MOST_DEPTH  0.9999f

#define BLOCK_SHIFT 3 // of the depth that boxes are held against
#define BLOCKS_WIDE (HG_RASTER_WIDE >> BLOCK_SHIFT)
#define BLOCKS      (BLOCKS_WIDE * (HG_RASTER_HIGH >> BLOCK_SHIFT))

// Where a run is on the screen: pixels [x, end_x) x [y, end_y), none when it is outside.
struct place {
    int16_t x, y, end_x, end_y;
    float nearest; // depth
};

struct hg_raster {
    hg_raster_kernel *kernel;
    bool fused;
    uint64_t pack[256];
    struct place *places; // [runs]
    size_t place_capacity;
    uint32_t *firsts; // [tiles + 1] into list
    size_t first_capacity;
    uint32_t *list; // runs of tiles
    size_t list_capacity;
};

struct hg_raster *hg_raster_create(bool portable)
{
    struct hg_raster *r = hg_calloc(1, sizeof *r);
    if (r == NULL)
        return NULL;
    r->kernel = !portable && hg_raster_has_avx2() ? hg_raster_avx2 : hg_raster_plain;
    r->fused = hg_raster_has_fma();
    for (uint32_t m = 0; m < 256; m++)
        for (uint32_t bit = 0, place = 0; bit < 8; bit++)
            if ((m >> bit & 1u) != 0)
                r->pack[m] |= (uint64_t)bit << (8 * place++);
    return r;
}

void hg_raster_destroy(struct hg_raster *r)
{
    if (r == NULL)
        return;
    hg_free(r->places);
    hg_free(r->firsts);
    hg_free(r->list);
    hg_free(r);
}

// --- boxes ---------------------------------------------------------------------------------------

void hg_raster_open(
    const struct hg_raster_view *view, const struct hg_mat4x3 *world, struct hg_raster_rows *out)
{
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 4; c++) {
            double sum = c == 3 ? (double)view->clip[r] : 0.0;
            for (int i = 0; i < 3; i++) {
                const double at =
                    (double)world->m[c * 3 + i] - (c == 3 ? (double)view->eye[i] : 0.0);
                sum += (double)view->view_proj[i * 4 + r] * at;
            }
            out->m[r][c] = (float)sum;
        }
}

// Of the corners of a box: least and most of x / w, y / w and z / w, and the least w.
struct reach {
    float low[3], high[3], least_w;
};

static void project_box(const struct hg_raster_rows *rows, const float center[3],
    const float extent[3], struct reach *out)
{
    float clip[4][8];
    for (int r = 0; r < 4; r++) {
        const float *m = rows->m[r];
        const float middle = m[0] * center[0] + m[1] * center[1] + m[2] * center[2] + m[3];
        for (int i = 0; i < 8; i++)
            clip[r][i] = middle + (i & 1 ? m[0] : -m[0]) * extent[0] +
                         (i & 2 ? m[1] : -m[1]) * extent[1] + (i & 4 ? m[2] : -m[2]) * extent[2];
    }
    out->least_w = FLT_MAX;
    for (int r = 0; r < 3; r++) {
        out->low[r] = FLT_MAX;
        out->high[r] = -FLT_MAX;
        for (int i = 0; i < 8; i++) {
            const float at = clip[r][i] / clip[3][i];
            out->low[r] = at < out->low[r] ? at : out->low[r];
            out->high[r] = at > out->high[r] ? at : out->high[r];
        }
    }
    for (int i = 0; i < 8; i++)
        out->least_w = clip[3][i] < out->least_w ? clip[3][i] : out->least_w;
}

bool hg_raster_takes(const struct hg_raster_view *view, const struct hg_raster_rows *rows,
    const float center[3], const float extent[3])
{
    struct reach reach;
    project_box(rows, center, extent, &reach);
    const float most_x = 1.0f + 2.0f * (AROUND - AROUND_PX / (float)view->width);
    const float most_y = 1.0f + 2.0f * (AROUND - AROUND_PX / (float)view->height);
    return reach.least_w > 0.0f && reach.low[0] > -most_x && reach.high[0] < most_x &&
           reach.low[1] > -most_y && reach.high[1] < most_y && reach.low[2] > LEAST_DEPTH &&
           reach.high[2] < MOST_DEPTH;
}

// --- one picture ---------------------------------------------------------------------------------

struct picture {
    struct hg_raster *raster;
    const struct hg_raster_view *view;
    const struct hg_raster_run *runs;
    uint32_t count, tiles_x, tiles_y;
    const struct hg_raster_target *target;
    uint8_t *marks;
};

// Pixels between two places in clip space; clamped to the image.
static int16_t pixel_of(float at, float size, float margin)
{
    const float px = floorf((at * 0.5f + 0.5f) * size + margin);
    return (int16_t)(px < 0.0f ? 0.0f : px > size ? size : px);
}

static void place_runs(void *user, size_t job)
{
    const struct picture *p = user;
    const float width = (float)p->view->width, height = (float)p->view->height;
    const uint32_t first = (uint32_t)job * RUNS_PER_JOB;
    const uint32_t end = first + RUNS_PER_JOB < p->count ? first + RUNS_PER_JOB : p->count;
    struct hg_raster_rows rows;
    for (uint32_t i = first; i < end; i++) {
        const struct hg_raster_run *run = &p->runs[i];
        struct reach reach;
        if (i == first || run->draw != run[-1].draw)
            hg_raster_open(p->view, run->world, &rows);
        project_box(&rows, run->center, run->extent, &reach);
        p->raster->places[i] = (struct place){.x = pixel_of(reach.low[0], width, -MARGIN_PX),
            .y = pixel_of(reach.low[1], height, -MARGIN_PX),
            .end_x = pixel_of(reach.high[0], width, MARGIN_PX + 1.0f),
            .end_y = pixel_of(reach.high[1], height, MARGIN_PX + 1.0f),
            .nearest = reach.high[2] + 1e-4f * reach.high[2]};
    }
}

struct tiles {
    uint32_t x, y, end_x, end_y;
};

static struct tiles tiles_of(const struct place *p)
{
    if (p->x >= p->end_x || p->y >= p->end_y)
        return (struct tiles){0};
    return (struct tiles){(uint32_t)p->x >> HG_RASTER_WIDE_SHIFT,
        (uint32_t)p->y >> HG_RASTER_HIGH_SHIFT,
        ((uint32_t)(p->end_x - 1) >> HG_RASTER_WIDE_SHIFT) + 1,
        ((uint32_t)(p->end_y - 1) >> HG_RASTER_HIGH_SHIFT) + 1};
}

// Lists of the runs of each tile, in draw order.
static enum hg_status bin(const struct picture *p)
{
    struct hg_raster *r = p->raster;
    const size_t tiles = (size_t)p->tiles_x * p->tiles_y;
    enum hg_status status = hg_grow(&r->firsts, &r->first_capacity, tiles + 2, sizeof *r->firsts);
    if (status != HG_OK)
        return status;
    memset(r->firsts, 0, (tiles + 2) * sizeof *r->firsts);
    for (int pass = 0; pass < 2 && status == HG_OK; pass++) {
        for (uint32_t i = 0; i < p->count; i++) {
            const struct tiles t = tiles_of(&r->places[i]);
            for (uint32_t y = t.y; y < t.end_y; y++)
                for (uint32_t x = t.x; x < t.end_x; x++) {
                    uint32_t *at = &r->firsts[(size_t)y * p->tiles_x + x + (pass == 0 ? 2 : 1)];
                    if (pass == 1)
                        r->list[*at] = i;
                    ++*at;
                }
        }
        for (size_t t = 0; t < tiles && pass == 0; t++)
            r->firsts[t + 2] += r->firsts[t + 1];
        if (pass == 0)
            status = hg_grow(
                &r->list, &r->list_capacity, (size_t)r->firsts[tiles + 1] + 1, sizeof *r->list);
    }
    return status;
}

// --- a tile --------------------------------------------------------------------------------------

static void fill_draw(
    const struct picture *p, const struct hg_raster_run *run, struct hg_raster_shot *s)
{
    const struct hg_raster_view *view = p->view;
    memcpy(s->rotate, run->world->m, sizeof s->rotate);
    for (int i = 0; i < 3; i++)
        s->shift[i] = run->world->m[9 + i] - view->eye[i];
    memcpy(s->project, view->view_proj, sizeof s->project);
    memcpy(s->clip, view->clip, sizeof s->clip);
    s->half_width = 0.5f * (float)view->width;
    s->half_height = 0.5f * (float)view->height;
    s->sides = run->both_sides ? HG_RASTER_SHOWS_CCW | HG_RASTER_SHOWS_CW
               : run->mirrored ? HG_RASTER_SHOWS_CW
                               : HG_RASTER_SHOWS_CCW;
    s->fused = p->raster->fused;
    s->pack = p->raster->pack;
}

// Vertices of a run that lie too far apart, one for each corner.
struct apart {
    float positions[HG_RASTER_MOST_VERTICES * 3];
    uint32_t indices[HG_RASTER_MOST_VERTICES];
};

static void take_apart(const struct hg_raster_run *run, struct apart *to, struct hg_raster_shot *s)
{
    for (uint32_t i = 0; i < run->count * 3; i++) {
        memcpy(to->positions + (size_t)i * 3, run->positions + (size_t)run->indices[i] * 3, 12);
        to->indices[i] = i;
    }
    s->positions = to->positions;
    s->indices = to->indices;
    s->first_vertex = 0;
    s->vertex_count = run->count * 3;
}

// Vertices of a run.
struct range {
    uint32_t low, high;
};

static struct range range_of(const struct hg_raster_run *run)
{
    struct range r = {UINT32_MAX, 0};
    for (uint32_t i = 0; i < run->count * 3; i++) {
        r.low = run->indices[i] < r.low ? run->indices[i] : r.low;
        r.high = run->indices[i] > r.high ? run->indices[i] : r.high;
    }
    return r;
}

static void draw_run(const struct picture *p, uint32_t index, struct range range,
    const struct hg_raster_tile *tile, struct hg_raster_shot *s)
{
    const struct hg_raster_run *run = &p->runs[index];
    struct apart apart;
    fill_draw(p, run, s);
    s->indices = run->indices;
    s->count = run->count;
    s->order = UINT32_MAX - index * HG_RASTER_MOST_TRIANGLES;
    s->first_vertex = range.low;
    s->vertex_count = range.high - range.low + 1;
    s->positions = run->positions + (size_t)range.low * 3;
    if (s->vertex_count > HG_RASTER_MOST_VERTICES)
        take_apart(run, &apart, s);
    p->raster->kernel(s, tile);
}

static void fetch(const void *from, size_t bytes)
{
    for (size_t i = 0; i < bytes; i += CACHE_LINE)
        __builtin_prefetch((const uint8_t *)from + i);
}

// Farthest depth of blocks of pixels; what lies outside of the image hides.
static void reduce(const struct hg_raster_tile *tile, float blocks[BLOCKS])
{
    for (int i = 0; i < BLOCKS; i++)
        blocks[i] = 1.0f;
    for (int32_t y = tile->y; y < tile->end_y; y++) {
        const uint64_t *row = tile->keys + (size_t)(y - tile->y) * HG_RASTER_WIDE;
        float *to = blocks + ((y - tile->y) >> BLOCK_SHIFT) * BLOCKS_WIDE;
        for (int32_t x = 0; x < tile->end_x - tile->x; x++) {
            const uint32_t bits = (uint32_t)(row[x] >> 32);
            float depth;
            memcpy(&depth, &bits, 4);
            to[x >> BLOCK_SHIFT] = depth < to[x >> BLOCK_SHIFT] ? depth : to[x >> BLOCK_SHIFT];
        }
    }
}

static bool is_hidden(
    const struct hg_raster_tile *tile, const struct place *place, const float blocks[BLOCKS])
{
    const int32_t low_x = place->x > tile->x ? place->x : tile->x;
    const int32_t low_y = place->y > tile->y ? place->y : tile->y;
    const int32_t end_x = place->end_x < tile->end_x ? place->end_x : tile->end_x;
    const int32_t end_y = place->end_y < tile->end_y ? place->end_y : tile->end_y;
    for (int32_t y = (low_y - tile->y) >> BLOCK_SHIFT; y <= (end_y - 1 - tile->y) >> BLOCK_SHIFT;
         y++)
        for (int32_t x = (low_x - tile->x) >> BLOCK_SHIFT;
             x <= (end_x - 1 - tile->x) >> BLOCK_SHIFT; x++)
            if (place->nearest >= blocks[y * BLOCKS_WIDE + x])
                return false;
    return true;
}

static void mark(const struct picture *p, uint32_t run, uint8_t what)
{
    if ((__atomic_load_n(&p->marks[run], __ATOMIC_RELAXED) & what) != what)
        __atomic_fetch_or(&p->marks[run], what, __ATOMIC_RELAXED);
}

static void write_row(const struct picture *p, const uint64_t *keys, uint32_t count, size_t at)
{
    uint32_t *ids = p->target->ids + at * 2;
    uint32_t *depth = (uint32_t *)(void *)(p->target->depth + at);
    uint32_t last = UINT32_MAX;
    for (uint32_t x = 0; x < count; x++) {
        const uint32_t place = UINT32_MAX - (uint32_t)keys[x];
        const uint32_t run = place / HG_RASTER_MOST_TRIANGLES;
        const bool none = keys[x] == 0;
        ids[x * 2] = none ? 0 : p->runs[run].draw + 1;
        ids[x * 2 + 1] = none ? 0 : p->runs[run].number + place % HG_RASTER_MOST_TRIANGLES;
        depth[x] = (uint32_t)(keys[x] >> 32);
        if (!none && run != last)
            mark(p, run, HG_RASTER_SEEN);
        last = none ? last : run;
    }
}

// Runs lie all over memory: indices are asked for two runs ahead, positions one. Returns whether
// there are late runs.
static bool draw_early(const struct picture *p, size_t index, const struct hg_raster_tile *tile)
{
    const uint32_t *list = p->raster->list, end = p->raster->firsts[index + 1];
    uint32_t i = p->raster->firsts[index];
    struct range next = {0, 0};
    struct hg_raster_shot shot;
    bool late = false;
    if (i < end)
        next = range_of(&p->runs[list[i]]);
    for (; i < end; i++) {
        const struct range range = next;
        if (i + 2 < end)
            fetch(p->runs[list[i + 2]].indices, (size_t)p->runs[list[i + 2]].count * 12);
        if (i + 1 < end) {
            const struct hg_raster_run *run = &p->runs[list[i + 1]];
            next = range_of(run);
            fetch(run->positions + (size_t)next.low * 3, (size_t)(next.high - next.low) * 12);
        }
        late = late || p->runs[list[i]].late;
        if (p->runs[list[i]].late)
            continue;
        draw_run(p, list[i], range, tile, &shot);
        mark(p, list[i], HG_RASTER_DRAWN);
    }
    return late;
}

static void draw_late(const struct picture *p, size_t index, const struct hg_raster_tile *tile)
{
    const struct hg_raster *r = p->raster;
    float blocks[BLOCKS];
    struct hg_raster_shot shot;
    reduce(tile, blocks);
    for (uint32_t i = r->firsts[index]; i < r->firsts[index + 1]; i++) {
        const uint32_t run = r->list[i];
        if (!p->runs[run].late || is_hidden(tile, &r->places[run], blocks))
            continue;
        draw_run(p, run, range_of(&p->runs[run]), tile, &shot);
        mark(p, run, HG_RASTER_DRAWN);
    }
}

static void draw_tile(void *user, size_t index)
{
    const struct picture *p = user;
    uint64_t keys[HG_RASTER_WIDE * HG_RASTER_HIGH];
    struct hg_raster_tile tile = {.keys = keys,
        .x = (int32_t)(index % p->tiles_x) * HG_RASTER_WIDE,
        .y = (int32_t)(index / p->tiles_x) * HG_RASTER_HIGH};
    const int32_t width = (int32_t)p->view->width, height = (int32_t)p->view->height;
    tile.end_x = tile.x + HG_RASTER_WIDE < width ? tile.x + HG_RASTER_WIDE : width;
    tile.end_y = tile.y + HG_RASTER_HIGH < height ? tile.y + HG_RASTER_HIGH : height;
    memset(keys, 0, sizeof keys);
    if (draw_early(p, index, &tile))
        draw_late(p, index, &tile);
    for (int32_t y = tile.y; y < tile.end_y; y++)
        write_row(p, keys + (size_t)(y - tile.y) * HG_RASTER_WIDE, (uint32_t)(tile.end_x - tile.x),
            (size_t)y * p->view->width + (size_t)tile.x);
}

static void spread(struct hg_jobs *jobs, size_t count, hg_jobs_fn *fn, struct picture *p)
{
    if (count > 1 && jobs != NULL)
        hg_jobs_for(jobs, count, fn, p);
    else
        for (size_t i = 0; i < count; i++)
            fn(p, i);
}

enum hg_status hg_raster_draw(struct hg_raster *r, const struct hg_raster_view *view,
    const struct hg_raster_runs *runs, const struct hg_raster_target *target, struct hg_jobs *jobs)
{
    struct picture p = {.raster = r,
        .view = view,
        .runs = runs->list,
        .count = runs->count,
        .tiles_x = (view->width + HG_RASTER_WIDE - 1) / HG_RASTER_WIDE,
        .tiles_y = (view->height + HG_RASTER_HIGH - 1) / HG_RASTER_HIGH,
        .target = target,
        .marks = runs->marks};
    enum hg_status status =
        hg_grow(&r->places, &r->place_capacity, (size_t)runs->count + 1, sizeof *r->places);
    if (status != HG_OK)
        return status;
    spread(jobs, ((size_t)runs->count + RUNS_PER_JOB - 1) / RUNS_PER_JOB, place_runs, &p);
    status = bin(&p);
    if (status == HG_OK)
        spread(jobs, (size_t)p.tiles_x * p.tiles_y, draw_tile, &p);
    return status;
}
