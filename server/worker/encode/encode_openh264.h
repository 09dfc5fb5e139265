// encode_openh264.h - H.264 through OpenH264: High profile, 4:2:0, one thread, no frame held back.
// Floor 6, private to server/worker. See encoder.h.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_OPENH264_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_OPENH264_H

#include "server/worker/encode/encode_request.h"

enum hg_status hg_openh264_open(
    const struct encode_request *first, void **state, struct hg_error *err);
enum hg_status hg_openh264_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err);
void hg_openh264_close(void *state);

#endif
