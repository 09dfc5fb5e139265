// decode_video.h - frames of H.264 (OpenH264's decoder) and AV1 (libaom) to pixels, each out as
// soon as it is in. Private to decode*.c. Floor 6 (client).
#ifndef HG_CLIENT_VIEW_DECODE_VIDEO_H
#define HG_CLIENT_VIEW_DECODE_VIDEO_H

#include "client/view/decode.h"

struct hg_view_video; // a decoder, as the newest frame left it

bool hg_view_video_decodes(enum hgp_encoding encoding); // what was built in
// *video is made with the first frame. `out` has room for the frame. HG_E_FORMAT: damaged, of
// another size, or a frame that this one depends on is missing: a key frame is needed next.
enum hg_status hg_view_video_decode(struct hg_view_video **video, const struct hgp_frame *frame,
    struct hg_view_pixels *out, struct hg_error *err) HG_MUST_CHECK;
void hg_view_video_destroy(struct hg_view_video *video); // accepts NULL

#endif
