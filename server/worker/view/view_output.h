// view_output.h - reads the picture of a view's newest step and passes it to the view's encoders.
// Floor 6, private to server/worker. Thread: the render thread. Renders nothing.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_OUTPUT_H
#define HG_SERVER_WORKER_VIEW_VIEW_OUTPUT_H

#include "server/worker/view/view_slot.h"

// Formats of the pixels that will be read after the next step: 1 << enum hg_pixel_format.
uint32_t hg_output_formats(const struct render_state *s, const struct view_slot *view);
// Sends the newest frame to waiting requests and to the subscription, as far as it is due and the
// view's encode stream has room; otherwise it is retried when there is.
void hg_output_deliver(
    struct render_state *s, struct session *session, struct view_slot *view, uint64_t heard_ns);
// Fails all waiting requests; the view idles until something changes.
void hg_output_fail(struct render_state *s, struct session *session, struct view_slot *view,
    const struct hg_error *err);

#endif
