#include "server/worker/view/view_look.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/view_look.h"
#include "server/worker/edit/variant.h"

// The protocol's values are the renderer's.
_Static_assert((int)HG_CAPS_NONE == (int)HGP_cap_style_NONE, "cap_style");
_Static_assert(HG_LOOK_ALPHA == 8u, "node_override.set");

static void finish(const struct request *r, struct view_slot *view, enum hg_status status,
    const struct hg_error *err)
{
    if (status) {
        hg_reply_error(r->to, err);
        return;
    }
    view->settings.changed = true;
    hg_request_ok(r);
}

void hg_handle_view_clip(const struct request *r)
{
    static const float cap_color[3] = {0.8f, 0.25f, 0.1f};
    const struct hgp_view_clip *m = &r->message->view_clip;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    struct hg_error err = {0};
    struct hg_clip clip = {.count = m->planes.count,
        .caps = m->has_caps ? (enum hg_cap_style)m->caps : HG_CAPS_MATERIAL,
        .hatch_px = m->has_hatch_px ? m->hatch_px : 8};
    for (uint32_t i = 0; i < m->planes.count && i < HG_CLIP_MOST_PLANES; i++) {
        memcpy(clip.planes[i], m->planes.items[i].normal, sizeof m->planes.items[i].normal);
        clip.planes[i][3] = m->planes.items[i].distance;
    }
    memcpy(clip.cap_color, m->has_cap_color ? m->cap_color : cap_color, sizeof clip.cap_color);
    const enum hg_status status = hg_view_set_clip(view->view, &clip, &err);
    finish(r, view, status, &err);
}

// Nodes have to be there, but for those whose override goes.
static enum hg_status take_items(const struct request *r, const struct hgp_view_overrides *m,
    struct hg_node_look *items, struct hg_error *err)
{
    const struct hg_scene *scene = r->session->scene->scene;
    for (uint32_t i = 0; i < m->overrides.count; i++) {
        const struct hgp_node_override *o = &m->overrides.items[i];
        if (o->set != 0 && !hg_scene_find(scene, HG_OBJECT_NODE, o->node))
            return hg_error_set(err, HG_E_NOTFOUND, "view_overrides", "overrides", "no node %llu",
                (unsigned long long)o->node);
        items[i] = (struct hg_node_look){.node = o->node,
            .set = o->set,
            .hidden = o->hidden,
            .selected = o->selected,
            .alpha = o->alpha};
        memcpy(items[i].tint, o->tint, sizeof items[i].tint);
    }
    return HG_OK;
}

void hg_handle_view_overrides(const struct request *r)
{
    const struct hgp_view_overrides *m = &r->message->view_overrides;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    struct hg_error err = {0};
    struct hg_node_look *items = hg_calloc((size_t)m->overrides.count + 1, sizeof *items);
    enum hg_status status =
        items ? take_items(r, m, items, &err)
              : hg_error_set(&err, HG_E_NOMEM, "view_overrides", NULL, "no memory");
    const struct hg_view_overrides overrides = {.items = items,
        .count = m->overrides.count,
        .clear = m->has_clear && m->clear,
        .select_color = m->has_select_color ? m->select_color : NULL};
    if (!status)
        status = hg_view_set_overrides(view->view, &overrides, &err);
    hg_free(items);
    finish(r, view, status, &err);
}

void hg_handle_view_variant(const struct request *r)
{
    const struct hgp_view_variant *m = &r->message->view_variant;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    const struct hg_asset *asset = hg_scene_find_asset(r->session->scene->scene, m->asset);
    struct hg_error err = {0};
    enum hg_status status = HG_OK;
    char *name =
        m->has_variant ? hg_strndup(m->variant.size ? m->variant.data : "", m->variant.size) : NULL;
    if (m->has_variant && !name)
        status = hg_error_set(&err, HG_E_NOMEM, "view_variant", NULL, "no memory");
    else if (!asset)
        status =
            hg_error_set(&err, HG_E_NOTFOUND, "view_variant", "asset", "no asset %u", m->asset);
    else if (name)
        status = hg_variant_find(asset, m->variant, &(int32_t){0}, &err);
    if (!status)
        status = hg_view_set_variant(view->view, m->asset, name, &err);
    hg_free(name);
    finish(r, view, status, &err);
}
