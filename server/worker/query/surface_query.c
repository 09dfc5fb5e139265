#include "server/worker/query/surface_query.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/view_look.h"
#include "server/worker/view/view_schedule.h"

enum { MOST_PIXELS = 4194304, MOST_NODES = 65536 };

// The state that a frame showed has to be the view's still: pixels are looked at again.
static enum hg_status check_frame(const struct view_slot *view, const char *what, bool has_frame,
    uint64_t frame, struct hg_error *err)
{
    const struct view_progress *p = &view->progress;
    if (!has_frame || (frame >= p->first_number && frame <= p->info.number))
        return HG_OK;
    return hg_error_set(err, HG_E_STATE, what, "frame",
        "%llu shows another state than the view does by now (frames %llu to %llu)",
        (unsigned long long)frame, (unsigned long long)p->first_number,
        (unsigned long long)p->info.number);
}

// The view as it is now, if that is what `frame` showed. NULL after failing.
static struct view_slot *view_at(
    const struct request *r, uint32_t number, const char *what, const uint64_t *frame)
{
    struct view_slot *view = hg_request_view(r, number);
    struct hg_error err = {0};
    if (!view)
        return NULL;
    enum hg_status status = hg_schedule_refresh(r->session, view, &err);
    if (!status)
        status = check_frame(view, what, frame != NULL, frame ? *frame : 0, &err);
    if (status)
        hg_reply_error(r->to, &err);
    return status ? NULL : view;
}

static void size_of(const struct view_slot *view, uint32_t *width, uint32_t *height)
{
    const struct hg_view_params p = hg_view_params_filled(&view->settings.params);
    *width = p.width;
    *height = p.height;
}

static enum hg_status check_rect(
    const struct view_slot *view, const char *what, const uint32_t rect[4], struct hg_error *err)
{
    uint32_t width, height;
    size_of(view, &width, &height);
    if (rect[0] < width && rect[2] <= width - rect[0] && rect[1] < height &&
        rect[3] <= height - rect[1])
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, what, "x",
        "%ux%u px at %u,%u are not inside of the picture of %ux%u px", rect[2], rect[3], rect[0],
        rect[1], width, height);
}

// ---- nodes in rectangles ------------------------------------------------------------------------

struct counted {
    uint64_t node;
    uint32_t inside, outside;
    bool cut; // at the border of the picture
};

struct counting {
    const struct hgp_pixel_rect *rects;
    uint32_t rect_count;
    uint32_t x, y, width, height; // y: of the first row that is read; of the picture
    uint8_t *covered;             // [width] of the row
    struct counted *nodes;        // hashed by id, at most half full
    size_t places;
    uint32_t count;
    bool failed;
};

static struct counted *place_of(struct counted *nodes, size_t places, uint64_t node)
{
    size_t at = (size_t)((node * UINT64_C(0x9e3779b97f4a7c15)) >> 20) & (places - 1);
    while (nodes[at].node != 0 && nodes[at].node != node)
        at = (at + 1) & (places - 1);
    return &nodes[at];
}

static bool make_room(struct counting *c)
{
    if (c->count < c->places / 2)
        return true;
    const size_t places = c->places ? c->places * 2 : 256;
    struct counted *grown = hg_calloc(places, sizeof *grown);
    if (!grown)
        return false;
    for (size_t i = 0; i < c->places; i++)
        if (c->nodes[i].node != 0)
            *place_of(grown, places, c->nodes[i].node) = c->nodes[i];
    hg_free(c->nodes);
    c->nodes = grown;
    c->places = places;
    return true;
}

static void cover_row(struct counting *c, uint32_t y)
{
    memset(c->covered, 0, c->width);
    for (uint32_t i = 0; i < c->rect_count; i++) {
        const struct hgp_pixel_rect *rect = &c->rects[i];
        if (y >= rect->y && y - rect->y < rect->height)
            memset(c->covered + rect->x, 1, rect->width);
    }
}

static void count_row(void *user, uint32_t row, const struct hg_surface_point *points)
{
    struct counting *c = user;
    const uint32_t y = c->y + row;
    cover_row(c, y);
    for (uint32_t x = 0; x < c->width && !c->failed; x++) {
        if (points[x].node == 0)
            continue;
        c->failed = !make_room(c);
        if (c->failed)
            return;
        struct counted *n = place_of(c->nodes, c->places, points[x].node);
        c->count += n->node == 0;
        n->node = points[x].node;
        n->inside += c->covered[x];
        n->outside += !c->covered[x];
        n->cut |= x == 0 || y == 0 || x + 1 == c->width || y + 1 == c->height;
    }
}

static int compare_seen(const void *a, const void *b)
{
    const struct hgp_seen_node *x = a, *y = b;
    if (x->pixels != y->pixels)
        return x->pixels > y->pixels ? -1 : 1;
    return x->node < y->node ? -1 : x->node > y->node;
}

// Those that are asked for, the largest first. Returns how many.
static uint32_t choose(const struct counting *c, bool inside, struct hgp_seen_node *out)
{
    uint32_t count = 0;
    for (size_t i = 0; i < c->places; i++) {
        const struct counted *n = &c->nodes[i];
        if (n->inside > 0 && (!inside || (n->outside == 0 && !n->cut)))
            out[count++] = (struct hgp_seen_node){n->node, n->inside, n->outside};
    }
    qsort(out, count, sizeof *out, compare_seen);
    return count;
}

static enum hg_status count_nodes(struct view_slot *view, const struct hgp_box_select *m,
    struct counting *c, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < m->rects.count && !status; i++) {
        const struct hgp_pixel_rect *rect = &m->rects.items[i];
        status = check_rect(
            view, "box_select", (uint32_t[]){rect->x, rect->y, rect->width, rect->height}, err);
    }
    if (status)
        return status;
    size_of(view, &c->width, &c->height);
    c->rects = m->rects.items;
    c->rect_count = m->rects.count;
    c->covered = hg_calloc(c->width, 1);
    if (!c->covered)
        return hg_error_set(err, HG_E_NOMEM, "box_select", NULL, "no memory");
    const struct hg_surface_rect all = {
        .width = c->width, .height = c->height, .row = count_row, .user = c};
    status = hg_view_surfaces(view->view, &all, err);
    return !status && c->failed
               ? hg_error_set(err, HG_E_NOMEM, "box_select", NULL, "no memory for the nodes")
               : status;
}

void hg_handle_box_select(const struct request *r)
{
    const struct hgp_box_select *m = &r->message->box_select;
    struct view_slot *view = view_at(r, m->view, "box_select", m->has_frame ? &m->frame : NULL);
    if (!view)
        return;
    struct counting c = {0};
    struct hg_error err = {0};
    enum hg_status status = count_nodes(view, m, &c, &err);
    struct hgp_seen_node *seen = status ? NULL : hg_calloc((size_t)c.count + 1, sizeof *seen);
    if (!status && !seen)
        status = hg_error_set(&err, HG_E_NOMEM, "box_select", NULL, "no memory for the nodes");
    if (status) {
        hg_reply_error(r->to, &err);
    } else {
        struct hgp_box_selected answer = {.revision = hg_view_shown_revision(view->view),
            .frame = view->progress.info.number,
            .total = choose(&c, m->has_inside && m->inside, seen)};
        answer.nodes.items = seen;
        answer.nodes.count = answer.total < MOST_NODES ? answer.total : MOST_NODES;
        hg_reply_send(r->to, HGP_T_box_selected, &answer);
    }
    hg_free(seen);
    hg_free(c.covered);
    hg_free(c.nodes);
}

// ---- surfaces of a rectangle --------------------------------------------------------------------

// Bytes of a pixel in each array, by its bit.
static const uint32_t array_bytes[] = {4, 12, 12, 8, 8};
enum { ARRAYS = 5 };

struct filling {
    uint32_t width, what;
    uint8_t *arrays[ARRAYS]; // NULL: not asked for
};

static void put_u64(uint8_t *to, uint64_t value)
{
    for (int i = 0; i < 8; i++)
        to[i] = (uint8_t)(value >> (8 * i));
}

static void put_floats(uint8_t *to, const float *values, int count)
{
    for (int i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        for (int k = 0; k < 4; k++)
            to[4 * i + k] = (uint8_t)(bits >> (8 * k));
    }
}

static void fill_row(void *user, uint32_t y, const struct hg_surface_point *points)
{
    const struct filling *f = user;
    for (uint32_t x = 0; x < f->width; x++) {
        const size_t at = (size_t)y * f->width + x;
        if (f->arrays[0])
            put_floats(f->arrays[0] + at * 4, &points[x].depth, 1);
        if (f->arrays[1])
            put_floats(f->arrays[1] + at * 12, points[x].normal, 3);
        if (f->arrays[2])
            put_floats(f->arrays[2] + at * 12, points[x].position, 3);
        if (f->arrays[3])
            put_u64(f->arrays[3] + at * 8, points[x].node);
        if (f->arrays[4])
            put_u64(f->arrays[4] + at * 8, points[x].material);
    }
}

static enum hg_status check_surfaces(
    const struct view_slot *view, const struct hgp_surface_query *m, struct hg_error *err)
{
    const uint64_t pixels = (uint64_t)m->width * m->height;
    if (pixels > MOST_PIXELS)
        return hg_error_set(err, HG_E_LIMIT, "surface_query", "width",
            "%llu pixels, of at most %d at once", (unsigned long long)pixels, MOST_PIXELS);
    return check_rect(view, "surface_query", (uint32_t[]){m->x, m->y, m->width, m->height}, err);
}

void hg_handle_surface_query(const struct request *r)
{
    const struct hgp_surface_query *m = &r->message->surface_query;
    struct view_slot *view = view_at(r, m->view, "surface_query", m->has_frame ? &m->frame : NULL);
    if (!view)
        return;
    struct hg_error err = {0};
    enum hg_status status = check_surfaces(view, m, &err);
    const size_t pixels = (size_t)m->width * m->height;
    size_t bytes = 0;
    for (int i = 0; i < ARRAYS; i++)
        bytes += m->what >> i & 1 ? pixels * array_bytes[i] : 0;
    uint8_t *data = status ? NULL : hg_calloc(bytes, 1);
    if (!status && !data)
        status = hg_error_set(&err, HG_E_NOMEM, "surface_query", NULL, "no memory");
    struct filling f = {.width = m->width, .what = m->what};
    uint8_t *next = data;
    for (int i = 0; i < ARRAYS && !status; i++) {
        f.arrays[i] = m->what >> i & 1 ? next : NULL;
        next += f.arrays[i] ? pixels * array_bytes[i] : 0;
    }
    const struct hg_surface_rect rect = {m->x, m->y, m->width, m->height, fill_row, &f};
    if (!status)
        status = hg_view_surfaces(view->view, &rect, &err);
    if (status)
        hg_reply_error(r->to, &err);
    else
        hg_reply_send(r->to, HGP_T_surfaces,
            &(struct hgp_surfaces){.revision = hg_view_shown_revision(view->view),
                .frame = view->progress.info.number,
                .width = m->width,
                .height = m->height,
                .what = m->what,
                .data = {data, (uint32_t)bytes}});
    hg_free(data);
}

// ---- measuring ----------------------------------------------------------------------------------

static void measure(const struct hg_pick p[2], struct hgp_measured *out)
{
    double between = 0, along = 0, cosine = 0, lengths[2] = {0};
    for (int i = 0; i < 3; i++) {
        const double d = (double)p[1].position[i] - (double)p[0].position[i];
        between += d * d;
        along += d * (double)p[0].normal[i];
        cosine += (double)p[0].normal[i] * (double)p[1].normal[i];
        for (int k = 0; k < 2; k++)
            lengths[k] += (double)p[k].normal[i] * (double)p[k].normal[i];
    }
    cosine /= fmax(sqrt(lengths[0] * lengths[1]), 1e-30);
    out->hit = true;
    out->node0 = p[0].node;
    out->node1 = p[1].node;
    memcpy(out->position0, p[0].position, sizeof out->position0);
    memcpy(out->position1, p[1].position, sizeof out->position1);
    memcpy(out->normal0, p[0].normal, sizeof out->normal0);
    memcpy(out->normal1, p[1].normal, sizeof out->normal1);
    out->distance = (float)fmin(sqrt(between), 1e30);
    out->along_normal = (float)fmin(fabs(along) / fmax(sqrt(lengths[0]), 1e-30), 1e30);
    out->angle_rad = (float)acos(fmax(fmin(cosine, 1), -1));
}

void hg_handle_measure(const struct request *r)
{
    const struct hgp_measure *m = &r->message->measure;
    struct view_slot *view = view_at(r, m->view, "measure", m->has_frame ? &m->frame : NULL);
    if (!view)
        return;
    struct hg_error err = {0};
    struct hg_pick picks[2];
    enum hg_status status = hg_view_pick(view->view, m->x0, m->y0, &picks[0], &err);
    if (!status)
        status = hg_view_pick(view->view, m->x1, m->y1, &picks[1], &err);
    if (status) {
        hg_reply_error(r->to, &err);
        return;
    }
    struct hgp_measured answer = {
        .revision = picks[0].revision, .frame = view->progress.info.number};
    if (picks[0].hit && picks[1].hit)
        measure(picks, &answer);
    hg_reply_send(r->to, HGP_T_measured, &answer);
}
