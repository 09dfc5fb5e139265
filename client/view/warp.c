// warp.c - see warp.h.
#include "client/view/warp.h"

#include <libdeflate.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/vec3d.h"

enum { HEAD_BYTES = 12, STEPS = 4094, ORDER = 1024 };
static const double ring = 3;      // how far it reaches, of half the picture
static const double least_w = 0.2; // nearer to the plane of the eye nothing is drawn
static const double most_px = 32768, most_nearness = 1e30;

// ---- depth of frames ---------------------------------------------------------------------------

static enum hg_status damaged(struct hg_error *err, const char *why)
{
    return hg_error_set(err, HG_E_FORMAT, "depth", NULL, "%s", why);
}

// Cells of the low bytes, then of the high ones: how far each is off what its neighbours predict.
static void unfold(
    struct hg_warp_depth *d, const uint8_t *planes, uint16_t *q, const float range[2])
{
    const size_t cells = (size_t)d->columns * d->rows, width = d->columns;
    const float nothing = d->camera.kind == HGP_camera_kind_ORTHOGRAPHIC ? range[1] : 0;
    for (size_t i = 0; i < cells; i++) {
        const bool has_left = i % width > 0, has_above = i >= width;
        const int left = has_left ? q[i - 1] : 0, above = has_above ? q[i - width] : 0;
        const int between = has_left && has_above ? q[i - width - 1] : 0;
        const int folded = planes[i] | planes[cells + i] << 8;
        q[i] = (uint16_t)(left + above - between + (folded >> 1 ^ -(folded & 1)));
        const float share = ((float)q[i] - 1) / STEPS;
        d->values[i] = q[i] ? range[0] + share * (range[1] - range[0]) : nothing;
    }
}

static enum hg_status inflate_cells(struct hg_warp_depth *d, const struct hgp_frame *frame,
    const float range[2], struct hg_error *err)
{
    const size_t cells = (size_t)d->columns * d->rows;
    uint8_t *scratch = hg_calloc(cells, 4); // planes, then cells
    struct libdeflate_decompressor *inflate = libdeflate_alloc_decompressor();
    enum hg_status status =
        scratch && inflate ? HG_OK : hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory");
    if (!status && libdeflate_zlib_decompress(inflate, frame->depth.data + HEAD_BYTES,
                       frame->depth.size - HEAD_BYTES, scratch, 2 * cells, NULL))
        status = damaged(err, "it does not unpack to as many cells as it says");
    if (!status)
        unfold(d, scratch, (uint16_t *)(void *)(scratch + 2 * cells), range);
    if (inflate)
        libdeflate_free_decompressor(inflate);
    hg_free(scratch);
    return status;
}

static enum hg_status read_depth(
    struct hg_warp_depth *d, const struct hgp_frame *frame, struct hg_error *err)
{
    struct hg_reader r = hg_reader_make(frame->depth.data, frame->depth.size);
    d->columns = hg_read_u16(&r);
    d->rows = hg_read_u16(&r);
    float range[2];
    for (int i = 0; i < 2; i++)
        range[i] = hg_read_f32(&r);
    if (frame->depth.size < HEAD_BYTES || d->columns == 0 || d->rows == 0 ||
        d->columns > frame->width || d->rows > frame->height || !isfinite(range[0]) ||
        !isfinite(range[1]))
        return damaged(err, "its head is wrong");
    const size_t cells = (size_t)d->columns * d->rows;
    if (hg_grow(&d->values, &d->capacity, cells, sizeof *d->values))
        return hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory for %zu cells", cells);
    return inflate_cells(d, frame, range, err);
}

static struct hgp_view_camera camera_of(const struct hgp_frame *f)
{
    struct hgp_view_camera c = {.has_eye = true,
        .has_target = true,
        .has_up = true,
        .has_kind = true,
        .kind = f->has_kind ? f->kind : HGP_camera_kind_PERSPECTIVE,
        .has_vfov_rad = f->has_vfov_rad,
        .vfov_rad = f->vfov_rad,
        .has_half_height = f->has_half_height,
        .half_height = f->half_height};
    for (int i = 0; i < 3; i++) {
        c.eye[i] = f->eye[i];
        c.target[i] = f->eye[i] + f->forward[i];
        c.up[i] = f->up[i];
    }
    return c;
}

enum hg_status hg_warp_take(
    struct hg_warp_depth *d, const struct hgp_frame *frame, struct hg_error *err)
{
    const bool same = d->input_seq == frame->input_seq && d->revision == frame->scene_revision;
    if (!frame->has_depth) {
        d->is_known &= same;
        return HG_OK;
    }
    d->is_known = false;
    if (!frame->has_eye || !frame->has_forward || !frame->has_up)
        return damaged(err, "it comes without a camera");
    d->input_seq = frame->input_seq;
    d->revision = frame->scene_revision;
    d->camera = camera_of(frame);
    const enum hg_status status = read_depth(d, frame, err);
    d->is_known = !status;
    return status;
}

enum hg_status hg_warp_copy(
    const struct hg_warp_depth *from, struct hg_warp_depth *to, struct hg_error *err)
{
    const size_t cells = (size_t)from->columns * from->rows;
    to->is_known = false;
    if (!from->is_known)
        return HG_OK;
    if (hg_grow(&to->values, &to->capacity, cells, sizeof *to->values))
        return hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory for %zu cells", cells);
    float *const values = to->values;
    const size_t capacity = to->capacity;
    memcpy(values, from->values, cells * sizeof *values);
    *to = *from;
    to->values = values;
    to->capacity = capacity;
    return HG_OK;
}

void hg_warp_depth_finish(struct hg_warp_depth *d)
{
    hg_free(d->values);
    *d = (struct hg_warp_depth){0};
}

// ---- the mesh ----------------------------------------------------------------------------------

struct hg_warp_quad {
    struct hg_warp_vertex corners[4];
    float nearness;
};

struct warp {
    const struct hg_warp_depth *depth;
    struct hg_projection_rect rect;
    bool flat;
    double most;    // the greatest amount of d
    double m[4][3]; // of x, y, 1, d: to clip space, and along the view
};

static bool begin(struct warp *w, const struct hgp_view_camera *camera)
{
    struct hg_projection_view a, b;
    if (!hg_projection_look(&a, &w->depth->camera, &w->rect) ||
        !hg_projection_look(&b, camera, &w->rect) || (a.tangent > 0) != (b.tangent > 0))
        return false;
    const double aspect = (double)w->rect.width / w->rect.height;
    const double half = a.tangent > 0 ? a.tangent : a.half_height;
    const double new_half = b.tangent > 0 ? b.tangent : b.half_height;
    double columns[4][3];
    w->flat = !(a.tangent > 0);
    for (int i = 0; i < 3; i++) {
        const double shift = a.eye[i] - b.eye[i];
        columns[0][i] = a.right[i] * half * aspect;
        columns[1][i] = a.up[i] * half;
        columns[2][i] = w->flat ? shift : a.forward[i];
        columns[3][i] = w->flat ? a.forward[i] : shift;
    }
    for (int c = 0; c < 4; c++) {
        w->m[c][0] = hg_dot3d(columns[c], b.right) / (new_half * aspect);
        w->m[c][1] = hg_dot3d(columns[c], b.up) / new_half;
        w->m[c][2] = hg_dot3d(columns[c], b.forward);
    }
    return true;
}

struct point {
    struct hg_warp_vertex vertex; // u, v beyond 0..1 in the ring
    float d, nearness;            // 1 / depth with perspective, -depth without
    bool is_seen;
};

// Vertex (x, y) of the mesh, which begins at -1.
static struct point point_at(const struct warp *w, int x, int y)
{
    const int columns = (int)w->depth->columns, rows = (int)w->depth->rows;
    const int cx = x < 0         ? 0
                   : x < columns ? x
                                 : columns - 1,
              cy = y < 0      ? 0
                   : y < rows ? y
                              : rows - 1;
    const double d = (double)w->depth->values[(size_t)cy * w->depth->columns + (size_t)cx];
    const double px = x < 0 ? -ring : x == columns ? ring : (2.0 * x + 1) / columns - 1;
    const double py = y < 0 ? ring : y == rows ? -ring : 1 - (2.0 * y + 1) / rows;
    double at[3];
    for (int i = 0; i < 3; i++)
        at[i] = w->m[0][i] * px + w->m[1][i] * py + w->m[2][i] + w->m[3][i] * d;
    const double over = w->flat ? 1 : at[2];
    struct point p = {.d = (float)d, .is_seen = over > least_w};
    if (!p.is_seen)
        return p;
    p.nearness = (float)(w->flat ? -at[2] : d / at[2]);
    p.vertex =
        (struct hg_warp_vertex){(float)(w->rect.x + (0.5 + 0.5 * at[0] / over) * w->rect.width),
            (float)(w->rect.y + (0.5 - 0.5 * at[1] / over) * w->rect.height),
            (float)(0.5 + 0.5 * px), (float)(0.5 - 0.5 * py)};
    p.is_seen = fabs((double)p.nearness) < most_nearness && fabs((double)p.vertex.x) < most_px &&
                fabs((double)p.vertex.y) < most_px; // what comes from the server may be anything
    return p;
}

static float clamp(float v)
{
    return v < 0 ? 0 : v > 1 ? 1 : v;
}

static float smooth(float v)
{
    v = clamp((v - 2) / 3); // of cells
    return v * v * (3 - 2 * v);
}

// How far a quad in which the depth jumps has opened into a gap: that is filled with what is
// behind.
static float gap_of(const struct warp *w, const struct point p[4], const struct point **behind)
{
    float low = p[0].d, high = p[0].d;
    float least[2] = {INFINITY, INFINITY}, most[2] = {-INFINITY, -INFINITY};
    *behind = &p[0];
    for (int i = 0; i < 4; i++) {
        least[0] = fminf(least[0], p[i].vertex.x);
        least[1] = fminf(least[1], p[i].vertex.y);
        most[0] = fmaxf(most[0], p[i].vertex.x);
        most[1] = fmaxf(most[1], p[i].vertex.y);
        if (w->flat ? p[i].d > high : p[i].d < low)
            *behind = &p[i];
        low = fminf(low, p[i].d);
        high = fmaxf(high, p[i].d);
    }
    if (!(w->flat ? high - low > 0.02f * (float)w->most : high > 1.5f * low))
        return 0;
    const float across = (most[0] - least[0]) * (float)w->depth->columns / (float)w->rect.width,
                down = (most[1] - least[1]) * (float)w->depth->rows / (float)w->rect.height;
    return smooth(fmaxf(across, down));
}

static void add_quad(const struct warp *w, struct hg_warp_mesh *mesh, int x, int y)
{
    const struct point p[4] = {
        point_at(w, x, y), point_at(w, x + 1, y), point_at(w, x, y + 1), point_at(w, x + 1, y + 1)};
    const bool inside =
        x >= 0 && y >= 0 && x + 1 < (int)w->depth->columns && y + 1 < (int)w->depth->rows;
    const struct point *behind = p;
    for (int i = 0; i < 4; i++)
        if (!p[i].is_seen)
            return;
    const float gap = inside ? gap_of(w, p, &behind) : 0;
    struct hg_warp_quad *quad = &mesh->quads[mesh->quad_count++];
    float mean = 0;
    for (int i = 0; i < 4; i++) {
        quad->corners[i] = p[i].vertex;
        quad->corners[i].u = clamp(p[i].vertex.u + gap * (behind->vertex.u - p[i].vertex.u));
        quad->corners[i].v = clamp(p[i].vertex.v + gap * (behind->vertex.v - p[i].vertex.v));
        mean += p[i].nearness / 4;
    }
    quad->nearness = mean + gap * (behind->nearness - mean);
}

// What is farther first, to within a part in ORDER of the range.
static void sort(struct hg_warp_mesh *mesh)
{
    uint32_t first[ORDER + 1] = {0};
    float low = INFINITY, high = -INFINITY;
    for (uint32_t i = 0; i < mesh->quad_count; i++) {
        low = fminf(low, mesh->quads[i].nearness);
        high = fmaxf(high, mesh->quads[i].nearness);
    }
    const float per = high > low ? (ORDER - 1) / (high - low) : 0;
    for (uint32_t i = 0; i < mesh->quad_count; i++)
        first[(uint32_t)((mesh->quads[i].nearness - low) * per) + 1]++;
    for (uint32_t i = 0; i < ORDER; i++)
        first[i + 1] += first[i];
    for (uint32_t i = 0; i < mesh->quad_count; i++) {
        static const int corners[6] = {0, 1, 2, 2, 1, 3};
        const uint32_t at = first[(uint32_t)((mesh->quads[i].nearness - low) * per)]++;
        memcpy(
            mesh->vertices + (size_t)4 * at, mesh->quads[i].corners, sizeof mesh->quads[i].corners);
        for (uint32_t k = 0; k < 6; k++)
            mesh->indices[(size_t)6 * at + k] = (int)(4 * at) + corners[k];
    }
}

bool hg_warp_build(struct hg_warp_mesh *mesh, const struct hg_warp_depth *depth,
    const struct hgp_view_camera *camera, const struct hg_projection_rect *rect)
{
    struct warp w = {.depth = depth, .rect = *rect};
    const size_t quads = ((size_t)depth->columns + 1) * (depth->rows + 1);
    mesh->quad_count = 0;
    if (!depth->is_known || rect->width < 1 || rect->height < 1 || !begin(&w, camera) ||
        hg_grow(&mesh->quads, &mesh->quad_capacity, quads, sizeof *mesh->quads) ||
        hg_grow(&mesh->vertices, &mesh->vertex_capacity, 4 * quads, sizeof *mesh->vertices) ||
        hg_grow(&mesh->indices, &mesh->index_capacity, 6 * quads, sizeof *mesh->indices))
        return false;
    for (size_t i = 0; i < (size_t)depth->columns * depth->rows; i++)
        w.most = fmax(w.most, fabs((double)depth->values[i]));
    for (int y = -1; y < (int)depth->rows; y++)
        for (int x = -1; x < (int)depth->columns; x++)
            add_quad(&w, mesh, x, y);
    sort(mesh);
    return true;
}

void hg_warp_mesh_finish(struct hg_warp_mesh *mesh)
{
    hg_free(mesh->vertices);
    hg_free(mesh->indices);
    hg_free(mesh->quads);
    *mesh = (struct hg_warp_mesh){0};
}
