// viewer_measure.c - clicks into the picture: measuring between two points, and what is drawn of
// it.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/view/viewer.h"

enum { DOT_PX = 7 };

void hg_viewer_switch_measure(struct hg_viewer *v)
{
    v->panels.measures = !v->panels.measures;
    v->panels.measure.count = 0;
    v->dirty = true;
}

void hg_viewer_click(struct hg_viewer *v, int x, int y, enum hg_view_ask ask)
{
    struct hg_projection_rect rect;
    uint32_t pixel[2];
    const struct hg_view_pixels *p = &v->picture.pixels;
    if (v->status.state != HG_VIEW_OPEN || !hg_viewer_picture_rect(v, &rect) ||
        !hg_projection_pixel(&rect, (int)p->width, (int)p->height, x, y, pixel))
        return;
    const struct hg_view_request request = {
        .ask = ask, .at = {pixel[0], pixel[1], v->picture.facts.number}};
    hg_viewer_ask(v, &request);
}

void hg_viewer_note_point(struct hg_viewer *v, const struct hg_view_answer *answer)
{
    if (!v->panels.measures)
        return; // it has ended meanwhile
    if (answer->hit)
        hg_measure_add(&v->panels.measure, answer->position, answer->normal);
    else
        hg_viewer_say(v, "there is nothing to measure there");
    v->dirty = true;
}

// ---- drawing -----------------------------------------------------------------------------------

// Of the picture that is shown, not the one that was sent last.
static void find_camera(const struct hg_viewer *v, struct hgp_view_camera *camera)
{
    const uint64_t seq = v->picture.facts.input_seq;
    const struct hg_viewer_sent *sent = &v->measured.sent[seq % HG_VIEWER_SENT_MAX];
    if (v->choice.camera < 0 && sent->seq == seq && sent->camera.has_eye &&
        !hg_viewer_is_reprojected(v))
        *camera = sent->camera;
    else
        hg_navigate_camera(&v->navigate, camera);
}

// Two pixels wide with a dark border, so that it is seen on everything.
static void draw_line(struct hg_viewer *v, const double from[2], const double to[2])
{
    static const struct {
        int dx, dy;
        Uint8 red, green, blue;
    } strokes[] = {{-1, 0, 0, 0, 0}, {2, 0, 0, 0, 0}, {0, -1, 0, 0, 0}, {0, 2, 0, 0, 0},
        {0, 0, 255, 235, 60}, {1, 0, 255, 235, 60}, {0, 1, 255, 235, 60}};
    for (size_t i = 0; i < sizeof strokes / sizeof *strokes; i++) {
        const float x = (float)strokes[i].dx, y = (float)strokes[i].dy;
        SDL_SetRenderDrawColor(v->renderer, strokes[i].red, strokes[i].green, strokes[i].blue, 255);
        SDL_RenderDrawLineF(v->renderer, (float)from[0] + x, (float)from[1] + y, (float)to[0] + x,
            (float)to[1] + y);
    }
}

static void draw_dot(struct hg_viewer *v, const double at[3])
{
    const float x = (float)at[0] - DOT_PX / 2.0F, y = (float)at[1] - DOT_PX / 2.0F;
    SDL_SetRenderDrawColor(v->renderer, 0, 0, 0, 255);
    SDL_RenderFillRectF(v->renderer, &(SDL_FRect){x - 1, y - 1, DOT_PX + 2, DOT_PX + 2});
    SDL_SetRenderDrawColor(v->renderer, 255, 235, 60, 255);
    SDL_RenderFillRectF(v->renderer, &(SDL_FRect){x, y, DOT_PX, DOT_PX});
}

static void draw_label(struct hg_viewer *v, const struct hg_projection_view *view)
{
    const struct hg_measure *r = &v->panels.measure;
    double middle[3], at[3];
    char text[40];
    for (int i = 0; i < 3; i++)
        middle[i] = (r->points[0][i] + r->points[1][i]) / 2;
    if (!hg_projection_point(view, middle, at) || fabs(at[0]) > 1e6 || fabs(at[1]) > 1e6)
        return;
    hg_measure_text(hg_measure_distance(r), text, sizeof text);
    const int width = (int)strlen(text) * v->overlay.advance, pad = HG_OVERLAY_PADDING / 2;
    const SDL_Point to = {(int)at[0] - width / 2, (int)at[1] + DOT_PX};
    hg_overlay_box(&v->overlay,
        &(SDL_Rect){to.x - pad, to.y - pad, width + 2 * pad, v->overlay.height + 2 * pad});
    hg_overlay_put(&v->overlay, HG_OVERLAY_PLAIN, text, (int)sizeof text, &to);
}

static void draw_card(struct hg_viewer *v)
{
    struct hg_overlay_text text = {0};
    const struct hg_measure *r = &v->panels.measure;
    char lengths[4][32];
    if (r->count < 2) {
        hg_overlay_add(&text, HG_OVERLAY_PLAIN, "Measure: click %s (Esc ends)",
            r->count ? "the other point" : "two points");
    } else {
        hg_measure_text(hg_measure_distance(r), lengths[3], sizeof lengths[3]);
        for (int i = 0; i < 3; i++)
            hg_measure_text(r->points[1][i] - r->points[0][i], lengths[i], sizeof lengths[i]);
        hg_overlay_add(&text, HG_OVERLAY_PLAIN, "Distance  %s", lengths[3]);
        hg_overlay_add(
            &text, HG_OVERLAY_DIM, "x, y, z   %s, %s, %s", lengths[0], lengths[1], lengths[2]);
        hg_overlay_add(
            &text, HG_OVERLAY_DIM, "Surfaces  %.1f degrees apart", hg_measure_angle_deg(r));
    }
    hg_overlay_draw(&v->overlay, &text, HG_OVERLAY_BOTTOM_LEFT, v->width, v->height);
}

void hg_viewer_draw_measure(struct hg_viewer *v)
{
    const struct hg_measure *r = &v->panels.measure;
    struct hgp_view_camera camera = {0};
    struct hg_projection_rect rect;
    struct hg_projection_view view;
    double from[2], to[2], at[3];
    if (!v->panels.measures || !hg_viewer_picture_rect(v, &rect))
        return;
    find_camera(v, &camera);
    if (!hg_projection_look(&view, &camera, &rect))
        return;
    if (r->count == 2 && hg_projection_segment(&view, r->points[0], r->points[1], from, to))
        draw_line(v, from, to);
    for (uint32_t i = 0; i < r->count; i++)
        if (hg_projection_point(&view, r->points[i], at))
            draw_dot(v, at);
    if (r->count == 2)
        draw_label(v, &view);
    draw_card(v);
}
