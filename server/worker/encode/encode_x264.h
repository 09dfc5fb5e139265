// encode_x264.h - H.264 through x264, 4:2:0 and 4:4:4; built in with HELIO_X264, as its licence is
// the GPL. One thread, no frame held back.
// Floor 6, private to server/worker. See encoder.h.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_X264_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_X264_H

#include "server/worker/encode/encode_request.h"

// The first request's encoding says whether chroma is subsampled.
enum hg_status hg_x264_open(const struct encode_request *first, void **state, struct hg_error *err);
enum hg_status hg_x264_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err);
void hg_x264_close(void *state);

#endif
