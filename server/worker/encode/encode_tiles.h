// encode_tiles.h - frames as the tiles that differ from the frame before: TILES and TILES_JPEG.
// Floor 6, private to server/worker. See encoder.h.
//
// The state keeps the pixels that the client's tiles were made from, and which of these it has with
// loss. A tile with loss stays while the picture is within one to four levels of them, by its
// contrast and the quality. docs/protocol.md has the format. All tiles of a frame that are sent
// with loss are one JPEG file: a file for each costs more in headers than in pixels. Tiles are its
// blocks: smaller ones would not be cheaper, and larger ones bring pixels that are the same as
// before. In TILES_JPEG those with alpha are sent without loss.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_TILES_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_TILES_H

#include "server/worker/encode/encode_request.h"

enum { HG_TILE_PX = 8 };

enum hg_status hg_tiles_open(
    const struct encode_request *first, void **state, struct hg_error *err);
enum hg_status hg_tiles_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err); // TILES
enum hg_status hg_tiles_encode_jpeg(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err); // TILES_JPEG
void hg_tiles_close(void *state);

#endif
