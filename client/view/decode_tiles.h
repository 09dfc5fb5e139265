// decode_tiles.h - frames of tiles: a picture that each frame changes in places. Layout of the
// data: docs/protocol.md, "Tiles". Private to decode*.c. Floor 6 (client).
#ifndef HG_CLIENT_VIEW_DECODE_TILES_H
#define HG_CLIENT_VIEW_DECODE_TILES_H

#include "client/view/decode.h"

struct hg_view_tiles; // the picture as the newest frame left it

// *tiles is made with the first frame; *jpeg as of hg_view_decode_jpeg. `out` has room for the
// frame. HG_E_FORMAT: damaged, or a frame that this one depends on is missing: a key frame is
// needed next.
enum hg_status hg_view_tiles_decode(struct hg_view_tiles **tiles, void **jpeg,
    const struct hgp_frame *frame, struct hg_view_pixels *out, struct hg_error *err) HG_MUST_CHECK;
void hg_view_tiles_destroy(struct hg_view_tiles *tiles); // accepts NULL

#endif
