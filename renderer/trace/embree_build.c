// embree_build.c - scenes of Embree from a layout. See embree.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/trace/embree.h"

// Refits before a tree is rebuilt: its quality degrades with distance from the pose it was built
// for.
#define MOST_REFITS 64u
// Bytes that a triangle takes at most, by measurement (docs/internals/trace.md), and a vertex that
// is brought to world space.
#define TRIANGLE_BYTES 96u
#define VERTEX_BYTES   12u

struct build {
    struct hg_embree *e;
    const struct hg_trace_layout *layout;
};

// --- geometry ------------------------------------------------------------------------------------

// Positions in world space, at one end of the shutter.
static RTCBuffer world_positions(
    struct hg_embree *e, const struct hg_ray_geometry_piece *piece, const float m[12])
{
    const size_t count = piece->vertex_count;
    const RTCBuffer buffer = rtcNewBuffer(e->device, (count + 1) * 12);
    float *out = buffer != NULL ? rtcGetBufferData(buffer) : NULL;
    if (out == NULL)
        return NULL;
    for (size_t i = 0; i < count; i++)
        hg_trace_to_world(m, piece->positions + i * 3, out + i * 3);
    return buffer;
}

static RTCGeometry open_geometry(
    struct hg_embree *e, const struct hg_ray_geometry_piece *piece, enum RTCBuildQuality quality)
{
    const RTCGeometry geometry = rtcNewGeometry(e->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (geometry == NULL)
        return NULL;
    rtcSetGeometryBuildQuality(geometry, quality);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, piece->indices,
        0, 12, piece->triangle_count);
    return geometry;
}

static void share_positions(RTCGeometry geometry, const struct hg_ray_geometry_piece *piece,
    uint32_t step, const float *positions)
{
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3, positions,
        0, 12, piece->vertex_count);
}

static void attach(RTCScene scene, RTCGeometry geometry, uint32_t mask, uint32_t id)
{
    rtcSetGeometryMask(geometry, mask);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
    rtcReleaseGeometry(geometry);
}

// Robust: no ray leaks between triangles that share an edge. It costs an eighth of the rays per
// second, and spatial splits, of which Embree then makes none.
static RTCScene open_scene(struct hg_embree *e, bool dynamic)
{
    const RTCScene scene = rtcNewScene(e->device);
    if (scene == NULL)
        return NULL;
    rtcSetSceneFlags(
        scene, RTC_SCENE_FLAG_ROBUST | (dynamic ? RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_NONE));
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
    return scene;
}

static void release_body(struct hg_embree_body *body)
{
    if (body->scene != NULL)
        rtcReleaseScene(body->scene);
    hg_free(body->geometries);
    memset(body, 0, sizeof *body);
}

static void release_flat(struct hg_embree *e)
{
    release_body(&e->flat);
    if (e->flat_alpha_mask != NULL)
        rtcReleaseScene(e->flat_alpha_mask);
    e->flat_alpha_mask = NULL;
    e->flat_there = false;
}

static enum hg_status start_body(
    struct hg_embree *e, struct hg_embree_body *body, uint32_t geometries, bool dynamic)
{
    body->geometry_count = geometries;
    body->geometries = hg_calloc(geometries, sizeof *body->geometries);
    body->scene = open_scene(e, dynamic);
    return body->geometries != NULL && body->scene != NULL ? HG_OK : HG_E_NOMEM;
}

// --- flat ----------------------------------------------------------------------------------------

// The pieces of one place in world space. Pieces of one chunk share its vertices.
static enum hg_status add_flat_place(
    const struct build *b, const struct hg_trace_place *place, uint32_t *id)
{
    RTCBuffer buffer = NULL;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < place->piece_count && status == HG_OK; i++) {
        const struct hg_ray_geometry_piece *piece = hg_trace_piece(b->layout, place, i);
        if (i == 0 || piece->positions != piece[-1].positions) {
            if (buffer != NULL)
                rtcReleaseBuffer(buffer);
            buffer = world_positions(b->e, piece, piece->world);
        }
        const RTCGeometry geometry =
            buffer != NULL ? open_geometry(b->e, piece, RTC_BUILD_QUALITY_MEDIUM) : NULL;
        if (geometry == NULL) {
            status = HG_E_NOMEM;
            break;
        }
        rtcSetGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, buffer, 0, 12,
            piece->vertex_count);
        b->e->flat.geometries[*id] =
            (struct hg_embree_geometry){place->draw, piece->first_primitive};
        if (place->mask != HG_RAY_OPAQUE && b->e->flat_alpha_mask == NULL)
            b->e->flat_alpha_mask = open_scene(b->e, false);
        if (place->mask != HG_RAY_OPAQUE && b->e->flat_alpha_mask != NULL)
            rtcAttachGeometryByID(b->e->flat_alpha_mask, geometry, *id);
        if (place->mask != HG_RAY_OPAQUE && b->e->flat_alpha_mask == NULL)
            status = HG_E_NOMEM;
        attach(b->e->flat.scene, geometry, place->mask, (*id)++);
    }
    if (buffer != NULL)
        rtcReleaseBuffer(buffer);
    return status;
}

static uint32_t flat_pieces(const struct hg_trace_layout *l)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < l->body_count; i++)
        for (uint32_t p = 0; l->bodies[i].flat && p < l->bodies[i].place_count; p++)
            count += l->places[l->bodies[i].first_place + p].piece_count;
    return count;
}

static enum hg_status build_flat(const struct build *b)
{
    struct hg_embree *e = b->e;
    const struct hg_trace_layout *l = b->layout;
    if (e->flat_there && e->flat.key == l->flat_key && !l->flat_deforms)
        return HG_OK;
    release_flat(e);
    if (l->flat_key == 0)
        return HG_OK;
    enum hg_status status = start_body(e, &e->flat, flat_pieces(l), false);
    uint32_t id = 0;
    for (uint32_t i = 0; i < l->body_count; i++)
        for (uint32_t p = 0; status == HG_OK && l->bodies[i].flat && p < l->bodies[i].place_count;
             p++)
            status = add_flat_place(b, &l->places[l->bodies[i].first_place + p], &id);
    if (status != HG_OK)
        return status;
    rtcCommitScene(e->flat.scene);
    if (e->flat_alpha_mask != NULL)
        rtcCommitScene(e->flat_alpha_mask);
    e->flat.key = l->flat_key;
    e->flat_there = true;
    e->trace->stats.built_triangles += l->flat_triangles;
    return HG_OK;
}

// --- bodies --------------------------------------------------------------------------------------

static uint64_t shape_of(const struct build *b, const struct hg_trace_body *body)
{
    uint64_t h = body->moves;
    const struct hg_trace_place *place = &b->layout->places[body->first_place];
    for (uint32_t i = 0; i < place->piece_count; i++) {
        const struct hg_ray_geometry_piece *p = hg_trace_piece(b->layout, place, i);
        h = (h * 31 + (uintptr_t)p->positions) * 31 + (uintptr_t)p->indices;
    }
    return h;
}

// In the body's own space, at both ends of the shutter where they differ.
static bool set_positions(struct hg_embree *e, const struct hg_trace_body *from,
    const struct hg_ray_geometry_piece *piece, RTCGeometry geometry)
{
    const bool moves = piece->opening != NULL;
    rtcSetGeometryTimeStepCount(geometry, moves ? 2 : 1);
    if (from->in_world) {
        const RTCBuffer buffer = world_positions(e, piece, piece->world);
        if (buffer == NULL)
            return false;
        rtcSetGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, buffer, 0, 12,
            piece->vertex_count);
        rtcReleaseBuffer(buffer);
        return true;
    }
    share_positions(geometry, piece, 0, moves ? piece->opening : piece->positions);
    if (moves)
        share_positions(geometry, piece, 1, piece->positions);
    return true;
}

static enum hg_status build_body(
    const struct build *b, const struct hg_trace_body *from, struct hg_embree_body *body)
{
    const struct hg_trace_place *place = &b->layout->places[from->first_place];
    const enum RTCBuildQuality quality =
        from->deforms ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM;
    const enum hg_status status = start_body(b->e, body, place->piece_count, from->deforms);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < place->piece_count; i++) {
        const struct hg_ray_geometry_piece *piece = hg_trace_piece(b->layout, place, i);
        const RTCGeometry geometry = open_geometry(b->e, piece, quality);
        if (geometry == NULL)
            return HG_E_NOMEM;
        if (!set_positions(b->e, from, piece, geometry)) {
            rtcReleaseGeometry(geometry);
            return HG_E_NOMEM;
        }
        body->geometries[i].first_primitive = piece->first_primitive;
        attach(body->scene, geometry, HG_RAY_ALL, i);
    }
    rtcCommitScene(body->scene);
    body->key = from->key;
    body->shape = shape_of(b, from);
    return HG_OK;
}

// Positions are others under the same addresses.
static void refit_body(struct hg_embree_body *body, bool moves)
{
    for (uint32_t i = 0; i < body->geometry_count; i++) {
        const RTCGeometry geometry = rtcGetGeometry(body->scene, i);
        rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
        if (moves)
            rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 1);
        rtcCommitGeometry(geometry);
    }
    rtcCommitScene(body->scene);
    body->refits++;
}

static int by_key(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static enum hg_status bring_body(const struct build *b, const struct hg_trace_body *from,
    struct hg_embree_body *old, struct hg_embree_body *body)
{
    struct hg_trace_stats *stats = &b->e->trace->stats;
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = HG_OK;
    if (old != NULL && old->shape == shape_of(b, from) && old->refits < MOST_REFITS) {
        *body = *old;
        memset(old, 0, sizeof *old);
        if (from->deforms) {
            refit_body(body, from->moves);
            stats->refit_triangles += from->triangles;
        }
        stats->refit_ns += hg_clock_now_ns() - start;
    } else {
        status = build_body(b, from, body);
        stats->built_triangles += from->triangles;
        stats->build_ns += hg_clock_now_ns() - start;
    }
    return status;
}

static enum hg_status build_bodies(const struct build *b)
{
    struct hg_embree *e = b->e;
    const struct hg_trace_layout *l = b->layout;
    struct hg_embree_body *old = e->bodies;
    const uint32_t old_count = e->body_count;
    e->bodies = hg_calloc(l->body_count, sizeof *e->bodies);
    e->body_count = 0;
    enum hg_status status = e->bodies != NULL ? HG_OK : HG_E_NOMEM;
    for (uint32_t i = 0; i < l->body_count && status == HG_OK; i++) {
        if (l->bodies[i].flat)
            continue;
        struct hg_embree_body *found =
            old_count > 0 ? bsearch(&l->bodies[i].key, old, old_count, sizeof *old, by_key) : NULL;
        status = bring_body(b, &l->bodies[i], found, &e->bodies[e->body_count++]);
    }
    for (uint32_t i = 0; i < old_count; i++)
        release_body(&old[i]);
    hg_free(old);
    return status;
}

// --- instances -----------------------------------------------------------------------------------

static enum hg_status add_instance(const struct build *b, const struct hg_trace_body *from,
    const struct hg_embree_body *body, const struct hg_trace_place *place, uint32_t id)
{
    struct hg_embree *e = b->e;
    const struct hg_ray_geometry_piece *piece = &b->layout->pieces[place->first_piece];
    const RTCGeometry geometry = rtcNewGeometry(e->device, RTC_GEOMETRY_TYPE_INSTANCE);
    if (geometry == NULL)
        return HG_E_NOMEM;
    const float *world = hg_trace_matrix(from, piece);
    const bool moves =
        !from->in_world && memcmp(piece->world, piece->previous, sizeof piece->world) != 0;
    rtcSetGeometryInstancedScene(geometry, body->scene);
    rtcSetGeometryTimeStepCount(geometry, moves ? 2 : 1);
    rtcSetGeometryTransform(
        geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, moves ? piece->previous : world);
    if (moves)
        rtcSetGeometryTransform(geometry, 1, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, world);
    e->instances[id] = (struct hg_embree_instance){place->draw, body};
    attach(e->top, geometry, place->mask, id);
    return HG_OK;
}

static enum hg_status build_instances(const struct build *b)
{
    struct hg_embree *e = b->e;
    const struct hg_trace_layout *l = b->layout;
    if (e->top != NULL)
        rtcReleaseScene(e->top);
    e->top = NULL;
    if (l->instances == 0)
        return HG_OK;
    enum hg_status status =
        hg_grow(&e->instances, &e->instance_capacity, l->instances, sizeof *e->instances);
    e->top = open_scene(e, false);
    if (e->top == NULL)
        status = HG_E_NOMEM;
    uint32_t id = 0, at = 0;
    for (uint32_t i = 0; i < l->body_count && status == HG_OK; i++) {
        const struct hg_trace_body *from = &l->bodies[i];
        if (from->flat)
            continue;
        for (uint32_t p = 0; p < from->place_count && status == HG_OK; p++)
            status = add_instance(b, from, &e->bodies[at], &l->places[from->first_place + p], id++);
        at++;
    }
    if (status == HG_OK)
        rtcCommitScene(e->top);
    return status;
}

// --- all of it -----------------------------------------------------------------------------------

void hg_embree_clear(struct hg_embree *e)
{
    if (e->top != NULL)
        rtcReleaseScene(e->top);
    e->top = NULL;
    for (uint32_t i = 0; i < e->body_count; i++)
        release_body(&e->bodies[i]);
    hg_free(e->bodies);
    e->bodies = NULL;
    e->body_count = 0;
    release_flat(e);
}

static enum hg_status check_budget(const struct build *b, struct hg_error *err)
{
    const struct hg_trace_layout *l = b->layout;
    const uint64_t budget = (uint64_t)b->e->limit_bytes;
    uint64_t vertices = 0;
    for (uint32_t i = 0; i < l->body_count; i++)
        vertices += l->bodies[i].flat ? l->bodies[i].vertices * l->bodies[i].place_count : 0;
    const uint64_t need = l->triangles * TRIANGLE_BYTES + vertices * VERTEX_BYTES;
    if (budget == 0 || need <= budget)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, "ray tracing budget", NULL,
        "about %llu bytes are needed for %llu triangles, the budget is %llu",
        (unsigned long long)need, (unsigned long long)l->triangles, (unsigned long long)budget);
}

enum hg_status hg_embree_build(
    struct hg_embree *e, const struct hg_trace_layout *layout, struct hg_error *err)
{
    const struct build b = {e, layout};
    enum hg_status status = check_budget(&b, err);
    if (status != HG_OK)
        return status;
    atomic_store(&e->refused, false);
    const uint64_t start = hg_clock_now_ns();
    status = build_flat(&b);
    e->trace->stats.build_ns += hg_clock_now_ns() - start;
    if (status == HG_OK)
        status = build_bodies(&b);
    const uint64_t top = hg_clock_now_ns();
    if (status == HG_OK)
        status = build_instances(&b);
    e->trace->stats.refit_ns += hg_clock_now_ns() - top;
    const enum hg_status said = hg_embree_check(e, err);
    if (said != HG_OK || status == HG_OK)
        return said;
    return hg_error_set(err, status, "ray tracing", NULL, "no memory");
}
