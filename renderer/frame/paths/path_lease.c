// path_lease.c - see path_lease.h.
#include "renderer/frame/paths/path_lease.h"

#include <string.h>

#include "base/clock.h"
#include "renderer/frame/exposure/meter.h"
#include "renderer/frame/light/gather_view.h"

// Longer than views that have turns are between two steps: one that is not watched any more.
#define LEFT_NS  5000000000u
#define MOVED_NS 1000000000u // who stops and goes on in less keeps its buffers

static bool is_counted(const struct hg_view_state *view)
{
    return !view->final && view->settings.mode != HG_VIEW_MODE_PATH &&
           view->settings.path.planes == 0;
}

// Has begun something for what it shows now.
static bool is_busy(const struct hg_view_state *view)
{
    const struct hg_gather_key key = hg_gather_view_key(view);
    const struct hg_view_gather *g = &view->gi.gather;
    return (g->path != NULL && g->begun && memcmp(&key, &g->key, sizeof key) == 0) ||
           hg_meter_has_begun(view);
}

static void revoke(struct hg_path_lease *lease)
{
    struct hg_view_state *view = lease->view;
    *lease = (struct hg_path_lease){0};
    if (!is_counted(view))
        return;
    hg_path_destroy(view->path);
    view->path = NULL;
    view->exposure.begun = false;
    hg_path_destroy(view->gi.gather.path);
    view->gi.gather.path = NULL;
    view->gi.gather.begun = false;
}

static struct hg_path_lease *find(struct hg_view_state *view, uint64_t now_ns)
{
    struct hg_path_lease *leases = view->scene_gpu->leases, *lost = NULL;
    for (int i = 0; i < HG_PATH_LEASES; i++)
        if (leases[i].view == view)
            return &leases[i];
    for (int i = 0; i < HG_PATH_LEASES; i++)
        if (leases[i].view == NULL)
            return &leases[i];
    for (int i = 0; i < HG_PATH_LEASES && lost == NULL; i++)
        if (!is_busy(leases[i].view) || now_ns - leases[i].used_ns > LEFT_NS)
            lost = &leases[i];
    if (lost != NULL)
        revoke(lost);
    return lost;
}

bool hg_path_lease_take(struct hg_view_state *view)
{
    const uint64_t now_ns = hg_clock_now_ns();
    if (!is_counted(view))
        return true;
    struct hg_path_lease *lease = find(view, now_ns);
    if (lease != NULL)
        *lease = (struct hg_path_lease){view, now_ns};
    view->stats.waits |= lease == NULL;
    return lease != NULL;
}

void hg_path_lease_note_motion(struct hg_view_state *view)
{
    struct hg_path_lease *leases = view->scene_gpu->leases;
    for (int i = 0; i < HG_PATH_LEASES; i++)
        if (leases[i].view == view && hg_clock_now_ns() - leases[i].used_ns > MOVED_NS)
            revoke(&leases[i]);
}

void hg_path_lease_end(struct hg_view_state *view)
{
    for (int i = 0; view->scene_gpu != NULL && i < HG_PATH_LEASES; i++)
        if (view->scene_gpu->leases[i].view == view)
            view->scene_gpu->leases[i] = (struct hg_path_lease){0};
}
