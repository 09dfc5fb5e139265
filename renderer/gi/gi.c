// gi.c - the two fields of a scene, settled and dynamic. See gi.h.
#include "renderer/gi/gi.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/gi/build.h"
#include "renderer/gi/cameras.h"
#include "renderer/gi/camera_hits.h"
#include "renderer/math/vec.h"

#define BEYOND       0.26f // spacings that a scene may reach beyond its outermost probes: just placed
#define MOST_COARSER 2.0f // times the spacing that it would have now
#define WIDEST       1.5f // likewise, of one that holds what was there before
#define MOVES_WITHIN 8    // pictures: geometry that moved is in motion as long as it does so again
#define MARGIN       0.1f // of the longest side, around a scene that moves

struct hg_gi {
    struct hg_gi_waves waves;
    struct hg_gi_build settled, dynamic; // grids over the whole scene
    struct hg_gi_cameras cameras;
    uint64_t pictures, moved_at; // hg_gi_update calls; that of the newest geometry
    uint64_t geometry, emitters; // its revision; state of its emissive triangles
    bool moves_on;               // geometry moves from picture to picture, and no emitter with it
    bool on_settled; // pictures in motion use the settled field's grid over the whole scene
};

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_gi_create(
    const struct hg_gi_params *params, struct hg_gi **out, struct hg_error *err)
{
    struct hg_gi *gi = hg_calloc(1, sizeof *gi);
    *out = NULL;
    if (!gi)
        return hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    const enum hg_status status = hg_gi_waves_init(&gi->waves, params, err);
    if (status != HG_OK)
        hg_free(gi);
    else
        *out = gi;
    return status;
}

void hg_gi_destroy(struct hg_gi *gi)
{
    if (!gi)
        return;
    struct hg_gpu *gpu = gi->waves.params.gpu;
    hg_gi_cameras_drop_settled(&gi->cameras, gpu);
    hg_gi_cameras_drop_dynamic(&gi->cameras, gpu);
    hg_gi_build_finish(&gi->settled, gpu);
    hg_gi_build_finish(&gi->dynamic, gpu);
    hg_gi_waves_finish(&gi->waves);
    hg_free(gi);
}

void hg_gi_touch(struct hg_gi *gi, uint64_t view)
{
    if (gi != NULL)
        hg_gi_cameras_touch(&gi->cameras, view);
}

// --- the settled field ---------------------------------------------------------------------------

static bool is_whole_settled(const struct hg_gi *gi, const struct hg_gi_key *key)
{
    return hg_gi_build_has_key(&gi->settled, key) && hg_gi_build_is_done(&gi->settled);
}

bool hg_gi_is_settled(
    const struct hg_gi *gi, const struct hg_gi_key *key, const struct hg_gi_eye *eye)
{
    return gi != NULL && is_whole_settled(gi, key) &&
           hg_gi_camera_is_settled(hg_gi_cameras_find(&gi->cameras, eye->view), key, eye);
}

static enum hg_status upload(struct hg_gi *gi, struct hg_gi_build *b, struct hg_error *err)
{
    const struct hg_gi_params *p = &gi->waves.params;
    return b->field.count > 0 ? hg_gi_field_upload(&b->field, p->gpu, p->jobs, err) : HG_OK;
}

// Of the scene as it is now. NULL: there is nothing.
static const struct hg_gi_bounds *find_bounds(const struct hg_gi *gi, struct hg_gi_bounds *out)
{
    return hg_geometry_bounds(gi->waves.params.geometry, out->min, out->max) ? out : NULL;
}

static enum hg_status settle_whole(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, uint64_t *rays, struct hg_error *err)
{
    struct hg_gi_build *b = &gi->settled;
    const struct hg_gi_build_params params = {&gi->waves, sources, &b->field};
    enum hg_status status = HG_OK;
    if (is_whole_settled(gi, key))
        return HG_OK;
    if (!hg_gi_build_has_key(b, key)) {
        hg_gi_cameras_drop_settled(&gi->cameras, gi->waves.params.gpu);
        if (gi->on_settled)
            hg_gi_cameras_drop_dynamic(&gi->cameras, gi->waves.params.gpu);
        gi->on_settled = false;
        struct hg_gi_bounds box;
        status = hg_gi_build_surround(b, &gi->waves, find_bounds(gi, &box), err);
        b->key = *key;
        b->keyed = true;
    }
    if (status == HG_OK)
        status = hg_gi_build_advance(b, &params, rays, err);
    if (status == HG_OK && hg_gi_build_is_done(b))
        status = upload(gi, b, err);
    b->keyed = b->keyed && status == HG_OK;
    return status;
}

enum hg_status hg_gi_settle(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_gi_eye *eye, const struct hg_lighting_sources *sources, uint64_t rays,
    struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    if (hg_gi_is_settled(gi, key, eye))
        return HG_OK;
    enum hg_status status = hg_gi_waves_sync(&gi->waves, key, sources, true, err);
    if (status == HG_OK)
        status = settle_whole(gi, key, sources, &rays, err);
    if (status == HG_OK && is_whole_settled(gi, key)) {
        struct hg_gi_camera *c =
            hg_gi_cameras_acquire(&gi->cameras, eye->view, gi->waves.params.gpu);
        const struct hg_gi_camera_params params = {
            &gi->waves, sources, &gi->settled, true, false, true, key, eye};
        if (c != NULL)
            status = hg_gi_camera_settle(c, &params, &rays, err);
    }
    gi->waves.stats.ns += hg_clock_now_ns() - begin;
    return status;
}

// --- the dynamic field ---------------------------------------------------------------------------

static bool is_same_grid(const struct hg_gi_field *a, const struct hg_gi_field *b)
{
    return a->count > 0 && memcmp(a->counts, b->counts, sizeof a->counts) == 0 &&
           memcmp(a->origin, b->origin, sizeof a->origin) == 0 && a->spacing == b->spacing;
}

// What the settled field holds is better to begin with than nothing, though it is not of this
// light.
static enum hg_status take_settled(
    struct hg_gi *gi, const struct hg_gi_key *key, struct hg_error *err)
{
    struct hg_gi_build *b = &gi->dynamic;
    const bool moved = gi->settled.key.geometry != key->geometry;
    const enum hg_status status = hg_gi_build_place(b, &gi->settled.field, err);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < b->field.count; i++)
        hg_gi_probe_copy(&b->field, i, &gi->settled.field, i);
    b->round = gi->settled.round;
    hg_gi_build_outdate(b, moved ? HG_GI_MOVED : HG_GI_LIGHT);
    return HG_OK;
}

static enum hg_status surround(struct hg_gi *gi, const struct hg_gi_bounds *box,
    const struct hg_lighting_sources *sources, struct hg_error *err)
{
    struct hg_gi_build *b = &gi->dynamic;
    const struct hg_gi_build_params params = {&gi->waves, sources, &b->field};
    hg_gi_cameras_drop_dynamic(&gi->cameras, gi->waves.params.gpu);
    enum hg_status status = hg_gi_build_surround(b, &gi->waves, box, err);
    b->updates = 0;
    while (status == HG_OK && b->field.count > 0 && !hg_gi_build_is_placed(b)) {
        uint64_t rays = 1;
        status = hg_gi_build_advance(b, &params, &rays, err);
    }
    return status;
}

// Whether the grid still serves the scene, whose bounds change with each pose of an animation.
static bool fits(const struct hg_gi_field *f, const struct hg_gi_bounds *box)
{
    struct hg_gi_field now = {0};
    if (!box)
        return f->count == 0;
    if (f->count == 0)
        return false;
    hg_gi_field_grid(&now, box->min, box->max);
    bool holds = f->spacing <= MOST_COARSER * now.spacing;
    for (int a = 0; a < 3; a++) {
        const float first = f->origin[a] - BEYOND * f->spacing,
                    last = f->origin[a] + ((float)f->counts[a] - 1 + BEYOND) * f->spacing;
        holds = holds && box->min[a] >= first && box->max[a] <= last;
    }
    return holds;
}

// A scene that outgrows its grid does so again, to and fro: the next one holds both, unless that
// makes it much coarser, and has room to all sides.
static void widen(const struct hg_gi_field *old, struct hg_gi_bounds *box)
{
    struct hg_gi_field now = {0}, both = {0};
    struct hg_gi_bounds wide = *box;
    for (int a = 0; a < 3; a++) {
        const float last = old->origin[a] + ((float)old->counts[a] - 1) * old->spacing;
        wide.min[a] = fminf(wide.min[a], old->origin[a]);
        wide.max[a] = fmaxf(wide.max[a], last);
    }
    hg_gi_field_grid(&now, box->min, box->max);
    hg_gi_field_grid(&both, wide.min, wide.max);
    if (both.spacing <= WIDEST * now.spacing)
        *box = wide;
    float longest = 0;
    for (int a = 0; a < 3; a++)
        longest = fmaxf(longest, box->max[a] - box->min[a]);
    for (int a = 0; a < 3; a++) {
        box->min[a] -= MARGIN * longest;
        box->max[a] += MARGIN * longest;
    }
}

// Its probes are put around a scene once, and again where the scene has outgrown them.
static enum hg_status follow(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, struct hg_error *err)
{
    struct hg_gi_build *b = &gi->dynamic;
    struct hg_gi_bounds now;
    enum hg_status status = HG_OK;
    if (hg_gi_build_has_key(b, key))
        return HG_OK;
    const struct hg_gi_bounds *box = find_bounds(gi, &now);
    if (gi->on_settled && hg_gi_build_is_done(&gi->settled) && fits(&gi->settled.field, box))
        status = take_settled(gi, key, err);
    else if (!fits(&b->field, box) || !hg_gi_build_is_placed(b)) { // an error may have cut it
        const struct hg_gi_field *old = gi->on_settled ? &gi->settled.field : &b->field;
        if (box && old->count > 0)
            widen(old, &now);
        status = surround(gi, box, sources, err);
    } else
        hg_gi_build_outdate(b, hg_gi_change_of(&b->key, key, gi->moves_on));
    // All have light before any is looked up.
    const struct hg_gi_build_params params = {&gi->waves, sources, &b->field};
    if (status == HG_OK)
        status = hg_gi_build_light_new(b, &params, err);
    b->key = *key;
    b->keyed = status == HG_OK;
    return status;
}

static bool is_still(
    const struct hg_gi *gi, const struct hg_gi_key *key, const struct hg_gi_eye *eye)
{
    const struct hg_gi_camera *c = hg_gi_cameras_find(&gi->cameras, eye->view);
    if (gi->on_settled != is_whole_settled(gi, key) || !hg_gi_camera_is_still(c, key, eye))
        return false;
    return gi->on_settled ||
           (hg_gi_build_has_key(&gi->dynamic, key) && !hg_gi_build_wants_updates(&gi->dynamic));
}

// Of emitters that move light would stay behind.
static void note_moves(struct hg_gi *gi, const struct hg_gi_key *key)
{
    const uint64_t emitters = gi->waves.emissive.state;
    if (gi->geometry == key->geometry)
        return;
    gi->moves_on = gi->geometry != 0 && gi->pictures - gi->moved_at <= MOVES_WITHIN &&
                   gi->emitters == emitters;
    gi->moved_at = gi->pictures;
    gi->geometry = key->geometry;
    gi->emitters = emitters;
}

enum hg_status hg_gi_update(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_gi_eye *eye, const struct hg_lighting_sources *sources, uint64_t rays,
    struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    gi->pictures++;
    if (is_still(gi, key, eye))
        return HG_OK;
    const bool on_settled = is_whole_settled(gi, key), switched = on_settled != gi->on_settled;
    enum hg_status status = hg_gi_waves_sync(&gi->waves, key, sources, on_settled, err);
    note_moves(gi, key);
    if (status == HG_OK && !on_settled)
        status = follow(gi, key, sources, err);
    gi->on_settled = on_settled;
    const bool on_lattice = is_same_grid(&gi->settled.field, &gi->dynamic.field);
    if (switched && !on_lattice)
        hg_gi_cameras_drop_dynamic(&gi->cameras, gi->waves.params.gpu);
    const struct hg_gi_camera_params params = {&gi->waves, sources,
        on_settled ? &gi->settled : &gi->dynamic, on_settled, gi->moves_on,
        on_settled || on_lattice, key, eye};
    if (status == HG_OK)
        status = hg_gi_camera_update(
            hg_gi_cameras_acquire(&gi->cameras, eye->view, gi->waves.params.gpu), &params, rays,
            err);
    gi->dynamic.keyed = gi->dynamic.keyed && status == HG_OK;
    gi->waves.stats.ns += hg_clock_now_ns() - begin;
    return status;
}

// --- what shaders and statistics get -------------------------------------------------------------

// The grids of a field, from coarse to fine.
static uint32_t list_grids(const struct hg_gi *gi, enum hg_gi_field_kind kind,
    const struct hg_gi_camera *camera, const struct hg_gi_field *out[HG_PROBE_GRIDS])
{
    const bool settled = kind == HG_GI_SETTLED;
    const struct hg_gi_finer *f = !camera ? NULL : settled ? &camera->settled : &camera->dynamic;
    const struct hg_gi_build *whole = settled || gi->on_settled ? &gi->settled : &gi->dynamic;
    uint32_t count = 0;
    if (whole->field.count > 0)
        out[count++] = &whole->field;
    for (uint32_t i = 0; count > 0 && f && i < f->at.count && f->builds[i].field.count > 0; i++)
        out[count++] = &f->builds[i].field;
    return count;
}

void hg_gi_fill(
    const struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view, struct hg_gpu_probes *out)
{
    const struct hg_gi_field *grids[HG_PROBE_GRIDS];
    *out = (struct hg_gpu_probes){0};
    if (!gi || kind == HG_GI_NO_FIELD)
        return;
    out->count = list_grids(gi, kind, hg_gi_cameras_find(&gi->cameras, view), grids);
    for (uint32_t i = 0; i < out->count; i++) {
        const struct hg_gi_field *f = grids[i];
        out->grids[i] = (struct hg_gpu_probe_grid){.words = f->buffer.address,
            .origin_ws = {f->origin[0], f->origin[1], f->origin[2]},
            .spacing = f->spacing,
            .counts = {f->counts[0], f->counts[1], f->counts[2]},
            .count = f->count};
    }
}

// The finest grid of a field, that knows the coarser ones; NULL: there is none.
static const struct hg_gi_field *finest_grid(
    const struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view)
{
    const struct hg_gi_field *grids[HG_PROBE_GRIDS];
    const uint32_t count = list_grids(gi, kind, hg_gi_cameras_find(&gi->cameras, view), grids);
    return count > 0 ? grids[count - 1] : NULL;
}

enum hg_status hg_gi_world(struct hg_gi *gi, enum hg_gi_field_kind kind, uint64_t view,
    struct hg_gi_world *out, struct hg_error *err)
{
    const bool settled = kind == HG_GI_SETTLED || gi->on_settled;
    const struct hg_gi_build *whole = settled ? &gi->settled : &gi->dynamic;
    *out = (struct hg_gi_world){0};
    const struct hg_gi_field *field = finest_grid(gi, kind, view);
    if (field == NULL)
        return HG_OK;
    const enum hg_status status = hg_gi_waves_sync_surfaces(&gi->waves, settled, err);
    if (status == HG_OK)
        *out = (struct hg_gi_world){.caster = &gi->waves.caster,
            .environment = &gi->waves.environment,
            .surfaces = &gi->waves.surfaces,
            .emissive = &gi->waves.emissive,
            .whole = &whole->field,
            .field = field,
            .rounds = !settled && whole->listed > 0 ? whole->updates / whole->listed : 0,
            .moves_on = gi->moves_on};
    return status;
}

static_assert(HG_GI_MOST_CAMERA_RAYS <= HG_GI_WAVE_PROBES * HG_GI_MOST_RAYS, "buffers of waves");

enum hg_status hg_gi_trace_camera(struct hg_gi *gi, const struct hg_gi_camera_rays *camera,
    struct hg_gi_camera_hit *out, struct hg_error *err)
{
    const struct hg_gi_field *field = finest_grid(gi, camera->field, camera->view);
    struct hg_gi_waves *w = &gi->waves;
    memset(out, 0, camera->count * sizeof *out);
    if (w->rays == NULL || field == NULL)
        return HG_OK;
    const struct hg_gi_camera_hits with = {.caster = &w->caster,
        .jobs = w->params.jobs,
        .field = field,
        .sources = camera->sources,
        .rays = &w->probe_rays,
        .hits = &w->probe_hits,
        .shadow_rays = &w->shadow_rays,
        .blocked = &w->blocked};
    return hg_gi_camera_hits_find(&with, camera->rays, camera->count, out, err);
}

static void count_grid(const struct hg_gi_field *f, struct hg_gi_stats *out)
{
    struct hg_gi_grid_stats *grid = &out->grids[out->grid_count++];
    *grid = (struct hg_gi_grid_stats){.probes = f->count, .spacing = f->spacing};
    for (uint32_t i = 0; i < f->count; i++) {
        const bool awake = hg_gi_probe_is_awake(f, i);
        grid->asleep += !awake;
        out->inside += f->inside[i];
        out->moved +=
            awake && hg_dot3(f->offsets[i], f->offsets[i]) > HG_PROBE_MOVED * HG_PROBE_MOVED;
    }
    out->probes += grid->probes;
    out->asleep += grid->asleep;
}

void hg_gi_stats(const struct hg_gi *gi, struct hg_gi_stats *out)
{
    const struct hg_gi_field *grids[HG_PROBE_GRIDS];
    *out = gi ? gi->waves.stats : (struct hg_gi_stats){0};
    if (!gi)
        return;
    const struct hg_gi_camera *newest = hg_gi_cameras_newest(&gi->cameras);
    const bool settled = gi->settled.field.count > 0 && (!newest || newest->dynamic.at.count == 0);
    const uint32_t count = list_grids(gi, settled ? HG_GI_SETTLED : HG_GI_DYNAMIC, newest, grids);
    for (uint32_t i = 0; i < count; i++)
        count_grid(grids[i], out);
    out->bytes = hg_gi_field_bytes(&gi->settled.field) + hg_gi_field_bytes(&gi->dynamic.field) +
                 hg_gi_cameras_bytes(&gi->cameras);
    if (gi->waves.rays != NULL) {
        struct hg_trace_stats structures;
        hg_trace_stats(hg_rays_trace(gi->waves.rays), &structures);
        out->structure_bytes = structures.bytes;
    }
}
