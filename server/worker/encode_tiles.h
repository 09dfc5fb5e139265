// encode_tiles.h - frames as the tiles that differ from the frame before: TILES and TILES_JPEG.
// Floor 6, private to server/worker. See encoder.h.
//
// The state keeps a reference to the pixels of the newest frame, so that tiles are compared byte by
// byte and without a copy, and which tiles the client has with loss. docs/protocol.md has the
// format. In TILES_JPEG tiles of one colour, and those with alpha, are sent without loss.
#ifndef HG_SERVER_WORKER_ENCODE_TILES_H
#define HG_SERVER_WORKER_ENCODE_TILES_H

#include "server/worker/encode_request.h"

enum { HG_TILE_PX = 64 };

enum hg_status hg_tiles_open(
    const struct encode_request *first, void **state, struct hg_error *err);
enum hg_status hg_tiles_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err); // TILES
enum hg_status hg_tiles_encode_jpeg(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err); // TILES_JPEG
void hg_tiles_close(void *state);

#endif
