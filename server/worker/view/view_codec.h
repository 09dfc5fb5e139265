// view_codec.h - which encoding frames of a view in motion have: negotiation of codecs.
// Floor 6, private to server/worker. Thread: the render thread.
//
// A client lists what it can decode, the best first (view_set's codecs). The first one that this
// build has, that takes frames of the view's size, that the client has not refused since
// (key_frame), that has not failed here and holds target_fps is used. One that does not is tried
// again after some seconds, longer each time, and when the view has another size. Where the view
// has alpha, encodings that keep it come first; where the network takes other frames in poor
// quality only, video does, until it takes twice as much.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_CODEC_H
#define HG_SERVER_WORKER_VIEW_VIEW_CODEC_H

#include "server/worker/view/view_slot.h"

// Takes over the list; what the client has refused counts no more.
void hg_codec_set_list(struct view_slot *view, struct hgp_bytes codecs);
// The view has another size.
void hg_codec_resized(struct view_slot *view);
void hg_codec_refuse(struct view_slot *view, uint8_t encoding);

// Chooses again, after any of what it depends on has changed.
void hg_codec_choose(const struct render_state *s, struct view_slot *view);
// Sends view_codec if the choice is another than the client knows of. Views without a list: never.
void hg_codec_tell(
    const struct render_state *s, const struct session *session, struct view_slot *view);

// HG_E_UNSUPPORTED: this build lacks the encoder of an encoding that the message asks for.
enum hg_status hg_codec_check(const struct render_state *s, enum hgp_encoding encoding,
    const char *what, struct hg_error *err) HG_MUST_CHECK;

#endif
