// session_look.h - how a viewer's view alone shows the scene. Floor 6 (client). Thread: the
// session's.
#ifndef HG_CLIENT_VIEW_SESSION_LOOK_H
#define HG_CLIENT_VIEW_SESSION_LOOK_H

#include "client/view/session_state.h"

// The view outlines this node; 0: none.
enum hg_status hg_view_look_select(struct hg_view_session *s, uint64_t node, struct hg_error *err);
// The view leaves a node out, with what is below it, or shows one again that it left out.
// HG_E_LIMIT: too many; HG_E_PERM: the scene hides it; what the server says. On failure nothing has
// changed.
enum hg_status hg_view_look_hide(
    struct hg_view_session *s, uint64_t node, bool hidden, struct hg_error *err);
// name: of a variant of the asset; "": the file's own materials.
enum hg_status hg_view_look_variant(
    struct hg_view_session *s, uint32_t asset, const char *name, struct hg_error *err);
// Nodes of a new list that this view leaves out are not visible.
void hg_view_look_mark(const struct hg_view_look *look, struct hg_tree *tree);

#endif
