// viewer_clipping.c - the panel of clipping planes.
#include <stdio.h>
#include <string.h>

#include "client/view/viewer.h"

enum {
    CAPS_ROW = HG_CLIPPING_AXES,
    ROWS,
    LABEL_COLUMNS = 6,
    PLACE_COLUMNS = 13,
    BAR_PX = 4,
    KNOB_PX = 8
};

static void send(struct hg_viewer *v)
{
    struct hg_clipping_list planes;
    hg_clipping_planes(&v->panels.clipping, &planes);
    hg_view_session_clip(v->session, &planes);
    v->dirty = true;
}

static bool has_box(struct hg_viewer *v)
{
    if (!v->panels.clipping.has_box)
        hg_viewer_say(v, "the scene is empty: there is nothing to cut");
    return v->panels.clipping.has_box;
}

// ---- keys --------------------------------------------------------------------------------------

static void change(struct hg_viewer *v, SDL_Scancode key, double step)
{
    struct hg_clipping *c = &v->panels.clipping;
    const int row = (int)v->panels.row;
    if (row == CAPS_ROW)
        hg_clipping_next_caps(c, key == SDL_SCANCODE_LEFT);
    else if (key == SDL_SCANCODE_SPACE)
        c->axes[row].is_on = !c->axes[row].is_on;
    else if (key == SDL_SCANCODE_RETURN)
        c->axes[row].is_flipped = !c->axes[row].is_flipped;
    else
        hg_clipping_set_share(
            c, row, c->axes[row].share + (key == SDL_SCANCODE_RIGHT ? step : -step));
    send(v);
}

bool hg_viewer_clipping_key(struct hg_viewer *v, SDL_Scancode key, bool shift)
{
    struct hg_viewer_panels *p = &v->panels;
    switch (key) {
    case SDL_SCANCODE_UP:
        p->row -= p->row > 0;
        return true;
    case SDL_SCANCODE_DOWN:
        p->row += p->row + 1 < ROWS;
        return true;
    case SDL_SCANCODE_LEFT:
    case SDL_SCANCODE_RIGHT:
    case SDL_SCANCODE_SPACE:
    case SDL_SCANCODE_RETURN:
        if (has_box(v))
            change(v, key, shift ? 0.1 : 0.01);
        return true;
    default:
        return false;
    }
}

// ---- the pointer -------------------------------------------------------------------------------

// Pixels of the slider, from the left.
static void slider(const struct hg_viewer_box *box, int *from, int *width)
{
    *from = box->x + LABEL_COLUMNS * box->advance;
    *width = (box->columns - LABEL_COLUMNS - PLACE_COLUMNS) * box->advance;
}

void hg_viewer_clipping_slide(struct hg_viewer *v, const struct hg_viewer_box *box, int x)
{
    int from, width;
    slider(box, &from, &width);
    if (width <= 0 || v->panels.row >= CAPS_ROW)
        return;
    hg_clipping_set_share(&v->panels.clipping, (int)v->panels.row, (double)(x - from) / width);
    send(v);
}

void hg_viewer_clipping_click(
    struct hg_viewer *v, const struct hg_viewer_box *box, const SDL_Point *at)
{
    int from, width;
    slider(box, &from, &width);
    if (!has_box(v))
        return;
    if (v->panels.row == CAPS_ROW || at->x < from)
        change(v, SDL_SCANCODE_SPACE, 0);
    else if (at->x >= from + width)
        change(v, SDL_SCANCODE_RETURN, 0);
    else {
        v->panels.slides = true;
        hg_viewer_clipping_slide(v, box, at->x);
    }
}

// ---- drawing -----------------------------------------------------------------------------------

// The part that is shown is bright.
static void draw_slider(struct hg_viewer *v, const struct hg_viewer_box *box, int axis, int y)
{
    const struct hg_clipping_axis *cut = &v->panels.clipping.axes[axis];
    int from, width;
    slider(box, &from, &width);
    if (width <= 0)
        return;
    const int at = (int)(cut->share * width), top = y + (box->line - BAR_PX) / 2;
    const SDL_Rect low = {from, top, at, BAR_PX}, high = {from + at, top, width - at, BAR_PX};
    const Uint8 bright = cut->is_on ? 210 : 90, dark = cut->is_on ? 70 : 90;
    const Uint8 below = cut->is_flipped ? dark : bright, above = cut->is_flipped ? bright : dark;
    SDL_SetRenderDrawColor(v->renderer, below, below, below, 255);
    SDL_RenderFillRect(v->renderer, &low);
    SDL_SetRenderDrawColor(v->renderer, above, above, above, 255);
    SDL_RenderFillRect(v->renderer, &high);
    SDL_SetRenderDrawColor(v->renderer, 255, 140, 40, 255);
    SDL_RenderFillRect(
        v->renderer, &(SDL_Rect){from + at - KNOB_PX / 2, y + 2, KNOB_PX, box->line - 4});
}

static void draw_axis(struct hg_viewer *v, const struct hg_viewer_box *box, int axis, int y)
{
    const struct hg_clipping *c = &v->panels.clipping;
    const struct hg_clipping_axis *cut = &c->axes[axis];
    const enum hg_overlay_tone tone = cut->is_on ? HG_OVERLAY_PLAIN : HG_OVERLAY_DIM;
    char text[40], place[32];
    snprintf(text, sizeof text, "[%c] %c", cut->is_on ? 'x' : ' ', "xyz"[axis]);
    hg_overlay_put(&v->overlay, tone, text, box->columns, &(SDL_Point){box->x, y});
    draw_slider(v, box, axis, y);
    hg_measure_text(hg_clipping_position(c, axis), place, sizeof place);
    snprintf(text, sizeof text, " %c %s", cut->is_flipped ? '>' : '<', place);
    hg_overlay_put(&v->overlay, tone, text, PLACE_COLUMNS,
        &(SDL_Point){box->x + (box->columns - PLACE_COLUMNS) * box->advance, y});
}

void hg_viewer_draw_cuts(struct hg_viewer *v, const struct hg_viewer_box *box)
{
    char text[64];
    for (int row = 0; row < ROWS && row < box->rows; row++) {
        const int y = box->y + row * box->line;
        if (row == (int)v->panels.row) {
            SDL_SetRenderDrawColor(v->renderer, 60, 66, 78, 255);
            SDL_RenderFillRect(v->renderer,
                &(SDL_Rect){box->x - 2, y, box->columns * box->advance + 4, box->line});
        }
        if (row < HG_CLIPPING_AXES) {
            draw_axis(v, box, row, y);
            continue;
        }
        snprintf(text, sizeof text, "solids are closed by: %s",
            hg_clipping_caps_name(&v->panels.clipping));
        hg_overlay_put(&v->overlay, HG_OVERLAY_PLAIN, text, box->columns, &(SDL_Point){box->x, y});
    }
}
