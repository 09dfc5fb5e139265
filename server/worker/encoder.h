// encoder.h - encodings of frames behind one interface.
// Floor 6, private to server/worker. Thread: any, but one at a time for each state.
#ifndef HG_SERVER_WORKER_ENCODER_H
#define HG_SERVER_WORKER_ENCODER_H

#include "base/bytes.h"
#include "server/worker/encode_request.h"

// One encoding. A view that uses it opens a state with its first frame and closes it when the view
// goes, or when its frames change size: what an encoder needs to know of the frames before (video)
// is kept there. Encoders without state leave open and close NULL and get NULL.
struct encoder_ops {
    const char *name;
    enum hg_pixel_format pixels; // what it begins from
    bool lossless;               // decoded pixels are those it began from
    // `first`: the request that is encoded next, borrowed for the call.
    enum hg_status (*open)(const struct encode_request *first, void **state, struct hg_error *err);
    // The bytes of frame.data to `out`; none: the pixels are sent as they are.
    enum hg_status (*encode)(void *state, const struct encode_request *request,
        struct hg_writer *out, struct hg_error *err);
    void (*close)(void *state);
};

enum { ENCODER_COUNT = HGP_encoding_EXR_FLOAT + 1 }; // values of enum hgp_encoding

// The encoder of an encoding below ENCODER_COUNT; the protocol knows no other.
typedef const struct encoder_ops *encoder_find_fn(enum hgp_encoding encoding);
const struct encoder_ops *hg_encoder_find(enum hgp_encoding encoding);

#endif
