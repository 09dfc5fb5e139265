// tree.c - the nodes of a scene as a tree that is folded and scrolled.
#include "client/view/tree.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

// ---- making ------------------------------------------------------------------------------------

static enum hg_status add_name(
    struct hg_tree *t, const char *name, size_t size, uint32_t *at, struct hg_error *err)
{
    if (hg_grow(&t->names, &t->name_capacity, t->name_bytes + size + 1, 1))
        return hg_error_set(err, HG_E_NOMEM, "scene tree", NULL, "no memory for names");
    *at = (uint32_t)t->name_bytes;
    for (size_t i = 0; i < size; i++) {
        const unsigned char c = (unsigned char)name[i];
        t->names[t->name_bytes + i] = (char)(c < 32 || c == 127 ? '?' : c);
    }
    t->name_bytes += size + 1;
    t->names[t->name_bytes - 1] = 0;
    return HG_OK;
}

enum hg_status hg_tree_add(
    struct hg_tree *t, const struct hgp_node_entry *entry, struct hg_error *err)
{
    char number[32];
    uint32_t name = 0;
    snprintf(number, sizeof number, "node %" PRIu32, (uint32_t)entry->node);
    const bool named = entry->name.size > 0;
    enum hg_status status = add_name(t, named ? entry->name.data : number,
        named ? entry->name.size : strlen(number), &name, err);
    if (status)
        return status;
    if (hg_grow(&t->nodes, &t->capacity, (size_t)t->count + 1, sizeof *t->nodes))
        return hg_error_set(err, HG_E_NOMEM, "scene tree", NULL, "no memory for nodes");
    t->nodes[t->count++] = (struct hg_tree_node){.id = entry->node,
        .parent_id = entry->parent,
        .parent = HG_TREE_NONE,
        .first = HG_TREE_NONE,
        .next = HG_TREE_NONE,
        .name = name,
        .kind = entry->camera  ? HG_TREE_CAMERA
                : entry->light ? HG_TREE_LIGHT
                : entry->mesh  ? HG_TREE_MESH
                               : HG_TREE_GROUP,
        .visible = entry->visible};
    return HG_OK;
}

static int by_id(const void *a, const void *b)
{
    const struct hg_tree_place *x = a, *y = b;
    return (x->id > y->id) - (x->id < y->id);
}

uint32_t hg_tree_find(const struct hg_tree *t, uint64_t id)
{
    const struct hg_tree_place key = {.id = id};
    const struct hg_tree_place *found =
        t->places && t->count ? bsearch(&key, t->places, t->count, sizeof key, by_id) : NULL;
    return found ? found->node : HG_TREE_NONE;
}

// From the last to the first, each before its next sibling: children keep the order of the list.
static void link_parents(struct hg_tree *t)
{
    t->roots = HG_TREE_NONE;
    for (uint32_t i = t->count; i-- > 0;) {
        struct hg_tree_node *node = &t->nodes[i];
        node->parent = node->parent_id ? hg_tree_find(t, node->parent_id) : HG_TREE_NONE;
        if (node->parent == i)
            node->parent = HG_TREE_NONE;
        uint32_t *list = node->parent == HG_TREE_NONE ? &t->roots : &t->nodes[node->parent].first;
        node->next = *list;
        *list = i;
    }
}

// Nodes of a cycle are below no root, and are not reached.
static void flatten(struct hg_tree *t)
{
    uint32_t at = t->roots, depth = 0;
    t->row_count = 0;
    while (at != HG_TREE_NONE) {
        const struct hg_tree_node *node = &t->nodes[at];
        const bool filters = t->filter[0], listed = !filters || node->found;
        if (listed)
            t->rows[t->row_count++] = (struct hg_tree_row){at, depth};
        if (listed && (filters || node->open) && node->first != HG_TREE_NONE) {
            at = node->first;
            depth++;
            continue;
        }
        while (at != HG_TREE_NONE && t->nodes[at].next == HG_TREE_NONE) {
            at = t->nodes[at].parent;
            depth--;
        }
        at = at == HG_TREE_NONE ? at : t->nodes[at].next;
    }
}

// What matches, and what is above it; a cycle ends where it was found already.
static void find_names(struct hg_tree *t)
{
    t->matches = 0;
    for (uint32_t i = 0; i < t->count; i++)
        t->nodes[i].found = false;
    for (uint32_t i = 0; t->filter[0] && i < t->count; i++) {
        if (!strcasestr(hg_tree_name(t, i), t->filter))
            continue;
        t->matches++;
        for (uint32_t n = i; n != HG_TREE_NONE && !t->nodes[n].found; n = t->nodes[n].parent)
            t->nodes[n].found = true;
    }
}

enum hg_status hg_tree_link(struct hg_tree *t, struct hg_error *err)
{
    t->places = hg_calloc(t->count, sizeof *t->places);
    t->rows = hg_calloc(t->count, sizeof *t->rows);
    if (!t->places || !t->rows) {
        t->count = 0;
        return hg_error_set(err, HG_E_NOMEM, "scene tree", NULL, "no memory for rows");
    }
    for (uint32_t i = 0; i < t->count; i++)
        t->places[i] = (struct hg_tree_place){t->nodes[i].id, i};
    qsort(t->places, t->count, sizeof *t->places, by_id);
    link_parents(t);
    uint32_t only = t->roots;
    while (only != HG_TREE_NONE && t->nodes[only].next == HG_TREE_NONE) {
        t->nodes[only].open = true;
        only = t->nodes[only].first;
    }
    flatten(t);
    return HG_OK;
}

void hg_tree_carry(struct hg_tree *t, const struct hg_tree *before)
{
    t->selected = before->selected;
    t->top = before->top;
    memcpy(t->filter, before->filter, sizeof t->filter);
    find_names(t);
    for (uint32_t i = 0; i < before->count; i++) {
        const uint32_t node = hg_tree_find(t, before->nodes[i].id);
        if (node != HG_TREE_NONE)
            t->nodes[node].open = before->nodes[i].open;
    }
    if (t->count)
        flatten(t);
    if (t->top >= t->row_count)
        t->top = t->row_count ? t->row_count - 1 : 0;
}

void hg_tree_finish(struct hg_tree *t)
{
    hg_free(t->nodes);
    hg_free(t->names);
    hg_free(t->places);
    hg_free(t->rows);
    *t = (struct hg_tree){0};
}

// ---- looking -----------------------------------------------------------------------------------

const char *hg_tree_name(const struct hg_tree *t, uint32_t node)
{
    return &t->names[t->nodes[node].name];
}

uint32_t hg_tree_row_of(const struct hg_tree *t, uint64_t id)
{
    const uint32_t node = hg_tree_find(t, id);
    for (uint32_t i = 0; node != HG_TREE_NONE && i < t->row_count; i++)
        if (t->rows[i].node == node)
            return i;
    return HG_TREE_NONE;
}

bool hg_tree_is_hidden(const struct hg_tree *t, uint32_t node)
{
    for (uint32_t i = 0; node != HG_TREE_NONE && i < t->count; i++) { // a cycle ends, too
        if (!t->nodes[node].visible)
            return true;
        node = t->nodes[node].parent;
    }
    return false;
}

// ---- folding, selecting, scrolling -------------------------------------------------------------

void hg_tree_scroll(struct hg_tree *t, int64_t rows, uint32_t height)
{
    const int64_t last = t->row_count > height ? (int64_t)t->row_count - height : 0;
    const int64_t top = (int64_t)t->top + rows;
    t->top = (uint32_t)(top < 0 ? 0 : top > last ? last : top);
}

static void show_row(struct hg_tree *t, uint32_t row, uint32_t height)
{
    if (row < t->top)
        t->top = row;
    else if (height && row >= t->top + height)
        t->top = row - height + 1;
}

void hg_tree_set_filter(struct hg_tree *t, const char *text)
{
    snprintf(t->filter, sizeof t->filter, "%s", text);
    find_names(t);
    t->top = 0;
    if (t->count)
        flatten(t);
}

void hg_tree_set_open(struct hg_tree *t, uint32_t node, bool open)
{
    t->nodes[node].open = open;
    flatten(t);
}

void hg_tree_reveal(struct hg_tree *t, uint64_t id, uint32_t height)
{
    t->selected = id;
    uint32_t node = hg_tree_find(t, id);
    if (node == HG_TREE_NONE)
        return;
    node = t->nodes[node].parent;
    for (uint32_t i = 0; node != HG_TREE_NONE && i < t->count; i++) {
        t->nodes[node].open = true;
        node = t->nodes[node].parent;
    }
    flatten(t);
    const uint32_t row = hg_tree_row_of(t, id);
    if (row != HG_TREE_NONE)
        show_row(t, row, height);
}

bool hg_tree_move(struct hg_tree *t, int64_t rows, uint32_t height)
{
    const uint32_t at = hg_tree_row_of(t, t->selected);
    int64_t to = (at == HG_TREE_NONE ? -1 : (int64_t)at) + rows;
    if (!t->row_count)
        return false;
    to = to < 0 ? 0 : to >= t->row_count ? (int64_t)t->row_count - 1 : to;
    t->selected = t->nodes[t->rows[to].node].id;
    show_row(t, (uint32_t)to, height);
    return true;
}
