// build.c - see build.h.
#include "renderer/gi/build.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/gi/occupancy.h"

// Rounds of the schedule: every probe once in each.
#define PLACE_ROUNDS 3
#define PLACE_RAYS   64
#define WARM_LEAST   8 // light that bounces comes to its level; what they sum up is let go of
#define WARM_MOST    64
#define WARM_WINDOW                                                                                \
    HG_GI_WARM_WINDOW      // rounds, over which the logarithm of light grows by less than
#define WARM_GROWTH  0.006 // when nearly all that bounces has come
#define WARM_RAYS    24
#define MAIN_ROUNDS  4
#define MAIN_RAYS    96
#define MOST_ROUNDS  (PLACE_ROUNDS + WARM_MOST + MAIN_ROUNDS)
#define WARM_KEEP    0.4f
#define MAIN_KEEP    0.9f
#define MOVE_ROUND   15 // the first one: other directions than those that place probes
#define DYNAMIC_RAYS 16
#define FIRST_RAYS   8 // of the first updates since a change, so that light bounces on sooner
#define FIRST_ROUNDS 12
#define MOVING_UPDATES 12u // that probes count as having had, at most, as long as geometry moves
#define MOVE_ENOUGH  40 // updates of each probe since a change, after which none are needed

void hg_gi_build_finish(struct hg_gi_build *b, struct hg_gpu *gpu)
{
    hg_gi_field_finish(&b->field, gpu);
    hg_free(b->list);
    hg_free(b->is_new);
    *b = (struct hg_gi_build){0};
}

bool hg_gi_build_has_key(const struct hg_gi_build *b, const struct hg_gi_key *key)
{
    return b->keyed && memcmp(&b->key, key, sizeof *key) == 0;
}

bool hg_gi_build_is_done(const struct hg_gi_build *b)
{
    return b->end > 0 && b->round >= b->end;
}

bool hg_gi_build_is_placed(const struct hg_gi_build *b)
{
    return b->round >= PLACE_ROUNDS;
}

// --- placing -------------------------------------------------------------------------------------

// The probes that the rounds to come are of: those that take part, and before it is known which are
// inside of something all. Of finer grids the first round tells which have surfaces near.
static void list_probes(struct hg_gi_build *b)
{
    const bool placed = b->round >= PLACE_ROUNDS, finer = b->field.coarser != NULL;
    b->listed = b->next = 0;
    for (uint32_t i = 0; i < b->field.count; i++) {
        const bool asleep = placed ? !hg_gi_probe_is_awake(&b->field, i)
                                   : finer && b->round > 0 && !b->field.needed[i];
        if (!asleep)
            b->list[b->listed++] = i;
    }
}

// Before any memory is taken.
static enum hg_status check_budget(
    const struct hg_gi_params *params, const float min[3], const float max[3], struct hg_error *err)
{
    struct hg_gi_field grid = {0};
    const uint64_t budget = params->budget_bytes;
    if (budget == 0)
        return HG_OK;
    hg_gi_field_grid(&grid, min, max);
    const uint64_t bytes = hg_gi_field_bytes_of(grid.count);
    return bytes <= budget ? HG_OK
                           : hg_error_set(err, HG_E_LIMIT, "probes", NULL,
                                 "%u probes take %.1f MiB, the geometry budget is %.1f MiB",
                                 grid.count, (double)bytes / (1 << 20), (double)budget / (1 << 20));
}

enum hg_status hg_gi_build_place(
    struct hg_gi_build *b, const struct hg_gi_field *grid, struct hg_error *err)
{
    b->round = b->next = b->listed = b->end = 0;
    enum hg_status status = hg_gi_field_place_grid(&b->field, grid);
    hg_free(b->list);
    b->list = status == HG_OK ? hg_calloc(b->field.count, sizeof *b->list) : NULL;
    if (!b->list) {
        hg_gi_field_finish(&b->field, NULL);
        return hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    }
    list_probes(b);
    return HG_OK;
}

enum hg_status hg_gi_build_surround(struct hg_gi_build *b, struct hg_gi_waves *waves,
    const struct hg_gi_bounds *box, struct hg_error *err)
{
    struct hg_gi_field grid = {0};
    b->round = b->next = b->listed = b->end = 0;
    if (!box) {
        hg_gi_field_finish(&b->field, NULL);
        b->round = b->end = MOST_ROUNDS;
        return HG_OK;
    }
    enum hg_status status = check_budget(&waves->params, box->min, box->max, err);
    if (status != HG_OK)
        return status;
    hg_gi_field_grid(&grid, box->min, box->max);
    status = hg_gi_build_place(b, &grid, err);
    if (status == HG_OK)
        hg_gi_occupy(&b->field, &waves->surfaces);
    return status;
}

// --- the schedule of the settled field -----------------------------------------------------------

static struct hg_gi_wave wave_of(struct hg_gi_build *b, const struct hg_gi_build_params *params)
{
    const uint32_t left = b->listed - b->next;
    struct hg_gi_wave w = {.sources = params->sources,
        .field = &b->field,
        .light = params->light,
        .probes = b->list + b->next,
        .count = left < HG_GI_WAVE_PROBES ? left : HG_GI_WAVE_PROBES,
        .round = b->round};
    if (b->round < PLACE_ROUNDS) {
        w.places = true;
        w.last = b->round == PLACE_ROUNDS - 1;
        w.rays = PLACE_RAYS;
    } else if (b->end == 0) {
        w.rays = WARM_RAYS;
        w.keep = WARM_KEEP;
    } else {
        w.rays = MAIN_RAYS;
        w.keep = b->round == b->end - MAIN_ROUNDS ? 0 : MAIN_KEEP;
    }
    return w;
}

static uint64_t less(uint64_t rays, uint64_t cast)
{
    return rays > cast ? rays - cast : 0;
}

// A round is over: has light that bounces come to its level? In a corridor around corners that
// takes many rounds, as each brings it a bounce further.
static bool is_warm(struct hg_gi_build *b)
{
    const uint32_t warm = b->round - PLACE_ROUNDS;
    double *slot = &b->log_light[warm % WARM_WINDOW];
    const double before = *slot;
    *slot = hg_gi_field_log_light(&b->field, b->list, b->listed);
    return warm >= WARM_LEAST && (*slot - before < WARM_GROWTH || warm == WARM_MOST);
}

static void finish_round(struct hg_gi_build *b)
{
    b->next = 0;
    b->round++;
    if (b->round <= PLACE_ROUNDS)
        list_probes(b);
    else if (b->end == 0 && is_warm(b))
        b->end = b->round + MAIN_ROUNDS;
}

enum hg_status hg_gi_build_advance(struct hg_gi_build *b, const struct hg_gi_build_params *params,
    uint64_t *rays, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    while (*rays > 0 && !hg_gi_build_is_done(b) && status == HG_OK) {
        const struct hg_gi_wave w = wave_of(b, params);
        status = hg_gi_waves_run(params->waves, &w, err);
        *rays = less(*rays, (uint64_t)w.count * w.rays);
        b->next += w.count;
        if (b->next == b->listed)
            finish_round(b);
        if (b->listed == 0) // nothing that light could reach
            b->round = b->end = MOST_ROUNDS;
    }
    return status;
}

// --- the dynamic field ---------------------------------------------------------------------------

struct seeding {
    struct hg_gi_field *field;
    const uint32_t *probes;
};

static void seed(void *user, size_t i)
{
    const struct seeding *s = user;
    hg_gi_probe_seed(s->field, s->probes[i]);
}

// Of the listed ones those that are new.
static void list_new(struct hg_gi_build *b)
{
    uint32_t kept = 0;
    list_probes(b);
    for (uint32_t i = 0; i < b->listed; i++)
        if (b->is_new[b->list[i]])
            b->list[kept++] = b->list[i];
    b->listed = kept;
}

enum hg_status hg_gi_build_begin_new(struct hg_gi_build *b, struct hg_error *err)
{
    hg_free(b->is_new);
    b->is_new = hg_calloc(b->field.count, sizeof *b->is_new);
    if (!b->is_new)
        return hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    memset(b->is_new, true, b->field.count * sizeof *b->is_new);
    b->listed = b->next = 0; // what is new is not known before the first round
    b->round = 0;
    return HG_OK;
}

static void finish_new(struct hg_gi_build *b, struct hg_jobs *jobs)
{
    hg_jobs_for(jobs, b->listed, seed, &(struct seeding){&b->field, b->list});
    hg_free(b->is_new);
    b->is_new = NULL;
    list_probes(b);
}

enum hg_status hg_gi_build_relocate_new(struct hg_gi_build *b,
    const struct hg_gi_build_params *params, uint64_t *rays, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (b->round == 0 && b->next == 0)
        list_new(b);
    while (b->is_new && *rays > 0 && status == HG_OK) {
        if (b->next < b->listed) {
            const struct hg_gi_wave w = wave_of(b, params);
            status = hg_gi_waves_run(params->waves, &w, err);
            b->next += w.count;
            *rays = less(*rays, (uint64_t)w.count * w.rays);
            continue;
        }
        b->round++;
        list_new(b);
        if (b->round == PLACE_ROUNDS)
            finish_new(b, params->waves->params.jobs);
    }
    return status;
}

void hg_gi_build_outdate(struct hg_gi_build *b, enum hg_gi_change change)
{
    const bool moves = change == HG_GI_MOVES;
    b->updates = moves ? b->updates : 0;
    if (b->field.count == 0)
        return;
    if (change != HG_GI_LIGHT) { // surfaces may come anywhere
        const uint32_t next = b->next;
        hg_gi_field_doubt_distances(&b->field);
        b->field.follows = true;
        memset(b->field.needed, true, b->field.count * sizeof *b->field.needed);
        list_probes(b);
        b->next = b->listed > 0 ? next % b->listed : 0;
    }
    for (uint32_t i = 0; i < b->field.count; i++)
        b->field.updates[i] = !moves                                 ? 0
                              : b->field.updates[i] < MOVING_UPDATES ? b->field.updates[i]
                                                                     : MOVING_UPDATES;
}

// The next probes of the list that have not had enough updates, up to its end.
static uint32_t choose(struct hg_gi_build *b, uint32_t probes[HG_GI_WAVE_PROBES])
{
    uint32_t count = 0;
    for (; b->next < b->listed && count < HG_GI_WAVE_PROBES; b->next++)
        if (b->field.updates[b->list[b->next]] < MOVE_ENOUGH)
            probes[count++] = b->list[b->next];
    if (b->next == b->listed)
        b->next = 0;
    return count;
}

static enum hg_status run_updates(struct hg_gi_build *b, const struct hg_gi_build_params *params,
    const uint32_t *probes, uint32_t count, struct hg_error *err)
{
    const bool first = b->updates < (uint64_t)FIRST_ROUNDS * b->listed;
    const struct hg_gi_wave w = {.sources = params->sources,
        .field = &b->field,
        .light = params->light,
        .probes = probes,
        .count = count,
        .rays = first ? FIRST_RAYS : DYNAMIC_RAYS,
        .round = MOVE_ROUND + (uint32_t)(b->updates / b->listed),
        .keep = -1};
    b->updates += count;
    return hg_gi_waves_run(params->waves, &w, err);
}

enum hg_status hg_gi_build_light_new(
    struct hg_gi_build *b, const struct hg_gi_build_params *params, struct hg_error *err)
{
    uint32_t probes[HG_GI_WAVE_PROBES], count = 0;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < b->listed && status == HG_OK; i++) {
        const uint32_t probe = b->list[i];
        if (!hg_gi_probe_is_lit(&b->field, probe) && b->field.coarser)
            hg_gi_probe_seed(&b->field, probe);
        else if (!hg_gi_probe_is_lit(&b->field, probe))
            probes[count++] = probe;
        if (count == 0 || (count < HG_GI_WAVE_PROBES && i + 1 < b->listed))
            continue;
        status = run_updates(b, params, probes, count, err);
        count = 0;
    }
    return status;
}

enum hg_status hg_gi_build_update(struct hg_gi_build *b, const struct hg_gi_build_params *params,
    uint64_t *rays, struct hg_error *err)
{
    uint32_t probes[HG_GI_WAVE_PROBES];
    const uint32_t from = b->next;
    uint32_t count = choose(b, probes);
    if (count == 0 && from > 0)
        count = choose(b, probes);
    *rays = 0;
    if (count == 0)
        return HG_OK;
    const bool first = b->updates < (uint64_t)FIRST_ROUNDS * b->listed;
    *rays = (uint64_t)count * (first ? FIRST_RAYS : DYNAMIC_RAYS);
    return run_updates(b, params, probes, count, err);
}

bool hg_gi_build_wants_updates(const struct hg_gi_build *b)
{
    for (uint32_t i = 0; i < b->listed; i++)
        if (b->field.updates[b->list[i]] < MOVE_ENOUGH)
            return true;
    return false;
}
