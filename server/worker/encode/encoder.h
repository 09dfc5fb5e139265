// encoder.h - encodings of frames behind one interface.
// Floor 6, private to server/worker. Thread: any, but one at a time for each state.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODER_H
#define HG_SERVER_WORKER_ENCODE_ENCODER_H

#include "base/bytes.h"
#include "server/worker/encode/encode_request.h"

// One encoding. A view that uses it opens a state with its first frame and closes it when the view
// goes, or when its frames change size: what an encoder needs to know of the frames before (video,
// tiles) is kept there. Encoders without state leave open and close NULL and get NULL.
//
// A request with key_frame set gets a frame that depends on none before it, and so does the first
// one of a state. Quality and bit rate of requests may change from frame to frame.
struct encoder_ops {
    const char *name;
    enum hg_pixel_format pixels; // what it begins from
    bool lossless;               // decoded pixels are those it began from
    // `first`: the request that is encoded next, borrowed for the call.
    enum hg_status (*open)(const struct encode_request *first, void **state, struct hg_error *err);
    // After an error the state is closed.
    enum hg_status (*encode)(void *state, const struct encode_request *request,
        struct encode_output *out, struct hg_error *err);
    void (*close)(void *state);
    bool motion;      // for frames of a view in motion: fast enough, and not a file to keep
    bool alpha;       // keeps it
    uint32_t most_px; // width x height; 0 = as many as a frame may have
    uint32_t shares;  // 1 + the encoding whose state it uses; 0 = its own
};

enum { ENCODER_COUNT = HGP_encoding_TILES_JPEG + 1 }; // values of enum hgp_encoding

// The encoder of an encoding below ENCODER_COUNT; NULL: its library is not in this build.
typedef const struct encoder_ops *encoder_find_fn(enum hgp_encoding encoding);
const struct encoder_ops *hg_encoder_find(enum hgp_encoding encoding);

#endif
