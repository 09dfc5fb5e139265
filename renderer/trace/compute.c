// compute.c - the compute shader backend: BVHs of shared/bvh.h on the device, traversed by
// passes/trace_bvh.comp. Needs only Vulkan 1.3. See trace.h.
//
// Waves are submitted in pieces of about 8 ms, so that other work is not delayed: dispatches are
// not preempted. Trees of bodies whose positions change are refitted; after MOST_REFITS they are
// rebuilt.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/trace/bvh.h"
#include "renderer/trace/internal.h"

#define MOST_REFITS    64u
#define LEAST_PIECE    8192u // on a busy machine clocks run ahead of the work
#define TRIANGLE_BYTES 80u   // of the structure, at most about
#define LARGEST        1e18f // coordinates beyond it are no triangle: products overflow

struct body {
    uint64_t key, shape;
    struct hg_gpu_buffer buffer; // nodes, triangles, openings
    uint64_t triangles_at, openings_at, bytes;
    uint32_t triangle_count, refits;
    struct hg_bvh bvh; // order and nodes only where it may be refitted
};

struct compute {
    struct hg_trace *trace;
    struct hg_bvh_builder *builder;
    struct body flat;
    struct body *bodies; // that are placed, by key
    uint32_t body_count;
    struct hg_gpu_buffer top;
    uint64_t instances_at;
    struct hg_bvh top_bvh;
    uint32_t features; // HG_BVH_* of any instance
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
}

static void release_body(struct compute *c, struct body *body)
{
    hg_gpu_buffer_destroy(c->trace->gpu, &body->buffer);
    hg_bvh_finish(&body->bvh);
    memset(body, 0, sizeof *body);
}

static void clear(struct compute *c)
{
    release_body(c, &c->flat);
    for (uint32_t i = 0; i < c->body_count; i++)
        release_body(c, &c->bodies[i]);
    hg_free(c->bodies);
    c->bodies = NULL;
    c->body_count = 0;
    hg_gpu_buffer_destroy(c->trace->gpu, &c->top);
    hg_bvh_finish(&c->top_bvh);
    c->top_bvh.root = HG_BVH_NONE;
}

static void destroy(void *self)
{
    struct compute *c = self;
    if (c == NULL)
        return;
    clear(c);
    hg_bvh_builder_destroy(c->builder);
    hg_free(c);
}

static enum hg_status create(struct hg_trace *trace, void **self, struct hg_error *err)
{
    struct compute *c = hg_calloc(1, sizeof *c);
    if (c == NULL)
        return no_memory(err);
    *self = c;
    c->trace = trace;
    c->top_bvh.root = HG_BVH_NONE;
    return hg_bvh_builder_create(&c->builder, err);
}

// --- triangles -----------------------------------------------------------------------------------

struct soup { // of one tree, before it is ordered
    struct hg_gpu_bvh_triangle *triangles;
    struct hg_gpu_bvh_corners *openings; // NULL: none
    struct hg_bvh_box *boxes;
    uint32_t count;
};

static void soup_finish(struct soup *s)
{
    hg_free(s->triangles);
    hg_free(s->openings);
    hg_free(s->boxes);
}

static enum hg_status soup_init(struct soup *s, uint64_t triangles, bool moves)
{
    memset(s, 0, sizeof *s);
    if (triangles > HG_BVH_FIRST)
        return HG_E_LIMIT;
    s->triangles = hg_calloc(triangles, sizeof *s->triangles);
    s->boxes = hg_calloc(triangles, sizeof *s->boxes);
    s->openings = moves ? hg_calloc(triangles, sizeof *s->openings) : NULL;
    return s->triangles != NULL && s->boxes != NULL && (!moves || s->openings != NULL) ? HG_OK
                                                                                       : HG_E_NOMEM;
}

// False when it is no corner of a triangle.
static bool grow(struct hg_bvh_box *box, const float v[3])
{
    for (int i = 0; i < 3; i++) {
        box->min[i] = fminf(box->min[i], v[i]);
        box->max[i] = fmaxf(box->max[i], v[i]);
    }
    return fabsf(v[0]) <= LARGEST && fabsf(v[1]) <= LARGEST && fabsf(v[2]) <= LARGEST;
}

// Corners in the space of the tree (world: where to; NULL: they stay in object space), and what
// they add to the box. False when they are no triangle.
static bool load_corners(const float *positions, const uint32_t index[3], const float *world,
    struct hg_gpu_bvh_corners *out, struct hg_bvh_box *box)
{
    bool is_finite = true;
    float v[3][3];
    for (int i = 0; i < 3; i++) {
        const float *p = positions + (size_t)index[i] * 3;
        if (world != NULL)
            hg_trace_to_world(world, p, v[i]);
        else
            memcpy(v[i], p, sizeof v[i]);
        is_finite = grow(box, v[i]) && is_finite;
    }
    memcpy(out, v, sizeof *out);
    return is_finite;
}

// Appends the triangles of a piece.
static void add_piece(
    struct soup *s, const struct hg_ray_geometry_piece *piece, const float *world, uint32_t owner)
{
    const float *before = piece->opening != NULL ? piece->opening : piece->positions;
    for (uint32_t i = 0; i < piece->triangle_count; i++) {
        const uint32_t *index = piece->indices + (size_t)i * 3;
        struct hg_gpu_bvh_corners now;
        struct hg_bvh_box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
        if (index[0] >= piece->vertex_count || index[1] >= piece->vertex_count ||
            index[2] >= piece->vertex_count ||
            !load_corners(piece->positions, index, world, &now, &box) ||
            (s->openings != NULL &&
                !load_corners(before, index, world, &s->openings[s->count], &box)))
            continue;
        s->boxes[s->count] = box;
        s->triangles[s->count++] =
            (struct hg_gpu_bvh_triangle){now.p0, now.p1, now.p2, piece->first_primitive + i, owner};
    }
}

static enum hg_status fail(enum hg_status status, struct hg_error *err)
{
    if (status == HG_E_LIMIT)
        return hg_error_set(
            err, status, "ray tracing", NULL, "one structure has more than 2^28 triangles");
    return no_memory(err);
}

// --- trees ---------------------------------------------------------------------------------------

static uint64_t round_up(uint64_t bytes)
{
    return (bytes + 255) & ~255ull;
}

static uint64_t structure_bytes(const struct compute *c)
{
    uint64_t bytes = c->flat.bytes + c->top.size_bytes;
    for (uint32_t i = 0; i < c->body_count; i++)
        bytes += c->bodies[i].bytes;
    return bytes;
}

static void note_peak(struct compute *c, uint64_t more)
{
    const uint64_t now = structure_bytes(c) + more;
    if (now > c->trace->stats.peak_bytes)
        c->trace->stats.peak_bytes = now;
}

// Brings tree and triangles, in its order, to the buffer.
static enum hg_status upload_body(
    struct compute *c, struct body *body, const struct soup *s, struct hg_error *err)
{
    struct hg_gpu *gpu = c->trace->gpu;
    const struct hg_bvh *bvh = &body->bvh;
    struct hg_gpu_bvh_triangle *ordered = hg_calloc(bvh->item_count, sizeof *ordered);
    struct hg_gpu_bvh_corners *openings =
        s->openings != NULL ? hg_calloc(bvh->item_count, sizeof *openings) : NULL;
    enum hg_status status = HG_OK;
    if (ordered == NULL || (s->openings != NULL && openings == NULL))
        status = no_memory(err);
    for (uint32_t i = 0; i < bvh->item_count && status == HG_OK; i++) {
        ordered[i] = s->triangles[bvh->order[i]];
        if (openings != NULL)
            openings[i] = s->openings[bvh->order[i]];
    }
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(
            gpu, &body->buffer, 0, bvh->nodes, bvh->node_count * sizeof *bvh->nodes, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(gpu, &body->buffer, body->triangles_at, ordered,
            bvh->item_count * sizeof *ordered, err);
    if (status == HG_OK && openings != NULL)
        status = hg_gpu_buffer_upload(gpu, &body->buffer, body->openings_at, openings,
            bvh->item_count * sizeof *openings, err);
    hg_free(ordered);
    hg_free(openings);
    return status;
}

static enum hg_status take_buffer(
    struct compute *c, struct body *body, const struct soup *s, struct hg_error *err)
{
    const uint64_t budget = c->trace->params.budget_bytes;
    body->triangles_at = round_up(body->bvh.node_count * sizeof *body->bvh.nodes);
    body->openings_at = round_up(body->triangles_at + body->bvh.item_count * sizeof *s->triangles);
    body->bytes =
        body->openings_at + (s->openings != NULL ? body->bvh.item_count * sizeof *s->openings : 0);
    if (budget > 0 && structure_bytes(c) + body->bytes > budget)
        return hg_error_set(err, HG_E_LIMIT, "ray tracing budget", NULL,
            "%llu bytes do not hold the structures of this scene", (unsigned long long)budget);
    return hg_gpu_buffer_create(c->trace->gpu, HG_GPU_BUFFER_DEVICE,
        body->bytes > 0 ? body->bytes : 256, "bvh", &body->buffer, err);
}

static enum hg_status build_tree(
    struct compute *c, struct body *body, const struct soup *s, bool keep, struct hg_error *err)
{
    note_peak(c, s->count * (uint64_t)(sizeof *s->triangles + sizeof *s->boxes) +
                     hg_bvh_build_bytes(s->count));
    enum hg_status status =
        hg_bvh_build(c->builder, s->boxes, s->count, HG_BVH_LEAF_MOST, &body->bvh);
    if (status != HG_OK)
        return fail(status, err);
    body->triangle_count = s->count;
    status = take_buffer(c, body, s, err);
    if (status == HG_OK)
        status = upload_body(c, body, s, err);
    if (!keep) {
        hg_free(body->bvh.nodes);
        hg_free(body->bvh.order);
        body->bvh.nodes = NULL;
        body->bvh.order = NULL;
        body->bvh.node_capacity = 0;
    }
    return status;
}

// --- flat ----------------------------------------------------------------------------------------

static enum hg_status build_flat(
    struct compute *c, const struct hg_trace_layout *l, struct hg_error *err)
{
    struct soup s;
    if (c->flat.key == l->flat_key && !l->flat_deforms)
        return HG_OK;
    release_body(c, &c->flat);
    if (l->flat_key == 0)
        return HG_OK;
    enum hg_status status = soup_init(&s, l->flat_triangles, false);
    if (status != HG_OK)
        status = fail(status, err);
    for (uint32_t i = 0; i < l->body_count && status == HG_OK; i++) {
        const struct hg_trace_body *body = &l->bodies[i];
        for (uint32_t p = 0; body->flat && p < body->place_count; p++) {
            const struct hg_trace_place *place = &l->places[body->first_place + p];
            for (uint32_t k = 0; k < place->piece_count; k++) {
                const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, k);
                add_piece(&s, piece, piece->world, place->draw | place->mask << 28);
            }
        }
    }
    if (status == HG_OK)
        status = build_tree(c, &c->flat, &s, false, err);
    c->flat.key = l->flat_key;
    c->trace->stats.built_triangles += l->flat_triangles;
    soup_finish(&s);
    return status;
}

// --- bodies --------------------------------------------------------------------------------------

static enum hg_status fill_body(
    const struct hg_trace_layout *l, const struct hg_trace_body *from, struct soup *s)
{
    const struct hg_trace_place *place = &l->places[from->first_place];
    const enum hg_status status = soup_init(s, from->triangles, from->moves);
    for (uint32_t i = 0; i < place->piece_count && status == HG_OK; i++) {
        const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, i);
        add_piece(s, piece, from->in_world ? piece->world : NULL, HG_RAY_ALL << 28);
    }
    return status;
}

// The same triangles elsewhere, unless some have become none or are some again.
static enum hg_status refit_body(
    struct compute *c, struct body *body, const struct soup *s, bool *fits, struct hg_error *err)
{
    *fits =
        body->refits < MOST_REFITS && body->bvh.order != NULL && body->triangle_count == s->count;
    if (!*fits)
        return HG_OK;
    struct hg_bvh_box *items = hg_calloc(s->count, sizeof *items);
    if (items == NULL)
        return no_memory(err);
    for (uint32_t i = 0; i < s->count; i++)
        items[i] = s->boxes[body->bvh.order[i]];
    enum hg_status status = hg_bvh_refit(&body->bvh, items);
    hg_free(items);
    if (status != HG_OK)
        return no_memory(err);
    body->refits++;
    return upload_body(c, body, s, err);
}

static enum hg_status bring_body(struct compute *c, const struct hg_trace_layout *l,
    const struct hg_trace_body *from, struct body *old, struct hg_error *err)
{
    struct hg_trace_stats *stats = &c->trace->stats;
    struct body *body = &c->bodies[c->body_count++];
    const uint64_t start = hg_clock_now_ns();
    struct soup s = {0};
    bool fits = false;
    if (old != NULL && old->shape == from->moves) {
        *body = *old;
        memset(old, 0, sizeof *old);
        if (!from->deforms)
            return HG_OK;
    }
    enum hg_status status = fill_body(l, from, &s);
    if (status != HG_OK)
        status = fail(status, err);
    if (status == HG_OK && body->key == from->key && body->buffer.handle != VK_NULL_HANDLE)
        status = refit_body(c, body, &s, &fits, err);
    if (status == HG_OK && !fits) {
        release_body(c, body);
        status = build_tree(c, body, &s, from->deforms, err);
    }
    body->key = from->key;
    body->shape = from->moves;
    soup_finish(&s);
    *(fits ? &stats->refit_ns : &stats->build_ns) += hg_clock_now_ns() - start;
    *(fits ? &stats->refit_triangles : &stats->built_triangles) += from->triangles;
    return status;
}

static int by_key(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static enum hg_status build_bodies(
    struct compute *c, const struct hg_trace_layout *l, struct hg_error *err)
{
    struct body *old = c->bodies;
    const uint32_t old_count = c->body_count;
    c->bodies = hg_calloc(l->body_count, sizeof *c->bodies);
    c->body_count = 0;
    enum hg_status status = c->bodies != NULL ? HG_OK : no_memory(err);
    for (uint32_t i = 0; i < l->body_count && status == HG_OK; i++) {
        if (l->bodies[i].flat)
            continue;
        struct body *found =
            old_count > 0 ? bsearch(&l->bodies[i].key, old, old_count, sizeof *old, by_key) : NULL;
        status = bring_body(c, l, &l->bodies[i], found, err);
    }
    for (uint32_t i = 0; i < old_count; i++)
        release_body(c, &old[i]);
    hg_free(old);
    return status;
}

// --- instances -----------------------------------------------------------------------------------

struct placing {
    struct hg_gpu_bvh_instance *instances;
    struct hg_bvh_box *boxes;
    uint32_t count;
};

// World to object, in double. The matrix has an inverse.
static void invert(const float m[12], struct hg_mat4x3 *out)
{
    double r[9], det = 0.0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, x = (k + 1) % 3, y = (k + 2) % 3;
            r[i + 3 * k] =
                (double)m[a * 3 + x] * m[b * 3 + y] - (double)m[a * 3 + y] * m[b * 3 + x];
        }
    for (int k = 0; k < 3; k++)
        det += m[k] * r[3 * k];
    for (int i = 0; i < 9; i++)
        out->m[i] = (float)(r[i] / det);
    for (int i = 0; i < 3; i++)
        out->m[9 + i] = (float)(-(r[i] * m[9] + r[3 + i] * m[10] + r[6 + i] * m[11]) / det);
}

static void add_world_box(struct hg_bvh_box *box, const struct hg_bvh_box *from, const float m[12])
{
    for (int c = 0; c < 3; c++) {
        double low = m[9 + c], high = m[9 + c];
        for (int i = 0; i < 3; i++) {
            const double a = (double)m[i * 3 + c] * from->min[i];
            const double b = (double)m[i * 3 + c] * from->max[i];
            low += fmin(a, b);
            high += fmax(a, b);
        }
        const double slack = 1e-6 * (fabs(low) + fabs(high));
        box->min[c] = fminf(box->min[c], (float)(low - slack));
        box->max[c] = fmaxf(box->max[c], (float)(high + slack));
    }
}

static void place_body(struct placing *p, const struct body *body, const struct hg_trace_body *from,
    const struct hg_trace_place *place, const struct hg_ray_geometry_piece *piece)
{
    static const float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const float *world = piece != NULL ? piece->world : identity;
    const float *before = piece != NULL ? piece->previous : identity;
    if (body->bvh.root == HG_BVH_NONE)
        return;
    struct hg_gpu_bvh_instance *i = &p->instances[p->count];
    struct hg_bvh_box *box = &p->boxes[p->count++];
    *i = (struct hg_gpu_bvh_instance){.nodes = body->buffer.address,
        .triangles = body->buffer.address + body->triangles_at,
        .openings = body->buffer.address + body->openings_at,
        .root = body->bvh.root,
        .draw = place != NULL ? place->draw : 0,
        .mask = place != NULL ? place->mask : HG_RAY_ALL};
    if (memcmp(world, before, 12 * sizeof *world) != 0)
        i->flags |= HG_BVH_MOVES;
    if (from != NULL && from->moves)
        i->flags |= HG_BVH_DEFORMS;
    memcpy(i->world.m, world, sizeof i->world);
    memcpy(i->previous.m, before, sizeof i->previous);
    memcpy(&i->origin, body->bvh.origin, sizeof i->origin);
    memcpy(&i->step, body->bvh.step, sizeof i->step);
    invert(world, &i->to_object);
    *box = (struct hg_bvh_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    add_world_box(box, &body->bvh.bounds, world);
    add_world_box(box, &body->bvh.bounds, before);
}

static void place_all(struct compute *c, const struct hg_trace_layout *l, struct placing *p)
{
    uint32_t at = 0;
    if (l->flat_key != 0)
        place_body(p, &c->flat, NULL, NULL, NULL);
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *from = &l->bodies[i];
        for (uint32_t k = 0; !from->flat && k < from->place_count; k++) {
            const struct hg_trace_place *place = &l->places[from->first_place + k];
            const struct hg_ray_geometry_piece *piece = &l->pieces[place->first_piece];
            place_body(p, &c->bodies[at], from, place, from->in_world ? NULL : piece);
        }
        at += !from->flat;
    }
}

static enum hg_status upload_top(struct compute *c, const struct placing *p, struct hg_error *err)
{
    const struct hg_bvh *bvh = &c->top_bvh;
    struct hg_gpu *gpu = c->trace->gpu;
    const uint64_t node_bytes = bvh->node_count * sizeof *bvh->nodes;
    c->instances_at = round_up(node_bytes);
    enum hg_status status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_DEVICE,
        c->instances_at + (uint64_t)p->count * sizeof *p->instances + 256, "instances", &c->top,
        err);
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(gpu, &c->top, 0, bvh->nodes, node_bytes, err);
    for (uint32_t i = 0; i < bvh->item_count && status == HG_OK; i++)
        status =
            hg_gpu_buffer_upload(gpu, &c->top, c->instances_at + i * (uint64_t)sizeof *p->instances,
                &p->instances[bvh->order[i]], sizeof *p->instances, err);
    return status;
}

static enum hg_status build_top(
    struct compute *c, const struct hg_trace_layout *l, struct hg_error *err)
{
    struct placing p = {.instances = hg_calloc((size_t)l->instances + 1, sizeof *p.instances),
        .boxes = hg_calloc((size_t)l->instances + 1, sizeof *p.boxes)};
    enum hg_status status = p.instances != NULL && p.boxes != NULL ? HG_OK : no_memory(err);
    if (status == HG_OK)
        place_all(c, l, &p);
    c->features = 0;
    for (uint32_t i = 0; i < p.count; i++)
        c->features |= p.instances[i].flags;
    hg_bvh_finish(&c->top_bvh);
    c->top_bvh.root = HG_BVH_NONE;
    if (status == HG_OK) {
        status = hg_bvh_build(c->builder, p.boxes, p.count, 1, &c->top_bvh);
        status = status == HG_OK ? upload_top(c, &p, err) : fail(status, err);
    }
    hg_free(p.instances);
    hg_free(p.boxes);
    return status;
}

// --- all of it -----------------------------------------------------------------------------------

static enum hg_status check_budget(
    const struct compute *c, const struct hg_trace_layout *l, struct hg_error *err)
{
    const uint64_t budget = c->trace->params.budget_bytes;
    const uint64_t need =
        l->triangles * TRIANGLE_BYTES + l->instances * sizeof(struct hg_gpu_bvh_instance);
    if (budget == 0 || need <= budget)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, "ray tracing budget", NULL,
        "about %llu bytes are needed for %llu triangles, the budget is %llu",
        (unsigned long long)need, (unsigned long long)l->triangles, (unsigned long long)budget);
}

static enum hg_status sync(void *self, const struct hg_trace_layout *l, struct hg_error *err)
{
    struct compute *c = self;
    struct hg_trace_stats *stats = &c->trace->stats;
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = check_budget(c, l, err);
    if (status == HG_OK)
        status = build_flat(c, l, err);
    stats->build_ns += hg_clock_now_ns() - start;
    if (status == HG_OK)
        status = build_bodies(c, l, err);
    const uint64_t top = hg_clock_now_ns();
    if (status == HG_OK)
        status = build_top(c, l, err);
    stats->refit_ns += hg_clock_now_ns() - top;
    if (status != HG_OK)
        clear(c);
    stats->bytes = structure_bytes(c);
    note_peak(c, 0);
    return status;
}

// --- waves ---------------------------------------------------------------------------------------

static enum hg_status submit(
    void *self, const struct hg_trace_piece *piece, uint64_t *value, struct hg_error *err)
{
    struct compute *c = self;
    const struct hg_trace_addresses at = hg_trace_addresses(piece);
    struct hg_gpu_bvh_wave wave = {.rays = at.rays,
        .list = at.list,
        .nodes = c->top.address,
        .instances = c->top.address + c->instances_at,
        .root = c->top_bvh.root,
        .count = piece->count};
    *(piece->any ? &wave.blocked : &wave.hits) = at.out;
    memcpy(&wave.origin, c->top_bvh.origin, sizeof wave.origin);
    memcpy(&wave.step, c->top_bvh.step, sizeof wave.step);
    const struct hg_gpu_pipeline_params pipeline = {
        .compute = "trace_bvh.comp", .spec = {piece->any, c->features}, .spec_count = 2};
    const struct hg_trace_dispatch dispatch = {
        &pipeline, &wave, sizeof wave, (piece->count + HG_BVH_GROUP - 1) / HG_BVH_GROUP};
    return hg_trace_submit_dispatch(c->trace->gpu, &dispatch, value, err);
}

const struct hg_trace_ops hg_trace_compute = {.create = create,
    .destroy = destroy,
    .sync = sync,
    .submit = submit,
    .least_piece = LEAST_PIECE};
