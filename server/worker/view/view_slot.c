#include "server/worker/view/view_slot.h"

#include "base/alloc.h"

struct view_slot *hg_view_slot_find(struct session *session, uint32_t number)
{
    for (struct view_slot *it = session->views; it; it = it->next)
        if (it->number == number)
            return it;
    return NULL;
}

static void free_view(struct view_slot *view)
{
    for (struct frame_wait *next; view->waits; view->waits = next) {
        next = view->waits->next;
        hg_free(view->waits);
    }
    hg_encode_stream_close(view->encoder);
    hg_view_destroy(view->view);
    hg_writer_finish(&view->checkpoint.sending);
    hg_writer_finish(&view->checkpoint.receiving);
    hg_free(view);
}

enum hg_status hg_view_slot_create(struct render_state *s, struct session *session, uint32_t number,
    struct view_slot **out, struct hg_error *err)
{
    *out = NULL;
    enum hg_status status = hg_render_state_need_renderer(s, err);
    if (status)
        return status;
    struct view_slot *view = hg_calloc(1, sizeof *view);
    if (view)
        view->encoder = hg_encode_stream_open(s->w->encoders);
    if (!view || !view->encoder) {
        hg_free(view);
        return hg_error_set(err, HG_E_NOMEM, "view_set", NULL, "no memory for a view");
    }
    status = hg_view_create(s->renderer, session->scene->scene, &view->view, err);
    if (status) {
        free_view(view);
        return status;
    }
    view->number = number;
    view->settings.camera_revision = UINT64_MAX;
#define STANDARD_U8(a, standard)    standard
#define STANDARD_U32(a, standard)   standard
#define STANDARD_F32(a, standard)   standard
#define STANDARD_ENUM(a, standard)  HGP_##a##_##standard
#define STANDARD_BYTES(a, standard) {.announced = -1}
    view->subscription = (struct view_subscription){
#define HGP_VIEW_DELIVERY(kind, field, a, b, standard, doc) .field = STANDARD_##kind(a, standard),
#include "protocol/view_params.def"
    };
    view->subscription.motion = view->subscription.encoding;
    view->next = session->views;
    session->views = view;
    atomic_fetch_add(&s->w->view_count, 1);
    *out = view;
    return HG_OK;
}

void hg_view_slot_destroy(struct render_state *s, struct session *session, struct view_slot *view)
{
    struct view_slot **link = &session->views;
    while (*link != view)
        link = &(*link)->next;
    *link = view->next;
    free_view(view);
    atomic_fetch_sub(&s->w->view_count, 1);
}

bool hg_view_slot_is_stale(const struct session *session, const struct view_slot *view)
{
    return !view->progress.stepped || view->settings.changed ||
           view->progress.info.scene_revision != session->scene->scene->revision;
}

bool hg_view_slot_is_watched(const struct view_slot *view)
{
    return view->subscription.credit > 0 && !view->subscription.hidden;
}
