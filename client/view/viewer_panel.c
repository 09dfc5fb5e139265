// viewer_panel.c - the panel at the right side of the window: which one is open, its place, keys
// and pointer. Its rows are in viewer_tree.c and viewer_clipping.c.
#include <stdio.h>
#include <string.h>

#include "client/view/viewer.h"

enum { COLUMNS = 40, TITLE_ROWS = 1, CUT_ROWS = 4, LINE_PX = 18, ADVANCE_PX = 9 };

// Text is what the nodes are filtered by, from the key that begins it to Enter or Esc.
static void set_search(struct hg_viewer *v, bool on)
{
    v->panels.searches = on;
    if (on) {
        hg_controls_release(&v->controls);
        SDL_StartTextInput();
    } else {
        SDL_StopTextInput();
    }
}

void hg_viewer_switch_panel(struct hg_viewer *v, enum hg_viewer_panel panel)
{
    v->panels.open = v->panels.open == panel ? HG_VIEWER_NO_PANEL : panel;
    v->panels.slides = false;
    set_search(v, false);
    v->help = false;
    hg_controls_release(&v->controls); // arrows that are held were the camera's
    hg_viewer_refresh_tree(v);
}

void hg_viewer_reset_panels(struct hg_viewer *v)
{
    struct hg_viewer_panels *p = &v->panels;
    struct hg_tree old;
    if (hg_view_session_nodes(v->session, &old)) // of the scene before
        hg_tree_finish(&old);
    v->taken.lists = v->status.lists;
    v->taken.answers = v->status.answers;
    hg_tree_finish(&p->tree);
    p->listed_ns = 0;
    p->measure.count = 0;
    p->slides = p->says_selected = false;
    set_search(v, false);
    hg_clipping_reset(&p->clipping, v->scene->has_box, v->scene->min, v->scene->max);
}

void hg_viewer_panel_box(const struct hg_viewer *v, struct hg_viewer_box *box)
{
    const int margin = HG_OVERLAY_MARGIN, padding = HG_OVERLAY_PADDING;
    const bool font = v->overlay.advance > 0;
    *box = (struct hg_viewer_box){.advance = font ? v->overlay.advance : ADVANCE_PX,
        .line = font ? v->overlay.height : LINE_PX};
    const int columns = (v->width - 2 * (margin + padding)) / box->advance;
    const int rows = (v->height - 2 * (margin + padding)) / box->line - TITLE_ROWS;
    box->columns = columns < COLUMNS ? columns : COLUMNS;
    box->rows = v->panels.open == HG_VIEWER_CLIPPING && rows > CUT_ROWS ? CUT_ROWS : rows;
    if (box->columns < 1 || box->rows < 1)
        box->columns = box->rows = 0;
    box->all.w = box->columns * box->advance + 2 * padding;
    box->all.h = (box->rows + TITLE_ROWS) * box->line + 2 * padding;
    box->all.x = v->width - box->all.w - margin;
    box->all.y = margin;
    box->x = box->all.x + padding;
    box->y = box->all.y + padding + TITLE_ROWS * box->line;
}

// ---- searching ---------------------------------------------------------------------------------

void hg_viewer_type(struct hg_viewer *v, const char *text)
{
    char filter[HG_TREE_FILTER_BYTES];
    struct hg_tree *tree = &v->panels.tree;
    const size_t had = strlen(tree->filter), more = strlen(text);
    if (!v->panels.searches || had + more >= sizeof filter)
        return;
    memcpy(filter, tree->filter, had);
    memcpy(filter + had, text, more + 1);
    hg_tree_set_filter(tree, filter);
    v->dirty = true;
}

// The last character, all of its bytes.
static void take_back(struct hg_tree *tree)
{
    char filter[HG_TREE_FILTER_BYTES];
    size_t size = strlen(tree->filter);
    while (size > 0 && (tree->filter[size - 1] & 0xc0) == 0x80)
        size--;
    memcpy(filter, tree->filter, sizeof filter);
    filter[size > 0 ? size - 1 : 0] = 0;
    hg_tree_set_filter(tree, filter);
}

// Keys while text is typed: none of them is the camera's. Those that move the selection do that.
static bool search_key(struct hg_viewer *v, SDL_Scancode key, const struct hg_viewer_box *box)
{
    struct hg_tree *tree = &v->panels.tree;
    if (key == SDL_SCANCODE_BACKSPACE)
        take_back(tree);
    else if (key == SDL_SCANCODE_ESCAPE)
        hg_tree_set_filter(tree, "");
    else if (key != SDL_SCANCODE_SPACE && key != SDL_SCANCODE_RETURN && key != SDL_SCANCODE_TAB)
        (void)hg_viewer_tree_key(v, key, box);
    if (key == SDL_SCANCODE_ESCAPE || key == SDL_SCANCODE_RETURN)
        set_search(v, false);
    return true;
}

static bool tree_key(struct hg_viewer *v, SDL_Scancode key, const struct hg_viewer_box *box)
{
    if (v->panels.searches)
        return search_key(v, key, box);
    if (key != SDL_SCANCODE_SLASH)
        return hg_viewer_tree_key(v, key, box);
    set_search(v, true);
    return true;
}

// ---- keys --------------------------------------------------------------------------------------

bool hg_viewer_panel_key(struct hg_viewer *v, SDL_Scancode key, bool shift)
{
    struct hg_viewer_box box;
    if (v->status.state != HG_VIEW_OPEN || v->help)
        return false;
    hg_viewer_panel_box(v, &box);
    const bool taken = v->panels.open == HG_VIEWER_TREE ? tree_key(v, key, &box)
                       : v->panels.open == HG_VIEWER_CLIPPING
                           ? hg_viewer_clipping_key(v, key, shift)
                           : false;
    v->dirty |= taken;
    return taken;
}

// ---- the pointer -------------------------------------------------------------------------------

static bool press(struct hg_viewer *v, const SDL_MouseButtonEvent *button)
{
    struct hg_viewer_box box;
    hg_viewer_panel_box(v, &box);
    const SDL_Point at = {button->x, button->y};
    if (!SDL_PointInRect(&at, &box.all))
        return false;
    const int row = at.y < box.y ? -1 : (at.y - box.y) / box.line;
    if (button->button != SDL_BUTTON_LEFT || row < 0 || row >= box.rows)
        return true;
    if (v->panels.open == HG_VIEWER_TREE) {
        const int x = at.x < box.x ? 0 : (at.x - box.x) / box.advance;
        hg_viewer_tree_click(v, x, row, button->clicks == 2);
    } else {
        v->panels.row = (uint32_t)row;
        hg_viewer_clipping_click(v, &box, &at);
    }
    SDL_CaptureMouse(v->panels.slides);
    return true;
}

static bool turn_wheel(struct hg_viewer *v, const SDL_MouseWheelEvent *wheel)
{
    struct hg_viewer_box box;
    SDL_Point at;
    enum { ROWS_PER_STEP = 3 };
    hg_viewer_panel_box(v, &box);
    SDL_GetMouseState(&at.x, &at.y);
    if (!SDL_PointInRect(&at, &box.all))
        return false;
    if (v->panels.open == HG_VIEWER_TREE)
        hg_tree_scroll(&v->panels.tree, -(int64_t)wheel->y * ROWS_PER_STEP, (uint32_t)box.rows);
    return true;
}

bool hg_viewer_panel_pointer(struct hg_viewer *v, const SDL_Event *event)
{
    struct hg_viewer_box box;
    bool taken = false;
    if (v->panels.open == HG_VIEWER_NO_PANEL || v->status.state != HG_VIEW_OPEN)
        return false;
    if (event->type == SDL_MOUSEMOTION && v->panels.slides) {
        hg_viewer_panel_box(v, &box);
        hg_viewer_clipping_slide(v, &box, event->motion.x);
        taken = true;
    } else if (event->type == SDL_MOUSEBUTTONUP && v->panels.slides) {
        v->panels.slides = false;
        SDL_CaptureMouse(SDL_FALSE);
        taken = true;
    } else if (event->type == SDL_MOUSEBUTTONDOWN) {
        taken = press(v, &event->button);
    } else if (event->type == SDL_MOUSEWHEEL) {
        taken = turn_wheel(v, &event->wheel);
    }
    v->dirty |= taken;
    return taken;
}

// ---- drawing and leaving -----------------------------------------------------------------------

void hg_viewer_draw_panel(struct hg_viewer *v)
{
    struct hg_viewer_box box;
    char title[40 + HG_TREE_FILTER_BYTES];
    const struct hg_viewer_panels *p = &v->panels;
    hg_viewer_panel_box(v, &box);
    if (p->open == HG_VIEWER_NO_PANEL || v->status.state != HG_VIEW_OPEN || !box.rows || v->help)
        return;
    if (p->open == HG_VIEWER_CLIPPING)
        snprintf(title, sizeof title, "Clipping planes");
    else if (p->searches || p->tree.filter[0])
        snprintf(title, sizeof title, "Search: %s%s  %u found", p->tree.filter,
            p->searches ? "_" : "", p->tree.filter[0] ? p->tree.matches : p->tree.count);
    else if (p->tree.count < p->tree.total)
        snprintf(title, sizeof title, "Nodes: the first %u of %u", p->tree.count, p->tree.total);
    else
        snprintf(title, sizeof title, "Nodes: %u", p->tree.count);
    hg_overlay_box(&v->overlay, &box.all);
    hg_overlay_put(&v->overlay, HG_OVERLAY_DIM, title, box.columns,
        &(SDL_Point){box.x, box.y - TITLE_ROWS * box.line});
    if (p->open == HG_VIEWER_TREE)
        hg_viewer_draw_tree(v, &box);
    else
        hg_viewer_draw_cuts(v, &box);
}

bool hg_viewer_escape(struct hg_viewer *v)
{
    struct hg_viewer_panels *p = &v->panels;
    if (p->measures)
        hg_viewer_switch_measure(v);
    else if (p->open == HG_VIEWER_TREE && p->tree.filter[0])
        hg_tree_set_filter(&p->tree, "");
    else if (p->open != HG_VIEWER_NO_PANEL)
        hg_viewer_switch_panel(v, p->open);
    else if (p->tree.selected && v->status.state == HG_VIEW_OPEN)
        hg_viewer_select(v, 0);
    else
        return false;
    return true;
}
