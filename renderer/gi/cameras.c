// cameras.c - see cameras.h.
#include "renderer/gi/cameras.h"

#include <float.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/math/vec.h"

#define BUSY       64     // touches of any, for which a camera's grids are not taken by another one
#define PLACE_RAYS 16384u // of a picture, that place probes of the grids to come

// --- which cameras -------------------------------------------------------------------------------

static void drop(struct hg_gi_finer *f, uint32_t from, struct hg_gpu *gpu)
{
    for (uint32_t i = from; i < HG_GI_FINER; i++)
        hg_gi_build_finish(&f->builds[i], gpu);
    f->at.count = f->at.count < from ? f->at.count : from;
    f->known = false;
}

static void drop_dynamic(struct hg_gi_camera *c, struct hg_gpu *gpu)
{
    drop(&c->dynamic, 0, gpu);
    drop(&c->next, 0, gpu);
    c->has_next = false;
}

const struct hg_gi_camera *hg_gi_cameras_find(const struct hg_gi_cameras *c, uint64_t view)
{
    for (uint32_t i = 0; i < HG_GI_CAMERAS; i++)
        if (c->cameras[i].touched > 0 && c->cameras[i].view == view)
            return &c->cameras[i];
    return NULL;
}

const struct hg_gi_camera *hg_gi_cameras_newest(const struct hg_gi_cameras *c)
{
    const struct hg_gi_camera *newest = &c->cameras[0];
    for (uint32_t i = 1; i < HG_GI_CAMERAS; i++)
        newest = c->cameras[i].touched > newest->touched ? &c->cameras[i] : newest;
    return newest->touched > 0 ? newest : NULL;
}

void hg_gi_cameras_touch(struct hg_gi_cameras *c, uint64_t view)
{
    for (uint32_t i = 0; i < HG_GI_CAMERAS; i++)
        if (c->cameras[i].touched > 0 && c->cameras[i].view == view)
            c->cameras[i].touched = ++c->touches;
}

struct hg_gi_camera *hg_gi_cameras_acquire(
    struct hg_gi_cameras *c, uint64_t view, struct hg_gpu *gpu)
{
    struct hg_gi_camera *found = &c->cameras[0];
    c->touches++;
    for (uint32_t i = 0; i < HG_GI_CAMERAS && !(found->touched > 0 && found->view == view); i++) {
        struct hg_gi_camera *other = &c->cameras[i];
        if (other->touched < found->touched || (other->touched > 0 && other->view == view))
            found = other;
    }
    if (found->touched == 0 || found->view != view) {
        if (found->touched > 0 && c->touches - found->touched < BUSY)
            return NULL;
        drop(&found->settled, 0, gpu);
        drop_dynamic(found, gpu);
        *found = (struct hg_gi_camera){.view = view};
    }
    found->touched = c->touches;
    return found;
}

static uint64_t bytes_of(const struct hg_gi_finer *f)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < HG_GI_FINER; i++)
        bytes += hg_gi_field_bytes(&f->builds[i].field);
    return bytes;
}

uint64_t hg_gi_cameras_bytes(const struct hg_gi_cameras *c)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < HG_GI_CAMERAS; i++)
        bytes += bytes_of(&c->cameras[i].settled) + bytes_of(&c->cameras[i].dynamic) +
                 bytes_of(&c->cameras[i].next);
    return bytes;
}

void hg_gi_cameras_drop_settled(struct hg_gi_cameras *c, struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < HG_GI_CAMERAS; i++)
        drop(&c->cameras[i].settled, 0, gpu);
}

void hg_gi_cameras_drop_dynamic(struct hg_gi_cameras *c, struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < HG_GI_CAMERAS; i++)
        drop_dynamic(&c->cameras[i], gpu);
}

// --- where finer grids stand ---------------------------------------------------------------------

static void cast_eye(const struct hg_gi_eye *eye, struct hg_gpu_ray *rays)
{
    float middle[3];
    for (int a = 0; a < 3; a++)
        middle[a] = eye->corner[a] + 0.5f * (eye->across[a] + eye->down[a]);
    for (uint32_t i = 0; i < HG_GI_EYE_SEEN + HG_GI_EYE_AROUND; i++) {
        const float x = ((float)(i % HG_GI_EYE_SIDE) + 0.5f) / HG_GI_EYE_SIDE;
        const float y = ((float)(i / HG_GI_EYE_SIDE) + 0.5f) / HG_GI_EYE_SIDE;
        float to[3], d[3];
        for (int a = 0; a < 3; a++)
            to[a] = eye->corner[a] + x * eye->across[a] + y * eye->down[a];
        const float *from = eye->parallel ? to : eye->eye;
        hg_copy3(eye->parallel ? eye->eye : to, d);
        if (i >= HG_GI_EYE_SEEN) {
            from = eye->parallel ? middle : eye->eye;
            hg_gi_sphere_point(i - HG_GI_EYE_SEEN, HG_GI_EYE_AROUND, d);
        }
        hg_normalize3(d);
        rays[i] = (struct hg_gpu_ray){.origin_ws = {from[0], from[1], from[2]},
            .direction_ws = {d[0], d[1], d[2]},
            .t_max = FLT_MAX,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
}

// Without the finest grids, while the budget does not hold all of them.
static void fit_budget(const struct hg_gi_camera_params *params, struct hg_gi_placement *p)
{
    const struct hg_gi_field *coarsest = &params->whole->field;
    const uint64_t budget = params->waves->params.budget_bytes;
    uint32_t probes = coarsest->count;
    for (uint32_t i = 0; i < p->count && budget > 0; i++) {
        struct hg_gi_field grid;
        hg_gi_box_grid(&p->boxes[i], coarsest, &grid);
        probes += grid.count;
        if (hg_gi_field_bytes_of(probes) > budget)
            p->count = i;
    }
}

// before: as of hg_gi_placement_find.
static enum hg_status find_placement(const struct hg_gi_camera_params *params,
    const struct hg_gi_placement *before, struct hg_gi_placement *out, struct hg_error *err)
{
    enum { RAYS = HG_GI_EYE_SEEN + HG_GI_EYE_AROUND };
    float distances[RAYS];
    struct hg_gi_points points = {.seen_count = 0};
    struct hg_gpu_ray *rays = params->waves->probe_rays.mapped;
    *out = (struct hg_gi_placement){0};
    if (params->whole->field.count == 0)
        return HG_OK;
    cast_eye(params->eye, rays);
    const enum hg_status status = hg_gi_waves_distances(params->waves, RAYS, distances, err);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < RAYS; i++) {
        const float from[3] = {rays[i].origin_ws.x, rays[i].origin_ws.y, rays[i].origin_ws.z};
        const float d[3] = {rays[i].direction_ws.x, rays[i].direction_ws.y, rays[i].direction_ws.z};
        if (distances[i] >= FLT_MAX)
            continue;
        float *point = i < HG_GI_EYE_SEEN ? points.seen[points.seen_count++]
                                          : points.around[points.around_count++];
        hg_mad3(from, d, distances[i], point);
    }
    hg_gi_placement_find(&params->whole->field, &points, before, out);
    fit_budget(params, out);
    return HG_OK;
}

static void grid_at(const struct hg_gi_camera_params *params, struct hg_gi_finer *f, uint32_t i,
    struct hg_gi_field *out)
{
    hg_gi_box_grid(&f->at.boxes[i], &params->whole->field, out);
    out->coarser = i > 0 ? &f->builds[i - 1].field : &params->whole->field;
}

static bool is_for(
    const struct hg_gi_finer *f, const struct hg_gi_key *key, const struct hg_gi_eye *eye)
{
    return f->known && memcmp(&f->key, key, sizeof *key) == 0 &&
           memcmp(&f->eye, eye, sizeof *eye) == 0;
}

static void note(struct hg_gi_finer *f, const struct hg_gi_camera_params *params)
{
    f->key = *params->key;
    f->eye = *params->eye;
    f->known = true;
}

static enum hg_status upload(
    const struct hg_gi_camera_params *params, struct hg_gi_build *b, struct hg_error *err)
{
    const struct hg_gi_params *p = &params->waves->params;
    return b->field.count > 0 ? hg_gi_field_upload(&b->field, p->gpu, p->jobs, err) : HG_OK;
}

// --- the settled field ---------------------------------------------------------------------------

static bool is_done(const struct hg_gi_finer *f)
{
    bool done = true;
    for (uint32_t i = 0; i < f->at.count; i++)
        done = done && hg_gi_build_is_done(&f->builds[i]);
    return done;
}

bool hg_gi_camera_is_settled(
    const struct hg_gi_camera *c, const struct hg_gi_key *key, const struct hg_gi_eye *eye)
{
    return c != NULL && is_for(&c->settled, key, eye) && is_done(&c->settled);
}

// Grids that stand where they did stay, and their coarser ones with them: light comes from these
// alone.
static enum hg_status place_settled(
    struct hg_gi_camera *c, const struct hg_gi_camera_params *params, struct hg_error *err)
{
    struct hg_gi_finer *f = &c->settled;
    struct hg_gi_placement p;
    struct hg_gpu *gpu = params->waves->params.gpu;
    if (!f->known || memcmp(&f->key, params->key, sizeof f->key) != 0)
        drop(f, 0, gpu);
    const enum hg_status status = find_placement(params, NULL, &p, err);
    if (status != HG_OK)
        return status;
    uint32_t same = 0;
    while (same < p.count && same < f->at.count &&
           memcmp(&p.boxes[same], &f->at.boxes[same], sizeof *p.boxes) == 0)
        same++;
    drop(f, same, gpu);
    f->at = p;
    note(f, params);
    return HG_OK;
}

static enum hg_status advance(struct hg_gi_finer *f, const struct hg_gi_camera_params *params,
    uint64_t *rays, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i<f->at.count && * rays> 0 && status == HG_OK; i++) {
        struct hg_gi_build *b = &f->builds[i];
        struct hg_gi_field grid;
        grid_at(params, f, i, &grid);
        if (b->field.count == 0)
            status = hg_gi_build_place(b, &grid, err);
        if (status != HG_OK || hg_gi_build_is_done(b))
            continue;
        const struct hg_gi_build_params build = {params->waves, params->sources, &b->field};
        status = hg_gi_build_advance(b, &build, rays, err);
        if (status == HG_OK && hg_gi_build_is_done(b))
            status = upload(params, b, err);
    }
    return status;
}

enum hg_status hg_gi_camera_settle(struct hg_gi_camera *c, const struct hg_gi_camera_params *params,
    uint64_t *rays, struct hg_error *err)
{
    struct hg_gpu *gpu = params->waves->params.gpu;
    enum hg_status status = HG_OK;
    if (!is_for(&c->settled, params->key, params->eye))
        status = place_settled(c, params, err);
    if (status == HG_OK)
        status = advance(&c->settled, params, rays, err);
    if (status != HG_OK)
        drop(&c->settled, 0, gpu);
    else if (is_done(&c->settled))
        drop_dynamic(c, gpu);
    return status;
}

// --- the dynamic field ---------------------------------------------------------------------------

// The grids of the settled field that stand where the camera needs them; of a scene that needs none
// there are always such.
static enum hg_status try_settled(struct hg_gi_camera *c, const struct hg_gi_camera_params *params,
    bool *rests, struct hg_error *err)
{
    struct hg_gi_finer *f = &c->settled;
    struct hg_gi_placement p;
    *rests = false;
    if (!params->is_settled)
        return HG_OK;
    const enum hg_status status = find_placement(params, NULL, &p, err);
    if (status != HG_OK)
        return status;
    const bool known = f->known && memcmp(&f->key, params->key, sizeof f->key) == 0;
    *rests = known ? is_done(f) && memcmp(&f->at, &p, sizeof p) == 0 : p.count == 0;
    if (*rests && !known)
        drop(f, 0, params->waves->params.gpu);
    if (*rests)
        note(f, params);
    return HG_OK;
}

static struct hg_gi_build *find_build(struct hg_gi_finer *f, uint32_t fineness, uint32_t *index)
{
    for (*index = 0; *index < f->at.count; ++*index)
        if (f->at.boxes[*index].fineness == fineness && f->builds[*index].field.count > 0)
            return &f->builds[*index];
    return NULL;
}

// Probes of a grid that comes to another place: those that stay keep their light. So do those of
// the settled field, which the picture before may have had, though it is not of this light any
// more.
static enum hg_status take_probes(
    struct hg_gi_camera *c, const struct hg_gi_camera_params *params, uint32_t i)
{
    struct hg_gi_build *b = &c->next.builds[i];
    const struct hg_gi_box *box = &c->next.at.boxes[i];
    uint32_t k;
    const struct hg_gi_build *from = find_build(&c->dynamic, box->fineness, &k);
    if (from != NULL)
        hg_gi_box_take(&b->field, box, &from->field, &c->dynamic.at.boxes[k], b->is_new);
    from = params->on_lattice ? find_build(&c->settled, box->fineness, &k) : NULL;
    if (from == NULL || !hg_gi_build_is_done(from))
        return HG_OK;
    bool *were_new = hg_calloc(b->field.count, sizeof *were_new);
    if (!were_new)
        return HG_E_NOMEM;
    memcpy(were_new, b->is_new, b->field.count * sizeof *were_new);
    hg_gi_box_take(&b->field, box, &from->field, &c->settled.at.boxes[k], b->is_new);
    for (uint32_t probe = 0; probe < b->field.count && !params->is_settled; probe++)
        if (were_new[probe] && !b->is_new[probe])
            b->field.updates[probe] = 0;
    hg_free(were_new);
    return HG_OK;
}

static void link_grid(struct hg_gi_finer *f, uint32_t i, const struct hg_gi_camera_params *params)
{
    f->builds[i].field.coarser = i > 0 ? &f->builds[i - 1].field : &params->whole->field;
}

// The dynamic grid that stands where the next one of this box does; NULL: none.
static struct hg_gi_build *find_same(struct hg_gi_camera *c, uint32_t i)
{
    uint32_t k;
    struct hg_gi_build *same = find_build(&c->dynamic, c->next.at.boxes[i].fineness, &k);
    const bool stays = same && memcmp(&c->dynamic.at.boxes[k], &c->next.at.boxes[i],
                                   sizeof c->next.at.boxes[i]) == 0;
    return stays ? same : NULL;
}

// The grid that the next one of this box is lit by before it is updated.
static const struct hg_gi_field *coarser_of_next(
    struct hg_gi_camera *c, const struct hg_gi_camera_params *params, uint32_t i)
{
    if (i == 0)
        return &params->whole->field;
    const struct hg_gi_build *same = find_same(c, i - 1);
    return same ? &same->field : &c->next.builds[i - 1].field;
}

static enum hg_status begin_grid(struct hg_gi_camera *c, const struct hg_gi_camera_params *params,
    uint32_t i, struct hg_error *err)
{
    struct hg_gi_build *b = &c->next.builds[i];
    struct hg_gi_field grid;
    grid_at(params, &c->next, i, &grid);
    enum hg_status status = hg_gi_build_place(b, &grid, err);
    if (status == HG_OK)
        status = hg_gi_build_begin_new(b, err);
    if (status == HG_OK && take_probes(c, params, i) != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    return status;
}

static enum hg_status begin_next(
    struct hg_gi_camera *c, const struct hg_gi_camera_params *params, struct hg_error *err)
{
    const struct hg_gi_placement *before = c->dynamic.known     ? &c->dynamic.at
                                           : params->on_lattice ? &c->settled.at
                                                                : NULL;
    enum hg_status status = find_placement(params, before, &c->next.at, err);
    if (status != HG_OK)
        return status;
    c->has_next = true;
    c->next.key = *params->key;
    for (uint32_t i = 0; i < c->next.at.count && status == HG_OK; i++)
        if (!find_same(c, i))
            status = begin_grid(c, params, i, err);
    return status;
}

// Places probes of the next grids, from the coarsest on. *rays is not 0 after that: all have found
// their places.
static enum hg_status settle_next(struct hg_gi_camera *c, const struct hg_gi_camera_params *params,
    uint64_t *rays, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i<c->next.at.count && * rays> 0 && status == HG_OK; i++) {
        struct hg_gi_build *b = &c->next.builds[i];
        if (!b->is_new)
            continue;
        const struct hg_gi_build_params build = {params->waves, params->sources, &b->field};
        b->field.coarser = coarser_of_next(c, params, i);
        status = hg_gi_build_relocate_new(b, &build, rays, err);
        if (status == HG_OK && b->is_new)
            *rays = 0;
    }
    return status;
}

// Surfaces that moved may need probes that have had no light so far.
static enum hg_status outdate(struct hg_gi_build *b, enum hg_gi_change change,
    const struct hg_gi_camera_params *params, struct hg_error *err)
{
    const struct hg_gi_build_params build = {params->waves, params->sources, &b->field};
    hg_gi_build_outdate(b, change);
    return hg_gi_build_light_new(b, &build, err);
}

static enum hg_status take_next(
    struct hg_gi_camera *c, const struct hg_gi_camera_params *params, struct hg_error *err)
{
    bool is_new[HG_GI_FINER] = {false};
    struct hg_gi_finer *n = &c->next;
    const bool changed = memcmp(&n->key, params->key, sizeof n->key) != 0;
    const enum hg_gi_change change = hg_gi_change_of(&n->key, params->key, params->moves_on);
    for (uint32_t i = 0; i < n->at.count; i++) {
        struct hg_gi_build *same = find_same(c, i);
        is_new[i] = !same;
        if (same) {
            n->builds[i] = *same;
            *same = (struct hg_gi_build){0};
        }
    }
    drop(&c->dynamic, 0, params->waves->params.gpu);
    c->dynamic = *n;
    c->next = (struct hg_gi_finer){0};
    c->has_next = false;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < c->dynamic.at.count && status == HG_OK; i++) {
        link_grid(&c->dynamic, i, params);
        if (changed && is_new[i])
            status = outdate(&c->dynamic.builds[i], change, params, err);
    }
    return status;
}

// Whether the camera has grids to go on with meanwhile, and both fit into memory.
static bool may_take_time(const struct hg_gi_camera *c, const struct hg_gi_camera_params *params)
{
    const bool has_none = params->is_settled && c->settled.known && c->settled.at.count == 0;
    return (c->dynamic.known || has_none) && params->waves->params.budget_bytes == 0;
}

static enum hg_status follow(
    struct hg_gi_camera *c, const struct hg_gi_camera_params *params, struct hg_error *err)
{
    struct hg_gi_finer *f = &c->dynamic;
    const bool changed = memcmp(&f->key, params->key, sizeof f->key) != 0;
    const enum hg_gi_change change = hg_gi_change_of(&f->key, params->key, params->moves_on);
    uint64_t rays = may_take_time(c, params) ? PLACE_RAYS : UINT64_MAX;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < f->at.count && changed && status == HG_OK; i++)
        status = outdate(&f->builds[i], change, params, err);
    if (status == HG_OK && !c->has_next)
        status = begin_next(c, params, err);
    if (status == HG_OK)
        status = settle_next(c, params, &rays, err);
    if (status == HG_OK && rays > 0)
        status = take_next(c, params, err);
    note(f, params);
    return status;
}

// Waves for the grids in turn, from the finest on.
static enum hg_status update(struct hg_gi_camera *c, const struct hg_gi_camera_params *params,
    uint64_t rays, struct hg_error *err)
{
    struct hg_gi_build *builds[HG_PROBE_GRIDS];
    bool updated[HG_PROBE_GRIDS] = {false};
    uint32_t count = 0, idle = 0;
    enum hg_status status = HG_OK;
    for (uint32_t i = c->dynamic.at.count; i-- > 0;) {
        link_grid(&c->dynamic, i, params);
        builds[count++] = &c->dynamic.builds[i];
    }
    if (!params->is_settled)
        builds[count++] = params->whole;
    while (rays > 0 && idle < count && status == HG_OK) {
        const uint32_t k = c->turn++ % count;
        const struct hg_gi_build_params build = {params->waves, params->sources, &builds[0]->field};
        uint64_t cast;
        status = hg_gi_build_update(builds[k], &build, &cast, err);
        idle = cast > 0 ? 0 : idle + 1;
        updated[k] |= cast > 0;
        rays -= cast < rays ? cast : rays;
    }
    for (uint32_t k = 0; k < count && status == HG_OK; k++)
        if (updated[k] || builds[k]->field.buffer.address == 0)
            status = upload(params, builds[k], err);
    return status;
}

bool hg_gi_camera_is_still(
    const struct hg_gi_camera *c, const struct hg_gi_key *key, const struct hg_gi_eye *eye)
{
    bool still = c != NULL && is_for(&c->dynamic, key, eye) && !c->has_next;
    for (uint32_t i = 0; still && i < c->dynamic.at.count; i++)
        still = !hg_gi_build_wants_updates(&c->dynamic.builds[i]);
    return still;
}

enum hg_status hg_gi_camera_update(struct hg_gi_camera *c, const struct hg_gi_camera_params *params,
    uint64_t rays, struct hg_error *err)
{
    struct hg_gi_camera without = {0};
    bool rests;
    if (c == NULL)
        return update(&without, params, rays, err);
    enum hg_status status = try_settled(c, params, &rests, err);
    if (status != HG_OK || rests)
        return status;
    if (c->has_next || !is_for(&c->dynamic, params->key, params->eye))
        status = follow(c, params, err);
    if (status == HG_OK)
        status = update(c, params, rays, err);
    if (status != HG_OK)
        drop_dynamic(c, params->waves->params.gpu);
    return status;
}
