// viewer_tree.c - the panel of the scene's nodes, and the selection.
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "client/view/viewer.h"

enum { FLAG_COLUMNS = 4, INDENT_COLUMNS = 2, DEEPEST_INDENT = 10, TWIST_COLUMNS = 2 };
static const uint64_t refresh_ns = 1500000000;

// ---- the selection -----------------------------------------------------------------------------

const char *hg_viewer_selected_name(const struct hg_viewer *v)
{
    const uint32_t node = hg_tree_find(&v->panels.tree, v->panels.tree.selected);
    return node == HG_TREE_NONE ? NULL : hg_tree_name(&v->panels.tree, node);
}

static void say_selected(struct hg_viewer *v)
{
    const char *name = hg_viewer_selected_name(v);
    if (v->panels.says_selected && name)
        hg_viewer_say(v, "%s", name);
    v->panels.says_selected &= !name;
}

void hg_viewer_select(struct hg_viewer *v, uint64_t node)
{
    const struct hg_view_request request = {.ask = HG_VIEW_ASK_SELECT, .node = node};
    v->panels.tree.selected = node;
    v->panels.says_selected = false;
    hg_viewer_ask(v, &request);
    v->dirty = true;
}

void hg_viewer_note_picked(struct hg_viewer *v, const struct hg_view_answer *answer)
{
    struct hg_viewer_box box;
    if (!answer->hit && v->panels.tree.selected == 0)
        return;
    hg_viewer_panel_box(v, &box);
    hg_viewer_select(v, answer->hit ? answer->node : 0);
    if (!answer->hit)
        return;
    hg_tree_reveal(&v->panels.tree, answer->node, (uint32_t)box.rows);
    v->panels.says_selected = true;
    say_selected(v);
    hg_viewer_refresh_tree(v);
}

// ---- the list ----------------------------------------------------------------------------------

// Nodes are listed while they are looked at, and when a name is wanted.
void hg_viewer_refresh_tree(struct hg_viewer *v)
{
    struct hg_viewer_panels *p = &v->panels;
    const uint64_t now_ns = hg_clock_now_ns();
    const bool wanted = p->open == HG_VIEWER_TREE || p->says_selected;
    const bool stale = p->tree.count == 0 || v->picture.facts.revision > p->tree.revision;
    if (v->status.state != HG_VIEW_OPEN || !wanted || !stale ||
        (p->listed_ns && now_ns - p->listed_ns < refresh_ns))
        return;
    p->listed_ns = now_ns;
    hg_viewer_ask(v, &(struct hg_view_request){.ask = HG_VIEW_ASK_LIST});
}

void hg_viewer_take_nodes(struct hg_viewer *v)
{
    struct hg_viewer_box box;
    struct hg_tree fresh, *tree = &v->panels.tree;
    if (!hg_view_session_nodes(v->session, &fresh))
        return;
    const bool first = tree->count == 0;
    hg_tree_carry(&fresh, tree);
    hg_tree_finish(tree);
    *tree = fresh;
    hg_viewer_panel_box(v, &box);
    if (first && tree->selected)
        hg_tree_reveal(tree, tree->selected, (uint32_t)box.rows);
    say_selected(v);
}

void hg_viewer_note_visible(struct hg_viewer *v, const struct hg_view_answer *answer)
{
    struct hg_tree *tree = &v->panels.tree;
    const uint32_t node = hg_tree_find(tree, answer->node);
    if (node != HG_TREE_NONE)
        tree->nodes[node].visible = answer->visible;
    if (answer->revision == tree->revision + 1) // what was done here needs no new list
        tree->revision = answer->revision;
}

// ---- keys and pointer --------------------------------------------------------------------------

static void toggle(struct hg_viewer *v, uint32_t node)
{
    const struct hg_tree_node *n = &v->panels.tree.nodes[node];
    hg_viewer_ask(v, &(struct hg_view_request){
                         .ask = HG_VIEW_ASK_VISIBLE, .node = n->id, .visible = !n->visible});
}

// To the right: unfolds, or goes to the first child; to the left: folds, or goes to the parent.
static void fold(struct hg_viewer *v, uint32_t node, bool right, uint32_t height)
{
    struct hg_tree *tree = &v->panels.tree;
    const struct hg_tree_node *n = &tree->nodes[node];
    const bool has = n->first != HG_TREE_NONE;
    if (has && n->open != right)
        hg_tree_set_open(tree, node, right);
    else if (right && has && hg_tree_move(tree, 1, height))
        hg_viewer_select(v, tree->selected);
    else if (!right && n->parent != HG_TREE_NONE) {
        hg_tree_reveal(tree, tree->nodes[n->parent].id, height);
        hg_viewer_select(v, tree->selected);
    }
}

static void show_whole(struct hg_viewer *v, uint32_t node)
{
    hg_viewer_ask(v,
        &(struct hg_view_request){.ask = HG_VIEW_ASK_FIT, .node = v->panels.tree.nodes[node].id});
}

// How many rows a key moves the selection by; 0: it does not.
static int64_t rows_of(SDL_Scancode key, const struct hg_tree *tree, int page)
{
    switch (key) {
    case SDL_SCANCODE_UP:
        return -1;
    case SDL_SCANCODE_DOWN:
        return 1;
    case SDL_SCANCODE_PAGEUP:
        return page > 1 ? 1 - (int64_t)page : -1;
    case SDL_SCANCODE_PAGEDOWN:
        return page > 1 ? page - 1 : 1;
    case SDL_SCANCODE_HOME:
        return -(int64_t)tree->row_count;
    case SDL_SCANCODE_END:
        return (int64_t)tree->row_count + 1;
    default:
        return 0;
    }
}

bool hg_viewer_tree_key(struct hg_viewer *v, SDL_Scancode key, const struct hg_viewer_box *box)
{
    struct hg_tree *tree = &v->panels.tree;
    const int64_t rows = rows_of(key, tree, box->rows);
    const uint32_t node = hg_tree_find(tree, tree->selected);
    if (rows) {
        if (hg_tree_move(tree, rows, (uint32_t)box->rows))
            hg_viewer_select(v, tree->selected);
        return true;
    }
    if (key != SDL_SCANCODE_LEFT && key != SDL_SCANCODE_RIGHT && key != SDL_SCANCODE_SPACE &&
        key != SDL_SCANCODE_RETURN)
        return false;
    if (node == HG_TREE_NONE)
        hg_viewer_say(v, "no node is selected");
    else if (key == SDL_SCANCODE_SPACE)
        toggle(v, node);
    else if (key == SDL_SCANCODE_RETURN)
        show_whole(v, node);
    else
        fold(v, node, key == SDL_SCANCODE_RIGHT, (uint32_t)box->rows);
    return true;
}

static int indent_of(uint32_t depth)
{
    return INDENT_COLUMNS * (int)(depth > DEEPEST_INDENT ? DEEPEST_INDENT : depth);
}

void hg_viewer_tree_click(struct hg_viewer *v, int x, int y, bool twice)
{
    struct hg_tree *tree = &v->panels.tree;
    const uint32_t row = tree->top + (uint32_t)y;
    if (row >= tree->row_count)
        return;
    const struct hg_tree_row *r = &tree->rows[row];
    const struct hg_tree_node *node = &tree->nodes[r->node];
    const int twist = FLAG_COLUMNS + indent_of(r->depth);
    if (x < FLAG_COLUMNS)
        toggle(v, r->node);
    else if (x >= twist && x < twist + TWIST_COLUMNS && node->first != HG_TREE_NONE)
        hg_tree_set_open(tree, r->node, !node->open);
    else if (twice)
        show_whole(v, r->node);
    else
        hg_viewer_select(v, node->id);
}

// ---- drawing -----------------------------------------------------------------------------------

static void draw_row(struct hg_viewer *v, const struct hg_viewer_box *box, int line, uint32_t row)
{
    const struct hg_tree *tree = &v->panels.tree;
    const struct hg_tree_row *r = &tree->rows[row];
    const struct hg_tree_node *node = &tree->nodes[r->node];
    const char twist = node->first == HG_TREE_NONE ? ' ' : node->open ? '-' : '+';
    const char *kind = node->kind == HG_TREE_CAMERA  ? " (camera)"
                       : node->kind == HG_TREE_LIGHT ? " (light)"
                                                     : "";
    char text[HG_OVERLAY_LINE_BYTES];
    const int y = box->y + line * box->line;
    snprintf(text, sizeof text, "%s %*s%c %.160s%s", node->visible ? "[x]" : "[ ]",
        indent_of(r->depth), "", twist, hg_tree_name(tree, r->node), kind);
    if (node->id == tree->selected) {
        SDL_SetRenderDrawColor(v->renderer, 150, 75, 15, 255);
        SDL_RenderFillRect(
            v->renderer, &(SDL_Rect){box->x - 2, y, box->columns * box->advance + 4, box->line});
    }
    hg_overlay_put(&v->overlay,
        hg_tree_is_hidden(tree, r->node) ? HG_OVERLAY_DIM : HG_OVERLAY_PLAIN, text, box->columns,
        &(SDL_Point){box->x, y});
}

void hg_viewer_draw_tree(struct hg_viewer *v, const struct hg_viewer_box *box)
{
    struct hg_tree *tree = &v->panels.tree;
    hg_tree_scroll(tree, 0, (uint32_t)box->rows); // the window or the list may have shrunk
    for (int i = 0; i < box->rows && tree->top + (uint32_t)i < tree->row_count; i++)
        draw_row(v, box, i, tree->top + (uint32_t)i);
}
