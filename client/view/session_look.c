// session_look.c - how this view alone shows the scene: what is selected and hidden, and variants.
// Who may edit hides nodes and chooses variants in the scene, for all (session_requests.c).
#include "client/view/session_look.h"

enum { HIDDEN = 1, SELECTED = 4 }; // properties of a node_override

static size_t find_hidden(const struct hg_view_look *look, uint64_t node)
{
    size_t i = 0;
    while (i < look->hidden_count && look->hidden[i] != node)
        i++;
    return i;
}

static struct hgp_node_override override_of(const struct hg_view_look *look, uint64_t node)
{
    const bool hidden = find_hidden(look, node) < look->hidden_count;
    const bool selected = node == look->selected;
    return (struct hgp_node_override){.node = node,
        .set = (hidden ? HIDDEN : 0u) | (selected ? SELECTED : 0u),
        .hidden = hidden,
        .selected = selected,
        .alpha = 1};
}

// All of them, in place of those before.
static void list_overrides(const struct hg_view_look *look, struct hgp_view_overrides *out,
    struct hgp_node_override items[HG_VIEW_HIDDEN_MAX + 1])
{
    uint32_t count = 0;
    for (size_t i = 0; i < look->hidden_count; i++)
        items[count++] = override_of(look, look->hidden[i]);
    if (look->selected && find_hidden(look, look->selected) == look->hidden_count)
        items[count++] = override_of(look, look->selected);
    *out = (struct hgp_view_overrides){
        .view = HG_CLI_VIEW, .overrides = {items, count}, .has_clear = true, .clear = true};
}

enum hg_status hg_view_look_select(struct hg_view_session *s, uint64_t node, struct hg_error *err)
{
    struct hgp_node_override items[HG_VIEW_HIDDEN_MAX + 1];
    struct hgp_view_overrides all;
    s->work.look.selected = node;
    list_overrides(&s->work.look, &all, items);
    return hg_view_send(s, HGP_T_view_overrides, &all, err);
}

enum hg_status hg_view_look_hide(
    struct hg_view_session *s, uint64_t node, bool hidden, struct hg_error *err)
{
    struct hgp_node_override items[HG_VIEW_HIDDEN_MAX + 1];
    struct hg_view_look changed = s->work.look;
    struct hgp_view_overrides all;
    struct helio_message *m;
    const size_t at = find_hidden(&changed, node);
    if (hidden && at == HG_VIEW_HIDDEN_MAX)
        return hg_error_set(err, HG_E_LIMIT, "nodes", NULL,
            "a session that may look alone hides at most %d nodes", HG_VIEW_HIDDEN_MAX);
    if (!hidden && at == changed.hidden_count)
        return hg_error_set(err, HG_E_PERM, "nodes", NULL,
            "the scene hides it; this session may look, not change the scene");
    if (hidden && at == changed.hidden_count)
        changed.hidden[changed.hidden_count++] = node;
    else if (!hidden)
        changed.hidden[at] = changed.hidden[--changed.hidden_count];
    list_overrides(&changed, &all, items);
    enum hg_status status =
        helio_call_for(s->work.render.cli.h, HGP_T_view_overrides, &all, HGP_T_ok, &m, err);
    if (status)
        return status;
    helio_message_free(m);
    s->work.look = changed;
    return HG_OK;
}

enum hg_status hg_view_look_variant(
    struct hg_view_session *s, uint32_t asset, const char *name, struct hg_error *err)
{
    const struct hgp_view_variant variant = {
        .view = HG_CLI_VIEW, .asset = asset, .has_variant = true, .variant = hgp_str_make(name)};
    return hg_view_send(s, HGP_T_view_variant, &variant, err);
}

void hg_view_look_mark(const struct hg_view_look *look, struct hg_tree *tree)
{
    for (size_t i = 0; i < look->hidden_count; i++) {
        const uint32_t node = hg_tree_find(tree, look->hidden[i]);
        if (node != HG_TREE_NONE)
            tree->nodes[node].visible = false;
    }
}
