// tree.h - the nodes of a scene as a tree of which some are unfolded: the rows that are seen of it,
// what is selected, and where the list is scrolled to. Floor 6 (client). Pure but for the heap; one
// thread at a time. What the server lists is not trusted: unknown parents make roots, cycles are
// left out.
#ifndef HG_CLIENT_VIEW_TREE_H
#define HG_CLIENT_VIEW_TREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"
#include "protocol/hgp.h"

#define HG_TREE_NONE      UINT32_MAX // no node, no row
#define HG_TREE_NODES_MAX 200000     // more are not listed; `total` says how many there are

enum { HG_TREE_FILTER_BYTES = 64 };

enum hg_tree_kind { HG_TREE_GROUP, HG_TREE_MESH, HG_TREE_LIGHT, HG_TREE_CAMERA };

struct hg_tree_node {
    uint64_t id, parent_id;       // of the protocol; parent 0 = root
    uint32_t parent, first, next; // nodes by index: the parent, its first child, the next sibling
    uint32_t name;                // where it begins in `names`
    enum hg_tree_kind kind;
    bool visible, open; // its own flag; unfolded
    bool found;         // with a filter: it, or one below it, matches
};

struct hg_tree_row {
    uint32_t node, depth;
};

struct hg_tree_place {
    uint64_t id;
    uint32_t node;
};

struct hg_tree {
    struct hg_tree_node *nodes;
    size_t capacity, name_bytes, name_capacity;
    char *names;                  // terminated, control bytes replaced
    struct hg_tree_place *places; // of all nodes, by id
    struct hg_tree_row *rows;     // what is unfolded, or found, from the top
    uint32_t count, row_count, roots;
    char filter[HG_TREE_FILTER_BYTES]; // "" = none
    uint32_t matches;                  // nodes whose names have it
    uint32_t total;                    // nodes of the scene, listed or not
    uint64_t revision;                 // of the scene that was listed
    uint64_t selected;                 // id, 0 = none; it may be folded away or not be listed
    uint32_t top;                      // the first row in sight
};

// Making a tree: zeroed, add in the order of the list, then link. HG_E_NOMEM leaves it valid.
enum hg_status hg_tree_add(
    struct hg_tree *t, const struct hgp_node_entry *entry, struct hg_error *err) HG_MUST_CHECK;
// Also unfolds chains of single nodes, so that the first look shows more than one name.
enum hg_status hg_tree_link(struct hg_tree *t, struct hg_error *err) HG_MUST_CHECK;
// Filters, unfolds, selects and scrolls as in `before`, an older list of the scene (linked or
// zeroed).
void hg_tree_carry(struct hg_tree *t, const struct hg_tree *before);
void hg_tree_finish(struct hg_tree *t); // accepts a zeroed one

// Index of a node by its id; HG_TREE_NONE: it is not listed.
uint32_t hg_tree_find(const struct hg_tree *t, uint64_t id);
const char *hg_tree_name(const struct hg_tree *t, uint32_t node);
// The row of a node's id; HG_TREE_NONE: it is folded away or not listed.
uint32_t hg_tree_row_of(const struct hg_tree *t, uint64_t id);
// A node above it, or itself, is not visible.
bool hg_tree_is_hidden(const struct hg_tree *t, uint32_t node);

// Rows are those whose names have `text` in them (cut to HG_TREE_FILTER_BYTES; ASCII letters of
// either case), and what is above them; "": what is unfolded.
void hg_tree_set_filter(struct hg_tree *t, const char *text);
void hg_tree_set_open(struct hg_tree *t, uint32_t node, bool open);
// Selects a node, unfolds what is above it and scrolls there; `height` is that of the list in rows.
void hg_tree_reveal(struct hg_tree *t, uint64_t id, uint32_t height);
// Selects the row that is `rows` further down (negative: up), the first or last one at most;
// nothing selected: from before the first. Scrolls there. False: there are no rows.
bool hg_tree_move(struct hg_tree *t, int64_t rows, uint32_t height);
void hg_tree_scroll(struct hg_tree *t, int64_t rows, uint32_t height);

#endif
