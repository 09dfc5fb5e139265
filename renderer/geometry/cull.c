// cull.c - which draws a camera or a light may see. See geometry.h.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/geometry/internal.h"

// Row r of a column-major matrix, times sign, added to row 3.
static void clip_plane(const float m[16], int row, float sign, bool with_w, float plane[4])
{
    for (int c = 0; c < 4; c++)
        plane[c] = sign * m[c * 4 + row] + (with_w ? m[c * 4 + 3] : 0.0f);
}

// Source: Gribb and Hartmann 2001, "Fast Extraction of Viewing Frustum Planes".
uint32_t hg_cull_planes(const float m[16], float planes[6][4])
{
    clip_plane(m, 2, -1.0f, true, planes[0]); // near: z <= w (reversed depth)
    clip_plane(m, 0, 1.0f, true, planes[1]);
    clip_plane(m, 0, -1.0f, true, planes[2]);
    clip_plane(m, 1, 1.0f, true, planes[3]);
    clip_plane(m, 1, -1.0f, true, planes[4]);
    clip_plane(m, 2, 1.0f, false, planes[5]); // far: z >= 0; no plane at infinity
    uint32_t count = 0;
    for (int i = 0; i < 6; i++) {
        float *p = planes[i];
        const float length = sqrtf(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        if (!(length > 1e-20f))
            continue;
        for (int c = 0; c < 4; c++)
            planes[count][c] = p[c] / length;
        count++;
    }
    return count;
}

// Conservative: a box is outside when it lies wholly behind one plane.
static bool is_outside(const struct hg_cull *cull, const struct hg_box *box)
{
    for (uint32_t i = 0; i < cull->plane_count; i++) {
        const float *p = cull->planes[i];
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

static bool is_too_small(const struct hg_cull *cull, const struct hg_box *box)
{
    if (!(cull->min_px > 0.0f))
        return false;
    float radius2 = 0.0f, distance2 = 0.0f;
    for (int c = 0; c < 3; c++) {
        const float half = 0.5f * (box->max[c] - box->min[c]);
        const float d = 0.5f * (box->max[c] + box->min[c]) - cull->eye[c];
        radius2 += half * half;
        distance2 += d * d;
    }
    const float radius = sqrtf(radius2), distance = sqrtf(distance2) - radius;
    if (cull->orthographic)
        return 2.0f * radius * cull->px_scale < cull->min_px;
    return distance > 0.0f && 2.0f * radius * cull->px_scale < cull->min_px * distance;
}

static enum hg_draw_class class_of(uint32_t flags)
{
    return flags & HG_DRAW_BLEND  ? HG_DRAW_CLASS_BLEND
           : flags & HG_DRAW_MASK ? HG_DRAW_CLASS_MASK
                                  : HG_DRAW_CLASS_OPAQUE;
}

static enum hg_status add_draw(
    struct hg_draw_ranges *out, const struct hg_draw_entry *d, uint32_t index)
{
    struct hg_draw_range *last = out->count > 0 ? &out->items[out->count - 1] : NULL;
    const uint64_t offset = d->part->layout.indices;
    if (last != NULL && last->first_draw + last->draw_count == index &&
        last->flags == d->gpu.flags && last->part == d->gpu.part) {
        last->draw_count++;
    } else {
        const enum hg_status status =
            hg_grow(&out->items, &out->capacity, out->count + 1, sizeof *out->items);
        if (status != HG_OK)
            return status;
        out->items[out->count++] = (struct hg_draw_range){.first_draw = index,
            .draw_count = 1,
            .index_count = d->part->index_count,
            .primitive_count = d->part->primitive_count,
            .flags = d->gpu.flags,
            .part = d->gpu.part,
            .index_buffer = d->part->buffer.handle,
            .index_offset = offset};
    }
    out->draws++;
    if (!(d->gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)))
        out->triangles += d->part->primitive_count;
    return HG_OK;
}

enum hg_status hg_geometry_cull(
    const struct hg_geometry *g, const struct hg_cull *cull, struct hg_draw_ranges *out)
{
    out->count = 0;
    out->draws = out->triangles = 0;
    memset(out->class_first, 0, sizeof out->class_first);
    for (uint32_t i = 0; i < g->draw_count; i++) {
        const struct hg_draw_entry *d = &g->draws[i];
        const enum hg_draw_class class = class_of(d->gpu.flags);
        if (d->part->index_count == 0 || hg_box_is_empty(&d->bounds) ||
            (cull->casters_only && class == HG_DRAW_CLASS_BLEND) || is_outside(cull, &d->bounds) ||
            is_too_small(cull, &d->bounds))
            continue;
        const enum hg_status status = add_draw(out, d, i);
        if (status != HG_OK) {
            out->count = 0;
            memset(out->class_first, 0, sizeof out->class_first);
            return status;
        }
        for (int c = class + 1; c < 4; c++)
            out->class_first[c] = out->count;
    }
    return HG_OK;
}

void hg_draw_ranges_finish(struct hg_draw_ranges *ranges)
{
    hg_free(ranges->items);
    memset(ranges, 0, sizeof *ranges);
}
