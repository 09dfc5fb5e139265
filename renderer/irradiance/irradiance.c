// irradiance.c - see irradiance.h.
#include "renderer/irradiance/irradiance.h"

#include <float.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/hash.h"
#include "renderer/gi/patches.h"
#include "renderer/host_shading/emissive.h"
#include "renderer/host_shading/environment.h"
#include "renderer/host_shading/surfaces.h"
#include "renderer/irradiance/cells.h"
#include "renderer/irradiance/directions.h"
#include "renderer/math/rgb9e5.h"
#include "renderer/math/sequence.h"

#define MOST_RAYS  16384u
#define MOST_EACH  4u                    // rays of a texel in one picture
#define TURN_BITS  3                     // of places along a side that have turns of their own
#define MOST_TURNS (1u << 2 * TURN_BITS) // pictures in which each texel sends once, at most
#define ACROSS     20.0f                 // cells that the height of a picture is, at any distance
#define FINEST     0.005f                // metres of the smallest cells
#define BELIEVED   2.0f                  // samples that count as much as that probe light is right
#define ENOUGH     1024u                 // rays of a cell from which on it is asked less often,
#define SELDOM     8u                    // in one of so many turns
#define WIDER      2                     // levels from a cell to the cube that has a guide
#define GREY       0.02f // of the brightest channel, that a dark one is taken to have
#define MOST_RATIO 16.0f
#define MOST_NEAR  2.0f // times as unoccluded as its cells that a texel may be
#define NEAR_FROM  4.0f // that counts wholly where as many times what is hidden would be all
#define FAR        1e6f  // metres to where orthographic cameras see lobes from
#define CANDIDATES 32u   // that are asked for together
#define BATCH      256u  // rays of a job
#define TILE_X     16u   // texels of a job, which share lookups
#define TILE_Y     8u
#define LIFT       2e-3f // of the depth, that rays begin off surfaces: levels of detail differ

struct sample {
    uint32_t at[2];                           // texel
    struct hg_irradiance_place diffuse, lobe; // lobe.cell HG_IRRADIANCE_NONE: mirrors otherwise
    struct hg_irradiance_turn turn;
    struct hg_irradiance_guide *guide; // NULL: no room
    struct hg_irradiance_direction direction;
    float position[3];
    float without[3]; // probe light
    float unoccluded; // share of the cosine lobe that nothing near occludes
    float even[3];    // radiance of the environment that way, without its peaks
    float brought[3]; // radiance
    float over;       // its cosine, over pi
    float emitted[3]; // what an emitter sent that rays of their own bring
    float straight[3]; // irradiance over pi of a peak of the environment or an emitter, if nothing
                       // is in the way
    uint32_t patch;    // of what it met
    bool to_peak;      // straight is of a peak
    bool lost, open;   // behind the triangle; met nothing
};

// A texel whose turn it is.
struct candidate {
    uint32_t at[2];
    bool rough, seldom; // seldom: not its turn in a cell with rays enough
    struct hg_irradiance_query diffuse, lobe;
};

struct hg_irradiance {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_irradiance_cells cells;
    struct hg_irradiance_guides guides;
    double origin[3];
    uint64_t light;
    bool moves; // geometry does, from picture to picture
    uint32_t doublings;
    struct sample *samples; // [MOST_RAYS]
    uint32_t count;
    struct hg_gpu_buffer rays, hits, straight, hidden;
    struct hg_gi_patches patches;
    struct hg_irradiance_stats stats;
};

// One picture in the making.
struct work {
    struct hg_irradiance *r;
    const struct hg_irradiance_picture *p;
    uint32_t *words;
    uint32_t columns, rows;
    float eye[3]; // far away where the camera is orthographic
};

// --- life ----------------------------------------------------------------------------------------

static enum hg_status make_buffers(struct hg_irradiance *r, struct hg_error *err)
{
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t item;
        const char *name;
    } rows[] = {{&r->rays, sizeof(struct hg_gpu_ray), "irradiance rays"},
        {&r->hits, sizeof(struct hg_gpu_hit), "irradiance hits"},
        {&r->straight, sizeof(struct hg_gpu_ray), "irradiance rays to lights"},
        {&r->hidden, sizeof(uint32_t), "irradiance hidden lights"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_create(r->gpu, HG_GPU_BUFFER_READBACK, MOST_RAYS * rows[i].item,
            rows[i].name, rows[i].buffer, err);
    return status;
}

uint64_t hg_irradiance_bytes(void)
{
    const uint64_t patch = sizeof(struct hg_gi_patch) + sizeof(struct hg_host_direct) +
                           sizeof(struct hg_gi_lit) + 3 * sizeof(float) +
                           HG_HOST_SHADOW_RAYS * (sizeof(struct hg_gpu_ray) + sizeof(uint32_t));
    const uint64_t ray = 2 * sizeof(struct hg_gpu_ray) + sizeof(struct hg_gpu_hit) +
                         sizeof(struct sample) + sizeof(uint32_t);
    return sizeof(struct hg_irradiance_cell) * HG_IRRADIANCE_CELLS + HG_IRRADIANCE_KEY_BYTES +
           hg_irradiance_guides_bytes() + MOST_RAYS * (patch + ray);
}

enum hg_status hg_irradiance_create(
    struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_irradiance **out, struct hg_error *err)
{
    struct hg_irradiance *r = hg_calloc(1, sizeof *r);
    *out = r;
    if (!r)
        return hg_error_set(err, HG_E_NOMEM, "irradiance", NULL, "out of host memory");
    r->gpu = gpu;
    r->jobs = jobs;
    r->samples = hg_calloc(MOST_RAYS, sizeof *r->samples);
    enum hg_status status = hg_irradiance_cells_init(&r->cells, FINEST);
    if (status == HG_OK)
        status = hg_irradiance_guides_init(&r->guides);
    if (!r->samples || status != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, "irradiance", NULL, "out of host memory");
    if (status == HG_OK)
        status = make_buffers(r, err);
    if (status == HG_OK)
        status = hg_gi_patches_reserve(&r->patches, gpu, MOST_RAYS, err);
    if (status != HG_OK) {
        hg_irradiance_destroy(r);
        *out = NULL;
    }
    return status;
}

void hg_irradiance_destroy(struct hg_irradiance *r)
{
    if (!r)
        return;
    struct hg_gpu_buffer *buffers[] = {&r->rays, &r->hits, &r->straight, &r->hidden};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        hg_gpu_buffer_destroy(r->gpu, buffers[i]);
    hg_gi_patches_finish(&r->patches, r->gpu);
    hg_irradiance_cells_finish(&r->cells);
    hg_irradiance_guides_finish(&r->guides);
    hg_free(r->samples);
    hg_free(r);
}

// --- which texels send ---------------------------------------------------------------------------

// False: there is no surface.
static bool find_point(
    const struct work *w, const uint32_t at[2], struct hg_irradiance_point *out, float *depth)
{
    const size_t texel = (size_t)at[1] * w->columns + at[0];
    const uint32_t *light = w->p->looked_up + 4 * texel;
    const struct hg_gpu_camera *c = w->p->texels.camera;
    float view[3];
    memcpy(depth, &light[3], sizeof *depth);
    if (!(*depth > 0))
        return false;
    hg_host_texel_place(&w->p->texels, at, *depth, out->position, view);
    hg_host_texel_normal(light[2], out->normal);
    const float pixel = c->orthographic ? c->pixel_size : c->pixel_angle * *depth;
    out->eye = NULL;
    out->level =
        hg_irradiance_level(&w->r->cells, pixel * (float)w->p->texels.height * (1 / ACROSS));
    return true;
}

static bool is_rough(const struct work *w, const uint32_t at[2])
{
    const size_t texel = (size_t)at[1] * w->columns + at[0];
    return w->p->lobes && hg_irradiance_is_rough(w->p->mirrors + 2 * texel);
}

static void take_sample(
    struct hg_irradiance *r, const struct candidate *c, const struct hg_irradiance_place *place)
{
    struct sample *s = &r->samples[r->count++];
    *s = (struct sample){.at = {c->at[0], c->at[1]},
        .diffuse = *place,
        .lobe = {HG_IRRADIANCE_NONE, HG_IRRADIANCE_NONE},
        .turn = hg_irradiance_take_turn(&r->cells, place->cell)};
    if (c->rough)
        (void)hg_irradiance_ask(&r->cells, &c->lobe, &s->lobe);
    s->guide = hg_irradiance_guide_ask(&r->guides,
        hg_irradiance_key(&r->cells, &c->diffuse.point, WIDER), r->cells.picture, r->cells.light);
}

// False: the texel sends no ray in this picture.
static bool is_candidate(
    const struct work *w, const uint32_t at[2], uint32_t turns, struct candidate *out)
{
    const struct hg_irradiance_cells *cells = &w->r->cells;
    const uint32_t rank = hg_dither_rank(at[0], at[1], TURN_BITS);
    struct hg_irradiance_point point;
    float depth;
    if (rank % turns != cells->picture % turns || !find_point(w, at, &point, &depth))
        return false;
    out->at[0] = at[0];
    out->at[1] = at[1];
    out->seldom = !w->r->moves && (rank / turns + cells->picture / turns) % SELDOM != 0;
    out->diffuse = hg_irradiance_query(cells, &point);
    out->rough = is_rough(w, at);
    point.eye = w->eye;
    if (out->rough)
        out->lobe = hg_irradiance_query(cells, &point);
    return true;
}

static void take_samples(
    struct hg_irradiance *r, const struct candidate *candidates, uint32_t count)
{
    for (uint32_t i = 0; i < count && r->count < MOST_RAYS; i++) {
        const struct candidate *c = &candidates[i];
        struct hg_irradiance_place place;
        if (!hg_irradiance_ask(&r->cells, &c->diffuse, &place))
            continue;
        if (!c->seldom || r->cells.cells[place.cell].rays < ENOUGH)
            take_sample(r, c, &place);
    }
}

static void choose_row(const struct work *w, uint32_t y, uint32_t turns)
{
    struct candidate candidates[CANDIDATES];
    uint32_t count = 0;
    for (uint32_t x = 0; x < w->columns; x++) {
        count += is_candidate(w, (const uint32_t[2]){x, y}, turns, &candidates[count]);
        if (count < CANDIDATES && x + 1 < w->columns)
            continue;
        take_samples(w->r, candidates, count);
        count = 0;
    }
}

// In the order of texels: what cells count does not depend on threads.
static void choose(const struct work *w)
{
    struct hg_irradiance *r = w->r;
    const float most = (w->p->share > 0 ? w->p->share : 1) * MOST_RAYS;
    const float texels = (float)w->columns * (float)w->rows;
    const float room = hg_clampf(most / fmaxf(texels, 1), 1, MOST_EACH);
    const uint32_t each = (uint32_t)room;
    uint32_t turns = 1;
    while (turns < MOST_TURNS && texels > most * (float)turns)
        turns *= 2;
    r->count = 0;
    for (uint32_t k = 0; k < each; k++)
        for (uint32_t y = 0; y < w->rows && r->count < MOST_RAYS; y++)
            choose_row(w, y, turns);
}

// --- where rays go -------------------------------------------------------------------------------

static struct hg_gpu_ray ray_of(const struct sample *s, const float direction[3])
{
    return (struct hg_gpu_ray){.origin_ws = {s->position[0], s->position[1], s->position[2]},
        .direction_ws = {direction[0], direction[1], direction[2]},
        .t_max = FLT_MAX,
        .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
}

// A ray to a peak of the environment, beside each other one.
static void choose_peak(const struct work *w, uint32_t i, const struct hg_irradiance_surface *on)
{
    struct sample *s = &w->r->samples[i];
    float direction[3] = {0, 1, 0}, light[3];
    hg_host_environment_peak(
        w->p->world.environment, w->p->sources, s->direction.xi, direction, light);
    const float cosine = hg_dot3(direction, on->facet) > 0 ? hg_dot3(direction, on->normal) : 0;
    for (int c = 0; c < 3; c++)
        s->straight[c] = cosine > 0 ? light[c] * cosine * (1 / (float)HG_PI) : 0;
    s->to_peak = true;
    struct hg_gpu_ray *ray = (struct hg_gpu_ray *)w->r->straight.mapped + i;
    *ray = ray_of(s, direction);
    ray->t_max = cosine > 0 ? FLT_MAX : -1;
}

static void choose_emitter(const struct work *w, uint32_t i, const struct hg_irradiance_surface *on)
{
    struct sample *s = &w->r->samples[i];
    struct hg_host_emissive_receiver receiver = {
        .normal = on->normal, .seed = hg_hash_mix(w->r->cells.picture, i)};
    struct hg_host_emissive_ray to;
    hg_copy3(s->position, receiver.position);
    const bool shines = hg_host_emissive_choose(w->p->world.emissive, &receiver, &to) &&
                        hg_dot3(to.direction, on->facet) > 0;
    struct hg_gpu_ray *ray = (struct hg_gpu_ray *)w->r->straight.mapped + i;
    *ray = ray_of(s, shines ? to.direction : on->facet);
    ray->t_max = shines ? to.distance : -1;
    for (int c = 0; c < 3; c++)
        s->straight[c] = shines ? to.light[c] : 0;
}

static bool has_emitters(const struct work *w)
{
    return w->p->world.emissive->count > 0;
}

static bool has_straight(const struct work *w)
{
    return w->p->world.environment->has_peaks || has_emitters(w);
}

// Where there are both, samples take turns.
static void choose_straight(
    const struct work *w, uint32_t i, const struct hg_irradiance_surface *on)
{
    const bool both = w->p->world.environment->has_peaks && has_emitters(w);
    if (both ? ((i + w->r->cells.picture) & 1) != 0 : has_emitters(w))
        choose_emitter(w, i, on);
    else
        choose_peak(w, i, on);
    for (int c = 0; c < 3 && both; c++)
        w->r->samples[i].straight[c] *= 2;
}

static void surface_at(
    const struct work *w, const uint32_t at[2], struct hg_irradiance_surface *out)
{
    const size_t texel = (size_t)at[1] * w->columns + at[0];
    hg_irradiance_surface_at(
        &w->p->texels, at, w->p->looked_up + 4 * texel, w->p->mirrors + 2 * texel, out);
    out->rough &= w->p->lobes;
}

// By the ambient occlusion of probe light.
static float unoccluded_of(const uint32_t light[4])
{
    const uint32_t bits = light[3] & HG_PROBE_LIGHT_OPEN_MASK;
    return (float)bits * (1 / (float)HG_PROBE_LIGHT_OPEN_MASK);
}

// Interpolated normals may lie far off their triangle. What comes from behind that is lost, as it
// is in path mode.
static void send(const struct work *w, uint32_t i)
{
    struct hg_irradiance *r = w->r;
    struct sample *s = &r->samples[i];
    struct hg_gpu_ray *ray = (struct hg_gpu_ray *)r->rays.mapped + i;
    struct hg_irradiance_surface on;
    struct hg_irradiance_point point;
    struct hg_irradiance_distribution d;
    float depth;
    (void)find_point(w, s->at, &point, &depth);
    surface_at(w, s->at, &on);
    hg_mad3(point.position, on.facet, LIFT * depth, s->position);
    const uint32_t *light = w->p->looked_up + 4 * ((size_t)s->at[1] * w->columns + s->at[0]);
    hg_rgb9e5_unpack(light[0], s->without);
    s->unoccluded = unoccluded_of(light);
    const bool guided =
        s->guide && hg_irradiance_guide_distribution(&r->guides, s->guide, on.normal, &d);
    hg_irradiance_choose(&s->turn, &on, guided ? &d : NULL, &s->direction);
    s->lost = hg_dot3(s->direction.way, on.facet) < 0;
    s->over = fmaxf(hg_dot3(s->direction.way, on.normal), 0) * (1 / (float)HG_PI);
    *ray = ray_of(s, s->direction.way);
    if (s->lost)
        ray->t_max = -1;
    if (has_straight(w))
        choose_straight(w, i, &on);
}

static void send_batch(void *user, size_t batch)
{
    const struct work *w = user;
    const uint32_t first = (uint32_t)batch * BATCH;
    for (uint32_t i = first; i < first + BATCH && i < w->r->count; i++)
        send(w, i);
}

// --- what rays bring -----------------------------------------------------------------------------

// The surface that a ray met; what met none has the environment's light.
static void meet(const struct work *w, uint32_t i)
{
    struct hg_irradiance *r = w->r;
    struct sample *s = &r->samples[i];
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)r->hits.mapped + i;
    struct hg_host_surface surface;
    hg_host_environment_even(w->p->world.environment, w->p->sources, s->direction.way, s->even);
    if (s->open)
        hg_copy3(s->even, s->brought);
    if (s->open || s->lost)
        return;
    hg_host_surface_at(w->p->world.surfaces, hit, s->direction.way, &surface);
    struct hg_gi_patch *patch = &r->patches.points[s->patch];
    const struct hg_host_material *m = surface.material;
    hg_mad3(s->position, s->direction.way, hit->t, patch->position);
    hg_copy3(surface.normal, patch->normal);
    hg_copy3(m->albedo, patch->albedo);
    const float share = hg_host_emissive_share(w->p->world.emissive, m->emitted, hit->t,
        fabsf(hg_dot3(surface.normal, s->direction.way)), s->over);
    for (int c = 0; c < 3; c++) { // what has one side shines to that side
        s->emitted[c] = surface.back ? 0 : share * m->emitted[c];
        patch->emission[c] = surface.back ? 0 : m->emission[c] - s->emitted[c];
    }
}

static void meet_batch(void *user, size_t batch)
{
    const struct work *w = user;
    const uint32_t first = (uint32_t)batch * BATCH;
    for (uint32_t i = first; i < first + BATCH && i < w->r->count; i++)
        meet(w, i);
}

static void number_patches(struct hg_irradiance *r)
{
    const struct hg_gpu_hit *hits = r->hits.mapped;
    r->patches.count = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        struct sample *s = &r->samples[i];
        s->open = !s->lost && hits[i].draw == HG_HIT_NONE;
        r->stats.misses += s->open;
        s->patch = r->patches.count;
        r->patches.count += !s->lost && !s->open;
    }
}

// The environment as rays meet it is noise where it is uneven, and so is what they see of it: the
// quotient, by which its irradiance is multiplied, is not where all of it is seen.
static void add_diffuse(const struct work *w, const struct sample *s, bool straight)
{
    const float weight = s->direction.diffuse;
    struct hg_irradiance_sums sum = {.weight = weight, .unoccluded = weight * s->unoccluded};
    const float most = fmaxf(s->without[0], fmaxf(s->without[1], s->without[2]));
    float all = 0;
    for (int c = 0; c < 3; c++) {
        const float peak = s->to_peak ? s->straight[c] : 0, emitter = s->straight[c] - peak;
        sum.gathered[c] = (s->open ? 0 : weight * s->brought[c]) + (straight ? emitter : 0);
        sum.without[c] = weight * (s->without[c] + GREY * most);
        sum.all[c] = weight * s->even[c] + peak;
        sum.seen[c] = (s->open ? weight * s->even[c] : 0) + (straight ? peak : 0);
        all += sum.gathered[c] + sum.all[c];
    }
    if (most > 0 && all < FLT_MAX)
        hg_irradiance_add(&w->r->cells, &s->diffuse, &sum);
}

// The prefiltered environment is multiplied by the share of its light that is seen: of a sky that
// is bright at the horizon and seen at the zenith alone that is less than the share of directions.
static void add_lobe(const struct work *w, const struct sample *s)
{
    const float weight = s->direction.mirrored;
    const float all = weight * hg_luminance(s->even), seen = s->open ? all : 0;
    struct hg_irradiance_sums sum = {.without = {weight, seen, all}};
    for (int c = 0; c < 3; c++)
        sum.gathered[c] = s->open ? 0 : weight * (s->brought[c] + s->emitted[c]);
    if (weight > 0 && sum.gathered[0] + sum.gathered[1] + sum.gathered[2] + all < FLT_MAX)
        hg_irradiance_add(&w->r->cells, &s->lobe, &sum);
}

// Three that know nothing of each other, each in the order of samples.
enum sums { DIFFUSE, LOBES, GUIDES, SUMS };

static void add(void *user, size_t to)
{
    const struct work *w = user;
    struct hg_irradiance *r = w->r;
    const uint32_t *hidden = r->hidden.mapped;
    const bool straight = has_straight(w);
    for (uint32_t i = 0; i < r->count; i++) {
        const struct sample *s = &r->samples[i];
        if (to == DIFFUSE)
            add_diffuse(w, s, straight && !hidden[i]);
        else if (to == LOBES && s->lobe.cell != HG_IRRADIANCE_NONE)
            add_lobe(w, s);
        else if (to == GUIDES && s->guide && !s->lost)
            hg_irradiance_guide_add(s->guide, s->direction.way, hg_luminance(s->brought));
    }
}

// Of surfaces; what met none, or is lost, has what it brought.
static void bring(struct hg_irradiance *r)
{
    for (uint32_t i = 0; i < r->count; i++) {
        struct sample *s = &r->samples[i];
        if (!s->lost && !s->open)
            hg_copy3(r->patches.radiance[s->patch], s->brought);
    }
}

static enum hg_status gather(struct work *w, struct hg_error *err)
{
    struct hg_irradiance *r = w->r;
    struct hg_host_caster *caster = w->p->world.caster;
    uint32_t more;
    const struct hg_gi_patch_lighting with = {
        r->jobs, w->p->sources, &w->p->world, r->cells.picture};
    struct hg_trace_wave wave = {.rays = &r->rays, .hits = &r->hits, .count = r->count};
    const size_t batches = (r->count + BATCH - 1) / BATCH;
    hg_jobs_for(r->jobs, batches, send_batch, w);
    enum hg_status status = r->count > 0 ? hg_host_cast(caster, &wave, &more, err) : HG_OK;
    if (status != HG_OK)
        return status;
    number_patches(r);
    hg_jobs_for(r->jobs, batches, meet_batch, w);
    status = hg_gi_patches_light(&r->patches, &with, &r->stats.shadow_rays, err);
    wave = (struct hg_trace_wave){.rays = &r->straight, .blocked = &r->hidden, .count = r->count};
    if (status == HG_OK && r->count > 0 && has_straight(w))
        status = hg_host_cast_shadows(caster, &wave, err);
    if (status != HG_OK)
        return status;
    bring(r);
    hg_jobs_for(r->jobs, SUMS, add, w);
    return HG_OK;
}

// --- what they change ----------------------------------------------------------------------------

// So much of the environment's irradiance pixels add themselves, on normals that textures turn.
static void leave_to_pixels(float share, const float sky[3], float light[3], uint32_t words[4])
{
    const uint32_t steps = (uint32_t)(share * HG_PROBE_LIGHT_SKY_MOST);
    const float left = (float)steps * (1.0f / HG_PROBE_LIGHT_SKY_MOST);
    for (int c = 0; c < 3; c++)
        light[c] = fmaxf(light[c] - left * sky[c], 0);
    words[0] = hg_rgb9e5_pack(light[0], light[1], light[2]);
    words[2] |= steps << HG_PROBE_LIGHT_SKY_SHIFT;
}

// Light of surfaces as much more or less than probe light as in the cells; the environment's as
// much as is seen of it there, in more or less near occlusion.
static void apply_diffuse(const struct work *w, const struct hg_irradiance_point *point,
    struct hg_irradiance_lookups *lookups, uint32_t words[4])
{
    struct hg_irradiance_sums sums;
    float light[3], sky[3];
    hg_irradiance_look_up(&w->r->cells, point, lookups, &sums);
    if (!(sums.samples > 0))
        return;
    hg_rgb9e5_unpack(words[0], light);
    hg_host_environment_irradiance(w->p->sources, point->normal, sky);
    const float most = fmaxf(light[0], fmaxf(light[1], light[2]));
    const float relative = unoccluded_of(words) * sums.weight / fmaxf(sums.unoccluded, FLT_MIN);
    const float near = fminf(relative, MOST_NEAR);
    const float known = sums.samples / (sums.samples + BELIEVED);
    float least = 1;
    for (int c = 0; c < 3; c++) {
        const float ratio = fminf(sums.gathered[c] / fmaxf(sums.without[c], FLT_MIN), MOST_RATIO);
        const float share = sums.seen[c] / fmaxf(sums.all[c], FLT_MIN);
        const float detail = 1 + (near - 1) * fminf((1 - share) * NEAR_FROM, 1);
        const float seen = fminf(share * detail, 1);
        const float found = ratio * (light[c] + GREY * most) + seen * sky[c];
        light[c] = known * found + (1 - known) * light[c];
        least = fminf(least, known * seen);
    }
    leave_to_pixels(least, sky, light, words);
}

// What a rough surface mirrors: light of surfaces, and the share of the environment in the upper
// bits of the next word.
static void apply_lobe(const struct work *w, const struct hg_irradiance_point *point,
    struct hg_irradiance_lookups *lookups, uint32_t words[2])
{
    struct hg_irradiance_point seen = *point;
    struct hg_irradiance_sums sums;
    float light[3];
    seen.eye = w->eye;
    hg_irradiance_look_up(&w->r->cells, &seen, lookups, &sums);
    if (!(sums.without[0] > 0))
        return;
    const float known = sums.samples / (sums.samples + BELIEVED), scale = known / sums.without[0];
    hg_rgb9e5_unpack(words[0], light);
    for (int c = 0; c < 3; c++)
        light[c] = light[c] * (1 - known) + sums.gathered[c] * scale;
    const float sky = 255 * sums.without[1] / fmaxf(sums.without[2], FLT_MIN);
    const float open = (float)(words[1] >> 24) * (1 - known) + known * sky;
    words[0] = hg_rgb9e5_pack(light[0], light[1], light[2]);
    words[1] = (words[1] & 0xffffff) | (uint32_t)(hg_clampf(open, 0, 255) + 0.5f) << 24;
}

static void apply_at(const struct work *w, const uint32_t at[2],
    struct hg_irradiance_lookups *diffuse, struct hg_irradiance_lookups *lobes)
{
    const size_t texel = (size_t)at[1] * w->columns + at[0];
    uint32_t *words = w->words + 4 * texel;
    struct hg_irradiance_point point;
    float depth;
    if (!find_point(w, at, &point, &depth))
        return;
    if (w->p->diffuse)
        apply_diffuse(w, &point, diffuse, words);
    if (is_rough(w, at))
        apply_lobe(w, &point, lobes, words + 1);
}

// Texels beside and below each other mostly lie between the same cells.
static void apply_tile(void *user, size_t tile)
{
    const struct work *w = user;
    const uint32_t across = (w->columns + TILE_X - 1) / TILE_X;
    const uint32_t x0 = (uint32_t)tile % across * TILE_X, y0 = (uint32_t)tile / across * TILE_Y;
    struct hg_irradiance_lookups diffuse = {0}, lobes = {0};
    for (uint32_t y = y0; y < y0 + TILE_Y && y < w->rows; y++)
        for (uint32_t x = x0; x < x0 + TILE_X && x < w->columns; x++)
            apply_at(w, (const uint32_t[2]){x, y}, &diffuse, &lobes);
}

static void apply(struct work *w)
{
    const size_t across = (w->columns + TILE_X - 1) / TILE_X;
    hg_jobs_for(w->r->jobs, across * ((w->rows + TILE_Y - 1) / TILE_Y), apply_tile, w);
}

// --- the picture ---------------------------------------------------------------------------------

static void sync(struct hg_irradiance *r, const struct hg_irradiance_picture *p)
{
    if (memcmp(r->origin, p->origin, sizeof r->origin) != 0) {
        hg_irradiance_cells_clear(&r->cells);
        hg_irradiance_guides_clear(&r->guides);
    }
    memcpy(r->origin, p->origin, sizeof r->origin);
    // In a scene that moves all the while samples of the picture before are nearly as good.
    const bool differs = p->light != r->light, is_new = differs && !p->world.moves_on;
    // Views that have the settled field have seen no updates.
    r->cells.light += is_new || p->doublings > r->doublings;
    r->doublings = is_new || p->doublings > r->doublings ? p->doublings : r->doublings;
    r->moves = differs && !is_new;
    r->light = p->light;
    r->cells.picture++;
}

enum hg_status hg_irradiance_run(struct hg_irradiance *r,
    const struct hg_irradiance_picture *picture, uint32_t *words, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns(), cpu = hg_clock_cpu_ns();
    struct work w = {.r = r,
        .p = picture,
        .words = words,
        .columns = (picture->texels.width + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX,
        .rows = (picture->texels.height + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX};
    const struct hg_gpu_camera *c = picture->texels.camera;
    const float away = c->orthographic ? FAR : 0;
    const float eye[3] = {c->eye_ws.x, c->eye_ws.y, c->eye_ws.z};
    const float ahead[3] = {c->forward_ws.x, c->forward_ws.y, c->forward_ws.z};
    hg_mad3(eye, ahead, -away, w.eye);
    r->stats = (struct hg_irradiance_stats){0};
    sync(r, picture);
    choose(&w);
    const enum hg_status status = gather(&w, err);
    if (status == HG_OK)
        apply(&w);
    r->stats.rays = r->count;
    r->stats.cells = r->cells.count;
    r->stats.ns = hg_clock_now_ns() - begin;
    r->stats.cpu_ns = hg_clock_cpu_ns() - cpu;
    r->stats.bytes = hg_irradiance_bytes();
    return status;
}

void hg_irradiance_stats(const struct hg_irradiance *r, struct hg_irradiance_stats *out)
{
    *out = r ? r->stats : (struct hg_irradiance_stats){0};
}
