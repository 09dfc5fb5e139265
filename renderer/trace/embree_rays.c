// embree_rays.c - traces waves with Embree: packets of coherent rays, else single rays.
//
// Flat triangles and instances are two scenes: a ray traverses the first, then the second up to the
// hit. Packets affect rounding: a hit may depend in its last bits on the other rays of the packet,
// so packets are always formed by the position of rays in the wave.
//
// Embree traverses packets three times as fast with the coherent flag. With it, rtcOccluded16 does
// not return for some packets of incoherent rays (3.13.5), so it is set only for packets whose
// directions have the same signs, and not where instances would rotate them.

#include <math.h>
#include <string.h>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#include "renderer/trace/embree.h"

// Embree requires flush-to-zero and denormals-are-zero while it traces.
#ifdef __SSE2__
static uint32_t flush_to_zero(void)
{
    const uint32_t mode = _mm_getcsr();
    _mm_setcsr(mode | 0x8040u);
    return mode;
}

static void restore_mode(uint32_t mode)
{
    _mm_setcsr(mode);
}
#else
static uint32_t flush_to_zero(void)
{
    return 0;
}

static void restore_mode(uint32_t mode)
{
    (void)mode;
}
#endif

// The next floats: t_min and t_max themselves are not hit. Denormals count as 0.
static float above(float t)
{
    uint32_t bits;
    if (!(t >= 0x1p-126f))
        return 0x1p-126f;
    memcpy(&bits, &t, sizeof bits);
    bits++;
    memcpy(&t, &bits, sizeof t);
    return t;
}

static float below(float t)
{
    uint32_t bits;
    memcpy(&bits, &t, sizeof bits);
    bits -= bits > 0 && bits <= 0x7f7fffffu;
    if (bits > 0x7f7fffffu)
        bits = 0x7f7fffffu;
    memcpy(&t, &bits, sizeof t);
    return t;
}

static float clamp01(float x)
{
    return x > 0.0f ? (x < 1.0f ? x : 1.0f) : 0.0f;
}

static void fill_ray(const struct hg_gpu_ray *from, struct RTCRay *to)
{
    *to = (struct RTCRay){.org_x = from->origin_ws.x,
        .org_y = from->origin_ws.y,
        .org_z = from->origin_ws.z,
        .tnear = above(from->t_min),
        .dir_x = from->direction_ws.x,
        .dir_y = from->direction_ws.y,
        .dir_z = from->direction_ws.z,
        .time = clamp01(from->time),
        .tfar = below(from->t_max),
        .mask = from->mask};
}

static uint32_t number_of(const struct hg_embree *e, uint32_t instance, uint32_t geometry,
    uint32_t primitive, uint32_t *draw)
{
    const struct hg_embree_body *body =
        instance != RTC_INVALID_GEOMETRY_ID ? e->instances[instance].body : &e->flat;
    const struct hg_embree_geometry *g = &body->geometries[geometry];
    *draw = instance != RTC_INVALID_GEOMETRY_ID ? e->instances[instance].draw : g->draw;
    return g->first_primitive + primitive;
}

// The flat scene for one ray; NULL: it has nothing that the ray looks for.
static RTCScene flat_scene(const struct hg_embree *e, uint32_t mask)
{
    if (!e->flat_there)
        return NULL;
    return (mask & HG_RAY_OPAQUE) != 0 ? e->flat.scene : e->flat_alpha_mask;
}

// --- the two Embrees -----------------------------------------------------------------------------

#if HELIO_EMBREE == 4
#define CONTEXT(name, coherent)                                                                    \
    struct RTCIntersectArguments name##_i;                                                         \
    struct RTCOccludedArguments name##_o;                                                          \
    rtcInitIntersectArguments(&name##_i);                                                          \
    rtcInitOccludedArguments(&name##_o);                                                           \
    name##_i.flags = name##_o.flags =                                                              \
        ((coherent) ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT)
#define INTERSECT1(scene, c, r)      rtcIntersect1(scene, r, &c##_i)
#define OCCLUDED1(scene, c, r)       rtcOccluded1(scene, r, &c##_o)
#define INTERSECT(n, scene, c, v, r) rtcIntersect##n(v, scene, r, &c##_i)
#define OCCLUDED(n, scene, c, v, r)  rtcOccluded##n(v, scene, r, &c##_o)
#else
#define CONTEXT(name, coherent)                                                                    \
    struct RTCIntersectContext name;                                                               \
    rtcInitIntersectContext(&name);                                                                \
    name.flags =                                                                                   \
        ((coherent) ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT)
#define INTERSECT1(scene, c, r)      rtcIntersect1(scene, &c, r)
#define OCCLUDED1(scene, c, r)       rtcOccluded1(scene, &c, r)
#define INTERSECT(n, scene, c, v, r) rtcIntersect##n(v, scene, &c, r)
#define OCCLUDED(n, scene, c, v, r)  rtcOccluded##n(v, scene, &c, r)
#endif

// Place of ray i of a wave.
static uint32_t place_of(const uint32_t *list, uint32_t i)
{
    return list != NULL ? list[i] : i;
}

// The part of a list that is a block's; NULL: there is none.
static const uint32_t *list_of(const struct hg_trace_wave *w, uint32_t first)
{
    return w->list != NULL ? (const uint32_t *)w->list->mapped + first : NULL;
}

// --- one by one ----------------------------------------------------------------------------------

static void closest_one(
    const struct hg_embree *e, const struct hg_gpu_ray *ray, struct hg_gpu_hit *out)
{
    struct RTCRayHit r;
    CONTEXT(context, false);
    out->draw = HG_HIT_NONE;
    if (!hg_trace_is_ray(ray))
        return;
    fill_ray(ray, &r.ray);
    const RTCScene flat = flat_scene(e, ray->mask);
    for (int scene = 0; scene < 2; scene++) {
        r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        if (scene == 0 && flat != NULL)
            INTERSECT1(flat, context, &r);
        if (scene == 1 && e->top != NULL)
            INTERSECT1(e->top, context, &r);
        if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID)
            continue;
        out->t = r.ray.tfar;
        out->u = r.hit.u;
        out->v = r.hit.v;
        out->primitive = number_of(e, r.hit.instID[0], r.hit.geomID, r.hit.primID, &out->draw);
    }
}

static uint32_t blocked_one(const struct hg_embree *e, const struct hg_gpu_ray *ray)
{
    struct RTCRay r;
    CONTEXT(context, false);
    if (!hg_trace_is_ray(ray))
        return 0;
    const RTCScene flat = flat_scene(e, ray->mask);
    fill_ray(ray, &r);
    if (flat != NULL)
        OCCLUDED1(flat, context, &r);
    if (e->top != NULL && r.tfar >= 0.0f)
        OCCLUDED1(e->top, context, &r);
    return r.tfar < 0.0f;
}

// --- packets -------------------------------------------------------------------------------------

// Whether the directions of all rays have the same signs.
static bool is_alike(const int *valid, const float *x, const float *y, const float *z, uint32_t n)
{
    uint32_t any[3] = {0}, all[3] = {1, 1, 1};
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t signs[3] = {signbit(x[i]) != 0, signbit(y[i]) != 0, signbit(z[i]) != 0};
        for (int c = 0; c < 3 && valid[i] != 0; c++) {
            any[c] |= signs[c];
            all[c] &= signs[c];
        }
    }
    return any[0] == all[0] && any[1] == all[1] && any[2] == all[2];
}

#define PACKET(N)                                                                                  \
    static void load##N(const struct hg_gpu_ray *rays, const uint32_t *list, uint32_t count,       \
        int valid[N], struct RTCRay##N *to)                                                        \
    {                                                                                              \
        struct RTCRay r = {0};                                                                     \
        for (uint32_t i = 0; i < N; i++) {                                                         \
            const struct hg_gpu_ray *ray = &rays[i < count ? place_of(list, i) : 0];               \
            valid[i] = i < count && hg_trace_is_ray(ray) ? -1 : 0;                                 \
            if (valid[i] != 0)                                                                     \
                fill_ray(ray, &r);                                                                 \
            to->org_x[i] = r.org_x;                                                                \
            to->org_y[i] = r.org_y;                                                                \
            to->org_z[i] = r.org_z;                                                                \
            to->tnear[i] = r.tnear;                                                                \
            to->dir_x[i] = r.dir_x;                                                                \
            to->dir_y[i] = r.dir_y;                                                                \
            to->dir_z[i] = r.dir_z;                                                                \
            to->time[i] = r.time;                                                                  \
            to->tfar[i] = r.tfar;                                                                  \
            to->mask[i] = r.mask;                                                                  \
            to->id[i] = to->flags[i] = 0;                                                          \
        }                                                                                          \
    }                                                                                              \
                                                                                                   \
    static void closest##N(const struct hg_embree *e, const struct hg_gpu_ray *rays,               \
        const uint32_t *list, uint32_t count, struct hg_gpu_hit *out)                              \
    {                                                                                              \
        struct RTCRayHit##N r;                                                                     \
        int valid[N] __attribute__((aligned(64)));                                                 \
        load##N(rays, list, count, valid, &r.ray);                                                 \
        CONTEXT(flat, is_alike(valid, r.ray.dir_x, r.ray.dir_y, r.ray.dir_z, N));                  \
        CONTEXT(placed, false);                                                                    \
        for (uint32_t i = 0; i < count; i++)                                                       \
            out[place_of(list, i)].draw = HG_HIT_NONE;                                             \
        for (int scene = 0; scene < 2; scene++) {                                                  \
            if (scene == 0 ? !e->flat_there : e->top == NULL)                                      \
                continue;                                                                          \
            memset(r.hit.geomID, 0xff, sizeof r.hit.geomID);                                       \
            memset(r.hit.instID, 0xff, sizeof r.hit.instID);                                       \
            if (scene == 0)                                                                        \
                INTERSECT(N, e->flat.scene, flat, valid, &r);                                      \
            else                                                                                   \
                INTERSECT(N, e->top, placed, valid, &r);                                           \
            for (uint32_t i = 0; i < count; i++) {                                                 \
                if (valid[i] == 0 || r.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID)                   \
                    continue;                                                                      \
                struct hg_gpu_hit *hit = &out[place_of(list, i)];                                  \
                hit->t = r.ray.tfar[i];                                                            \
                hit->u = r.hit.u[i];                                                               \
                hit->v = r.hit.v[i];                                                               \
                hit->primitive = number_of(                                                        \
                    e, r.hit.instID[0][i], r.hit.geomID[i], r.hit.primID[i], &hit->draw);          \
            }                                                                                      \
        }                                                                                          \
    }                                                                                              \
                                                                                                   \
    static void blocked##N(const struct hg_embree *e, const struct hg_gpu_ray *rays,               \
        const uint32_t *list, uint32_t count, uint32_t *out)                                       \
    {                                                                                              \
        struct RTCRay##N r;                                                                        \
        int valid[N] __attribute__((aligned(64)));                                                 \
        load##N(rays, list, count, valid, &r);                                                     \
        CONTEXT(flat, is_alike(valid, r.dir_x, r.dir_y, r.dir_z, N));                              \
        CONTEXT(placed, false);                                                                    \
        if (e->flat_there)                                                                         \
            OCCLUDED(N, e->flat.scene, flat, valid, &r);                                           \
        for (uint32_t i = 0; i < count; i++) {                                                     \
            const bool met = valid[i] != 0 && r.tfar[i] < 0.0f;                                    \
            out[place_of(list, i)] = met;                                                          \
            if (met)                                                                               \
                valid[i] = 0;                                                                      \
        }                                                                                          \
        if (e->top == NULL)                                                                        \
            return;                                                                                \
        OCCLUDED(N, e->top, placed, valid, &r);                                                    \
        for (uint32_t i = 0; i < count; i++)                                                       \
            out[place_of(list, i)] |= valid[i] != 0 && r.tfar[i] < 0.0f;                           \
    }

PACKET(8)
PACKET(16)

// --- a block -------------------------------------------------------------------------------------

struct block {
    const struct hg_gpu_ray *rays; // of the wave
    const uint32_t *list;          // of the block; NULL: rays are the block's
    uint32_t count, packet;
};

static void closest_block(const struct hg_embree *e, const struct block *b, struct hg_gpu_hit *hits)
{
    for (uint32_t i = 0; i < b->count; i += b->packet) {
        const uint32_t n = b->count - i < b->packet ? b->count - i : b->packet;
        const uint32_t *list = b->list != NULL ? b->list + i : NULL;
        const uint32_t at = list != NULL ? 0 : i;
        if (b->packet == 16)
            closest16(e, b->rays + at, list, n, hits + at);
        else if (b->packet == 8)
            closest8(e, b->rays + at, list, n, hits + at);
        else
            closest_one(e, b->rays + place_of(b->list, i), hits + place_of(b->list, i));
    }
}

static void blocked_block(const struct hg_embree *e, const struct block *b, uint32_t *out)
{
    for (uint32_t i = 0; i < b->count; i += b->packet) {
        const uint32_t n = b->count - i < b->packet ? b->count - i : b->packet;
        const uint32_t *list = b->list != NULL ? b->list + i : NULL;
        const uint32_t at = list != NULL ? 0 : i;
        if (b->packet == 16)
            blocked16(e, b->rays + at, list, n, out + at);
        else if (b->packet == 8)
            blocked8(e, b->rays + at, list, n, out + at);
        else
            out[place_of(b->list, i)] = blocked_one(e, b->rays + place_of(b->list, i));
    }
}

void hg_embree_trace(const struct hg_embree *e, const struct hg_trace_wave *w, bool any,
    uint32_t first, uint32_t count)
{
    const uint32_t mode = flush_to_zero(), skip = w->list != NULL ? 0 : first;
    const struct block block = {
        .rays = (const struct hg_gpu_ray *)w->rays->mapped + w->first_ray + skip,
        .list = list_of(w, first),
        .count = count,
        .packet = w->coherent ? e->packet : 1};
    if (any)
        blocked_block(e, &block, (uint32_t *)w->blocked->mapped + w->first_hit + skip);
    else
        closest_block(e, &block, (struct hg_gpu_hit *)w->hits->mapped + w->first_hit + skip);
    restore_mode(mode);
}

// --- raw -----------------------------------------------------------------------------------------

struct packet { // of 16 rays
    int valid[16];
    union {
        struct RTCRayHit16 wide;
        struct RTCRayHit8 half[2];
        struct RTCRayHit one[16];
    };
} __attribute__((aligned(64)));

size_t hg_embree_packet_bytes(void)
{
    return sizeof(struct packet);
}

static void lay_out_one(const struct hg_gpu_ray *from, struct RTCRayHit *to, int *valid)
{
    to->hit.geomID = to->hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    *valid = hg_trace_is_ray(from) ? -1 : 0;
    if (*valid != 0)
        fill_ray(from, &to->ray);
}

void hg_embree_lay_out(const struct hg_embree *e, const struct hg_trace_wave *w, uint32_t first,
    uint32_t count, void *packets)
{
    const uint32_t *list = list_of(w, first);
    const struct hg_gpu_ray *rays =
        (const struct hg_gpu_ray *)w->rays->mapped + w->first_ray + (list != NULL ? 0 : first);
    struct packet *p = packets;
    memset(p, 0, (count + 15) / 16 * sizeof *p);
    for (uint32_t i = 0; i < count; i++, p += i % 16 == 0) {
        const uint32_t at = i % 16;
        const uint32_t *here = list != NULL ? list + i : NULL;
        const struct hg_gpu_ray *from = list != NULL ? rays : rays + i;
        if (!w->coherent || e->packet == 1)
            lay_out_one(&rays[place_of(list, i)], &p->one[at], &p->valid[at]);
        else if (at == 0 && e->packet == 16)
            load16(from, here, count - i, p->valid, &p->wide.ray);
        else if (at % 8 == 0 && e->packet == 8)
            load8(from, here, count - i, p->valid + at, &p->half[at / 8].ray);
        if (at == 0 && w->coherent && e->packet == 16)
            memset(&p->wide.hit, 0xff, sizeof p->wide.hit);
        else if (at % 8 == 0 && w->coherent && e->packet == 8)
            memset(&p->half[at / 8].hit, 0xff, sizeof p->half[0].hit);
    }
}

static void walk_packet(const struct hg_embree *e, RTCScene scene, struct packet *p, bool any)
{
    const bool flat = scene != e->top;
    if (e->packet == 16) {
        const struct RTCRay16 *r = &p->wide.ray;
        CONTEXT(context, flat && is_alike(p->valid, r->dir_x, r->dir_y, r->dir_z, 16));
        if (any)
            OCCLUDED(16, scene, context, p->valid, &p->wide.ray);
        else
            INTERSECT(16, scene, context, p->valid, &p->wide);
        return;
    }
    for (int i = 0; i < 2; i++) {
        const struct RTCRay8 *r = &p->half[i].ray;
        CONTEXT(context, flat && is_alike(p->valid + i * 8, r->dir_x, r->dir_y, r->dir_z, 8));
        if (any)
            OCCLUDED(8, scene, context, p->valid + i * 8, &p->half[i].ray);
        else
            INTERSECT(8, scene, context, p->valid + i * 8, &p->half[i]);
    }
}

static void walk_ones(RTCScene scene, struct packet *p, bool any)
{
    for (int i = 0; i < 16; i++) {
        CONTEXT(context, false);
        if (p->valid[i] == 0 || p->one[i].ray.tfar < 0.0f)
            continue;
        if (any)
            OCCLUDED1(scene, context, &p->one[i].ray);
        else
            INTERSECT1(scene, context, &p->one[i]);
    }
}

void hg_embree_walk(const struct hg_embree *e, const struct hg_trace_wave *w, bool any,
    void *packets, uint32_t count)
{
    const uint32_t mode = flush_to_zero();
    struct packet *p = packets;
    const RTCScene scenes[2] = {e->flat_there ? e->flat.scene : NULL, e->top};
    for (uint32_t i = 0; i < count; i += 16, p++)
        for (int s = 0; s < 2; s++) {
            if (scenes[s] != NULL && w->coherent && e->packet > 1)
                walk_packet(e, scenes[s], p, any);
            else if (scenes[s] != NULL)
                walk_ones(scenes[s], p, any);
        }
    restore_mode(mode);
}
