// frame_planes.h - planes of the protocol and of the renderer.
// Floor 6, private to server/worker. Pure; safe from any thread.
#ifndef HG_SERVER_WORKER_ENCODE_FRAME_PLANES_H
#define HG_SERVER_WORKER_ENCODE_FRAME_PLANES_H

#include "renderer/renderer.h"

// Planes of the protocol (bits of enum hgp_plane) to those of the renderer and bits of enum
// hg_matte_kind. HG_E_UNSUPPORTED names one that there is not; both stay as they were then.
enum hg_status hg_frame_planes_decode(
    uint32_t bits, uint32_t *planes, uint32_t *mattes, struct hg_error *err) HG_MUST_CHECK;

#endif
