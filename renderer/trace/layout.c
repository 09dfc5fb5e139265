// layout.c - see layout.h.
#include "renderer/trace/layout.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/trace/internal.h"
#include "shaders/shared/ray.h"

// Triangles of all places of a body up to which it is flat though it is placed more than once.
#define FLAT_TRIANGLES 65536u

// Most that Embree takes of a coordinate of a ray; above it aborts. Rays go into instances.
#define LARGEST 1e18

static double determinant(const float m[12])
{
    double det = 0.0;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        det += m[i] * ((double)m[3 + j] * m[6 + k] - (double)m[3 + k] * m[6 + j]);
    }
    return det;
}

// Whether all rays are rays in the space of the instance, too.
static bool keeps_rays(const float m[12], double det)
{
    for (int c = 0; c < 3; c++) { // rows of the inverse
        const float *u = m + (c + 1) % 3 * 3, *v = m + (c + 2) % 3 * 3;
        double largest = 0.0, sum = 0.0;
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double entry = fabs(((double)u[j] * v[k] - (double)u[k] * v[j]) / det);
            largest = fmax(largest, entry);
            sum += entry * fabs((double)m[9 + i]);
        }
        if (!(largest * (double)HG_RAY_FARTHEST + sum <= LARGEST))
            return false;
    }
    return true;
}

// False for matrices unsuitable for instances: not finite or (nearly) singular.
static bool is_invertible(const float m[12])
{
    double length[3];
    for (int i = 0; i < 3; i++) {
        length[i] = sqrt((double)m[i * 3] * m[i * 3] + (double)m[i * 3 + 1] * m[i * 3 + 1] +
                         (double)m[i * 3 + 2] * m[i * 3 + 2]);
        if (!isfinite(m[9 + i]) || !(length[i] > 1e-18 && length[i] < 1e18))
            return false;
    }
    const double det = determinant(m);
    return fabs(det) > 1e-5 * length[0] * length[1] * length[2] && keeps_rays(m, det);
}

// Draws with non-finite or oversized bounds are left out.
static bool is_somewhere(const float m[12])
{
    for (int i = 0; i < 12; i++)
        if (!(fabsf(m[i]) <= 1e15f))
            return false;
    return true;
}

static int by_key(const void *a, const void *b)
{
    const struct hg_trace_place *x = a, *y = b;
    if (x->key != y->key)
        return x->key < y->key ? -1 : 1;
    return x->draw < y->draw ? -1 : x->draw > y->draw;
}

// One place per draw.
static enum hg_status list_places(
    struct hg_trace_layout *l, const struct hg_ray_geometry_piece *pieces, uint32_t count)
{
    l->place_count = 0;
    for (uint32_t i = 0, n; i < count; i += n) {
        uint64_t key = hg_hash_mix(3, pieces[i].key);
        for (n = 1; i + n < count && pieces[i + n].draw == pieces[i].draw; n++)
            key = hg_hash_mix(key, pieces[i + n].key);
        if (!is_somewhere(pieces[i].world) || !is_somewhere(pieces[i].previous))
            continue;
        const enum hg_status status =
            hg_grow(&l->places, &l->place_capacity, l->place_count + 1, sizeof *l->places);
        if (status != HG_OK)
            return status;
        l->places[l->place_count++] = (struct hg_trace_place){.draw = pieces[i].draw,
            .mask = hg_trace_mask(pieces[i].flags),
            .first_piece = i,
            .piece_count = n,
            .key = key};
    }
    if (l->place_count > 0)
        qsort(l->places, l->place_count, sizeof *l->places, by_key);
    return HG_OK;
}

static void measure_body(const struct hg_trace_layout *l, struct hg_trace_body *body)
{
    const struct hg_trace_place *place = &l->places[body->first_place];
    for (uint32_t i = 0; i < place->piece_count; i++) {
        const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, i);
        body->triangles += piece->triangle_count;
        if (i == 0 || piece->positions != piece[-1].positions)
            body->vertices += piece->vertex_count;
        body->deforms = body->deforms || piece->deforms;
        body->moves = body->moves || piece->opening != NULL;
    }
}

// Whether the body should be flat.
static void choose(const struct hg_trace_layout *l, struct hg_trace_body *body)
{
    bool invertible = true, still = true, animated = false;
    for (uint32_t i = 0; i < body->place_count; i++) {
        const struct hg_ray_geometry_piece *p =
            &l->pieces[l->places[body->first_place + i].first_piece];
        // Matrices that change handedness have no valid interpolation.
        invertible = invertible && is_invertible(p->world) && is_invertible(p->previous) &&
                     (determinant(p->world) > 0) == (determinant(p->previous) > 0);
        still = still && memcmp(p->world, p->previous, sizeof p->world) == 0;
        animated = animated || p->animated;
    }
    const bool small = body->triangles * body->place_count <= FLAT_TRIANGLES;
    body->still = still || !invertible; // what is flat without choice is shown as it is at the end
    body->flat =
        !invertible || (still && !body->deforms && !animated && (body->place_count == 1 || small));
}

// What decides the flat structure: also draws, classes, and where its input lies.
static uint64_t hash_flat(
    const struct hg_trace_layout *l, const struct hg_trace_body *body, uint64_t h)
{
    for (uint32_t i = 0; i < body->place_count; i++) {
        const struct hg_trace_place *place = &l->places[body->first_place + i];
        h = hg_hash_mix(hg_hash_mix(h, place->key), (uint64_t)place->draw << 32 | place->mask);
        h = hg_hash_mix_bytes(h, l->pieces[place->first_piece].world, 12 * sizeof(float));
        for (uint32_t k = 0; k < place->piece_count; k++) {
            const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, k);
            h = hg_hash_mix(hg_hash_mix(h, (uintptr_t)piece->positions), (uintptr_t)piece->indices);
        }
    }
    return h | 1;
}

static enum hg_status list_bodies(struct hg_trace_layout *l)
{
    enum hg_status status = HG_OK;
    l->body_count = 0;
    for (uint32_t i = 0, n; i < l->place_count && status == HG_OK; i += n) {
        for (n = 1; i + n < l->place_count && l->places[i + n].key == l->places[i].key;)
            n++;
        status = hg_grow(&l->bodies, &l->body_capacity, l->body_count + 1, sizeof *l->bodies);
        if (status != HG_OK)
            return status;
        struct hg_trace_body *body = &l->bodies[l->body_count++];
        *body = (struct hg_trace_body){.key = l->places[i].key, .first_place = i, .place_count = n};
        measure_body(l, body);
        choose(l, body);
    }
    return status;
}

static void sum_up(struct hg_trace_layout *l)
{
    l->flat_key = l->flat_triangles = l->triangles = 0;
    l->instances = 0;
    l->flat_deforms = l->motion = false;
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *body = &l->bodies[i];
        l->motion = l->motion || body->moves || !body->still;
        l->triangles += body->triangles * (body->flat ? body->place_count : 1);
        if (!body->flat) {
            l->instances += body->place_count;
            continue;
        }
        l->flat_deforms = l->flat_deforms || (body->deforms && body->place_count > 0);
        l->flat_triangles += body->triangles * body->place_count;
        if (body->place_count > 0)
            l->flat_key = hash_flat(l, body, l->flat_key);
    }
}

static int by_body_key(const void *a, const void *b)
{
    const struct hg_trace_body *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

enum hg_status hg_trace_layout_make(
    struct hg_trace_layout *l, const struct hg_ray_geometry_piece *pieces, uint32_t count)
{
    l->pieces = pieces;
    enum hg_status status = list_places(l, pieces, count);
    if (status == HG_OK)
        status = list_bodies(l);
    if (status == HG_OK && l->apart)
        status = hg_trace_apart_split(l);
    if (status == HG_OK && l->apart && l->body_count > 0)
        qsort(l->bodies, l->body_count, sizeof *l->bodies, by_body_key);
    if (status == HG_OK)
        sum_up(l);
    return status;
}

void hg_trace_layout_finish(struct hg_trace_layout *l)
{
    hg_free(l->places);
    hg_free(l->bodies);
    hg_trace_apart_finish(&l->moved);
    memset(l, 0, sizeof *l);
}
