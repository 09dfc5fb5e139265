// temporal.c - see temporal.h.
#include "renderer/temporal/temporal.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/temporal/checkerboard.h"
#include "renderer/temporal/lanes.h"
#include "renderer/temporal/mix.h"
#include "renderer/temporal/smooth.h"

#define BAND           24u // rows that one thread works on
#define PROBE_PX       16u // every so many samples across and down one is looked up before all others
#define MOST_AT_ONCE   64u   // bands
#define FOUND_REACH    0.1f  // of depths of the same surface, relative
#define MOTION_FULL_PX 16.0f // of the debug view
#define BETWEEN        0.25f // what pixels between shaded ones count

struct scratch {
    float *memory;
    _Atomic bool taken;
    struct hg_temporal_line lines[3]; // row y in y % 3
    struct hg_temporal_about samples, pixels;
    struct hg_temporal_checkerboard checkerboard;
    uint32_t middle; // row that `samples` is about
    struct hg_temporal_found found;
};

struct hg_temporal {
    uint32_t width, height;
    struct hg_temporal_past past[2];
    uint32_t newest; // of the two
    uint32_t pictures;
    struct hg_temporal_taps columns, rows;
    struct scratch *scratch; // [MOST_AT_ONCE] made when they are first needed
};

// --- life ----------------------------------------------------------------------------------------

static size_t color_words(const struct hg_temporal *t)
{
    const size_t border = 2 * HG_TEMPORAL_BORDER;
    return 4 * (t->width + border) * (t->height + border);
}

static bool make_taps(struct hg_temporal_taps *taps, uint32_t pixels)
{
    // Read in eights.
    taps->first = hg_calloc((size_t)pixels + HG_LANES, sizeof *taps->first);
    taps->weight = hg_calloc(3 * (size_t)pixels + HG_LANES, sizeof *taps->weight);
    taps->trust = hg_calloc((size_t)pixels + HG_LANES, sizeof *taps->trust);
    return taps->first != NULL && taps->weight != NULL && taps->trust != NULL;
}

static bool make_past(const struct hg_temporal *t, struct hg_temporal_past *past)
{
    const size_t pixels = (size_t)t->width * t->height;
    // Vectors of four texels are read whole.
    past->color = hg_calloc(color_words(t) + 16, sizeof *past->color);
    past->depth = hg_calloc(pixels, sizeof *past->depth);
    past->weight = hg_calloc(pixels + 3, sizeof *past->weight); // read in fours
    return past->color != NULL && past->depth != NULL && past->weight != NULL;
}

enum hg_status hg_temporal_create(uint32_t width, uint32_t height, struct hg_temporal **out)
{
    struct hg_temporal *t = hg_calloc(1, sizeof *t);
    *out = t;
    if (t == NULL)
        return HG_E_NOMEM;
    t->width = width;
    t->height = height;
    t->scratch = hg_calloc(MOST_AT_ONCE, sizeof *t->scratch);
    if (t->scratch != NULL && make_taps(&t->columns, width) && make_taps(&t->rows, height) &&
        make_past(t, &t->past[0]) && make_past(t, &t->past[1]))
        return HG_OK;
    hg_temporal_destroy(t);
    *out = NULL;
    return HG_E_NOMEM;
}

static void free_taps(struct hg_temporal_taps *taps)
{
    hg_free(taps->first);
    hg_free(taps->weight);
    hg_free(taps->trust);
}

void hg_temporal_destroy(struct hg_temporal *t)
{
    if (t == NULL)
        return;
    for (int i = 0; i < 2; i++) {
        hg_free(t->past[i].color);
        hg_free(t->past[i].depth);
        hg_free(t->past[i].weight);
    }
    for (uint32_t i = 0; i < MOST_AT_ONCE && t->scratch != NULL; i++)
        hg_free(t->scratch[i].memory);
    hg_free(t->scratch);
    free_taps(&t->columns);
    free_taps(&t->rows);
    hg_free(t);
}

void hg_temporal_size(const struct hg_temporal *t, uint32_t *width, uint32_t *height)
{
    *width = t->width;
    *height = t->height;
}

uint64_t hg_temporal_bytes(const struct hg_temporal *t)
{
    const uint64_t pixels = (uint64_t)t->width * t->height;
    return 2 * (color_words(t) * sizeof(uint16_t) + pixels * (sizeof(float) + 1));
}

void hg_temporal_forget(struct hg_temporal *t)
{
    t->pictures = 0;
}

// --- scratch of a band ---------------------------------------------------------------------------

#define LINE_ROWS  (HG_TEMPORAL_CHANNELS + 4)
#define ABOUT_ROWS (3 * HG_TEMPORAL_CHANNELS + 4 + 1 + 4)
#define FOUND_ROWS (4 + 1 + 2 + 2)
#define HALF_ROWS  (HG_TEMPORAL_CHECKERBOARD_ROWS * HG_TEMPORAL_CHANNELS)

struct rows {
    float *at;
    size_t stride;
};

static float *take(struct rows *rows)
{
    float *row = rows->at + HG_TEMPORAL_ROW_PAD;
    rows->at += rows->stride;
    return row;
}

static void take_motion(struct rows *rows, struct hg_temporal_motion_row *out)
{
    out->x = take(rows);
    out->y = take(rows);
    out->expect = take(rows);
    out->depth = take(rows);
}

static void take_about(struct rows *rows, struct hg_temporal_about *out)
{
    for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++) {
        out->color[c] = take(rows);
        out->mean[c] = take(rows);
        out->deviation[c] = take(rows);
        out->spare[c] = take(rows);
    }
    take_motion(rows, &out->motion);
    out->slope = take(rows);
}

// width: of the output, the widest.
static bool scratch_init(struct scratch *s, uint32_t width)
{
    const size_t stride = ((size_t)width + 2 * HG_TEMPORAL_ROW_PAD + 7) & ~(size_t)7;
    struct rows rows = {.stride = stride};
    s->memory = hg_calloc(
        stride * (3 * LINE_ROWS + 2 * ABOUT_ROWS + FOUND_ROWS + HALF_ROWS), sizeof(float));
    if (s->memory == NULL)
        return false;
    rows.at = s->memory;
    for (int i = 0; i < 3; i++) {
        for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++)
            s->lines[i].color[c] = take(&rows);
        take_motion(&rows, &s->lines[i].motion);
    }
    take_about(&rows, &s->samples);
    take_about(&rows, &s->pixels);
    for (int i = 0; i < HALF_ROWS; i++)
        s->checkerboard.rows[i / HG_TEMPORAL_CHANNELS][i % HG_TEMPORAL_CHANNELS] = take(&rows);
    s->found.weight = take(&rows);
    s->found.part_x = take(&rows);
    s->found.part_y = take(&rows);
    s->found.texel = (int32_t *)take(&rows);
    s->found.nearest = (int32_t *)take(&rows);
    s->found.color = take(&rows); // four rows in one
    return true;
}

// --- one picture ---------------------------------------------------------------------------------

struct job {
    struct hg_temporal *t;
    const struct hg_temporal_picture *picture;
    const struct hg_temporal_way *ways;
    enum hg_temporal_show show;
    bool continues;
    uint8_t *rgba;
    _Atomic bool failed;
};

static bool is_whole(const struct job *j)
{
    return j->picture->width == j->t->width && j->picture->height == j->t->height;
}

static void fill_line(const struct job *j, struct scratch *s, uint32_t y)
{
    struct hg_temporal_line *line = &s->lines[y % 3];
    hg_temporal_motion_fill(j->picture, j->ways, y, &line->motion);
    if (j->picture->checkerboard)
        hg_temporal_checkerboard_fill(j->picture, y, &s->checkerboard, line);
    else
        hg_temporal_line_fill(j->picture, y, line);
}

// Rows of samples about that of row y of the output; *have: the last that is filled, plus 1.
static void fill_about(const struct job *j, struct scratch *s, uint32_t y, uint32_t *have)
{
    const struct hg_temporal *t = j->t;
    const uint32_t middle = t->rows.first[y], last = j->picture->height - 1;
    const uint32_t above = middle > 0 ? middle - 1 : 0, below = middle < last ? middle + 1 : last;
    const float weight[3] = {
        t->rows.weight[y], t->rows.weight[t->height + y], t->rows.weight[2 * t->height + y]};
    if (*have < above)
        *have = above;
    const struct hg_temporal_line *const lines[3] = {
        &s->lines[above % 3], &s->lines[middle % 3], &s->lines[below % 3]};
    // Rows of the output between the same samples differ in their weights.
    const bool all = is_whole(j) || *have != below + 1 || middle != s->middle;
    for (; *have <= below; ++*have)
        fill_line(j, s, *have);
    if (all)
        hg_temporal_about_fill(lines, weight, j->picture->width, &s->samples);
    else
        hg_temporal_about_weigh(lines, weight, j->picture->width, &s->samples);
    s->middle = middle;
    if (is_whole(j)) {
        const uint32_t centre = t->width / 2; // all columns have the same weights
        const float along[3] = {t->columns.weight[centre], t->columns.weight[t->width + centre],
            t->columns.weight[2 * t->width + centre]};
        hg_temporal_about_blur(&s->samples, along, j->picture->width);
    } else {
        for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++) { // taps at the ends reach beyond
            s->samples.color[c][-1] = s->samples.color[c][0];
            s->samples.color[c][j->picture->width] = s->samples.color[c][j->picture->width - 1];
        }
        hg_temporal_about_expand(&s->samples, &t->columns, t->width, all, &s->pixels);
    }
}

static void repeat_border(const struct hg_temporal *t, uint16_t *row)
{
    for (uint32_t i = 0; i < HG_TEMPORAL_BORDER; i++) {
        memcpy(row - 4 * (i + 1), row, 8);
        memcpy(row + 4 * (size_t)(t->width + i), row + 4 * (size_t)(t->width - 1), 8);
    }
}

static void show_motion(const struct hg_temporal_about *about, uint32_t width, uint8_t *rgba)
{
    for (uint32_t i = 0; i < width; i++) {
        const float m[2] = {about->motion.x[i], about->motion.y[i]};
        const bool lost = m[0] >= HG_TEMPORAL_LOST;
        for (int c = 0; c < 2; c++) {
            const float v = 127.5f + 127.5f * (lost ? 0.0f : m[c]) / MOTION_FULL_PX;
            rgba[4 * i + (uint32_t)c] = (uint8_t)fminf(fmaxf(v + 0.5f, 0.0f), 255.0f);
        }
        rgba[4 * i + 2] = lost ? 255 : 128;
        rgba[4 * i + 3] = 255;
    }
}

static void show_history(const float *weight, uint32_t width, uint8_t *rgba)
{
    for (uint32_t i = 0; i < width; i++) {
        memset(rgba + 4 * i, (int)(255.0f * weight[i] / HG_TEMPORAL_MOST_WEIGHT), 3);
        rgba[4 * i + 3] = 255;
    }
}

static void show_scale(const float *weight, const struct hg_temporal_trust *trust, float scale,
    uint32_t width, uint8_t *rgba)
{
    const float red = fminf(fmaxf(4.0f * (1.0f - scale), 0.0f), 1.0f);
    const float green = fminf(fmaxf(4.0f * scale - 2.0f, 0.0f), 1.0f);
    for (uint32_t i = 0; i < width; i++) {
        const float seen = trust->row * trust->columns[i] * trust->part[i & 1];
        const float share = weight[i] > 0.0f ? seen / (weight[i] + seen) : 1.0f;
        rgba[4 * i] = (uint8_t)(255.0f * red * share + 0.5f);
        rgba[4 * i + 1] = (uint8_t)(255.0f * green * share + 0.5f);
        rgba[4 * i + 2] = 0;
        rgba[4 * i + 3] = 255;
    }
}

static bool lacks_any(const float *weight, uint32_t width)
{
    bool lacks = false;
    for (uint32_t x = 0; x < width; x++)
        lacks |= !(weight[x] > 0.0f);
    return lacks;
}

static void smooth_row(
    const struct job *j, struct scratch *s, const float *weight, uint32_t y, uint8_t *rgba)
{
    const uint32_t size[2] = {j->t->width, j->t->height};
    // Rows that are free by now; that of colours has four times the width.
    int32_t *marks = s->found.nearest, *rows = (int32_t *)(void *)s->found.color;
    if (!lacks_any(weight, size[0]))
        return;
    hg_temporal_smooth_mark(j->picture->rgba, size, y, rows, marks);
    for (uint32_t x = 0; x < size[0]; x++)
        if (marks[x] && !(weight[x] > 0.0f))
            hg_temporal_smooth(j->picture->rgba, size, x, y, rgba + 4 * x);
}

static void resolve_row(const struct job *j, struct scratch *s, uint32_t y)
{
    struct hg_temporal *t = j->t;
    const struct hg_temporal_about *about = is_whole(j) ? &s->samples : &s->pixels;
    const struct hg_temporal_past *was = &t->past[t->newest], *now = &t->past[1 - t->newest];
    const uint32_t size[2] = {t->width, t->height};
    const size_t pitch = t->width + 2 * HG_TEMPORAL_BORDER;
    uint8_t *rgba = j->rgba + 4 * (size_t)y * t->width;
    const struct hg_temporal_past to = {
        .color = now->color + 4 * ((y + HG_TEMPORAL_BORDER) * pitch + HG_TEMPORAL_BORDER),
        .depth = now->depth + (size_t)y * t->width,
        .weight = now->weight + (size_t)y * t->width};
    if (j->continues)
        hg_temporal_look_up(was, size, y, about, &s->found);
    else
        memset(s->found.weight, 0, t->width * sizeof *s->found.weight);
    float *had = (float *)s->found.texel; // free by now
    memcpy(had, s->found.weight, t->width * sizeof *had);
    struct hg_temporal_trust trust = {t->rows.trust[y], t->columns.trust, {1.0f, 1.0f}};
    if (j->picture->checkerboard)
        trust.part[(y + j->picture->first + 1) & 1] = BETWEEN;
    hg_temporal_mix(about, &s->found, &trust, t->width, &to, rgba);
    repeat_border(t, to.color);
    if (j->show == HG_TEMPORAL_MOTION)
        show_motion(about, t->width, rgba);
    else if (j->show == HG_TEMPORAL_HISTORY)
        show_history(had, t->width, rgba);
    else if (j->show == HG_TEMPORAL_SCALE)
        show_scale(had, &trust, (float)j->picture->height / (float)t->height, t->width, rgba);
    else if (is_whole(j) && !j->picture->checkerboard)
        smooth_row(j, s, had, y, rgba);
}

// One that no other band uses; what is in it does not matter.
static struct scratch *borrow(struct hg_temporal *t)
{
    for (uint32_t i = 0;; i = (i + 1) % MOST_AT_ONCE) {
        struct scratch *s = &t->scratch[i];
        if (atomic_exchange(&s->taken, true))
            continue;
        if (s->memory != NULL || scratch_init(s, t->width))
            return s;
        s->taken = false;
        return NULL;
    }
}

static void resolve_band(void *user, size_t index)
{
    struct job *j = user;
    const uint32_t first = (uint32_t)index * BAND;
    const uint32_t end = first + BAND < j->t->height ? first + BAND : j->t->height;
    struct scratch *s = borrow(j->t);
    uint32_t have = 0;
    if (s == NULL) {
        j->failed = true;
        return;
    }
    for (uint32_t y = first; y < end; y++) {
        fill_about(j, s, y, &have);
        resolve_row(j, s, y);
    }
    s->taken = false;
}

// Rows above and below the picture.
static void repeat_rows(const struct hg_temporal *t, uint16_t *color)
{
    const size_t pitch = 4 * ((size_t)t->width + 2 * HG_TEMPORAL_BORDER);
    uint16_t *first = color + HG_TEMPORAL_BORDER * pitch, *last = first + (t->height - 1) * pitch;
    for (size_t i = 1; i <= HG_TEMPORAL_BORDER; i++) {
        memcpy(first - i * pitch, first, pitch * sizeof *color);
        memcpy(last + i * pitch, last, pitch * sizeof *color);
    }
}

// --- cuts ----------------------------------------------------------------------------------------

// Of a sample alone, without those around it; depth: of the picture before, of that size.
static bool is_found(const float *depth, const uint32_t size[2],
    const struct hg_temporal_motion_row *m, uint32_t x, const float at[2])
{
    const float to[2] = {at[0] + m->x[x], at[1] + m->y[x]};
    if (!(to[0] >= 0.0f && to[0] < (float)size[0] && to[1] >= 0.0f && to[1] < (float)size[1]))
        return false;
    if (depth == NULL)
        return true;
    const float was = depth[(size_t)to[1] * size[0] + (size_t)to[0]];
    return fabsf(was - m->expect[x]) <= FOUND_REACH * fmaxf(was, m->expect[x]);
}

// Share of a few samples that show what the picture before does.
static float share_found(const struct job *j, struct scratch *s)
{
    const struct hg_temporal *t = j->t;
    const struct hg_temporal_picture *p = j->picture;
    const uint32_t size[2] = {t->width, t->height};
    const float *depth = t->past[t->newest].depth;
    uint32_t found = 0, all = 0;
    for (uint32_t y = (PROBE_PX < p->height ? PROBE_PX : p->height) / 2; y < p->height;
         y += PROBE_PX) {
        hg_temporal_motion_fill(p, j->ways, y, &s->lines[0].motion);
        for (uint32_t x = PROBE_PX / 2; x < p->width; x += PROBE_PX, all++) {
            const float at[2] = {((float)x + 0.5f) * (float)t->width / (float)p->width,
                ((float)y + 0.5f) * (float)t->height / (float)p->height};
            found += is_found(depth, size, &s->lines[0].motion, x, at);
        }
    }
    return all > 0 ? (float)found / (float)all : 1.0f;
}

static enum hg_status look_for_cut(struct job *j, struct hg_temporal_stats *stats)
{
    j->continues = j->picture->continues && j->t->pictures > 0;
    if (!j->continues)
        return HG_OK;
    struct scratch *s = borrow(j->t);
    if (s == NULL)
        return HG_E_NOMEM;
    stats->found = share_found(j, s);
    s->taken = false;
    j->continues = stats->found >= 1.0f - j->picture->cut;
    return HG_OK;
}

// --- entry ---------------------------------------------------------------------------------------

static struct hg_temporal_way *make_ways(
    const struct hg_temporal_picture *p, uint32_t width, uint32_t height)
{
    struct hg_temporal_way *ways = hg_calloc(p->matrix_count, sizeof *ways);
    for (uint32_t i = 0; ways != NULL && i < p->matrix_count; i++)
        hg_temporal_way_make(p, p->to_previous[i], width, height, &ways[i]);
    return ways;
}

enum hg_status hg_temporal_resolve(struct hg_temporal *t, struct hg_jobs *jobs,
    const struct hg_temporal_picture *picture, enum hg_temporal_show show, uint8_t *rgba,
    struct hg_temporal_stats *stats)
{
    struct job j = {.t = t, .picture = picture, .show = show, .rgba = rgba};
    struct hg_temporal_way *ways = make_ways(picture, t->width, t->height);
    *stats = (struct hg_temporal_stats){0};
    j.ways = ways;
    enum hg_status status = ways != NULL ? look_for_cut(&j, stats) : HG_E_NOMEM;
    if (status == HG_OK) {
        hg_temporal_taps_fill(&t->columns, t->width, picture->width, picture->jitter_px[0]);
        hg_temporal_taps_fill(&t->rows, t->height, picture->height, picture->jitter_px[1]);
        hg_jobs_for(jobs, (t->height + BAND - 1) / BAND, resolve_band, &j);
        status = j.failed ? HG_E_NOMEM : HG_OK;
    }
    hg_free(ways);
    if (status != HG_OK) {
        hg_temporal_forget(t);
        return status;
    }
    t->newest = 1 - t->newest;
    repeat_rows(t, t->past[t->newest].color);
    t->pictures = j.continues ? t->pictures + 1 : 1;
    stats->pictures = t->pictures;
    return HG_OK;
}

enum hg_status hg_temporal_motion(
    const struct hg_temporal_picture *p, const float *depth_before, float *motion_px)
{
    struct scratch s = {0};
    const uint32_t size[2] = {p->width, p->height};
    struct hg_temporal_way *ways = make_ways(p, p->width, p->height);
    const bool room = ways != NULL && scratch_init(&s, p->width);
    for (uint32_t y = 0; y < p->height && room; y++) {
        const struct hg_temporal_motion_row *row = &s.lines[0].motion;
        hg_temporal_motion_fill(p, ways, y, &s.lines[0].motion);
        for (uint32_t x = 0; x < p->width; x++) {
            float *to = motion_px + 3 * ((size_t)y * p->width + x);
            const float at[2] = {(float)x + 0.5f, (float)y + 0.5f};
            const bool lost = row->x[x] >= HG_TEMPORAL_LOST;
            to[0] = lost ? 0.0f : row->x[x];
            to[1] = lost ? 0.0f : row->y[x];
            to[2] = is_found(depth_before, size, row, x, at) ? 1.0f : 0.0f;
        }
    }
    hg_free(s.memory);
    hg_free(ways);
    return room ? HG_OK : HG_E_NOMEM;
}
