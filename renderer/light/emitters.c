#include "renderer/light/emitters.h"

#include <math.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/mix.h"
#include "renderer/light/env_warp.h"
#include "renderer/light/glow.h"
#include "renderer/light/light_tree.h"
#include "renderer/light/lights.h"
#include "renderer/light/sky.h"
#include "renderer/light/vec.h"
#include "renderer/texture/page_cache.h"

#define BUDGET     (96ull << 20)
#define LEAF_BYTES (2 * sizeof(struct hg_gpu_light_node) + sizeof(struct hg_gpu_emitter_leaf) + 4)
#define MOST_SHIFT 8    // 256 triangles per leaf
#define BLOCK      1024 // leaves per job

// An emissive texture, by what it shows.
struct glow_entry {
    uint64_t texture, revision;
    enum hg_texture_use use;
    struct hg_glow glow;
    bool used;
};

// A part that shines.
struct source {
    const struct hg_emitter_part *part;
    const struct hg_glow *glow; // NULL: no texture
    uint32_t glow_index;        // in `glows`, UINT32_MAX: none
    float luminance;            // of the factor
    uint32_t first_leaf, leaf_count;
    uint32_t first_weight;
};

struct hg_emitters {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    uint64_t budget_bytes;
    struct hg_light_set set;                      // scratch
    const struct hg_light_set *opening, *closing; // of a shutter; NULL: nothing moves
    struct hg_gpu_light *lights;                  // then those of the opening, if any
    size_t light_capacity;
    bool lights_move;
    uint32_t light_count, directional_count;
    float directional_lux;
    struct glow_entry *glows;
    size_t glow_capacity;
    uint32_t glow_count;
    struct source *sources; // scratch
    size_t source_capacity;
    uint32_t source_count, shift;
    uint64_t signature; // of what the tables show; 0: nothing
    uint64_t env_signature;
    uint32_t environment_levels;
    float environment_mean; // 0: black
    struct hg_gpu_buffer nodes, leaves, trails, weights, pieces, draw_pieces, light_table,
        directional, environment;
    struct hg_gpu_emitters block;
    struct hg_emitters_stats stats;
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "emitters", NULL, "no memory for tables of lights");
}

static float luminance_of(float r, float g, float b)
{
    const float sum = 0.2126f * fmaxf(r, 0) + 0.7152f * fmaxf(g, 0) + 0.0722f * fmaxf(b, 0);
    return isfinite(r) && isfinite(g) && isfinite(b) && isfinite(sum) ? sum : 0;
}

static float luminance(const float c[3])
{
    return luminance_of(c[0], c[1], c[2]);
}

static float light_luminance(const struct hg_gpu_light *light)
{
    return luminance_of(light->color.x, light->color.y, light->color.z);
}

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_emitters_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    const struct hg_emitters_params *params, struct hg_emitters **out, struct hg_error *err)
{
    *out = hg_calloc(1, sizeof **out);
    if (!*out)
        return no_memory(err);
    (*out)->gpu = gpu;
    (*out)->jobs = jobs;
    (*out)->budget_bytes = params && params->budget_bytes ? params->budget_bytes : BUDGET;
    return HG_OK;
}

#define BUFFERS 9
static void list_buffers(struct hg_emitters *e, struct hg_gpu_buffer *out[BUFFERS])
{
    struct hg_gpu_buffer *all[BUFFERS] = {&e->nodes, &e->leaves, &e->trails, &e->weights,
        &e->pieces, &e->draw_pieces, &e->light_table, &e->directional, &e->environment};
    memcpy(out, all, sizeof all);
}

void hg_emitters_destroy(struct hg_emitters *e)
{
    if (!e)
        return;
    struct hg_gpu_buffer *buffers[BUFFERS];
    list_buffers(e, buffers);
    for (int i = 0; i < BUFFERS; i++)
        hg_gpu_buffer_destroy(e->gpu, buffers[i]);
    for (uint32_t i = 0; i < e->glow_count; i++)
        hg_glow_finish(&e->glows[i].glow);
    hg_free(e->glows);
    hg_free(e->lights);
    hg_free(e->sources);
    hg_light_set_finish(&e->set);
    hg_free(e);
}

static enum hg_status put(struct hg_emitters *e, struct hg_gpu_buffer *buffer, const char *name,
    const void *data, uint64_t bytes, struct hg_error *err)
{
    if (!bytes)
        return HG_OK;
    enum hg_status status =
        hg_gpu_buffer_reserve(e->gpu, HG_GPU_BUFFER_DEVICE, bytes, name, buffer, err);
    return status ? status : hg_gpu_buffer_upload(e->gpu, buffer, 0, data, bytes, err);
}

// --- punctual lights -----------------------------------------------------------------------------

static bool is_finite3(struct hg_vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

static bool is_usable(const struct hg_gpu_light *light)
{
    return light_luminance(light) > 0 && is_finite3(light->direction_ws) &&
           isfinite(light->inv_range_sq) && isfinite(light->spot_scale) &&
           isfinite(light->spot_offset) &&
           (light->kind == HG_LIGHT_KIND_DIRECTIONAL || is_finite3(light->position_ws));
}

// Directional ones first, as in the set. Adds to *h.
static enum hg_status collect_lights(
    struct hg_emitters *e, const struct hg_emitter_input *in, uint64_t *h)
{
    if (hg_light_set_collect(&e->set, in->scene, in->origin) ||
        hg_grow(&e->lights, &e->light_capacity, 2 * (size_t)e->set.count + 1, sizeof *e->lights))
        return HG_E_NOMEM;
    // Lights that are there at one time only stay as the scene has them, all of them.
    e->lights_move = e->opening && e->closing && e->opening->count == e->set.count &&
                     e->closing->count == e->set.count;
    const struct hg_gpu_light *now = e->lights_move ? e->closing->items : e->set.items;
    const struct hg_gpu_light *then = e->lights_move ? e->opening->items : e->set.items;
    e->light_count = e->directional_count = 0;
    e->directional_lux = 0;
    for (uint32_t i = 0; i < e->set.count; i++) {
        const struct hg_gpu_light *light = &now[i];
        if (!is_usable(light) || !is_usable(&then[i]))
            continue;
        if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
            e->directional_count++;
            e->directional_lux += light_luminance(light);
        }
        *h = hg_mix_bytes(*h, light, sizeof *light);
        e->lights[e->light_count++] = *light;
    }
    for (uint32_t i = 0, k = e->light_count; i < e->set.count && e->lights_move; i++) {
        if (!is_usable(&now[i]) || !is_usable(&then[i]))
            continue;
        *h = hg_mix_bytes(*h, &then[i], sizeof then[i]);
        e->lights[k++] = then[i];
    }
    return HG_OK;
}

static struct hg_light_item item_of_light(const struct hg_gpu_light *light)
{
    struct hg_light_item item = {.cos_o = -1,
        .cos_e = 1,
        .power = light_luminance(light),
        .range = hg_gpu_light_range(light)};
    memcpy(item.min, &light->position_ws, sizeof item.min);
    memcpy(item.max, &light->position_ws, sizeof item.max);
    memcpy(item.axis, &light->direction_ws, sizeof item.axis);
    // The cone ends where cos * scale + offset is 0.
    if (light->kind == HG_LIGHT_KIND_SPOT && light->spot_scale > 0 &&
        hg_dot3(item.axis, item.axis) > 0.5f)
        item.cos_o = hg_clampf(-light->spot_offset / light->spot_scale - 1e-4f, -1, 1);
    return item;
}

// All that the light sends on its way.
static void widen(struct hg_light_item *item, const struct hg_light_item *then)
{
    for (int i = 0; i < 3; i++) {
        item->min[i] = fminf(item->min[i], then->min[i]);
        item->max[i] = fmaxf(item->max[i], then->max[i]);
    }
    if (memcmp(item->axis, then->axis, sizeof item->axis) != 0)
        item->cos_o = -1;
    item->cos_o = fminf(item->cos_o, then->cos_o);
    item->power = fmaxf(item->power, then->power);
    item->range = item->range > 0 && then->range > 0 ? fmaxf(item->range, then->range) : 0;
}

static enum hg_status upload_lights(struct hg_emitters *e, struct hg_error *err)
{
    float *shares = hg_calloc((size_t)e->directional_count + 1, sizeof *shares);
    if (!shares)
        return no_memory(err);
    double sum = 0;
    for (uint32_t i = 0; i < e->directional_count; i++) {
        sum += (double)light_luminance(&e->lights[i]) / (double)e->directional_lux;
        shares[i] = i + 1 < e->directional_count ? (float)fmin(1, sum) : 1;
    }
    enum hg_status status = put(e, &e->light_table, "emitters: lights", e->lights,
        (e->lights_move ? 2 : 1) * e->light_count * sizeof *e->lights, err);
    if (!status)
        status = put(e, &e->directional, "emitters: directional", shares,
            e->directional_count * sizeof *shares, err);
    hg_free(shares);
    return status;
}

// --- emissive parts ------------------------------------------------------------------------------

static bool shines(const struct hg_emitter_part *part)
{
    const struct hg_material *m = part->material;
    return m && !m->unlit && part->piece->triangle_count > 0 && part->piece->positions &&
           part->piece->indices && !(part->piece->flags & (HG_DRAW_LINES | HG_DRAW_POINTS)) &&
           luminance(m->emissive) > 0;
}

static enum hg_status find_glow(struct hg_emitters *e, struct hg_textures *textures,
    const struct hg_material *m, uint32_t *index)
{
    const struct hg_texture *texture = m->slots[HG_SLOT_EMISSIVE].texture;
    const enum hg_texture_use use = hg_texture_slot_use(m, HG_SLOT_EMISSIVE);
    *index = UINT32_MAX;
    if (!texture || !textures)
        return HG_OK;
    for (uint32_t i = 0; i < e->glow_count; i++) {
        struct glow_entry *g = &e->glows[i];
        if (g->texture == texture->head.id && g->revision == texture->head.revision &&
            g->use == use) {
            g->used = true;
            *index = i;
            return HG_OK;
        }
    }
    if (hg_grow(&e->glows, &e->glow_capacity, e->glow_count + 1, sizeof *e->glows))
        return HG_E_NOMEM;
    struct glow_entry entry = {texture->head.id, texture->head.revision, use, {0}, true};
    if (hg_glow_make(
            hg_page_cache_sources(hg_textures_cache(textures)), texture, use, 0, &entry.glow))
        return HG_E_NOMEM;
    *index = e->glow_count;
    e->glows[e->glow_count++] = entry;
    return HG_OK;
}

// What is no longer used goes; indices are made into pointers.
static void keep_used_glows(struct hg_emitters *e)
{
    uint32_t *moved = NULL, kept = 0;
    bool all = true;
    for (uint32_t i = 0; i < e->glow_count; i++)
        all = all && e->glows[i].used;
    if (!all)
        moved = hg_calloc(e->glow_count, sizeof *moved);
    for (uint32_t i = 0; i < e->glow_count && moved; i++) {
        moved[i] = kept;
        if (e->glows[i].used)
            e->glows[kept++] = e->glows[i];
        else
            hg_glow_finish(&e->glows[i].glow);
    }
    if (moved)
        e->glow_count = kept;
    for (uint32_t i = 0; i < e->source_count; i++) {
        struct source *s = &e->sources[i];
        if (s->glow_index != UINT32_MAX)
            s->glow = &e->glows[moved ? moved[s->glow_index] : s->glow_index].glow;
    }
    hg_free(moved);
}

static uint64_t mix_part(uint64_t h, const struct hg_emitter_part *part, uint64_t poses)
{
    const struct hg_cut_piece *p = part->piece;
    const struct hg_material *m = part->material;
    const struct hg_texture_ref *ref = &m->slots[HG_SLOT_EMISSIVE];
    h = hg_mix(hg_mix(h, p->key), (uint64_t)p->draw << 32 | p->first_primitive);
    h = hg_mix(hg_mix(h, p->triangle_count), p->flags);
    h = hg_mix_bytes(h, p->world, sizeof p->world);
    h = hg_mix_bytes(h, p->previous, sizeof p->previous);
    h = hg_mix_bytes(h, m->emissive, sizeof m->emissive);
    if (ref->texture) {
        h = hg_mix(hg_mix(h, ref->texture->head.id), ref->texture->head.revision);
        h = hg_mix_bytes(hg_mix(h, ref->uv_set), ref->uv_transform, sizeof ref->uv_transform);
        h = hg_mix(h, part->uv != NULL);
    }
    return p->deforms ? hg_mix(h, poses) : h;
}

static enum hg_status collect_sources(
    struct hg_emitters *e, const struct hg_emitter_input *in, uint64_t *h)
{
    e->source_count = 0;
    e->stats.triangles = 0;
    for (uint32_t i = 0; i < e->glow_count; i++)
        e->glows[i].used = false;
    for (uint32_t i = 0; i < in->part_count; i++) {
        const struct hg_emitter_part *part = &in->parts[i];
        if (!shines(part))
            continue;
        if (hg_grow(&e->sources, &e->source_capacity, e->source_count + 1, sizeof *e->sources))
            return HG_E_NOMEM;
        struct source s = {.part = part, .luminance = luminance(part->material->emissive)};
        if (find_glow(e, in->textures, part->material, &s.glow_index))
            return HG_E_NOMEM;
        e->sources[e->source_count++] = s;
        e->stats.triangles += part->piece->triangle_count;
        *h = mix_part(*h, part, in->poses);
    }
    keep_used_glows(e);
    *h = hg_mix(hg_mix(*h, in->draw_count), e->source_count);
    return HG_OK;
}

// Triangles per leaf, and how many sources fit.
static void plan_leaves(struct hg_emitters *e, uint32_t *leaf_count, uint32_t *weight_count)
{
    const uint64_t lights = (uint64_t)(e->light_count - e->directional_count) * LEAF_BYTES;
    const uint64_t room = e->budget_bytes > lights ? e->budget_bytes - lights : 0;
    uint64_t leaves = 0, bytes = 0;
    for (e->shift = 0; e->shift <= MOST_SHIFT; e->shift++) {
        leaves = 0;
        for (uint32_t i = 0; i < e->source_count; i++)
            leaves += (((uint64_t)e->sources[i].part->piece->triangle_count - 1) >> e->shift) + 1;
        bytes = leaves * LEAF_BYTES + (e->shift > 0 ? e->stats.triangles * 2 : 0);
        if (bytes <= room && leaves < 1u << 29)
            break;
    }
    e->shift = e->shift > MOST_SHIFT ? MOST_SHIFT : e->shift;
    uint64_t used = 0, weights = 0, left_out = 0;
    uint32_t kept = 0;
    leaves = 0;
    for (uint32_t i = 0; i < e->source_count; i++) {
        struct source *s = &e->sources[i];
        const uint64_t triangles = s->part->piece->triangle_count;
        const uint64_t n = ((triangles - 1) >> e->shift) + 1;
        bytes = n * LEAF_BYTES + (e->shift > 0 ? triangles * 2 : 0);
        if (used + bytes > room || leaves + n >= 1u << 29 || weights + triangles > UINT32_MAX) {
            left_out += triangles;
            continue;
        }
        s->first_leaf = (uint32_t)leaves;
        s->leaf_count = (uint32_t)n;
        s->first_weight = (uint32_t)weights;
        leaves += n;
        weights += e->shift > 0 ? triangles : 0;
        used += bytes;
        e->sources[kept++] = *s;
    }
    e->source_count = kept;
    if (left_out && left_out != e->stats.left_out)
        hg_warn(LIGHT,
            "%llu emissive triangles do not fit %llu MiB: only rays that meet them see their light",
            (unsigned long long)left_out, (unsigned long long)(e->budget_bytes >> 20));
    e->stats.left_out = left_out;
    *leaf_count = (uint32_t)leaves;
    *weight_count = (uint32_t)weights;
}

// --- triangles -----------------------------------------------------------------------------------

struct triangle {
    double normal[3]; // unit
    double area;      // 0: not good for anything
    float min[3], max[3];
};

static void transform(const float m[12], const float p[3], double out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = (double)m[r] * (double)p[0] + (double)m[3 + r] * (double)p[1] +
                 (double)m[6 + r] * (double)p[2] + (double)m[9 + r];
}

static void grow_box(struct triangle *t, const double p[3], bool first)
{
    for (int a = 0; a < 3; a++) {
        // Rounded outwards: the device multiplies in floats.
        const double slack = fabs(p[a]) * 4e-7;
        const float low = (float)(p[a] - slack), high = (float)(p[a] + slack);
        t->min[a] = first ? low : fminf(t->min[a], low);
        t->max[a] = first ? high : fmaxf(t->max[a], high);
    }
}

static struct triangle triangle_at(const struct hg_cut_piece *piece, uint32_t index)
{
    struct triangle t = {.area = 0};
    double p[3][3], e1[3], e2[3], length = 0;
    const bool moves = memcmp(piece->world, piece->previous, sizeof piece->world) != 0;
    bool good = true;
    for (int c = 0; c < 3; c++) {
        const uint32_t vertex = piece->indices[(size_t)index * 3 + (size_t)c];
        if (vertex >= piece->vertex_count)
            return t;
        const float *at = piece->positions + (size_t)vertex * 3;
        transform(piece->world, at, p[c]);
        grow_box(&t, p[c], c == 0);
        if (moves || piece->opening != NULL) {
            double before[3];
            const float *from = piece->opening != NULL ? piece->opening : piece->positions;
            transform(piece->previous, from + (size_t)vertex * 3, before);
            grow_box(&t, before, false);
        }
    }
    for (int a = 0; a < 3; a++) {
        e1[a] = p[1][a] - p[0][a];
        e2[a] = p[2][a] - p[0][a];
        good = good && isfinite(t.min[a]) && isfinite(t.max[a]);
    }
    for (int a = 0; a < 3; a++) {
        t.normal[a] = e1[(a + 1) % 3] * e2[(a + 2) % 3] - e1[(a + 2) % 3] * e2[(a + 1) % 3];
        length += t.normal[a] * t.normal[a];
    }
    length = sqrt(length);
    if (!good || !(length > 0) || !isfinite(length) || !((float)length > 0))
        return t;
    const double sign = piece->flags & HG_DRAW_MIRRORED ? -1 : 1;
    for (int a = 0; a < 3; a++)
        t.normal[a] *= sign / length;
    t.area = length / 2;
    return t;
}

// Mean of the texture over a triangle; 1 without one.
static float glow_of(const struct source *s, uint32_t index)
{
    const struct hg_texture_ref *ref = &s->part->material->slots[HG_SLOT_EMISSIVE];
    float min[2] = {INFINITY, INFINITY}, max[2] = {-INFINITY, -INFINITY};
    if (!s->glow)
        return 1;
    for (uint32_t c = 0; c < 3 && s->part->uv; c++) {
        const uint32_t vertex = s->part->piece->indices[(size_t)index * 3 + c];
        const float *uv = s->part->uv + (size_t)vertex * s->part->uv_stride;
        for (int a = 0; a < 2; a++) {
            const float *row = ref->uv_transform + a * 3;
            const float at = row[0] * uv[0] + row[1] * uv[1] + row[2];
            min[a] = fminf(min[a], at);
            max[a] = fmaxf(max[a], at);
        }
    }
    return hg_glow_mean(s->glow, min, max); // of all of it when there are no coordinates
}

// --- leaves --------------------------------------------------------------------------------------

struct filling {
    const struct hg_emitters *e;
    struct hg_light_item *items;
    struct hg_gpu_emitter_leaf *leaves;
    uint16_t *weights;
    uint32_t leaf_count;
};

// Sums in units of 1 / 65535; every triangle that shines gets at least one.
static void sum_weights(const double *shares, uint32_t count, double total, uint16_t *out)
{
    uint32_t sum = 0, last = 0;
    for (uint32_t i = 0; i < count; i++)
        last = shares[i] > 0 ? i : last;
    for (uint32_t i = 0; i < count; i++) {
        if (shares[i] > 0)
            sum += 1 + (uint32_t)(shares[i] / total * (65535 - (1 << MOST_SHIFT)));
        out[i] = (uint16_t)(i >= last ? 65535 : sum);
    }
}

static void join(struct hg_light_item *item, const struct triangle *t, bool first)
{
    for (int a = 0; a < 3; a++) {
        item->min[a] = first ? t->min[a] : fminf(item->min[a], t->min[a]);
        item->max[a] = first ? t->max[a] : fmaxf(item->max[a], t->max[a]);
    }
}

// Axis and cone of several normals.
static void cone_of(struct hg_light_item *item, const struct triangle *triangles,
    const double *shares, uint32_t count)
{
    double axis[3] = {0, 0, 0}, length = 0, least = 1;
    for (uint32_t i = 0; i < count; i++)
        for (int a = 0; a < 3 && shares[i] > 0; a++)
            axis[a] += triangles[i].normal[a] * triangles[i].area;
    for (int a = 0; a < 3; a++)
        length += axis[a] * axis[a];
    length = sqrt(length);
    for (int a = 0; a < 3; a++)
        item->axis[a] = length > 0 ? (float)(axis[a] / length) : a == 1;
    for (uint32_t i = 0; i < count; i++) {
        double dot = 0;
        for (int a = 0; a < 3; a++)
            dot += triangles[i].normal[a] * (double)item->axis[a];
        if (shares[i] > 0)
            least = fmin(least, dot);
    }
    item->cos_o = length > 0 && least > -1 ? (float)least : -1;
}

// While the shutter is open: then its normals may go anywhere.
static bool turns(const struct hg_cut_piece *piece)
{
    return piece->opening != NULL ||
           memcmp(piece->world, piece->previous, 9 * sizeof *piece->world) != 0;
}

static void fill_leaf(const struct filling *f, const struct source *s, uint32_t leaf)
{
    const struct hg_cut_piece *piece = s->part->piece;
    const uint32_t shift = f->e->shift, first = (leaf - s->first_leaf) << shift;
    const uint32_t rest = piece->triangle_count - first;
    const uint32_t count = rest < 1u << shift ? rest : 1u << shift;
    struct hg_light_item *item = &f->items[leaf];
    struct triangle triangles[1 << MOST_SHIFT];
    double shares[1 << MOST_SHIFT], total = 0;
    *item =
        (struct hg_light_item){.cos_e = 0, .two_sided = (piece->flags & HG_DRAW_DOUBLE_SIDED) != 0};
    for (uint32_t i = 0; i < count; i++) {
        const float glow = glow_of(s, first + i);
        triangles[i] = triangle_at(piece, first + i);
        shares[i] = triangles[i].area * (double)s->luminance * (double)glow;
        shares[i] = shares[i] > 1e-30 && shares[i] < 1e30 ? shares[i] : 0;
        if (shares[i] > 0)
            join(item, &triangles[i], !(total > 0));
        total += shares[i];
    }
    f->leaves[leaf] = (struct hg_gpu_emitter_leaf){
        piece->draw, piece->first_primitive + first, s->first_weight + first, count};
    if (!(total > 0))
        return;
    item->power = (float)fmin(total, 1e30);
    cone_of(item, triangles, shares, count);
    item->cos_o = turns(piece) ? -1 : item->cos_o;
    if (shift > 0)
        sum_weights(shares, count, total, f->weights + s->first_weight + first);
}

static void fill_block(void *user, size_t block)
{
    const struct filling *f = user;
    const uint32_t first = (uint32_t)block * BLOCK;
    const uint32_t end = f->leaf_count - first < BLOCK ? f->leaf_count : first + BLOCK;
    uint32_t low = 0, high = f->e->source_count - 1;
    while (low < high) { // the last that starts at or before the block
        const uint32_t middle = (low + high + 1) / 2;
        if (f->e->sources[middle].first_leaf <= first)
            low = middle;
        else
            high = middle - 1;
    }
    for (uint32_t leaf = first; leaf < end; leaf++) {
        while (leaf - f->e->sources[low].first_leaf >= f->e->sources[low].leaf_count)
            low++;
        fill_leaf(f, &f->e->sources[low], leaf);
    }
}

static void fill_lights(const struct filling *f)
{
    const struct hg_emitters *e = f->e;
    for (uint32_t i = e->directional_count; i < e->light_count; i++) {
        const uint32_t leaf = f->leaf_count + i - e->directional_count;
        f->items[leaf] = item_of_light(&e->lights[i]);
        if (e->lights_move) {
            const struct hg_light_item then = item_of_light(&e->lights[e->light_count + i]);
            widen(&f->items[leaf], &then);
        }
        f->leaves[leaf] = (struct hg_gpu_emitter_leaf){.draw = i, .count = HG_EMITTER_IS_LIGHT};
    }
}

// --- upload --------------------------------------------------------------------------------------

static enum hg_status upload_pieces(
    struct hg_emitters *e, uint32_t draw_count, struct hg_error *err)
{
    struct hg_gpu_emitter_piece *pieces = hg_calloc((size_t)e->source_count + 1, sizeof *pieces);
    uint32_t *first = hg_calloc((size_t)draw_count + 1, sizeof *first), draw = 0;
    enum hg_status status = pieces && first ? HG_OK : no_memory(err);
    for (uint32_t i = 0; i < e->source_count && !status; i++) {
        const struct hg_cut_piece *p = e->sources[i].part->piece;
        pieces[i] = (struct hg_gpu_emitter_piece){
            p->first_primitive, p->triangle_count, e->sources[i].first_leaf, e->shift};
        while (draw <= p->draw && draw < draw_count)
            first[draw++] = i;
    }
    while (draw <= draw_count && !status)
        first[draw++] = e->source_count;
    if (!status)
        status =
            put(e, &e->pieces, "emitters: pieces", pieces, e->source_count * sizeof *pieces, err);
    if (!status)
        status = put(e, &e->draw_pieces, "emitters: draws", first,
            ((uint64_t)draw_count + 1) * sizeof *first, err);
    hg_free(pieces);
    hg_free(first);
    return status;
}

static enum hg_status upload_tree(struct hg_emitters *e, const struct filling *f,
    const struct hg_light_tree *tree, uint32_t leaves, uint32_t weights, struct hg_error *err)
{
    enum hg_status status =
        put(e, &e->nodes, "light tree", tree->nodes, tree->node_count * sizeof *tree->nodes, err);
    if (!status)
        status = put(e, &e->leaves, "emitters: leaves", f->leaves, leaves * sizeof *f->leaves, err);
    if (!status)
        status = put(
            e, &e->trails, "emitters: trails", tree->trails, leaves * sizeof *tree->trails, err);
    if (!status)
        status = put(
            e, &e->weights, "emitters: weights", f->weights, ((uint64_t)weights + 1) / 2 * 4, err);
    e->block.node_count = tree->node_count;
    e->block.leaf_count = leaves;
    e->stats.leaves = tree->leaf_count;
    e->stats.depth = tree->depth;
    return status;
}

static enum hg_status build(
    struct hg_emitters *e, const struct hg_emitter_input *in, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    uint32_t triangles_leaves, weights;
    plan_leaves(e, &triangles_leaves, &weights);
    const uint32_t leaves = triangles_leaves + e->light_count - e->directional_count;
    struct filling f = {.e = e, .leaf_count = triangles_leaves};
    struct hg_light_tree tree = {0};
    f.items = hg_calloc((size_t)leaves + 1, sizeof *f.items);
    f.leaves = hg_calloc((size_t)leaves + 1, sizeof *f.leaves);
    f.weights = hg_calloc((size_t)weights + 2, sizeof *f.weights);
    enum hg_status status = f.items && f.leaves && f.weights ? HG_OK : no_memory(err);
    if (!status) {
        if (triangles_leaves > 0)
            hg_jobs_for(e->jobs, (triangles_leaves - 1) / BLOCK + 1, fill_block, &f);
        fill_lights(&f);
        if (hg_light_tree_build(f.items, leaves, e->jobs, &tree))
            status = no_memory(err);
    }
    if (!status)
        status = upload_tree(e, &f, &tree, leaves, weights, err);
    if (!status)
        status = upload_pieces(e, in->draw_count, err);
    if (!status)
        status = upload_lights(e, err);
    e->block.draw_count = in->draw_count;
    e->stats.run = 1u << e->shift;
    e->stats.builds++;
    e->stats.build_ns = hg_clock_now_ns() - begin;
    hg_light_tree_finish(&tree);
    hg_free(f.items);
    hg_free(f.leaves);
    hg_free(f.weights);
    return status;
}

// --- environment ---------------------------------------------------------------------------------

// What the image shows; 0: there is none.
static uint64_t environment_signature(const struct hg_environment *env, bool has_sun)
{
    uint64_t h = hg_mix(1, env->kind);
    if (env->kind == HG_ENV_SKY) {
        h = hg_mix_bytes(h, env->sun_direction, sizeof env->sun_direction);
        h = hg_mix_bytes(h, &env->turbidity, sizeof env->turbidity);
        return hg_mix(h, has_sun) | 1;
    }
    if (env->kind != HG_ENV_IMAGE || !env->image.pixels)
        return 0;
    h = hg_mix_bytes(h, env->image_hash, sizeof env->image_hash);
    h = hg_mix(h, (uint64_t)(uintptr_t)env->image.pixels);
    return hg_mix(hg_mix(h, env->revision), (uint64_t)env->image.width << 32 | env->image.height) |
           1;
}

// As renderer/light/env_device.c draws it.
static enum hg_status draw_sky(
    const struct hg_environment *env, bool has_sun, struct hg_jobs *jobs, struct hg_image *out)
{
    struct hg_sky sky = {.turbidity = env->turbidity, .with_disc = !has_sun};
    hg_copy3(env->sun_direction, sky.sun_direction);
    hg_normalize3(sky.sun_direction);
    if (!(hg_dot3(sky.sun_direction, sky.sun_direction) > 0))
        sky.sun_direction[1] = 1;
    return hg_sky_render(&sky, jobs, out);
}

static enum hg_status make_warp(
    struct hg_emitters *e, const struct hg_environment *env, bool has_sun, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    struct hg_image drawn = {0};
    struct hg_env_warp warp = {0};
    enum hg_status status = HG_OK;
    if (env->kind == HG_ENV_SKY)
        status = draw_sky(env, has_sun, e->jobs, &drawn);
    if (!status)
        status = hg_env_warp_make(env->kind == HG_ENV_SKY ? &drawn : &env->image, e->jobs, &warp);
    hg_image_finish(&drawn);
    status = status ? no_memory(err)
                    : put(e, &e->environment, "emitters: environment", warp.quads,
                          (uint64_t)warp.quad_count * sizeof *warp.quads, err);
    e->environment_levels = warp.levels;
    e->environment_mean = warp.mean;
    hg_env_warp_finish(&warp);
    e->stats.warps++;
    e->stats.warp_ns = hg_clock_now_ns() - begin;
    return status;
}

static enum hg_status sync_environment(
    struct hg_emitters *e, const struct hg_environment *env, struct hg_error *err)
{
    // As lighting.c: any directional light of the scene stands for the disc.
    const bool has_sun = e->set.directional_count > 0;
    const uint64_t signature = environment_signature(env, has_sun);
    enum hg_status status = HG_OK;
    if (signature && signature != e->env_signature)
        status = make_warp(e, env, has_sun, err);
    if (status)
        e->env_signature = 0;
    else if (signature)
        e->env_signature = signature;
    struct hg_gpu_emitters *b = &e->block;
    const bool image = signature && e->environment_mean > 0;
    b->environment_kind = image ? HG_ENV_KIND_IMAGE : HG_ENV_KIND_NONE;
    if (env->kind == HG_ENV_COLOR && luminance(env->color) > 0)
        b->environment_kind = HG_ENV_KIND_COLOR;
    if (!(env->intensity > 0) || !isfinite(env->intensity))
        b->environment_kind = HG_ENV_KIND_NONE;
    b->environment_levels = e->environment_levels;
    b->environment_mean = image ? e->environment_mean : 1;
    return status;
}

// --- the whole -----------------------------------------------------------------------------------

static void count_bytes(struct hg_emitters *e)
{
    struct hg_gpu_buffer *buffers[BUFFERS];
    list_buffers(e, buffers);
    e->stats.bytes = 0;
    for (int i = 0; i < BUFFERS; i++)
        e->stats.bytes += buffers[i]->memory.size_bytes;
    if (e->stats.bytes > e->stats.peak_bytes)
        e->stats.peak_bytes = e->stats.bytes;
}

static void fill_addresses(struct hg_emitters *e)
{
    struct hg_gpu_emitters *b = &e->block;
    b->nodes = e->nodes.address;
    b->leaves = e->leaves.address;
    b->trails = e->trails.address;
    b->weights = e->weights.address;
    b->pieces = e->pieces.address;
    b->draw_pieces = e->draw_pieces.address;
    b->lights = b->lights_before = e->light_table.address;
    if (e->lights_move)
        b->lights_before += e->light_count * sizeof *e->lights;
    b->directional = e->directional.address;
    b->environment = e->environment.address;
    b->directional_count = e->directional_count;
    b->directional_lux = e->directional_lux;
}

enum hg_status hg_emitters_update(
    struct hg_emitters *e, const struct hg_emitter_input *in, struct hg_error *err)
{
    uint64_t signature = hg_mix(1, e->budget_bytes);
    enum hg_status status = HG_OK;
    if (collect_lights(e, in, &signature) || collect_sources(e, in, &signature))
        status = no_memory(err);
    signature |= 1;
    if (!status && signature != e->signature)
        status = build(e, in, err);
    if (!status) {
        e->signature = signature;
        status = sync_environment(e, &in->scene->environment, err);
    }
    count_bytes(e);
    if (status) {
        e->signature = 0;
        e->block = (struct hg_gpu_emitters){0};
        return status;
    }
    fill_addresses(e);
    e->stats.directional = e->directional_count;
    e->stats.punctual = e->light_count - e->directional_count;
    return HG_OK;
}

void hg_emitters_move_lights(
    struct hg_emitters *e, const struct hg_light_set *opening, const struct hg_light_set *closing)
{
    e->opening = opening;
    e->closing = closing;
}

void hg_emitters_fill(const struct hg_emitters *e, struct hg_gpu_emitters *out)
{
    *out = e->block;
}

void hg_emitters_stats(const struct hg_emitters *e, struct hg_emitters_stats *out)
{
    *out = e->stats;
}
