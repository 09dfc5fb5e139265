// encode_exr.h - EXR frames: the picture, its planes as further parts, and where they come from.
// Floor 6, private to server/worker. Thread: any.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_EXR_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_EXR_H

#include "base/bytes.h"
#include "server/worker/encode/encode_request.h"

// HG_E_LIMIT, HG_E_NOMEM with *err.
enum hg_status hg_encode_exr(const struct encode_request *request, struct hg_writer *out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
