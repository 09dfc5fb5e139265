// decode.h - a frame's data to pixels: raw, zstd and JPEG, tiles and video. Other encodings are
// files for people or for compositing, which a viewer does not ask for. Floor 6 (client). Thread:
// one at a time per decoder. What comes from the server is not trusted: sizes are checked before
// memory is taken.
#ifndef HG_CLIENT_VIEW_DECODE_H
#define HG_CLIENT_VIEW_DECODE_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"
#include "protocol/hgp.h"

// Pixels of a picture, which its owner keeps for the next one.
struct hg_view_pixels {
    uint8_t *data;   // RGBA, 8 bit, rows from the top, no padding; heap
    size_t capacity; // bytes
    uint32_t width, height;
};

struct hg_view_decoder {
    void *jpeg;                  // of libturbojpeg; NULL until the first JPEG
    void *zstd;                  // ZSTD_DCtx; NULL until the first zstd frame
    struct hg_view_tiles *tiles; // NULL until the first of these
    struct hg_view_video *video;
};

// Encodings of frames in motion that this build decodes, the best first: view_set's codecs.
enum { HG_VIEW_CODECS_MAX = 8 };
size_t hg_view_codecs(uint8_t out[HG_VIEW_CODECS_MAX]);
// Whether frames change what those before them left: all have to be decoded, in order.
bool hg_view_is_stream(enum hgp_encoding encoding);

// Replaces the pixels. HG_E_UNSUPPORTED: an encoding that is not shown; HG_E_FORMAT: damaged, of
// another size than the frame says, or without one that it depends on; HG_E_NOMEM. On failure `out`
// keeps a valid state, without a picture (width 0).
enum hg_status hg_view_decode(struct hg_view_decoder *d, const struct hgp_frame *frame,
    struct hg_view_pixels *out, struct hg_error *err) HG_MUST_CHECK;
void hg_view_decoder_finish(struct hg_view_decoder *d); // accepts a zeroed one
void hg_view_pixels_finish(struct hg_view_pixels *pixels);

#endif
