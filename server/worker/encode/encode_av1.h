// encode_av1.h - AV1 through libaom in its real-time mode: main profile, 4:2:0, one thread, no
// frame held back. docs/decisions/0027 says why not through SVT-AV1.
// Floor 6, private to server/worker. See encoder.h.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_AV1_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_AV1_H

#include "server/worker/encode/encode_request.h"

enum { HG_AV1_MOST_PX = 3840 * 2176 };

enum hg_status hg_av1_open(const struct encode_request *first, void **state, struct hg_error *err);
enum hg_status hg_av1_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err);
void hg_av1_close(void *state);

#endif
