// cascades.c - see cascades.h.
#include "renderer/gi/cascades.h"

#include <stdlib.h>

#include "renderer/math/vec.h"

#define MOST_FINEST  2560  // probes of the finest grid
#define LEAST_SIDE   4     // and along each of its axes
#define COARSER_SIDE 8     // of the others, which fill in towards the grid of the whole scene
#define INSET        0.25f // of its outermost ones from the box that it is for, in spacings
#define STEP         (2 * HG_GI_FINE_OCTAVE) // from a grid to the next finer one
#define LEAST_FINER  (2 * HG_GI_FINE_OCTAVE) // fineness of the coarsest of the finer grids
#define LEAST_FINEST                                                                               \
    (3 * HG_GI_FINE_OCTAVE) // and of the finest: else that of the scene is fine enough
#define MOST_FINE  (13 * HG_GI_FINE_OCTAVE) // FLT_EPSILON of the scene is 1/1000 of a spacing then
#define LEAST_SEEN 16 // a share of the rays of a picture, below which there is nothing near
#define WIDER                                                                                      \
    (HG_GI_FINE_OCTAVE * 3 /                                                                       \
        4) // fineness that the finest grid may lose for holding more of what is seen
#define STAYS_FINER                                                                                \
    HG_GI_FINE_OCTAVE // a placement of before stays that is finer than wanted by this at most,
#define STAYS_COARSER (STEP - HG_GI_FINE_OCTAVE + 1) // or coarser by less than this;
#define FITS          (HG_GI_FINE_OCTAVE / 4)        // and for fitting it
#define STAYS_OFF     24 // and a grid that is no farther from where it should be, in steps of boxes,
#define SALT          4096 // more than a grid has probes
#define STAYS_COUNTS  2    // and whose sides differ from what they should be by no more

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static float spacing_of(const struct hg_gi_field *coarsest, uint32_t fineness)
{
    return coarsest->spacing * exp2f(-(float)fineness / HG_GI_FINE_OCTAVE);
}

// Probes along each axis of the finest grid, and of all.
static uint32_t count_finest(float spacing, const float half[3], uint32_t counts[3])
{
    uint32_t all = 1;
    for (int a = 0; a < 3; a++) {
        const float cells = fminf(ceilf(2 * (half[a] / spacing - INSET)), MOST_FINEST) + 1;
        counts[a] = cells > LEAST_SIDE ? (uint32_t)cells : LEAST_SIDE;
        all = all * counts[a] > MOST_FINEST ? MOST_FINEST + 1 : all * counts[a];
    }
    return all;
}

// The same where the spacing is finer than wanted: the grid holds less.
static void limit_finest(float spacing, const float half[3], uint32_t counts[3])
{
    count_finest(spacing, half, counts);
    while ((uint64_t)counts[0] * counts[1] * counts[2] > MOST_FINEST) {
        uint32_t *longest = &counts[0];
        for (int a = 1; a < 3; a++)
            longest = counts[a] > *longest ? &counts[a] : longest;
        --*longest;
    }
}

// Of the finest grid: as fine as its number of probes allows. 0: there is none.
static uint32_t finest_for(const struct hg_gi_field *coarsest, const float half[3])
{
    uint32_t counts[3], fineness = MOST_FINE;
    while (fineness >= LEAST_FINEST &&
           count_finest(spacing_of(coarsest, fineness), half, counts) > MOST_FINEST)
        fineness--;
    return fineness >= LEAST_FINEST ? fineness : 0;
}

// That of before, or steps from it, unless it has become too coarse or too fine.
static uint32_t keep_finest(
    const struct hg_gi_field *coarsest, const float half[3], const struct hg_gi_placement *before)
{
    const uint32_t wanted = finest_for(coarsest, half);
    if (before == NULL || before->count == 0 || wanted == 0)
        return wanted;
    uint32_t fineness = before->boxes[before->count - 1].fineness;
    while (fineness + STAYS_COARSER <= wanted && fineness + STEP <= MOST_FINE)
        fineness += STEP;
    while (fineness > wanted + STAYS_FINER && fineness >= STEP)
        fineness -= STEP;
    return fineness >= LEAST_FINER ? fineness : 0;
}

// How far the outermost probes of the finest grid are from where they should be, INSET inside of
// its box: lookups at walls read the layer behind them as much.
static float misfit(float spacing, const float half[3])
{
    float sum = 0;
    for (int a = 0; a < 3; a++) {
        const float extent = 2 * half[a] / spacing;
        sum += ceilf(extent - 2 * INSET) - (extent - 2 * INSET);
    }
    return sum;
}

// Of grids that are hardly coarser the one that fits best; that of before stays.
static uint32_t fit_finest(const struct hg_gi_field *coarsest, const float half[3], uint32_t finest,
    const struct hg_gi_placement *before)
{
    uint32_t best = finest;
    if (before != NULL && before->count > 0)
        return finest;
    for (uint32_t i = finest; finest > 0 && i >= LEAST_FINEST && i + FITS >= finest; i--)
        if (misfit(spacing_of(coarsest, i), half) < misfit(spacing_of(coarsest, best), half))
            best = i;
    return best;
}

static const struct hg_gi_box *find_box(const struct hg_gi_placement *p, uint32_t fineness)
{
    for (uint32_t i = 0; p != NULL && i < p->count; i++)
        if (p->boxes[i].fineness == fineness)
            return &p->boxes[i];
    return NULL;
}

static int32_t round_to(float at, int32_t steps)
{
    return (int32_t)rintf(at / (float)steps) * steps;
}

// The finest grid is in line with what is seen at rest, which walls of a room are the ends of;
// others are on a lattice.
static void set_box(const struct hg_gi_field *coarsest, const float middle[3],
    const struct hg_gi_placement *before, bool finest, struct hg_gi_box *box)
{
    const float step = spacing_of(coarsest, box->fineness) / HG_GI_BOX_STEPS;
    const struct hg_gi_box *old = find_box(before, box->fineness);
    const int32_t snap = finest && !old ? 1 : HG_GI_BOX_STEPS;
    bool stays = old != NULL;
    for (int a = 0; a < 3; a++) {
        const int32_t from = old ? old->first[a] : 0;
        const float half = 0.5f * HG_GI_BOX_STEPS * (float)(box->counts[a] - 1);
        const float at = (middle[a] - coarsest->origin[a]) / step - half;
        box->first[a] = from + round_to(at - (float)from, snap);
        if (!stays)
            continue;
        const int32_t wider = (int32_t)box->counts[a] - (int32_t)old->counts[a];
        const int32_t off = box->first[a] - old->first[a] + wider * HG_GI_BOX_STEPS / 2;
        stays = abs(off) <= STAYS_OFF && abs(wider) <= STAYS_COUNTS;
    }
    if (stays)
        *box = *old;
}

struct bounds {
    float low[3], high[3];
};

// The box of points, without those that are farthest off along each axis.
static void trim(const float (*points)[3], uint32_t count, float share, struct bounds *out)
{
    float sorted[HG_GI_EYE_SEEN];
    const uint32_t off = (uint32_t)(share * (float)count);
    for (int a = 0; a < 3; a++) {
        for (uint32_t i = 0; i < count; i++)
            sorted[i] = points[i][a];
        qsort(sorted, count, sizeof *sorted, compare_floats);
        out->low[a] = sorted[off];
        out->high[a] = sorted[count - 1 - off];
    }
}

static void center(const struct bounds *b, float middle[3], float half[3])
{
    for (int a = 0; a < 3; a++) {
        middle[a] = 0.5f * (b->low[a] + b->high[a]);
        half[a] = 0.5f * (b->high[a] - b->low[a]);
    }
}

// What the finest grid holds: most of what is seen, and as much more of it, and then of what is all
// around, as does not make the grid much coarser. Of a room that is all of it, of a plane not the
// horizon.
static void measure(const struct hg_gi_field *coarsest, const struct hg_gi_points *points,
    float middle[3], float half[3])
{
    static const float shares[] = {0.2f, 0.1f, 0.02f, 0.02f};
    struct bounds box, around;
    uint32_t finest = 0;
    for (int i = 0; i < 4; i++) {
        float wide_middle[3], wide_half[3];
        trim(points->seen, points->seen_count, shares[i], &box);
        if (i == 3 && points->around_count > 0) {
            trim(points->around, points->around_count, shares[i], &around);
            for (int a = 0; a < 3; a++) {
                box.low[a] = fminf(box.low[a], around.low[a]);
                box.high[a] = fmaxf(box.high[a], around.high[a]);
            }
        }
        center(&box, wide_middle, wide_half);
        const uint32_t fineness = finest_for(coarsest, wide_half);
        finest = i == 0 ? fineness : finest;
        if (i > 0 && fineness + WIDER < finest)
            return;
        hg_copy3(wide_middle, middle);
        hg_copy3(wide_half, half);
    }
}

void hg_gi_placement_find(const struct hg_gi_field *coarsest, const struct hg_gi_points *points,
    const struct hg_gi_placement *before, struct hg_gi_placement *out)
{
    float middle[3], half[3];
    *out = (struct hg_gi_placement){0};
    if (coarsest->count == 0 || points->seen_count * LEAST_SEEN < HG_GI_EYE_SEEN)
        return;
    measure(coarsest, points, middle, half);
    const uint32_t finest = fit_finest(coarsest, half, keep_finest(coarsest, half, before), before);
    const uint32_t steps = finest < LEAST_FINER ? 0 : (finest - LEAST_FINER) / STEP + 1;
    out->count = steps < HG_GI_FINER ? steps : HG_GI_FINER;
    for (uint32_t i = 0; i < out->count; i++) {
        struct hg_gi_box *box = &out->boxes[i];
        box->fineness = finest - STEP * (out->count - 1 - i);
        for (int a = 0; a < 3; a++)
            box->counts[a] = COARSER_SIDE;
        if (i + 1 == out->count)
            limit_finest(spacing_of(coarsest, box->fineness), half, box->counts);
        set_box(coarsest, middle, before, i + 1 == out->count, box);
    }
}

void hg_gi_box_grid(
    const struct hg_gi_box *box, const struct hg_gi_field *coarsest, struct hg_gi_field *out)
{
    *out = (struct hg_gi_field){.count = box->counts[0] * box->counts[1] * box->counts[2],
        .spacing = spacing_of(coarsest, box->fineness),
        .salt = box->fineness * SALT};
    for (int a = 0; a < 3; a++) {
        out->counts[a] = box->counts[a];
        out->origin[a] =
            coarsest->origin[a] + (float)box->first[a] * (out->spacing / HG_GI_BOX_STEPS);
    }
}

void hg_gi_box_take(struct hg_gi_field *field, const struct hg_gi_box *box,
    const struct hg_gi_field *from, const struct hg_gi_box *from_box, bool *is_new)
{
    const uint32_t *n = box->counts, *m = from_box->counts;
    for (int a = 0; a < 3; a++)
        if ((box->first[a] - from_box->first[a]) % HG_GI_BOX_STEPS != 0)
            return;
    for (uint32_t k = 0; k < field->count; k++) {
        const uint32_t at[3] = {k % n[0], k / n[0] % n[1], k / n[0] / n[1]};
        int64_t there[3];
        bool inside = is_new[k];
        for (int a = 0; a < 3; a++) {
            there[a] = at[a] + ((int64_t)box->first[a] - from_box->first[a]) / HG_GI_BOX_STEPS;
            inside = inside && there[a] >= 0 && there[a] < m[a];
        }
        if (!inside)
            continue;
        const int64_t other = (there[2] * m[1] + there[1]) * m[0] + there[0];
        hg_gi_probe_copy(field, k, from, (uint32_t)other);
        is_new[k] = false;
    }
}
