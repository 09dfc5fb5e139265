// select.c - see select.h. Planes and eye are brought to the space of each object: what side of a
// plane a point is on, and which side of a triangle shows, no affine map changes.
#include "renderer/cull/select.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec3d.h"

#define BLOCK_MESHLETS 4096 // of one job, about

// Meshlets of a smaller radius are tested triangle by triangle only: tiny triangles may turn when
// their corners are rounded.
#define LEAST_CONE_PX 16.0f

struct block {
    uint32_t first_draw, end_draw;
    struct hg_selection selection;
    enum hg_status status;
};

struct run {
    const struct hg_geometry *geometry;
    const struct hg_culling_view *view;
    struct block *blocks;
};

// --- one object ----------------------------------------------------------------------------------

static void move_planes(
    const struct hg_culling_view *view, const float m[12], struct hg_object_view *out)
{
    out->plane_count = view->plane_count;
    for (uint32_t i = 0; i < view->plane_count; i++) {
        const float *p = view->planes[i];
        float *q = out->planes[i];
        for (int c = 0; c < 3; c++) {
            q[c] = p[0] * m[c * 3] + p[1] * m[c * 3 + 1] + p[2] * m[c * 3 + 2];
            out->reach[i][c] = fabsf(q[c]);
        }
        float at = p[3], slack = fabsf(p[3]);
        for (int c = 0; c < 3; c++) {
            at += p[c] * m[9 + c];
            slack += fabsf(p[c] * m[9 + c]);
        }
        q[3] = at + 1e-6f * slack; // what the sum may have lost: small objects far from the origin
    }
}

// inverse(m) * v of the linear part, and returns its determinant; 0 when it has no inverse. The
// rows of the inverse are the cross products of the columns over the determinant.
static double move_back(const float m[12], const double v[3], float out[3])
{
    const double x[3] = {m[0], m[1], m[2]}, y[3] = {m[3], m[4], m[5]}, z[3] = {m[6], m[7], m[8]};
    double rows[3][3];
    hg_cross3d(y, z, rows[0]);
    hg_cross3d(z, x, rows[1]);
    hg_cross3d(x, y, rows[2]);
    const double det = x[0] * rows[0][0] + x[1] * rows[0][1] + x[2] * rows[0][2];
    if (!(fabs(det) > DBL_MIN))
        return 0.0;
    for (int i = 0; i < 3; i++)
        out[i] = (float)((rows[i][0] * v[0] + rows[i][1] * v[1] + rows[i][2] * v[2]) / det);
    return det;
}

// Conservative: a box is outside when it lies wholly behind one plane.
static bool is_box_outside(const struct hg_culling_view *view, const struct hg_box *box)
{
    for (uint32_t i = 0; i < view->plane_count; i++) {
        const float *p = view->planes[i];
        float distance = p[3], scale = fabsf(p[3]);
        for (int c = 0; c < 3; c++) {
            const float corner = p[c] >= 0.0f ? box->max[c] : box->min[c];
            distance += p[c] * corner;
            scale += fabsf(p[c] * corner);
        }
        if (distance < -1e-6f * scale)
            return true;
    }
    return false;
}

// One of the planes that cut goes through the box, or there are none.
static bool is_cut(const struct hg_culling_view *view, const struct hg_box *box)
{
    for (uint32_t i = 0; i < view->cut_count; i++) {
        const float *p = view->cuts[i];
        float low = p[3], high = p[3];
        for (int c = 0; c < 3; c++) {
            low += p[c] * (p[c] >= 0.0f ? box->min[c] : box->max[c]);
            high += p[c] * (p[c] >= 0.0f ? box->max[c] : box->min[c]);
        }
        if (low <= 0.0f && high >= 0.0f)
            return true;
    }
    return view->cut_count == 0;
}

static void open_object(const struct hg_culling_view *view, const struct hg_mat4x3 *world,
    bool both_sides, struct hg_object_view *out)
{
    const float *m = world->m;
    const double from[3] = {
        (double)view->eye[0] - m[9], (double)view->eye[1] - m[10], (double)view->eye[2] - m[11]};
    const double along[3] = {view->forward[0], view->forward[1], view->forward[2]};
    memset(out, 0, sizeof *out);
    move_planes(view, m, out);
    out->orthographic = view->orthographic;
    if (both_sides)
        return;
    const double det =
        view->orthographic ? move_back(m, along, out->forward) : move_back(m, from, out->eye);
    // The least that a length grows is at least the determinant over the square of the most.
    const double most = (double)hg_matrix_max_stretch(world);
    const double least = fabs(det) / (most * most);
    out->has_facing = det != 0.0;
    out->px_scale = (float)((double)view->px_scale * (view->orthographic ? least : least / most));
}

bool hg_select_is_outside(const struct hg_object_view *o, const struct hg_meshlet *c)
{
    for (uint32_t i = 0; i < o->plane_count; i++) {
        const float *p = o->planes[i], *r = o->reach[i];
        const float at = p[0] * c->center[0] + p[1] * c->center[1] + p[2] * c->center[2] + p[3];
        const float size = r[0] * c->extent[0] + r[1] * c->extent[1] + r[2] * c->extent[2];
        const float scale = r[0] * fabsf(c->center[0]) + r[1] * fabsf(c->center[1]) +
                            r[2] * fabsf(c->center[2]) + fabsf(p[3]);
        if (at < -size - 1e-5f * scale)
            return true;
    }
    return false;
}

bool hg_select_faces_away(const struct hg_object_view *o, const struct hg_meshlet *c)
{
    if (!o->has_facing || c->cone_cutoff >= 1.0f)
        return false;
    float to[3], along = 0.0f, distance = 0.0f, radius = 0.0f;
    for (int i = 0; i < 3; i++) {
        to[i] = o->orthographic ? o->forward[i] : c->center[i] - o->eye[i];
        along += to[i] * c->cone_axis[i];
        distance += to[i] * to[i];
        radius += c->extent[i] * c->extent[i];
    }
    distance = sqrtf(distance);
    radius = sqrtf(radius);
    if (o->orthographic)
        return radius * o->px_scale >= LEAST_CONE_PX && along >= c->cone_cutoff * distance;
    return radius * o->px_scale >= LEAST_CONE_PX * distance &&
           along >= c->cone_cutoff * distance + radius;
}

// --- runs ----------------------------------------------------------------------------------------

static enum hg_status add(struct block *b, const struct hg_run *run)
{
    struct hg_selection *s = &b->selection;
    const enum hg_status status = hg_grow(&s->items, &s->capacity, s->count + 1, sizeof *s->items);
    if (status == HG_OK)
        s->items[s->count++] = *run;
    return status;
}

static enum hg_status add_whole(struct block *b, uint32_t index, const struct hg_draw_entry *d)
{
    const struct hg_run run = {.draw = index,
        .chunk = HG_LOD_NONE,
        .count = d->part->primitive_count,
        .bit = HG_RUN_NO_BIT,
        .extent = {-1.0f, -1.0f, -1.0f}};
    return add(b, &run);
}

// Pixels that a metre at the nearest point of a box may show.
static float px_per_metre(const struct hg_culling_view *view, const struct hg_box *box)
{
    float distance2 = 0.0f;
    if (view->orthographic)
        return view->px_scale;
    for (int i = 0; i < 3; i++) {
        const float gap =
            fmaxf(fmaxf(box->min[i] - view->eye[i], view->eye[i] - box->max[i]), 0.0f);
        distance2 += gap * gap;
    }
    return view->px_scale / fmaxf(sqrtf(distance2), view->near);
}

// The coarsest level of a posed part that is fine enough.
static enum hg_status add_posed(const struct run *run, struct block *b, uint32_t index,
    const struct hg_draw_entry *d, const struct hg_mat4x3 *world)
{
    const struct hg_skinned_lod_levels *levels = &d->part->posed;
    const float scale = d->skinned ? 1.0f : hg_matrix_max_stretch(world);
    const float px = scale * px_per_metre(run->view, &d->bounds);
    uint32_t level = levels->count;
    while (level > 0 && !(d->deform->level_errors[level - 1] * px <= run->view->error_px))
        level--;
    if (level == 0)
        return add_whole(b, index, d);
    const struct hg_run r = {.draw = index,
        .chunk = HG_LOD_NONE,
        .first = levels->items[level - 1].first,
        .count = levels->items[level - 1].count,
        .bit = HG_RUN_NO_BIT,
        .extent = {-1.0f, -1.0f, -1.0f}};
    return add(b, &r);
}

// Box of meshlets [first, first + count).
static void box_of(const struct hg_meshlet *first, uint32_t count, struct hg_run *run)
{
    for (int d = 0; d < 3; d++) {
        float low = FLT_MAX, high = -FLT_MAX;
        for (uint32_t i = 0; i < count; i++) {
            low = fminf(low, first[i].center[d] - first[i].extent[d]);
            high = fmaxf(high, first[i].center[d] + first[i].extent[d]);
        }
        run->center[d] = 0.5f * low + 0.5f * high;
        run->extent[d] = 0.5f * high - 0.5f * low + 1e-6f * (fabsf(low) + fabsf(high));
    }
}

// Meshlets that may be seen, in runs that do not cross a group.
static enum hg_status add_meshlets(
    const struct run *run, struct block *b, uint32_t index, const struct hg_object_view *object)
{
    const struct hg_draw_entry *d = &run->geometry->draws[index];
    const struct hg_meshlet_list *list = &d->part->meshlets;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < list->count && status == HG_OK;) {
        const uint32_t group = i / HG_MESHLET_GROUP;
        const uint32_t end = (group + 1) * HG_MESHLET_GROUP;
        uint32_t k = i, count = 0;
        for (; k < list->count && k < end; k++, count++)
            if (hg_select_is_outside(object, &list->items[k]) ||
                hg_select_faces_away(object, &list->items[k]))
                break;
        if (count > 0) {
            const struct hg_meshlet *last = &list->items[k - 1];
            struct hg_run r = {.draw = index,
                .chunk = HG_LOD_NONE,
                .first = list->items[i].first,
                .count = last->first + last->count - list->items[i].first,
                .bit = d->first_bit + group};
            box_of(&list->items[i], count, &r);
            status = add(b, &r);
        }
        i = count > 0 ? k : i + 1;
    }
    return status;
}

static enum hg_status select_draw(
    const struct run *run, struct block *b, uint32_t index, const struct hg_mat4x3 *world)
{
    const struct hg_culling_view *view = run->view;
    const struct hg_draw_entry *d = &run->geometry->draws[index];
    const uint32_t flags = hg_select_flags(run->geometry, view, index);
    const bool both_sides = view->both_sides || (flags & HG_DRAW_DOUBLE_SIDED) != 0;
    struct hg_object_view object;
    if (d->part->index_count == 0 || hg_box_is_empty(&d->bounds) || (flags & HG_DRAW_HIDDEN) != 0 ||
        is_box_outside(view, &d->bounds) || !is_cut(view, &d->bounds))
        return HG_OK;
    if (d->part->clusters != NULL) {
        const uint32_t first = b->selection.count;
        open_object(view, world, both_sides, &object);
        const struct hg_lod_draw draw = {
            index, run->geometry->bits.count, d->part->clusters, world, &object};
        const enum hg_status status = hg_select_lod(view, &draw, &b->selection);
        // Layers are never candidates of the second phase, which draws opaque surfaces.
        for (uint32_t i = first; i < b->selection.count && flags & HG_DRAW_BLEND; i++)
            b->selection.items[i].bit = HG_RUN_NO_BIT;
        return status;
    }
    if (view->shares > 1 && view->share > 0)
        return HG_OK;
    if (d->deform != NULL && d->part->posed.count > 0 && view->error_px > 0.0f)
        return add_posed(run, b, index, d, world);
    if (d->deformed || d->part->meshlets.count < 2 || (flags & HG_DRAW_BLEND) != 0 ||
        view->plane_count == 0)
        return add_whole(b, index, d);
    open_object(view, world, both_sides, &object);
    return add_meshlets(run, b, index, &object);
}

static void select_block(void *user, size_t index)
{
    struct run *run = user;
    struct block *b = &run->blocks[index];
    const struct hg_geometry *g = run->geometry;
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    for (uint32_t i = b->first_draw; i < b->end_draw && b->status == HG_OK; i++)
        b->status = select_draw(run, b, i, &instances[g->draws[i].gpu.instance].world);
}

// Runs of draws of about equal work.
static uint32_t cut_blocks(const struct hg_geometry *g, struct block *blocks)
{
    uint32_t count = 0, weight = 0, first = 0;
    for (uint32_t i = 0; i < g->draw_count; i++) {
        weight += 4 + g->draws[i].part->meshlets.count;
        if (weight < BLOCK_MESHLETS && i + 1 < g->draw_count)
            continue;
        if (blocks != NULL)
            blocks[count] = (struct block){.first_draw = first, .end_draw = i + 1};
        first = i + 1;
        weight = 0;
        count++;
    }
    return count;
}

// Draws are in the order of their classes in the scene: those that the view shows in another class
// go behind those of that class.
static enum hg_status order_classes(
    const struct hg_geometry *g, const struct hg_culling_view *view, struct hg_selection *out)
{
    if (view->shown == NULL || out->count == 0)
        return HG_OK;
    struct hg_run *ordered = hg_calloc(out->count, sizeof *ordered);
    if (ordered == NULL)
        return HG_E_NOMEM;
    uint32_t count = 0;
    for (int class = HG_DRAW_CLASS_OPAQUE; class <= HG_DRAW_CLASS_BLEND; class ++)
        for (uint32_t i = 0; i < out->count; i++)
            if ((int)hg_draw_class_of(hg_select_flags(g, view, out->items[i].draw)) == class)
                ordered[count++] = out->items[i];
    memcpy(out->items, ordered, out->count * sizeof *ordered);
    hg_free(ordered);
    return HG_OK;
}

enum hg_status hg_select(const struct hg_geometry *g, const struct hg_culling_view *view,
    struct hg_jobs *jobs, struct hg_selection *out)
{
    const uint32_t count = cut_blocks(g, NULL);
    if (count == 0)
        return HG_OK;
    struct run run = {.geometry = g, .view = view};
    run.blocks = hg_calloc(count, sizeof *run.blocks);
    if (run.blocks == NULL)
        return HG_E_NOMEM;
    cut_blocks(g, run.blocks);
    if (count == 1 || jobs == NULL) {
        for (uint32_t i = 0; i < count; i++)
            select_block(&run, i);
    } else {
        hg_jobs_for(jobs, count, select_block, &run);
    }
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_selection *from = &run.blocks[i].selection;
        if (status == HG_OK)
            status = run.blocks[i].status;
        if (status == HG_OK)
            status =
                hg_grow(&out->items, &out->capacity, out->count + from->count, sizeof *out->items);
        if (status == HG_OK && from->count > 0) {
            memcpy(out->items + out->count, from->items, from->count * sizeof *from->items);
            out->count += from->count;
        }
        if (status == HG_OK)
            status = hg_grow(&out->wants, &out->want_capacity, out->want_count + from->want_count,
                sizeof *out->wants);
        if (status == HG_OK && from->want_count > 0) {
            memcpy(
                out->wants + out->want_count, from->wants, from->want_count * sizeof *from->wants);
            out->want_count += from->want_count;
        }
        hg_free(from->items);
        hg_free(from->wants);
    }
    hg_free(run.blocks);
    return status == HG_OK ? order_classes(g, view, out) : status;
}
