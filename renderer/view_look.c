// view_look.c - see view_look.h.
#include "renderer/view_look.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "shaders/shared/pick.h"

// The look of the view, made on first use.
static enum hg_status need_look(struct hg_view *view, const char *what, struct hg_error *err)
{
    if (view->state.settings.look != NULL)
        return HG_OK;
    const enum hg_status status = hg_look_create(&view->look);
    if (status != HG_OK)
        return hg_error_set(err, status, what, NULL, "no memory");
    view->state.settings.look = view->look;
    return HG_OK;
}

static bool is_in_unit(const float *v, int count)
{
    for (int i = 0; i < count; i++)
        if (!(v[i] >= 0.0f && v[i] <= 1.0f))
            return false;
    return true;
}

// --- clipping planes -----------------------------------------------------------------------------

static enum hg_status normalise(
    const struct hg_clip *clip, struct hg_clip *out, struct hg_error *err)
{
    if (clip->count > HG_CLIP_MOST_PLANES)
        return hg_error_set(err, HG_E_LIMIT, "view_clip", "planes", "%u, of at most %u",
            clip->count, HG_CLIP_MOST_PLANES);
    memset(out, 0, sizeof *out); // compared as bytes
    out->count = clip->count;
    for (uint32_t i = 0; i < clip->count; i++) {
        const float *p = clip->planes[i];
        const double length = sqrt((double)p[0] * (double)p[0] + (double)p[1] * (double)p[1] +
                                   (double)p[2] * (double)p[2]);
        if (!(length > 0.0 && length < 1e30) || !isfinite(p[3]))
            return hg_error_set(err, HG_E_INVAL, "view_clip", "planes",
                "plane %u has the normal %g %g %g and the distance %g", i, (double)p[0],
                (double)p[1], (double)p[2], (double)p[3]);
        for (int c = 0; c < 3; c++)
            out->planes[i][c] = (float)((double)p[c] / length);
        out->planes[i][3] = p[3];
    }
    if ((unsigned)clip->caps > HG_CAPS_NONE || !is_in_unit(clip->cap_color, 3) ||
        !(clip->hatch_px >= 1.0f && clip->hatch_px <= 1e4f))
        return hg_error_set(
            err, HG_E_INVAL, "view_clip", "caps", "have a style, a colour in 0..1 and a hatch");
    out->caps = clip->caps;
    memcpy(out->cap_color, clip->cap_color, sizeof out->cap_color);
    out->hatch_px = clip->hatch_px;
    return HG_OK;
}

enum hg_status hg_view_set_clip(
    struct hg_view *view, const struct hg_clip *clip, struct hg_error *err)
{
    struct hg_clip next;
    enum hg_status status = normalise(clip, &next, err);
    if (status == HG_OK && next.count == 0 && view->look == NULL)
        return HG_OK;
    if (status == HG_OK)
        status = need_look(view, "view_clip", err);
    if (status != HG_OK || memcmp(&view->look->clip, &next, sizeof next) == 0)
        return status;
    view->look->clip = next;
    hg_view_state_note_look(&view->state);
    return HG_OK;
}

// --- overrides -----------------------------------------------------------------------------------

static enum hg_status check_override(const struct hg_node_look *o, struct hg_error *err)
{
    const char *where = NULL;
    if ((o->set & HG_LOOK_TINT) != 0 && !is_in_unit(o->tint, 4))
        where = "tint";
    if ((o->set & HG_LOOK_ALPHA) != 0 && !is_in_unit(&o->alpha, 1))
        where = "alpha";
    return where == NULL ? HG_OK
                         : hg_error_set(err, HG_E_INVAL, "view_overrides", where,
                               "of node %llu is outside of 0..1", (unsigned long long)o->node);
}

enum hg_status hg_view_set_overrides(
    struct hg_view *view, const struct hg_view_overrides *o, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < o->count && status == HG_OK; i++)
        status = check_override(&o->items[i], err);
    if (status == HG_OK && o->select_color != NULL && !is_in_unit(o->select_color, 3))
        status =
            hg_error_set(err, HG_E_INVAL, "view_overrides", "select_color", "is outside of 0..1");
    if (status == HG_OK)
        status = need_look(view, "view_overrides", err);
    if (status == HG_OK)
        status = hg_look_set_nodes(view->look, o->items, o->count, o->clear, err);
    if (status != HG_OK)
        return status;
    if (o->select_color != NULL)
        memcpy(view->look->select_color, o->select_color, sizeof view->look->select_color);
    hg_view_state_note_look(&view->state);
    return HG_OK;
}

enum hg_status hg_view_set_variant(
    struct hg_view *view, uint32_t asset, const char *name, struct hg_error *err)
{
    enum hg_status status = need_look(view, "view_variant", err);
    if (status == HG_OK)
        status = hg_look_set_variant(view->look, asset, name, err);
    if (status == HG_OK)
        hg_view_state_note_look(&view->state);
    return status;
}

enum hg_status hg_view_set_layers(struct hg_view *view, uint32_t layers, struct hg_error *err)
{
    if (layers == (view->look != NULL ? view->look->layers : 0))
        return HG_OK;
    const enum hg_status status = need_look(view, "view_set", err);
    if (status != HG_OK)
        return status;
    view->look->layers = layers;
    view->look->revision++;
    hg_view_state_note_look(&view->state);
    return HG_OK;
}

enum hg_status hg_view_write_look(
    const struct hg_view *view, const struct hg_scene *scene, struct hg_writer *w)
{
    return hg_look_write_key(view->look, scene, w);
}

// --- surfaces ------------------------------------------------------------------------------------

struct reading {
    const struct hg_geometry *geometry;
    uint32_t width;
    struct hg_surface_point *points; // [width]
    void (*row)(void *user, uint32_t y, const struct hg_surface_point *points);
    void *user;
    double origin[3];
};

static struct hg_surface_point point_of(const struct reading *r, const struct hg_gpu_pick *hit)
{
    struct hg_surface_point p = {.depth = INFINITY};
    struct hg_draw_info draw;
    if (hit->draw_plus_one == 0 ||
        !hg_geometry_draw_info(r->geometry, hit->draw_plus_one - 1, &draw))
        return p;
    p.node = draw.node->head.id;
    p.material = draw.material != NULL ? draw.material->head.id : 0;
    p.depth = hit->depth;
    memcpy(p.normal, &hit->normal_ws, sizeof p.normal);
    p.position[0] = (float)(hit->position_ws.x + r->origin[0]);
    p.position[1] = (float)(hit->position_ws.y + r->origin[1]);
    p.position[2] = (float)(hit->position_ws.z + r->origin[2]);
    return p;
}

static void read_row(void *user, uint32_t y, const struct hg_gpu_pick *pixels)
{
    const struct reading *r = user;
    for (uint32_t x = 0; x < r->width; x++)
        r->points[x] = point_of(r, &pixels[x]);
    r->row(r->user, y, r->points);
}

// Of rows of r->width; hg_free(r->points).
static enum hg_status begin_reading(
    const struct hg_view *view, struct reading *r, struct hg_error *err)
{
    r->geometry = view->state.scene_gpu->geometry;
    r->points = hg_calloc((size_t)r->width, sizeof *r->points);
    if (r->points == NULL)
        return hg_error_set(err, HG_E_NOMEM, "surfaces", NULL, "no memory");
    hg_geometry_origin(r->geometry, r->origin);
    return HG_OK;
}

enum hg_status hg_view_surfaces(
    struct hg_view *view, const struct hg_surface_rect *rect, struct hg_error *err)
{
    const VkRect2D pixels = {{(int32_t)rect->x, (int32_t)rect->y}, {rect->width, rect->height}};
    struct reading r = {.width = rect->width, .row = rect->row, .user = rect->user};
    enum hg_status status = begin_reading(view, &r, err);
    if (status == HG_OK)
        status = hg_view_state_surfaces(&view->state, pixels, read_row, &r, err);
    hg_free(r.points);
    return status;
}

enum hg_status hg_view_surface_grid(
    struct hg_view *view, const struct hg_surface_grid *grid, struct hg_error *err)
{
    const VkExtent2D cells = {grid->columns, grid->rows};
    struct reading r = {.width = grid->columns, .row = grid->row, .user = grid->user};
    enum hg_status status = begin_reading(view, &r, err);
    if (status == HG_OK)
        status = hg_view_state_grid(&view->state, cells, read_row, &r, err);
    hg_free(r.points);
    return status;
}

uint64_t hg_view_shown_revision(const struct hg_view *view)
{
    return view->state.accumulation.key.scene;
}
